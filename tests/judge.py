"""A judge of its own: the answer of docs/concepts.md, written from that page alone, in plain loops.

It runs the scene once more with later ends to see what happens after a cut. Nothing of the package's own judgement is
used: no components, units, outcomes or end times of it.
"""

import math
from collections import namedtuple
from itertools import zip_longest

from judged_rows import closing, count, due, parting, rows_of, stuck_apart

import granular as gr
from granular.scene import speed_scale

Judgement = namedtuple("Judgement", "answer error components")
SAME, ROUNDING, FOLLOWED = 0.01, 1e-12, 20.0
WORST = ["no", "not_unique", "not_ball_by_ball", "undecided", "yes"]
MOST = 200_000
"""Collisions that are waited for: balls that ride on a driven floor at an ε near 1 have millions."""
EARLY = {"max_events", "max_steps", "unstable", "broken"}


class Judge:
    """One scene, its laws and its end."""

    def __init__(self, scene, laws, rule, t_end, ties="left"):
        self.scene, self.laws, self.rule, self.t_end, self.ties = scene, laws, rule, t_end, ties
        self.known = {}
        self.n, self.walls = scene.n, [math.isinf(m) for m in scene.mass]
        self.hard = self.collide(scene, t_end)
        self.carried = self.merging(self.hard, t_end)
        self.soft = gr.md.simulate(scene, laws, t_end=t_end)

    def collide(self, scene, t_end, **options):
        return gr.edmd.simulate(scene, self.rule, t_end=t_end, **{"ties": self.ties, "max_events": MOST} | options)

    def merging(self, run, t_end, **options):
        """A hard run; after a collapse those that collide ever more slowly stick."""
        if run.status.name not in ("collapse", "bounded"):
            return run if t_end == self.t_end else self.collide(run.scene, t_end, **options)
        slow = 1e-9 * max(closing(row) for row in rows_of(run))
        return self.collide(run.scene, t_end, collapse="merge", merge_below=slow, **options)

    def bodies(self, pair):
        return pair, (pair + 1) % self.n

    def lasting(self, pair, speed):
        """Duration of an isolated contact; 0 if it has none that ends."""
        if (pair, speed) not in self.known:
            try:
                slowest = max(2.0**-30 * speed_scale(self.scene), 1e-30)
                contact = gr.binary.collision(self.laws[pair], self.scene.pairs[pair], max(speed, slowest))
                self.known[pair, speed] = contact.duration
            except (ValueError, ArithmeticError):
                self.known[pair, speed] = 0.0
        return self.known[pair, speed]

    def strength(self, row):
        return max(closing(row), row.impulse / self.scene.pairs[row.pair].m_eff)

    def instants(self, rows):
        """Collisions of a pair in one instant are one; at its end the instant is over."""
        final, kept, of, before = {}, {}, [], 0.0
        for row in rows:
            of.append(of[-1] + (row.begin - before > ROUNDING * row.begin) if of else 0)
            before = row.begin
            for body, v in zip(self.bodies(row.pair), row.after, strict=True):
                final[body, of[-1]] = v
        for row, k in zip(rows, of, strict=True):
            after = tuple(final[body, k] for body in self.bodies(row.pair))
            kept.setdefault((row.pair, k), row._replace(after=after))
        return list(kept.values())

    def groups(self, *logs):
        """Component of every pair that has a contact."""
        met = sorted({row.pair for rows in logs for row in rows})
        of = {c: c for c in met}
        for c in met:
            shared = self.bodies(c)[1]
            if (c + 1) % self.n in of and not self.walls[shared] and c + 1 <= len(self.scene.gap):
                other = (c + 1) % self.n
                old, new = of[other], of[c]
                of = {k: new if v == old else v for k, v in of.items()}
        return of

    def without_rounding(self, *logs, beside=None):
        of = self.groups(*(beside or logs))
        fastest = {}
        for row in (row for rows in (beside or logs) for row in rows):
            fastest[of[row.pair]] = max(fastest.get(of[row.pair], 0.0), closing(row))
        return [[r for r in rows if self.strength(r) > ROUNDING * fastest.get(of.get(r.pair), 0.0)] for rows in logs]

    # the end

    def level(self):
        """The first n contacts of every pair in both runs, each followed to its end."""
        hard, soft = self.without_rounding(self.instants(rows_of(self.carried)), rows_of(self.soft))
        most = {c: max(count(hard, c), count(soft, c)) for c in range(len(self.scene.gap))}
        of, way = self.groups(hard, soft), {}
        for c, k in of.items():
            mine = [[r for r in rows if of[r.pair] == k] for rows in (hard, soft)]
            delay = sum(self.lasting(r.pair, float(f"{closing(r):.2g}")) for r in mine[0])
            delay += sum(r.end - r.begin for r in mine[1] if not math.isnan(r.end))
            way[c] = delay * max(closing(r) for rows in mine for r in rows)
        latest_hard = self.latest(hard, soft, most, way, float(self.carried.time[-1]))
        end = float(self.carried.time[-1])
        latest_hard |= {r.pair: end for r in soft if r.begin == 0.0 and not count(hard, r.pair)}
        latest_hard |= {c: end for c in of if self.sticks(hard, c) and self.lower(hard, soft, c, of)}
        latest_soft = self.latest(soft, hard, most, way, float(self.soft.time[-1]))
        lower = {c for c in of if self.lower(soft, hard, c, of)}
        hard = self.later(hard, latest_hard, self.carried.status.name)
        soft = self.followed(soft, latest_soft, most, lower)
        hard, soft = self.without_rounding(hard, soft)
        return due(hard, latest_hard, most), due(soft, latest_soft, most)

    def latest(self, rows, others, most, way, end):
        found = {}
        for c in most:
            found[c] = end
            if count(rows, c) < most[c]:
                speed = abs(closing([r for r in others if r.pair == c][-1]))
                span = self.soft.time[-1] - self.soft.time[0]
                found[c] += self.lasting(c, speed) + (min(way[c] / speed, span) if speed > 0.0 else span)
        return found

    def sticks(self, rows, c):
        """Whether the bodies of a hard pair that have collided are at rest on each other at the end."""
        mine = [r for r in rows if r.pair == c]
        together = self.carried.stats.get("merge_below", 0.0)
        return bool(mine) and self.carried.gap[-1][c] == 0.0 and abs(parting(mine[-1])) <= together

    def lower(self, rows, others, c, of):
        """Whether the contacts that a pair lacks are those of a ball that bounces ever lower, or settles."""
        mine, theirs = ([r for r in log if r.pair == c] for log in (rows, others))
        settles = self.weight([p for p in of if of[p] == of[c]])
        return bool(mine) and all(closing(r) <= max(closing(mine[-1]), settles) for r in theirs[len(mine):])

    def later(self, rows, latest, status):
        if status in ("time", "until") and max(latest.values()) > self.t_end:
            return self.instants(rows_of(self.merging(self.hard, max(latest.values()), max_events=10 * MOST)))
        return rows

    def followed(self, rows, latest, most, lower):
        """The soft run until all that is due is over; pairs at rest that lack only lower bounces do not count."""
        if self.soft.status.name not in ("time", "until"):
            return rows
        end, cut, until = max(latest.values()), rows, {}
        if end > self.t_end:
            rows = rows_of(gr.md.simulate(self.scene, self.laws, t_end=end))
        for r in cut:
            upto = self.t_end + FOLLOWED * self.lasting(r.pair, self.strength(r))
            then = [o.end for o in rows if o.pair == r.pair][count(cut, r.pair) - 1]
            if math.isnan(r.end) and r.pair in lower and not then <= upto:
                latest[r.pair], until[r.pair] = self.t_end, upto
        for r in due(rows, latest, most):
            if math.isnan(r.end) and r.pair not in until:
                until[r.pair] = max(r.begin, self.t_end) + FOLLOWED * self.lasting(r.pair, self.strength(r))
        if until and max(until.values()) > end:
            rows = rows_of(gr.md.simulate(self.scene, self.laws, t_end=max(until.values())))
        never = (math.nan, math.nan)
        return [r._replace(end=math.nan, after=never) if r.end > until.get(r.pair, math.inf) else r
                for r in rows]

    # numbers

    def unit(self, pairs, hard, soft):
        rows = [r for rows in (hard, soft) for r in rows if r.pair in pairs]
        speeds = [closing(r) for r in rows]
        speeds += [parting(r) for r in rows if closing(r) <= 0.0 and not math.isnan(parting(r))]
        fastest = max(abs(v) for rows in (hard, soft) for r in rows for v in r.before)
        return max(*speeds, self.weight(pairs), 1e-13 * fastest)

    def falls(self, body):
        """Acceleration by weight and constant forces."""
        scene = self.scene
        force = 0.0 if scene.external_force is None else scene.external_force[body] / scene.mass[body]
        return 0.0 if self.walls[body] else float(force - scene.gravity)

    def weight(self, pairs):
        """Largest speed that weight gives a ball in a contact."""
        g, found = max(abs(self.falls(a) - self.falls(b)) for a, b in map(self.bodies, pairs)), 0.0
        for c in pairs if g > 0.0 else ():
            speed = g
            for _ in range(8):
                speed = g * self.lasting(c, speed)
            found = max(found, min(speed, g * (self.soft.time[-1] - self.soft.time[0])))
        return found

    def leaves(self, rows, body):
        """Velocity with which a body leaves, and when."""
        mine = [r for r in rows if body in self.bodies(r.pair)]
        if not mine:
            return float(self.scene.velocity[body]), 0.0
        last = max(mine, key=lambda r: (math.inf if math.isnan(r.end) else r.end))
        return last.after[self.bodies(last.pair).index(body)], last.end

    def ball_apart(self, one, other, body):
        (u, t), (v, s) = self.leaves(one, body), self.leaves(other, body)
        if not self.scene.pendulum:
            return min(abs(u - v), abs(u + self.falls(body) * (s - t) - v))  # nan stays nan
        omega, y, w, now = self.scene.pendulum, self.scene.displacement[body], self.scene.velocity[body], 0.0
        for row in (r for r in one if body in self.bodies(r.pair)):
            turn = omega * (row.begin - now)
            y = y * math.cos(turn) + w / omega * math.sin(turn)
            w, now = row.after[self.bodies(row.pair).index(body)], row.begin
        turn = omega * (s - t)
        return min(abs(u - v), abs(u * math.cos(turn) - omega * y * math.sin(turn) - v))

    def pair_apart(self, pair, hard, soft, weight):
        """Difference of a pair that does not rest, or of all its contacts if it does; and whether it rests."""
        mine = [[r for r in rows if r.pair == pair] for rows in (hard, soft)]
        ends = [parting(rows[-1]) if rows else math.nan for rows in mine]
        endless = bool(mine[1]) and math.isnan(ends[1])
        if endless:
            return self.rest_apart(mine[1], mine[0], pair, weight), True
        if abs(ends[0]) <= self.carried.stats.get("merge_below", 0.0) and len(mine[0]) < len(mine[1]):
            return self.rest_apart(mine[0], mine[1], pair, weight), True
        known = [x for x in ends if not math.isnan(x)]
        return abs(known[0] - known[1]) if len(known) == 2 else abs(sum(known)), False

    def rest_apart(self, rests, other, pair, weight):
        k, apart = len(rests) - 1, []
        for nth, (r, o) in enumerate(zip_longest(rests, other)):
            speed = max(closing(row) for row in (r, o) if row)
            if r is None:
                size = closing(o) - closing(rests[k])
            elif o is None:
                size = max(abs(parting(r)), closing(r)) if nth < k else closing(r)
            else:
                size = abs(parting(r) - parting(o)) if nth < k else abs(closing(r) - closing(o))
            apart.append((size, speed))
        out = parting(other[-1]) if other else 0.0
        out = 0.0 if math.isnan(out) else abs(out)
        still = out <= self.carried.stats.get("merge_below", 0.0) if other else self.hard.gap[-1][pair] == 0.0
        return max([out, *(size for size, speed in apart if speed > weight * still)])

    # the answer

    def judge(self):
        if self.soft.status.name in EARLY:
            return Judgement("undecided", math.nan, {})
        hard, soft = self.level()
        if self.carried.status.name in EARLY:
            return Judgement("no" if self.forever(range(len(self.scene.gap)), soft) else "undecided", math.nan, {})
        of, found = self.groups(hard, soft), {}
        self.others = self.other_rules()
        self.twins = self.shifted()
        for k in sorted(set(of.values())):
            pairs = sorted(c for c in of if of[c] == k)
            found[tuple(pairs)] = self.component(pairs, hard, soft)
        worst = min((WORST.index(answer) for answer, _ in found.values()), default=4)
        return Judgement(WORST[worst], max((e for _, e in found.values()), default=0.0), found)

    def component(self, pairs, hard, soft):
        balls = sorted({b for c in pairs for b in self.bodies(c) if not self.walls[b]})
        unit, weight = self.unit(pairs, hard, soft), self.weight(pairs)
        apart = [x for b in balls if not math.isnan(x := self.ball_apart(hard, soft, b))]
        rests = {}
        for c in pairs:
            size, rests[c] = self.pair_apart(c, hard, soft, weight)
            apart.append(size)
        error = max([0.0, *(x for x in apart if not math.isnan(x))]) / unit
        error = 0.0 if self.lies(pairs, hard) else error
        return self.said(pairs, balls, hard, soft, unit, rests, error), error

    def said(self, pairs, balls, hard, soft, unit, rests, error):
        if self.forever(pairs, soft):
            return "no"
        weight = self.weight(pairs)
        sinks = any(self.sinks(c, soft, self.lies(pairs, hard), weight) for c in pairs)
        if self.lies(pairs, hard):
            return "no" if sinks else "yes"
        for other, together in self.others:
            stuck = [stuck_apart(*other, c, weight, together) for c in pairs]
            if max(*stuck, *(self.ball_apart(*other, b) for b in balls)) > SAME * unit:
                return "not_unique"
        moved = [self.ball_apart(*self.twins, b) for b in balls]
        moved = [0.0 if math.isnan(x) else x for x in moved]
        mass = [float(self.scene.mass[b]) for b in balls]
        far = math.sqrt(sum(m * x * x for m, x in zip(mass, moved, strict=True)) / (sum(mass) * unit**2))
        if far > SAME:
            return "not_unique" if any(self.touch(c) for c in pairs) else "not_ball_by_ball"
        if max(moved) > SAME * unit:
            return "not_unique"
        if any(count(hard, c) != count(soft, c) and not rests[c] for c in pairs) or not error <= SAME or sinks:
            return "no"
        return "yes"

    def sinks(self, pair, soft, lies, weight):
        """Whether soft balls at rest sink too deep."""
        rows = [r for r in soft if r.pair == pair and (lies or math.isnan(r.end))]
        sizes = [r for b in self.bodies(pair) if (r := self.scene.radius[b]) > 0.0]
        if not rows or not sizes or not self.scene.gravity:
            return False
        deep = max(r.deepest if closing(r) <= weight else -float(self.soft.gap[-1][pair]) for r in rows)
        return deep > SAME * min(sizes)

    def lies(self, pairs, hard):
        """Whether balls rest on each other from the start."""
        return not any(r.pair in pairs for r in hard) and all(self.hard.gap[-1][c] == 0.0 for c in pairs)

    def forever(self, pairs, soft):
        if self.hard.status.name not in ("collapse", "bounded") or "pairs" not in self.hard.stats:
            return False
        first, last = self.hard.stats["pairs"]
        group = [c for c in pairs if (first <= c <= last if first <= last else c >= first or c <= last)]
        ends = {r.pair: r.end for r in soft}
        return any(not math.isnan(ends.get(c, math.nan)) for c in group)

    def other_rules(self):
        """Hard runs under the other tie rules, each beside the own one, where balls touch or collide at once."""
        rows = rows_of(self.carried)
        times = {}
        for r in rows:
            times.setdefault(r.begin, set()).add(r.pair)
        at_once = any(c + 1 in pairs for pairs in times.values() for c in pairs)
        found = []
        if self.n < 3 or not (at_once or (self.scene.gap == 0.0).any()):
            return found
        for ties in {"left", "right", "poisson"} - {self.ties}:
            options = {"ties": ties, "max_events": min(MOST, 10 * (len(rows) + self.n))}
            try:
                run = self.merging(self.collide(self.scene, self.t_end, **options), self.t_end, **options)
            except (ValueError, ArithmeticError):
                continue
            if run.status.name not in EARLY:
                together = min(one.stats.get("merge_below", 0.0) for one in (run, self.carried))
                found.append((self.beside(run, self.carried), together))
        return found

    def beside(self, *runs):
        logs = [self.instants(rows_of(run)) for run in runs]
        soft = rows_of(self.soft)
        return [self.without_rounding(rows, soft, beside=[rows, soft])[0] for rows in logs]

    def touch(self, pair):
        """Whether two balls touch at the start."""
        return self.scene.gap[pair] == 0.0 and not any(self.walls[b] for b in self.bodies(pair))

    def shifted(self):
        scene = self.scene
        typical = float(scene.gap.mean()) or 1.0
        gap = [1e-12 * typical if self.touch(c) else g * (1.0 + 1e-12 * (-1) ** c) for c, g in enumerate(scene.gap)]
        limit = min(MOST, 10 * (self.hard.stats["events"] + self.n))
        twin = self.merging(self.collide(scene.replace(gap=gap), self.t_end, max_events=limit), self.t_end)
        one, other = self.beside(self.carried if twin.status.name in EARLY else twin, self.carried)
        if twin.status.name == self.carried.status.name == "time":
            before = self.t_end * (1.0 - 1e-9)
            one, other = ([r for r in rows if r.begin < before] for rows in (one, other))
        return one, other


def judged(scene, law, t_end, **options):
    """The answer of this judge for a comparison."""
    report = gr.compare(scene, law, t_end=t_end, max_events=MOST, **options)
    return report, Judge(scene, report.law, report.rule, t_end, **options).judge()

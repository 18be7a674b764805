"""A reference judge: the answer of docs/concepts.md, written from that page alone, in plain loops.

The scene is run again with later ends to obtain the contacts after a cut. Only engines, laws and trajectories of the
package are used: none of its components, units, episodes, errors or answers.
"""

import math
from collections import namedtuple
from itertools import zip_longest

from judged_episodes import Leaving, episodes_of, last_contact, numbered, velocity_after
from judged_rows import closing, count, due, of_pair, parting, rows_of, stuck_apart

import granular as gr
from granular.scene import speed_scale

Judgement = namedtuple("Judgement", "answer error components deciding")
Component = namedtuple("Component", "answer error unit deciding reason")
ERROR_LIMIT, ROUNDING, FOLLOWED_DURATIONS = 0.01, 1e-12, 20.0
WORST_FIRST = ["no", "not_unique", "not_ball_by_ball", "undecided", "yes"]
MAX_COLLISIONS = 200_000
"""Limit of every run: balls that ride on a driven floor at an ε near 1 have millions of collisions."""
STOPPED_EARLY = {"max_events", "max_steps", "unstable", "broken"}
MAX_BODIES_OF_POISSON = 1000


class Judge:
    """One scene, its laws and its end; without `t_end` both runs go on until no contact can follow."""

    def __init__(self, scene, laws, rule, t_end=None, ties="left", max_events=MAX_COLLISIONS):
        self.scene, self.laws, self.rule, self.t_end, self.ties = scene, laws, rule, t_end, ties
        self.max_events = max_events
        self.known_durations, self.known_settling = {}, {}
        self.n, self.walls = scene.n, [math.isinf(m) for m in scene.mass]
        self.pairs = range(len(scene.gap))
        self.hard = self.collide(scene, t_end)
        self.limit_hit = False
        try:
            self.carried = self.continued_by_sticking(self.hard, t_end)
        except ValueError:  # rules for whole groups cannot stick
            self.carried, self.limit_hit = self.hard, True
        self.soft = gr.md.simulate(scene, laws, t_end=t_end)
        self.length = float(self.soft.time[-1] - self.soft.time[0])

    def collide(self, scene, t_end, **options):
        options = {"ties": self.ties, "max_events": self.max_events} | options
        return gr.edmd.simulate(scene, self.rule, t_end=t_end, **options)

    def continued_by_sticking(self, run, t_end, **options):
        """A hard run to `t_end`; after a collapse slow pairs stick."""
        if run.status.name not in ("collapse", "bounded"):
            return run if t_end == self.t_end else self.collide(run.scene, t_end, **options)
        slow = 1e-9 * max(closing(row) for row in rows_of(run))
        return self.collide(run.scene, t_end, collapse="merge", merge_below=slow, **options)

    def bodies(self, pair):
        return pair, (pair + 1) % self.n

    def isolated_duration(self, pair, speed):
        """Duration of an isolated contact; 0 if it has none that ends."""
        if (pair, speed) not in self.known_durations:
            try:
                slowest = max(2.0**-30 * speed_scale(self.scene), 1e-30)
                contact = gr.binary.collision(self.laws[pair], self.scene.pairs[pair], max(speed, slowest))
                self.known_durations[pair, speed] = contact.duration
            except (ValueError, ArithmeticError):
                self.known_durations[pair, speed] = 0.0
        return self.known_durations[pair, speed]

    def impact_speed(self, row):
        return max(closing(row), row.impulse / self.scene.pairs[row.pair].m_eff)

    def joined_instants(self, rows):
        """All collisions of a pair in one instant as one contact, with the velocities at the end of the instant."""
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

    def components(self, *logs):
        """Component of every pair that has a contact in one of the logs."""
        met = sorted({row.pair for rows in logs for row in rows})
        of = {c: c for c in met}
        for c in met:
            above = (c + 1) % self.n
            if above in of and not self.walls[above]:
                old, new = of[above], of[c]
                of = {k: new if v == old else v for k, v in of.items()}
        return of

    def without_rounding(self, *logs, beside=None):
        """The logs without impacts weaker than rounding of the fastest approach in their component."""
        of = self.components(*(beside or logs))
        fastest = {}
        for row in (row for rows in (beside or logs) for row in rows):
            fastest[of[row.pair]] = max(fastest.get(of[row.pair], 0.0), closing(row))
        return [[r for r in rows if self.impact_speed(r) > ROUNDING * fastest.get(of.get(r.pair), 0.0)]
                for rows in logs]

    # the end

    def counted_contacts(self):
        """The first n contacts of every pair in both runs, each followed to its end."""
        hard, soft = self.without_rounding(self.joined_instants(rows_of(self.carried)), rows_of(self.soft))
        most = {c: max(count(hard, c), count(soft, c)) for c in self.pairs}
        of, self.delays = self.components(hard, soft), {}
        for c, k in of.items():
            mine = [[r for r in rows if of[r.pair] == k] for rows in (hard, soft)]
            total = sum(self.isolated_duration(r.pair, float(f"{closing(r):.3g}")) for r in mine[0])
            total += sum(r.end - r.begin for r in mine[1] if not math.isnan(r.end))
            self.delays[c] = total * max(closing(r) for rows in mine for r in rows)
        end = float(self.carried.time[-1])
        latest_hard = self.latest_onsets(hard, soft, most, end)
        latest_hard |= {r.pair: end for r in soft if r.begin == 0.0 and not count(hard, r.pair)}
        latest_hard |= {c: end for c in of if self.sticks(hard, c) and self.lacks_lower_bounces(hard, soft, c, of)}
        latest_soft = self.latest_onsets(soft, hard, most, float(self.soft.time[-1]))
        lower = {c for c in of if self.lacks_lower_bounces(soft, hard, c, of)}
        hard = self.continued_hard(hard, latest_hard, self.carried.status.name)
        self.whole_hard = hard
        soft = self.continued_soft(soft, latest_soft, most, lower)
        hard, soft = self.without_rounding(hard, soft)
        return due(hard, latest_hard, most), due(soft, latest_soft, most)

    def lag(self, pair, speed):
        """How much later than hard spheres a soft contact of this approach speed may be."""
        own = self.isolated_duration(pair, speed)
        return own + (min(self.delays[pair] / speed, self.length) if speed > 0.0 else self.length)

    def latest_onsets(self, rows, others, most, end):
        """Latest onset of the contacts of every pair that one run has yet to make."""
        found = {}
        for c in most:
            found[c] = end
            if count(rows, c) < most[c]:
                found[c] += self.lag(c, abs(closing(of_pair(others, c)[-1])))
        return found

    def sticks(self, rows, c):
        """Whether the bodies of a hard pair that have collided are at rest on each other at the end."""
        mine = of_pair(rows, c)
        together = self.carried.stats.get("merge_below", 0.0)
        return bool(mine) and self.carried.gap[-1][c] == 0.0 and abs(parting(mine[-1])) <= together

    def lacks_lower_bounces(self, rows, others, c, of):
        """Whether the contacts that a pair lacks are those of a ball that bounces ever lower, or settles."""
        mine, theirs = (of_pair(log, c) for log in (rows, others))
        settling = self.settling_speed([p for p in of if of[p] == of[c]])
        return bool(mine) and all(closing(r) <= max(closing(mine[-1]), settling) for r in theirs[len(mine):])

    def continued_hard(self, rows, latest, status):
        if status not in ("time", "until") or max(latest.values()) <= self.t_end:
            return rows
        run = self.continued_by_sticking(self.hard, max(latest.values()), max_events=10 * self.max_events)
        self.limit_hit |= run.status.name in STOPPED_EARLY
        return self.joined_instants(rows_of(run))

    def soft_rows_until(self, end):
        run = gr.md.simulate(self.scene, self.laws, t_end=end)
        self.limit_hit |= run.status.name in STOPPED_EARLY
        return rows_of(run)

    def continued_soft(self, rows, latest, most, lower):
        """The soft contacts until all that count are over; later contacts of pairs that bounce lower are left out."""
        if self.soft.status.name not in ("time", "until"):
            return rows
        end, cut, until = max(latest.values()), rows, {}
        if end > self.t_end:
            rows = self.soft_rows_until(end)
        for r in cut:
            upto = self.t_end + FOLLOWED_DURATIONS * self.isolated_duration(r.pair, self.impact_speed(r))
            then = [o.end for o in rows if o.pair == r.pair][count(cut, r.pair) - 1]
            if math.isnan(r.end) and r.pair in lower and not then <= upto:
                latest[r.pair], until[r.pair] = self.t_end, upto
        for r in due(rows, latest, most):
            if math.isnan(r.end) and r.pair not in until:
                followed = FOLLOWED_DURATIONS * self.isolated_duration(r.pair, self.impact_speed(r))
                until[r.pair] = max(r.begin, self.t_end) + followed
        if until and max(until.values()) > end:
            rows = self.soft_rows_until(max(until.values()))
        never = (math.nan, math.nan)
        return [r._replace(end=math.nan, after=never) if r.end > until.get(r.pair, math.inf) else r
                for r in rows]

    # the error

    def unit(self, pairs, hard, soft):
        rows = [r for rows in (hard, soft) for r in rows if r.pair in pairs]
        speeds = [closing(r) for r in rows]
        speeds += [parting(r) for r in rows if closing(r) <= 0.0 and not math.isnan(parting(r))]
        fastest = max(abs(v) for rows in (hard, soft) for r in rows for v in r.before)
        return max(*speeds, self.settling_speed(pairs), 1e-13 * fastest)

    def acceleration(self, body):
        """Acceleration by weight and constant forces in m/s²."""
        scene = self.scene
        force = 0.0 if scene.external_force is None else scene.external_force[body] / scene.mass[body]
        return 0.0 if self.walls[body] else float(force - scene.gravity)

    def settling_speed(self, pairs):
        """The speed a t_c of a component in m/s, no more than weight gives in the whole run."""
        key = tuple(pairs)
        if key not in self.known_settling:
            a = max(self.acceleration(lower) - self.acceleration(upper) for lower, upper in map(self.bodies, pairs))
            found = 0.0
            for c in pairs if a > 0.0 else ():
                before, speed = 0.0, a * self.length
                while abs(speed - before) > 1e-12 * speed:  # of all laws t_c depends weakly on the speed
                    before, speed = speed, a * self.isolated_duration(c, speed)
                found = max(found, min(speed, a * self.length))
            self.known_settling[key] = found
        return self.known_settling[key]

    def carried_velocity(self, ball, u, begin, span):
        """Velocity of a hard ball after free flight over `span`, which may be negative."""
        omega = self.scene.pendulum
        if not omega:
            return u + self.acceleration(ball) * span
        y, w, now = self.scene.displacement[ball], self.scene.velocity[ball], 0.0
        for row in self.whole_hard:
            if ball in self.bodies(row.pair) and row.begin <= begin:
                turn = omega * (row.begin - now)
                y = y * math.cos(turn) + w / omega * math.sin(turn)
                w, now = velocity_after(row, ball, self.bodies), row.begin
        return u * math.cos(omega * span) - omega * y * math.sin(omega * span)

    def leavings(self, pairs, hard, soft, ignored):
        """Every ball that leaves an episode in both runs."""
        one, other = ({key: r for key, r in numbered(rows).items() if key[0] in pairs and key not in ignored}
                      for rows in (hard, soft))
        endless = [r for r in other.values() if math.isnan(r.end)]
        found = []
        for episode in episodes_of(other, self.bodies, self.walls):
            for ball in sorted({b for c, _ in episode for b in self.bodies(c) if not self.walls[b]}):
                h, s = (last_contact(contacts, episode, ball, self.bodies) for contacts in (one, other))
                if h is None or any(ball in self.bodies(r.pair) and r.begin < s.end for r in endless):
                    continue
                found.append(self.leaving(ball, episode, h, s))
        return found

    def leaving(self, ball, episode, h, s):
        u, v = (velocity_after(row, ball, self.bodies) for row in (h, s))
        late = s.end - h.end
        span = math.copysign(min(abs(late), self.lag(h.pair, closing(h))), late)
        difference = min(abs(u - v), abs(self.carried_velocity(ball, u, h.begin, span) - v))
        return Leaving(ball, episode, u, v, h.end, s.end, difference)

    def rests(self, pair, hard, soft):
        """The log in which a pair is at rest and the other log; None for a pair that does not rest."""
        h, s = of_pair(hard, pair), of_pair(soft, pair)
        if s and math.isnan(parting(s[-1])):
            return s, h
        together = self.carried.stats.get("merge_below", 0.0)
        if h and abs(parting(h[-1])) <= together and len(h) < len(s):
            return h, s
        return None

    def settling_contacts(self, pair, hard, soft, settling):
        """The contacts of a pair at rest in both runs that close no faster than a t_c in both."""
        found = self.rests(pair, hard, soft)
        if found is None or not self.is_at_rest_in_the_other(pair, found[1]):
            return set()
        both = zip_longest(of_pair(hard, pair), of_pair(soft, pair))
        return {(pair, k) for k, rows in enumerate(both) if max(closing(r) for r in rows if r) <= settling}

    def is_at_rest_in_the_other(self, pair, other):
        if not other:
            return self.hard.gap[-1][pair] == 0.0
        out = parting(other[-1])
        return math.isnan(out) or abs(out) <= self.carried.stats.get("merge_below", 0.0)

    def rest_difference(self, pair, rests, other, ignored):
        """The largest difference under *Rest* of a pair, in m/s."""
        k, apart = len(rests) - 1, []
        for nth, (r, o) in enumerate(zip_longest(rests, other)):
            if (pair, nth) in ignored:
                continue
            if r is None:
                apart.append(closing(o) - closing(rests[k]))
            elif o is None:
                apart.append(max(abs(parting(r)), closing(r)) if nth < k else closing(r))
            else:
                apart.append(abs(parting(r) - parting(o)) if nth < k else abs(closing(r) - closing(o)))
        out = parting(other[-1]) if other else 0.0
        return max([0.0 if math.isnan(out) else abs(out), *apart])

    # the answer

    def judge(self):
        if self.soft.status.name in STOPPED_EARLY:
            return Judgement("undecided", math.nan, {}, None)
        hard, soft = self.counted_contacts()
        self.logs = hard, soft
        if self.carried.status.name in STOPPED_EARLY or self.limit_hit:
            parts = self.parts_where_hard_spheres_collide_forever(self.pairs, soft)
            return Judgement("no" if parts else "undecided", math.nan, {}, None)
        of, found = self.components(hard, soft), {}
        self.run_checks()
        for k in sorted(set(of.values())):
            pairs = sorted(c for c in of if of[c] == k)
            found[tuple(pairs)] = self.component(pairs, hard, soft)
        worst = min((WORST_FIRST.index(part.answer) for part in found.values()), default=4)
        largest = max(found.values(), key=lambda part: part.error, default=None)
        return Judgement(WORST_FIRST[worst], largest.error if largest else 0.0, found, largest and largest.deciding)

    def component(self, pairs, hard, soft):
        unit, settling = self.unit(pairs, hard, soft), self.settling_speed(pairs)
        lies = self.lies_from_start(pairs, hard)
        ignored = set().union(*(self.settling_contacts(c, hard, soft, settling) for c in pairs))
        left = [] if lies else self.leavings(pairs, hard, soft, ignored)
        deciding = max(left, key=lambda one: one.difference, default=None)
        resting = {c: found for c in pairs if (found := self.rests(c, hard, soft))}
        apart = [0.0] if lies else [self.rest_difference(c, *logs, ignored) for c, logs in resting.items()]
        error = max([0.0, *apart, *(one.difference for one in left)]) / unit
        answer, reason = self.component_answer(pairs, hard, soft, unit, resting, error)
        return Component(answer, error, unit, deciding, reason)

    def component_answer(self, pairs, hard, soft, unit, resting, error):
        """The first matching rule of the page, with its reason."""
        balls = sorted({b for c in pairs for b in self.bodies(c) if not self.walls[b]})
        lies = self.lies_from_start(pairs, hard)
        if self.parts_where_hard_spheres_collide_forever(pairs, soft):
            return "no", "forever"
        sinks = any(self.sinks(c, soft, lies, self.settling_speed(pairs)) for c in pairs)
        if lies:
            return ("no", "sinks") if sinks else ("yes", "lies")
        depends = self.depends_on_rounding(pairs, balls, unit)
        if depends:
            return depends
        if any(count(hard, c) != count(soft, c) for c in pairs if c not in resting):
            return "no", "counts"
        if not error <= ERROR_LIMIT or sinks:
            return "no", "sinks" if error <= ERROR_LIMIT else "error"
        failed = self.failed_ties if self.has_ties(pairs) else []
        failed = failed + ["shifted gaps"] * (self.shifted is None)
        return ("undecided", f"not checked: {failed}") if failed else ("yes", "")

    def depends_on_rounding(self, pairs, balls, unit):
        """Rules 2 and 3: tie rules and shifted gaps; None if the answer is unique."""
        settling = self.settling_speed(pairs)
        for name, (logs, together) in self.other_ties.items() if self.has_ties(pairs) else ():
            stuck = [stuck_apart(*logs, c, settling, together) for c in pairs]
            if max(*stuck, *(self.last_difference(*logs, b) for b in balls)) > ERROR_LIMIT * unit:
                return "not_unique", f"ties={name}"
        moved = [0.0 if self.shifted is None else self.last_difference(*self.shifted, b) for b in balls]
        mass = [float(self.scene.mass[b]) for b in balls]
        far = math.sqrt(sum(m * x * x for m, x in zip(mass, moved, strict=True)) / (sum(mass) * unit**2))
        if far > ERROR_LIMIT:
            touching = any(self.balls_touch(c) for c in pairs)
            return ("not_unique", "shifted gaps, touching") if touching else ("not_ball_by_ball", "shifted gaps")
        return ("not_unique", "shifted gaps, one ball") if max(moved) > ERROR_LIMIT * unit else None

    def last_difference(self, one, other, ball):
        """Difference between the velocities with which a ball leaves its last contact in two hard runs."""
        found = []
        for rows in (one, other):
            mine = [r for r in rows if ball in self.bodies(r.pair)]
            start = float(self.scene.velocity[ball]), 0.0
            found.append((velocity_after(mine[-1], ball, self.bodies), mine[-1].end) if mine else start)
        (u, t), (v, s) = found
        if self.scene.pendulum:
            return abs(u - v) if abs(u - v) < 1e-9 else self.swing_difference(one, ball, u, t, v, s)
        return min(abs(u - v), abs(u + self.acceleration(ball) * (s - t) - v))

    def swing_difference(self, rows, ball, u, t, v, s):
        saved, self.whole_hard = self.whole_hard, rows
        found = min(abs(u - v), abs(self.carried_velocity(ball, u, t, s - t) - v))
        self.whole_hard = saved
        return found

    def sinks(self, pair, soft, lies, settling):
        """Whether soft balls at rest sink by more than 1 % of the smaller radius."""
        rows = [r for r in of_pair(soft, pair) if lies or math.isnan(r.end)]
        sizes = [r for b in self.bodies(pair) if (r := self.scene.radius[b]) > 0.0]
        if not rows or not sizes:
            return False
        at_end = -float(self.soft.gap[-1][pair])
        if self.soft.status.name == "resting":
            settled = self.length + 10 * FOLLOWED_DURATIONS * self.isolated_duration(pair, settling)
            run = gr.md.simulate(self.scene, self.laws, t_end=settled)
            at_end = max(at_end, -float(run.gap[-1][pair]))
        deep = max(max(r.deepest, at_end) if closing(r) <= settling else at_end for r in rows)
        return deep > ERROR_LIMIT * min(sizes)

    def lies_from_start(self, pairs, hard):
        """Whether balls rest on each other from the start."""
        return not any(r.pair in pairs for r in hard) and all(self.hard.gap[-1][c] == 0.0 for c in pairs)

    def parts_where_hard_spheres_collide_forever(self, pairs, soft):
        if self.hard.status.name not in ("collapse", "bounded") or "pairs" not in self.hard.stats:
            return False
        first, last = self.hard.stats["pairs"]
        group = [c for c in pairs if (first <= c <= last if first <= last else c >= first or c <= last)]
        ends = {r.pair: r.end for r in soft}
        return any(not math.isnan(ends.get(c, math.nan)) for c in group)

    # the checks of rules 2 and 3

    def has_ties(self, pairs):
        """Whether balls of a component touch at the start or collide at once in the hard run."""
        times = {}
        for r in rows_of(self.carried):
            if r.pair in pairs:
                times.setdefault(r.begin, set()).add(r.pair)
        at_once = any((c + 1) % self.n in met for met in times.values() for c in met)
        return self.n >= 3 and (at_once or any(self.scene.gap[c] == 0.0 for c in pairs))

    def run_checks(self):
        """Hard runs under the other tie rules and from shifted gaps; names of the rules that could not be run."""
        self.other_ties, self.failed_ties = {}, []
        rows = rows_of(self.carried)
        limit = min(self.max_events, 10 * (len(rows) + self.n))
        for ties in self.tie_rules() if self.has_ties(self.pairs) else ():
            options = {"ties": ties, "max_events": limit}
            try:
                run = self.continued_by_sticking(self.collide(self.scene, self.t_end, **options), self.t_end, **options)
            except (ValueError, ArithmeticError):
                self.failed_ties.append(ties)
                continue
            if run.status.name in STOPPED_EARLY:
                self.failed_ties.append(ties)
            else:
                together = min(one.stats.get("merge_below", 0.0) for one in (run, self.carried))
                self.other_ties[ties] = self.comparable_logs(run, self.carried), together
        self.shifted = self.logs_from_shifted_gaps()

    def tie_rules(self):
        sticky = all(self.rule(1.0, pair) == 0.0 for pair in self.scene.pairs) if callable(self.rule) else False
        poisson = [] if sticky or self.n > MAX_BODIES_OF_POISSON else ["poisson"]
        return [ties for ties in ("left", "right", *poisson) if ties != self.ties]

    def comparable_logs(self, *runs):
        logs = [self.joined_instants(rows_of(run)) for run in runs]
        soft = rows_of(self.soft)
        return [self.without_rounding(rows, soft, beside=[rows, soft])[0] for rows in logs]

    def balls_touch(self, pair):
        """Whether two balls touch at the start."""
        return self.scene.gap[pair] == 0.0 and not any(self.walls[b] for b in self.bodies(pair))

    def logs_from_shifted_gaps(self):
        """Logs of the hard run from shifted gaps and of the hard run itself; None if the first stopped early."""
        scene = self.scene
        mean = float(scene.gap.mean()) or 1.0
        gap = [1e-12 * mean if self.balls_touch(c) else g * (1.0 + 1e-12 * (-1) ** c) for c, g in enumerate(scene.gap)]
        limit = min(self.max_events, 10 * (self.hard.stats["events"] + self.n))
        run = self.collide(scene.replace(gap=gap), self.t_end, max_events=limit)
        run = self.continued_by_sticking(run, self.t_end)
        if run.status.name in STOPPED_EARLY:
            return None
        one, other = self.comparable_logs(run, self.carried)
        if run.status.name == self.carried.status.name == "time":
            before = self.t_end * (1.0 - 1e-9)
            one, other = ([r for r in rows if r.begin < before] for rows in (one, other))
        return one, other


def judged(scene, law, t_end=None, **options):
    """The report of a comparison and the judgement of this judge."""
    report = gr.compare(scene, law, t_end=t_end, max_events=MAX_COLLISIONS, **options)
    return report, Judge(scene, report.law, report.rule, t_end, **options).judge()

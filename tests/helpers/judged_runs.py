"""Both runs of a question and their counted contacts, for the reference judge."""

import math

import granular as gr
from granular.scene import speed_scale
from tests.helpers.judged_rows import closing, count, due, of_pair, parting, rows_of

ROUNDING, FOLLOWED_DURATIONS = 1e-12, 20.0
MAX_COLLISIONS = 20_000
"""Limit of every run: balls that ride on a driven floor at an ε near 1 have millions of collisions."""
COLLAPSED = {"collapse", "bounded"}
STOPPED_EARLY = {"max_events", "max_steps", "unstable", "broken"}


def merging_speed(run):
    """Separation speed up to which balls of a hard run stick; negative if the run merges none."""
    merges = run.stats.get("merged", 0) or run.stats.get("settled", 0)
    return run.stats.get("merge_below", 0.0 if merges else -1.0)


class Runs:
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
        if run.status.name not in COLLAPSED:
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
        hard = self.continued_hard(hard, latest_hard, most)
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
        return bool(mine) and self.carried.gap[-1][c] == 0.0 and abs(parting(mine[-1])) <= merging_speed(self.carried)

    def lacks_lower_bounces(self, rows, others, c, of):
        """Whether the contacts that a pair lacks are those of a ball that bounces ever lower, or settles."""
        mine, theirs = (of_pair(log, c) for log in (rows, others))
        settling = self.settling_speed([p for p in of if of[p] == of[c]])
        return bool(mine) and all(closing(r) <= max(closing(mine[-1]), settling) for r in theirs[len(mine):])

    def continued_hard(self, rows, latest, most):
        """The hard contacts to the latest onset; a limit counts if it comes before the contacts that are needed."""
        if self.carried.status.name not in ("time", "until") or max(latest.values()) <= self.t_end:
            return rows
        run = self.continued_by_sticking(self.hard, max(latest.values()), max_events=10 * self.max_events)
        rows, end = self.joined_instants(rows_of(run)), float(run.time[-1])
        if run.status.name in STOPPED_EARLY:
            self.limit_hit |= any(count(rows, c) < most[c] and end < latest[c] for c in most)
        return rows

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

    def lies_from_start(self, pairs, hard):
        """Whether balls rest on each other from the start."""
        return not any(r.pair in pairs for r in hard) and all(self.hard.gap[-1][c] == 0.0 for c in pairs)

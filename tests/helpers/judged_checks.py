"""Hard runs under other tie rules and from shifted gaps, for rules 2, 3 and 6 of the reference judge."""

import math

from tests.helpers.judged_episodes import velocity_after
from tests.helpers.judged_rows import rows_of
from tests.helpers.judged_runs import COLLAPSED, STOPPED_EARLY, Runs, merging_speed

MAX_BODIES_OF_POISSON = 1000


class Checks(Runs):
    """The checks of a question, and the velocity differences between two hard runs."""

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
                run = self.collide(self.scene, self.t_end, **options)
                if ties == "poisson" and run.status.name in COLLAPSED:
                    continue
                run = self.continued_by_sticking(run, self.t_end, **options)
            except (ValueError, ArithmeticError):
                self.failed_ties.append(ties)
                continue
            if run.status.name in STOPPED_EARLY:
                self.failed_ties.append(ties)
            else:
                merges = min(map(merging_speed, (run, self.carried))) >= 0.0
                self.other_ties[ties] = self.comparable_logs(run, self.carried), merges
        self.shifted = self.logs_from_shifted_gaps()

    def tie_rules(self):
        sticky = all(self.rule(1.0, pair) == 0.0 for pair in self.scene.pairs) if callable(self.rule) else False
        undefined = sticky or self.hard.status.name in COLLAPSED
        poisson = [] if undefined or self.n > MAX_BODIES_OF_POISSON else ["poisson"]
        return [ties for ties in ("left", "right", *poisson) if ties != self.ties]

    def comparable_logs(self, *runs):
        logs = [self.joined_instants(rows_of(run)) for run in runs]
        soft = rows_of(self.soft)
        return [self.without_rounding(rows, soft, beside=[rows, soft])[0] for rows in logs]

    def balls_touch(self, pair):
        """Whether two balls touch at the start."""
        return self.scene.gap[pair] == 0.0 and not any(self.walls[b] for b in self.bodies(pair))

    def room(self, pair):
        """The smaller of the nearest open gaps below and above a pair, at most the sum of its radii."""
        gap, size = self.scene.gap.tolist(), sum(self.scene.radius[b] for b in self.bodies(pair))
        sides = [[g for g in some if g > 0.0] for some in (gap[pair::-1], gap[pair:])]
        return min([side[0] for side in sides if side] + ([float(size)] if size > 0.0 else []), default=1.0)

    def logs_from_shifted_gaps(self):
        """Logs of the hard run from shifted gaps and of the hard run itself; None if the first stopped early."""
        scene = self.scene
        gap = [g + 1e-12 * self.room(c) if self.balls_touch(c) else g * (1.0 + 1e-12 * (-1) ** c)
               for c, g in enumerate(scene.gap)]
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

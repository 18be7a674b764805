"""A reference judge: docs/guide/error-definition.md and answer-definition.md in plain loops, from these pages alone.

The scene is run again with later ends to obtain the contacts after a cut. Only engines, laws and trajectories of the
package are used: none of its components, units, episodes, errors or answers.
"""

import math
from collections import namedtuple
from functools import cache
from itertools import zip_longest

import granular as gr
from tests.helpers.judged_checks import Checks
from tests.helpers.judged_episodes import Leaving, episodes_of, free_flights, last_contact, numbered, velocity_after
from tests.helpers.judged_rows import closing, count, of_pair, parting, stuck_apart
from tests.helpers.judged_runs import COLLAPSED, FOLLOWED_DURATIONS, MAX_COLLISIONS, STOPPED_EARLY, merging_speed

Judgement = namedtuple("Judgement", "answer error components deciding")
Component = namedtuple("Component", "answer error unit deciding reason")
ERROR_LIMIT = 0.01
LONG_FLIGHT_DURATIONS = 5.0
WORST_FIRST = ["no", "not_unique", "not_ball_by_ball", "undecided", "yes"]


class Judge(Checks):
    """Error and answer of one question."""

    def unit(self, pairs, hard, soft):
        rows = [r for rows in (hard, soft) for r in rows if r.pair in pairs]
        speeds = [closing(r) for r in rows]
        speeds += [parting(r) for r in rows if closing(r) <= 0.0 and not math.isnan(parting(r))]
        fastest = max(abs(v) for rows in (hard, soft) for r in rows for v in r.before)
        return max(*speeds, self.settling_speed(pairs), 1e-13 * fastest)

    def leavings(self, pairs, hard, soft, ignored):
        """Every ball that leaves an episode in both runs."""
        one, other = ({key: r for key, r in numbered(rows).items() if key[0] in pairs and key not in ignored}
                      for rows in (hard, soft))
        whole, found = [numbered(rows) for rows in (hard, soft)], []
        flights = cache(lambda log, ball: free_flights(whole[log], ball, self.bodies))
        for episode in episodes_of(other, self.bodies, self.walls):
            for ball in sorted({b for c, _ in episode for b in self.bodies(c) if not self.walls[b]}):
                both = [[last_contact(contacts, episode, ball, self.bodies) for contacts in (one, other)]]
                both += [[one[key], other[key]] for key in episode if key in one and ball in self.bodies(key[0])
                         and self.flies_long(key, flights(0, ball), flights(1, ball), *whole)]
                found += [self.leaving(ball, episode, h, s) for h, s in both
                          if h and not self.rests_on_a_wall(ball, soft, s.end)]
        return found

    def flies_long(self, key, hard_flights, soft_flights, hard, soft):
        """Whether a long free flight follows a contact in both runs, up to a contact that both runs have."""
        shortest = min(0.0 if following and following not in other else time for (time, following), other
                       in ((hard_flights[key], soft), (soft_flights[key], hard)))
        return shortest > LONG_FLIGHT_DURATIONS * (soft[key].end - soft[key].begin)

    def rests_on_a_wall(self, ball, soft, time):
        """Whether contacts without end that have begun before a time reach from a wall to a ball."""
        endless = {r.pair for r in soft if math.isnan(r.end) and r.begin < time}
        below = self.walls[0] and all(c in endless for c in range(ball))
        return below or (self.walls[-1] and all(c in endless for c in range(ball, self.n - 1)))

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
        if h and abs(parting(h[-1])) <= merging_speed(self.carried) and len(h) < len(s):
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
        return math.isnan(out) or abs(out) <= merging_speed(self.carried)

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
            elif nth >= k:  # how earlier contacts end is compared by episodes
                apart.append(abs(closing(r) - closing(o)))
        out = parting(other[-1]) if other else 0.0
        return max([0.0 if math.isnan(out) else abs(out), *apart])

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
        for name, (logs, merges) in self.other_ties.items() if self.has_ties(pairs) else ():
            stuck = [stuck_apart(*logs, c, settling) if merges else 0.0 for c in pairs]
            if max(*stuck, *(self.last_difference(*logs, b) for b in balls)) > ERROR_LIMIT * unit:
                return "not_unique", f"ties={name}"
        moved = [0.0 if self.shifted is None else self.last_difference(*self.shifted, b) for b in balls]
        mass = [float(self.scene.mass[b]) for b in balls]
        far = math.sqrt(sum(m * x * x for m, x in zip(mass, moved, strict=True)) / (sum(mass) * unit**2))
        if far > ERROR_LIMIT:
            touching = any(self.balls_touch(c) for c in pairs)
            return ("not_unique", "shifted gaps, touching") if touching else ("not_ball_by_ball", "shifted gaps")
        return ("not_unique", "shifted gaps, one ball") if max(moved) > ERROR_LIMIT * unit else None

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

    def parts_where_hard_spheres_collide_forever(self, pairs, soft):
        if self.hard.status.name not in COLLAPSED or "pairs" not in self.hard.stats:
            return False
        first, last = self.hard.stats["pairs"]
        group = [c for c in pairs if (first <= c <= last if first <= last else c >= first or c <= last)]
        ends = {r.pair: r.end for r in soft}
        return any(not math.isnan(ends.get(c, math.nan)) for c in group)


def judged(scene, law, t_end=None, **options):
    """The report of a comparison and the judgement of this judge."""
    report = gr.compare(scene, law, t_end=t_end, max_events=MAX_COLLISIONS, **options)
    return report, Judge(scene, report.law, report.rule, t_end, **options).judge()

"""The error of a comparison by plain loops over contacts: episodes by comparing every two contacts, no numpy.

Written from docs/guide/error-definition.md, "Episodes", "Error" and "Rest". Given are the runs of "End of the runs" and
the units; everything else is done here a second time.
"""

import math
from collections import namedtuple

import granular as gr

Contact = namedtuple("Contact", "pair number begin end before after")
Entry = namedtuple("Entry", "ball episode times velocities apart")


def contacts_of(run):
    """Contacts in order of onset, numbered pair by pair."""
    found, count = [], {}
    for row in sorted(run.contacts, key=lambda row: row["t_begin"]):
        c = int(row["pair"])
        before, after = (tuple(map(float, row[name])) for name in ("v_in", "v_out"))
        found.append(Contact(c, count.get(c, 0), float(row["t_begin"]), float(row["t_end"]), before, after))
        count[c] = count.get(c, 0) + 1
    return found


def closing(contact):
    return contact.before[0] - contact.before[1]


def parting(contact):
    return contact.after[1] - contact.after[0]


def bodies(scene, contact):
    return contact.pair, (contact.pair + 1) % scene.n


def endless(contact):
    return math.isnan(contact.end)


def episodes(scene, soft, settling):
    """Number of the episode of every soft contact, every two of which are compared."""
    of = list(range(len(soft)))
    for i, a in enumerate(soft):
        for j, b in enumerate(soft[:i]):
            balls = set(bodies(scene, a)) & set(bodies(scene, b))
            share = any(math.isfinite(scene.mass[ball]) for ball in balls)
            ends = not (endless(a) or endless(b) or {(a.pair, a.number), (b.pair, b.number)} & settling)
            if share and ends and a.begin < b.end and b.begin < a.end and of[i] != of[j]:
                old, new = of[i], of[j]
                of = [new if k == old else k for k in of]
    names = list(dict.fromkeys(of))
    return [names.index(k) for k in of]


class ByHand:
    """Entries of all balls and episodes, and differences of pairs at rest."""

    def __init__(self, report):
        self.report, self.scene = report, report.scene
        self.hard, self.soft = map(contacts_of, report.continued)
        self.counted = tuple(map(contacts_of, report.counted))
        stats = report.continued[0].stats
        self.below = stats.get("merge_below", 0.0 if stats.get("merged") or stats.get("settled") else -1.0)
        self.weight = report.components.weight(report.continued[1]).tolist()
        self.rests = {c: rest for c in range(self.scene.n_pairs) if (rest := self.rest(c)) is not None}
        self.settling = {(r.pair, r.number) for r in [*self.hard, *self.soft] if self.settles(r)}
        self.entries = list(self.departures())

    def of(self, run, pair):
        return [r for r in run if r.pair == pair]

    def settles(self, contact):
        """Whether a contact is one of balls that settle, which rest in both runs."""
        both = [r for run in (self.hard, self.soft) for r in run if r[:2] == contact[:2]]
        rest = self.rests.get(contact.pair)
        return rest is not None and rest[1] and max(map(closing, both)) <= self.weight[contact.pair]

    def rest(self, pair):
        """How far a pair at rest is apart, and whether it rests in both runs; None of other pairs."""
        hard, soft = self.of(self.hard, pair), self.of(self.soft, pair)
        if soft and endless(soft[-1]):
            mine, other = soft, hard
        elif hard and abs(parting(hard[-1])) <= self.below and len(hard) < len(soft):
            mine, other = hard, soft
        else:
            return None
        k = len(mine) - 1
        left = abs(parting(other[-1])) if other else 0.0
        left = 0.0 if math.isnan(left) else left
        both = left <= self.below if other else self.report.continued[0].gap[-1][pair] == 0.0
        sizes = {i: max(abs(parting(r)), closing(r)) for i, r in enumerate(mine[:k]) if i >= len(other)}
        sizes[k] = abs(closing(mine[k]) - closing(other[k])) if len(other) > k else closing(mine[k])
        sizes |= {i: closing(r) - closing(mine[k]) for i, r in enumerate(other) if i > k}
        for i in list(sizes):
            fastest = max(closing(run[i]) for run in (mine, other) if i < len(run))
            if both and fastest <= self.weight[pair]:
                del sizes[i]
        return max([left, *sizes.values()]), both

    def departures(self):
        number, of_hard = episodes(self.scene, self.soft, self.settling), {}
        of = {(r.pair, r.number): e for r, e in zip(self.soft, number, strict=True)}
        of_hard = {k: [r for r in self.hard if of.get(r[:2]) == k and r[:2] not in self.settling] for k in set(number)}
        for episode in sorted(set(number)):
            soft = [r for r, e in zip(self.soft, number, strict=True) if e == episode and r[:2] not in self.settling]
            for ball in range(self.scene.n):
                last = [max((r for r in run if ball in bodies(self.scene, r)), default=None,
                            key=lambda r: math.inf if endless(r) else r.end) for run in (of_hard[episode], soft)]
                if None in last or math.isinf(self.scene.mass[ball]) or endless(last[1]):
                    continue
                times = [r.end for r in last]
                if self.rests_on_a_wall(ball, times[1]):
                    continue
                yield self.entry(ball, episode, last)
            for s in (r for r in soft if not endless(r)):
                for h in (r for r in of_hard[episode] if r[:2] == s[:2]):
                    yield from (self.entry(ball, episode, [h, s]) for ball in bodies(self.scene, s)
                                if self.flies_long(ball, h, s) and not self.rests_on_a_wall(ball, s.end))

    def entry(self, ball, episode, last):
        times, (u, v) = [r.end for r in last], (r.after[bodies(self.scene, r).index(ball)] for r in last)
        return Entry(ball, episode, times, (u, v), min(abs(u - v), abs(self.carried(ball, last, times, u) - v)))

    def flies_long(self, ball, *contacts):
        """Whether a ball flies freely for more than five durations of the soft contact in both runs."""
        if math.isinf(self.scene.mass[ball]):
            return False
        for run, contact in zip((self.hard, self.soft), contacts, strict=True):
            others = [r for r in run if ball in bodies(self.scene, r) and r is not contact]
            later = contact.end + 1e-12 * contact.end
            if any(r.begin <= later and not r.end <= later for r in others):
                return False
            onset, following = min(((r.begin, r[:2]) for r in others if r.begin > later), default=(math.inf, None))
            both = all(following in [r[:2] for r in of] for of in (self.hard, self.soft))
            long = onset - contact.end > 5.0 * (contacts[1].end - contacts[1].begin)
            if not long or not (both or following is None):
                return False
        return True

    def rests_on_a_wall(self, ball, time):
        """Whether contacts without end reach from a wall to the ball, all begun before a time."""
        since = {r.pair: r.begin for r in self.soft if endless(r)}
        ways = [range(ball)] * math.isinf(self.scene.mass[0])
        ways += [range(ball, self.scene.n - 1)] * math.isinf(self.scene.mass[-1])
        return any(all(since.get(c, math.inf) < time for c in way) for way in ways)

    def carried(self, ball, last, times, u):
        """Velocity of the hard ball in free flight towards the time of the soft ball, no longer than the lag."""
        lag = self.lag(last[0])
        elapsed = min(max(times[1] - times[0], -lag), lag)
        scene, omega = self.scene, self.scene.pendulum
        if not omega:
            force = 0.0 if scene.external_force is None else scene.external_force[ball] / scene.mass[ball]
            return u + (force - scene.gravity) * elapsed
        y, w, now = float(scene.displacement[ball]), float(scene.velocity[ball]), 0.0
        for r in self.hard:
            if ball in bodies(scene, r) and r.begin <= last[0].begin:
                turn = omega * (r.begin - now)
                y = y * math.cos(turn) + w / omega * math.sin(turn)
                w, now = r.after[bodies(scene, r).index(ball)], r.begin
        return u * math.cos(omega * elapsed) - omega * y * math.sin(omega * elapsed)

    def lag(self, contact):
        """t_c + min(v_max Σ t_c / v, T)."""
        hard, soft = self.counted
        part = self.component(contact.pair, hard, soft)
        hard, soft = ([r for r in run if r.pair in part] for run in (hard, soft))
        total = sum(self.lasting(r.pair, closing(r)) for r in hard)
        total += sum(r.end - r.begin for r in soft if not endless(r))
        fastest, speed = max(map(closing, [*hard, *soft])), closing(contact)
        span = float(self.report.soft.time[-1] - self.report.soft.time[0])
        return self.lasting(contact.pair, speed) + (min(fastest * total / speed, span) if speed > 0.0 else span)

    def lasting(self, pair, speed):
        slowest = 2.0**-30 * gr.scene.speed_scale(self.scene)
        try:
            return gr.binary.collision(self.report.law[pair], self.scene.pairs[pair], max(abs(speed), slowest)).duration
        except ValueError:
            return 0.0

    def component(self, pair, *runs):
        """Pairs that belong together with one."""
        met, found = {r.pair for run in runs for r in run}, [pair]
        for c in found:
            for other in met - set(found):
                if any(math.isfinite(self.scene.mass[b]) for b in {c, (c + 1) % self.scene.n}
                       & {other, (other + 1) % self.scene.n}):
                    found.append(other)
        return found

    def error_of(self, pairs, unit):
        balls = {b for c in pairs for b in (c, (c + 1) % self.scene.n)}
        sizes = [e.apart for e in self.entries if e.ball in balls]
        return max([0.0, *sizes, *(self.rests[c][0] for c in pairs if c in self.rests)]) / unit

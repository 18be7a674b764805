"""Counts, error and unit from the numbers that a report prints as JSON, without a run and without the package."""

import json
import math
import re
from itertools import pairwise

from tests.helpers.judged_episodes import episodes_of, last_contact, numbered, velocity_after
from tests.helpers.judged_rows import Contact, closing, count, parting

COMPLETE = {"time", "quiet", "until"}


def saved(report, folder):
    """The JSON of a report as Python numbers; null is nan."""
    report.to_json(folder / "report.json")
    return json.loads((folder / "report.json").read_text(encoding="utf-8"))


def rows_of_json(data, run):
    log = data[run]["contacts"]
    columns = zip(*(log[name] for name in ("pair", "t_begin", "t_end", "v_in", "v_out", "impulse")), strict=True)
    return [Contact(c, t, math.nan if end is None else end, before, tuple(after), j, math.nan)
            for c, t, end, before, after, j in columns]


def is_complete(data):
    """Whether both logs hold all that counts: nothing cut, at rest, missing in one run or left out as rounding."""
    hard, soft = rows_of_json(data, "hard"), rows_of_json(data, "soft")
    cut = data.get("rounding_contacts") or {}
    same = all(count(hard, c) == count(soft, c) for c in range(len(data["scene"]["gap"])))
    ended = all(isinstance(v, float) and math.isfinite(v) for r in (*hard, *soft) for v in (*r.after, r.end))
    apart = all(b.begin - a.begin > 1e-9 * b.begin for a, b in pairwise(hard))
    statuses = {data[run]["status"] for run in ("hard", "soft")}
    return same and ended and apart and not any(cut.values()) and statuses <= COMPLETE


class Recomputed:
    """Components, counts and the error from a JSON whose logs are complete."""

    def __init__(self, data):
        scene = data["scene"]
        self.scene, self.mass = scene, [float(m) for m in scene["mass"]]
        self.walls, self.n = [math.isinf(m) for m in self.mass], len(scene["mass"])
        self.hard, self.soft = rows_of_json(data, "hard"), rows_of_json(data, "soft")
        self.counts = {c: (count(self.hard, c), count(self.soft, c)) for c in range(len(scene["gap"]))}
        self.errors = [self.error_of(pairs) for pairs in self.components()]
        self.error = max(self.errors, default=0.0)

    def bodies(self, pair):
        return pair, (pair + 1) % self.n

    def components(self):
        """Pairs with contacts, joined at common balls."""
        met = [c for c, numbers in self.counts.items() if any(numbers)]
        groups = [{c} for c in met]
        for c in met:
            above = (c + 1) % self.n
            if above in met and not self.walls[above]:
                mine, other = (next(group for group in groups if pair in group) for pair in (c, above))
                if mine is not other:
                    groups = [group for group in groups if group is not mine and group is not other] + [mine | other]
        return groups

    def acceleration(self, ball):
        force = self.scene["external_force"]
        return (force[ball] / self.mass[ball] if force else 0.0) - self.scene["gravity"]

    def error_of(self, pairs):
        hard, soft = ([r for r in rows if r.pair in pairs] for rows in (self.hard, self.soft))
        unit = max(max(closing(r), parting(r) if closing(r) <= 0.0 else 0.0) for r in (*hard, *soft))
        one, other = numbered(hard), numbered(soft)
        apart = [0.0]
        for episode in episodes_of(other, self.bodies, self.walls):
            for ball in {b for c, _ in episode for b in self.bodies(c) if not self.walls[b]}:
                h, s = (last_contact(contacts, episode, ball, self.bodies) for contacts in (one, other))
                u, v = (velocity_after(row, ball, self.bodies) for row in (h, s))
                apart.append(min(abs(u - v), abs(u + self.acceleration(ball) * (s.end - h.end) - v)))
        return max(apart) / unit


def numbers_of_verdict(verdict):
    """The error named by a verdict and whether it is an upper bound; the two counts of a pair; None if not named."""
    number = r"(\d+(?:\.\d+)?(?:e[-+]?\d+)?)"
    bound = re.search(rf"within {number} %", verdict)
    off = re.search(rf"(?:an error of|outcomes differ by) {number} %", verdict)
    counts = re.search(r"has (\d+) contacts?, not (\d+)", verdict)
    return (0.01 * float(bound[1]) if bound else None, 0.01 * float(off[1]) if off else None,
            (int(counts[1]), int(counts[2])) if counts else None)

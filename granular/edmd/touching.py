"""Touching groups in a run: which pairs touch now, their collision as a whole, and what rounding leaves of it."""

from __future__ import annotations

import math

from granular._flight import gap_after
from granular.edmd.groups import RULES, Row
from granular.edmd.merge import release
from granular.edmd.model import Model
from granular.edmd.motion import NOISE, carry
from granular.edmd.state import State


def group(c: int, now: float, s: State) -> tuple[int, int]:
    """Return the first and the last pair of the group around pair `c` that touches at time `now`, without tolerance."""
    first = last = c
    while first > 0 and _touches(first - 1, now, s):
        first -= 1
    while last + 1 < len(s.pairs) and _touches(last + 1, now, s):
        last += 1
    return first, last


def _touches(c: int, now: float, s: State) -> bool:
    pair, a = s.pairs[c], s.pairs[c].pull
    rate = (s.bodies[c + 1].u - s.bodies[c].u) - a * pair.at
    return bool(gap_after(pair.gap, rate, a, now - pair.at) <= 0.0)


def velocities(first: int, last: int, now: float, s: State) -> Row:
    """Return the velocities (m/s) of the bodies of the group at time `now`."""
    fallen = s.run.gravity * now
    return [body.u - body.falls * fallen for body in s.bodies[first : last + 2]]


def impulses(c: int, first: int, last: int, s: State, m: Model) -> Row:
    """Return the impulses (kg m/s) of pairs `first` … `last`, which touch pair `c` now, by the tie rule."""
    for k in range(max(first - 1, 0), min(last + 2, len(s.pairs))):
        s.run.clamps += carry(s.pairs[k], s.bodies[k], s.bodies[k + 1], s.now)
    s.pairs[c].gap = 0.0
    release(s.run, s.pairs, s.bodies, first, last + 1, s.now)
    rate = [_rate(k, s) for k in range(first, last + 1)]
    if m.rule is None:
        eps = [pair.eps for pair in s.pairs[first : last + 1]]
    else:
        eps = [m.rule(k, max(0.0, -r)) for k, r in zip(range(first, last + 1), rate, strict=True)]
    bodies = s.bodies[first : last + 2]
    if bodies[0].mass == math.inf == bodies[-1].mass and (m.ties == "reflect" or bodies[-1].u < bodies[0].u):
        why = "walls that close on them leave no way out" if m.ties != "reflect" else "use ties='poisson'"
        raise ValueError(f"ties is {m.ties!r}: balls wedged between two walls have no such collision; {why}.")
    return RULES[m.ties]([1.0 / body.mass for body in bodies], rate, eps)


def apply(first: int, last: int, p: Row, s: State) -> None:
    """Change the velocities by impulses `p`, and make rates that are only rounding exactly 0, or they collide again."""
    for c in range(first, last + 1):
        lower, upper = s.bodies[c], s.bodies[c + 1]
        s.pairs[c].gap = 0.0
        lower.u -= p[c - first] / lower.mass
        upper.u += p[c - first] / upper.mass
    bodies = s.bodies[first : last + 2]
    fastest = max(abs(body.u) for body in bodies)
    doubt = max(body.noise for body in bodies) + NOISE * (fastest * fastest)
    for body in bodies:
        body.noise = doubt
    tiny, c = fastest * 2.0**-40, first
    while c <= last:
        end = c
        while end <= last and abs(_rate(end, s)) <= tiny:
            end += 1
        _go_together(c, end, s)
        c = end + 1


def _rate(c: int, s: State) -> float:
    rate: float = (s.bodies[c + 1].u - s.bodies[c].u) - s.pairs[c].pull * s.now
    return rate


def _go_together(first: int, last: int, s: State) -> None:
    """Give bodies `first` … `last` the velocity of the heaviest of them.

    All of them that one: were it done pair by pair, a light ball between two heavy ones would leave the first it was
    given to.
    """
    heaviest = max(range(first, last + 1), key=lambda i: s.bodies[i].mass)
    for i in range(heaviest, last):
        s.bodies[i + 1].u = s.bodies[i].u + s.pairs[i].pull * s.now
    for i in range(heaviest, first, -1):
        s.bodies[i - 1].u = s.bodies[i].u - s.pairs[i - 1].pull * s.now

"""Touching groups in a run: which pairs touch now, their collision as a whole, and what rounding leaves of it."""

from __future__ import annotations

import math

from granular._flight import gap_after
from granular.edmd.groups import Row
from granular.edmd.merge import repull
from granular.edmd.model import Model
from granular.edmd.motion import NOISE, carry
from granular.edmd.state import State


def group(c: int, now: float, s: State) -> tuple[int, int]:
    """Return the first and the last pair of the group around pair `c` that touches at time `now`, without tolerance."""
    first = last = c
    while first > 0 and _touches(first - 1, now, s):
        first -= 1
    while last + 1 < len(s.gap) and _touches(last + 1, now, s):
        last += 1
    return first, last


def _touches(c: int, now: float, s: State) -> bool:
    a = s.pull[c]
    return bool(gap_after(s.gap[c], (s.u[c + 1] - s.u[c]) - a * s.at[c], a, now - s.at[c]) <= 0.0)


def release(first: int, last: int, now: float, s: State, m: Model) -> None:
    """Let the balls of the group that are at rest fall again."""
    g = m.gravity
    for i in range(first, last + 2):
        if s.falls[i] == 0.0 and m.mass[i] < math.inf:
            s.falls[i] = 1.0
            s.u[i] += g * now
    repull(max(first - 1, 0), min(last + 1, len(s.gap) - 1), g, s.falls, s.pull)


def velocities(first: int, last: int, now: float, s: State, m: Model) -> Row:
    """Return the velocities (m/s) of the bodies of the group at time `now`."""
    return [s.u[i] - s.falls[i] * (m.gravity * now) for i in range(first, last + 2)]


def impulses(c: int, first: int, last: int, now: float, s: State, m: Model) -> Row:
    """Return the impulses (kg m/s) of pairs `first` … `last`, which touch pair `c` at time `now`, by the tie rule."""
    for k in range(max(first - 1, 0), min(last + 2, len(s.gap))):
        s.tally[0] += carry(k, now, s.u, s.gap, s.at, s.pull)
    s.gap[c] = 0.0
    release(first, last, now, s, m)
    rate = [(s.u[c + 1] - s.u[c]) - s.pull[c] * now for c in range(first, last + 1)]
    if m.rule is None:
        eps = m.eps[first : last + 1]
    else:
        eps = [m.rule(c, max(0.0, -r)) for c, r in zip(range(first, last + 1), rate, strict=True)]
    inverse_mass = [1.0 / x for x in m.mass[first : last + 2]]
    if inverse_mass[0] == 0.0 == inverse_mass[-1] and (m.ties == "reflect" or s.u[last + 1] < s.u[first]):
        why = "walls that close on them leave no way out" if m.ties != "reflect" else "use ties='poisson'"
        raise ValueError(f"ties is {m.ties!r}: balls wedged between two walls have no such collision; {why}.")
    assert m.solver is not None
    return m.solver(inverse_mass, rate, eps)


def apply(first: int, last: int, p: Row, now: float, s: State, m: Model) -> None:
    """Change the velocities by impulses `p`, and make rates that are only rounding exactly 0, or they collide again."""
    for c in range(first, last + 1):
        s.gap[c] = 0.0
        s.u[c] -= p[c - first] / m.mass[c]
        s.u[c + 1] += p[c - first] / m.mass[c + 1]
    fastest = max(abs(v) for v in s.u[first : last + 2])
    doubt = max(s.noise[first : last + 2]) + NOISE * (fastest * fastest)
    for i in range(first, last + 2):
        s.noise[i] = doubt
    noise, c = fastest * 2.0**-40, first
    while c <= last:
        end = c
        while end <= last and _is_noise(end, now, s, noise):
            end += 1
        _go_together(c, end, now, s, m)
        c = end + 1


def _is_noise(c: int, now: float, s: State, noise: float) -> bool:
    return bool(abs((s.u[c + 1] - s.u[c]) - s.pull[c] * now) <= noise)


def _go_together(first: int, last: int, now: float, s: State, m: Model) -> None:
    """Give bodies `first` … `last` the velocity of the heaviest of them.

    All of them that one: were it done pair by pair, a light ball between two heavy ones would leave the first it was
    given to.
    """
    heaviest = max(range(first, last + 1), key=lambda i: m.mass[i])
    for i in range(heaviest, last):
        s.u[i + 1] = s.u[i] + s.pull[i] * now
    for i in range(heaviest, first, -1):
        s.u[i - 1] = s.u[i] - s.pull[i - 1] * now

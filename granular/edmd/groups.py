"""Simultaneous collisions of a touching group, solved as a whole by the rules of `ties`.
May be skipped: rarer, balls that touch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

from granular._kernels import kernel, rare
from granular._records import Records, twin
from granular.edmd import hanging
from granular.edmd.collision import release
from granular.edmd.motion import NOISE, carry, predicted, same, touches, velocities
from granular.edmd.physics import Physics
from granular.edmd.records import BUDGET, ROW, TOUCHING, UNTIL, Walls
from granular.edmd.state import State
from granular.edmd.ties import RULES, Row, gave_up, velocity_changes
from granular.edmd.wall_state import enter
from granular.scene.flags import FORCED, RING

Fit = Callable[[Any], Any]
"""Makes kernels fit the scene."""
Log = list[Any]
"""The log: chunks of records `ROW`, as arrays or as lists of plain objects."""


@rare
@kernel
def is_touched(pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> bool:
    """Return whether a neighbour of pair `c` touches at time `now`. A hit on a thermal wall has none."""
    n = len(pairs)
    if FORCED and pairs[c].heat >= 0:
        return False
    for side in (c - 1, c + 1):
        k = side % n if RING else side
        if 0 <= k < n and touches(pairs[k], bodies[k], bodies[k + 1], now, walls):
            return True
    return False


@rare
@kernel
def group(pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Return the first and the last pair of the group around pair `c` that touches at time `now`, without tolerance."""
    first = last = c
    while first > 0 and touches(pairs[first - 1], bodies[first - 1], bodies[first], now, walls):
        first -= 1
    while last + 1 < len(pairs) and touches(pairs[last + 1], bodies[last + 1], bodies[last + 2], now, walls):
        last += 1
    return first, last


def collide_as_one(s: State, physics: Physics, fit: Fit, log: Log | None) -> tuple[int, int, int]:
    """Let the group that touches the suspect now collide by the tie rule; return why to pause, else `TOUCHING`.

    Before it: the contact to stop at is among its own, or they are more than the run may still have. Returns, too, the
    first and the last pair to predict anew.
    """
    return (_collide_around if s.ring else _collide)(s, physics, fit, log)


def _collide(s: State, physics: Any, fit: Fit, log: Log | None) -> tuple[int, int, int]:
    """Do so on a line."""
    run, c, now = s.run, s.run.suspect, s.run.now
    first, last = fit(group)(s.pairs, s.bodies, c, now, s.walls)
    p = _impulses(first, last, s, physics, fit)
    hit = [k for k in range(first, last + 1) if p[k - first] > 0.0]
    if run.stop_pair in hit and s.pairs[run.stop_pair].contacts >= run.stop_contacts:
        return UNTIL, c, c
    if run.events + len(hit) > s.clock.last_event:
        return BUDGET, c, c
    before = _velocities(first, last, s, fit)
    if s.hung:
        inverse_mass = [1.0 / body.mass for body in s.bodies[first : last + 2]]
        hanging.strike(s, first, [_rate(k, s) for k in range(first, last + 1)], velocity_changes(inverse_mass, p))
    else:
        _apply(first, last, p, s)
    parted = _velocities(first, last, s, fit)
    if s.walls is not None:
        for k, x, closing, opening in zip(range(first, last + 1), p, pairwise(before), pairwise(parted), strict=True):
            rates = (closing[1] - closing[0]) + (opening[1] - opening[0])
            enter(s.bodies[k], s.bodies[k + 1], x, -0.5 * x * rates, s.walls)
    for k in hit:
        s.pairs[k].contacts, s.pairs[k].last = s.pairs[k].contacts + 1, now
    if log is not None:
        row: Any = twin(ROW)
        log.append([row(first + i, now, *before[i : i + 2], *parted[i : i + 2], x) for i, x in enumerate(p) if x > 0.0])
    run.events += len(hit)
    if not hit and fit(predicted)(s.pairs[c], s.bodies[c], s.bodies[c + 1], s.walls) <= now:
        raise gave_up(physics.options["ties"])
    return TOUCHING, max(first - 1, 0), min(last + 1, len(s.pairs) - 1)


def _collide_around(s: State, physics: Physics, fit: Fit, log: Log | None) -> tuple[int, int, int]:
    """Do so on the line that begins behind the largest gap of a ring."""
    run, n, rows = s.run, len(s.pairs), None if log is None else list[Any]()
    widest = int(s.row(run.now)[1].argmax())
    k = (widest + 1) % n
    run.clamps += fit(carry)(s.pairs[widest], s.bodies[widest], s.bodies[widest + 1], run.now, None)
    asked = run.suspect, run.stop_pair
    run.suspect, run.stop_pair = ((c - k) % n if c >= 0 else c for c in asked)
    rule = physics.rule and (lambda c, speed: physics.rule((c + k) % n, speed))
    line = replace(s, pairs=s.pairs[k:] + s.pairs[:k], bodies=s.bodies[k:n] + s.bodies[: k + 1])
    counted: Any = SimpleNamespace(rule=rule, options=physics.options)
    why, first, last = _collide(line, counted, fit, rows)
    run.suspect, run.stop_pair = asked
    same(s.bodies[n], s.bodies[0])
    for chunk in rows or ():
        for row in chunk:
            row.pair = (row.pair + k) % n
    if log is not None and rows:
        log += rows
    if first == 0 or last >= n - 2:  # the largest gap is beside them
        return why, 0, n - 1
    return why, (first + k) % n, (first + k) % n + last - first


def _impulses(first: int, last: int, s: State, physics: Physics, fit: Fit) -> Row:
    """Return the impulses (kg m/s) of pairs `first` … `last`, which touch now, by the tie rule."""
    ties, rule, bodies = physics.options["ties"], physics.rule, s.bodies[first : last + 2]
    for k in range(max(first - 1, 0), min(last + 2, len(s.pairs))):
        s.run.clamps += fit(carry)(s.pairs[k], s.bodies[k], s.bodies[k + 1], s.run.now, s.walls)
    s.pairs[s.run.suspect].gap = 0.0
    fit(release)(s.run, s.pairs, s.bodies, first, last + 1, s.run.now, s.walls)
    rate = [_rate(k, s) for k in range(first, last + 1)]
    eps = [s.pairs[k].eps if rule is None else rule(k, max(0.0, -r)) for k, r in enumerate(rate, first)]
    meet = bodies[-1].fall_velocity < bodies[0].fall_velocity
    if bodies[0].mass == math.inf == bodies[-1].mass and (ties == "reflect" or meet):
        why = "walls that close on them leave no way out" if ties != "reflect" else "use ties='poisson'"
        raise ValueError(f"ties is {ties!r}: balls wedged between two walls have no such collision; {why}.")
    return RULES[ties]([1.0 / body.mass for body in bodies], rate, eps)


def _velocities(first: int, last: int, s: State, fit: Fit) -> Row:
    """Return the velocities (m/s) of the bodies of the group now."""
    return [fit(velocities)(body, body, s.run.gravity, s.run.now)[0] for body in s.bodies[first : last + 2]]


def _apply(first: int, last: int, p: Row, s: State) -> None:
    """Change the velocities by impulses `p`, and make rates that are only rounding exactly 0, or they collide again."""
    for c in range(first, last + 1):
        lower, upper = s.bodies[c], s.bodies[c + 1]
        s.pairs[c].gap = 0.0
        lower.fall_velocity -= p[c - first] / lower.mass
        upper.fall_velocity += p[c - first] / upper.mass
    bodies = s.bodies[first : last + 2]
    fastest = max(abs(body.fall_velocity) for body in bodies)
    doubt = max(body.noise for body in bodies) + NOISE * (fastest * fastest)
    for body in bodies:
        body.noise = doubt if body.mass < math.inf else body.noise
    parted = [c + 1 for c in range(first, last + 1) if abs(_rate(c, s)) > fastest * 2.0**-40]
    for low, high in pairwise([first, *parted, last + 2]):
        _go_together(low, high - 1, s)


def _rate(c: int, s: State) -> float:
    pair, lower, upper = s.pairs[c], s.bodies[c], s.bodies[c + 1]
    rate: float = pair.rate if s.hung else (
        (upper.fall_velocity - lower.fall_velocity) - pair.closing_acceleration * s.run.now)
    return rate


def _go_together(first: int, last: int, s: State) -> None:
    """Give bodies `first` … `last` the velocity of the heaviest of them.

    All of them that one: were it done pair by pair, a light ball between two heavy ones would leave the first it was
    given to.
    """
    heaviest = max(range(first, last + 1), key=lambda i: s.bodies[i].mass)
    for i in range(heaviest, last):
        s.bodies[i + 1].fall_velocity = s.bodies[i].fall_velocity + s.pairs[i].closing_acceleration * s.run.now
    for i in range(heaviest, first, -1):
        s.bodies[i - 1].fall_velocity = s.bodies[i].fall_velocity - s.pairs[i - 1].closing_acceleration * s.run.now

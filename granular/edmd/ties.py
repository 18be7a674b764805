"""Simultaneous collisions of a touching group of pairs, solved as a whole.

Collisions that act one after the other are ordered by `physics.rank` instead. For stuck bodies see
`granular.edmd.motion`.

Newton's rule, Poisson's rule and generalised reflections are pure functions. Their arguments are the inverse masses
(1/kg) of m + 1 bodies, the rates of their m touching pairs (m/s, negative while approaching), and the coefficient of
restitution of each pair. They return the impulses p ≥ 0 (kg m/s) of the pairs.

The rates after the impulses p are rate + W p. The Delassus matrix W is tridiagonal, W_cc = 1/m_c + 1/m_{c+1}, W_{c,c+1}
= -1/m_{c+1}, and an M-matrix. The set of active pairs of its complementarity problem only grows, so the solution is
exact after at most m rounds.

Sources: Moreau (1988) for Newton's rule; Glocker & Pfeiffer, Nonlinear Dyn. 7, 471 (1995) for Poisson's rule; Smith,
Kaufman, Vouga, Tamstorf & Grinspun, ACM Trans. Graph. 31, 106 (2012) for reflections; Chandrasekaran (1970) for the
algorithm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

from granular._engine.kernels import FORCED, RING, kernel, rare
from granular._engine.records import Records, plain_class
from granular.edmd import hanging
from granular.edmd.collision import release_bodies
from granular.edmd.motion import COLLISION_NOISE, advance_pair, copy_ball, next_event_time, touches, velocities
from granular.edmd.physics import Physics
from granular.edmd.records import BUDGET, LOG_ROW, TOUCHING, UNTIL, Log, Walls
from granular.edmd.state import State
from granular.edmd.wall_state import account_impulse

Row = list[float]
Floats = Sequence[float]
Solver = Callable[[Floats, Floats, Floats], Row]
MAX_PASSES = 10_000
"""Largest number of repetitions of a rule."""
Fit = Callable[[Any], Any]
"""Type of a function that specialises a kernel for the flags of the scene."""


@rare
@kernel
def is_touched(pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> bool:
    """Return whether a neighbouring pair of pair `c` touches at time `now`.

    The result is False for a hit on a thermal wall.
    """
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
def touching_group(pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Return the first and the last pair of the touching group around pair `c`.

    A pair belongs to the group if its gap at time `now` is not positive. No tolerance is applied.
    """
    first = last = c
    while first > 0 and touches(pairs[first - 1], bodies[first - 1], bodies[first], now, walls):
        first -= 1
    while last + 1 < len(pairs) and touches(pairs[last + 1], bodies[last + 1], bodies[last + 2], now, walls):
        last += 1
    return first, last


def collide_as_one(s: State, physics: Physics, fit: Fit, log: Log | None) -> tuple[int, int, int]:
    """Apply the simultaneous collisions of the touching group around `run.suspect`.

    The tie rule of `physics` gives the impulses. `fit` specialises kernels, and `log` receives the log rows. Returns
    `TOUCHING` if the group has collided. Otherwise the return value is the reason of a pause: `UNTIL` if the stop
    contact is in the group, or `BUDGET` if too few events are left. Nothing has changed then. The other two values are
    the first and the last pair to predict again.
    """
    return (_collide_on_ring if s.ring else _collide_on_line)(s, physics, fit, log)


def _collide_on_line(s: State, physics: Any, fit: Fit, log: Log | None) -> tuple[int, int, int]:
    """Apply the simultaneous collisions of a group on a line, as `collide_as_one`."""
    run, c, now = s.run, s.run.suspect, s.run.now
    first, last = fit(touching_group)(s.pairs, s.bodies, c, now, s.walls)
    p = _impulses(first, last, s, physics, fit)
    colliding = [k for k in range(first, last + 1) if p[k - first] > 0.0]
    # Checked before any velocity changes.
    if run.stop_pair in colliding and s.pairs[run.stop_pair].contacts >= run.stop_contacts:
        return UNTIL, c, c
    if run.events + len(colliding) > s.clock.last_event:
        return BUDGET, c, c
    velocities_before = _velocities(first, last, s, fit)
    if s.hung:
        inverse_mass = [1.0 / body.mass for body in s.bodies[first : last + 2]]
        before = [_rate(k, s) for k in range(first, last + 1)]
        hanging.collide_pendula(s, first, before, velocity_changes(inverse_mass, p))
    else:
        _apply(first, last, p, s)
    velocities_after = _velocities(first, last, s, fit)
    if s.walls is not None:
        for k, x, closing, opening in zip(
            range(first, last + 1), p, pairwise(velocities_before), pairwise(velocities_after), strict=True
        ):
            rates = (closing[1] - closing[0]) + (opening[1] - opening[0])
            account_impulse(s.bodies[k], s.bodies[k + 1], x, -0.5 * x * rates, s.walls)
    for k in colliding:
        s.pairs[k].contacts, s.pairs[k].last = s.pairs[k].contacts + 1, now
    if log is not None:
        log.append([plain_class(LOG_ROW)(first + i, now, *velocities_before[i : i + 2], *velocities_after[i : i + 2], x)
                    for i, x in enumerate(p) if x > 0.0])
    run.events += len(colliding)
    # Without an impulse the same event would repeat forever.
    if not colliding and fit(next_event_time)(s.pairs[c], s.bodies[c], s.bodies[c + 1], s.walls) <= now:
        raise convergence_error(physics.options["ties"])
    return TOUCHING, max(first - 1, 0), min(last + 1, len(s.pairs) - 1)


def _collide_on_ring(s: State, physics: Physics, fit: Fit, log: Log | None) -> tuple[int, int, int]:
    """Apply the simultaneous collisions of a group on a ring, as `collide_as_one`.

    The ring is cut at the largest gap, and its pairs are numbered from there as on a line. The record of the run is
    shared with the line, so its pair numbers are changed during the collision.
    """
    run, n, rows = s.run, len(s.pairs), None if log is None else list[Any]()
    widest = int(s.row(run.now)[1].argmax())
    k = (widest + 1) % n
    run.clamps += fit(advance_pair)(s.pairs[widest], s.bodies[widest], s.bodies[widest + 1], run.now, None)
    scene_numbers = run.suspect, run.stop_pair
    run.suspect, run.stop_pair = ((c - k) % n if c >= 0 else c for c in scene_numbers)
    pair_rule: Any = physics.rule
    rule = None if pair_rule is None else lambda c, speed: pair_rule((c + k) % n, speed)
    line = replace(s, pairs=s.pairs[k:] + s.pairs[:k], bodies=s.bodies[k:n] + s.bodies[: k + 1])
    why, first, last = _collide_on_line(line, SimpleNamespace(rule=rule, options=physics.options), fit, rows)
    run.suspect, run.stop_pair = scene_numbers
    copy_ball(s.bodies[n], s.bodies[0])
    for chunk in rows or ():
        for row in chunk:
            row.pair = (row.pair + k) % n
    if log is not None and rows:
        log += rows
    # Then the pairs to predict again include the largest gap.
    if first == 0 or last >= n - 2:
        return why, 0, n - 1
    return why, (first + k) % n, (first + k) % n + last - first


def _impulses(first: int, last: int, s: State, physics: Physics, fit: Fit) -> Row:
    """Return the impulses (kg m/s) of the touching pairs `first` to `last`.

    Before, the pairs are advanced to the current time, and stuck bodies are released.
    """
    ties, rule, bodies = physics.options["ties"], physics.rule, s.bodies[first : last + 2]
    for k in range(max(first - 1, 0), min(last + 2, len(s.pairs))):
        s.run.clamps += fit(advance_pair)(s.pairs[k], s.bodies[k], s.bodies[k + 1], s.run.now, s.walls)
    # The suspect collides now; its gap can differ from 0 by rounding.
    s.pairs[s.run.suspect].gap = 0.0
    fit(release_bodies)(s.run, s.pairs, s.bodies, first, last + 1, s.run.now, s.walls)
    rate = [_closing_rate(k, s) for k in range(first, last + 1)]
    eps = [s.pairs[k].eps if rule is None else rule(k, max(0.0, -r)) for k, r in enumerate(rate, first)]
    walls_approach = bodies[-1].fall_velocity < bodies[0].fall_velocity
    if bodies[0].mass == math.inf == bodies[-1].mass and (ties == "reflect" or walls_approach):
        reason = "The walls approach each other, so the balls cannot separate." if ties != "reflect" else (
            "Use ties='poisson'.")
        raise ValueError(f"ties={ties!r} has no solution for balls wedged between two walls. {reason}")
    return TIE_RULES[ties]([1.0 / body.mass for body in bodies], rate, eps)


def _velocities(first: int, last: int, s: State, fit: Fit) -> Row:
    """Return the velocities (m/s) of the bodies of the group at the current time."""
    return [fit(velocities)(body, body, s.run.gravity, s.run.now)[0] for body in s.bodies[first : last + 2]]


def _apply(first: int, last: int, p: Row, s: State) -> None:
    """Apply the impulses `p` (kg m/s) to the fall velocities of the bodies of a group.

    Relative velocities that consist of rounding errors become exactly 0. Otherwise the pairs would collide again.
    """
    for c in range(first, last + 1):
        lower, upper = s.bodies[c], s.bodies[c + 1]
        s.pairs[c].gap = 0.0
        lower.fall_velocity -= p[c - first] / lower.mass
        upper.fall_velocity += p[c - first] / upper.mass
    bodies = s.bodies[first : last + 2]
    fastest = max([abs(body.fall_velocity) for body in bodies])
    # One bound for the group, because every impulse depends on all rates.
    common_noise = max([body.noise for body in bodies]) + COLLISION_NOISE * (fastest * fastest)
    for body in bodies:
        body.noise = common_noise if body.mass < math.inf else body.noise
    separating = [c + 1 for c in range(first, last + 1) if abs(_rate(c, s)) > fastest * 2.0**-40]
    for low, high in pairwise([first, *separating, last + 2]):
        _set_common_velocity(low, high - 1, s)


def _rate(c: int, s: State) -> float:
    pair, lower, upper = s.pairs[c], s.bodies[c], s.bodies[c + 1]
    return float(pair.rate if s.hung else
                 (upper.fall_velocity - lower.fall_velocity) - pair.closing_acceleration * s.run.now)


def _closing_rate(c: int, s: State) -> float:
    """Return the rate (m/s) of pair `c`, or 0 for an approach below its noise."""
    rate, below, above = _rate(c, s), s.bodies[c], s.bodies[c + 1]
    return 0.0 if rate < 0.0 and rate * rate < below.noise + above.noise else rate


def _set_common_velocity(first: int, last: int, s: State) -> None:
    """Give bodies `first` to `last` the velocity of the heaviest of these bodies.

    If pairs were treated one by one, the velocity of a light ball between two heavy balls would change twice. The light
    ball would then separate from the first heavy ball.
    """
    heaviest = max(range(first, last + 1), key=lambda i: s.bodies[i].mass)
    for i in range(heaviest, last):
        s.bodies[i + 1].fall_velocity = s.bodies[i].fall_velocity + s.pairs[i].closing_acceleration * s.run.now
    for i in range(heaviest, first, -1):
        s.bodies[i - 1].fall_velocity = s.bodies[i].fall_velocity - s.pairs[i - 1].closing_acceleration * s.run.now


def newton(inverse_mass: Floats, rate: Floats, eps: Floats) -> Row:
    """Return the impulses of Newton's rule: new rates ≥ -ε times the old rates.

    The rule is repeated while pairs approach. It requires the same ε for all pairs, because different values can
    multiply the energy.
    """
    return _repeated_impulses("newton", inverse_mass, rate, lambda now, _: complementary_impulses(
        inverse_mass, [(1.0 + e) * r for e, r in zip(eps, now, strict=True)]))


def poisson(inverse_mass: Floats, rate: Floats, eps: Floats) -> Row:
    """Return the impulses of Poisson's rule: compression, then expansion.

    The compression stops all approach. The expansion returns ε times its impulses. The rule accepts any ε per pair and
    never increases the energy.
    """
    compression = complementary_impulses(inverse_mass, rate)
    left = zip(compression, rates_after(inverse_mass, rate, compression), strict=True)
    expansion = [e * p for e, p in zip(eps, compression, strict=True)]
    rates = rates_after(inverse_mass, [0.0 if p > 0.0 else r for p, r in left], expansion)
    remaining = complementary_impulses(inverse_mass, rates)
    return [a + b + c for a, b, c in zip(compression, expansion, remaining, strict=True)]


def reflect(inverse_mass: Floats, rate: Floats, eps: Floats) -> Row:
    """Return the impulses of generalised reflections.

    All approaching pairs reverse their rates simultaneously, and this is repeated until no pair approaches. The rule
    requires the same ε for all pairs. The result is ε times these elastic impulses plus 1 - ε times the impulses that
    stop all approach. The repetition does not end if walls confine the group at both ends.
    """
    e = eps[0]
    elastic = _repeated_impulses("reflect", inverse_mass, rate, lambda now, approaching: solve(
        inverse_mass, [-2.0 * r for r in now], approaching))
    if e == 1.0:
        return elastic
    return [e * a + (1.0 - e) * b for a, b in zip(elastic, complementary_impulses(inverse_mass, rate), strict=True)]


def _repeated_impulses(
    name: str, inverse_mass: Floats, rate: Floats, impulses: Callable[[Row, list[bool]], Row]
) -> Row:
    """Return the sum of impulses that are computed again until no pair approaches.

    `impulses` is called with the current rates (m/s) and with a flag per pair that is True if the pair approaches.
    `name` is the name of the rule. Raises `ValueError` if the number of repetitions exceeds `MAX_PASSES`.
    """
    total, now, tiny = [0.0] * len(rate), list(rate), rounding_bound(rate)
    for _ in range(MAX_PASSES):
        approaching = [r < -tiny for r in now]
        if not any(approaching):
            return total
        p = impulses(now, approaching)
        now = rates_after(inverse_mass, now, p)
        total = [a + b for a, b in zip(total, p, strict=True)]
    raise convergence_error(name)


TIE_RULES: dict[str, Solver] = {"newton": newton, "poisson": poisson, "reflect": reflect}


def complementary_impulses(inverse_mass: Floats, q: Floats) -> Row:
    """Solve 0 ≤ p ⟂ W p + q ≥ 0 for p, with a growing set of active pairs."""
    active, tiny, pinned = [x < 0.0 for x in q], rounding_bound(q), inverse_mass[0] == 0.0 and inverse_mass[-1] == 0.0
    while True:
        p = solve(inverse_mass, [-x for x in q], active)
        grown = [a or r < -tiny for a, r in zip(active, rates_after(inverse_mass, q, p), strict=True)]
        # Between two walls the rates sum to 0. If all pairs are active, the last one is rounding.
        if grown == active or (pinned and all(grown)):
            return p
        active = grown


def solve(inverse_mass: Floats, right: Floats, active: Sequence[bool]) -> Row:
    """Solve W p = right on the active pairs by elimination, with p = 0 elsewhere."""
    m = len(right)
    p, pivot, load = [0.0] * (m + 1), [0.0] * m, [0.0] * m
    for c in range(m):
        if active[c]:
            diagonal = inverse_mass[c] + inverse_mass[c + 1]
            factor = inverse_mass[c] / pivot[c - 1] if c > 0 and pivot[c - 1] > 0.0 else 0.0
            left = diagonal - factor * inverse_mass[c]
            # Between two walls W is singular: the last pivot is a rounding error, and its impulse is set to 0.
            pivot[c] = left if left >= 1e-14 * diagonal else 0.0
            load[c] = right[c] + factor * load[c - 1]
    for c in range(m - 1, -1, -1):
        if pivot[c] > 0.0:
            p[c] = (load[c] + inverse_mass[c + 1] * p[c + 1]) / pivot[c]
    return p[:m]


def rates_after(inverse_mass: Floats, rate: Floats, p: Floats) -> Row:
    """Return the rates (m/s) after impulses `p`: rate + W p."""
    change = pairwise(velocity_changes(inverse_mass, p))
    return [r + (upper - lower) for r, (lower, upper) in zip(rate, change, strict=True)]


def velocity_changes(inverse_mass: Floats, p: Floats) -> Row:
    """Return the velocity changes (m/s) of the bodies by impulses `p` of the pairs."""
    return [w * (below - above) for w, (below, above) in zip(inverse_mass, pairwise([0.0, *p, 0.0]), strict=True)]


def rounding_bound(rate: Floats) -> float:
    """Return a bound of the rounding error (m/s) of rates of this size."""
    return max(map(abs, rate)) * 2.0**-46


def convergence_error(rule: str) -> ValueError:
    """Return the exception for a rule that did not converge."""
    alternative = "left" if rule == "poisson" else "poisson"
    return ValueError(
        f"ties={rule!r} did not converge within {MAX_PASSES} passes on a touching group. Use ties={alternative!r}."
    )

"""Simultaneous collisions: which acts first, and touching groups solved as a whole.
May be skipped: rarer, collisions at one instant.

The queue is ordered by ``(time, rank)``. The lower 24 bits of a rank are the number of its pair, so a rank says whose
it is; the upper bits order pairs at equal times, and only then: from the left, from the right, or at random by a hash
of the seed, the pair and how often it has collided (Han & Gilmore's sequential treatment, reproducible).

Newton, Poisson and generalised reflections solve a touching group as a whole: pure functions on the inverse masses
(1/kg) of m + 1 bodies and the rates (m/s, negative: approaching) of their m touching pairs; they return the impulses
p ≥ 0 (kg m/s) of the pairs. The Delassus matrix W is tridiagonal, W_cc = 1/m_c + 1/m_{c+1}, W_{c,c+1} = -1/m_{c+1},
and an M-matrix: the set of active pairs of its complementarity problem only grows, so the solution is exact after at
most m rounds.

Sources: Moreau (1988) for Newton's rule; Glocker & Pfeiffer, Nonlinear Dyn. 7, 471 (1995) for Poisson's; Smith,
Kaufman, Vouga, Tamstorf & Grinspun, ACM Trans. Graph. 31, 106 (2012) for reflections; Chandrasekaran (1970) for the
algorithm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

from granular._kernels import kernel

Row = list[float]
Floats = Sequence[float]
Solver = Callable[[Floats, Floats, Floats], Row]
PASSES = 10_000
"""Repetitions of a rule before it is given up."""

LEFT, RIGHT, RANDOM, GROUP = range(4)
ORDER = {"left": LEFT, "right": RIGHT, "random": RANDOM, "newton": GROUP, "poisson": GROUP, "reflect": GROUP}
"""The last three solve a touching group as a whole, see `granular.edmd.groups`; groups apart act from the left."""
MASK = (1 << 24) - 1
"""Mask of the pair in a rank; scenes have at most that many pairs."""


@kernel
def rank(c: int, order: int, seed: int, hits: int) -> int:
    """Return the rank of pair `c`, which has collided `hits` times."""
    if order in (LEFT, GROUP):
        return c
    if order == RIGHT:
        return ((MASK - c) << 24) | c
    return (mixed(mixed(mixed(seed & 0x7FFFFFFF) ^ c) ^ (hits & 0x7FFFFFFF)) << 24) | c


@kernel
def mixed(x: int) -> int:
    """Return 31 well-mixed bits of `x`; no product exceeds 63 bits, so that compiled and plain agree."""
    x = ((x ^ (x >> 16)) * 0x45D9F3B) & 0x7FFFFFFF
    x = ((x ^ (x >> 15)) * 0x2C1B3C6D) & 0x7FFFFFFF
    return x ^ (x >> 16)


def newton(inverse_mass: Floats, rate: Floats, eps: Floats) -> Row:
    """Return the impulses of Newton's rule: post-rates ≥ -ε times the rates before, as long as pairs approach.

    Only for one common ε: with different ones it can multiply the energy.
    """
    return _repeated("newton", inverse_mass, rate, lambda now, _: complementary(
        inverse_mass, [(1.0 + e) * r for e, r in zip(eps, now, strict=True)]))


def poisson(inverse_mass: Floats, rate: Floats, eps: Floats) -> Row:
    """Return the impulses of Poisson's rule: a compression that stops all approach, then ε times its impulses back.

    For any ε per pair; never gains energy.
    """
    compression = complementary(inverse_mass, rate)
    left = zip(compression, after(inverse_mass, rate, compression), strict=True)
    back = [e * p for e, p in zip(eps, compression, strict=True)]
    more = complementary(inverse_mass, after(inverse_mass, [0.0 if p > 0.0 else r for p, r in left], back))
    return [a + b + c for a, b, c in zip(compression, back, more, strict=True)]


def reflect(inverse_mass: Floats, rate: Floats, eps: Floats) -> Row:
    """Return the impulses of generalised reflections: all approaching pairs turn round at once, repeatedly.

    Only for one common ε: ε times the elastic impulses plus 1 - ε times those that stop all approach. Never ends if
    the group is held by walls at both ends.
    """
    e = eps[0]
    elastic = _repeated("reflect", inverse_mass, rate, lambda now, approaching: solve(
        inverse_mass, [-2.0 * r for r in now], approaching))
    if e == 1.0:
        return elastic
    return [e * a + (1.0 - e) * b for a, b in zip(elastic, complementary(inverse_mass, rate), strict=True)]


def _repeated(name: str, inverse_mass: Floats, rate: Floats, impulses: Callable[[Row, list[bool]], Row]) -> Row:
    """Return the sum of `impulses` of the rates and of which of them approach, applied until none does."""
    total, now, tiny = [0.0] * len(rate), list(rate), noise(rate)
    for _ in range(PASSES):
        approaching = [r < -tiny for r in now]
        if not any(approaching):
            return total
        p = impulses(now, approaching)
        now = after(inverse_mass, now, p)
        total = [a + b for a, b in zip(total, p, strict=True)]
    raise gave_up(name)


RULES: dict[str, Solver] = {"newton": newton, "poisson": poisson, "reflect": reflect}


def complementary(inverse_mass: Floats, q: Floats) -> Row:
    """Solve 0 ≤ p ⟂ W p + q ≥ 0 by a growing set of active pairs."""
    active, tiny, pinned = [x < 0.0 for x in q], noise(q), inverse_mass[0] == 0.0 and inverse_mass[-1] == 0.0
    while True:
        p = solve(inverse_mass, [-x for x in q], active)
        grown = [a or r < -tiny for a, r in zip(active, after(inverse_mass, q, p), strict=True)]
        if grown == active or (pinned and all(grown)):  # held at both ends the rates sum to 0: the last is rounding
            return p
        active = grown


def solve(inverse_mass: Floats, right: Floats, active: Sequence[bool]) -> Row:
    """Solve W p = right on the active pairs (p = 0 elsewhere) by elimination along each run of them."""
    m = len(right)
    p, pivot, load = [0.0] * (m + 1), [0.0] * m, [0.0] * m
    for c in range(m):
        if active[c]:
            diagonal = inverse_mass[c] + inverse_mass[c + 1]
            factor = inverse_mass[c] / pivot[c - 1] if c > 0 and pivot[c - 1] > 0.0 else 0.0
            left = diagonal - factor * inverse_mass[c]
            pivot[c] = left if left >= 1e-14 * diagonal else 0.0  # held at both ends: one impulse is free, and is none
            load[c] = right[c] + factor * load[c - 1]
    for c in range(m - 1, -1, -1):
        if pivot[c] > 0.0:
            p[c] = (load[c] + inverse_mass[c + 1] * p[c + 1]) / pivot[c]
    return p[:m]


def after(inverse_mass: Floats, rate: Floats, p: Floats) -> Row:
    """Return the rates after impulses `p`: rate + W p."""
    change = pairwise(velocity_changes(inverse_mass, p))
    return [r + (upper - lower) for r, (lower, upper) in zip(rate, change, strict=True)]


def velocity_changes(inverse_mass: Floats, p: Floats) -> Row:
    """Return the velocity changes (m/s) of the bodies by impulses `p` of the pairs."""
    return [w * (below - above) for w, (below, above) in zip(inverse_mass, pairwise([0.0, *p, 0.0]), strict=True)]


def noise(rate: Floats) -> float:
    """Return what rounding may leave of rates of this size."""
    return max(abs(r) for r in rate) * 2.0**-46


def gave_up(rule: str) -> ValueError:
    """Return the error of a rule that found no end."""
    other = "left" if rule == "poisson" else "poisson"
    return ValueError(f"ties is {rule!r}: no end after {PASSES} passes on a touching group; use ties={other!r}.")

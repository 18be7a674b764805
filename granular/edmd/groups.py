"""Simultaneous collisions of a touching group, solved as a whole: Newton, Poisson and generalised reflections.

Pure functions on the inverse masses (1/kg) of m + 1 bodies and the rates (m/s, negative: approaching) of their m
touching pairs; they return the impulses p ≥ 0 (kg m/s) of the pairs. The Delassus matrix W is tridiagonal,
W_cc = 1/m_c + 1/m_{c+1}, W_{c,c+1} = -1/m_{c+1}, and an M-matrix: the set of active pairs of its complementarity
problem only grows, so the solution is exact after at most m rounds.

Sources: Moreau (1988) for Newton's rule; Glocker & Pfeiffer, Nonlinear Dyn. 7, 471 (1995) for Poisson's; Smith,
Kaufman, Vouga, Tamstorf & Grinspun, ACM Trans. Graph. 31, 106 (2012) for reflections; Chandrasekaran (1970) for the
algorithm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

Row = list[float]
Solver = Callable[[Sequence[float], Sequence[float], Sequence[float]], Row]
PASSES = 10_000
"""Repetitions of a rule before it is given up."""


def newton(inverse_mass: Sequence[float], rate: Sequence[float], eps: Sequence[float]) -> Row:
    """Return the impulses of Newton's rule: post-rates ≥ -ε times the rates before, as long as pairs approach.

    Only for one common ε: with different ones it can multiply the energy.
    """
    total, now, tiny = [0.0] * len(rate), list(rate), noise(rate)
    for _ in range(PASSES):
        if min(now) >= -tiny:
            return total
        p = complementary(inverse_mass, [(1.0 + e) * r for e, r in zip(eps, now, strict=True)])
        now = after(inverse_mass, now, p)
        total = [a + b for a, b in zip(total, p, strict=True)]
    raise gave_up("newton")


def poisson(inverse_mass: Sequence[float], rate: Sequence[float], eps: Sequence[float]) -> Row:
    """Return the impulses of Poisson's rule: a compression that stops all approach, then ε times its impulses back.

    For any ε per pair; never gains energy.
    """
    compression = complementary(inverse_mass, rate)
    stopped = [
        0.0 if p > 0.0 else r for p, r in zip(compression, after(inverse_mass, rate, compression), strict=True)
    ]
    back = [e * p for e, p in zip(eps, compression, strict=True)]
    more = complementary(inverse_mass, after(inverse_mass, stopped, back))
    return [a + b + c for a, b, c in zip(compression, back, more, strict=True)]


def reflect(inverse_mass: Sequence[float], rate: Sequence[float], eps: Sequence[float]) -> Row:
    """Return the impulses of generalised reflections: all approaching pairs turn round at once, repeatedly.

    Only for one common ε: ε times the elastic impulses plus 1 - ε times those that stop all approach. Never ends if
    the group is held by walls at both ends.
    """
    total, now, tiny = [0.0] * len(rate), list(rate), noise(rate)
    for _ in range(PASSES):
        approaching = [r < -tiny for r in now]
        if not any(approaching):
            break
        p = solve(inverse_mass, [-2.0 * r for r in now], approaching)
        now = after(inverse_mass, now, p)
        total = [a + b for a, b in zip(total, p, strict=True)]
    else:
        raise gave_up("reflect")
    e = eps[0]
    if e == 1.0:
        return total
    plastic = complementary(inverse_mass, rate)
    return [e * a + (1.0 - e) * b for a, b in zip(total, plastic, strict=True)]


RULES: dict[str, Solver] = {"newton": newton, "poisson": poisson, "reflect": reflect}


def complementary(inverse_mass: Sequence[float], q: Sequence[float]) -> Row:
    """Solve 0 ≤ p ⟂ W p + q ≥ 0 by a growing set of active pairs."""
    active = [x < 0.0 for x in q]
    pinned = inverse_mass[0] == 0.0 and inverse_mass[-1] == 0.0
    while True:
        p = solve(inverse_mass, [-x for x in q], active)
        residual = after(inverse_mass, q, p)
        tiny = noise(q)
        new = [not a and r < -tiny for a, r in zip(active, residual, strict=True)]
        grown = [a or b for a, b in zip(active, new, strict=True)]
        if not any(new) or (pinned and all(grown)):  # held at both ends the rates sum to 0: the last one is rounding
            return p
        active = grown


def solve(inverse_mass: Sequence[float], right: Sequence[float], active: Sequence[bool]) -> Row:
    """Solve W p = right on the active pairs (p = 0 elsewhere) by elimination along each run of them."""
    m = len(right)
    p, pivot, load = [0.0] * m, [0.0] * m, [0.0] * m
    for c in range(m):
        if active[c]:
            diagonal = inverse_mass[c] + inverse_mass[c + 1]
            pivot[c], load[c] = diagonal, right[c]
            if c > 0 and active[c - 1] and pivot[c - 1] > 0.0:
                factor = inverse_mass[c] / pivot[c - 1]
                pivot[c] -= factor * inverse_mass[c]
                load[c] += factor * load[c - 1]
            if pivot[c] < 1e-14 * diagonal:
                pivot[c] = 0.0  # held at both ends: one impulse is free, and is none
    for c in range(m - 1, -1, -1):
        if active[c] and pivot[c] > 0.0:
            above = inverse_mass[c + 1] * p[c + 1] if c + 1 < m and active[c + 1] else 0.0
            p[c] = (load[c] + above) / pivot[c]
    return p


def after(inverse_mass: Sequence[float], rate: Sequence[float], p: Sequence[float]) -> Row:
    """Return the rates after impulses `p`: rate + W p."""
    change = velocity_changes(inverse_mass, p)
    return [r + (change[c + 1] - change[c]) for c, r in enumerate(rate)]


def velocity_changes(inverse_mass: Sequence[float], p: Sequence[float]) -> Row:
    """Return the velocity changes (m/s) of the bodies by impulses `p` of the pairs."""
    around = [0.0, *p, 0.0]
    return [w * (around[i] - around[i + 1]) for i, w in enumerate(inverse_mass)]


def noise(rate: Sequence[float]) -> float:
    """Return what rounding may leave of rates of this size."""
    return max(abs(r) for r in rate) * 2.0**-46


def gave_up(rule: str) -> ValueError:
    """Return the error of a rule that found no end."""
    other = "left" if rule == "poisson" else "poisson"
    return ValueError(f"ties is {rule!r}: no end after {PASSES} passes on a touching group; use ties={other!r}.")

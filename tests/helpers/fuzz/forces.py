"""The laws a second time, by number: force, bracket and kinks, as the solver needs them."""

from __future__ import annotations

from typing import Any

from tests.helpers.fuzz.arithmetic import exp, formula, power, root, tanh

POWER, TWO_STIFF, TWO_DAMP, STIFFEN, EXPO, BRAUN, HYSTERESIS, SATURATED = range(8)
"""k ξ^p + γ ξ^d η (p, d any) · stiffness k up to ξ₁, then k₂ · k ξ^p + γ ξ^d η with γ₁ in loading and γ₂ in unloading ·
k ξ + k₃ ξ³ + γ η · A (exp(ξ/L) - 1) · Walton and Braun · k ξ^p loading, unloading to c ξ_max · k ξ + γ v tanh(η/v)."""


@formula
def raised(x: Any, p: Any) -> Any:
    """x^p, by roots where that is quicker."""
    if p == 1.0:
        return x
    if p == 1.5:
        return x * root(x)
    if p == 0.0:
        return 1.0 + 0.0 * x
    if p == 0.5:
        return root(x)
    if p == 0.25:
        return root(root(x))
    return power(x, p)


@formula
def force(kind: int, a: Any, xi: Any, eta: Any, top: Any, branch: int) -> Any:
    """Unclipped force; continued beyond ξ = 0 where it is analytic there, else 0."""
    if kind == POWER:
        p, d = a[1], a[3]
        if xi <= 0.0 and (p != int(p) or d != 0.0):
            return 0.0 * xi
        elastic = a[0] * raised(xi, p)
        if a[2] == 0.0:
            return elastic
        return elastic + a[2] * eta * raised(xi, d)
    if kind == TWO_STIFF:
        if branch == 0:
            return a[0] * xi + a[3] * eta
        return a[0] * a[2] + a[1] * (xi - a[2]) + a[3] * eta
    if kind == TWO_DAMP:
        p, d = a[1], a[4]
        if xi <= 0.0 and (p != int(p) or d != 0.0):
            return 0.0 * xi
        gamma = a[2] if branch == 1 else a[3]
        return a[0] * raised(xi, p) + gamma * eta * raised(xi, d)
    if kind == STIFFEN:
        return a[0] * xi + a[1] * xi * xi * xi + a[2] * eta
    if kind == EXPO:
        return a[0] * (exp(xi / a[1]) - 1.0)
    if kind == BRAUN:
        if branch == 1:
            return a[0] * xi
        return a[0] * top - a[1] * (top - xi)
    if kind == HYSTERESIS:
        if branch == 1:
            return 0.0 * xi if xi <= 0.0 else a[0] * power(xi, a[1])
        rest = a[2] * top
        if xi <= rest:
            return 0.0 * xi
        return a[0] * power(top, a[1]) * power((xi - rest) / (top - rest), a[1])
    return a[0] * xi + a[1] * a[2] * tanh(eta / a[2])


@formula
def bracket(kind: int, a: Any, xi: Any, eta: Any, top: Any, branch: int) -> Any:
    """A smooth function with the sign of the force, with a simple zero where the force ends."""
    if kind == POWER:
        if a[2] == 0.0:
            return a[0] * xi
        return a[0] * signed_power(xi, a[1] - a[3]) + a[2] * eta
    if kind == TWO_DAMP:
        gamma = a[2] if branch == 1 else a[3]
        if gamma == 0.0:
            return a[0] * xi
        return a[0] * signed_power(xi, a[1] - a[4]) + gamma * eta
    if kind == STIFFEN and a[2] == 0.0:
        return a[0] * xi
    if kind == EXPO:
        return a[0] * xi / a[1]
    if kind == HYSTERESIS:
        return a[0] * (xi if branch == 1 else xi - a[2] * top)
    return force(kind, a, xi, eta, top, branch)


@formula
def weight(kind: int, a: Any, xi: Any, top: Any) -> Any:
    """The size of the terms of the bracket, of which it is known to rounding."""
    if kind == POWER:
        return a[0] * signed_power(abs(xi), a[1] - a[3])
    if kind == TWO_DAMP:
        return a[0] * signed_power(abs(xi), a[1] - a[4])
    if kind == BRAUN:
        return a[0] * abs(xi) + a[1] * abs(top)
    if kind == EXPO:
        return a[0] * abs(xi) / a[1]
    if kind == TWO_STIFF:
        return a[0] * abs(xi) + a[1] * abs(xi)
    return a[0] * (abs(xi) + abs(top))


@formula
def signed_power(x: Any, p: Any) -> Any:
    """x^p with the sign of x."""
    if p == 1.0:
        return x
    if x > 0.0:
        return power(x, p)
    if x < 0.0:
        return -power(-x, p)
    return 0.0 * x


@formula
def kink(kind: int, a: Any, xi: Any, eta: Any, top: Any, branch: int) -> Any:
    """Rises through 0 where the law changes to its other branch; negative if it has none."""
    if kind == TWO_STIFF:
        return xi - a[2] if branch == 0 else a[2] - xi
    if kind == TWO_DAMP:
        return -eta if branch == 1 else eta
    if kind in (BRAUN, HYSTERESIS):
        return -eta if branch == 1 else xi - top
    return -1.0 + 0.0 * xi


@formula
def has_kink(kind: int) -> bool:
    """Whether the law has two branches."""
    return kind in (TWO_STIFF, TWO_DAMP, BRAUN, HYSTERESIS)


@formula
def remembers(kind: int) -> bool:
    """Whether the law knows its largest overlap."""
    return kind in (BRAUN, HYSTERESIS)


@formula
def elastic(kind: int, a: Any, branch: int) -> bool:
    """Whether the force ends where the overlap does."""
    if kind == POWER:
        return a[2] == 0.0
    if kind == TWO_STIFF:
        return a[3] == 0.0
    if kind == TWO_DAMP:
        return (a[2] if branch == 1 else a[3]) == 0.0
    if kind == STIFFEN:
        return a[2] == 0.0
    if kind == EXPO:
        return True
    if kind == BRAUN:
        return a[0] == a[1]
    if kind == HYSTERESIS:
        return a[2] == 0.0
    return False


@formula
def roughness(kind: int, a: Any) -> Any:
    """The lowest broken power of the time in the acceleration after a touch; 0 if it is smooth."""
    if kind == POWER:
        p, d = a[1], a[3]
        if a[2] != 0.0 and d != int(d):
            return d
        return p if p != int(p) else 0.0 * p
    if kind == TWO_DAMP:
        return a[4]
    if kind == HYSTERESIS:
        return a[1] if a[1] != int(a[1]) else 0.0 * a[1]
    return 0.0 * a[0]


@formula
def duration_scale(kind: int, a: Any, inertia: Any, speed: Any) -> Any:
    """About how long an isolated impact takes: the overlap at which the energy is used up, over the speed."""
    xi = 1e-40 / inertia * inertia
    energy = inertia * speed * speed
    for _ in range(600):
        if xi * force(kind, a, xi, 0.0 * xi, xi, 0 if kind == TWO_STIFF and xi < a[2] else 1) > energy:
            break
        xi = xi * 1.7
    return xi / speed

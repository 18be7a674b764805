"""An independent twin of one contact of a ball and a wall, or of two balls: closed forms and integrals in 30 digits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

import granular as gr

mpmath = pytest.importorskip("mpmath")
MP = mpmath.MPContext()
MP.dps = 30


@dataclass
class Exact:
    """A contact as `maps.encounter` describes it: times and speeds of the ends of force and overlap, and peaks."""

    t1: Any
    t2: Any
    v1: Any
    v2: Any
    xi_max: Any
    force_max: Any


def bisected(f: Callable[[Any], Any], low: Any, high: Any) -> Any:
    """Where f falls through zero."""
    for _ in range(150):
        middle = (low + high) / 2
        low, high = (middle, high) if f(middle) > 0 else (low, middle)
    return low


def after_force(t1: Any, xi: Any, v1: Any, pull: Any) -> tuple[Any, Any]:
    """When and how fast the overlap `xi` that is left at t1 has run off."""
    v2 = MP.sqrt(v1 * v1 - 2 * pull * xi)
    return t1 + 2 * xi / (v1 + v2), v2


def dashpot(law: gr.LinearDashpot, m: Any, v: Any, pull: Any) -> Exact:
    """Damped oscillation about its equilibrium, by complex exponentials."""
    k, gamma = MP.mpf(law.k), MP.mpf(law.gamma)
    rest, lam = pull * m / k, gamma / (2 * m)
    root = MP.sqrt(MP.mpc(lam * lam - k / m))
    one, two = -lam + root, -lam - root
    b = (v + one * rest) / (two - one)  # of y = a e^(one t) + b e^(two t), y(0) = -rest, y'(0) = v
    a = -rest - b

    def xi(t: Any) -> Any:
        return MP.re(a * MP.exp(one * t) + b * MP.exp(two * t)) + rest

    def rate(t: Any) -> Any:
        return MP.re(a * one * MP.exp(one * t) + b * two * MP.exp(two * t))

    def force(t: Any) -> Any:
        return k * xi(t) + gamma * rate(t)

    def slope(t: Any) -> Any:
        return k * rate(t) + gamma * (pull - force(t) / m)

    turn = bisected(rate, MP.mpf(0), MP.pi * MP.sqrt(m / k))
    t1 = bisected(force, turn, turn + 4 * MP.sqrt(m / k))
    top = bisected(slope, MP.mpf(0), turn) if slope(MP.mpf(0)) > 0 else MP.mpf(0)
    t2, v2 = after_force(t1, xi(t1), -rate(t1), pull)
    return Exact(t1, t2, -rate(t1), v2, xi(turn), max(force(top), gamma * v))


def elastic(force: Callable[[Any], Any], energy: Callable[[Any], Any]) -> Callable[..., Exact]:
    """The contact of any potential: t = 2 ∫ dξ/ξ̇, with ξ = ξ_max (1 - u²), which is smooth at the turn."""

    def exact(law: Any, m: Any, v: Any, pull: Any) -> Exact:
        def left(xi: Any) -> Any:
            return v * v + 2 * pull * xi - 2 * energy(xi) / m

        high = MP.mpf(1)
        while left(high) > 0:
            high *= 2
        deep = bisected(left, MP.mpf(0), high)
        slope = 2 * (force(deep) / m - pull)

        def integrand(u: Any) -> Any:
            xi = deep * (1 - u * u)
            return 2 * deep * u / MP.sqrt(left(xi)) if u > MP.mpf(10) ** -12 else 2 * MP.sqrt(deep / slope)

        t = 2 * MP.quad(integrand, [0, MP.mpf(1) / 2, 1])
        return Exact(t, t, v, v, deep, force(deep))

    return exact


def power(k: Any, p: Any) -> Callable[..., Exact]:
    return elastic(lambda x: MP.mpf(k) * x ** MP.mpf(p), lambda x: MP.mpf(k) * x ** (MP.mpf(p) + 1) / (MP.mpf(p) + 1))


def similar(k: Any, p: Any, gamma: Any) -> Callable[..., Exact]:
    """F = k ξ^p + γ ξ^d ξ̇, d = (p-1)/2: s = ξ^((p+1)/2) swings as a dashpot in the time dτ = ξ^d dt."""

    def exact(law: Any, m: Any, v: Any, pull: Any) -> Exact:
        assert pull == 0
        kk, pp, g = MP.mpf(k), MP.mpf(p), MP.mpf(gamma)
        omega = MP.sqrt((pp + 1) * kk / (2 * m))
        zeta = g / MP.sqrt(2 * (pp + 1) * kk * m)
        swing, beta, h = omega * MP.sqrt(1 - zeta**2), (pp - 1) / (pp + 1), (pp + 1) / 2

        def s(tau: Any) -> Any:
            return h * v / swing * MP.exp(-zeta * omega * tau) * MP.sin(swing * tau)

        def ds(tau: Any) -> Any:
            lean = zeta * omega / swing
            return h * v * MP.exp(-zeta * omega * tau) * (MP.cos(swing * tau) - lean * MP.sin(swing * tau))

        end = 2 * MP.atan2(MP.sqrt(1 - zeta**2), zeta) / swing
        turn = end / 2
        t1 = MP.quad(lambda tau: s(tau) ** -beta, [0, turn, end])
        v1 = -ds(end) / h
        xi = s(end) ** (1 / h)

        def force(tau: Any) -> Any:
            return s(tau) ** beta * (kk * s(tau) + g * ds(tau) / h)

        low, high = MP.mpf(0), turn
        for _ in range(120):
            a, b = low + (high - low) / 3, high - (high - low) / 3
            low, high = (a, high) if force(a) < force(b) else (low, b)
        return Exact(t1, t1 + xi / v1, v1, v1, s(turn) ** (1 / h), force(low))

    return exact


def walton_braun(law: gr.WaltonBraun, m: Any, v: Any, pull: Any) -> Exact:
    """Two arcs about two equilibria."""
    k1, k2 = MP.mpf(law.k_load), MP.mpf(law.k_unload)
    w1, w2 = MP.sqrt(k1 / m), MP.sqrt(k2 / m)
    rest = pull / w1**2
    top = rest + MP.sqrt(rest**2 + (v / w1) ** 2)
    gone = top * (1 - k1 / k2)
    low = pull / w2**2
    wide = top - gone - low
    angle = MP.acos(-low / wide)
    t1, v1 = (MP.pi / 2 + MP.atan(rest * w1 / v)) / w1 + angle / w2, wide * w2 * MP.sin(angle)
    t2, v2 = after_force(t1, gone, v1, pull)
    return Exact(t1, t2, v1, v2, top, k1 * top)


def stiffening(law: Any, m: Any, v: Any, pull: Any) -> Exact:
    k, k3 = MP.mpf(law.k), MP.mpf(law.k3)
    return elastic(lambda x: k * x + k3 * x**3, lambda x: k * x * x / 2 + k3 * x**4 / 4)(law, m, v, pull)


def softening(law: Any, m: Any, v: Any, pull: Any) -> Exact:
    k, x0 = MP.mpf(law.k), MP.mpf(law.x)
    return elastic(
        lambda x: k * x * (1 + x0 / (x0 + x)), lambda x: k * (x * x / 2 + x0 * (x - x0 * MP.log(1 + x / x0)))
    )(law, m, v, pull)

"""What an engine may know of a force law beyond its `force`: traits, never the class.

A law is a frozen dataclass of floats with ``force(self, xi, xi_dot, pair)``. Optional traits unlock more:

* ``linear(pair) -> (k, gamma)``: F = k ξ + γ ξ̇;
* ``power(pair) -> (k, p, gamma, d)``: F = k ξ^p + γ ξ^d ξ̇;
* ``exponent``: the power of ξ with which F begins; ``rate_dependent``: whether ξ̇ enters (true if not said);
* ``potential(xi, pair)``: the elastic energy; ``memory = True``: `force` also takes ``xi_max``.
"""

from __future__ import annotations

import math
from typing import Any

from granular.laws.linearity import traced
from granular.scene import Pair, Scene


def checked(law: Any, scene: Scene) -> tuple[Any, ...]:
    """Return one law per pair, or raise: every law must have `force`, and traits that agree with it."""
    from granular._check import per_pair

    laws = per_pair("law", law, scene.n - 1)
    for one, pair in zip(laws, scene.pairs, strict=True):
        if not callable(getattr(one, "force", None)):
            raise TypeError(
                f"law of pair {pair.index} is {one!r}: an object with force(self, xi, xi_dot, pair) is needed; "
                "for hard spheres use granular.edmd."
            )
        _agree(one, pair)
    return laws


def evaluate(law: Any, xi: float, xi_dot: float, pair: Pair, xi_max: float) -> float:
    """Unclipped force in N of any law, with or without memory."""
    if getattr(law, "memory", False):
        return float(law.force(xi, xi_dot, pair, xi_max))
    return float(law.force(xi, xi_dot, pair))


def power_form(law: Any, pair: Pair) -> tuple[float, float, float, float] | None:
    """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ if the law says so by `power` or `linear`, or is seen to be linear."""
    if hasattr(law, "power"):
        k, p, gamma, d = law.power(pair)
        return float(k), float(p), float(gamma), float(d)
    if hasattr(law, "linear"):
        k, gamma = law.linear(pair)
        return float(k), 1.0, float(gamma), 0.0
    found = None if getattr(law, "memory", False) else traced(law, pair)
    return None if found is None else (found[0], 1.0, found[1], 0.0)


def rate_dependent(law: Any) -> bool:
    """Whether ξ̇ enters the force; true unless the law denies it."""
    return bool(getattr(law, "rate_dependent", True))


def tangent(law: Any, xi: float, pair: Pair) -> tuple[float, float]:
    """Stiffness ∂F/∂ξ in N/m and damping ∂F/∂ξ̇ in kg/s at overlap `xi` and rest, by differences."""
    form = None if getattr(law, "memory", False) else power_form(law, pair)
    if form is not None and form[1] == 1.0 and form[3] == 0.0:
        return form[0], form[2]
    step = 1e-6 * xi
    here = evaluate(law, xi, 0.0, pair, xi)
    # backwards: the unloading branch of a law with memory is the stiffer one
    k = (here - evaluate(law, xi - step, 0.0, pair, xi)) / step
    if not rate_dependent(law):
        return abs(k), 0.0
    rate = xi * math.sqrt(abs(k) / pair.m_eff)
    return abs(k), abs(evaluate(law, xi, rate, pair, xi) - here) / rate if rate else 0.0


def _agree(law: Any, pair: Pair) -> None:
    form = power_form(law, pair)
    if form is None or getattr(law, "memory", False):
        return
    k, p, gamma, d = form
    for xi, rate in ((0.25, 0.5), (0.5, -0.25)):
        said = k * math.pow(xi, p) + gamma * math.pow(xi, d) * rate
        got = evaluate(law, xi, rate, pair, xi)
        if not abs(got - said) <= 1e-9 * (abs(k) + abs(gamma)):
            raise ValueError(
                f"law of pair {pair.index} is {law!r}: force({xi}, {rate}) gives {got!r} but its linear or power "
                f"trait says {said!r}; mend the trait or leave it out."
            )

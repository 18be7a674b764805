"""What an engine may know of a force law beyond its `force`: traits, never the class.

A law is a frozen dataclass of floats with ``force(self, xi, xi_dot, pair)``. Optional traits unlock more:

* ``linear(pair) -> (k, gamma)``: F = k ξ + γ ξ̇;
* ``power(pair) -> (k, p, gamma, d)``: F = k ξ^p + γ ξ^d ξ̇;
* ``exponent``: the power of ξ with which F begins; ``rate_dependent``: whether ξ̇ enters (true if not said);
* ``potential(xi, pair)``: the elastic energy; ``memory = True``: `force` also takes ``xi_max``.

Before a run each law is tried: a force that is no number, a trait that contradicts the force, or negative damping (a
harder push while bodies part than while they approach, at the same overlap) is refused. What pulls is legal, and so is
a force that sets in late (F = k (ξ - ξ₀)): the engine takes both for no force.
"""

from __future__ import annotations

import math
from itertools import islice
from typing import Any

import numpy as np

from granular.laws.linearity import traced
from granular.scene import Pair, Scene, speed_scale

RUNG = 4.0
"""Ratio of the overlaps at which a law is tried before a run."""
TRIED = 256
"""How many different pairs are tried."""


def checked(law: Any, scene: Scene) -> tuple[Any, ...]:
    """Return one law per pair, or raise: each must have `force`, give finite numbers, and traits that agree with it."""
    from granular._check import per_pair

    laws = per_pair("law", law, scene.n - 1)
    speed = speed_scale(scene)
    tried: dict[Any, tuple[Any, Pair]] = {}
    for one, pair in zip(laws, scene.pairs, strict=True):
        instance(f"law of pair {pair.index}", one)
        _agree(one, pair)
        tried.setdefault((id(one), pair.m_eff, pair.r_eff), (one, pair))
    for one, pair in islice(tried.values(), TRIED):
        _try(one, pair, speed)
    return laws


def instance(name: str, law: Any) -> None:
    """Raise if `law` is a class, or has no `force`."""
    if isinstance(law, type):
        known = getattr(law, "__dataclass_fields__", {})
        values = ", ".join(f"{field}=..." for field in known)
        raise TypeError(f"{name} is the class {law.__name__}: an instance is needed, such as {law.__name__}({values}).")
    if not callable(getattr(law, "force", None)):
        raise TypeError(
            f"{name} is {law!r}: an object with force(self, xi, xi_dot, pair) is needed; for hard spheres use "
            "granular.edmd."
        )


def finite(law: Any, xi: float, xi_dot: float, pair: Pair) -> float:
    """Return `evaluate(law, xi, xi_dot, pair, xi)`, or raise the sentence that says what is wrong with it."""
    memory = (xi,) if getattr(law, "memory", False) else ()
    value = law.force(xi, xi_dot, pair, *memory)
    try:
        force = math.nan if isinstance(value, (str, bytes)) else float(value)
    except (TypeError, ValueError):
        force = math.nan
    if not math.isfinite(force):
        raise no_number(law, xi, xi_dot, pair, value)
    return force


def check_deepest(laws: tuple[Any, ...], scene: Scene, contacts: Any) -> None:
    """Raise if a force is no number at the largest overlap in a contact log: fixed steps take that for no force."""
    deepest = np.zeros(len(laws))
    np.maximum.at(deepest, contacts["pair"], contacts["xi_max"])
    for law, pair, xi in zip(laws, scene.pairs, deepest.tolist(), strict=True):
        if xi > 0.0:
            finite(law, xi, 0.0, pair)


def no_number(law: Any, xi: float, xi_dot: float, pair: Pair, value: Any) -> ValueError:
    """Return the error of a force that is no finite number."""
    return ValueError(
        f"law of pair {pair.index} is {law!r}: its force at overlap ξ = {xi:.6g} m and rate ξ̇ = {xi_dot:.6g} m/s is "
        f"{value!r}; a finite number in N is needed."
    )


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


def _try(law: Any, pair: Pair, speed: float) -> None:
    """Raise if the force of a law gives no numbers, or contradicts `rate_dependent` or `potential`."""
    form = None if getattr(law, "memory", False) else power_form(law, pair)
    xi = _probed(law, pair, speed) if form is None else 0.5
    if form is not None and form[2] < 0.0:
        raise _gains(law, pair, xi, 1.0)
    if form is not None and form[2] != 0.0 and not rate_dependent(law):
        raise _denied(law, pair, xi, (0.0, 1.0), (evaluate(law, xi, 0.0, pair, xi), evaluate(law, xi, 1.0, pair, xi)))
    if hasattr(law, "potential") and not getattr(law, "memory", False):
        _agree_energy(law, pair, xi)


def _probed(law: Any, pair: Pair, speed: float) -> float:
    """Evaluate the force up to overlaps (m) that an impact at `speed` is sure to reach, and return the last of them."""
    xi = 1e-10 * (pair.r_eff if 0.0 < pair.r_eff < math.inf else 1.0)
    top, energy = 1e10 * xi, 0.5 * pair.m_eff * speed * speed
    while True:
        force = finite(law, xi, 0.0, pair)
        closing, parting = (finite(law, xi, rate, pair) for rate in (speed, -speed))
        for rate, moving in ((speed, closing), (-speed, parting)):
            if not rate_dependent(law) and abs(moving - force) > 1e-9 * abs(force):
                raise _denied(law, pair, xi, (0.0, rate), (force, moving))
        if parting > max(0.0, closing) + 1e-9 * abs(closing):
            raise _gains(law, pair, xi, speed)
        if 0.5 * RUNG * RUNG * xi * force > energy or RUNG * xi > top:
            return xi
        xi *= RUNG


def _denied(law: Any, pair: Pair, xi: float, rate: tuple[float, float], force: tuple[float, float]) -> ValueError:
    """Return the error of a law whose force depends on the rate although it says that it does not."""
    return ValueError(
        f"law of pair {pair.index} is {law!r}: force({xi:.6g}, {rate[0]:.6g}) gives {force[0]!r} but "
        f"force({xi:.6g}, {rate[1]:.6g}) gives {force[1]!r}, although rate_dependent is False; mend the trait or leave "
        "it out."
    )


def _gains(law: Any, pair: Pair, xi: float, speed: float) -> ValueError:
    """Return the error of a law that pushes harder while bodies part than while they approach."""
    closing, parting = (max(0.0, evaluate(law, xi, rate, pair, xi)) for rate in (speed, -speed))
    return ValueError(
        f"law of pair {pair.index} is {law!r}: at overlap ξ = {xi:.6g} m it pushes with {parting:.6g} N while the "
        f"bodies part and with {closing:.6g} N while they approach at {speed:.6g} m/s, and so gains energy; damping "
        "that is not negative is needed."
    )


def _agree_energy(law: Any, pair: Pair, xi: float) -> None:
    """Raise if the potential of a law is not the integral of its force from 0 to `xi`."""
    said, form = float(law.potential(xi, pair)), power_form(law, pair)
    if form is not None:
        got, doubt = form[0] * math.pow(xi, form[1] + 1.0) / (form[1] + 1.0), 0.0
    else:
        from scipy.integrate import quad

        got, doubt = quad(lambda x: evaluate(law, x, 0.0, pair, x), 0.0, xi, limit=200)
    if not abs(got - said) <= 1e-6 * abs(got) + 10.0 * doubt:
        raise ValueError(
            f"law of pair {pair.index} is {law!r}: its potential at overlap {xi:.6g} m is {said!r} J but the integral "
            f"of its force is {got!r} J; mend the trait or leave it out."
        )


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

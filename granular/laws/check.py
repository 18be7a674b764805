"""Try each law before a run: a mistake in it is a sentence, not a wrong answer.
May be skipped: arguments, no physics.

A force that is no number, that changes from call to call, or that hangs on the rate alone, a trait that contradicts the
force, or negative damping (a harder push while bodies part than while they approach, at the same overlap) is refused.
What pulls is legal, and so is a force that sets in late (F = k (ξ - ξ₀)): the engine takes both for no force.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np

from granular._check import is_own, per_pair
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws, resolved
from granular.scene import Scene, speed_scale

RUNG = 4.0
"""Ratio of the overlaps at which a law is tried before a run."""
TRIED = 256
"""How many different pairs are tried."""
SLOW = 1e-6
"""Rate in m/s at which a law is tried in a scene at rest."""


def checked(law: Any, scene: Scene) -> SceneLaws:
    """Return the laws of all pairs, or raise: each must give finite numbers, and traits that agree with its force."""
    laws, speed = resolved(per_pair("law", law, scene.n_pairs), scene), speed_scale(scene)
    for one in laws.each[:TRIED]:
        if is_own(one.law):
            _check_pure(one, speed)
    for one in laws.each:
        if one.form is not None:
            _check_form(one, *one.form)
    for one in laws.each[:TRIED]:
        xi = _probed(one, speed) if one.form is None else 0.5
        if one.potential is not None and not one.memory:
            _check_potential(one, float(one.potential(xi, one.pair)), xi)
    return laws


def check_deepest(laws: SceneLaws, contacts: Any) -> None:
    """Raise if a force is no number at the largest overlap in a contact log: fixed steps take that for no force."""
    deepest = np.zeros(len(laws))
    np.maximum.at(deepest, contacts["pair"], contacts["xi_max"])
    for c in np.flatnonzero(deepest > 0.0).tolist():
        finite(laws[c], float(deepest[c]), 0.0)


def finite(law: PairLaw, xi: float, xi_dot: float) -> float:
    """Return the force at an overlap that is the largest so far, or raise the sentence that says what is wrong."""
    value = law.given(xi, xi_dot, xi)
    try:
        force = math.nan if isinstance(value, (str, bytes)) else float(value)
    except (TypeError, ValueError):
        force = math.nan
    if not math.isfinite(force):
        raise no_number(law, xi, xi_dot, value)
    return force


def no_number(law: PairLaw, xi: float, xi_dot: float, value: Any) -> ValueError:
    """Return the error of a force that is no finite number."""
    return _error(law, f"its force at overlap ξ = {xi:.6g} m and rate ξ̇ = {xi_dot:.6g} m/s is {value!r}; a finite "
                       "number in N is needed.")


def _probed(law: PairLaw, speed: float) -> float:
    """Evaluate the force up to overlaps (m) that an impact at `speed` is sure to reach, and return the last of them."""
    deepest = _size(law)
    xi, energy, dampings = 1e-10 * deepest, 0.5 * law.pair.m_eff * speed * speed, set()
    speed = speed or SLOW
    while True:
        force, closing, parting = (finite(law, xi, rate) for rate in (0.0, speed, -speed))
        dampings.add(math.nan if force > 0.0 else closing)
        for rate, moving in ((speed, closing), (-speed, parting)):
            if not law.rate_dependent and abs(moving - force) > 1e-9 * abs(force):
                raise _denied(law, xi, rate)
        if parting > max(0.0, closing) + 1e-9 * abs(closing):
            raise _gains(law, xi, speed)
        if 0.5 * RUNG * RUNG * xi * force > energy or RUNG * xi > deepest:
            break
        xi *= RUNG
    if len(dampings) == 1 and (damping := dampings.pop()) > 0.0:
        raise _without_spring(law, damping, speed)
    return xi


def _size(law: PairLaw) -> float:
    """Return r_eff of a pair in m, 1 m of points."""
    return law.pair.r_eff if 0.0 < law.pair.r_eff < math.inf else 1.0


def _check_pure(law: PairLaw, speed: float) -> None:
    """Raise if a law, asked the same again a little later, gives another force."""
    asked = [(share * _size(law), rate) for share in (1e-8, 1e-4) for rate in (speed, 0.0, -speed)]
    before: dict[tuple[float, float], float] = {}
    for at in asked:
        with suppress(ArithmeticError):  # beyond what a law is made for, as its own exponentials may be
            before[at] = finite(law, *at)
    for at, first in before.items():
        if (again := finite(law, *at)) != first:
            raise _error(law, f"two calls with the same arguments, ξ = {at[0]:.6g} m and ξ̇ = {at[1]:.6g} m/s, gave "
                              f"{first!r} and {again!r} N; a law must be a pure function, without state or chance.")


def _check_potential(law: PairLaw, said: float, xi: float) -> None:
    """Raise if the potential of a law is not the integral of its force from 0 to `xi`."""
    if law.form is not None:
        k, p = law.form[:2]
        got, doubt = k * math.pow(xi, p + 1.0) / (p + 1.0), 0.0
    else:
        from scipy.integrate import quad

        got, doubt = quad(lambda x: law.force(x, 0.0, x), 0.0, xi, limit=200)
    if not abs(got - said) <= 1e-6 * abs(got) + 10.0 * doubt:
        raise _error(law, f"its potential at overlap {xi:.6g} m is {said!r} J but the integral of its force is {got!r} "
                          "J; mend the trait or leave it out.")


def _check_form(law: PairLaw, k: float, p: float, gamma: float, d: float) -> None:
    """Raise if the force of a law is not the form that it says, or the form gains energy, or has a rate denied."""
    for xi, rate in ((0.25, 0.5), (0.5, -0.25)):
        said, got = k * math.pow(xi, p) + gamma * math.pow(xi, d) * rate, law.force(xi, rate, xi)
        if not abs(got - said) <= 1e-9 * (abs(k) + abs(gamma)):
            raise _error(law, f"force({xi}, {rate}) gives {got!r} but its linear or power trait says {said!r}; mend "
                              "the trait or leave it out.")
    if k == 0.0 < gamma and d == 0.0:
        raise _without_spring(law, gamma, 1.0)
    if gamma < 0.0:
        raise _gains(law, 0.5, 1.0)
    if gamma != 0.0 and not law.rate_dependent:
        raise _denied(law, 0.5, 1.0)


def _without_spring(law: PairLaw, damping: float, speed: float) -> ValueError:
    """Return the error of a law whose force hangs on the rate alone: bodies would creep into each other for good."""
    return _error(law, f"its force does not depend on the overlap, it is {damping!r} N at rate {speed:.6g} m/s and no "
                       "push at rest at any overlap; are the arguments (xi, xi_dot, pair)?")


def _denied(law: PairLaw, xi: float, rate: float) -> ValueError:
    """Return the error of a law whose force depends on the rate although it says that it does not."""
    still, moving = law.force(xi, 0.0, xi), law.force(xi, rate, xi)
    return _error(law, f"force({xi:.6g}, 0) gives {still!r} but force({xi:.6g}, {rate:.6g}) gives {moving!r}, "
                       "although rate_dependent is False; mend the trait or leave it out.")


def _gains(law: PairLaw, xi: float, speed: float) -> ValueError:
    """Return the error of a law that pushes harder while bodies part than while they approach."""
    closing, parting = (max(0.0, law.force(xi, rate, xi)) for rate in (speed, -speed))
    return _error(law, f"at overlap ξ = {xi:.6g} m it pushes with {parting:.6g} N while the bodies part and with "
                       f"{closing:.6g} N while they approach at {speed:.6g} m/s, and so gains energy; damping that is "
                       "not negative is needed.")


def _error(law: PairLaw, what: str) -> ValueError:
    return ValueError(f"law of pair {law.pair.index} is {law.law!r}: {what}")

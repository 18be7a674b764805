"""From a scene and its laws to the records of a run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular import until as stop
from granular._check import Array
from granular.laws.contact_law import Form, PairLaw
from granular.laws.kinds import SceneLaws
from granular.md.located.records import (
    ACTIVE,
    DAMPED,
    ELASTIC,
    GENERAL,
    LINEAR,
    OPEN,
    RESIDUAL,
    ROOM,
    STEEPEST,
    System,
    new_system,
)
from granular.scene import Scene, speed_scale

LARGEST_Q = 4


def build(scene: Scene, laws: SceneLaws, t: float) -> System:
    """Return the records of `scene` at time `t`, its pairs open, overlapping or (ACTIVE) about to begin a contact."""
    near = 3 * int(np.count_nonzero(scene.gap <= 0.0))  # no more pairs than these join islands at once
    s = new_system(scene.n_pairs, len(laws.each), near + ROOM)
    pairs, bodies = s.pairs, s.bodies
    bodies["inverse_mass"], bodies["v"], bodies["t"] = scene.inverse_mass, scene.velocity, t
    bodies["fall"] = np.where(scene.is_wall, 0.0, scene.gravity)
    if not np.isfinite(sum(scene.sides(scene.inverse_mass))).all():
        raise OverflowError("the inverse of a mass")
    pairs["pull"], pairs["xi"], pairs["eta"], pairs["t"] = scene.pull, -scene.gap, -scene.across(scene.velocity), t
    speed = speed_scale(scene)
    s.kinds[:] = [_described(law, speed, scene.gravity) for law in laws.each]
    if (s.kinds["kind"] == GENERAL).any():  # one law beyond powers, and every law is evaluated as it stands
        s.kinds["kind"], s.kinds["s"] = GENERAL, 0.0
    pairs["kind_of"], pairs["mode"] = laws.kind, _first_modes(laws, -scene.gap, pairs["eta"])
    s.run[0]["pairs"], s.run[0]["t"] = scene.n_pairs, t
    return s


def limit(s: System, until: stop.Until | None, tol: float, max_events: int, max_steps: int, log: int) -> None:
    """Set what ends a run, its tolerance, and what it logs: nothing (0), contacts (1), their peaks too (2)."""
    r = s.run[0]
    r["max_events"], r["max_steps"], r["tol"], r["log"], r["until_pair"] = max_events, max_steps, tol, log, -1
    if isinstance(until, stop.Contact):
        r["until_pair"], r["until_nth"] = until.pair, until.nth
    r["separated"] = int(isinstance(until, stop.Separated))


def _described(law: PairLaw, speed: float, gravity: float) -> tuple[float, ...]:
    """What kind of law it is, and its coefficients: a row of `KIND`."""
    form = power_form(law)
    if form is None:
        k, p, q = _rough_form(law, speed, gravity)
        kind, form = GENERAL, (k, p, 0.0, 0.0)
    else:
        kind, q = kind_and_q(*form)
    k, p, gamma, d = form
    d = factor(p, gamma, d)
    return kind, q, law.memory, k, gamma, p, d, p - d


def power_form(law: PairLaw) -> Form | None:
    """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ if a power series can follow it, else None."""
    return law.form if law.form is not None and kind_and_q(*law.form)[0] != GENERAL else None


def _rough_form(law: PairLaw, speed: float, gravity: float) -> tuple[float, float, int]:
    """Return k and p of a power law of about the size of `law`, and 1 if its force begins smoothly in time, else 2.

    It sets scales, as of first steps; matched at the overlap that an impact at `speed` reaches, or a weight at rest.
    """
    pair = law.pair
    xi = 1e-3 * pair.r_eff if 0.0 < pair.r_eff < math.inf else 1e-3
    for factor in (4.0, 0.25):
        while 1e-100 < xi < 1e100 and speed + gravity > 0.0:
            stops = abs(_bounded(law, xi)) * xi >= pair.m_eff * (speed * speed + gravity * xi)
            if stops == (factor > 1.0):
                break
            xi *= factor
    p, onset = (_slope(law, x) for x in (xi, 1e-6 * xi))
    k = abs(_bounded(law, xi)) / math.pow(xi, p)
    smooth = abs(onset - round(onset)) < 1e-3
    return (k if 0.0 < k < math.inf else 1.0), p, (1 if smooth else 2)


def _slope(law: PairLaw, xi: float) -> float:
    """Return d ln F / d ln ξ at rest at overlap `xi`, within [1, 3]; 1.5 where it cannot be told."""
    near, far = abs(_bounded(law, xi)), abs(_bounded(law, 1.01 * xi))
    if not 0.0 < near < math.inf or not 0.0 < far < math.inf:
        return 1.5
    return min(max(1.0, math.log(far / near) / math.log(1.01)), 3.0)


def _bounded(law: PairLaw, xi: float) -> float:
    """Return the force at rest at overlap `xi`, 0 if it is too large for a number."""
    try:
        return law.force(xi, 0.0, xi)
    except OverflowError:
        return 0.0


def kind_and_q(k: float, p: float, gamma: float, d: float) -> tuple[int, int]:
    """Return the kind of the law F = k ξ^p + γ ξ^d ξ̇, and the q of the clock its contacts start on."""
    if p == 1.0 and (gamma == 0.0 or d == 0.0):
        return LINEAR, 1
    q = _denominator(p) if gamma == 0.0 else math.lcm(_denominator(p), _denominator(d))
    if k > 0.0 and q <= LARGEST_Q and q * p <= STEEPEST and (gamma == 0.0 or 0.0 <= d < p):
        return (ELASTIC if gamma == 0.0 else DAMPED), q
    return GENERAL, min(q, LARGEST_Q)


def factor(p: float, gamma: float, d: float) -> float:
    """Return the d of F = ξ^d (k ξ^(p-d) + γ ξ̇); without damping it is free: ½ for Hertz's law, else 0."""
    if gamma == 0.0:
        return 0.5 if p == 1.5 else 0.0
    return d


def _denominator(exponent: float) -> int:
    """Return the smallest q with q·exponent whole, or one that is too large."""
    for q in range(1, LARGEST_Q + 1):
        if abs(q * exponent - round(q * exponent)) < 1e-12:
            return q
    return LARGEST_Q + 1


def _first_modes(laws: SceneLaws, xi: Array, eta: Array) -> Any:
    """Return the modes in which pairs start; a pair that is about to begin a contact is ACTIVE."""
    mode = np.where((xi < 0.0) | ((xi == 0.0) & (eta <= 0.0)), OPEN, ACTIVE)
    for c in np.flatnonzero(xi > 0.0).tolist():
        deep = float(xi[c])
        mode[c] = ACTIVE if laws[c].force(deep, float(eta[c]), deep) > 0.0 else RESIDUAL
    return mode

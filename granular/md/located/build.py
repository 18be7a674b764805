"""From a scene and its laws to the records of a run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular import until as stop
from granular.laws import traits
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
from granular.scene import Pair, Scene, speed_scale

LARGEST_Q = 4


def build(scene: Scene, laws: tuple[Any, ...], t: float) -> System:
    """Return the records of `scene` at time `t`, its pairs open, overlapping or (ACTIVE) about to begin a contact."""
    at_start = np.pad(scene.gap <= 0.0, 1)
    near = int((at_start[:-2] | at_start[1:-1] | at_start[2:]).sum())  # no more pairs than these join islands at once
    s = new_system(scene.n - 1, scene.n - 1, near + ROOM)
    pairs, bodies = s.pairs[:-1], s.bodies
    bodies["inverse_mass"], bodies["v"], bodies["t"] = scene.inverse_mass, scene.velocity, t
    bodies["fall"] = np.where(scene.is_wall, 0.0, scene.gravity)
    if not np.isfinite(scene.inverse_mass[:-1] + scene.inverse_mass[1:]).all():
        raise OverflowError("the inverse of a mass")
    pairs["pull"], pairs["xi"], pairs["eta"], pairs["t"] = scene.pull, -scene.gap, -np.diff(scene.velocity), t
    speed = speed_scale(scene)
    pairs["kind_of"] = np.arange(scene.n - 1)
    for record, law, pair in zip(s.kinds, laws, scene.pairs, strict=True):
        _describe(record, law, pair, speed)
    if (s.kinds["kind"] == GENERAL).any():  # one law beyond powers, and every law is evaluated as it stands
        s.kinds["kind"], s.kinds["s"] = GENERAL, 0.0
    for record, law, pair in zip(pairs, laws, scene.pairs, strict=True):
        record["mode"] = _first_mode(law, float(record["xi"]), float(record["eta"]), pair)
    s.run[0]["pairs"], s.run[0]["t"] = scene.n - 1, t
    return s


def limit(s: System, until: stop.Until | None, tol: float, max_events: int, max_steps: int, log: int) -> None:
    """Set what ends a run, its tolerance, and what it logs: nothing (0), contacts (1), their peaks too (2)."""
    r = s.run[0]
    r["max_events"], r["max_steps"], r["tol"], r["log"], r["until_pair"] = max_events, max_steps, tol, log, -1
    if isinstance(until, stop.Contact):
        r["until_pair"], r["until_nth"] = until.pair, until.nth
    r["separated"] = int(isinstance(until, stop.Separated))


def _describe(record: Any, law: Any, pair: Pair, speed: float) -> None:
    """Note what kind of law it is, and its coefficients."""
    record["memory"] = int(getattr(law, "memory", False))
    form = power_law(law, pair)
    if form is None:
        k, p, record["q"] = _rough_form(law, pair, speed)
        record["kind"], form = GENERAL, (k, p, 0.0, 0.0)
    else:
        record["kind"], record["q"] = kind_and_q(*form)
    k, p, gamma, d = form
    d = factor(p, gamma, d)
    for name, value in (("k", k), ("p", p), ("gamma", gamma), ("d", d), ("s", p - d)):
        record[name] = value


def power_law(law: Any, pair: Pair) -> tuple[float, float, float, float] | None:
    """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ if a power series can follow it, else None."""
    form = None if getattr(law, "memory", False) else traits.power_form(law, pair)
    return form if form is not None and kind_and_q(*form)[0] != GENERAL else None


def _rough_form(law: Any, pair: Pair, speed: float) -> tuple[float, float, int]:
    """Return k and p of a power law of about the size of `law`, and 1 if its force begins smoothly in time, else 2.

    It sets scales, as of first steps; matched at the overlap that an impact at `speed` reaches.
    """
    xi = 1e-3 * pair.r_eff if 0.0 < pair.r_eff < math.inf else 1e-3
    energy = pair.m_eff * speed * speed
    for factor in (4.0, 0.25):
        while 1e-100 < xi < 1e100 and energy > 0.0 and (abs(_bounded(law, xi, pair)) * xi < energy) == (factor > 1.0):
            xi *= factor
    p, onset = (_slope(law, x, pair) for x in (xi, 1e-6 * xi))
    k = abs(_bounded(law, xi, pair)) / math.pow(xi, p)
    smooth = abs(onset - round(onset)) < 1e-3
    return (k if 0.0 < k < math.inf else 1.0), p, (1 if smooth else 2)


def _slope(law: Any, xi: float, pair: Pair) -> float:
    """Return d ln F / d ln ξ at rest at overlap `xi`, within [1, 3]; 1.5 where it cannot be told."""
    near, far = abs(_bounded(law, xi, pair)), abs(_bounded(law, 1.01 * xi, pair))
    if not 0.0 < near < math.inf or not 0.0 < far < math.inf:
        return 1.5
    return min(max(1.0, math.log(far / near) / math.log(1.01)), 3.0)


def _bounded(law: Any, xi: float, pair: Pair) -> float:
    """Return the force at rest at overlap `xi`, 0 if it is too large for a number."""
    try:
        return traits.evaluate(law, xi, 0.0, pair, xi)
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


def _first_mode(law: Any, xi: float, eta: float, pair: Pair) -> int:
    if xi < 0.0 or (xi == 0.0 and eta <= 0.0):
        return OPEN
    if xi == 0.0:
        return ACTIVE
    return ACTIVE if traits.evaluate(law, xi, eta, pair, xi) > 0.0 else RESIDUAL

"""What a picture says of the scene of a comparison in words: pairs, parameters, numbers with their units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.reports import PREFIXES, shortened, unit_of
from granular.laws.kinds import resolved
from granular.md.isolation import Durations
from granular.scene import Scene

if TYPE_CHECKING:
    from granular.comparison.answer import Judged

SAME = 1e-9
"""Numbers whose relative difference is less are one number."""
EXPONENTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
OF_MASS = ((1e3, "k"), *PREFIXES)
"""Multiples of the gram."""


def pair_name(scene: Scene, pair: int) -> str:
    """The two bodies of a pair, such as 1·2, or floor·1; their numbers are those of the library."""
    return "·".join(_body(scene, int(body)) for body in scene.bodies(pair))


def _body(scene: Scene, body: int) -> str:
    return str(body) if not scene.is_wall[body] else "wall" if not scene.gravity else "ceiling" if body else "floor"


def parameters(report: Judged) -> str:
    """Two lines with the parameters of a comparison: the scene, and the laws of its contacts."""
    return f"{_scene(report)}\n{_laws(report)}"


def _scene(report: Judged) -> str:
    scene, balls = report.scene, ~report.scene.is_wall
    inner = scene.gap[~np.logical_or(*scene.sides(scene.is_wall))]
    ratio = report.groups["mass_ratio"]
    return ", ".join([
        f"{balls.sum()} balls" if balls.sum() > 1 else "1 ball",
        *["on a ring"] * scene.ring,
        *[f"pendula of Ω = {number(scene.pendulum)} rad/s"] * (scene.pendulum > 0.0),
        f"m = {_span(1e3 * scene.mass[balls], 'g', OF_MASS)}" + f" ({number(ratio)} : 1)" * (ratio > 1.0 + SAME),
        *[f"gap {_span(inner, 'm')}" if inner.any() else "touching"] * bool(len(inner)),
        *[f"first impact at {number(report.impact_speed)} m/s"] * (report.impact_speed > 0.0),
        *[f"g = {number(scene.gravity)} m/s²"] * (scene.gravity > 0.0),
        *(shortened(repr(wall)) for wall in (scene.floor, scene.ceiling) if wall is not None),
    ])


def _laws(report: Judged) -> str:
    """The law, its constants, ε and t_c at the speed of the first impact; from which to which pair they go."""
    kinds = list(dict.fromkeys(type(law).__name__ for law in report.law))
    numbers = {name: np.array([getattr(law, name) for law in report.law])
               for name in (_constants(report.law) if len(kinds) == 1 else ())}
    soft, hard = (np.array(eps) for eps in (report.law_restitution, report.restitution_spec))
    lasts = _durations(report)
    return ", ".join([
        " and ".join(kinds),
        *(f"{name} = {_span(of)}{_stiffness(report) if name == 'k' else ''}" for name, of in numbers.items()),
        f"ε = {_span(soft)}" + f" (hard spheres {_span(hard)})" * bool((np.abs(soft - hard) > 1e-6).any()),
        *[f"a contact alone lasts {_span(lasts, 's', digits=3)}"] * bool(np.isfinite(lasts).any()),
    ])


def _stiffness(report: Judged) -> str:
    """The unit of k in F = k ξ^p, if that is the law."""
    form = resolved(report.law, report.scene)[0].form
    return "" if form is None else " N/m" if form[1] == 1.0 else f" N/m$^{{{form[1]:g}}}$"


def _constants(laws: Sequence[Any]) -> list[str]:
    """Constants of a law that say how hard a ball is: the damping is told by ε."""
    named = [field.name for field in fields(laws[0])] if is_dataclass(laws[0]) else []
    return [name for name in named if name not in ("gamma", "alpha") and isinstance(getattr(laws[0], name), float)]


def _durations(report: Judged) -> Any:
    """How long a contact of each pair lasts by itself, at the speed of the first impact, in s; inf without an end."""
    n = report.scene.n_pairs
    return Durations(report.law, report.scene)(np.arange(n), np.full(n, report._speed))


def _span(values: Any, unit: str = "", prefixes: Any = PREFIXES, digits: int = 4) -> str:
    """One number, or from which to which they go, with a unit."""
    known = values[np.isfinite(values)]
    if not len(known):
        return "–"
    low, high = float(known.min()), float(known.max())
    if high - low <= SAME * abs(high):
        return _one(high, unit, prefixes, digits)
    between = " and " if len(values) == 2 else " … "
    ends = (float(known[0]), float(known[-1])) if len(values) == 2 else (low, high)
    return between.join(_one(value, unit, prefixes, digits) for value in ends)


def _one(value: float, unit: str, prefixes: Any, digits: int) -> str:
    if not unit or value == 0.0:
        return f"{number(value, digits)} {unit}".strip()
    scale, name = unit_of(abs(value), unit, 1.0, prefixes)
    return f"{number(value / scale, digits)} {name}"


def number(value: float, digits: int = 4) -> str:
    """A number with so many digits, its power of ten as one writes it by hand."""
    factor, _, power = f"{value:.{digits}g}".partition("e")
    if not power:
        return factor
    return f"{factor}·" * (factor != "1") + f"10{str(int(power)).translate(EXPONENTS)}"

"""Ready-made cases: each scene of `granular.scenes` with a default law, rule and stop condition."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from granular import _check, scenes, until
from granular.cases import build
from granular.cases.case import Case
from granular.cases.options import Option, options_of, summary, unknown
from granular.rules import ConstantRestitution
from granular.scene import Scene


@dataclass(frozen=True)
class Template:
    """How a scene becomes a case.

    Attributes
    ----------
    make : callable
        The function of `granular.scenes`.
    until : stop condition or None
        When to stop.
    t_end : callable
        The end time in s for a scene; None: the stop condition is sure to come.
    contact : mapping
        Defaults of `contact` that differ for this scene.
    """

    make: Callable[..., Scene]
    until: until.Until | None
    t_end: Callable[[Scene], float | None] = lambda scene: None
    contact: Mapping[str, Any] = field(default_factory=dict)


def falls(count: float) -> Callable[[Scene], float | None]:
    """End times of `count` falls: the time s/g in which gravity gives the speed s of the first impact on the floor."""

    def t_end(scene: Scene) -> float | None:
        return (count * first_impact(scene) / scene.gravity or None) if scene.gravity else None

    return t_end


def flights(count: float) -> Callable[[Scene], float | None]:
    """End times in which a ball of a gas crosses `count` mean gaps."""

    def t_end(scene: Scene) -> float | None:
        rms = math.sqrt(float((scene.velocity**2).mean()))
        return count * float(scene.gap.mean()) / rms if rms else None

    return t_end


STEEL = {"restitution": 1.0, "stiffness": 2e10, "law": "TsujiHertz"}
"""Elastic Hertz contacts of steel balls of 1 kg; below ε = 1 with Tsuji's damping."""

TEMPLATES = {
    "three-balls": Template(scenes.three_balls, until.contact(pair=0, nth=2), falls(10)),
    "ball-stack": Template(scenes.ball_stack, until.separated(), falls(10), {"restitution": 0.9}),
    "newtons-cradle": Template(scenes.newtons_cradle, until.separated(), contact=STEEL),
    "chain": Template(scenes.chain, until.separated(), contact=STEEL),
    "column": Template(scenes.column, until.separated(), falls(20), {"restitution": 0.9}),
    "gas": Template(scenes.gas, None, flights(10), {"restitution": 0.9}),
    "bouncing-ball": Template(scenes.bouncing_ball, None, falls(6)),  # at ε = 0.7 it rests after 17/3 falls
}


def make(name: str, *, t_end: float | None = None, run: Mapping[str, Any] | None = None, **options: Any) -> Case:
    """Make a ready-made case.

    Parameters
    ----------
    name : str
        One of `names`.
    t_end : float, optional
        End time in s in place of the case's own.
    run : mapping, optional
        Further options of ``simulate``.
    **options
        Parameters of the scene's function in `granular.scenes`, and `restitution`, `stiffness`, `law` of `contact`.

    Raises
    ------
    TypeError, ValueError
        For an unknown name or option (with a suggestion), or a bad value.
    """
    template = _named(name)
    known = [option.name for option in _options(template)]
    if wrong := unknown(options, known, f"option of {name}"):
        raise TypeError(wrong)
    of_scene = {key: options.pop(key) for key in list(options) if key in inspect.signature(template.make).parameters}
    case = around(name, template.make(**of_scene), **options)
    end = case.t_end if t_end is None else _check.number("t_end", t_end, at_least=0.0)
    return replace(case, t_end=end, run=dict(run or {}))


def around(name: str, scene: Scene, **of_contact: Any) -> Case:
    """Return the case of that name around a scene of its kind, with options of `contact`."""
    template = _named(name)
    law, rule = contact(scene, **(dict(template.contact) | of_contact))
    return Case(scene, law, rule, template.until, template.t_end(scene), about=about(name))


def contact(
    scene: Scene, restitution: float | Sequence[float] = 0.7, stiffness: float = 5e7, law: str = "LinearDashpot"
) -> tuple[tuple[Any, ...], Any]:
    """Return force laws and the collision rule of the same restitution for all pairs of a scene.

    Parameters
    ----------
    restitution : float or floats
        Coefficient of restitution in (0, 1]: one for all pairs, or one per pair bottom to top.
    stiffness : float
        Stiffness k: in N/m, for the Hertz laws in N/m^(3/2).
    law : str
        LinearDashpot, TsujiHertz, WaltonBraun, or ViscoelasticHertz (restitution then holds at the speed of the
        first impact, and falls with speed).

    Returns
    -------
    tuple of laws, rule or None
        The rule is None where restitution depends on speed: then it is to be taken from the laws.
    """
    kinds = [name for name, kind in build.LAWS.items() if hasattr(kind, "from_restitution")]
    from_restitution = build.LAWS[_check.choice("law", law, kinds)].from_restitution
    needs = inspect.signature(from_restitution).parameters
    k = _check.number("stiffness", stiffness, above=0.0)
    given = {"k": k, "k_load": k, "speed": first_impact(scene)}
    values = {key: value for key, value in given.items() if key in needs}
    eps = list(restitution) if isinstance(restitution, Sequence) else restitution
    laws = tuple(
        build.call([from_restitution], {"restitution": e} | values, pair=pair)
        for e, pair in zip(_check.per_pair("restitution", eps, scene.n_pairs), scene.pairs, strict=True)
    )
    return laws, None if "speed" in needs else ConstantRestitution(eps)


def names() -> list[str]:
    """Names of the ready-made cases."""
    return list(TEMPLATES)


def about(name: str) -> str:
    """Return what a ready-made case is, in one line."""
    return summary(_named(name).make)


def options(name: str) -> list[Option]:
    """Return the options of a ready-made case: those of its scene, then those of the contacts."""
    return _options(_named(name))


def _options(template: Template) -> list[Option]:
    """Options of the scene and of `contact`, with the defaults of this case."""
    of_contact = [replace(o, default=template.contact.get(o.name, o.default)) for o in options_of(contact)]
    return options_of(template.make) + of_contact


def first_impact(scene: Scene) -> float:
    """Largest speed in m/s at which a pair would meet first if it were alone; 0 if none meets."""
    closing = -scene.across(scene.velocity)
    square = closing * np.abs(closing) + 2.0 * scene.pull * np.maximum(scene.gap, 0.0)
    return math.sqrt(max(0.0, float(square.max())))


def _named(name: str) -> Template:
    return TEMPLATES[_check.choice("scene", name, names())]

"""Ready-made cases: scenes of `granular.scenes` with default law, rule and end."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from granular._engine import check
from granular.cases import balls, build, materials, scenes
from granular.cases.case import Case, Option, options_of, summary
from granular.laws import Hertz, LinearDashpot
from granular.laws.hertz import hertz_stiffness
from granular.laws.rules import ConstantRestitution
from granular.md import waves
from granular.run import until
from granular.scene import Pair, Scene, walls
from granular.scene.walls.motion import ends, fastest

STEEL_CONTACT = {"restitution": 1.0, "stiffness": 2e10, "law": "TsujiHertz"}
"""Hertz contacts of steel balls of 1 kg, with Tsuji's damping for ε below 1."""


def first_impact_speed(scene: Scene) -> float:
    """Largest speed in m/s of the first impact of each pair on its own.

    Walls have their largest speed. v² = v_0² + 2 a gap under the acceleration a, and v² = v_0² + Ω² ((gap - rest)² -
    rest²) for pendula. 0 if no pair collides.
    """
    closing = -scene.across(scene.velocity)
    gap = np.maximum(scene.gap, 0.0)
    rest = 0.0 if scene.rest_gap is None else scene.rest_gap
    returns = (scene.pull > 0.0) | (scene.pendulum > 0.0)  # a pair that parts comes back as fast
    from_flight = np.where(returns, closing**2, closing * np.abs(closing))
    square = from_flight + gap * (2.0 * scene.pull + scene.pendulum**2 * (gap - 2.0 * rest))
    speed = np.sqrt(np.maximum(0.0, square))
    speed[0] += fastest(scene.floor)
    speed[-1] += fastest(scene.ceiling)
    return float(speed.max())


def of_restitution(
    scene: Scene, restitution: float | Sequence[float] = 0.7, stiffness: float = 5e7, law: str = "LinearDashpot",
    material: str | None = None,
) -> tuple[tuple[Any, ...], Any]:
    """Return force laws and the collision rule of equal restitution for a scene.

    Parameters
    ----------
    restitution : float or floats
        Coefficient of restitution in (0, 1]: one for all pairs, or one per pair bottom to top.
    stiffness : float
        Stiffness k in N/m, for the Hertz laws in N/m^(3/2).
    law : str
        LinearDashpot, Hertz (elastic: restitution 1), TsujiHertz, WaltonBraun, or ViscoelasticHertz (restitution then
        holds at the speed of the first impact, and decreases with speed).
    material : str, optional
        Material of balls and walls, a name of `granular.materials`, for the Hertz laws instead of a stiffness.

    Returns
    -------
    tuple of laws, rule or None
        The rule is None if the restitution depends on the speed. It then has to be taken from the laws.
    """
    known = list(LAW_CONSTRUCTORS) if material is None else [name for name in LAW_CONSTRUCTORS if "Hertz" in name]
    way = LAW_CONSTRUCTORS[check.choice("law" if material is None else "the law of a material", law, known)]
    needs = {parameter.name for parameter in build.parameters(way)}
    k, speed = check.number("stiffness", stiffness, above=0.0), first_impact_speed(scene)
    eps = list(restitution) if isinstance(restitution, Sequence) else restitution
    of = None if material is None else materials.named(material)

    def made(e: float, pair: Pair) -> Any:
        stiff = k if of is None else hertz_stiffness(of.young, of.poisson, pair)
        values = {"restitution": e, "k": stiff, "k_load": stiff, "speed": speed}
        return build.call([way], {key: value for key, value in values.items() if key in needs}, pair=pair)

    laws = build.each_pair(made, check.per_pair("restitution", eps, scene.n_pairs), scene.pairs)
    return laws, None if "speed" in needs else ConstantRestitution(eps)


def _elastic_hertz(restitution: float, k: float) -> Hertz:
    """Return Hertz's law, for restitution 1 only."""
    check.number("restitution", restitution, at_least=1.0, at_most=1.0,
                  fix="Hertz's law is elastic. For damping use TsujiHertz or ViscoelasticHertz.")
    return Hertz(k)


LAW_CONSTRUCTORS = {"Hertz": _elastic_hertz} | {
    name: kind.from_restitution for name, kind in build.LAWS.items() if hasattr(kind, "from_restitution")}
"""Laws of `of_restitution`, and their constructors."""


def of_balls(
    scene: Scene, lower: str | balls.Ball = "basketball", upper: str | balls.Ball | None = "tennis ball",
    pair_rule: str = "lens",
) -> tuple[tuple[Any, ...], Any]:
    """Return force laws and the collision rule of real balls, see `granular.balls`.

    Parameters
    ----------
    lower, upper : str or Ball
        The balls of the scene.
    pair_rule : {"lens", "series"}
        Rule for the contact of the two balls.
    """
    check.choice("pair_rule", pair_rule, balls.RULES)
    floor = balls.named(lower, "lower")
    each = [floor, floor if upper is None else balls.contact(lower, upper, pair_rule)][: scene.n_pairs]
    laws = [LinearDashpot.from_restitution(one.restitution, one.stiffness, pair)
            for one, pair in zip(each, scene.pairs, strict=True)]
    return tuple(laws), ConstantRestitution([one.restitution for one in each])


@dataclass(frozen=True)
class Template:
    """Recipe for a case from a scene.

    Attributes
    ----------
    make : callable
        The function of `granular.scenes`.
    until : stop condition or None
        The stop condition.
    t_end : callable
        Function of the scene that returns the end time in s. None if the stop condition is certain to be met.
    contact : mapping
        Defaults of `touch` that differ for this scene.
    pressed : callable or None
        Function of the scene and its laws that returns the end time in s, if overlaps at the start depend on the laws.
        `make` then takes the laws.
    touch : callable
        Function of `granular.cases.ready` that returns the force laws and the collision rule of a scene.
    """

    make: Callable[..., Scene]
    until: until.Until | None
    t_end: Callable[[Scene], float | None] = lambda scene: None
    contact: Mapping[str, Any] = field(default_factory=dict)
    pressed: Callable[[Scene, Any], float | None] | None = None
    touch: Callable[..., tuple[tuple[Any, ...], Any]] = of_restitution


def falls(count: float, scene: Scene) -> float | None:
    """End time after `count` fall times s/g.

    s is the speed of the first impact on the floor.
    """
    return (count * first_impact_speed(scene) / scene.gravity or None) if scene.gravity else None


def flights(count: float, scene: Scene) -> float | None:
    """End time in which a ball of a gas crosses `count` mean gaps."""
    rms = math.sqrt(float((scene.velocity**2).mean()))
    return count * float(scene.gap.mean()) / rms if rms else None


def swings(periods: float, scene: Scene) -> float | None:
    """Return the end time after `periods` periods of pendula."""
    return periods * 2.0 * math.pi / scene.pendulum


def shaken(periods: float, scene: Scene) -> float | None:
    """Return the end time after `periods` periods of a shaken floor.

    A floor whose path ends earlier ends the run.
    """
    end = ends(scene.floor)
    return periods / scene.floor.frequency if isinstance(scene.floor, walls.Sine) else end if end < math.inf else None


def bounces(count: float, periods: float, scene: Scene) -> float | None:
    """End time after `count` falls on a floor at rest, or periods of a shaken one."""
    return shaken(periods, scene) if scene.driven else falls(count, scene)


def crossings(count: float, periods: float, scene: Scene, law: Any) -> float | None:
    """End time of a compressed chain.

    After `count` passages of a slow wave, or periods of its floor.
    """
    if scene.driven:
        return shaken(periods, scene)
    once = waves.crossing_time(scene, law)
    return count * once if once < math.inf else None


TEMPLATES = {
    "three-balls": Template(scenes.three_balls, until.contact(pair=0, nth=2), partial(falls, 10)),
    "ball-stack": Template(scenes.ball_stack, until.separated(), partial(falls, 10), {"restitution": 0.9}),
    "real-balls": Template(scenes.real_balls, until.contact(pair=0, nth=2), partial(falls, 10), touch=of_balls),
    "newtons-cradle": Template(scenes.newtons_cradle, until.separated(), contact=STEEL_CONTACT),
    "chain": Template(scenes.chain, until.separated(), contact=STEEL_CONTACT),
    "column": Template(scenes.column, until.separated(), partial(falls, 20), {"restitution": 0.9}),
    "gas": Template(scenes.gas, None, partial(flights, 10), {"restitution": 0.9}),
    "ring-gas": Template(scenes.ring_gas, None, partial(flights, 10), {"restitution": 0.9}),
    "heated-gas": Template(scenes.heated_gas, None, partial(flights, 20), {"restitution": 1.0}),
    "bouncing-ball": Template(scenes.bouncing_ball, None, partial(bounces, 6, 50)),  # at ε = 0.7 it rests after 17/3
    "vibrated-column": Template(scenes.vibrated_column, None, partial(shaken, 20), contact={"restitution": 0.95}),
    "pendulum-cradle": Template(
        scenes.pendulum_cradle, None, partial(swings, 10), STEEL_CONTACT | {"restitution": 0.95}
    ),
    "compressed-chain": Template(
        scenes.compressed_chain, None, contact=STEEL_CONTACT | {"stiffness": 1e10}, pressed=partial(crossings, 2, 50)
    ),
}


@check.face
def make(name: str, *, t_end: float | None = None, run: Mapping[str, Any] | None = None, **options: Any) -> Case:
    """Return a ready-made case.

    Parameters
    ----------
    name : str
        One of `names`.
    t_end : float, optional
        End time in s. Defaults to the case's own.
    run : mapping, optional
        Further options of ``simulate``.
    **options
        Parameters of the scene's function in `granular.scenes`, and `restitution`, `stiffness`, `law` of its contacts.
        "real-balls" has `pair_rule`.

    Raises
    ------
    TypeError, ValueError
        For an unknown name or option (with a suggestion), or an invalid value.
    """
    shapes, touches = shaping(name), _touching(name)
    check.known(options, shapes | touches, f"option of {name}", TypeError)
    of_scene = {key: value for key, value in options.items() if key in shapes}
    case = bare(name, of_scene, t_end)
    case = touching(name, case, **{key: value for key, value in options.items() if key in touches})
    return replace(pressed(name, case, of_scene), run={} if run is None else run)


def of_table(name: str, given: Mapping[str, Any]) -> Case:
    """Return a case from a table of a file.

    The options of `of_restitution` have tables of their own.
    """
    own = set() if _named(name).touch is of_restitution else _touching(name)
    case = bare(name, {key: value for key, value in given.items() if key not in own - shaping(name)})
    return touching(name, case, **{key: value for key, value in given.items() if key in own})


def bare(name: str, of_scene: Mapping[str, Any], t_end: float | None = None) -> Case:
    """Return a ready-made case without contacts: the scene and its end."""
    template = _named(name)
    if template.pressed is not None:
        check.known(of_scene, shaping(name), f"parameter of {name}")
    untouched = {} if template.pressed is None else {"law": None}
    scene = build.call([template.make], build.walled(of_scene) | untouched)
    end = template.t_end(scene) if t_end is None else check.number("t_end", t_end, at_least=0.0)
    if end is not None and not math.isfinite(end):
        raise ValueError(f"The end time of {name} exceeds the range of floating-point numbers. Give `t_end`, or use "
                         "other units.")
    return Case(scene, None, None, template.until, end, about=about(name))


def touching(name: str, case: Case, **of_contact: Any) -> Case:
    """Return a bare case with its contacts, from options of the contacts."""
    template = _named(name)
    if {"material", "stiffness"} <= of_contact.keys():
        raise ValueError("Only one of `material` and `stiffness` can be given, got both.")
    law, rule = template.touch(case.scene, **(dict(template.contact) | of_contact))
    return replace(case, law=law, rule=rule)


def pressed(name: str, case: Case, of_scene: Mapping[str, Any]) -> Case:
    """Return a case with the static overlaps of its laws, and its end time."""
    template = _named(name)
    if template.pressed is None or case.law is None:
        return case
    scene = build.call([template.make], build.walled(of_scene) | {"law": case.law})
    return replace(case, scene=scene, t_end=template.pressed(scene, case.law) if case.t_end is None else case.t_end)


def is_whole(name: str) -> bool:
    """Return whether scene and contacts depend on each other.

    They depend by overlaps, or by the kind of ball.
    """
    template = _named(name)
    return template.pressed is not None or template.touch is not of_restitution


@check.face
def names() -> list[str]:
    """Names of the ready-made cases."""
    return list(TEMPLATES)


def is_file(scene: Any) -> bool:
    """Return whether a word is the name of a file, by its ending or existence.

    Names of cases are not file names.
    """
    if not isinstance(scene, (str, os.PathLike)) or scene in TEMPLATES:
        return False
    return os.fspath(scene).lower().endswith(".toml") or os.path.exists(scene)


@check.face
def about(name: str) -> str:
    """Return the description of a ready-made case, in one line."""
    return summary(_named(name).make)


@check.face
def options(name: str) -> list[Option]:
    """Return the options of a ready-made case: scene first, then contacts.

    They have the defaults of the case.
    """
    template = _named(name)
    return options_of(template.make) + [
        replace(option, default=template.contact.get(option.name, option.default))
        for option in options_of(template.touch) if option.name not in shaping(name)]


def shaping(name: str) -> set[str]:
    """Names of the options of a ready-made case that belong to its scene."""
    return {parameter.name for parameter in build.parameters(_named(name).make)} - {"law"}


def _touching(name: str) -> set[str]:
    """Names of the options of a ready-made case that belong to its contacts."""
    return {parameter.name for parameter in build.parameters(_named(name).touch)[1:]}


def _named(name: str) -> Template:
    return TEMPLATES[check.choice("scene", name, names())]

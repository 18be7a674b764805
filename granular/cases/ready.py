"""Ready-made cases: scenes of `granular.scenes` with a default law, rule and end."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular.cases import balls, build, materials, scenes
from granular.cases.case import Case, Option, options_of, summary
from granular.laws import Hertz, LinearDashpot
from granular.laws.hertz import hertz_stiffness
from granular.laws.rules import ConstantRestitution
from granular.md import waves
from granular.run import until
from granular.scene import Pair, Scene, walls
from granular.scene.walls.motion import ends, max_wall_speed

STEEL_CONTACT = {"restitution": 1.0, "stiffness": 2e10, "law": "TsujiHertz"}
"""Hertz contacts of steel balls of 1 kg, with Tsuji's damping for ε below 1."""


def first_impact_speed(scene: Scene) -> float:
    """Return the largest speed in m/s at which a pair collides for the first time.

    The first impact of each pair is computed as if no other pair collided. Its speed is v² = v_0² + 2 a gap under the
    acceleration a, plus Ω² ((gap - rest)² - rest²) for pendula. The largest speed of a driven wall is added to v. The
    result is 0 if no pair collides.
    """
    closing = -scene.across(scene.velocity)
    gap = np.maximum(scene.gap, 0.0)
    rest = 0.0 if scene.rest_gap is None else scene.rest_gap
    # a pair that separates returns at the same speed
    returns = (scene.closing_acceleration > 0.0) | (scene.pendulum > 0.0)
    from_flight = np.where(returns, closing**2, closing * np.abs(closing))
    square = from_flight + gap * (2.0 * scene.closing_acceleration + scene.pendulum**2 * (gap - 2.0 * rest))
    speed = np.sqrt(np.maximum(0.0, square))
    speed[0] += max_wall_speed(scene.floor)
    speed[-1] += max_wall_speed(scene.ceiling)
    return float(speed.max())


def of_restitution(
    scene: Scene, restitution: float | Sequence[float] = 0.7, stiffness: float = 5e7, law: str = "LinearDashpot",
    material: str | None = None,
) -> tuple[tuple[Any, ...], Any]:
    """Return force laws and a collision rule with the same coefficient of restitution.

    Parameters
    ----------
    scene : Scene
        The scene that the laws are made for.
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
        The rule is None if the restitution depends on the speed. It then has to be derived from the laws.
    """
    choices = list(LAW_CONSTRUCTORS) if material is None else [name for name in LAW_CONSTRUCTORS if "Hertz" in name]
    constructor = LAW_CONSTRUCTORS[check.choice("law" if material is None else "the law of a material", law, choices)]
    # without the keyword-only parameters of `from_restitution`, which replace the stiffness
    accepted = {p.name for p in build.parameters(constructor) if p.kind is not p.KEYWORD_ONLY}
    k, speed = check.number("stiffness", stiffness, above=0.0), first_impact_speed(scene)
    restitutions = list(restitution) if isinstance(restitution, Sequence) else restitution
    chosen_material = None if material is None else materials.named(material)

    def law_of_pair(eps: float, pair: Pair) -> Any:
        k_pair = k if chosen_material is None else hertz_stiffness(chosen_material.young, chosen_material.poisson, pair)
        values = {"restitution": eps, "k": k_pair, "k_load": k_pair, "speed": speed}
        return build.call([constructor], {key: value for key, value in values.items() if key in accepted}, pair=pair)

    laws = build.laws_of_pairs(law_of_pair, check.per_pair("restitution", restitutions, scene.n_pairs), scene.pairs)
    return laws, None if "speed" in accepted else ConstantRestitution(restitutions)


def _elastic_hertz(restitution: float, k: float) -> Hertz:
    """Return Hertz's law. Raise `ValueError` for a restitution other than 1."""
    check.number("restitution", restitution, at_least=1.0, at_most=1.0,
                  fix="Hertz's law is elastic. For damping use TsujiHertz or ViscoelasticHertz.")
    return Hertz(k)


LAW_CONSTRUCTORS = {"Hertz": _elastic_hertz} | {
    name: kind.from_restitution for name, kind in build.LAWS.items() if hasattr(kind, "from_restitution")}
"""Constructors of the laws that `of_restitution` accepts, by name."""


def of_balls(
    scene: Scene, lower: str | balls.Ball = "basketball", upper: str | balls.Ball | None = "tennis ball",
    pair_rule: str = "lens",
) -> tuple[tuple[Any, ...], Any]:
    """Return force laws and a collision rule for real balls, see `granular.balls`.

    Parameters
    ----------
    scene : Scene
        Scene of a floor and one or two balls.
    lower, upper : str or Ball
        The balls of the scene. `upper` is None if the lower ball falls alone.
    pair_rule : {"lens", "series"}
        Rule for the contact of the two balls.
    """
    check.choice("pair_rule", pair_rule, balls.RULES)
    floor = balls.named(lower, "lower")
    contacts = [floor, floor if upper is None else balls.contact(lower, upper, pair_rule)][: scene.n_pairs]
    laws = [LinearDashpot.from_restitution(contact.restitution, contact.stiffness, pair)
            for contact, pair in zip(contacts, scene.pairs, strict=True)]
    return tuple(laws), ConstantRestitution([contact.restitution for contact in contacts])


@dataclass(frozen=True)
class Template:
    """Ready-made case whose options have not been chosen: functions and defaults.

    Attributes
    ----------
    make : callable
        Function of `granular.scenes` that returns the scene.
    until : stop condition or None
        The stop condition.
    t_end : callable
        Function of the scene that returns the end time in s. It returns None if the stop condition is certain to be
        met.
    contact : mapping
        Arguments of `touch` for this scene, where they differ from the defaults of `touch`.
    pressed : callable or None
        For scenes whose initial overlaps depend on the laws: function of the scene and its laws that returns the end
        time in s. `make` then has the parameter `law`.
    touch : callable
        Function of `granular.cases.ready` that returns the force laws and the collision rule of a scene.
    """

    make: Callable[..., Scene]
    until: until.Until | None
    t_end: Callable[[Scene], float | None] = lambda scene: None
    contact: Mapping[str, Any] = field(default_factory=dict)
    pressed: Callable[[Scene, Any], float | None] | None = None
    touch: Callable[..., tuple[tuple[Any, ...], Any]] = of_restitution


def fall_time(count: float, scene: Scene) -> float | None:
    """Return the default end time of a fall in s: `count` times v/g.

    v is `first_impact_speed`. A ball that starts at rest falls for about v/g, and a ball thrown up with v rises
    for v/g. The result is None without gravity, or if no pair collides.
    """
    return (count * first_impact_speed(scene) / scene.gravity or None) if scene.gravity else None


def flight_time(count: float, scene: Scene) -> float | None:
    """Return the time in s in which a ball of a gas crosses `count` mean gaps.

    The speed is the root mean square of the velocities. The result is None if all velocities are 0.
    """
    rms = math.sqrt(float((scene.velocity**2).mean()))
    return count * float(scene.gap.mean()) / rms if rms else None


def swing_time(periods: float, scene: Scene) -> float | None:
    """Return the duration in s of `periods` periods of the pendula."""
    return periods * 2.0 * math.pi / scene.pendulum


def shaking_time(periods: float, scene: Scene) -> float | None:
    """Return the duration in s of `periods` periods of a sinusoidally driven floor.

    For another motion of the floor, the result is the time at which its path ends, or None if the path does not end.
    """
    last = ends(scene.floor)
    return periods / scene.floor.frequency if isinstance(scene.floor, walls.Sine) else last if last < math.inf else None


def bounce_time(count: float, periods: float, scene: Scene) -> float | None:
    """Return the end time in s of a ball that bounces on a floor.

    It is `shaking_time` of `periods` for a driven floor, otherwise `fall_time` of `count`.
    """
    return shaking_time(periods, scene) if scene.driven else fall_time(count, scene)


def chain_time(count: float, periods: float, scene: Scene, law: Any) -> float | None:
    """Return the end time in s of a run of a compressed chain.

    It is `shaking_time` of `periods` for a driven floor. Otherwise it is `count` times the time in which a long wave
    crosses the chain, or None if no balls are in contact.
    """
    if scene.driven:
        return shaking_time(periods, scene)
    crossing = waves.crossing_time(scene, law)
    return count * crossing if crossing < math.inf else None


TEMPLATES = {
    "three-balls": Template(scenes.three_balls, until.contact(pair=0, nth=2), partial(fall_time, 10)),
    "ball-stack": Template(scenes.ball_stack, until.separated(), partial(fall_time, 10), {"restitution": 0.9}),
    "real-balls": Template(scenes.real_balls, until.contact(pair=0, nth=2), partial(fall_time, 10), touch=of_balls),
    "newtons-cradle": Template(scenes.newtons_cradle, until.separated(), contact=STEEL_CONTACT),
    "chain": Template(scenes.chain, until.separated(), contact=STEEL_CONTACT),
    "column": Template(scenes.column, until.separated(), partial(fall_time, 20), {"restitution": 0.9}),
    "gas": Template(scenes.gas, None, partial(flight_time, 10), {"restitution": 0.9}),
    "ring-gas": Template(scenes.ring_gas, None, partial(flight_time, 10), {"restitution": 0.9}),
    "heated-gas": Template(scenes.heated_gas, None, partial(flight_time, 20), {"restitution": 1.0}),
    # at ε = 0.7 a ball on a floor at rest comes to rest after 17/3 fall times
    "bouncing-ball": Template(scenes.bouncing_ball, None, partial(bounce_time, 6, 50)),
    "vibrated-column": Template(scenes.vibrated_column, None, partial(shaking_time, 20), contact={"restitution": 0.95}),
    "pendulum-cradle": Template(
        scenes.pendulum_cradle, None, partial(swing_time, 10), STEEL_CONTACT | {"restitution": 0.95}
    ),
    "compressed-chain": Template(
        scenes.compressed_chain, None, contact=STEEL_CONTACT | {"stiffness": 1e10},
        pressed=partial(chain_time, 2, 50)
    ),
}


@signature.face
def make(name: str, *, t_end: float | None = None, run: Mapping[str, Any] | None = None, **options: Any) -> Case:
    """Return a ready-made case.

    Parameters
    ----------
    name : str
        One of `names`.
    t_end : float, optional
        End time in s. Defaults to the end time of the ready-made case.
    run : mapping, optional
        Further options of ``simulate``.
    **options
        Parameters of the scene's function in `granular.scenes`, and `restitution`, `stiffness`, `law` and `material`
        of its contacts. The contacts of "real-balls" have only the option `pair_rule`.

    Raises
    ------
    TypeError, ValueError
        For an unknown name or option (with a suggestion), or an invalid value.
    """
    scene_options, contact_options = scene_option_names(name), _contact_option_names(name)
    check.known_names(options, scene_options | contact_options, f"option of {name}", TypeError)
    of_scene = {key: value for key, value in options.items() if key in scene_options}
    case = case_without_contacts(name, of_scene, t_end)
    case = with_contacts(name, case, **{key: value for key, value in options.items() if key in contact_options})
    return replace(with_static_overlaps(name, case, of_scene), run={} if run is None else run)


def case_of_table(name: str, table: Mapping[str, Any]) -> Case:
    """Return a ready-made case from the [scene] table of a file.

    The options of `of_restitution` are not keys of [scene], because the table [law] contains them. The option
    `pair_rule` of "real-balls" is a key of [scene].
    """
    contact_options = set() if _template_named(name).touch is of_restitution else _contact_option_names(name)
    others = contact_options - scene_option_names(name)
    case = case_without_contacts(name, {key: value for key, value in table.items() if key not in others})
    return with_contacts(name, case, **{key: value for key, value in table.items() if key in contact_options})


def case_without_contacts(name: str, of_scene: Mapping[str, Any], t_end: float | None = None) -> Case:
    """Return a ready-made case without force law and collision rule.

    Parameters
    ----------
    name : str
        Name of the ready-made case.
    of_scene : mapping
        Arguments of the function of the scene.
    t_end : float, optional
        End time in s. Defaults to the end time of the ready-made case.
    """
    template = _template_named(name)
    if template.pressed is not None:
        check.known_names(of_scene, scene_option_names(name), f"parameter of {name}")
    without_law = {} if template.pressed is None else {"law": None}
    scene = build.call([template.make], build.with_wall_motions(of_scene) | without_law)
    end = template.t_end(scene) if t_end is None else check.number("t_end", t_end, at_least=0.0)
    if end is not None and not math.isfinite(end):
        raise ValueError(f"The end time of {name} exceeds the range of floating-point numbers. Give `t_end`, or use "
                         "other units.")
    return Case(scene, None, None, template.until, end, about=about(name))


def with_contacts(name: str, case: Case, **of_contact: Any) -> Case:
    """Return `case` with its force laws and its collision rule.

    `case` is a result of `case_without_contacts`. `of_contact` has options of the contacts, such as `restitution`.
    """
    template = _template_named(name)
    if {"material", "stiffness"} <= of_contact.keys():
        raise ValueError("Only one of `material` and `stiffness` can be given, got both.")
    law, rule = template.touch(case.scene, **(dict(template.contact) | of_contact))
    return replace(case, law=law, rule=rule)


def with_static_overlaps(name: str, case: Case, of_scene: Mapping[str, Any]) -> Case:
    """Return `case` with the initial overlaps that its force laws give.

    If the case has no end time, the end time is computed, too. Cases whose scene does not depend on the laws are
    returned unchanged. `of_scene` has the arguments of the function of the scene.
    """
    template = _template_named(name)
    if template.pressed is None or case.law is None:
        return case
    scene = build.call([template.make], build.with_wall_motions(of_scene) | {"law": case.law})
    return replace(case, scene=scene, t_end=template.pressed(scene, case.law) if case.t_end is None else case.t_end)


def couples_scene_and_contacts(name: str) -> bool:
    """Return whether scene and contacts of a ready-made case depend on each other.

    This holds if the initial overlaps depend on the force laws, or if the names of the balls determine scene and
    contacts.
    """
    template = _template_named(name)
    return template.pressed is not None or template.touch is not of_restitution


@signature.face
def names() -> list[str]:
    """Names of the ready-made cases."""
    return list(TEMPLATES)


def is_file(scene: Any) -> bool:
    """Return whether `scene` names a file: it ends in .toml, or such a file exists.

    Names of ready-made cases are not file names.
    """
    if not isinstance(scene, (str, os.PathLike)) or scene in TEMPLATES:
        return False
    return os.fspath(scene).lower().endswith(".toml") or os.path.exists(scene)


@signature.face
def about(name: str) -> str:
    """Return the description of a ready-made case, in one line."""
    return summary(_template_named(name).make)


@signature.face
def options(name: str) -> list[Option]:
    """Return the options of a ready-made case with their defaults.

    The options of the scene come first, followed by the options of the contacts.
    """
    template = _template_named(name)
    return options_of(template.make) + [
        replace(option, default=template.contact.get(option.name, option.default))
        for option in options_of(template.touch) if option.name not in scene_option_names(name)]


def scene_option_names(name: str) -> set[str]:
    """Return the names of the scene options of a ready-made case."""
    return {parameter.name for parameter in build.parameters(_template_named(name).make)} - {"law"}


def _contact_option_names(name: str) -> set[str]:
    """Return the names of the contact options of a ready-made case."""
    return {parameter.name for parameter in build.parameters(_template_named(name).touch)[1:]}


def _template_named(name: str) -> Template:
    return TEMPLATES[check.choice("scene", name, names())]

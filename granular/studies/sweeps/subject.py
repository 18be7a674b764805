"""Subject of a sweep, its parameters by name, and axes of values.

A subject is a ready-made case, a function that returns cases, a TOML file, or a `Case`. The name of a parameter is a
path, such as ``gap``, ``radii[0]``, ``law.k`` (of all pairs), ``law[0].k``, ``floor.amplitude``,
``external_force[1]``, ``run.dt``. The parameters of a file are the numbers in its tables. The parameters of a `Case`
are its fields. For files and cases the first part of the path can be omitted: ``mass[1]`` is ``scene.mass[1]``, ``k``
is ``law.k``. In a user-defined scene, ``gap`` is the gap of all pairs of balls. ``restitution`` of a `Case` is the
restitution of all its laws, at constant stiffness, and of its rule.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from granular import cases, md
from granular._engine import check, signature
from granular.cases import build, ready
from granular.cases.case import Case, descriptions, integer_parameters, options_of, parameters_of
from granular.cases.toml import case_of_tables, read_tables
from granular.md.binary import restitution
from granular.scene.state import Scene

Values = np.ndarray[Any, np.dtype[Any]]

MAX_CELLS = 10**8
"""Maximum number of cells of a sweep: the results must fit into memory."""
_NAME = re.compile(r"\w+(\[\d+\])*(\.\w+(\[\d+\])*)*")
_UNIT = re.compile(r"\bin (kg/m³|m/s²|m/s|N/m\^\(3/2\)|N/m|kg|m|s|J|N|Hz|rad)(?![\w/^])")
CASE_PARTS = ("scene", "law", "rule", "run")
"""Parts of a case that are searched for a parameter given without its first part."""
_WALLS = dict.fromkeys(build.WALL_MOTION_KEYS, tuple(build.WALLS.values()))
Way = tuple[str | int, ...]
RESTITUTION_PATH: Way = ("restitution",)
"""Parameter that is set last, because it depends on stiffness and scene."""
SceneLike = str | PathLike[str] | Callable[..., Case] | Case | Scene
"""Possible subjects of a sweep."""


@signature.face
def axis(text: str) -> tuple[str, Values]:
    """Parse ``name=first:last:count``, with ``:log``, or ``name=value,value``.

    Returns the name and the array of values.

    >>> axis("restitution=0.5:1:3")
    ('restitution', array([0.5 , 0.75, 1.  ]))
    """
    need = "a text such as gap=0:1:11"
    name, equals, values = check.of_kind("every entry of `over`", text, str, need).partition("=")
    if not equals:
        raise ValueError(f"An axis must be name=first:last:count[:log] or name=value,value,…, got {text!r}.")
    if ":" not in values:
        return name, _array(name, [_value(word) for word in values.split(",")])
    if values.count(":") not in (2, 3):
        raise ValueError(f"An axis must be name=first:last:count[:log], such as {name}=0.5:1:101, got {text!r}.")
    first, last, count, *scale = values.split(":")
    a, b = (check.number(f"the {what} {name}", _value(word)) for what, word in (("first", first), ("last", last)))
    n = check.integer(f"the count of {name}", _value(count), at_least=1, at_most=MAX_CELLS)
    check.raise_if_true({
        f"An axis must end after first:last:count or with ':log', got {text!r}.": scale not in ([], ["log"]),
        f"A logarithmic axis must have positive ends, got {text!r}.": scale and not (a > 0.0 and b > 0.0),
    })
    return name, (np.geomspace if scale else np.linspace)(a, b, n)


def checked_axes(over: Any) -> dict[str, Values]:
    """Return the axes of a sweep as checked arrays, by name.

    `over` maps names to values, or it is one string or several strings in the format of `axis`.
    """
    texts = over if isinstance(over, Iterable) and not isinstance(over, str) else [over]
    axes: dict[str, Values] = {}
    for name, values in over.items() if isinstance(over, Mapping) else map(axis, texts):
        array = _array(name, values)
        check.raise_if_true({
            f"`over` must have one axis per parameter, got two of {name}.": name in axes,
            f"The values of {name} must all be different.":
                len(np.unique(array)) < len(array),
        })
        axes[name] = array
    cells = math.prod(map(len, axes.values()))
    check.raise_if_true({
        "`over` must have at least one parameter with its values, got none.": not axes,
        f"`over` must have at most {MAX_CELLS:.0e} cells, got {cells:.3g}. Use fewer values.": cells > MAX_CELLS,
    })
    return axes


def _array(name: str, values: Any) -> Values:
    """Return the values of a parameter as an array (n,)."""
    array = np.empty(0)
    with suppress(ValueError):  # lists of different lengths
        array = np.asarray(values)
    if array.dtype.kind not in "biufU" or array.ndim != 1 or not len(array) or (
            array.dtype.kind != "b" and check.contains_booleans(values)):
        raise TypeError(f"The values of {name} must be a list of numbers or words, got {values!r}.")
    return array


def _value(text: str) -> Any:
    """Return the int, float or boolean of a string, else the string."""
    word = text.strip()
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return {"True": True, "False": False}.get(word, word)


@dataclass(frozen=True)
class Subject:
    """The subject of a sweep.

    Attributes
    ----------
    title : str
        Description of the subject.
    root : Any
        Parameters of a function by name, the tables of a file, or a `Case`.
    make : callable
        Function that returns a `Case` for the root, in which numbers can have been replaced.
    about : mapping
        Descriptions of the parameters by name.
    text : Any
        All other data that determine the results, to identify files.
    ready : str
        Name of a ready-made case whose scene does not depend on the contacts, otherwise empty.
    wholes : set of str
        Names of integer parameters.
    defaults : mapping
        Default values of the parameters of a function.
    source : callable or None
        The user-defined function, or None.
    """

    title: str
    root: Any
    make: Callable[[Any], Case]
    about: Mapping[str, str]
    text: Any
    ready: str = ""
    wholes: frozenset[str] = frozenset()
    defaults: Mapping[str, Any] = field(default_factory=dict)
    source: Callable[..., Case] | None = None

    def way(self, name: str) -> Way:
        """Return the path of a parameter from the root, a tuple of names and indices.

        Raises
        ------
        TypeError, ValueError
            If `name` is not a valid name, or not a parameter of a ready-made case or of the user-defined function.
        """
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise ValueError(f"A parameter must be a name such as gap or radii[0], got {name!r}.")
        way = tuple(int(index) if index else word for index, word in re.findall(r"\[(\d+)\]|(\w+)", name))
        if self.ready:
            names = [about for about in self.about if "." not in about]
            check.known_names([str(way[0])], names, f"parameter of {self.title}", TypeError)
        function_parameters = parameters_of(self.source) if self.source is not None else ()
        if function_parameters and not any(p.kind is p.VAR_KEYWORD for p in function_parameters):
            known = [p.name for p in function_parameters]
            check.known_names([str(way[0])], known, f"parameter of {self.title}", TypeError)
        of_function = isinstance(self.text, str)
        of_case = isinstance(self.root, Case) and way == RESTITUTION_PATH
        if of_function or of_case or way[0] in {*CASE_PARTS, *_fields_by_name(self.root)}:
            return way
        parts = (part for part in CASE_PARTS if way[0] in _fields_by_name(_fields_by_name(self.root).get(part)))
        return next(parts, "run" if way[0] == "t_end" else "scene"), *way

    def is_whole(self, name: str) -> bool:
        """Return whether a parameter is an integer."""
        return str(self.way(name)[-1]) in self.wholes

    def attributes(self, name: str) -> dict[str, str]:
        """Return unit, label and description of a parameter, from its docstring."""
        words = [step for step in self.way(name) if isinstance(step, str) and step not in ("scene", "run")]
        about = self.about.get(".".join(words), "")
        unit = _UNIT.search(about)
        units = unit[1].replace("^(3/2)", "³ᐟ²") if unit else "s" if words[-1] == "t_end" else "1"
        return {"units": units, "long_name": name.replace("_", " "), "comment": about.partition(". ")[0]}


def subject_of(scene: SceneLike) -> Subject:
    """Return the subject for the argument `scene`. Raise an error for misuse."""
    case = Case(scene, None) if isinstance(scene, Scene) else scene
    if isinstance(case, Case):
        about = _about([Scene], law=map(type, _entries(case.law)), rule=map(type, _entries(case.rule)),
                       **_WALLS)
        return Subject(case.about or str(case.scene), case, replace, about, vars(case))
    if callable(case):
        title = getattr(case, "__qualname__", repr(case))
        return Subject(title, _lists(options_of(case)), partial(_call, case), descriptions(case), title,
                       wholes=integer_parameters(case), defaults=_defaults(options_of(case)), source=case)
    if ready.is_file(case):
        return _of_file(Path(case))
    name = check.choice("scene", case, cases.names())
    options = cases.options(name)
    about = {option.name: option.about for option in options} | {"t_end": ""} | _about([], **_WALLS)
    # cells of different laws can share the scene
    ready_name = "" if ready.couples_scene_and_contacts(name) else name
    return Subject(
        title=name, root=_lists(options), make=partial(_call, partial(cases.make, name)), about=about, text=name,
        ready=ready_name, wholes=integer_parameters(ready.TEMPLATES[name].make), defaults=_defaults(options))


def _of_file(path: Path) -> Subject:
    """Return the subject of a sweep from a case file."""
    folder = str(path.parent)
    with build.message_prefix(path.name):
        tables = read_tables(path)
        case_of_tables(tables, folder)
    scene, scene_name = tables["scene"], tables["scene"].get("name")
    law, rule = ([kinds[table["type"]] for table in _entries(tables.get(part))]
                 for part, kinds in (("law", build.LAWS), ("rule", build.RULES)))
    functions: list[Callable[..., Any]] = [md.simulate, *([ready.TEMPLATES[scene_name].make] if scene_name else [])]
    about = _about([*functions, Scene], law=law, rule=rule, **_WALLS)
    root = tables | {"scene": _lists(cases.options(scene_name) if scene_name else []) | scene}
    wholes = frozenset(scene_name for function in functions for scene_name in integer_parameters(function))
    return Subject(str(tables.get("about", path.name)), root, partial(case_of_tables, folder=folder), about, tables,
                   wholes=wholes)


def with_parameter(holder: Any, way: Way, value: Any, name: str = "") -> Any:
    """Return a copy of `holder` in which the number at the end of `way` is `value`.

    `way` is a path of names and indices. If a step of the path is a name and the holder is a list, the name is looked
    up in every entry of the list. `name` is the part of the path that leads to `holder`.
    """
    if not way:
        if isinstance(holder, np.ndarray) and check.is_single(value):
            raise ValueError(f"The parameter {name} has {len(holder)} entries. Name one of them, such as {name}[0].")
        return value
    step, rest = way[0], way[1:]
    entries = isinstance(holder, (list, tuple, np.ndarray))
    if isinstance(step, int):
        if not entries:
            raise TypeError(f"{name}[{step}] is not a parameter, because {name} is a single value.")
        if step >= len(holder):
            raise ValueError(f"The index of {name}[{step}] must be below {len(holder)}, the number of entries, got "
                             f"{step}.")
        return [with_parameter(entry, rest, value, name) if i == step else entry for i, entry in enumerate(holder)]
    if entries:
        return [with_parameter(entry, way, value) for entry in holder]
    if (name, way) == ("scene", ("gap",)) and check.is_single(value):
        value = _of_balls(holder, value)
    if isinstance(holder, Mapping):
        return {**holder, step: with_parameter(holder.get(step, {}), rest, value, step)}
    if holder is None:
        raise TypeError(f"{name}.{step} is not a parameter, because the case has no {name}.")
    if isinstance(holder, Case) and way == RESTITUTION_PATH:
        return _with_restitution(holder, value)
    check.known_names([step], _fields_by_name(holder), f"parameter of {type(holder).__name__}", TypeError)
    return replace(holder, **{step: with_parameter(_entry(holder, step), rest, value, step)})


def _of_balls(holder: Any, gap: Any) -> Any:
    """Return gaps in m of a scene in which all pairs of balls have the gap `gap`.

    For a ready-made case, `gap` is returned unchanged.
    """
    fields_of_scene = _fields_by_name(holder)
    if not {"mass", "gap"} <= fields_of_scene.keys():
        return gap
    between_balls = _between_balls(fields_of_scene["mass"], fields_of_scene["gap"])
    if not between_balls.any():
        raise ValueError("The parameter gap stands for all pairs of balls, but this scene has none. Name one entry, "
                         "such as gap[0].")
    return np.where(between_balls, gap, fields_of_scene["gap"]).tolist()


def _between_balls(mass: Any, gap: Any) -> Any:
    """Return for each pair whether both of its bodies are balls."""
    wall = np.isinf(np.asarray(mass, float))
    return ~(wall | np.roll(wall, -1))[: len(gap)]


def common_parameters(case: Case) -> dict[str, float]:
    """Return the common values of `gap` and `restitution` of a case, by name.

    A value is missing if pairs or laws differ.
    """
    scene, speed = case.scene, ready.first_impact_speed(case.scene) or 1.0
    gap, laws = scene.gap[_between_balls(scene.mass, scene.gap)], [*check.per_pair("law", case.law, scene.n_pairs)]
    common = {"gap": float(gap[0])} if len(gap) and np.ptp(gap) == 0.0 else {}
    if all(hasattr(law, "from_restitution") for law in laws):
        eps = [restitution(law, pair, speed) for law, pair in zip(laws, scene.pairs, strict=True)]
        common |= {"restitution": eps[0]} if max(eps) - min(eps) <= 1e-12 else {}
    return common


def _with_restitution(case: Case, eps: float) -> Case:
    """Return the case with the restitution `eps` of all its laws and of its rule.

    The laws keep their stiffness. If a law has no `from_restitution`, only the rule is changed. Without a rule,
    `TypeError` is raised.
    """
    laws, pairs = check.per_pair("law", case.law, case.scene.n_pairs), case.scene.pairs
    rule = None if case.rule is None else with_parameter(case.rule, RESTITUTION_PATH, eps)
    without_restitution = next((law for law in laws if not hasattr(law, "from_restitution")), None)
    if without_restitution is not None and rule is None:
        raise TypeError(f"restitution is not a parameter of {without_restitution!r}. Vary its own numbers, such as "
                        "law.k.")
    return replace(case, rule=rule, law=case.law if without_restitution is not None else build.laws_of_pairs(
        partial(_like, {"restitution": eps, "speed": ready.first_impact_speed(case.scene)}), laws, pairs))


def _like(changes: dict[str, float], law: Any, pair: Any) -> Any:
    """Return a law of the same stiffness, with the restitution in `changes`."""
    # without the keyword-only parameters of `from_restitution`, which replace the stiffness
    accepted = {p.name for p in parameters_of(law.from_restitution) if p.kind is not p.KEYWORD_ONLY}
    values = {name: value for name, value in (_fields_by_name(law) | changes).items() if name in accepted}
    return build.call([law.from_restitution], values, pair=pair)


def _entry(holder: Any, name: str) -> Any:
    """Return a field of a dataclass.

    If a scene has no external forces, its field `external_force` is returned as zeros.
    """
    value = getattr(holder, name)
    return np.zeros(holder.n) if name == "external_force" and value is None else value


def _fields_by_name(holder: Any) -> dict[str, Any]:
    """Return the fields of a table or a dataclass, by name.

    For a list, return the fields of all entries; of equal names the last entry counts. For any other object the result
    is empty.
    """
    if isinstance(holder, (list, tuple)):
        return {name: value for entry in holder for name, value in _fields_by_name(entry).items()}
    if is_dataclass(holder):
        return {f.name: getattr(holder, f.name) for f in fields(holder)}
    return dict(holder) if isinstance(holder, Mapping) else {}


def numbers_in(subject: Subject, root: Any) -> dict[str, float]:
    """Return the finite numbers of a root that are not integer parameters, by name."""
    parts = {**subject.defaults, **_fields_by_name(root)}
    if not isinstance(subject.text, str):
        parts = {**_fields_by_name(parts.get("scene")), **{part: parts.get(part) for part in ("law", "rule", "t_end")}}
    found = {name: value for part, content in parts.items() for name, value in _leaves(part, content)}
    return {name: value for name, value in found.items() if math.isfinite(value) and not subject.is_whole(name)}


def _leaves(name: str, holder: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers in lists, tables and dataclasses, with their names."""
    if isinstance(holder, (int, float)) and not isinstance(holder, bool):
        yield name, float(holder)
    elif isinstance(holder, (list, tuple, np.ndarray)):
        for i, entry in enumerate(holder.tolist() if isinstance(holder, np.ndarray) else holder):
            yield from _leaves(f"{name}[{i}]", entry)
    else:
        for field_name, entry in _fields_by_name(holder).items():
            yield from _leaves(f"{name}.{field_name}", entry)


def _entries(given: Any) -> list[Any]:
    return list(given) if isinstance(given, (list, tuple)) else [] if given is None else [given]


def _about(plain: Any, **parts: Any) -> dict[str, str]:
    """Return descriptions of parameters from docstrings, by name.

    Names in `parts`, such as laws and rules, begin with the part.
    """
    documented = [("", plain), *((f"{part}.", kinds) for part, kinds in parts.items())]
    return {part + name: text for part, kinds in documented for kind in kinds
            for name, text in descriptions(kind).items()}


def _lists(options: list[Any]) -> dict[str, Any]:
    """Return the defaults that are lists. Their entries are parameters."""
    return {option.name: option.default for option in options if isinstance(option.default, (list, tuple))}


def _defaults(options: list[Any]) -> dict[str, Any]:
    return {option.name: option.default for option in options}


def _call(function: Callable[..., Case], parameters: Mapping[str, Any]) -> Case:
    name = f"the return value of {getattr(function, '__name__', function)}"
    return check.of_kind(name, function(**parameters), Case, "a granular.Case")  # type: ignore[no-any-return]

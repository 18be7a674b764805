"""Constructors of scenes, walls, laws and rules from the keys of a table.

The set of keys selects the constructor. User-defined functions have names: ``"motion.py:shake"`` for a file beside the
table's file, or ``"module:shake"``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, is_dataclass
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from granular import laws
from granular._engine import check
from granular.cases import materials
from granular.cases.case import parameters_of
from granular.laws import rules
from granular.scene import Pair, walls

on_running: list[Callable[[str], object]] = []
"""Functions to call with the place of Python code before a file runs it."""
CONSTRUCTOR_NAMES = ("from_restitution", "from_material", "from_acceleration")
"""Alternative constructors of classes."""
LAWS: dict[str, Any] = {name: getattr(laws, name) for name in laws.__all__ if is_dataclass(getattr(laws, name))}
RULES: dict[str, Any] = {kind.__name__: kind for kind in (rules.ConstantRestitution, rules.TabulatedRestitution)}
WALLS: dict[str, Any] = {name: getattr(walls, name) for name in walls.__all__}
WALL_MOTION_KEYS = ("floor", "ceiling", "plate")
"""Keys of a scene that contain the motion of a wall."""
Way = Callable[..., Any]
parameters = cache(parameters_of)
"""Return the parameters of a constructor."""


@dataclass(frozen=True, repr=False)
class Named:
    """Function given by its name, which is imported at the first call.

    It can be sent to other processes.

    Parameters
    ----------
    name : str
        ``"file.py:function"``, or ``"package.module:function"`` for an importable module.
    folder : str
        Folder of the file if `name` has none.
    """

    name: str
    folder: str = ""

    @property
    def place(self) -> str:
        """Path of the file, or name of the module, whose code the lookup runs."""
        place = self.name.partition(":")[0]
        return os.path.join(self.folder, place) if place.endswith(".py") else place

    def __call__(self, *given: Any) -> Any:
        """Call the function. Its exceptions are marked as its own."""
        function = self.function
        with _marked(self.name):
            return function(*given)

    @cached_property
    def function(self) -> Any:
        """The function itself.

        Raises
        ------
        ValueError
            If the file, the module or the function does not exist.
        """
        place, word = self.place, self.name.partition(":")[2]
        try:
            with _marked(self.name):
                module = _of_file(place) if place.endswith(".py") else import_module(place)
            found = getattr(module, word)
        except (AttributeError, ImportError, OSError, ValueError) as error:
            raise ValueError(f"`function` must be 'file.py:name' of a file beside this one, or 'module:name' of an "
                             f"importable module, got {self.name!r}, which was not found ({error}).") from None
        if not callable(found):
            raise ValueError(f"`function` must name a function m(t), got {self.name!r}, which is {found!r}.")
        return found

    def __repr__(self) -> str:
        return self.name

    def __reduce__(self) -> tuple[Any, ...]:
        return Named, (self.name, self.folder)


def sentence_of(error: BaseException) -> str:
    """Return the message of an exception in one line.

    The name of a user-defined function that raised it is included.
    """
    said = " ".join(str(error).split())
    owner = getattr(error, "raised_by", None)
    return said if owner is None else f"The function {owner} raised {type(error).__name__}: {said}"


def name_of(function: Any) -> str:
    """Return the name by which a file can refer to `function`.

    Raises `TypeError` if the function cannot be imported.
    """
    if isinstance(function, Named):
        return function.name
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', '')}"
    with suppress(ValueError):
        if Named(name).function is function:
            return name
    raise TypeError(f"`function` must be importable by its name to be written to TOML, got {function!r}. Put it into a "
                    "module.")


@contextmanager
def _marked(name: str) -> Iterator[None]:
    """Mark exceptions as `raised_by` the function `name`.

    The mark survives the transfer from other processes.
    """
    try:
        yield
    except Exception as error:
        error.__dict__["raised_by"] = name
        raise


def _of_file(path: str) -> Any:
    """Run a Python file and return its module."""
    module = ModuleType(Path(path).stem)
    module.__file__ = path
    exec(compile(Path(path).read_bytes(), path, "exec"), vars(module))
    return module


def law(table: Mapping[str, Any], pair: Pair) -> Any:
    """Return a force law for a table with ``type`` and coefficients.

    The keys can also be arguments of `from_restitution` or `from_material`. ``material``, a name of
    `granular.materials` or two (lower, upper), replaces ``young`` and ``poisson``.
    """
    given = dict(table)
    if "material" in given:
        if clash := {"young", "poisson"} & given.keys():
            raise ValueError(f"Only one of the keys material and {min(clash)} can be given, got both.")
        of_material = [name for name, kind in LAWS.items() if hasattr(kind, "from_material")]
        check.choice("the type of a law of a material", given.get("type"), of_material)
        one = given.pop("material")
        names = one if isinstance(one, list) else [one, one]
        if len(names) != 2:
            raise ValueError(f"`material` must have one entry, or two (lower, upper), got {len(names)}.")
        given["young"], given["poisson"] = materials.both(*names)
    return of_type(LAWS, given, pair=pair)


def rule(table: Mapping[str, Any]) -> Any:
    """Return a collision rule for a table with ``type`` and values."""
    return of_type(RULES, table)


def wall(table: Any, folder: str = "") -> Any:
    """Return the motion of a wall for a table with ``type`` (default Sine) and values.

    The values can also be arguments of `from_acceleration`. A function has a name.
    """
    if not isinstance(table, Mapping):
        return table
    values = {"type": "Sine", **table}
    if isinstance(function := values.get("function"), str):
        values["function"] = named = Named(function, folder)
        for tell in on_running:
            tell(named.place)
        named.function  # noqa: B018  says now what cannot be found
    elif isinstance(function, Mapping):
        values["function"] = wall(function)
    return of_type(WALLS, values)


def walled(table: Mapping[str, Any], folder: str = "") -> dict[str, Any]:
    """Return the keys of a scene with tables of walls replaced by motions."""
    made = dict(table)
    for name in table.keys() & set(WALL_MOTION_KEYS):
        with place(name):
            made[name] = wall(table[name], folder)
    return made


def rule_of(tables: Sequence[Mapping[str, Any]]) -> Any:
    """Return the rule with the constant ε by which all laws are given, or None."""
    if any("restitution" not in table or "speed" in table for table in tables):
        return None
    eps = [float(table["restitution"]) for table in tables]
    return rules.ConstantRestitution(eps[0] if len(set(eps)) == 1 else eps)


def each_pair(make: Callable[[Any, Pair], Any], given: Iterable[Any], pairs: Iterable[Pair]) -> tuple[Any, ...]:
    """Return one law per pair. Equal pairs share a law."""
    known: dict[Any, Any] = {}
    keys = []
    for one, pair in zip(given, pairs, strict=True):
        keys.append((id(one), pair.m_eff, pair.r_eff))
        if keys[-1] not in known:
            known[keys[-1]] = make(one, pair)
    return tuple(known[key] for key in keys)


def call(ways: Sequence[Way], values: Mapping[str, Any], **held: Any) -> Any:
    """Call the first of `ways` whose parameters match the keys of `values`.

    `held` has further arguments, which only some of the functions take.
    """
    keys = [[p for p in parameters(way) if p.name not in held] for way in ways]
    needed = [[p.name for p in each if p.default is p.empty] for each in keys]
    for way, each, least in zip(ways, keys, needed, strict=True):
        if set(least) <= values.keys() <= {p.name for p in each}:
            return way(**values, **{p.name: held[p.name] for p in parameters(way) if p.name in held})
    check.known(values, dict.fromkeys(p.name for each in keys for p in each), "key")
    sets = " or ".join("(" + ", ".join(least) + ")" for least in needed)
    raise ValueError(f"The keys must be {sets}, got ({', '.join(values)}).")


@contextmanager
def place(where: str) -> Iterator[None]:
    """Put a place, such as a file or a table, before the message of misuse."""
    try:
        yield
    except (TypeError, ValueError) as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError  # subclasses can have other arguments
        raise kind(f"{where}: {error}") from None


def of_type(types: Mapping[str, Any], table: Mapping[str, Any], **held: Any) -> Any:
    """Return the object that ``type`` of a table names, from its other keys."""
    if "type" not in table:
        raise ValueError(f"The key 'type' is missing. It must be one of {', '.join(types)}.")
    kind = types[check.choice("type", table["type"], list(types))]
    ways = [kind] + [getattr(kind, name) for name in CONSTRUCTOR_NAMES if hasattr(kind, name)]
    return call(ways, {key: value for key, value in table.items() if key != "type"}, **held)

"""Make a scene, a wall, a law or a rule from the keys of a table: the set of keys decides which constructor is meant.

A function of one's own is named: ``"motion.py:shake"`` of a file beside the table's, or ``"module:shake"``.
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
"""Who is told that a file read now names Python code, and which, before that runs."""
CONSTRUCTORS = ("from_restitution", "from_material", "from_acceleration")
"""Other ways to make a thing than by its fields."""
LAWS: dict[str, Any] = {name: getattr(laws, name) for name in laws.__all__ if is_dataclass(getattr(laws, name))}
RULES: dict[str, Any] = {kind.__name__: kind for kind in (rules.ConstantRestitution, rules.TabulatedRestitution)}
WALLS: dict[str, Any] = {name: getattr(walls, name) for name in walls.__all__}
MOVING = ("floor", "ceiling", "plate")
"""Keys of a scene that say how a wall moves."""
Way = Callable[..., Any]
parameters = cache(parameters_of)
"""What a way takes."""


@dataclass(frozen=True, repr=False)
class Named:
    """A function by its name; it travels to other processes, and is looked up when it is first called.

    Parameters
    ----------
    name : str
        ``"file.py:function"``, or ``"package.module:function"`` of what can be imported.
    folder : str
        Where the file is, if `name` says no more.
    """

    name: str
    folder: str = ""

    @property
    def place(self) -> str:
        """Path of the file, or name of the module, whose code runs when the function is looked up."""
        place = self.name.partition(":")[0]
        return os.path.join(self.folder, place) if place.endswith(".py") else place

    def __call__(self, *given: Any) -> Any:
        """Call the function; what it raises passes through, marked as its own."""
        function = self.function
        with _marked(self.name):
            return function(*given)

    @cached_property
    def function(self) -> Any:
        """The function itself.

        Raises
        ------
        ValueError
            If there is no such file, module or function.
        """
        place, word = self.place, self.name.partition(":")[2]
        try:
            with _marked(self.name):
                module = _of_file(place) if place.endswith(".py") else import_module(place)
            found = getattr(module, word)
        except (AttributeError, ImportError, OSError, ValueError) as error:
            raise ValueError(f"function is {self.name!r}: it cannot be found ({error}); 'file.py:name' of a file "
                             "beside this one is needed, or 'module:name' of a module that can be imported.") from None
        if not callable(found):
            raise ValueError(f"function is {self.name!r}: a function m(t) is needed, and that is {found!r}.")
        return found

    def __repr__(self) -> str:
        return self.name

    def __reduce__(self) -> tuple[Any, ...]:
        return Named, (self.name, self.folder)


def sentence_of(error: BaseException) -> str:
    """Return what an exception says, in one line; of one that a named function has raised, that too."""
    said = " ".join(str(error).split())
    owner = getattr(error, "raised_by", None)
    return said if owner is None else f"function {owner} raised {type(error).__name__}: {said}"


def name_of(function: Any) -> str:
    """Return the name by which a file may ask for `function`, or raise `TypeError` if there is none."""
    if isinstance(function, Named):
        return function.name
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', '')}"
    with suppress(ValueError):
        if Named(name).function is function:
            return name
    raise TypeError(f"function is {function!r}: only one that can be imported by its name can be written to TOML; put "
                    "it into a module.")


@contextmanager
def _marked(name: str) -> Iterator[None]:
    """Mark what is raised within as `raised_by` the function `name`; it keeps that through other processes too."""
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
    """Make a force law: ``type`` and its coefficients, or what its `from_restitution` or `from_material` takes.

    ``material``, a name of `granular.materials` or two (lower, upper), stands for ``young`` and ``poisson``.
    """
    given = dict(table)
    if "material" in given:
        if clash := {"young", "poisson"} & given.keys():
            raise ValueError(f"keys material and {min(clash)} are both given: one of the two ways is needed.")
        of_material = [name for name, kind in LAWS.items() if hasattr(kind, "from_material")]
        check.choice("type of a law of a material", given.get("type"), of_material)
        one = given.pop("material")
        names = one if isinstance(one, list) else [one, one]
        if len(names) != 2:
            raise ValueError(f"material has {len(names)} entries: one, or two (lower, upper), are needed.")
        given["young"], given["poisson"] = materials.both(*names)
    return of_type(LAWS, given, pair=pair)


def rule(table: Mapping[str, Any]) -> Any:
    """Make a collision rule: ``type`` and its values."""
    return of_type(RULES, table)


def wall(table: Any, folder: str = "") -> Any:
    """Make how a wall moves: ``type`` (a Sine if it is not said) and its numbers, or those of its `from_acceleration`;
    a function by its name."""
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
    """Return the keys of a scene with walls made of the tables that say how they move."""
    made = dict(table)
    for name in table.keys() & set(MOVING):
        with place(name):
            made[name] = wall(table[name], folder)
    return made


def rule_of(tables: Sequence[Mapping[str, Any]]) -> Any:
    """The rule of laws that are all given by an ε that depends on no speed: that very ε; else none."""
    if any("restitution" not in table or "speed" in table for table in tables):
        return None
    eps = [float(table["restitution"]) for table in tables]
    return rules.ConstantRestitution(eps[0] if len(set(eps)) == 1 else eps)


def each_pair(make: Callable[[Any, Pair], Any], given: Iterable[Any], pairs: Iterable[Pair]) -> tuple[Any, ...]:
    """Make one law per pair from what is given for it; pairs that are alike share one."""
    known: dict[Any, Any] = {}
    keys = []
    for one, pair in zip(given, pairs, strict=True):
        keys.append((id(one), pair.m_eff, pair.r_eff))
        if keys[-1] not in known:
            known[keys[-1]] = make(one, pair)
    return tuple(known[key] for key in keys)


def call(ways: Sequence[Way], values: Mapping[str, Any], **held: Any) -> Any:
    """Call the first of `ways` whose parameters are those that `values` gives; `held` is added for those who ask."""
    keys = [[p for p in parameters(way) if p.name not in held] for way in ways]
    needed = [[p.name for p in each if p.default is p.empty] for each in keys]
    for way, each, least in zip(ways, keys, needed, strict=True):
        if set(least) <= values.keys() <= {p.name for p in each}:
            return way(**values, **{p.name: held[p.name] for p in parameters(way) if p.name in held})
    check.known(values, dict.fromkeys(p.name for each in keys for p in each), "key")
    sets = " or ".join("(" + ", ".join(least) + ")" for least in needed)
    raise ValueError(f"the keys given are ({', '.join(values)}): {sets} is needed.")


@contextmanager
def place(where: str) -> Iterator[None]:
    """Put a place, such as a file or a table, in front of the sentence of misuse raised within."""
    try:
        yield
    except (TypeError, ValueError) as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError  # some kinds of them take other arguments
        raise kind(f"{where}: {error}") from None


def of_type(types: Mapping[str, Any], table: Mapping[str, Any], **held: Any) -> Any:
    """Make what ``type`` of a table says, of its other keys."""
    if "type" not in table:
        raise ValueError(f"key 'type' is missing; needed is one of {', '.join(types)}.")
    kind = types[check.choice("type", table["type"], list(types))]
    ways = [kind] + [getattr(kind, name) for name in CONSTRUCTORS if hasattr(kind, name)]
    return call(ways, {key: value for key, value in table.items() if key != "type"}, **held)

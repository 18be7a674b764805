"""Constructors of scenes, walls, laws and rules from the keys of a table.

The set of keys selects the constructor. User-defined functions are given by a name: ``"motion.py:shake"`` for a file in
the folder of the TOML file, or ``"module:shake"`` for an importable module.
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

user_code_callbacks: list[Callable[[str], object]] = []
"""Functions to call before user-defined Python code is run.

The argument is the path of the file or the name of the module.
"""
CONSTRUCTOR_NAMES = ("from_restitution", "from_material", "from_acceleration")
"""Class methods that are alternative constructors of laws and of wall motions."""
LAWS: dict[str, Any] = {name: getattr(laws, name) for name in laws.__all__ if is_dataclass(getattr(laws, name))}
RULES: dict[str, Any] = {kind.__name__: kind for kind in (rules.ConstantRestitution, rules.TabulatedRestitution)}
WALLS: dict[str, Any] = {name: getattr(walls, name) for name in walls.__all__}
WALL_MOTION_KEYS = ("floor", "ceiling", "plate")
"""Keys of a scene that contain the motion of a wall."""
Constructor = Callable[..., Any]
parameters = cache(parameters_of)
"""Return the parameters of a constructor (cached)."""


@dataclass(frozen=True, repr=False)
class Named:
    """Function given by its name, which is imported at the first call.

    It can be sent to other processes.

    Parameters
    ----------
    name : str
        ``"file.py:function"``, or ``"package.module:function"`` for an importable module.
    folder : str
        Folder that contains the file, if `name` names a file.
    """

    name: str
    folder: str = ""

    @property
    def location(self) -> str:
        """Path of the file, or name of the module, that contains the function."""
        location = self.name.partition(":")[0]
        return os.path.join(self.folder, location) if location.endswith(".py") else location

    def __call__(self, *arguments: Any) -> Any:
        """Call the function. Exceptions that it raises get its name as an attribute."""
        function = self.function
        with _attributing_errors(self.name):
            return function(*arguments)

    @cached_property
    def function(self) -> Any:
        """The imported function. The first access runs the code of the file or module.

        Raises
        ------
        ValueError
            If the file, the module or the function does not exist.
        """
        location, attribute = self.location, self.name.partition(":")[2]
        try:
            with _attributing_errors(self.name):
                module = _module_of_file(location) if location.endswith(".py") else import_module(location)
            function = getattr(module, attribute)
        except (AttributeError, ImportError, OSError, ValueError) as error:
            raise ValueError(f"`function` must be 'file.py:name' of a file beside this one, or 'module:name' of an "
                             f"importable module, got {self.name!r}, which was not found ({error}).") from None
        if not callable(function):
            raise ValueError(f"`function` must name a function m(t), got {self.name!r}, which is {function!r}.")
        return function

    def __repr__(self) -> str:
        return self.name

    def __reduce__(self) -> tuple[Any, ...]:
        return Named, (self.name, self.folder)


def error_sentence(error: BaseException) -> str:
    """Return the message of an exception in one line.

    If a user-defined function raised it, the message begins with the name of the function.
    """
    message = " ".join(str(error).split())
    owner = getattr(error, "raised_by", None)
    return message if owner is None else f"The function {owner} raised {type(error).__name__}: {message}"


def importable_name(function: Any) -> str:
    """Return the name by which a TOML file can refer to `function`.

    Raises `TypeError` if the function cannot be imported by its name.
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
def _attributing_errors(name: str) -> Iterator[None]:
    """Set the attribute `raised_by` of exceptions to `name`, a user-defined function.

    The attribute is kept when an exception is sent to another process.
    """
    try:
        yield
    except Exception as error:
        error.__dict__["raised_by"] = name
        raise


def _module_of_file(path: str) -> Any:
    """Run a Python file and return its module."""
    module = ModuleType(Path(path).stem)
    module.__file__ = path
    exec(compile(Path(path).read_bytes(), path, "exec"), vars(module))
    return module


def law(table: Mapping[str, Any], pair: Pair) -> Any:
    """Return a force law for a pair, from a table with ``type`` and coefficients.

    The keys can also be arguments of `from_restitution` or `from_material`. The key ``material`` replaces ``young`` and
    ``poisson``. It is a name of `granular.materials`, or a list of two names (lower, upper).
    """
    arguments = dict(table)
    if "material" in arguments:
        if clash := {"young", "poisson"} & arguments.keys():
            raise ValueError(f"Only one of the keys material and {min(clash)} can be given, got both.")
        of_material = [name for name, kind in LAWS.items() if hasattr(kind, "from_material")]
        check.choice("the type of a law of a material", arguments.get("type"), of_material)
        entry = arguments.pop("material")
        names = entry if isinstance(entry, list) else [entry, entry]
        if len(names) != 2:
            raise ValueError("`material` must have one entry, or two (lower, upper), got a list of length "
                             f"{len(names)}.")
        arguments["young"], arguments["poisson"] = materials.both(*names)
    return object_of_type(LAWS, arguments, pair=pair)


def rule(table: Mapping[str, Any]) -> Any:
    """Return a collision rule from a table with ``type`` and values."""
    return object_of_type(RULES, table)


def wall(table: Any, folder: str = "") -> Any:
    """Return the motion of a wall from a table with ``type`` (default Sine).

    The other keys are fields of the type, or arguments of `from_acceleration`. A user-defined function is given by its
    name, and `folder` is the folder of its file. A value that is not a table is returned unchanged.
    """
    if not isinstance(table, Mapping):
        return table
    values = {"type": "Sine", **table}
    if isinstance(function := values.get("function"), str):
        values["function"] = named_function = Named(function, folder)
        for observe in user_code_callbacks:
            observe(named_function.location)
        named_function.function  # noqa: B018  raises here if the function does not exist
    elif isinstance(function, Mapping):
        values["function"] = wall(function)
    return object_of_type(WALLS, values)


def with_wall_motions(table: Mapping[str, Any], folder: str = "") -> dict[str, Any]:
    """Return a [scene] table in which each table of a wall is replaced by its motion.

    `folder` is the folder of files with user-defined functions.
    """
    values = dict(table)
    for name in table.keys() & set(WALL_MOTION_KEYS):
        with message_prefix(name):
            values[name] = wall(table[name], folder)
    return values


def rule_of_law_tables(tables: Sequence[Mapping[str, Any]]) -> Any:
    """Return the collision rule with the restitution of the [law] tables, or None.

    The rule has a constant ε, or one constant ε per pair. It is None if a table has no ``restitution``, or if its
    restitution holds at one ``speed`` only.
    """
    if any("restitution" not in table or "speed" in table for table in tables):
        return None
    eps = [float(table["restitution"]) for table in tables]
    return rules.ConstantRestitution(eps[0] if len(set(eps)) == 1 else eps)


def laws_of_pairs(make: Callable[[Any, Pair], Any], entries: Iterable[Any], pairs: Iterable[Pair]) -> tuple[Any, ...]:
    """Return one law per pair, with one common law for equal pairs.

    Parameters
    ----------
    make : callable
        Returns the law of an entry and a pair.
    entries : iterable
        One entry per pair, such as a table. Pairs with the same entry, m_eff and r_eff have the same law.
    pairs : iterable of Pair
        The pairs.
    """
    laws: dict[Any, Any] = {}
    keys = []
    for entry, pair in zip(entries, pairs, strict=True):
        keys.append((id(entry), pair.m_eff, pair.r_eff))
        if keys[-1] not in laws:
            laws[keys[-1]] = make(entry, pair)
    return tuple(laws[key] for key in keys)


def call(functions: Sequence[Constructor], values: Mapping[str, Any], **extra: Any) -> Any:
    """Call the first of `functions` whose parameters match the keys of `values`.

    `extra` has additional arguments. Each function receives only the additional arguments that it accepts. Raises
    `ValueError` if no function matches.
    """
    keys = [[p for p in parameters(way) if p.name not in extra] for way in functions]
    needed = [[p.name for p in accepted if p.default is p.empty] for accepted in keys]
    for way, accepted, required in zip(functions, keys, needed, strict=True):
        if set(required) <= values.keys() <= {p.name for p in accepted}:
            return way(**values, **{p.name: extra[p.name] for p in parameters(way) if p.name in extra})
    check.known_names(values, dict.fromkeys(p.name for accepted in keys for p in accepted), "key")
    sets = " or ".join("(" + ", ".join(required) + ")" for required in needed)
    raise ValueError(f"The keys must be {sets}, got ({', '.join(values)}).")


@contextmanager
def message_prefix(where: str) -> Iterator[None]:
    """Prefix the messages of `TypeError` and `ValueError` with a file or table name."""
    try:
        yield
    except (TypeError, ValueError) as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError  # subclasses can have other arguments
        raise kind(f"{where}: {error}") from None


def object_of_type(types: Mapping[str, Any], table: Mapping[str, Any], **extra: Any) -> Any:
    """Return an object of the class that the key ``type`` of a table names.

    The other keys, and the additional arguments `extra`, are arguments of the class or of one of its alternative
    constructors.
    """
    if "type" not in table:
        raise ValueError(f"The key 'type' is missing. It must be one of {', '.join(types)}.")
    cls = types[check.choice("type", table["type"], list(types))]
    constructors = [cls] + [getattr(cls, name) for name in CONSTRUCTOR_NAMES if hasattr(cls, name)]
    return call(constructors, {key: value for key, value in table.items() if key != "type"}, **extra)

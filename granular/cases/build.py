"""Make a scene, a wall, a law or a rule from the keys of a table: the set of keys decides which constructor is meant.
May be skipped: files and the command, no physics.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

from granular import _check, laws, rules, walls
from granular.cases.named import Named, on_running
from granular.scene import Pair

CONSTRUCTORS = ("from_restitution", "from_material", "from_acceleration")
"""Other ways to make a thing than by its fields."""
LAWS: dict[str, Any] = {name: getattr(laws, name) for name in laws.__all__}
RULES: dict[str, Any] = {kind.__name__: kind for kind in (rules.ConstantRestitution, rules.TabulatedRestitution)}
WALLS: dict[str, Any] = {name: getattr(walls, name) for name in walls.__all__}
MOVING = ("floor", "ceiling", "plate")
"""Keys of a scene that say how a wall moves."""
Way = Callable[..., Any]


def law(table: Mapping[str, Any], pair: Pair) -> Any:
    """Make a force law: ``type`` and its coefficients, or what its `from_restitution` or `from_material` takes."""
    return _of_type(LAWS, table, pair=pair)


def rule(table: Mapping[str, Any]) -> Any:
    """Make a collision rule: ``type`` and its values."""
    return _of_type(RULES, table)


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
    return _of_type(WALLS, values)


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
    _check.known(values, dict.fromkeys(p.name for each in keys for p in each), "key")
    sets = " or ".join("(" + ", ".join(least) + ")" for least in needed)
    raise ValueError(f"the keys given are ({', '.join(values)}): {sets} is needed.")


@cache
def parameters(way: Way) -> tuple[inspect.Parameter, ...]:
    """What a function takes."""
    return tuple(inspect.signature(way).parameters.values())


@contextmanager
def place(where: str) -> Iterator[None]:
    """Put a place, such as a file or a table, in front of the sentence of misuse raised within."""
    try:
        yield
    except (TypeError, ValueError) as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError  # some kinds of them take other arguments
        raise kind(f"{where}: {error}") from None


def _of_type(types: Mapping[str, Any], table: Mapping[str, Any], **held: Any) -> Any:
    if "type" not in table:
        raise ValueError(f"key 'type' is missing; needed is one of {', '.join(types)}.")
    kind = types[_check.choice("type", table["type"], list(types))]
    ways = [kind] + [getattr(kind, name) for name in CONSTRUCTORS if hasattr(kind, name)]
    return call(ways, {key: value for key, value in table.items() if key != "type"}, **held)

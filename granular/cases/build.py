"""Make a scene, a law or a rule from the keys of a table: the set of keys decides which constructor is meant."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from granular import _check, laws, rules
from granular.cases.options import unknown
from granular.scene import Pair

LAWS: dict[str, Any] = {name: getattr(laws, name) for name in laws.__all__}
RULES: dict[str, Any] = {"ConstantRestitution": rules.ConstantRestitution,
                         "TabulatedRestitution": rules.TabulatedRestitution}
Way = Callable[..., Any]


def law(table: Mapping[str, Any], pair: Pair) -> Any:
    """Make a force law: ``type`` and its coefficients, or what its `from_restitution` or `from_material` takes."""
    return _of_type(LAWS, table, pair=pair)


def rule_of(tables: Sequence[Mapping[str, Any]]) -> Any:
    """The rule of laws that are all given by an ε that depends on no speed: that very ε; else none."""
    if any("restitution" not in table or "speed" in table for table in tables):
        return None
    eps = [float(table["restitution"]) for table in tables]
    return rules.ConstantRestitution(eps[0] if len(set(eps)) == 1 else eps)


def rule(table: Mapping[str, Any]) -> Any:
    """Make a collision rule: ``type`` and its values."""
    return _of_type(RULES, table)


def call(ways: Sequence[Way], values: Mapping[str, Any], **held: Any) -> Any:
    """Call the first of `ways` whose parameters are those that `values` gives; `held` is added for those who ask."""
    keys = [_keys(way, held) for way in ways]
    for way, (needed, allowed) in zip(ways, keys, strict=True):
        if set(needed) <= set(values) <= set(allowed):
            asked = inspect.signature(way).parameters
            return way(**values, **{name: value for name, value in held.items() if name in asked})
    if wrong := unknown(values, dict.fromkeys(key for _, allowed in keys for key in allowed), "key"):
        raise ValueError(wrong)
    sets = " or ".join("(" + ", ".join(needed) + ")" for needed, _ in keys)
    raise ValueError(f"the keys given are ({', '.join(values)}): {sets} is needed.")


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
    ways = [kind] + [getattr(kind, name) for name in ("from_restitution", "from_material") if hasattr(kind, name)]
    return call(ways, {key: value for key, value in table.items() if key != "type"}, **held)


def _keys(way: Way, held: Collection[str]) -> tuple[list[str], list[str]]:
    """Names that must be given, and names that may."""
    parameters = [p for p in inspect.signature(way).parameters.values() if p.name not in held]
    return [p.name for p in parameters if p.default is p.empty], [p.name for p in parameters]

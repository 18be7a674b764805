"""Write a case as TOML, with every digit: what `granular.cases.load` reads back is equal.
May be skipped: files and the command, no physics.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from os import PathLike
from typing import Any

import numpy as np

from granular import _check
from granular._files import write_text
from granular.cases.build import LAWS, RULES, WALLS, law, rule_of
from granular.cases.case import Case
from granular.cases.named import name_of
from granular.rules import ConstantRestitution
from granular.scene import Pair, Scene

STIFFNESS = ("k", "k_load")
"""Fields of a law that its `from_restitution` takes."""
Table = dict[str, Any]


def save(case: Case, path: str | PathLike[str]) -> None:
    """Write a case to a TOML file, whole or not at all.

    Raises
    ------
    OSError
        If the file cannot be written.
    TypeError
        If a law or rule is not one of granular's own, or the function of a wall has no name that can be imported: TOML
        holds numbers and names, not programs.
    """
    write_text(path, dumps(case))


def dumps(case: Case) -> str:
    """Return the TOML text of a case."""
    tables: dict[str, Table | list[Table]] = {"scene": _scene(case.scene)}
    tables |= _by_restitution(case) or _each("law", case.law, LAWS) | _each("rule", case.rule, RULES)
    until = None if case.until is None else asdict(case.until) or "separated"
    tables["run"] = {"until": until, "t_end": case.t_end, **case.run}
    lines = [f"about = {_value(case.about)}", ""] if case.about else []
    for name, table in tables.items():
        for one in table if isinstance(table, list) else [table]:
            lines += [f"[[{name}]]" if isinstance(table, list) else f"[{name}]"]
            lines += [*(f"{key} = {_value(value)}" for key, value in one.items() if value is not None), ""]
    return "\n".join(lines).rstrip() + "\n"


def _scene(scene: Scene) -> Table:
    """The fields of a scene, without those that say that it is no ring and has no pendula."""
    table = _numbers(scene)
    return table | {"ring": scene.ring or None, "pendulum": scene.pendulum or None}


def _numbers(physics: Any) -> Table:
    """The fields of a scene, law or rule."""
    return {f.name: getattr(physics, f.name) for f in fields(physics)}


def _each(name: str, values: Any, types: Mapping[str, Any]) -> dict[str, Table | list[Table]]:
    """The table of a law or rule, or one per pair."""
    each = list(values) if isinstance(values, (list, tuple)) else [] if values is None else [values]
    for value in each:
        if type(value) not in types.values():
            raise TypeError(f"{name} is {value!r}: only {', '.join(types)} can be written to TOML.")
    return _joined(name, [{"type": type(one).__name__} | _numbers(one) for one in each])


def _joined(name: str, tables: list[Table]) -> dict[str, Table | list[Table]]:
    """One table if all pairs have the same."""
    same = all(table == tables[0] for table in tables)
    return {name: tables[0] if same else tables} if tables else {}


def _by_restitution(case: Case) -> dict[str, Table | list[Table]]:
    """Laws given by the ε that is also the rule's, so that the two stay one number; nothing if that is not so.

    The tables are kept only if they make the very laws and the rule of the case again.
    """
    rule = case.rule
    if case.law is None or not isinstance(rule, ConstantRestitution):
        return {}
    laws = _check.per_pair("law", case.law, case.scene.n_pairs)
    tables = [_of_restitution(one, rule(0.0, pair), pair) for one, pair in zip(laws, case.scene.pairs, strict=True)]
    return _joined("law", tables) if all(tables) and rule_of(tables) == rule else {}


def _of_restitution(given: Any, restitution: float, pair: Pair) -> Table:
    """The table of a law by its restitution; empty if that does not make it again."""
    kept = _numbers(given) if type(given) in LAWS.values() else {}
    table = {"type": type(given).__name__, "restitution": restitution}
    table |= {name: value for name, value in kept.items() if name in STIFFNESS}
    try:
        return table if law(table, pair) == given else {}
    except (TypeError, ValueError):
        return {}


def _wall(motion: Any) -> Table:
    """The table of how a wall moves."""
    table: Table = {"type": type(motion).__name__} | _numbers(motion)
    if "function" in table:
        function = table["function"]
        table["function"] = function if type(function) in WALLS.values() else name_of(function)
    return table


def _value(value: Any) -> str:
    if type(value) in WALLS.values():
        value = _wall(value)
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, (bool, str)):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (int, float)):
        return repr(value)
    raise TypeError(f"{value!r} cannot be written to TOML: a number, a text or a list is needed.")

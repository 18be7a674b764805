"""Write a case as TOML, with every digit: what `granular.cases.load` reads back is equal."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields
from os import PathLike
from typing import Any

import numpy as np

from granular._files import write_text
from granular.cases.build import LAWS, RULES
from granular.cases.case import Case
from granular.until import Contact, Separated


def save(case: Case, path: str | PathLike[str]) -> None:
    """Write a case to a TOML file, whole or not at all.

    Raises
    ------
    OSError
        If the file cannot be written.
    TypeError
        If a law or rule is not one of granular's own: TOML holds numbers, not programs.
    """
    write_text(path, dumps(case))


def dumps(case: Case) -> str:
    """Return the TOML text of a case."""
    scene = {f.name: getattr(case.scene, f.name) for f in fields(case.scene)}
    lines = [f"about = {_value(case.about)}", ""] if case.about else []
    lines += _table("[scene]", scene)
    lines += _tables("law", case.law, LAWS)
    lines += _tables("rule", case.rule, RULES)
    run = {"until": _until(case.until), "t_end": case.t_end, **case.run}
    lines += _table("[run]", run)
    return "\n".join(lines).rstrip() + "\n"


def _tables(name: str, values: Any, types: Mapping[str, Any]) -> Iterator[str]:
    """[name] if all pairs have the same, else [[name]] once per pair."""
    if values is None:
        return
    each = list(values) if isinstance(values, (list, tuple)) else [values]
    for value in each:
        if type(value) not in types.values():
            raise TypeError(f"{name} is {value!r}: only {', '.join(types)} can be written to TOML.")
    same = all(value == each[0] for value in each)
    for value in each[:1] if same else each:
        content = {"type": type(value).__name__} | {f.name: getattr(value, f.name) for f in fields(value)}
        yield from _table(f"[{name}]" if same else f"[[{name}]]", content)


def _table(head: str, content: Mapping[str, Any]) -> list[str]:
    return [head, *(f"{key} = {_value(value)}" for key, value in content.items() if value is not None), ""]


def _until(until: Contact | Separated | None) -> Any:
    if isinstance(until, Contact):
        return {"pair": until.pair, "nth": until.nth}
    return "separated" if isinstance(until, Separated) else None


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    raise TypeError(f"{value!r} cannot be written to TOML: a number, a text or a list is needed.")

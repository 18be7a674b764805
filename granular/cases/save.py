"""Write a case as TOML, with every digit: what `granular.cases.load` reads back is equal."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields
from os import PathLike
from typing import Any

import numpy as np

from granular._files import write_text
from granular.cases.build import LAWS, RULES, law, rule_of
from granular.cases.case import Case
from granular.rules import ConstantRestitution
from granular.until import Contact, Separated

STIFFNESS = ("k", "k_load")
"""Fields of a law that its `from_restitution` takes."""


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
    if restitution := _by_restitution(case):
        lines += _same_or_each("law", restitution)
    else:
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
    contents = [{"type": type(one).__name__} | {f.name: getattr(one, f.name) for f in fields(one)} for one in each]
    yield from _same_or_each(name, contents)


def _same_or_each(name: str, contents: list[dict[str, Any]]) -> Iterator[str]:
    same = all(content == contents[0] for content in contents)
    for content in contents[:1] if same else contents:
        yield from _table(f"[{name}]" if same else f"[[{name}]]", content)


def _by_restitution(case: Case) -> list[dict[str, Any]]:
    """Tables of laws given by the ε that is also the rule's, so that the two stay one number; none if that is not so.

    The tables are kept only if they make the very laws and the rule of the case again.
    """
    if case.law is None or not isinstance(case.rule, ConstantRestitution):
        return []
    contents = []
    for one, pair in zip(case.law, case.scene.pairs, strict=True):
        kept = {f.name: getattr(one, f.name) for f in fields(one)} if type(one) in LAWS.values() else {}
        given = {name: value for name, value in kept.items() if name in STIFFNESS}
        content = {"type": type(one).__name__, "restitution": case.rule(0.0, pair)} | given
        try:
            if law(content, pair) != one:
                return []
        except (TypeError, ValueError):
            return []
        contents.append(content)
    return contents if rule_of(contents) == case.rule else []


def _table(head: str, content: Mapping[str, Any]) -> list[str]:
    return [head, *(f"{key} = {_value(value)}" for key, value in content.items() if value is not None), ""]


def _until(until: Contact | Separated | None) -> Any:
    if isinstance(until, Contact):
        return {"pair": until.pair, "nth": until.nth}
    return "separated" if isinstance(until, Separated) else None


def _value(value: Any) -> str:
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, (bool, str)):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (int, float)):
        return repr(value)
    raise TypeError(f"{value!r} cannot be written to TOML: a number, a text or a list is needed.")

"""Cases as TOML files with tables [scene], [law], [rule] and [run].

Numbers are written with all digits, so that a file that was saved and loaded gives a bitwise identical case.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.files import checked_path, write_text
from granular.cases import build, ready
from granular.cases.build import LAWS, RULES, WALLS, importable_name, law, message_prefix, rule_of_law_tables
from granular.cases.case import Case, checked_run
from granular.laws.rules import ConstantRestitution
from granular.run import until
from granular.scene import Pair, Scene, in_order

TABLE_NAMES = ("scene", "law", "rule", "run", "about")
MAX_FILE_BYTES = 32_000_000
"""Maximum size of a file in bytes, enough for a scene of 300 000 balls."""
LONG_KEY_PATTERN = re.compile(r"""(?<![\w"'-])(?:[\w"'-]+\s*\.\s*){50}""")
"""Pattern of dotted keys with 50 parts.

tomllib needs gigabytes of memory for a key with thousands of parts.
"""
STIFFNESS_FIELDS = ("k", "k_load")
"""Fields of a law that are also arguments of its `from_restitution`."""
Table = dict[str, Any]


@signature.face
def load(path: str | PathLike[str]) -> Case:
    """Read a case from a TOML file.

    Parameters
    ----------
    path : path
        A file such as::

            about = "two steel balls"

            [scene]                      # mass in kg, radius, gap and origin in m, velocity in m/s, gravity in m/s²
            mass = [inf, 4.0, 0.004]     # inf: a floor; or: name = "three-balls" and that scene's parameters
            radius = [0.0, 0.10, 0.01]
            gap = [0.5, 1e-4]            # or: position, of centres and walls
            velocity = [0.0, 0.0, 0.0]
            gravity = 9.81
            floor = { type = "Sine", amplitude = 1e-3, frequency = 50.0 }      # or gamma; ceiling has the same keys
            external_force = [0.0, 0.0, -1.0]                                  # N

            [law]                        # one for all pairs, or [[law]] once per pair, bottom to top
            type = "LinearDashpot"
            restitution = 0.7            # also of hard spheres; keys are arguments of the law or of its from_…
            k = 5e7

            [rule]                       # usually omitted: hard spheres then have the restitution of the laws
            type = "ConstantRestitution"
            restitution = 0.7

            [run]
            until = { pair = 0, nth = 2 }    # or: "separated", { type = "speed", ball = 2, above = 1.5 }
            t_end = 10.0
            dt = 1e-7                    # and other options of md.simulate and edmd.simulate

    A wall that moves by a user-defined function names a Python file beside this one, or an importable module, and the
    function in it::

        floor = { type = "Motion", function = "motion.py:shake" }

    This is the only way in which a file runs Python code. Read files from others before you load them. The command
    prints the file or module on standard error before it runs the code.

    Returns
    -------
    Case
        The case. A ready-made scene without [law], [rule] or `until` has its defaults.

    Raises
    ------
    OSError
        If the file cannot be read.
    TypeError, ValueError
        For a wrong or missing key, or an invalid value. The message names the file and the table.
    """
    with message_prefix(Path(checked_path("path", path)).name):
        return case_of_tables(read_tables(path), str(Path(path).parent))


@signature.face
def loads(text: str) -> Case:
    """Read a case from the text of a TOML file, see `load`."""
    check.of_kind("text", text, str, "the text of a TOML file", "To read a file, use load.")
    return case_of_tables(_parsed(text))


def read_tables(path: str | PathLike[str]) -> dict[str, Any]:
    """Read the tables of a TOML file, with or without a byte order mark.

    Raises `ValueError` if the file is too large, or is not valid TOML.
    """
    with open(path, "rb") as stream:
        content = stream.read(MAX_FILE_BYTES + 1)
    if len(content) > MAX_FILE_BYTES:
        raise ValueError(f"The file is larger than {MAX_FILE_BYTES // 1_000_000} MB. Build such a scene in Python.")
    try:
        return _parsed(content.decode("utf-8-sig").replace("\r\n", "\n"))
    except UnicodeDecodeError:
        raise ValueError("The file is not UTF-8 text, so it is not TOML. To play a recorded run, use granular "
                         "view.") from None


def _parsed(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text, or raise `ValueError`."""
    if LONG_KEY_PATTERN.search(text):
        raise ValueError("The file is not a case: a key has more than 50 parts. Keys such as scene.mass have two.")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("The file is not a case: lists or tables are nested too deeply.") from None
    except ValueError as error:
        raise ValueError(f"The file is not valid TOML: {error}.") from None


def case_of_tables(tables: Mapping[str, Any], folder: str = "") -> Case:
    """Return a case from the tables of a TOML file.

    `folder` is the folder of files with user-defined functions.
    """
    for key in tables:
        check.known_names([key], TABLE_NAMES, "table or key")
    if "scene" not in tables:
        raise ValueError("The table [scene] is missing. It names a ready-made scene, or gives mass, radius, gap and "
                         "velocity.")
    with message_prefix("[scene]"):
        scene_table = build.with_wall_motions(_table(tables["scene"]), folder)
        case = _base(scene_table)
    law_of_case, rule = _physics(tables, case)
    if "name" in scene_table:
        with message_prefix("[scene]"):
            case = ready.with_static_overlaps(scene_table.pop("name"), replace(case, law=law_of_case), scene_table)
    with message_prefix("[run]"):
        run = dict(_table(tables.get("run", {})))
        t_end = check.number("t_end", run.pop("t_end")) if "t_end" in run else case.t_end
        stop = stop_condition(run.pop("until"), case.scene) if "until" in run else case.until
        checked_run(run)
    about = check.of_kind("about", tables.get("about", case.about), str, "a text in quotes")
    return Case(case.scene, law_of_case, rule, stop, t_end, run, about)


def _base(table: Mapping[str, Any]) -> Case:
    """Return the ready-made case that [scene] names, or a case of its arrays.

    A case of arrays has no law and no rule.
    """
    if "name" not in table:
        return Case(in_order(build.call([Scene, Scene.from_positions], table)), None)
    name = check.choice("name", table["name"], ready.names())
    return ready.case_of_table(name, {key: value for key, value in table.items() if key != "name"})


def _physics(tables: Mapping[str, Any], base: Case) -> tuple[Any, Any]:
    """Return the force laws and the collision rule from the tables [law] and [rule].

    Each table holds for all pairs, or there is one per pair. Without [law], the laws of `base` are returned. Without
    [rule], the rule is taken from the restitution in [law], or from `base` if [law] is missing, too. Raises
    `ValueError` if there is neither a law nor a rule.
    """
    laws, rule, scene = base.law, base.rule, base.scene
    if "law" in tables:
        each = isinstance(tables["law"], list)

        def law_of_table(table: Any, pair: Pair) -> Any:
            with message_prefix(f"[[law]] of pair {pair.name}" if each else "[law]"):
                return build.law(_table(table), pair)

        of_pairs = check.per_pair("[[law]]", tables["law"], scene.n_pairs)
        laws, rule = build.laws_of_pairs(law_of_table, of_pairs, scene.pairs), build.rule_of_law_tables(of_pairs)
    if "rule" in tables:
        table = tables["rule"]
        with message_prefix("[rule]"):
            rules = [build.rule(_table(entry)) for entry in (table if isinstance(table, list) else [table])]
            rule = check.per_pair("[[rule]]", rules, scene.n_pairs) if isinstance(table, list) else rules[0]
    if laws is None and rule is None:
        raise ValueError("The table [law] is missing. Give a force law, or at least a [rule] for hard spheres.")
    return laws, rule


def stop_condition(value: Any, scene: Scene) -> until.Until | None:
    """Return the condition of `granular.until` for a table or the string "separated".

    A table without ``type`` is `until.contact`.
    """
    if value == "separated":
        return until.separated()
    check.of_kind("until", value, Mapping, '"separated" or a table such as { pair = 0, nth = 2 }')
    ways = {way.__name__: way for way in (until.contact, until.force, until.speed, until.position)}
    with message_prefix("until"):
        condition: until.Until = build.object_of_type(ways, {"type": "contact", **value})
    return until.checked(condition, scene)


def _table(value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise TypeError("A table must be written in [brackets] on a line of its own, then one key per line, got "
                        f"{value!r}.")
    return value


@signature.face
def save(case: Case, path: str | PathLike[str]) -> None:
    """Write a case to a TOML file, completely or not at all.

    Raises
    ------
    OSError
        If the file cannot be written.
    TypeError
        If a law or rule is user-defined, or the function of a wall cannot be imported by its name. TOML contains
        numbers and names, but not programs.
    """
    write_text(path, dumps(case))


@signature.face
def dumps(case: Case) -> str:
    """Return the TOML text of a case."""
    scene = check.of_kind("case", case, Case, "a granular.Case").scene
    tables: dict[str, Table | list[Table]] = {"scene": _scene(scene)}
    tables |= _by_restitution(case) or _each("law", case.law, LAWS) | _each("rule", case.rule, RULES)
    tables["run"] = {"until": _stop(case.until), "t_end": case.t_end, **case.run}
    lines = [f"about = {_value(case.about)}", ""] if case.about else []
    for name, table in tables.items():
        for entry in table if isinstance(table, list) else [table]:
            lines += [f"[[{name}]]" if isinstance(table, list) else f"[{name}]"]
            lines += [*(f"{key} = {_value(value)}" for key, value in entry.items() if value is not None), ""]
    return "\n".join(lines).rstrip() + "\n"


def _stop(condition: until.Until | None) -> Any:
    """Return the table, or the string "separated", of a stop condition."""
    if condition is None:
        return None
    arguments = {name: value for name, value in asdict(condition).items() if value is not None}
    kind = {} if isinstance(condition, until.Contact) else {"type": type(condition).__name__.lower()}
    return kind | arguments if arguments else "separated"


def _scene(scene: Scene) -> Table:
    """Return the fields of a scene.

    `ring` and `pendulum` are None if the scene is not a ring, or has no pendula.
    """
    return _numbers(scene) | {"ring": scene.ring or None, "pendulum": scene.pendulum or None}


def _numbers(physics: Any) -> Table:
    """Return the fields of a scene, law or rule by their names."""
    return {f.name: getattr(physics, f.name) for f in fields(physics)}


def _each(name: str, values: Any, types: Mapping[str, Any]) -> dict[str, Table | list[Table]]:
    """Return the table of a law or rule, or a list of one table per pair.

    The only key of the result is `name`, "law" or "rule". Raises `TypeError` for a type that is not in `types`.
    """
    each = list(values) if isinstance(values, (list, tuple)) else [] if values is None else [values]
    for value in each:
        if type(value) not in types.values():
            raise TypeError(f"`{name}` must be one of {', '.join(types)} to be written to TOML, got {value!r}.")
    return _single_or_list(name, [{"type": type(value).__name__} | _numbers(value) for value in each])


def _single_or_list(name: str, tables: list[Table]) -> dict[str, Table | list[Table]]:
    """Return {`name`: table} if all tables are equal, otherwise {`name`: `tables`}.

    The result is empty without tables.
    """
    return {name: tables[0] if all(table == tables[0] for table in tables) else tables} if tables else {}


def _by_restitution(case: Case) -> dict[str, Table | list[Table]]:
    """Return the [law] tables with the restitution of the rule, or an empty mapping.

    Such tables describe laws and rule by one common ε, so that [rule] is not needed. They are returned only if they
    reproduce the laws and the rule exactly.
    """
    rule = case.rule
    if case.law is None or not isinstance(rule, ConstantRestitution):
        return {}
    laws = check.per_pair("law", case.law, case.scene.n_pairs)
    tables = [_of_restitution(pair_law, rule(0.0, pair), pair)
              for pair_law, pair in zip(laws, case.scene.pairs, strict=True)]
    return _single_or_list("law", tables) if all(tables) and rule_of_law_tables(tables) == rule else {}


def _of_restitution(law_of_pair: Any, restitution: float, pair: Pair) -> Table:
    """Return the table of a law with its restitution, or an empty table.

    The table is empty if it does not reproduce the law exactly.
    """
    values = _numbers(law_of_pair) if type(law_of_pair) in LAWS.values() else {}
    table = {"type": type(law_of_pair).__name__, "restitution": restitution} | {
        name: value for name, value in values.items() if name in STIFFNESS_FIELDS}
    try:
        return table if law(table, pair) == law_of_pair else {}
    except (TypeError, ValueError):
        return {}


def _wall(motion: Any) -> Table:
    """Return the table of the motion of a wall."""
    table: Table = {"type": type(motion).__name__} | _numbers(motion)
    if "function" in table:
        function = table["function"]
        table["function"] = function if type(function) in WALLS.values() else importable_name(function)
    return table


def _value(value: Any) -> str:
    """Return a value in the syntax of TOML, or raise `TypeError`."""
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
    raise TypeError(f"Only numbers, strings, booleans, lists and tables can be written to TOML, got {value!r}.")

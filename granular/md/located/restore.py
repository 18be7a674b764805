"""Continuation of a run from a checkpoint, which can come from a file.

The records are validated against the scene first, because kernels do not check them. Field names of earlier versions
are translated.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from granular._engine.check import EDITED_STATE, saved_array
from granular._engine.records import column, copied, tournament
from granular.md.located.checkpoint import CHECKPOINT_RECORDS
from granular.md.located.records import (
    ASKS,
    EDGE,
    ENERGY_ACCOUNT_RECORD,
    LOOKED,
    MAX_CLOCK_EXPONENT,
    MAX_WORK_LIMIT,
    SPARE_PLACES,
    STRUCK,
)
from granular.md.located.system import System, empty_pool
from granular.run.contact_log import CONTACT_ROW

SCENE_FIELDS = {
    "run": ("omega", "length"),
    "pairs": ("pull", "kind_of", "map", "wall"),
    "bodies": ("inverse_mass", "wall"),
    "ledger": ("temperature", "mass", "seed"),
}
"""Fields that never change: they follow from the scene and its laws."""
LAW_FIELDS = ("memory", "k", "gamma", "p", "d", "s", "q", "kind")
"""Fields of a pair in the pool that are copied from its law."""
FINITE_FIELDS = {"run": ("t", "tail", "tol", "steps"), "pairs": ("xi", "eta", "t", "tail", "noise", "last_step"),
           "bodies": ("v", "t", "tail", "fall"), "pool": ("xi", "eta", "t", "tail", "h", "tau", "x", "e", "last_step"),
           "tables": ("c", "error"), "ledger": ("total", "low")}
"""Fields whose numbers must be finite.

In the pool, this applies to occupied places."""
OLD_FIELD_NAMES = {
    "run": {"alone": "solo", "begun": "contacts", "stride": "last_step", "log": "log_level"},
    "pairs": {"alone": "isolated", "count": "contacts", "what": "event", "stride": "last_step"},
    "pool": {"top": "xi_peak", "what": "event", "stride": "last_step", "begun": "going_on"},
    "ledger": {"alone": "solo", "hits": "contacts"},
}
"""Field names in files of earlier versions, and their current names."""
ADDED_FIELDS = {"pool": {"doubts": np.int64}}
"""Fields that earlier versions did not have. Missing fields are set to 0."""


def check(s: Any, state: Mapping[str, Any]) -> None:
    """Raise `ValueError` if a checkpoint does not fit the scene.

    `s` are the records of the scene at its start, `state` is the checkpoint. All indices in the checkpoint must exist.
    """
    saved_array(state, "origin", "f", ())
    for name in {"creeping", "riding"} & state.keys():  # fields of earlier versions
        saved_array(state, name, "b", ())
    sizes = {name: len(getattr(s, name)) for name in ("run", "pairs", "bodies", "maps")}
    for name, dtype in CHECKPOINT_RECORDS.items():
        if name == "ledger" and s.ledger is None:
            continue
        records = np.asarray(state.get(name))
        if not _like(records, dtype) or len(records) != sizes.get(name, len(records)):
            got = "other records" if name in state else "nothing"
            raise ValueError(f"{name!r} in the state of `trajectory` must be the records of its scene, got {got}. "
                             f"{EDITED_STATE}")
    if not _of_scene(s, state):
        raise ValueError("The state of `trajectory` belongs to another scene or other laws. The file was edited after "
                         "it was saved, or loaded with other laws.")
    if not _within(state) or not _numbers(state):
        raise ValueError(f"The state of `trajectory` contradicts itself. {EDITED_STATE}")


def _like(records: Any, dtype: np.dtype[Any]) -> bool:
    """Return whether records have all fields of `dtype`, each with its kind and shape."""
    fields: Any = records.dtype.fields
    return records.ndim == 1 and fields is not None and all(
        name in fields and (fields[name][0].base.kind, fields[name][0].shape) == (here.base.kind, here.shape)
        for name, (here, *_) in (dtype.fields or {}).items()
    )


def _of_scene(s: Any, state: Mapping[str, Any]) -> bool:
    """Return whether all constant fields of a checkpoint agree with the scene.

    `s` are the records of the scene at its start. Pairs in islands must have the law of their pair in the scene.
    """
    for name, fields in SCENE_FIELDS.items():
        for field in fields if getattr(s, name) is not None else ():
            if not np.array_equal(state[name][field], column(getattr(s, name), field)):
                return False
    still = (s.bodies["inverse_mass"] == 0.0) & (s.bodies["wall"] == 0.0)
    if not np.array_equal(state["bodies"]["v"][still], s.bodies["v"][still]):
        return False
    pairs, pool = state["pairs"], state["pool"]
    inside = np.flatnonzero(pairs["slot"] >= 0)
    if len(inside) and pairs["slot"].max() >= len(pool):
        return False
    members, laws = pool[pairs["slot"][inside]], s.kinds[pairs["kind_of"][inside]]
    return all(np.array_equal(members[name], laws[name]) for name in LAW_FIELDS) and bool(
        np.array_equal(members["wall"], pairs["wall"][inside]))


def _within(state: Mapping[str, Any]) -> bool:
    """Return whether all indices, numbers of pairs and codes are within their ranges.

    Indices that refer to each other must also be consistent.
    """
    run, pairs, pool, bodies = (state[name] for name in ("run", "pairs", "pool", "bodies"))
    n, rows, places = len(bodies) - 1, len(state["log"]), len(pool)
    place = np.arange(len(pairs)) % n
    first = pairs["first"][:n]
    spare, taken = pool["spare"], pairs["slot"][:n][pairs["slot"][:n] >= 0]
    one = run[0]
    free = spare[max(int(one["members"]), 0) :]
    if not (((first >= 0) & (first < n)).all() and 0 <= one["members"] <= places and np.array_equal(
            np.sort([*taken, *free]), np.arange(places)) and ((pairs["hi"] > 0) & (pairs["hi"] <= len(pairs))).all()):
        return False
    size, flies = pairs["hi"][first] - first, np.flatnonzero(pairs["slot"][:n] < 0)
    members = pool[taken]
    limits = [
        (pairs["mode"], 0, STRUCK), (pairs["event"], 0, EDGE), (pairs["exact"], 0, 1), (pairs["row"], -1, np.inf),
        (pairs["slot"], -1, places - 1),
        (state["log"]["pair"], -1, n - 1), (state["maps"]["table"], -1, len(state["tables"])),
        (state["maps"]["met"], 0, np.inf), (members["mode"], 0, STRUCK), (members["event"], 0, EDGE),
        (members["fired"], -1, n - 1), (members["head"], -1, n - 1), (members["piled"], 0, n),
        (members["manner"], 0, LOOKED), (members["doubts"], 0, np.inf),
        (members["clock"], 1, MAX_CLOCK_EXPONENT), (one["first"], -1, n - 1),
        (one["wanted"], 0, n - 1), (one["solo"], -1, n - 1), (one["lo"], 0, len(pairs)), (one["hi"], 0, len(pairs)),
        (state["tables"]["noted"], 0, np.inf), (run["events"], 0, np.inf), (run["steps"], 0, np.inf),
    ]
    return bool(
        all(((least <= values) & (values <= most)).all() for values, least, most in limits)
        and ((place[:n] - first) % n < size).all()
        and not (np.isinf(pairs["wait"][flies]) & (pairs["due"][flies] < np.inf)).any()  # a missed touch
        and np.array_equal(pairs["slot"][n:], pairs["slot"][: len(pairs) - n])
        and np.array_equal(members["number"], np.flatnonzero(pairs["slot"][:n] >= 0))
        and one["rows"] == rows and one["tables"] == len(state["tables"])
        and not (members["manner"] == ASKS).any()
    )


def _numbers(state: Mapping[str, Any]) -> bool:
    """Return whether all numbers of the motion in a checkpoint are finite.

    The dissipated energy, the last of five sums, is excluded, because it is unknown for laws with memory.
    """
    taken = state["pairs"]["slot"][state["pairs"]["slot"] >= 0]
    records = {name: state[name] for name in FINITE_FIELDS if name in state} | {"pool": state["pool"][taken]}
    return all(np.isfinite(rows[field][..., :4] if name == "ledger" else rows[field]).all()
               for name, rows in records.items() for field in FINITE_FIELDS[name])


def named_today(name: str, records: Any) -> Any:
    """Return records of a checkpoint with the current names of their fields.

    `name` is a key of `CHECKPOINT_RECORDS`. Fields that an earlier version did not have are added.
    """
    if records.ndim != 1 or records.dtype.names is None or records.dtype == CHECKPOINT_RECORDS[name]:
        return records
    now = {OLD_FIELD_NAMES.get(name, {}).get(field, field): field for field in records.dtype.names}
    fields = [(field, records.dtype[old]) for field, old in now.items()]
    had_signs = name == "pairs" and "lasts" in now and "ahead" not in now  # negative: only the clock is ahead
    added = [(field, np.dtype(kind)) for field, kind in ADDED_FIELDS.get(name, {}).items() if field not in now]
    out = np.zeros(len(records), [*fields, *added, *([("ahead", np.dtype(np.int8))] if had_signs else [])])
    for field, old in now.items():
        out[field] = records[old]
    if had_signs:
        out["ahead"], out["lasts"] = records["lasts"] != 0.0, np.maximum(records["lasts"], 0.0)
    return out


def named_alike(records: Any, dtype: np.dtype[Any]) -> Any:
    """Return a copy of records with the fields of `dtype`.

    Fields that the records do not have are 0. Fields that are not in `dtype` are omitted.
    """
    if records.dtype == dtype:
        return copied(records)
    out = np.zeros(len(records), dtype)
    for name in set(records.dtype.names) & set(dtype.names or ()):
        out[name] = records[name]
    return out


def restored(s: System, state: Mapping[str, Any]) -> System:
    """Return the records of a checkpoint with the limits and stop conditions of `s`.

    `s` are the records of the scene at its start. The limits on contacts and steps are counted from the checkpoint
    onwards. Raises `ValueError` if the checkpoint does not fit the scene and its laws.
    """
    state = {
        name: named_today(name, np.asarray(value)) if name in CHECKPOINT_RECORDS else value
        for name, value in state.items()
    }
    check(s, state)
    names = "run", "pairs", "pool", "bodies"
    run, pairs, taken, bodies = (named_alike(state[name], CHECKPOINT_RECORDS[name]) for name in names)
    pairs["row"][pairs["row"] >= len(state["log"])] = -1  # rows of contacts that are over
    for name in ("until_pair", "until_nth", "separated", "log_level", "disturbing"):
        run[name] = s.run[name]
    for name, so_far in (("max_events", "contacts"), ("max_steps", "steps")):
        run[name] = min(int(run[so_far][0]) + int(s.run[name][0]), MAX_WORK_LIMIT)
    pool, log = empty_pool(len(taken) + SPARE_PLACES), np.zeros(len(s.log) + len(state["log"]), CONTACT_ROW)
    pool[: len(taken)], log[: len(state["log"])] = taken, state["log"]
    tables = np.append(state["tables"], s.tables)
    n = len(bodies) - 1
    queue = tournament(n)
    queue["due"][len(queue) // 2 :][:n] = pairs["due"][:n]
    maps = copied(state["maps"])
    ledger = s.ledger if s.ledger is None else named_alike(state["ledger"], ENERGY_ACCOUNT_RECORD)
    return s._replace(run=run, pairs=pairs, pool=pool, bodies=bodies, queue=queue, log=log, maps=maps, tables=tables,
                      ledger=ledger)


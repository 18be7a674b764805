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
    CREEP_TESTED,
    EDGE,
    ENERGIES,
    ENERGY_ACCOUNT_RECORD,
    MAX_CLOCK_EXPONENT,
    MAX_WORK_LIMIT,
    NEEDS_CREEP_TEST,
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


def check_state(s: Any, state: Mapping[str, Any]) -> None:
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
        if not _has_fields_of(records, dtype) or len(records) != sizes.get(name, len(records)):
            got = "other records" if name in state else "nothing"
            raise ValueError(f"{name!r} in the state of `trajectory` must be the records of its scene, got {got}. "
                             f"{EDITED_STATE}")
    if not _matches_scene(s, state):
        raise ValueError("The state of `trajectory` belongs to another scene or other laws. The file was edited after "
                         "it was saved, or loaded with other laws.")
    if not _is_within_ranges(state) or not _is_finite(state):
        raise ValueError("The state of `trajectory` has numbers that are not finite, outside their range or "
                         f"inconsistent with each other. {EDITED_STATE}")


def _has_fields_of(records: Any, dtype: np.dtype[Any]) -> bool:
    """Return whether records have all fields of `dtype`, each with its kind and shape."""
    fields: Any = records.dtype.fields
    return records.ndim == 1 and fields is not None and all(
        name in fields and (fields[name][0].base.kind, fields[name][0].shape) == (expected.base.kind, expected.shape)
        for name, (expected, *_) in (dtype.fields or {}).items()
    )


def _matches_scene(s: Any, state: Mapping[str, Any]) -> bool:
    """Return whether all constant fields of a checkpoint agree with the scene.

    `s` are the records of the scene at its start. Pairs in islands must have the law of their pair in the scene.
    """
    for name, fields in SCENE_FIELDS.items():
        for field in fields if getattr(s, name) is not None else ():
            if not np.array_equal(state[name][field], column(getattr(s, name), field)):
                return False
    is_undriven_wall = (s.bodies["inverse_mass"] == 0.0) & (s.bodies["wall"] == 0.0)
    if not np.array_equal(state["bodies"]["v"][is_undriven_wall], s.bodies["v"][is_undriven_wall]):
        return False
    pairs, pool = state["pairs"], state["pool"]
    in_island = np.flatnonzero(pairs["slot"] >= 0)
    if len(in_island) and pairs["slot"].max() >= len(pool):
        return False
    members, laws = pool[pairs["slot"][in_island]], s.kinds[pairs["kind_of"][in_island]]
    return all(np.array_equal(members[name], laws[name]) for name in LAW_FIELDS) and bool(
        np.array_equal(members["wall"], pairs["wall"][in_island]))


def _is_within_ranges(state: Mapping[str, Any]) -> bool:
    """Return whether all indices, numbers of pairs and codes are within their ranges.

    Indices that refer to each other must also be consistent.
    """
    run, pairs, pool, bodies = (state[name] for name in ("run", "pairs", "pool", "bodies"))
    n, rows, places = len(bodies) - 1, len(state["log"]), len(pool)
    place = np.arange(len(pairs)) % n
    first = pairs["first"][:n]
    spare, occupied = pool["spare"], pairs["slot"][:n][pairs["slot"][:n] >= 0]
    record = run[0]
    free = spare[max(int(record["members"]), 0) :]
    # the occupied and the free places of the pool together are all places, each once
    if not (((first >= 0) & (first < n)).all() and 0 <= record["members"] <= places and np.array_equal(
            np.sort([*occupied, *free]), np.arange(places)
    ) and ((pairs["hi"] > 0) & (pairs["hi"] <= len(pairs))).all()):
        return False
    size, in_flight = pairs["hi"][first] - first, np.flatnonzero(pairs["slot"][:n] < 0)
    members = pool[occupied]
    limits = [
        (pairs["mode"], 0, STRUCK), (pairs["event"], 0, EDGE), (pairs["exact"], 0, 1), (pairs["row"], -1, np.inf),
        (pairs["slot"], -1, places - 1),
        (state["log"]["pair"], -1, n - 1), (state["maps"]["table"], -1, len(state["tables"])),
        (state["maps"]["met"], 0, np.inf), (members["mode"], 0, STRUCK), (members["event"], 0, EDGE),
        (members["fired"], -1, n - 1), (members["head"], -1, n - 1), (members["piled"], 0, n),
        (members["manner"], 0, CREEP_TESTED), (members["doubts"], 0, np.inf),
        (members["clock"], 1, MAX_CLOCK_EXPONENT), (record["first"], -1, n - 1),
        (record["wanted"], 0, n - 1), (record["solo"], -1, n - 1), (record["lo"], 0, len(pairs)),
        (record["hi"], 0, len(pairs)),
        (state["tables"]["noted"], 0, np.inf), (run["events"], 0, np.inf), (run["steps"], 0, np.inf),
    ]
    return bool(
        all(((lowest <= values) & (values <= highest)).all() for values, lowest, highest in limits)
        # every pair lies in the block whose first pair is named in its record
        and ((place[:n] - first) % n < size).all()
        # a flight without a next contact has no event that is due
        and not (np.isinf(pairs["wait"][in_flight]) & (pairs["due"][in_flight] < np.inf)).any()
        # on a ring the pairs are stored twice
        and np.array_equal(pairs["slot"][n:], pairs["slot"][: len(pairs) - n])
        # records in the pool contain the number of their own pair
        and np.array_equal(members["number"], np.flatnonzero(pairs["slot"][:n] >= 0))
        and record["rows"] == rows and record["tables"] == len(state["tables"])
        # a checkpoint is never taken before a creep test
        and not (members["manner"] == NEEDS_CREEP_TEST).any()
    )


def _is_finite(state: Mapping[str, Any]) -> bool:
    """Return whether all numbers of the motion in a checkpoint are finite.

    The dissipated energy, the last of five sums, is excluded, because it is unknown for laws with memory.
    """
    occupied = state["pairs"]["slot"][state["pairs"]["slot"] >= 0]
    records = {name: state[name] for name in FINITE_FIELDS if name in state} | {"pool": state["pool"][occupied]}
    return all(np.isfinite(rows[field][..., :4] if name == "ledger" else rows[field]).all()
               for name, rows in records.items() for field in FINITE_FIELDS[name])


def with_current_names(name: str, records: Any) -> Any:
    """Return records of a checkpoint with the current names of their fields.

    `name` is a key of `CHECKPOINT_RECORDS`. Fields that an earlier version did not have are added.
    """
    if records.ndim != 1 or records.dtype.names is None or records.dtype == CHECKPOINT_RECORDS[name]:
        return records
    old_names = {OLD_FIELD_NAMES.get(name, {}).get(field, field): field for field in records.dtype.names}
    fields = [(field, records.dtype[old]) for field, old in old_names.items()]
    # negative: only the clock is ahead
    had_signs = name == "pairs" and "lasts" in old_names and "ahead" not in old_names
    added = [(field, np.dtype(kind)) for field, kind in ADDED_FIELDS.get(name, {}).items() if field not in old_names]
    out = np.zeros(len(records), [*fields, *added, *([("ahead", np.dtype(np.int8))] if had_signs else [])])
    for field, old in old_names.items():
        out[field] = records[old]
    if had_signs:
        out["ahead"], out["lasts"] = records["lasts"] != 0.0, np.maximum(records["lasts"], 0.0)
    return out


def with_fields_of(records: Any, dtype: np.dtype[Any]) -> Any:
    """Return a copy of records with the fields of `dtype`.

    Fields that the records do not have are 0. Fields that are not in `dtype` are omitted.
    """
    if records.dtype == dtype:
        return copied(records)
    out = np.zeros(len(records), dtype)
    for name in set(records.dtype.names) & set(dtype.names or ()):
        out[name] = records[name]
    return out


def restored_records(s: System, state: Mapping[str, Any]) -> System:
    """Return the records of a checkpoint with the limits and stop conditions of `s`.

    `s` are the records of the scene at its start. The limits on contacts and steps are counted from the checkpoint
    onwards. Raises `ValueError` if the checkpoint does not fit the scene and its laws.
    """
    state = {
        name: with_current_names(name, np.asarray(value)) if name in CHECKPOINT_RECORDS else value
        for name, value in state.items()
    }
    check_state(s, state)
    names = "run", "pairs", "pool", "bodies"
    run, pairs, members, bodies = (with_fields_of(state[name], CHECKPOINT_RECORDS[name]) for name in names)
    pairs["row"][pairs["row"] >= len(state["log"])] = -1  # rows of contacts that are over
    if s.run["log_level"][0] == ENERGIES != run["log_level"][0]:  # the energies before the checkpoint are unknown
        members["force_max"] = state["log"]["force_max"] = np.nan
    for name in ("until_pair", "until_nth", "separated", "log_level", "disturbing"):
        run[name] = s.run[name]
    for name, counter in (("max_events", "contacts"), ("max_steps", "steps")):
        run[name] = min(int(run[counter][0]) + int(s.run[name][0]), MAX_WORK_LIMIT)
    pool, log = empty_pool(len(members) + SPARE_PLACES), np.zeros(len(s.log) + len(state["log"]), CONTACT_ROW)
    pool[: len(members)], log[: len(state["log"])] = members, state["log"]
    tables = np.append(state["tables"], s.tables)
    n = len(bodies) - 1
    queue = tournament(n)
    queue["due"][len(queue) // 2 :][:n] = pairs["due"][:n]
    maps = copied(state["maps"])
    ledger = s.ledger if s.ledger is None else with_fields_of(state["ledger"], ENERGY_ACCOUNT_RECORD)
    return s._replace(run=run, pairs=pairs, pool=pool, bodies=bodies, queue=queue, log=log, maps=maps, tables=tables,
                      ledger=ledger)


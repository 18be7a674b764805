"""Whether a checkpoint can be that of a scene: asked before kernels, which check nothing, go on with it.
May be skipped: how a run is saved and resumed, no physics.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from granular._check import held
from granular._records import column
from granular.drive import CONTACT_ROW
from granular.md.located.records import (
    ASKS,
    BODY,
    EDGE,
    LARGEST_Q,
    LEDGER,
    LOOKED,
    MAP,
    MEMBER,
    PAIR,
    RUN,
    STRUCK,
    TABLE,
)

KEPT = {"run": RUN, "pairs": PAIR, "pool": MEMBER, "bodies": BODY, "maps": MAP, "tables": TABLE, "log": CONTACT_ROW,
        "ledger": LEDGER}
"""Records that a checkpoint holds: of tables and log what is used; the ledger where walls are driven or thermal."""
SCENES = {"run": ("omega", "length"), "pairs": ("pull", "kind_of", "map", "wall"), "bodies": ("inverse_mass", "wall"),
          "ledger": ("temperature", "mass", "seed")}
"""Fields that never change: what the scene and its laws say of them."""
OF_LAW = ("memory", "k", "gamma", "p", "d", "s", "q", "kind")
NUMBERS = {"run": ("t", "tail", "tol", "steps"), "pairs": ("xi", "eta", "t", "tail", "noise", "stride"),
           "bodies": ("v", "t", "tail", "fall"), "pool": ("xi", "eta", "t", "tail", "h", "tau", "x", "e", "stride"),
           "tables": ("c", "error"), "ledger": ("total", "low")}
"""Fields of floats that are finite, in the pool those of places that are taken."""
CHANGED = "it was changed after it was saved"


def check(s: Any, state: Mapping[str, Any]) -> None:
    """Raise `ValueError` unless a checkpoint holds records like those of `s`, a run at its start, and places in them
    that exist."""
    held(state, "origin", "f", ())
    for name in ("creeping", "riding"):
        if name in state or name == "creeping":
            held(state, name, "b", ())
    sizes = {name: len(getattr(s, name)) for name in ("run", "pairs", "bodies", "maps")}
    for name, dtype in KEPT.items():
        if name == "ledger" and s.ledger is None:
            continue
        records = np.asarray(state.get(name))
        if not _like(records, dtype) or len(records) != sizes.get(name, len(records)):
            got = "is no array of such records as" if name in state else "is missing, which"
            raise ValueError(f"{name} in the state of trajectory {got} a run of its scene has; {CHANGED}.")
    if not _of_scene(s, state):
        raise ValueError(f"state of trajectory is of another scene or other laws; {CHANGED}, or was given other laws.")
    if not _within(state) or not _numbers(state):
        raise ValueError(f"state of trajectory contradicts itself; {CHANGED}.")


def _like(records: Any, dtype: np.dtype[Any]) -> bool:
    """Whether records have the fields of `dtype`, each of its kind and shape."""
    fields: Any = records.dtype.fields
    return records.ndim == 1 and fields is not None and all(
        name in fields and (fields[name][0].base.kind, fields[name][0].shape) == (here.base.kind, here.shape)
        for name, (here, *_) in (dtype.fields or {}).items()
    )


def _of_scene(s: Any, state: Mapping[str, Any]) -> bool:
    """Whether what never changes is as at the start, and islands have the laws of their pairs."""
    for name, fields in SCENES.items():
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
    return all(np.array_equal(members[name], laws[name]) for name in OF_LAW) and bool(
        np.array_equal(members["wall"], pairs["wall"][inside]))


def _within(state: Mapping[str, Any]) -> bool:
    """Whether all places, numbers of pairs and words for modes and events are such."""
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
        (pairs["mode"], 0, STRUCK), (pairs["what"], 0, EDGE), (pairs["exact"], 0, 1), (pairs["row"], -1, np.inf),
        (pairs["slot"], -1, places - 1),
        (state["log"]["pair"], -1, n - 1), (state["maps"]["table"], -1, len(state["tables"])),
        (state["maps"]["met"], 0, np.inf), (members["mode"], 0, STRUCK), (members["what"], 0, EDGE),
        (members["fired"], -1, n - 1), (members["head"], -1, n - 1), (members["piled"], 0, n),
        (members["manner"], 0, LOOKED), (members["clock"], 1, LARGEST_Q), (one["first"], -1, n - 1),
        (one["wanted"], 0, n - 1), (one["alone"], -1, n - 1), (one["lo"], 0, len(pairs)), (one["hi"], 0, len(pairs)),
        (state["tables"]["noted"], 0, np.inf), (run["events"], 0, np.inf), (run["steps"], 0, np.inf),
    ]
    return bool(
        all(((least <= values) & (values <= most)).all() for values, least, most in limits)
        and ((place[:n] - first) % n < size).all()
        and not (np.isinf(pairs["wait"][flies]) & (pairs["due"][flies] < np.inf)).any()  # it would miss a touch
        and np.array_equal(pairs["slot"][n:], pairs["slot"][: len(pairs) - n])
        and np.array_equal(members["number"], np.flatnonzero(pairs["slot"][:n] >= 0))
        and one["rows"] == rows and one["tables"] == len(state["tables"])
        and not (members["manner"] == ASKS).any()
    )


def _numbers(state: Mapping[str, Any]) -> bool:
    """Whether what is reckoned with is finite; not what was dissipated, the last of five, which nobody knows of laws
    with memory."""
    taken = state["pairs"]["slot"][state["pairs"]["slot"] >= 0]
    records = {name: state[name] for name in NUMBERS if name in state} | {"pool": state["pool"][taken]}
    return all(np.isfinite(rows[field][..., :4] if name == "ledger" else rows[field]).all()
               for name, rows in records.items() for field in NUMBERS[name])

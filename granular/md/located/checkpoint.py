"""What a run is at its end, to go on from: the records as they stood before the last row was made.
May be skipped: how a run is saved and resumed, no physics.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

import numpy as np

from granular._records import column, copied, packed, raw
from granular._tournament import tournament
from granular.drive import CONTACT_ROW
from granular.md.located.records import LEDGER, NO_PAUSE, SPARE
from granular.md.located.sound import KEPT, check
from granular.md.located.system import System, empty_pool

SMALL = 256
"""Pairs up to which all records are copied: to choose takes longer."""


class Checkpoint(Mapping[str, Any]):
    """The state of a run as arrays by name, made when they are first asked for."""

    def __init__(self, s: System, words: dict[str, Any]) -> None:
        self._s: Any = s
        self._arrays: dict[str, Any] = words

    def __getitem__(self, name: str) -> Any:
        return self._made()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._made())

    def __len__(self) -> int:
        return len(self._made())

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (self._made(),)

    def _made(self) -> dict[str, Any]:
        if self._s is not None:
            used = {"tables": int(column(self._s.run, "tables")[0]), "log": int(column(self._s.run, "rows")[0])}
            for name, dtype in KEPT.items():
                records = getattr(self._s, name)
                if records is None:
                    continue
                self._arrays[name] = packed(records[: used.get(name, len(records))], dtype)
            self._s = None
        return self._arrays


class Untouched:
    """Records of islands, and of contacts solved at once, put back as they were after the end of a run is looked at."""

    def __init__(self, s: System, t: float) -> None:
        """Keep what the end of a run, at time `t`, changes; of a small one all."""
        self.kept: list[tuple[Any, Any, Any]]
        rows = int(s.run[0]["rows"])
        if isinstance(s.run, np.ndarray) and len(s.pairs) <= SMALL:
            everything = [s.run, s.pairs, s.bodies, s.pool, s.log[:rows], *([] if s.ledger is None else [s.ledger])]
            self.kept = [(records, slice(None), raw(records).copy()) for records in everything]
            return
        if len(s.pairs) >= len(s.bodies):  # a ring
            self.kept = [(records, np.arange(n), _taken(records, np.arange(n))) for records, n in (
                (s.run, 1), (s.pairs, len(s.pairs)), (s.bodies, len(s.bodies)), (s.pool, len(s.pool)), (s.log, rows),
            )]
            return
        clock, lasts, slot = (column(s.pairs, name) for name in ("t", "lasts", "slot"))
        inside = np.flatnonzero((lasts > 0.0) & (slot < 0) & (clock >= t * (1.0 - 1e-12)))  # or may be
        joined = np.flatnonzero(slot >= 0)
        pairs, bodies = np.zeros(len(slot) + 2, bool), np.zeros(len(slot) + 1, bool)  # one more pair on either side
        pairs[joined + 1] = pairs[inside] = pairs[inside + 1] = pairs[inside + 2] = True
        near = np.flatnonzero(pairs[1:-1])
        bodies[near] = bodies[near + 1] = True
        self.kept = [(records, index, _taken(records, index)) for records, index in (
            (s.run, np.zeros(1, int)), (s.pairs, near), (s.bodies, np.flatnonzero(bodies)), (s.pool, slot[joined]),
            (s.log, np.arange(rows)), *([] if s.ledger is None else [(s.ledger, np.zeros(1, int))]),
        )]

    def put_back(self) -> None:
        """Let the records be as they were."""
        for records, index, values in self.kept:
            if isinstance(records, list):
                for i, value in zip(index.tolist(), values, strict=True):
                    records[i] = value
            else:
                raw(records)[index] = values


def _taken(records: Any, index: Any) -> Any:
    return deepcopy([records[i] for i in index.tolist()]) if isinstance(records, list) else raw(records)[index]


def named_alike(records: Any, dtype: np.dtype[Any]) -> Any:
    """Return a copy of records with the fields of `dtype`: those that an earlier version did not have are 0, what it
    had besides is dropped."""
    if records.dtype == dtype:
        return copied(records)
    out = np.zeros(len(records), dtype)
    for name in set(records.dtype.names) & set(dtype.names or ()):
        out[name] = records[name]
    return out


def restored(s: System, state: Mapping[str, Any]) -> System:
    """Return the records of a scene as a checkpoint has them, with the limits of `s`, those of its start; raise
    `ValueError` if it cannot be one of that scene and its laws."""
    state = {name: np.asarray(value) if name in KEPT else value for name, value in state.items()}
    check(s, state)
    names = "run", "pairs", "pool", "bodies"
    run, pairs, taken, bodies = (named_alike(state[name], KEPT[name]) for name in names)
    pairs["row"][pairs["row"] >= len(state["log"])] = -1  # of contacts that are long over
    for name in ("until_pair", "until_nth", "separated", "log", "disturbing"):
        run[name] = s.run[name]
    for name, so_far in (("max_events", "begun"), ("max_steps", "steps")):
        run[name] = min(int(run[so_far][0]) + int(s.run[name][0]), NO_PAUSE)
    pool, log = empty_pool(len(taken) + SPARE), np.zeros(len(s.log) + len(state["log"]), CONTACT_ROW)
    pool[: len(taken)], log[: len(state["log"])] = taken, state["log"]
    tables = np.append(state["tables"], s.tables)
    n = len(bodies) - 1
    queue = tournament(n)
    queue["due"][len(queue) // 2 :][:n] = pairs["due"][:n]
    maps = copied(state["maps"])
    ledger = s.ledger if s.ledger is None else named_alike(state["ledger"], LEDGER)
    return s._replace(run=run, pairs=pairs, pool=pool, bodies=bodies, queue=queue, log=log, maps=maps, tables=tables,
                      ledger=ledger)

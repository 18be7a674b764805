"""Checkpoints: the state of a run from which it can be continued.

A checkpoint contains the records before the end of the run was evaluated. This evaluation changes the records, and a
continued run must not depend on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from granular._engine.records import as_bytes, column, copied, record_array
from granular.md.located.records import (
    CONTACT_TABLE_RECORD,
    ENERGY_ACCOUNT_RECORD,
    MEMBER_RECORD,
    OCTAVE_MAP_RECORD,
    SOFT_BODY_RECORD,
    SOFT_PAIR_RECORD,
    SOFT_RUN_RECORD,
)
from granular.md.located.system import System
from granular.run.contact_log import CONTACT_ROW

CHECKPOINT_RECORDS = {
    "run": SOFT_RUN_RECORD,
    "pairs": SOFT_PAIR_RECORD,
    "pool": MEMBER_RECORD,
    "bodies": SOFT_BODY_RECORD,
    "maps": OCTAVE_MAP_RECORD,
    "tables": CONTACT_TABLE_RECORD,
    "log": CONTACT_ROW,
    "ledger": ENERGY_ACCOUNT_RECORD,
}
"""Records in a checkpoint, and their types.

Of tables and log only the used part is stored. The energy balance exists only if walls are driven or thermal."""
MAX_FULL_COPY_PAIRS = 256
"""Number of pairs up to which all records are copied.

For so few pairs, selecting the records that change takes longer than copying all of them."""


class Checkpoint(Mapping[str, Any]):
    """State of a run as arrays by name.

    The arrays are created at the first access.
    """

    def __init__(self, s: System, entries: dict[str, Any]) -> None:
        """Store the records `s` and additional entries `entries`."""
        self._s: Any = s._replace(queue=None, scratch=None)
        self._arrays: dict[str, Any] = entries

    def __getitem__(self, name: str) -> Any:
        return self._made()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._made())

    def __len__(self) -> int:
        return len(self._made())

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (self._made(),)

    def _made(self) -> dict[str, Any]:
        """Return the arrays by name. The first call creates them."""
        if (s := self._s) is not None:  # another thread can create the same arrays
            used = {"tables": int(column(s.run, "tables")[0]), "log": int(column(s.run, "rows")[0])}
            records_by_name = {name: getattr(s, name) for name in CHECKPOINT_RECORDS}
            arrays = {name: record_array(records[: used.get(name, len(records))], CHECKPOINT_RECORDS[name])
                    for name, records in records_by_name.items() if records is not None}
            self._arrays, self._s = self._arrays | arrays, None
        return self._arrays


class RecordsBeforeEnd:
    """Copy of the records of a run before all pairs are advanced to its end time.

    A checkpoint contains these records. For a large run, only the records that the advance changes are copied.
    `put_back` restores them.
    """

    def __init__(self, s: System, t: float) -> None:
        """Copy the records that the advance to the end of a run changes.

        `t` is the end in s since the start of the run. For a small run, or on a ring, all records are copied.
        """
        slot, self.kept = column(s.pairs, "slot"), list[tuple[Any, Any, Any]]()
        rows = int(s.run[0]["rows"])
        if not MAX_FULL_COPY_PAIRS < len(s.pairs) < len(s.bodies):
            run, pairs, bodies, pool, log = map(_full_copy, (s.run, s.pairs, s.bodies, s.pool, s.log[:rows]))
            ledger = None if s.ledger is None else _full_copy(s.ledger)
            self.before = s._replace(run=run, pairs=pairs, bodies=bodies, pool=pool, log=log, ledger=ledger)
            return
        near, bodies = _affected_by_end(s, t)
        changed = [(s.run, slice(None)), (s.pairs, near), (s.bodies, bodies), (s.pool, slot[slot >= 0]),
                   (s.log, slice(rows)), *([] if s.ledger is None else [(s.ledger, slice(None))])]
        self.before = s._replace(queue=copied(s.queue[:1]))
        self.kept = [(records, index, _copied_at(records, index)) for records, index in changed]

    def put_back(self) -> System:
        """Restore the records and return them."""
        for records, index, values in self.kept:
            if isinstance(records, list):
                numbers = range(len(records))[index] if isinstance(index, slice) else index.tolist()
                for i, value in zip(numbers, values, strict=True):
                    records[i] = value
            else:
                as_bytes(records)[index] = values
        return self.before


def _full_copy(records: Any) -> Any:
    """Return a copy of records. For non-empty arrays it is read-only."""
    if isinstance(records, np.ndarray) and records.size:
        return np.frombuffer(records.tobytes(), records.dtype)
    return copied(records)


def _affected_by_end(s: System, t: float) -> tuple[Any, Any]:
    """Return the numbers of the pairs and bodies that the end of a run changes.

    `t` is the end in s. The pairs are in islands, in contacts that last beyond `t`, or next to such a contact.
    """
    clock, lasts, slot = (column(s.pairs, name) for name in ("t", "lasts", "slot"))
    in_contact = np.flatnonzero((lasts > 0.0) & (slot < 0) & (clock >= t * (1.0 - 1e-12)))  # with a margin for rounding
    in_island = np.flatnonzero(slot >= 0)
    pairs, bodies = np.zeros(len(slot) + 2, bool), np.zeros(len(slot) + 1, bool)  # one more pair on either side
    pairs[in_island + 1] = pairs[in_contact] = pairs[in_contact + 1] = pairs[in_contact + 2] = True
    near = np.flatnonzero(pairs[1:-1])
    bodies[near] = bodies[near + 1] = True
    return near, np.flatnonzero(bodies)


def _copied_at(records: Any, index: Any) -> Any:
    """Return a copy of the records at `index`, a slice or an array of numbers."""
    if isinstance(records, np.ndarray):
        return as_bytes(records)[index].copy()
    return copied(records[index] if isinstance(index, slice) else [records[i] for i in index.tolist()])

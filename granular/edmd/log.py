"""The contacts of a run: settled rows, from which the public log is made when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from granular._records import packed
from granular.edmd import readout
from granular.edmd.event import ROW
from granular.edmd.sorted_queue import Rows
from granular.edmd.state import State
from granular.trajectory import CONTACT

Contacts = np.ndarray[tuple[int], np.dtype[np.void]]


class Log:
    """Keep the rows of collisions, and tell of them.

    Parameters
    ----------
    keep : bool
        Whether to keep them.
    on_event : callable or None
        Called with each contact.
    """

    def __init__(self, keep: bool, on_event: Callable[[Any], object] | None) -> None:
        self.keep, self.on_event = keep, on_event
        self.chunks: list[Contacts] = []

    def new(self) -> Rows | None:
        """Return what a queue is to write chunks of rows into; None if nobody wants them."""
        return [] if self.keep or self.on_event is not None else None

    def settle(self, rows: Rows | None, state: State, fall: float) -> None:
        """Take rows that were written since the last re-basing, in a frame that falls with `fall` (m/s²)."""
        for chunk in rows or ():
            if len(chunk) == 0:
                continue
            settled = packed(chunk, ROW) if isinstance(chunk, list) else chunk
            tau = settled["time"].copy()
            settled["time"] = state.time(tau)
            if fall > 0.0:
                fallen = fall * readout.elapsed(state, tau)
                for name in ("lower_in", "upper_in", "lower_out", "upper_out"):
                    settled[name] -= fallen
            if self.keep:
                self.chunks.append(settled)
            if self.on_event is not None:
                for row in contacts([settled]):
                    self.on_event(row)


def contacts(chunks: list[Contacts]) -> Contacts:
    """Return settled rows as the public log."""
    made = np.zeros(sum(map(len, chunks)), CONTACT)
    made["force_max"] = np.nan
    end = 0
    for chunk in chunks:
        part = made[end : end + len(chunk)]
        part["pair"], part["impulse"] = chunk["pair"], chunk["impulse"]
        part["t_begin"] = part["t_end"] = chunk["time"]
        part["v_in"][:, 0], part["v_in"][:, 1] = chunk["lower_in"], chunk["upper_in"]
        part["v_out"][:, 0], part["v_out"][:, 1] = chunk["lower_out"], chunk["upper_out"]
        end += len(chunk)
    return made

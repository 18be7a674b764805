"""Count the collisions of a hard-sphere run whose soft contacts would overlap.

Each collision is replaced by a contact under a given force law. It lasts as long as an isolated contact with the same
approach speed, but at most until the next collision of its pair. The contact is disturbed if it overlaps in time with a
contact of a neighbouring pair. The count is an estimate, not a proof: disturbed contacts end differently from isolated
contacts, so soft balls move differently afterwards. The number of disturbed contacts in a soft-sphere run can therefore
differ.

Collisions are evaluated in the order of their times, independently of the engine. Times are in s since the epoch of the
state (see `granular.edmd.motion`), so late times keep their digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.kernels import RING, kernel
from granular._engine.records import Records, column
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State
from granular.laws import kinds
from granular.laws.contact_law import instance
from granular.laws.rules import different
from granular.scene import Scene

Durations = Callable[[Any, check.Array], check.Array]
LAST_CONTACT_FIELDS = np.dtype([("began", float), ("lasting", float), ("disturbed", int)], align=True)
"""Last contact of a pair.

Fields: begin (s since the epoch), duration (s), and whether it is disturbed (1) or not (0).
"""


class Watch:
    """Counter of disturbed contacts in a hard-sphere run under a force law.

    Parameters
    ----------
    law : law or sequence of laws
        One law for all pairs, or one per pair.
    scene : Scene
        Scene of the run.
    durations : callable
        ``durations(laws, scene)`` returns a function of arrays of pairs and of approach speeds in m/s. Its values are
        the durations of isolated contacts in s. See `granular.md.isolation.Durations`.
    saved : mapping, optional
        Saved state of the run to continue.

    Raises
    ------
    TypeError, ValueError
        For invalid laws.
    """

    def __init__(
        self, law: Any, scene: Scene, durations: Callable[[Any, Scene], Durations],
        saved: Mapping[str, Any] | None = None,
    ) -> None:
        laws = check.per_pair("watch", law, scene.n_pairs)
        for single_law in different(laws):
            instance("watch", single_law, "A collision rule does not determine the duration of a contact.")
        kinds.checked(laws, scene)
        self.duration = durations(laws, scene)
        self.name = scene.pairs.name
        self.last: Records = np.zeros(scene.n_pairs, LAST_CONTACT_FIELDS)
        self.last["began"] = -math.inf
        ends = zip((0, scene.n_pairs - 1), scene.thermal_walls, strict=True)
        self.instants = [c for c, wall in ends if wall is not None]
        self.epoch, self.seen, self.disturbed, self.first = (0.0, 0.0), 0, 0, (math.nan, -1)
        if saved is not None and "watch_began" in saved:
            for name in LAST_CONTACT_FIELDS.names or ():
                self.last[name] = saved[f"watch_{name}"]
            self.epoch = float(saved["epoch"]), float(saved["epoch_low"])
            self.seen, self.disturbed, pair = map(int, saved["watch_counts"])
            self.first = float(saved["watch_time"]), pair

    def take(self, rows: Any, tau: check.Array, state: State, queue: SortedQueue) -> None:
        """Process the log rows of the next collisions, in the order of time.

        `tau` are the times of the collisions in s since the epoch of `state`.
        """
        self._to_epoch(state, queue)
        pair, lasting = rows["pair"], self.duration(rows["pair"], rows["lower_in"] - rows["upper_in"])
        lasting[np.isin(pair, self.instants)] = 0.0  # thermal walls act instantaneously
        columns: list[Any] = [pair, tau, lasting]
        if isinstance(self.last, list):
            columns = [x.tolist() for x in columns]
        count, row, lower = queue.specialise(begin_contacts)(self.last, *columns)
        self.seen += len(rows)
        self.disturbed += count
        if row >= 0 and self.first[1] < 0:
            self.first = float(rows["t_begin"][row]), lower

    def _to_epoch(self, state: State, queue: SortedQueue) -> None:
        """Convert the last contacts to the epoch of the state, as records of the queue."""
        self.last = queue.convert(self.last)
        epoch, low = state.clock.epoch, state.clock.epoch_low
        shift = (epoch - self.epoch[0]) + (low - self.epoch[1])
        if shift != 0.0:
            queue.specialise(shift_epoch)(self.last, shift)
            self.epoch = epoch, low

    def stats(self) -> dict[str, Any]:
        """Return entries of ``stats``: the count, and time and pair of the first overlap."""
        return {"watched": self.disturbed, "first_disturbed": self.first}

    def message(self) -> str:
        """Return the part of the message of a run that reports the count."""
        time, pair = self.first
        pair_names = f"pairs {self.name(pair)} and {self.name((pair + 1) % len(self.last))}"
        first = f", the first at {pair_names} at t = {time:.9g} s" if self.disturbed else ""
        return (f"; watch: {self.disturbed or 'none'} of {self.seen} collisions would, as soft contacts, overlap in "
                f"time with a contact of a neighbouring pair{first} (an estimate)")

    def checkpoint(self, state: State, queue: SortedQueue) -> dict[str, Any]:
        """Return all data that are saved with a state to continue the count."""
        self._to_epoch(state, queue)
        raw: dict[str, Any] = {f"watch_{name}": column(self.last, name) for name in LAST_CONTACT_FIELDS.names or ()}
        return raw | {"watch_counts": np.array([self.seen, self.disturbed, self.first[1]]), "watch_time": self.first[0]}


@kernel
def begin_contacts(last: Records, pair: Any, began: Any, lasting: Any) -> tuple[int, int, int]:
    """Replace collisions by contacts and count the newly disturbed contacts.

    `pair`, `began` (s since the epoch) and `lasting` (s) are arrays with one entry per collision, in the order of
    time. `last` contains the last contact of each pair and is updated. Returns the number of newly disturbed contacts.
    For the first overlap it also returns the row of the later contact, and the lower one of the two pairs. Both are -1
    if no contacts overlap.
    """
    count, row, lower = 0, -1, -1
    n = len(last)
    for j in range(len(pair)):
        c, t = pair[j], began[j]
        own = last[c]
        own.began, own.lasting, own.disturbed = t, lasting[j], 0
        for side in range(c - 1 if RING else max(c - 1, 0), c + 2 if RING else min(c + 2, n)):
            k = (side + n) % n
            neighbour = last[k]
            # Both contacts count as disturbed, but each only once.
            if k != c and t - neighbour.began <= neighbour.lasting:
                count += 2 - own.disturbed - neighbour.disturbed
                own.disturbed = 1
                neighbour.disturbed = 1
                if row < 0:
                    row, lower = j, k if side < c else c
    return count, row, lower


@kernel
def shift_epoch(last: Records, shift: float) -> None:
    """Convert the times in `last` to an epoch that is `shift` s later."""
    for c in range(len(last)):
        last[c].began -= shift

"""Count the collisions of a hard-sphere run whose soft contacts would overlap.

Each collision is replaced by a contact that lasts as long as an isolated contact of a given force law at the same
approach speed, but at most until the next collision of its pair. The contact is disturbed if it overlaps in time with a
contact of a neighbouring pair. The count is a warning, not a proof: disturbed contacts end differently from isolated
contacts, so soft balls move differently afterwards. The number of disturbed contacts in a soft-sphere run can therefore
differ.

Collisions are evaluated in order as they leave the queue, independently of the engine. Times are measured from the
epoch of the state, so late times keep their digits.
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
    """Contacts of a run under a force law.

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
        State of a run to continue.

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
        for one in different(laws):
            instance("watch", one, "A collision rule does not determine the duration of a contact.")
        kinds.checked(laws, scene)
        self.duration = durations(laws, scene)
        self.name = scene.pairs.name
        self.last: Records = np.zeros(scene.n_pairs, LAST_CONTACT_FIELDS)
        self.last["began"] = -math.inf
        self.instants = [c for c, heat in zip((0, scene.n_pairs - 1), scene.heat, strict=True) if heat is not None]
        self.epoch, self.seen, self.disturbed, self.first = (0.0, 0.0), 0, 0, (math.nan, -1)
        if saved is not None and "watch_began" in saved:
            for name in LAST_CONTACT_FIELDS.names or ():
                self.last[name] = saved[f"watch_{name}"]
            self.epoch = float(saved["epoch"]), float(saved["epoch_low"])
            self.seen, self.disturbed, pair = map(int, saved["watch_counts"])
            self.first = float(saved["watch_time"]), pair

    def take(self, rows: Any, tau: check.Array, state: State, queue: SortedQueue) -> None:
        """Process the next collisions, in order; `tau` are their times since the epoch."""
        self._to_epoch(state, queue)
        pair, lasting = rows["pair"], self.duration(rows["pair"], rows["lower_in"] - rows["upper_in"])
        lasting[np.isin(pair, self.instants)] = 0.0  # thermal walls act instantaneously
        columns: list[Any] = [pair, tau, lasting]
        if isinstance(self.last, list):
            columns = [x.tolist() for x in columns]
        more, row, lower = queue.use(disturb)(self.last, *columns)
        self.seen += len(rows)
        self.disturbed += more
        if row >= 0 and self.first[1] < 0:
            self.first = float(rows["t_begin"][row]), lower

    def _to_epoch(self, state: State, queue: SortedQueue) -> None:
        """Convert times to the epoch of the state, and records to the form of the queue."""
        self.last = queue.hold(self.last)
        epoch, low = state.clock.epoch, state.clock.epoch_low
        shift = (epoch - self.epoch[0]) + (low - self.epoch[1])
        if shift != 0.0:
            queue.use(earlier)(self.last, shift)
            self.epoch = epoch, low

    def stats(self) -> dict[str, Any]:
        """Return the counters of the run."""
        return {"watched": self.disturbed, "first_disturbed": self.first}

    def message(self) -> str:
        """Return the sentence for the message of the run."""
        time, pair = self.first
        both = f"pairs {self.name(pair)} and {self.name((pair + 1) % len(self.last))}"
        first = f", the first at {both} at t = {time:.9g} s" if self.disturbed else ""
        return (f"; watch: {self.disturbed or 'none'} of {self.seen} collisions would, as soft contacts, overlap in "
                f"time with a contact of a neighbouring pair{first} (an estimate)")

    def checkpoint(self, state: State, queue: SortedQueue) -> dict[str, Any]:
        """Return all data needed to continue."""
        self._to_epoch(state, queue)
        raw: dict[str, Any] = {f"watch_{name}": column(self.last, name) for name in LAST_CONTACT_FIELDS.names or ()}
        return raw | {"watch_counts": np.array([self.seen, self.disturbed, self.first[1]]), "watch_time": self.first[0]}


@kernel
def disturb(last: Records, pair: Any, began: Any, lasting: Any) -> tuple[int, int, int]:
    """Begin contacts in the given order, and count the newly disturbed contacts.

    Returns their number, and for the first two of them the row of the later contact and the lower pair. Both are -1
    without such contacts.
    """
    more, row, lower = 0, -1, -1
    n = len(last)
    for j in range(len(pair)):
        c, t = pair[j], began[j]
        mine = last[c]
        mine.began, mine.lasting, mine.disturbed = t, lasting[j], 0
        for side in range(c - 1 if RING else max(c - 1, 0), c + 2 if RING else min(c + 2, n)):
            k = (side + n) % n
            other = last[k]
            # Both contacts count as disturbed, but each only once.
            if k != c and t - other.began <= other.lasting:
                more += 2 - mine.disturbed - other.disturbed
                mine.disturbed = 1
                other.disturbed = 1
                if row < 0:
                    row, lower = j, k if side < c else c
    return more, row, lower


@kernel
def earlier(last: Records, shift: float) -> None:
    """Convert times to an epoch that is `shift` s later."""
    for c in range(len(last)):
        last[c].began -= shift

"""Record types of hard-sphere runs, their constants, and checks of saved states.

Saved states are checked here because kernels check nothing. The terms are defined in `granular.edmd.motion`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from granular._engine.check import EDITED_STATE, MAX_INTEGER, saved_array
from granular.edmd.physics import TIE_ORDERS, Physics
from granular.scene.walls.path import WALL_DTYPE

PAIR_FIELDS = np.dtype(
    [
        ("gap", float), ("at", float),  # m, at the time `at` in s since the epoch
        ("closing_acceleration", float),  # by gravity, m/s²
        ("contacts", int), ("last", float),  # number of collisions; time (s) of the last one outside `zoom`
        ("streak", int),  # consecutive collisions that looked like a collapse
        ("low", float), ("high", float),  # fractions of a change of the rate that the lower and the upper body receive
        ("eps", float),  # if all rules are constant
    ],
    align=True,
)
BODY_FIELDS = np.dtype(
    [
        ("fall_velocity", float),  # free-fall velocity at the epoch, m/s
        ("is_free", float),  # 1 falls; 0 a wall, or a ball that rests on a wall
        ("noise", float),  # (m/s)², square of the rounding error of its fall velocity
        ("mass", float),
    ],
    align=True,
)
RELATIVE_FIELDS = np.dtype([("gap", float), ("rate", float)])
"""Gap (m) and rate (m/s) of a pair that is followed in relative coordinates."""
RUN_FIELDS = np.dtype(
    [
        ("pairs", int), ("gravity", float), ("tc", float), ("elastic_below", float), ("merge_below", float),
        ("order", int), ("seed", int),  # of simultaneous collisions
        ("now", float), ("events", int), ("zoomed", int),  # tau (s) of the last event; collisions, and those in `zoom`
        ("clamps", int), ("merged", int),  # gaps set to 0, collisions merged
        ("settled", int),  # balls brought to rest with a relative velocity below rounding
        ("gap_sum", float),  # m, sum of the gaps if it is constant, else 0
        ("edge", float), ("budget", int),  # limits of this call: tau in s, number of events
        ("stop_pair", int), ("stop_contacts", int),  # pause before this pair collides after `stop_contacts` contacts
        ("slow", float), ("short", float),  # m/s (negative: off) and s, limits of a suspected collapse
        ("suspect", int), ("rebound", float),  # pair of the last collision, and its rate after, m/s
        # relative coordinates (`zoom`)
        ("first", int), ("began", float),  # the lowest pair; the beginning, tau in s
        ("elapsed", float), ("looked", int),  # s and collisions since the beginning
        ("ordinary", int),  # consecutive collisions that did not look like a collapse
        ("clamped", int),  # gaps set to 0
        ("faint", int),  # consecutive tests that found negligible speeds
        ("room", float),  # s since the beginning: the next event outside
        ("allowance", int),  # collisions without a decision; doubled each time
    ],
    align=True,
)
"""Numbers of a run that kernels use."""
CLOCK_FIELDS = np.dtype(
    [
        ("frame", float),  # m/s, velocity of the frame of the run
        ("start", float), ("epoch", float), ("epoch_low", float),  # s: the first sample; the zero of tau
        ("length", float),  # m, mean gap at the start; with driven walls its maximum so far
        ("window", float),  # s, 2^k, grows as balls slow down
        ("speed", float), ("fall", float),  # m/s, scale of relative velocities, at least that of falling by `length`
        ("strength", float),  # m/s², the largest acceleration of a ball
        ("rebases", int), ("zooms", int), ("lost", int),  # uses of `zoom`, and rates lost to rounding in them
        ("last_event", int),  # number of events at which the run ends
        ("goal", float), ("dated", int),  # s, end time of kernels that move the zero of tau; rows with final times
    ]
)
"""Numbers of a run that kernels use only in scenes with driven walls."""
LOG_ROW = np.dtype(
    [
        ("pair", int), ("t_begin", float),
        ("lower_in", float), ("upper_in", float), ("lower_out", float), ("upper_out", float),
        ("impulse", float),
    ],
    align=True,
)
"""Row of the contact log of one collision, as kernels write it.

Fields: pair, time in s since the epoch, velocities of both bodies before and after in m/s, impulse in N s. The impulse
is stored because it does not follow from the velocities. In relative coordinates the velocities cannot represent the
change, and balls that stick together transfer more than their own momentum.
"""
Log: TypeAlias = list[Any]
"""Contact log of a run: a list of chunks of rows `LOG_ROW`.

A chunk is an array of records or a list of objects.
"""
WALL_FIELDS = np.dtype(
    [
        *((name, WALL_DTYPE[name]) for name in WALL_DTYPE.names or ()),
        ("epoch", float), ("low", float),  # s, the zero of time of the run
        ("work", float), ("work_low", float), ("lost", float), ("lost_low", float),  # J; total loss in side 0
        ("temperature", float), ("seed", int),  # J, of a thermal wall; else 0
        ("heat", float), ("heat_low", float), ("given", float), ("given_low", float),  # J and N s, transferred to balls
        ("lands", int), ("forces", int),  # of the scene: pairs rest below their noise; forces act
    ],
    align=True,
)
"""Numbers of the floor or of the ceiling that kernels use, one record per wall.

A wall whose path has no panels moves at constant speed.
"""


class Walls(NamedTuple):
    """Data for kernels in scenes with forces or with driven or thermal walls.

    In all other scenes kernels receive None.
    """

    sides: Any  # two records `WALL_FIELDS`, of the floor and of the ceiling
    panels: Any  # of the paths of both
    clock: Any  # the record `CLOCK_FIELDS`


FREE, FLOOR, CEILING = 0, 1, 2
AT_FLOOR, AT_CEILING, BOTH = range(3)
"""Values of the field `wall` of a pair next to one or both driven walls.

A pair is next to a wall if one of its bodies is this wall or rests on it. The value is -1 for any other pair.
"""


def extended_types(
    of_pair: list[tuple[str, type]], of_body: list[tuple[str, type]]
) -> tuple[np.dtype[Any], np.dtype[Any]]:
    """Return the record types of pairs and bodies with additional fields."""
    return np.dtype(PAIR_FIELDS.descr + of_pair, align=True), np.dtype(BODY_FIELDS.descr + of_body, align=True)


PLAIN_RECORDS = PAIR_FIELDS, BODY_FIELDS
FORCED_RECORDS = extended_types(
    # The driven wall next to the pair (0 floor, 1 ceiling, 2 both, -1 none); 0 free, 1 or 2 stuck while its bodies rest
    # on the floor or the ceiling; time (s) from `at` to its next hit; the thermal wall next to it (-1 none).
    [("wall", int), ("stuck", int), ("wait", float), ("heat", int)],
    # m/s², by all forces, and by its own force alone.
    [("force_acceleration", float), ("own_acceleration", float)],
)
PENDULUM_RECORDS = extended_types(
    [("rate", float), ("rest", float), ("omega", float)],  # m/s, at `at`; m, gap at rest; Ω in rad/s
    # Ω times the displacement at time 0, extrapolated without the later collisions (m/s), and Ω.
    [("sway", float), ("omega", float)],
)
"""Record types of pairs and bodies, by the kind of the scene.

`FORCED_RECORDS` is for scenes with forces or with driven or thermal walls, `PENDULUM_RECORDS` for pendula, and
`PLAIN_RECORDS` for all other scenes.
"""
NEVER, APART, EACH = -1, -2, -3
"""Special values of `stop_pair`, otherwise the pair of the stop condition.

`NEVER`: the run does not stop at a contact. `APART`: the run stops when no pair approaches. `EACH`: the run pauses
after every event.
"""
LATER, UNTIL, BUDGET, SUSPECT, TOUCHING, OUTSIDE, QUIET, RESTS, TINY, SPENT = range(10)
"""Reasons why an event queue, or the kernel `zoom`, pauses.

* `LATER`: the next event is later than the requested time.
* `UNTIL`: the stop condition is met. The next event is the contact at which the run stops, or no pair approaches.
* `BUDGET`: the requested number of events has been processed.
* `SUSPECT` (queue): the last collisions look like an inelastic collapse.
* `TOUCHING` (queue): the next event is a collision in a touching group, which is solved as a whole.
* `OUTSIDE` (`zoom`): the next event is outside the slice.
* `QUIET` (`zoom`): the collisions do not lead to a collapse.
* `RESTS` (`zoom`): a ball has come to rest on a wall.
* `TINY` (`zoom`): a rate is below 2^-200 of the speed scale.
* `SPENT` (`zoom`): the allowed number of collisions has been processed without a decision.

The last five values end the use of relative coordinates.
"""
SAVED_NUMBERS = {"start": "f", "epoch": "f", "epoch_low": "f", "now": "f", "length": "f", "window": "f", "speed": "f",
           "fall": "f", "short": "f", "events": "i", "rebases": "i", "zooms": "i", "zoomed": "i", "allowance": "i",
           "tc": "f", "elastic_below": "f", "merge_below": "f", "seed": "i"}
"""Names and kinds of the numbers in a saved state ("f" float, "i" integer).

All numbers except `SIGNED_NUMBERS` must not be negative.
"""
SIGNED_NUMBERS = ("start", "epoch", "epoch_low", "now")
ENTRY_LIMITS = {
    "gap": (0.0, math.inf),
    "contacts": (0, MAX_INTEGER),
    "streak": (0, MAX_INTEGER),
    "last": (-math.inf, math.inf),
    "wall": (-1, 2),
    "stuck": (0, 2),
    "is_free": (0.0, 1.0),
    "noise": (0.0, math.inf),
}
"""Smallest and largest valid entry of arrays of pairs or bodies in a saved state.

Arrays that are not listed can have any finite entries.
"""
INTEGER_ARRAYS = ("contacts", "streak", "wall", "stuck")
OPTIONAL_ARRAYS = ("noise",)
"""Names of arrays that earlier releases did not save."""
PRESENT_NAMES = {"u": "fall_velocity", "falls": "is_free", "pull": "closing_acceleration", "push": "force_acceleration",
           "hits": "contacts", "shut": "stuck"}
"""Current names of saved arrays by the names that earlier releases used."""


def check_numbers(saved: Mapping[str, Any], physics: Physics) -> None:
    """Raise `ValueError` if a number or option of a saved state is invalid.

    Each number must be present, have its kind and be within its limits.
    """
    for name, kind in SAVED_NUMBERS.items():
        # Balls that stick at any speed have an infinite limit.
        infinite = name == "merge_below" and physics.eps.max() == 0.0
        saved_array(saved, name, kind, (), least=-math.inf if name in SIGNED_NUMBERS else 0, finite=not infinite)
    # Earlier releases saved three counters.
    saved_array(saved, "tally", "i", (4 if np.size(saved.get("tally", 0)) == 4 else 3,), least=0)
    if not isinstance(saved.get("ties"), str) or saved["ties"] not in TIE_ORDERS:
        raise ValueError(f"'ties' in the state of `trajectory` must be one of {', '.join(TIE_ORDERS)}. {EDITED_STATE}")
    if math.frexp(saved["window"])[0] != 0.5:
        raise ValueError(f"'window' in the state of `trajectory` must be a power of two, got {saved['window']!r}. "
                         f"{EDITED_STATE}")


def check_entries(
    saved: Mapping[str, Any], physics: Physics, of_pairs: tuple[str, ...], of_bodies: tuple[str, ...]
) -> None:
    """Raise `ValueError` if an array of pairs or bodies in a saved state is invalid.

    `of_pairs` and `of_bodies` are the names of the arrays. The entries of relative coordinates and of `watch` are
    checked as well, if the state contains them.
    """
    n = physics.scene.n_pairs
    for length, names in ((n, of_pairs), (n + 1, of_bodies)):
        for name in names:
            if name in saved or name not in OPTIONAL_ARRAYS:
                smallest, largest = ENTRY_LIMITS.get(name, (-math.inf, math.inf))
                kind = "i" if name in INTEGER_ARRAYS else "f"
                saved_array(saved, name, kind, (length,), smallest, largest, finite=name != "last")
    _check_slice(saved, n, physics.scene.ring)
    _check_watch(saved, n)


def _check_slice(saved: Mapping[str, Any], n: int, ring: bool) -> None:
    """Raise `ValueError` if saved entries of relative coordinates are invalid.

    `n` is the number of pairs. A state without such entries is valid.
    """
    if not any(name.startswith("zoom_") for name in saved):
        return
    gap_shape = np.shape(saved.get("zoom_gap", 0))
    max_pairs = n if ring else n - int(saved_array(saved, "zoom_first", "i", (), 0, n - 1))
    if len(gap_shape) != 1 or not 0 < gap_shape[0] <= max_pairs:
        raise ValueError(f"'zoom_gap' in the state of `trajectory` must have 1 to {max_pairs} pairs, got shape "
                         f"{gap_shape}. {EDITED_STATE}")
    saved_array(saved, "zoom_first", "i", (), 0, n - 1)
    dial_shape = (min(np.size(saved.get("zoom_dial", 0)), 5),)
    for name, shape, smallest in (("base", (), -math.inf), ("gap", gap_shape, 0.0), ("rate", gap_shape, -math.inf),
                               ("dial", dial_shape, 0.0)):
        saved_array(saved, f"zoom_{name}", "f", shape, smallest)


def _check_watch(saved: Mapping[str, Any], n: int) -> None:
    """Raise `ValueError` if saved entries of `watch` are invalid.

    `n` is the number of pairs. A state without such entries is valid.
    """
    if any(name.startswith("watch_") for name in saved):
        tables: list[tuple[str, str, tuple[int, ...], dict[str, Any]]] = [
            ("began", "f", (n,), {"finite": False}), ("lasting", "f", (n,), {"finite": False}),
            ("disturbed", "i", (n,), {"least": 0, "most": 1}), ("counts", "i", (3,), {"least": -1}),
            ("time", "f", (), {"finite": False, "nan": True})]
        for name, kind, shape, limits in tables:
            saved_array(saved, f"watch_{name}", kind, shape, **limits)

"""What a run of hard spheres knows of pairs, bodies and itself: records with names; why a queue hands control back.

Whether a saved state can be that of a run of some physics is asked before kernels, which check nothing, go on with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from granular._engine.check import LARGEST, held
from granular.edmd.physics import ORDER, Physics
from granular.scene.walls.path import WALL

PAIR = np.dtype(
    [
        ("gap", float), ("at", float),  # m, at that time in s since the epoch
        ("closing_acceleration", float),  # by gravity, m/s²
        ("contacts", int), ("last", float),  # collisions so far, and the time of the last not looked at closely in s
        ("streak", int),  # how often a collision in a row looked like a collapse
        ("low", float), ("high", float),  # shares of the lower and the upper body in a change of the rate
        ("eps", float),  # where rules are constant
    ],
    align=True,
)
BODY = np.dtype(
    [
        ("fall_velocity", float),  # free-fall velocity of the epoch, m/s
        ("is_free", float),  # 1 falls; 0 a wall, or a ball that rests on a wall
        ("noise", float),  # (m/s)², square of what rounding may have left in its fall velocity
        ("mass", float),
    ],
    align=True,
)
NEAR = np.dtype([("gap", float), ("rate", float)])
"""Gap and rate of a pair that is looked at closely, m and m/s."""
RUN = np.dtype(
    [
        ("pairs", int), ("gravity", float), ("tc", float), ("elastic_below", float), ("merge_below", float),
        ("order", int), ("seed", int),  # of ties
        ("now", float), ("events", int), ("zoomed", int),  # tau of the last event; collisions, those in closer looks
        ("clamps", int), ("merged", int),  # gaps set to 0, collisions merged
        ("settled", int),  # balls brought to rest because their relative velocity was rounding
        ("gap_sum", float),  # m, the sum of the gaps where it never changes, else 0
        ("edge", float), ("budget", int),  # until when to go now, and for how many events at most
        ("stop_pair", int), ("stop_contacts", int),  # pause before this pair, which has collided so often, does again
        ("slow", float), ("short", float),  # what looks like a collapse, m/s (< 0: nothing does) and s
        ("suspect", int), ("rebound", float),  # the pair that collided last, in a closer look too; its rate after, m/s
        # a closer look
        ("first", int), ("began", float),  # the lowest pair; when it began, tau in s
        ("elapsed", float), ("looked", int),  # s and collisions since then
        ("ordinary", int),  # collisions in a row that did not look like a collapse
        ("clamped", int),  # gaps set to 0
        ("faint", int),  # how often in a row its speeds were found to count for nothing
        ("room", float),  # s since it began: when something outside happens
        ("allowance", int),  # collisions without a decision; doubled after each such look
    ],
    align=True,
)
"""Numbers that kernels know."""
CLOCK = np.dtype(
    [
        ("frame", float),  # m/s, to which velocities are relative
        ("start", float), ("epoch", float), ("epoch_low", float),  # s: the first row; the zero of tau
        ("length", float),  # m, the mean gap at the start, the largest so far if driven
        ("window", float),  # s, 2^k, grows as balls slow down
        ("speed", float), ("fall", float),  # m/s, scale of relative velocities, never below what falling `length` gives
        ("strength", float),  # m/s², the largest acceleration of a ball
        ("rebases", int), ("zooms", int), ("lost", int),  # closer looks, and rates lost to rounding in them
        ("last_event", int),  # events at which the run ends
        ("goal", float), ("dated", int),  # s: until when kernels move the zero of tau themselves; rows they have dated
    ]
)
"""Numbers that they do not."""
ROW = np.dtype(
    [
        ("pair", int), ("t_begin", float),
        ("lower_in", float), ("upper_in", float), ("lower_out", float), ("upper_out", float),
        ("impulse", float),
    ],
    align=True,
)
"""What is kept of a collision: pair, time in s since the epoch, velocities before and after in m/s, impulse in N s.

The impulse is no function of the others: in a closer look velocities cannot hold the change, and balls that stick
together pass on more than their own."""
Log: TypeAlias = list[Any]
"""The log: chunks of records `ROW`, as arrays or as lists of plain objects."""
SIDE = np.dtype(
    [
        *((name, WALL[name]) for name in WALL.names or ()),
        ("epoch", float), ("low", float),  # s, the zero of times of the run
        ("work", float), ("work_low", float), ("lost", float), ("lost_low", float),  # J: done by it; of all, in side 0
        ("temperature", float), ("seed", int),  # J, of a thermal wall; else 0
        ("heat", float), ("heat_low", float), ("given", float), ("given_low", float),  # J and N s, given to balls
        ("lands", int), ("forces", int),  # of the scene: touching pairs come to rest by rounding; forces act
    ],
    align=True,
)
"""What kernels know of the floor and of the ceiling, one record each; no panels: it moves at constant speed."""


class Walls(NamedTuple):
    """Where walls are driven or thermal, or forces act, what kernels know of them; else there is None."""

    sides: Any  # two records `SIDE`, of the floor and of the ceiling
    panels: Any  # of the paths of both
    clock: Any  # the record of the run


FREE, FLOOR, CEILING = 0, 1, 2
AT_FLOOR, AT_CEILING, BOTH = range(3)
"""`wall` of a pair beside a driven floor, a driven ceiling, or between what rests on both; -1 of any other."""


def more(of_pair: list[tuple[str, type]], of_body: list[tuple[str, type]]) -> tuple[np.dtype[Any], np.dtype[Any]]:
    """Return the records of pairs and bodies with more fields."""
    return np.dtype(PAIR.descr + of_pair, align=True), np.dtype(BODY.descr + of_body, align=True)


PLAIN = PAIR, BODY
OF_FORCED = more(
    # beside which driven wall it is (0 floor, 1 ceiling, 2 both, -1 neither); 0 free, 1 or 2 stuck for as long as its
    # bodies rest on the floor or the ceiling; the time (s) from `at` to its next hit; beside which thermal wall it is
    [("wall", int), ("stuck", int), ("wait", float), ("heat", int)],
    # m/s², by forces, and by its own force if nothing holds it
    [("force_acceleration", float), ("own_acceleration", float)],
)
OF_HUNG = more(
    [("rate", float), ("rest", float), ("omega", float)],  # m/s, at the time `at`; m, its gap at rest; Ω in rad/s
    # Ω times its displacement when it was time 0, had there been no collision since (m/s), and Ω
    [("sway", float), ("omega", float)],
)
"""Records of pairs and of bodies: of plain scenes, of those with forces, driven or thermal walls, and of pendula."""
NEVER, APART, EACH = -1, -2, -3
"""`stop_pair` of a run that does not stop at a contact; of one that stops when no pair approaches; of one that pauses
after every event."""
LATER, UNTIL, BUDGET, SUSPECT, TOUCHING, OUTSIDE, QUIET, RESTS, TINY, SPENT = range(10)
"""Why a queue or a closer look hands control back. The next event is later than asked for; it is the contact to stop
at, or all pairs recede; as many events as asked for have acted. Of a queue: the last collisions look like a collapse;
a touching group is to collide as a whole. Of a closer look, for good: something outside the slice comes next; no
collapse; a ball has come to rest on a wall; rates below 2^-200 of the scale; no decision within the allowance."""
NUMBERS = {"start": "f", "epoch": "f", "epoch_low": "f", "now": "f", "length": "f", "window": "f", "speed": "f",
           "fall": "f", "short": "f", "events": "i", "rebases": "i", "zooms": "i", "zoomed": "i", "allowance": "i",
           "tc": "f", "elastic_below": "f", "merge_below": "f", "seed": "i"}
"""Numbers that are saved, and their kinds; of those from `length` on none is negative."""
ANY = ("start", "epoch", "epoch_low", "now")
ENTRIES = {"gap": (0.0, math.inf), "contacts": (0, LARGEST), "streak": (0, LARGEST), "last": (-math.inf, math.inf),
           "wall": (-1, 2), "stuck": (0, 2), "is_free": (0.0, 1.0), "noise": (0.0, math.inf)}
"""Least and largest entry of an array of pairs or bodies; others are any finite numbers."""
WHOLE = ("contacts", "streak", "wall", "stuck")
ADDED = ("noise",)
"""What releases before it did not save."""
RENAMED = {"u": "fall_velocity", "falls": "is_free", "pull": "closing_acceleration", "push": "force_acceleration",
           "hits": "contacts", "shut": "stuck"}
"""What releases before called what is saved."""


def check_numbers(saved: Mapping[str, Any], physics: Physics) -> None:
    """Raise `ValueError` unless `saved` has all numbers of a state and its options, each of its kind and its limits."""
    for name, kind in NUMBERS.items():
        infinite = name == "merge_below" and physics.eps.max() == 0.0
        held(saved, name, kind, (), least=-math.inf if name in ANY else 0, finite=not infinite)
    held(saved, "tally", "i", (4 if np.size(saved.get("tally", 0)) == 4 else 3,), least=0)
    if not isinstance(saved.get("ties"), str) or saved["ties"] not in ORDER:
        raise ValueError(f"state of trajectory has no rule for ties: one of {', '.join(ORDER)} is needed.")
    if math.frexp(saved["window"])[0] != 0.5:
        raise ValueError(f"window in the state of trajectory is {saved['window']!r}: a power of two is needed.")


def check_entries(
    saved: Mapping[str, Any], physics: Physics, of_pairs: tuple[str, ...], of_bodies: tuple[str, ...]
) -> None:
    """The same of the arrays of pairs and bodies, by these names, and of what is looked at closely or watched."""
    n = physics.scene.n_pairs
    for length, names in ((n, of_pairs), (n + 1, of_bodies)):
        for name in names:
            if name in saved or name not in ADDED:
                least, most = ENTRIES.get(name, (-math.inf, math.inf))
                held(saved, name, "i" if name in WHOLE else "f", (length,), least, most, finite=name != "last")
    _check_look(saved, n, physics.scene.ring)
    _check_watch(saved, n)


def _check_look(saved: Mapping[str, Any], n: int, ring: bool) -> None:
    """The same of a closer look, if there is one."""
    if not any(name.startswith("zoom_") for name in saved):
        return
    size = np.shape(saved.get("zoom_gap", 0))
    most = n if ring else n - int(held(saved, "zoom_first", "i", (), 0, n - 1))
    if len(size) != 1 or not 0 < size[0] <= most:
        raise ValueError(f"zoom_gap in the state of trajectory has shape {size}: 1 to {most} pairs are needed.")
    held(saved, "zoom_first", "i", (), 0, n - 1)
    dial = (min(np.size(saved.get("zoom_dial", 0)), 5),)
    for name, shape, least in (("base", (), -math.inf), ("gap", size, 0.0), ("rate", size, -math.inf),
                               ("dial", dial, 0.0)):
        held(saved, f"zoom_{name}", "f", shape, least)


def _check_watch(saved: Mapping[str, Any], n: int) -> None:
    """The same of what has been watched, if anything has."""
    if any(name.startswith("watch_") for name in saved):
        tables: list[tuple[str, str, tuple[int, ...], dict[str, Any]]] = [
            ("began", "f", (n,), {"finite": False}), ("lasting", "f", (n,), {"finite": False}),
            ("disturbed", "i", (n,), {"least": 0, "most": 1}), ("counts", "i", (3,), {"least": -1}),
            ("time", "f", (), {"finite": False, "nan": True})]
        for name, kind, shape, limits in tables:
            held(saved, f"watch_{name}", kind, shape, **limits)

"""What the engine knows about each pair and body, as records with names.

Compiled code reads one numpy record per pair, ``pairs[c].xi``; interpreted code reads plain objects with the same
fields, so one source serves both. A pair in free flight needs little, and most pairs of a gas fly: what an island
needs of a pair, above all its power series, is a record in the `pool`, taken when the pair joins the island and given
back when it leaves, ``pool[pairs[c].slot]``.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._records import packed, plain
from granular._roots import DEEPEST, workspace
from granular._tournament import NODE, tournament
from granular.md.rows import CONTACT_ROW

ORDER = 20
"""Order of the power series of a step."""
ROW = ORDER + 1
PADDED = ORDER + 8 - ORDER % 8
MIRROR = ORDER + PADDED
"""Lengths of rows: of series; of factors of products, whole blocks of eight; of factors written backwards."""

OPEN, ACTIVE, RESIDUAL, DORMANT = range(4)
"""Modes of a pair: ξ ≤ 0; F > 0; ξ > 0 with F clipped at 0; touching at rest, with a force still below rounding."""

LINEAR, ELASTIC, DAMPED, GENERAL = range(4)
"""Kinds of law: kξ + γη; kξ^p; ξ^d (kξ^s + γη); any other, as a function."""

STEEPEST = 16.0
"""Largest q·p of a power law that a start series of order 20 can show."""

FREE = 0
"""Clock of a pair in free flight; an island has the clock t = (hτ)^q with its q = 1, 2, 3 or 4."""

ROOM = 32
"""Places in the pool of a run, beyond those taken from the start."""

KIND = np.dtype(
    [
        ("kind", int), ("q", int), ("memory", int),  # ξ^(1/q) is what the force is analytic in
        ("k", float), ("gamma", float), ("p", float), ("d", float), ("s", float),
    ],
    align=True,
)  # fmt: skip
"""A law as the pairs of one kind have it."""
PAIR = np.dtype(
    [
        ("xi", float), ("eta", float),  # overlap (negative: gap), m, and its rate, m/s
        ("pull", float),  # closing acceleration by gravity, m/s²
        ("t", float), ("tail", float),  # it has them at time t + tail
        ("wait", float), ("due", float),  # time in s to the next event of its flight; when the piece of its block ends
        ("noise", float),  # what the rounding of steps may have left in the rate so far, m/s
        ("wake", float),  # overlap at which it became active when it was last dormant
        ("stride", float),  # last step of its block on the plain clock
        ("shared", float),  # impulse of all contacts so far that was exchanged while a neighbouring pair was active
        ("first", np.int32), ("hi", np.int32),  # first pair of the block it is in; end of the block that it starts
        ("slot", np.int32), ("kind_of", np.int32),  # its places in the pool, -1 in free flight, and among the kinds
        ("count", np.int32), ("mode", np.int8), ("exact", np.int8), ("what", np.int8),
    ],
    align=True,
)  # fmt: skip
"""What is kept of every pair; state and mode are those of the last flight while it is in an island. `due` is inf if it
does not start a block."""

_LAW = [("lower", float), ("upper", float), ("inverse", float), ("pull", float), *KIND.descr]
"""Inverse masses, 1/kg, and their sum; pull and law as above."""
_STATE = [
    ("xi", float), ("eta", float), ("mode", int), ("noise", float),
    ("exact", int),  # an event has just found φ = 0: keep it exactly so
    ("own_speed", float), ("own_length", float),  # scales of its motion, m/s and m
    ("wake", float),  # overlap at which a dormant pair becomes active
    ("top", float), ("loading", int),  # largest overlap so far, for laws with memory
]  # fmt: skip
_BLOCK = [  # of the island that starts with this pair
    ("clock", int), ("linear", int), ("t", float), ("tail", float),  # its time is t + tail
    ("wait", float), ("h", float), ("tau", float),  # length of the piece in s, its scale, its end in τ
    ("fired", int), ("what", int),  # the pair whose event ends it, and which event
    ("speed", float), ("length", float), ("stride", float),  # scales of the motion; last step on the plain clock
]  # fmt: skip
_CONTACT = [  # the contact that is going on
    ("begun", int), ("begin", float), ("lasted", float), ("lower_in", float), ("upper_in", float),
    ("xi_max", float), ("force_max", float), ("impulse", float),
]  # fmt: skip
_SERIES = [
    *((name, float, (ROW,)) for name in ("x", "e", "f", "g")),
    *((name, float, (PADDED,)) for name in ("r", "z")),
    *((name, float, (MIRROR,)) for name in ("gm", "rm", "zm")),
]
"""Coefficients in τ of overlap, rate, force, bracket φ; of the powers r = ξ^d and z = ξ^s; mirrors of φ, r and z."""

MEMBER = np.dtype([*_LAW, *_STATE, *_BLOCK, *_CONTACT, ("spare", int), *_SERIES], align=True)
"""A pair in an island. `spare` of record i of the pool is the i-th place, of which the first ones are taken."""
BODY = np.dtype(
    [("inverse_mass", float), ("fall", float), ("v", float), ("t", float), ("tail", float)], align=True
)  # fmt: skip
"""Inverse mass, downward acceleration, and the velocity the body had at time t + tail."""
RUN = np.dtype(
    [
        ("pairs", int), ("tol", float), ("members", int),
        ("t", float), ("tail", float), ("lo", int), ("hi", int), ("stride", float), ("waits", int),
        ("events", int), ("steps", int), ("max_events", int), ("max_steps", int), ("pause", int), ("error", float),
        ("until_pair", int), ("until_nth", int), ("separated", int),
        ("log", int), ("rows", int), ("begun", int),
        ("piled", int), ("load", float), ("energy", float), ("opening", float), ("barrier", float), ("rests", int),
    ],
    align=True,
)  # fmt: skip
"""Counters, limits and stop conditions of one run; places taken in the pool; of the event under way time, pairs
lo … hi-1 that it concerns, stride of its block, and whether it waits for room; the pile and the load on it in N."""

NO_PAUSE = np.iinfo(np.int64).max
"""`pause` of a run that need not stop on its way to be looked at."""

LOG_ROWS, MOST_ROWS = 256, 4096
"""Rows of the log buffer: twice as many as pairs, but within these limits."""

System = namedtuple("System", "run pairs pool kinds bodies queue log work")
"""All of a run: records (`run` has one), tournament tree of blocks, log buffer, scratch of the root finder."""


def to_plain(s: System) -> System:
    """Return the run for interpreted code."""
    return System._make([*map(plain, s[:-1]), workspace(ORDER)])


def to_compiled(s: System) -> System:
    """Return the run for compiled code: same numbers, same bits."""
    records = map(packed, s[:-1], (RUN, PAIR, MEMBER, KIND, BODY, NODE, CONTACT_ROW))
    return System._make([*records, np.array(s.work)])


def new_system(n_pairs: int, n_kinds: int, room: int) -> System:
    """Return empty records for a scene, with `room` places in the pool at most."""
    pairs, bodies, kinds = np.zeros(n_pairs, PAIR), np.zeros(n_pairs + 1, BODY), np.zeros(n_kinds, KIND)
    pairs["due"], pairs["slot"] = math.inf, -1
    log = np.zeros(min(max(LOG_ROWS, 2 * n_pairs), MOST_ROWS), CONTACT_ROW)
    run = np.zeros(1, RUN)
    run["pause"] = NO_PAUSE
    pool, queue = empty_pool(min(room, n_pairs)), tournament(n_pairs)
    return System(run, pairs, pool, kinds, bodies, queue, log, np.zeros((DEEPEST + 1, ORDER + 2)))


def empty_pool(room: int) -> np.ndarray[Any, Any]:
    """Return a pool of which no place is taken."""
    pool = np.zeros(room, MEMBER)
    pool["spare"] = np.arange(room)
    return pool


def with_more_room(s: System) -> System:
    """Return the run with a pool of twice the size; all of its places were taken."""
    taken = len(s.pool)
    pool = empty_pool(2 * taken)
    if isinstance(s.pool, list):
        return s._replace(pool=s.pool + plain(pool[taken:]))
    pool[:taken] = s.pool
    return s._replace(pool=pool)

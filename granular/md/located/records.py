"""What the engine knows about each pair and body, as records with names: see `granular._records`."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from granular._records import packed, plain
from granular._roots import workspace
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
"""Clock of a pair in free flight; a block of touching pairs has the clock t = (hτ)^q with its q = 1, 2, 3 or 4."""

_LAW = [
    ("lower", float), ("upper", float), ("inverse", float),  # inverse masses, 1/kg, and their sum
    ("pull", float),  # closing acceleration by gravity, m/s²
    ("kind", int), ("q", int),  # ξ^(1/q) is what the force is analytic in
    ("k", float), ("gamma", float), ("p", float), ("d", float), ("s", float),
    ("m_eff", float), ("r_eff", float), ("index", int), ("memory", int),
]  # fmt: skip
_STATE = [
    ("xi", float), ("eta", float),  # overlap (negative: gap), m, and its rate, m/s
    ("mode", int),
    ("noise", float),  # what the rounding of steps may have left in the rate so far, m/s
    ("exact", int),  # an event has just found φ = 0: keep it exactly so
    ("own_speed", float), ("own_length", float),  # scales of its motion, m/s and m
    ("wake", float),  # overlap at which a dormant pair becomes active
    ("load", float), ("rest", float),  # force in N and overlap in m in the static equilibrium of a pile
    ("top", float), ("loading", int),  # largest overlap so far, for laws with memory
]  # fmt: skip
_BLOCK = [  # of the block that starts with this pair; `first` is the start of the block a pair is in
    ("hi", int), ("first", int), ("clock", int), ("linear", int), ("t", float), ("tail", float),  # its time is t + tail
    ("due", float),  # time of the end of its present piece; inf if this pair does not start a block
    ("wait", float), ("h", float), ("tau", float),  # length of the piece in s, its scale, its end in τ
    ("fired", int), ("what", int),  # the pair whose event ends it, and which event
    ("speed", float), ("length", float), ("stride", float),  # scales of the motion; last step on the plain clock
]  # fmt: skip
_CONTACT = [  # the contact that is going on
    ("count", int), ("begun", int), ("begin", float), ("lasted", float), ("lower_in", float), ("upper_in", float),
    ("xi_max", float), ("force_max", float), ("impulse", float),
    ("shared", float),  # impulse of all contacts so far that was exchanged while a neighbouring pair was active
]  # fmt: skip
_SERIES = [
    *((name, float, (ROW,)) for name in ("x", "e", "f", "g")),
    *((name, float, (PADDED,)) for name in ("r", "z")),
    *((name, float, (MIRROR,)) for name in ("gm", "rm", "zm")),
]
"""Coefficients in τ of overlap, rate, force, bracket φ; of the powers r = ξ^d and z = ξ^s; mirrors of φ, r and z."""

PAIR = np.dtype(_LAW + _STATE + _BLOCK + _CONTACT + _SERIES, align=True)
BODY = np.dtype(
    [("inverse_mass", float), ("fall", float), ("v", float), ("t", float), ("tail", float)], align=True
)  # fmt: skip
"""Inverse mass, downward acceleration, and the velocity the body had at time t + tail."""
RUN = np.dtype(
    [
        ("pairs", int), ("tol", float), ("t", float),
        ("events", int), ("steps", int), ("max_events", int), ("max_steps", int), ("pause", int), ("error", float),
        ("until_pair", int), ("until_nth", int), ("separated", int),
        ("log", int), ("rows", int), ("begun", int),
        ("piled", int), ("energy", float), ("opening", float), ("barrier", float), ("rests", int),
    ],
    align=True,
)  # fmt: skip
"""Counters, limits and stop conditions of one run."""

NO_PAUSE = np.iinfo(np.int64).max
"""`pause` of a run that need not stop on its way to be looked at."""

LOG_ROWS = 256

System = namedtuple("System", "run pairs bodies queue log work")
"""All of a run: records (`run` has one), tournament tree of blocks, log buffer, scratch of the root finder."""


def to_plain(s: System) -> System:
    """Return the run for interpreted code."""
    return System._make([*map(plain, s[:-1]), workspace(ORDER)])


def to_compiled(s: System) -> System:
    """Return the run for compiled code: same numbers, same bits."""
    return System(
        packed(s.run, RUN), packed(s.pairs, PAIR), packed(s.bodies, BODY), packed(s.queue, NODE),
        packed(s.log, CONTACT_ROW), np.array(s.work),
    )  # fmt: skip


def new_system(n_pairs: int) -> System:
    """Return empty records for a scene of `n_pairs` pairs."""
    pairs, bodies = np.zeros(n_pairs, PAIR), np.zeros(n_pairs + 1, BODY)
    pairs["due"] = math.inf
    log = np.zeros(max(LOG_ROWS, 2 * n_pairs), CONTACT_ROW)
    run = np.zeros(1, RUN)
    run["pause"] = NO_PAUSE
    return System(run, pairs, bodies, tournament(n_pairs), log, np.array(workspace(ORDER)))

"""What the engine knows about each pair and body: records with names, and the words for modes, kinds and events.

Compiled code reads one numpy record per pair, ``pairs[c].xi``; interpreted code reads plain objects with the same
fields, so one source serves both. A pair in free flight needs little, and most pairs of a gas fly: what an island
needs of a pair, above all its power series, is a record in the `pool`, taken when the pair joins the island and given
back when it leaves, ``pool[pairs[c].slot]``.
"""

from __future__ import annotations

import math

import numpy as np

ORDER = 20
"""Order of the power series of a step."""
ROW = ORDER + 1
PADDED = ORDER + 8 - ORDER % 8
MIRROR = ORDER + PADDED
"""Lengths of rows: of series; of factors of products, whole blocks of eight; of factors written backwards."""
OPEN, ACTIVE, RESIDUAL, DORMANT, STRUCK = range(5)
"""Modes of a pair: ξ ≤ 0; F > 0; ξ > 0 with F clipped at 0; touching at rest, with a force still below rounding; at a
thermal wall that is about to throw the ball back."""
LINEAR, ELASTIC, DAMPED, GENERAL = range(4)
"""Kinds of law: kξ + γη; kξ^p; ξ^d (kξ^s + γη); any other, as a function."""
NO_MAP, DASHPOT, SELF_SIMILAR, VISCOELASTIC = range(4)
"""How an isolated contact is known at its onset: see `maps`."""
MOVES, LIES, CREEPS, ASKS, LOOKED = range(5)
"""Manners in which a block is followed: by its equation of motion; lying still; creeping, see `overdamped`; not yet,
for it is to be looked at whether it creeps; by its equation of motion, after that look."""
LONG = 2.0**300
"""Scale in s of the piece of a pile that is still: longer than any run."""
NOTHING, BEGIN, END, PART, TURN, RELOAD, EDGE = range(7)
"""Events of a pair, see `pieces`."""
REACHED, MORE, STOPPED, QUIET, WORK_LIMIT, REST, BINDING, CRAMPED, WANTS_TABLE, WANTS_CONTACT, WANTS_LOOK = range(11)
"""Why `advance` returned: time limit, chunk done or log full, stop condition, nothing can follow, work limit,
every ball rests for good, every ball is bound in contact forever, no room in the pool, a table of
contacts, a contact alone, or a look at a block that may rest or creep is wanted first."""
EXTEND, DONE, BY_PIECES, GOES_ON = 11, 12, 13, 14
"""What comes next, within `advance`: blocks are formed anew, of one more than is known; nothing, for what was due has
happened; the contact that is due is followed piece by piece; an island goes on with its next piece."""
LARGEST_Q = 4
STEEPEST = 16.0
"""Largest q of the clock t = (hτ)^q, and largest q·p of a power law, that a start series of order 20 can show."""
SPARE = 1
"""Places in the pool kept free, for a look inside a contact."""
ROOM = 32
"""Places in the pool of a run, beyond those taken from the start."""
KIND = np.dtype(
    [
        ("kind", int), ("q", int), ("memory", int),  # ξ^(1/q) is what the force is analytic in
        ("k", float), ("gamma", float), ("p", float), ("d", float), ("s", float),
        ("elastic", int), ("map", int),  # the map of its isolated contacts without pull
        *((name, float) for name in ("force_ends", "parts", "restitution", "deepest", "strongest")),
    ],
    align=True,
)
"""A law as the pairs of one kind have it; at last the `Shape` of its contacts where they have one: see `power_form`."""
PAIR = np.dtype(
    [
        ("xi", float), ("eta", float),  # overlap (negative: gap), m, and its rate, m/s
        ("pull", float),  # closing acceleration by gravity, m/s²
        ("t", float), ("tail", float),  # it has them at time t + tail
        ("wait", float), ("due", float),  # time in s to the next event of its flight; when the piece of its block ends
        ("noise", float),  # what the rounding of steps may have left in the rate so far, m/s
        ("wake", float),  # overlap at which it became active when it was last dormant
        ("last_step", float),  # of its block, on the plain clock
        ("lasts", float), ("speed", float),  # of a contact solved at once: see `one_contact.meet`
        ("first", np.int32), ("hi", np.int32),  # first pair of the block it is in; end of the block that it starts
        ("slot", np.int32), ("kind_of", np.int32),  # its places in the pool, -1 in free flight, and among the kinds
        ("row", np.int32),  # of its last contact solved at once, in the log buffer
        ("contacts", np.int32), ("isolated", np.int16),  # so far; undisturbed ones since it was open, or `DISTURBED`
        ("map", np.int8), ("mode", np.int8), ("exact", np.int8), ("event", np.int8),  # map: place of its tables, or -1
        ("ahead", np.int8),  # its clock may lie ahead, at the end of a contact of it or of a neighbour
        ("wall", np.int8),  # number from 1 on of the driven wall it is at; -1, -2 of a thermal floor, ceiling; else 0
    ],
    align=True,
)
"""What is kept of every pair; state and mode are those of the last flight while it is in an island. `due` is inf if it
does not start a block."""
_LAW = [("lower", float), ("upper", float), ("inverse", float), ("pull", float), ("wall", int), *KIND.descr[:8]]
"""Inverse masses, 1/kg, and their sum; pull (that of a driven wall in it, as it is now), wall and law as above."""
_STATE = [
    ("xi", float), ("eta", float), ("mode", int), ("noise", float),
    ("exact", int),  # an event has just found φ = 0: keep it exactly so
    ("own_speed", float), ("own_length", float),  # scales of its motion, m/s and m
    ("sway", float),  # bound of the closing acceleration that a driven wall gives it, m/s²; 0 without
    ("wake", float),  # overlap at which a dormant pair becomes active
    ("xi_peak", float), ("loading", int),  # largest overlap so far, for laws with memory
    ("number", int),  # of the pair; for laws that are functions:
    ("doubt", float), ("largest", float), ("deepest", float),  # of the force of its piece; since its balls last parted
    ("load", float), ("head", int),  # force that it bears at rest in its group, in N, and the first pair of that
    ("piled", int), ("energy", float), ("opening", float), ("barrier", float),  # of that: pairs; see `equilibrium`, J
]
_BLOCK = [  # of the island that starts with this pair; h = 0 before it has a piece
    ("clock", int), ("linear", int), ("t", float), ("tail", float),  # q of t = (hτ)^q; its time is t + tail
    ("h", float), ("tau", float),  # scale of the piece, and its end in τ, 0 when it is used up
    ("manner", int),  # in which its groups are followed
    ("doubts", int),  # steps since it was formed at which a look whether its linear pairs creep was considered
    ("fired", int), ("event", int),  # the pair whose event ends it, -1 for none, and which event
    ("holds", float),  # s for which a driven wall's path goes on as it does
    ("speed", float), ("length", float), ("last_step", float),  # scales of the motion; the step is on the plain clock
]
_CONTACT = [  # the contact that is going on
    ("going_on", int), ("t_begin", float), ("duration", float), ("lower_in", float), ("upper_in", float),
    ("xi_max", float), ("force_max", float), ("impulse", float),
    ("push", float),  # impulse of the last piece
]
_SERIES = [
    *((name, float, (PADDED,)) for name in ("r", "z")),
    *((name, float, (MIRROR,)) for name in ("gm", "rm", "zm")),
    *((name, float, (ROW,)) for name in ("x", "e", "f", "g")),
]
"""Coefficients in τ of overlap, rate, force, bracket φ; of the powers r = ξ^d and z = ξ^s; mirrors of φ, r and z."""
MEMBER = np.dtype([*_SERIES, *_LAW, *_STATE, *_BLOCK, *_CONTACT, ("spare", int)], align=True)
"""A pair in an island. `spare` of record i of the pool is the i-th place, of which the first ones are taken."""
BODY = np.dtype([(name, float) for name in ("inverse_mass", "fall", "v", "t", "tail", "wall")], align=True)
"""Inverse mass, downward acceleration (of a pendulum at time t + tail), velocity it had at time t + tail, and number
from 1 on of the driven wall that it is, or 0."""
RUN = np.dtype(
    [
        ("tol", float), ("members", int),
        ("t", float), ("tail", float), ("lo", int), ("hi", int), ("last_step", float), ("waits", int),
        ("events", int), ("steps", int), ("max_events", int), ("max_steps", int), ("error", float),
        ("until_pair", int), ("until_nth", int), ("separated", int),
        ("log_level", int), ("rows", int), ("contacts", int),
        ("shared", float), ("shared_low", float),  # impulse in N s exchanged while a neighbouring pair was active
        ("isolated", int), ("first", int), ("disturbed", float), ("tables", int), ("disturbing", int),
        ("wanted", int), ("answered", int),  # pair whose contact is asked for alone, and whether it has been answered
        ("solo", int), ("pieces", int), ("left", float), ("passed", float), ("at", float),  # see `inside.ask_to_follow`
        ("over", float), ("parting", float),
        ("before_due", float), ("before_steps", int), ("before_error", float), ("before_log", int),  # to be put back
        ("speed", float),  # at which it is followed
        ("omega", float),  # of pendula, 1/s
        ("length", float), ("look", int),  # free length of a ring, m, and the steps after which it is looked at
        ("energy", float), ("barrier", float), ("rests", int), ("doubted", int),
    ],
    align=True,
)
"""Counters, limits and stop conditions of one run; places taken in the pool; of the event under way time, pairs
lo … hi-1 that it concerns, last step of its block, and whether it waits for room; the contact that is followed alone;
the group that is nearest to open of a scene that rests, in J, and the pair at which that was last in doubt."""
LEDGER = np.dtype(
    [*((name, float, (5,)) for name in ("total", "low", "piece", "solo")),
     *((name, float, (2,)) for name in ("work", "lost", "temperature", "mass")),
     *((name, int, (2,)) for name in ("seed", "contacts"))]
)
"""What walls have done and contacts have lost, in J, in two floats; in a piece; in a contact that is followed alone; in
the last contacts at driven walls that were solved at once. See `ledger`. Of thermal floor and ceiling temperature in J,
mass of the ball at it in kg, seed, and contacts so far. See `jumps`."""
SLOWEST, OCTAVES, POINTS, CHECKS, QUANTITIES = -40, 64, 20, 4, 6
"""Of tables: binary exponent of the slowest speeds in m/s, octaves, points in each, points to check, numbers kept."""
MAP = np.dtype([("table", np.int32, (OCTAVES,)), ("met", np.int32, (OCTAVES,))], align=True)
"""For each octave of speeds the place of a table + 1 (-1: it has none), and contacts met so far."""
TABLE = np.dtype(
    [
        ("error", float), ("c", float, (QUANTITIES * POINTS,)),
        ("seen", float, (QUANTITIES * (POINTS + CHECKS),)), ("noted", int),
    ],
    align=True,
)
"""Chebyshev coefficients of the numbers of a contact over an octave of speeds, and the contacts they are made of."""
NO_LOG, ROWS, PEAKS = range(3)
"""`log_level`: no contacts are noted; rows without, and with, largest overlap and force."""
AT_LEAST_ONE = -1
"""`pieces`, at first, of a contact that takes one piece even if no time is left: it is looked at at its onset."""
WATCHED = -2
"""`until_pair` of a run that is watched, and so follows all contacts by pieces; -1 of one that is not."""
RESOLVE, STOP, IGNORE = range(3)
"""What is done where a contact disturbs another."""
MOST_MAPS = 64
"""Pairs that differ from each other, up to which contacts may have tables."""
TABLES = 1
"""Tables for which there is room at first."""
TO_PLAN = -math.inf
"""`due` of a block that has been formed anew: its piece is to be planned first of all."""

MOST_WORK = np.iinfo(np.int64).max
"""Largest number of contacts or steps that a limit can be."""
LOG_ROWS, ROWS_OF_MANY, MOST_ROWS = 16, 256, 4096
"""Rows of the log buffer at first: twice as many as pairs, but within these limits; of many scenes at least so many,
for theirs does not grow."""


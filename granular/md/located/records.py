"""Records of pairs, bodies and runs, and the codes for modes, laws and events.

Compiled code reads one numpy record per pair, ``pairs[c].xi``. Interpreted code reads plain objects with the same
fields, so that one source serves both. A pair in free flight needs only a few fields, and most pairs of a gas are in
free flight. The further fields of a pair in an island, above all its power series, are a record in the `pool`,
``pool[pairs[c].slot]``. The pair occupies this record while it is in an island.
"""

from __future__ import annotations

import math

import numpy as np

SERIES_ORDER = 20
"""Order of the power series of a step."""
ROW_LENGTH = SERIES_ORDER + 1
"""Number of coefficients of a power series."""
PADDED_LENGTH = SERIES_ORDER + 8 - SERIES_ORDER % 8
"""Number of coefficients of a factor of a product, a multiple of eight."""
MIRROR_LENGTH = SERIES_ORDER + PADDED_LENGTH
"""Length of a factor stored in reverse order, with zeros after it."""
OPEN, ACTIVE, RESIDUAL, DORMANT, STRUCK = range(5)
"""Modes of a pair.

Open: ξ ≤ 0. Active: F > 0. Residual: ξ > 0 with F clipped at 0. Dormant: touching at rest, with a force that is still
below rounding error. Struck: at a thermal wall that is about to throw the ball back."""
LINEAR, ELASTIC, DAMPED, GENERAL = range(4)
"""Kinds of force laws: kξ + γη, kξ^p, ξ^d (kξ^s + γη), or any other function."""
NO_MAP, DASHPOT, SELF_SIMILAR, VISCOELASTIC = range(4)
"""Contact maps: closed forms of the results of isolated contacts.

The kinds are: none, dashpot, self-similar contacts of a power law, viscoelastic spheres (see `one_contact.maps`)."""
MOVES, LIES, CREEPS, NEEDS_CREEP_TEST, CREEP_TESTED = range(5)
"""How a block is integrated.

MOVES: by its equation of motion. LIES: it is at rest. CREEPS: by its slow motion (see `rest.overdamped`).
NEEDS_CREEP_TEST: not yet, because it has to be tested for creep first. CREEP_TESTED: by its equation of motion, after
that test."""
REST_PIECE_SCALE = 2.0**300
"""Duration in s of the piece of a pile at rest: longer than any run."""
NOTHING, BEGIN, END, PART, TURN, RELOAD, EDGE = range(7)
"""Events that can end the piece or flight of a pair, see the table in `pieces`.

NOTHING is the end of a piece without an event. EDGE is the end of a panel of the path of a driven wall."""
(
    REACHED, MORE, STOPPED, QUIET, WORK_LIMIT, REST, BINDING, CRAMPED, WANTS_TABLE, WANTS_CONTACT, WANTS_REST_TEST,
) = range(11)
"""Reasons why `blocks.advance` returns.

In this order: time limit, chunk done or log full, stop condition, no event can follow, work limit, every ball rests
permanently, every ball is bound in contact permanently, pool full. The last three request work outside the event loop:
a table of contacts, a contact integrated alone, or a test of a block for rest or creep."""
EXTEND, DONE, BY_PIECES, GOES_ON = 11, 12, 13, 14
"""Further return codes inside `blocks.advance`.

EXTEND: form the blocks again, and include one more block if necessary. DONE: the event has been applied. BY_PIECES:
integrate the contact by pieces. GOES_ON: plan the next piece of the island."""
MAX_CLOCK_EXPONENT = 4
"""Largest exponent q of t = (hτ)^q, the time since the start of a piece."""
MAX_START_EXPONENT = 16.0
"""Largest q·p of a power law that a start series of order 20 can represent.

Here q is the exponent of t = (hτ)^q, and p is the exponent of the law k ξ^p."""
SPARE_PLACES = 1
"""Number of places in the pool that stay free, to integrate a contact alone."""
EXTRA_PLACES = 32
"""Number of places in the pool in addition to the estimated need at the start."""
LAW_KIND_RECORD = np.dtype(
    [
        ("kind", int), ("q", int), ("memory", int),  # kind; the force is analytic in ξ^(1/q); 1 for a law with memory
        ("k", float), ("gamma", float), ("p", float), ("d", float), ("s", float),  # F = k ξ^p or ξ^d (kξ^s + γη)
        ("elastic", int), ("map", int),  # 1 for an elastic law; map of its isolated contacts without pull
        *((name, float) for name in ("force_ends", "parts", "restitution", "deepest", "strongest")),
    ],
    align=True,
)
"""A force law, for all pairs of one kind.

The last five fields are the `Shape` of its isolated contacts, if the law has one (see `power_form`)."""
SOFT_PAIR_RECORD = np.dtype(
    [
        ("xi", float), ("eta", float),  # overlap (negative: gap) in m and its rate in m/s at the time t + tail
        ("pull", float),  # closing acceleration by gravity and external forces, m/s²
        ("t", float), ("tail", float),  # clock: absolute time t + tail of the state, s
        ("wait", float), ("due", float),  # s, from the clock to the next event of a flight; s, time of the next event
        ("noise", float),  # bound of the rounding errors accumulated in the rate, m/s
        ("wake", float),  # overlap in m at which the pair became active after it was dormant
        ("last_step", float),  # proposed step of its block with q = 1, s
        ("lasts", float), ("speed", float),  # duration and speed of a contact solved as one event (`one_contact.meet`)
        ("first", np.int32), ("hi", np.int32),  # first pair of its block; end of the block that starts with this pair
        ("slot", np.int32), ("kind_of", np.int32),  # index in the pool, -1 in free flight; index of its law
        ("row", np.int32),  # row in the log buffer of its last contact solved as one event, or -1
        ("contacts", np.int32), ("isolated", np.int16),  # contacts; isolated contacts since OPEN, or `NOT_ISOLATED`
        ("map", np.int8), ("mode", np.int8), ("exact", np.int8), ("event", np.int8),  # map: index of its tables, or -1
        ("ahead", np.int8),  # 1: its clock can be ahead, at the end of its contact or a neighbour's
        ("wall", np.int8),  # number of its driven wall, from 1 onwards; -1, -2: thermal floor, ceiling; 0: neither
    ],
    align=True,
)
"""State of a pair in free flight, its block and its counters.

For a pair in an island, state and mode describe its last flight. `due` is inf if the pair is not the first of its
block."""
_LAW = [
    ("lower", float),
    ("upper", float),
    ("inverse", float),
    ("pull", float),
    ("wall", int),
    *LAW_KIND_RECORD.descr[:8],
]
"""Inverse masses in 1/kg and their sum, pull, wall and law of a pair.

`lower` and `upper` are the inverse masses of the lower and the upper body, `inverse` is their sum. The pull includes
the acceleration of a driven wall at the current time."""
_STATE = [
    ("xi", float), ("eta", float), ("mode", int), ("noise", float),
    ("exact", int),  # 1: an event has located φ = 0, which is then exactly 0 in the next series
    ("own_speed", float), ("own_length", float),  # typical rate and overlap, m/s and m (`step_size.measure`)
    ("sway", float),  # bound of its closing acceleration at a driven wall, m/s²; else 0
    ("wake", float),  # overlap at which a dormant pair becomes active, m
    ("xi_peak", float), ("loading", int),  # largest overlap so far and 1 while loading, for laws with memory
    ("number", int),  # number of the pair
    ("doubt", float), ("largest", float), ("deepest", float),  # general laws: error and maxima of force and overlap
    ("load", float), ("head", int),  # force in N of the pair in its group at rest; first pair of the group
    ("piled", int), ("energy", float), ("opening", float), ("barrier", float),  # group: pairs, energies (`equilibrium`)
]
_BLOCK = [  # of the island that starts with this pair
    ("clock", int), ("linear", int),  # exponent q of dt = (hτ)^q (not a time); 1 if all laws are linear
    ("t", float), ("tail", float),  # clock: absolute time t + tail at the start of the piece, s
    ("h", float), ("tau", float),  # scale of the piece in s^(1/q), 0 without a piece; τ of its end, 0 if used up
    ("manner", int),  # MOVES, LIES, CREEPS, NEEDS_CREEP_TEST or CREEP_TESTED
    ("doubts", int),  # steps since it was formed at which a test of its linear pairs for creep was considered
    ("fired", int), ("event", int),  # pair and event that end the piece; -1 for no pair
    ("holds", float),  # time to the next edge of the path of a driven wall, s
    ("speed", float), ("length", float), ("last_step", float),  # typical rate and overlap; proposed step, q = 1
]
_CONTACT = [  # the current contact
    ("going_on", int), ("t_begin", float), ("duration", float), ("lower_in", float), ("upper_in", float),
    ("xi_max", float), ("force_max", float), ("impulse", float),
    ("push", float),  # impulse of the current piece so far, N s
]
_SERIES = [
    *((name, float, (PADDED_LENGTH,)) for name in ("r", "z")),
    *((name, float, (MIRROR_LENGTH,)) for name in ("gm", "rm", "zm")),
    *((name, float, (ROW_LENGTH,)) for name in ("x", "e", "f", "g")),
]
"""Coefficients in τ of the piece of a pair.

x, e, f and g are overlap, rate, force and bracket φ. r = ξ^d and z = ξ^s are powers of the overlap. gm, rm and zm are
φ, r and z in reverse order."""
MEMBER_RECORD = np.dtype([*_SERIES, *_LAW, *_STATE, *_BLOCK, *_CONTACT, ("spare", int)], align=True)
"""A pair in an island.

The fields `spare` of all these records together list the places of the pool. The first `run.members` places of this
list are occupied."""
SOFT_BODY_RECORD = np.dtype([(name, float) for name in ("inverse_mass", "fall", "v", "t", "tail", "wall")], align=True)
"""State of a body: inverse mass, downward acceleration, velocity and its time.

The velocity `v` in m/s is the velocity at the time t + tail in s. For a pendulum, the acceleration `fall` in m/s² also
belongs to this time. `wall` is the number of the driven wall, from 1 onwards, or 0 if the body is not a driven wall."""
SOFT_RUN_RECORD = np.dtype(
    [
        ("tol", float), ("members", int),  # tolerance; places taken in the pool
        ("t", float), ("tail", float), ("lo", int), ("hi", int),  # current event: time and pairs lo … hi-1
        ("last_step", float), ("waits", int),  # s, proposed step of its block; 1 if the event is not complete
        ("events", int), ("steps", int), ("max_events", int), ("max_steps", int), ("error", float),
        ("until_pair", int), ("until_nth", int), ("separated", int),  # stop condition
        ("log_level", int), ("rows", int), ("contacts", int),  # rows in the log buffer
        ("shared", float), ("shared_low", float),  # impulse in N s exchanged while a neighbouring pair was active
        ("isolated", int), ("first", int), ("disturbed", float), ("tables", int), ("disturbing", int),
        ("wanted", int), ("answered", int),  # pair whose contact has to be integrated alone; 1 after that
        ("solo", int), ("pieces", int), ("left", float), ("passed", float), ("at", float),  # see `request_integration`
        ("over", float), ("parting", float),
        ("before_due", float), ("before_steps", int), ("before_error", float), ("before_log", int),  # restored after it
        ("speed", float),  # speed of the contact that is integrated alone, m/s
        ("omega", float),  # Ω of pendula, 1/s
        ("length", float), ("look", int),  # sum of the gaps on a ring, m; step at which it is corrected next
        ("energy", float), ("barrier", float),  # J, of the resting group nearest to an opening contact
        ("rests", int), ("doubted", int),  # 1 if rest is proved; pair at which the last proof failed
    ],
    align=True,
)
"""Counters, limits and stop conditions of a run, and its current event."""
ENERGY_ACCOUNT_RECORD = np.dtype(
    [*((name, float, (5,)) for name in ("total", "low", "piece", "solo")),
     *((name, float, (2,)) for name in ("work", "lost", "temperature", "mass")),
     *((name, int, (2,)) for name in ("seed", "contacts"))]
)
"""Energy balance in J, and thermal walls.

The five entries are the work of floor and ceiling, the heat of floor and ceiling, and the dissipated energy. `total`
and `low` are the sums in two floats. `piece` has the sums of one piece, `solo` of a contact integrated alone. `work`
and `lost` belong to the last contacts at driven walls that were solved as one event (see `ledger`). For thermal floor
and ceiling: temperature in J, mass of the ball at the wall in kg, seed and number of reflections (see `jumps`)."""
MIN_SPEED_EXPONENT, SPEED_OCTAVES, POINTS_PER_OCTAVE, CHECKS_PER_OCTAVE, CONTACT_QUANTITIES = -40, 64, 20, 4, 6
"""Layout of the tables of contacts.

In this order: binary exponent of the lowest speed in m/s, octaves of speed, Chebyshev points per octave, additional
points per octave for checks, quantities per contact."""
OCTAVE_MAP_RECORD = np.dtype([("table", np.int32, (SPEED_OCTAVES,)), ("met", np.int32, (SPEED_OCTAVES,))], align=True)
"""Tables of one kind of pair: the table of each octave of speeds.

`table` is 1 + the index of the table of the octave, 0 before it is computed, or -1 if there is none. `met` counts the
contacts in the octave."""
CONTACT_TABLE_RECORD = np.dtype(
    [
        ("error", float), ("c", float, (CONTACT_QUANTITIES * POINTS_PER_OCTAVE,)),
        ("seen", float, (CONTACT_QUANTITIES * (POINTS_PER_OCTAVE + CHECKS_PER_OCTAVE),)), ("noted", int),
    ],
    align=True,
)
"""Table of the contacts in one octave of speeds.

`c` has Chebyshev coefficients of the quantities of a contact. `seen` has the `noted` contacts from which they are
computed, and `error` is the error of these contacts."""
NO_LOG, ROWS, PEAKS, ENERGIES = range(4)
"""Values of `log_level`: no log, rows without peaks, with peaks, with energies.

Peaks are the largest overlap and the largest force of a contact. With `ENERGIES`, in runs with the flag `METERED`, the
field `force_max` contains the dissipated energy ∫ F ξ̇ dt in J instead."""
AT_LEAST_ONE = -1
"""Initial `pieces` of a contact that is integrated for at least one piece.

The piece is needed to evaluate the contact at its onset, where no time is left."""
UNTIL_ANY_EVENT = -2
"""`until_pair` of a run that pauses after every event, to evaluate an observable.

Such a run integrates all contacts by pieces. The value is -1 in runs without a stop condition."""
RESOLVE, STOP, IGNORE = range(3)
"""Treatment of contacts that disturb each other: the values of `disturbing`.

RESOLVE integrates them together, STOP ends the run before them, IGNORE treats each as isolated."""
MAX_TABLED_PAIRS = 64
"""Maximum number of different pairs whose contacts can have tables."""
INITIAL_TABLES = 1
"""Number of tables for which memory is allocated at the start."""
DUE_TO_PLAN = -math.inf
"""`due` of a block that was formed again: its piece is planned before any event."""

MAX_WORK_LIMIT = np.iinfo(np.int64).max
"""Largest possible limit of the number of contacts or steps."""
MIN_LOG_ROWS, MIN_LOG_ROWS_OF_MANY, MAX_INITIAL_LOG_ROWS = 16, 256, 4096
"""Initial number of rows of the log buffer.

It is twice the number of pairs, with a minimum, another minimum for many scenes, and a maximum. The minimum for many
scenes is larger because their buffers do not grow."""


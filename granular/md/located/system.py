"""What the engine knows about each pair and body, as records with names, and how they are made from scenes.

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

from granular import until as stop
from granular._records import packed, plain
from granular._roots import DEEPEST, workspace
from granular._tournament import NODE, tournament
from granular.laws.contact_law import Form, PairLaw
from granular.laws.kinds import SceneLaws
from granular.md.rows import CONTACT_ROW
from granular.scene import Scene, speed_scale

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

NOTHING, BEGIN, END, PART, TURN, RELOAD = range(6)
"""Events of a pair, see `events`."""

LARGEST_Q = 4
STEEPEST = 16.0
"""Largest q of the clock t = (hτ)^q, and largest q·p of a power law, that a start series of order 20 can show."""

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
    ("number", int),  # of the pair; for laws that are functions:
    ("doubt", float), ("largest", float), ("deepest", float),  # of the force of its piece; since its balls last parted
]  # fmt: skip
_BLOCK = [  # of the island that starts with this pair; h = 0 before it has a piece
    ("clock", int), ("linear", int), ("t", float), ("tail", float),  # q of t = (hτ)^q; its time is t + tail
    ("h", float), ("tau", float),  # scale of the piece, and its end in τ, 0 when it is used up
    ("fired", int), ("what", int),  # the pair whose event ends it, -1 for none, and which event
    ("speed", float), ("length", float), ("stride", float),  # scales of the motion; last step on the plain clock
]  # fmt: skip
_CONTACT = [  # the contact that is going on
    ("begun", int), ("t_begin", float), ("duration", float), ("lower_in", float), ("upper_in", float),
    ("xi_max", float), ("force_max", float), ("impulse", float),
]  # fmt: skip
_SERIES = [
    *((name, float, (PADDED,)) for name in ("r", "z")),
    *((name, float, (MIRROR,)) for name in ("gm", "rm", "zm")),
    *((name, float, (ROW,)) for name in ("x", "e", "f", "g")),
]
"""Coefficients in τ of overlap, rate, force, bracket φ; of the powers r = ξ^d and z = ξ^s; mirrors of φ, r and z."""

MEMBER = np.dtype([*_SERIES, *_LAW, *_STATE, *_BLOCK, *_CONTACT, ("spare", int)], align=True)
"""A pair in an island. `spare` of record i of the pool is the i-th place, of which the first ones are taken."""
BODY = np.dtype([(name, float) for name in ("inverse_mass", "fall", "load", "v", "t", "tail")], align=True)
"""Inverse mass, downward acceleration, weight in N of the body and all above it, velocity it had at time t + tail."""
RUN = np.dtype(
    [
        ("tol", float), ("members", int),
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


def new_system(columns: Any, kinds: Any, kind_of: Any, room: int, until: stop.Until | None, **limits: Any) -> System:
    """Return the records at time 0 of one scene, or of many with one more axis, in front; `limits` are fields of `RUN`.

    The `columns` are inverse masses, velocities, gaps and gravity, the laws rows of `KIND`, `room` the places in the
    pool, which many scenes share.
    """
    inverse_mass, velocity, gap, gravity = columns
    n = gap.shape[-1]
    run, pairs, bodies = np.zeros((*gap.shape[:-1], 1), RUN), np.zeros(gap.shape, PAIR), np.zeros(velocity.shape, BODY)
    bodies["inverse_mass"], bodies["v"] = inverse_mass, velocity
    bodies["fall"] = fall = np.where(inverse_mass > 0.0, gravity, 0.0)
    weight = np.divide(fall, inverse_mass, out=np.zeros_like(fall), where=inverse_mass > 0.0)
    bodies["load"] = np.cumsum(weight[..., ::-1], axis=-1)[..., ::-1]
    pairs["xi"], pairs["eta"], pairs["pull"] = -gap, -np.diff(velocity), np.diff(fall)
    pairs["kind_of"], pairs["slot"], pairs["due"] = kind_of, -1, math.inf
    pairs["first"], pairs["hi"] = np.arange(n), np.arange(1, n + 1)
    stops = (until.pair, until.nth) if isinstance(until, stop.Contact) else (-1, 0)
    limits |= {"until_pair": stops[0], "until_nth": stops[1], "separated": isinstance(until, stop.Separated)}
    for name, value in limits.items():
        run[name] = value
    log = np.zeros(min(max(LOG_ROWS, 2 * n), MOST_ROWS), CONTACT_ROW)
    work = np.zeros((DEEPEST + 1, ORDER + 2))
    return System(run, pairs, empty_pool(min(room, n)), kinds, bodies, tournament(n), log, work)


def empty_pool(room: int) -> np.ndarray[Any, Any]:
    """Return a pool of which no place is taken."""
    pool = np.zeros(room, MEMBER)
    pool["spare"] = np.arange(room)
    return pool


def with_more_room(s: System) -> System:
    """Return the run with a pool of twice the size; all of its places were taken."""
    more = empty_pool(2 * len(s.pool))[len(s.pool) :]
    return s._replace(pool=s.pool + plain(more) if isinstance(s.pool, list) else np.concatenate([s.pool, more]))


def system_of(scene: Scene, laws: SceneLaws, until: stop.Until | None, **limits: Any) -> System:
    """Return the records of a scene at the start of its run."""
    if not np.isfinite(sum(scene.sides(scene.inverse_mass))).all():
        raise OverflowError("the inverse of a mass")
    speed = speed_scale(scene)
    kinds = np.array([_described(law, speed, scene.gravity) for law in laws.each], KIND)
    if (kinds["kind"] == GENERAL).any():  # one law beyond powers, and every law is evaluated as it stands
        kinds["kind"], kinds["s"] = GENERAL, 0.0
    room = 3 * int(np.count_nonzero(scene.gap <= 0.0)) + ROOM  # so many pairs may join islands at once, and some later
    columns = scene.inverse_mass, scene.velocity, scene.gap, scene.gravity
    return new_system(columns, kinds, laws.kind, room, until, **limits)


def _described(law: PairLaw, speed: float, gravity: float) -> tuple[float, ...]:
    """What kind of law it is, and its coefficients: a row of `KIND`."""
    form = power_form(law)
    if form is None:
        k, p, q = _rough_form(law, speed, gravity)
        return GENERAL, q, law.memory, k, 0.0, p, 0.0, 0.0
    k, p, gamma, d = form
    d = factor(p, gamma, d)
    return *kind_and_q(*form), law.memory, k, gamma, p, d, p - d


def power_form(law: PairLaw) -> Form | None:
    """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ if a power series can follow it, else None."""
    return law.form if law.form is not None and kind_and_q(*law.form)[0] != GENERAL else None


def _rough_form(law: PairLaw, speed: float, gravity: float) -> tuple[float, float, int]:
    """Return k and p of a power law of about the size of `law`, and 1 if its force begins smoothly in time, else 2.

    It sets scales, as of first steps; matched at the overlap that an impact at `speed` reaches, or a weight at rest.
    """
    pair = law.pair
    xi = 1e-3 * pair.r_eff if 0.0 < pair.r_eff < math.inf else 1e-3
    for factor in (4.0, 0.25):
        while 1e-100 < xi < 1e100 and speed + gravity > 0.0:
            stops = abs(_bounded(law, xi)) * xi >= pair.m_eff * (speed * speed + gravity * xi)
            if stops == (factor > 1.0):
                break
            xi *= factor
    p, onset = (_slope(law, x) for x in (xi, 1e-6 * xi))
    k = abs(_bounded(law, xi)) / math.pow(xi, p)
    return (k if 0.0 < k < math.inf else 1.0), p, (1 if abs(onset - round(onset)) < 1e-3 else 2)


def _slope(law: PairLaw, xi: float) -> float:
    """Return d ln F / d ln ξ at rest at overlap `xi`, within [1, 3]; 1.5 where it cannot be told."""
    near, far = abs(_bounded(law, xi)), abs(_bounded(law, 1.01 * xi))
    if not 0.0 < near < math.inf or not 0.0 < far < math.inf:
        return 1.5
    return min(max(1.0, math.log(far / near) / math.log(1.01)), 3.0)


def _bounded(law: PairLaw, xi: float) -> float:
    """Return the force at rest at overlap `xi`, 0 if it is too large for a number."""
    try:
        return law.force(xi, 0.0, xi)
    except OverflowError:
        return 0.0


def kind_and_q(k: float, p: float, gamma: float, d: float) -> tuple[int, int]:
    """Return the kind of the law F = k ξ^p + γ ξ^d ξ̇, and the q of the clock its contacts start on."""
    if p == 1.0 and (gamma == 0.0 or d == 0.0):
        return LINEAR, 1
    q = _denominator(p) if gamma == 0.0 else math.lcm(_denominator(p), _denominator(d))
    if k > 0.0 and q <= LARGEST_Q and q * p <= STEEPEST and (gamma == 0.0 or 0.0 <= d < p):
        return (ELASTIC if gamma == 0.0 else DAMPED), q
    return GENERAL, min(q, LARGEST_Q)


def factor(p: float, gamma: float, d: float) -> float:
    """Return the d of F = ξ^d (k ξ^(p-d) + γ ξ̇); without damping it is free: ½ for Hertz's law, else 0."""
    return d if gamma != 0.0 else 0.5 if p == 1.5 else 0.0


def _denominator(exponent: float) -> int:
    """Return the smallest q with q·exponent whole, or one that is too large."""
    found = (q for q in range(1, LARGEST_Q + 1) if abs(q * exponent - round(q * exponent)) < 1e-12)
    return next(found, LARGEST_Q + 1)

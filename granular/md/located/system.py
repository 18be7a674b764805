"""What the engine knows about each pair and body, as records with names, and how they are made from scenes.
May be skipped: how a run is held, no physics.

Compiled code reads one numpy record per pair, ``pairs[c].xi``; interpreted code reads plain objects with the same
fields, so one source serves both. A pair in free flight needs little, and most pairs of a gas fly: what an island
needs of a pair, above all its power series, is a record in the `pool`, taken when the pair joins the island and given
back when it leaves, ``pool[pairs[c].slot]``.
"""

from __future__ import annotations

import math
from collections import namedtuple
from functools import cache
from typing import Any

import numpy as np

from granular import until as stop
from granular._check import Array
from granular._records import packed, plain
from granular._roots import DEEPEST, workspace
from granular._tournament import NODE, tournament
from granular.laws.contact_law import Form, PairLaw
from granular.laws.kinds import SceneLaws, alike
from granular.md.located.similar import Shape, damped, elastic
from granular.md.located.wall_paths import Hung, compiled_walls, numbers_at_ends, plain_walls, walls_of, with_walls
from granular.md.rows import CONTACT_ROW
from granular.scene import Scene, speed_scale

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

NO_MAP, DASHPOT, SIMILAR, VISCOELASTIC = range(4)
"""How an isolated contact is known at its onset: see `maps`."""

MOVES, LIES, CREEPS, ASKS, LOOKED = range(5)
"""Manners in which a block is followed: by its equation of motion; lying still; creeping, see `overdamped`; not yet,
for it is to be looked at whether it creeps; by its equation of motion, after that look."""
LONG = 2.0**300
"""Scale in s of the piece of a pile that is still: longer than any run."""

NOTHING, BEGIN, END, PART, TURN, RELOAD, EDGE = range(7)
"""Events of a pair, see `events`."""

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
        *((name, float) for name in Shape._fields),
    ],
    align=True,
)  # fmt: skip
"""A law as the pairs of one kind have it; at last the shape of its contacts where they have one."""
PAIR = np.dtype(
    [
        ("xi", float), ("eta", float),  # overlap (negative: gap), m, and its rate, m/s
        ("pull", float),  # closing acceleration by gravity, m/s²
        ("t", float), ("tail", float),  # it has them at time t + tail
        ("wait", float), ("due", float),  # time in s to the next event of its flight; when the piece of its block ends
        ("noise", float),  # what the rounding of steps may have left in the rate so far, m/s
        ("wake", float),  # overlap at which it became active when it was last dormant
        ("stride", float),  # last step of its block on the plain clock
        ("lasts", float), ("speed", float),  # of a contact solved at once: see `isolated`
        ("first", np.int32), ("hi", np.int32),  # first pair of the block it is in; end of the block that it starts
        ("slot", np.int32), ("kind_of", np.int32),  # its places in the pool, -1 in free flight, and among the kinds
        ("row", np.int32),  # of its last contact solved at once, in the log buffer
        ("count", np.int32), ("alone", np.int16),  # contacts; those in which no neighbour overlapped, since it was open
        ("map", np.int8), ("mode", np.int8), ("exact", np.int8), ("what", np.int8),  # map: place of its tables, or -1
        ("wall", np.int8),  # number from 1 on of the driven wall it is at; -1, -2 of a thermal floor, ceiling; else 0
    ],
    align=True,
)  # fmt: skip
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
    ("top", float), ("loading", int),  # largest overlap so far, for laws with memory
    ("number", int),  # of the pair; for laws that are functions:
    ("doubt", float), ("largest", float), ("deepest", float),  # of the force of its piece; since its balls last parted
    ("load", float), ("head", int),  # force that it bears at rest in its group, in N, and the first pair of that
    ("piled", int), ("energy", float), ("opening", float), ("barrier", float),  # of that: pairs; see `equilibrium`, J
]  # fmt: skip
_BLOCK = [  # of the island that starts with this pair; h = 0 before it has a piece
    ("clock", int), ("linear", int), ("t", float), ("tail", float),  # q of t = (hτ)^q; its time is t + tail
    ("h", float), ("tau", float),  # scale of the piece, and its end in τ, 0 when it is used up
    ("manner", int),  # in which its groups are followed
    ("fired", int), ("what", int),  # the pair whose event ends it, -1 for none, and which event
    ("holds", float),  # s for which a driven wall's path goes on as it does
    ("speed", float), ("length", float), ("stride", float),  # scales of the motion; last step on the plain clock
]  # fmt: skip
_CONTACT = [  # the contact that is going on
    ("begun", int), ("t_begin", float), ("duration", float), ("lower_in", float), ("upper_in", float),
    ("xi_max", float), ("force_max", float), ("impulse", float),
    ("push", float),  # impulse of the last piece
]  # fmt: skip
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
        ("t", float), ("tail", float), ("lo", int), ("hi", int), ("stride", float), ("waits", int),
        ("events", int), ("steps", int), ("max_events", int), ("max_steps", int), ("pause", int), ("error", float),
        ("until_pair", int), ("until_nth", int), ("separated", int),
        ("log", int), ("rows", int), ("begun", int),
        ("shared", float), ("shared_low", float),  # impulse in N s exchanged while a neighbouring pair was active
        ("isolated", int), ("first", int), ("disturbed", float), ("tables", int), ("disturbing", int),
        ("wanted", int), ("answered", int),  # pair whose contact is asked for alone, and whether it has been answered
        ("alone", int), ("pieces", int), ("left", float), ("passed", float), ("at", float),  # see `alone.follow_alone`
        ("over", float), ("parting", float),
        ("before_due", float), ("before_steps", int), ("before_error", float), ("before_log", int),  # to be put back
        ("speed", float),  # at which it is followed
        ("omega", float),  # of pendula, 1/s
        ("length", float), ("look", int),  # free length of a ring, m, and the steps after which it is looked at
        ("energy", float), ("barrier", float), ("rests", int), ("doubted", int),
    ],
    align=True,
)  # fmt: skip
"""Counters, limits and stop conditions of one run; places taken in the pool; of the event under way time, pairs
lo … hi-1 that it concerns, stride of its block, and whether it waits for room; the contact that is followed alone; the
group that is nearest to open of a scene that rests, in J, and the pair at which that was last in doubt."""

LEDGER = np.dtype(
    [*((name, float, (5,)) for name in ("total", "low", "piece", "alone")),
     *((name, float, (2,)) for name in ("work", "lost", "temperature", "mass")),
     *((name, int, (2,)) for name in ("seed", "hits"))]
)
"""What walls have done and contacts have lost, in J, in two floats; in a piece; in a contact that is followed alone; in
the last contacts at driven walls that were solved at once. See `ledger`. Of thermal floor and ceiling temperature in J,
mass of the ball at it in kg, seed, and hits so far. See `heat`."""

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
)  # fmt: skip
"""Chebyshev coefficients of the numbers of a contact over an octave of speeds, and the contacts they are made of."""
RESOLVE, STOP, IGNORE = range(3)
"""What is done where a contact disturbs another."""
MOST_MAPS = 64
"""Pairs that differ from each other, up to which contacts may have tables."""
TABLES = 8
"""Tables for which there is room at first."""

DRIVEN: bool = False
WORKED: bool = False
HEATED: bool = False
HUNG: bool = False
RING: bool = False
"""Whether walls are driven, a ledger is kept, walls are thermal, balls are pendula or on a ring: kernels of such scenes
are specialised."""

NO_PAUSE = np.iinfo(np.int64).max
"""`pause` of a run that need not stop on its way to be looked at."""

LOG_ROWS, MOST_ROWS = 256, 4096
"""Rows of the log buffer: twice as many as pairs, but within these limits."""

System = namedtuple("System", "run pairs pool kinds bodies queue log maps tables answer work walls ledger")
"""All of a run: records (`run` has one), tournament tree of blocks, log buffer, scratch of the root finder; `Walls`
that are driven, or how balls are `Hung`, and the record of a ledger, None without."""


def to_plain(s: System) -> System:
    """Return the run for interpreted code."""
    ledger = None if s.ledger is None else plain(s.ledger)
    rest = list(s.answer), workspace(ORDER), plain_walls(s.walls), ledger
    return System._make([*map(plain, s[:9]), *rest])


def to_compiled(s: System) -> System:
    """Return the run for compiled code: same numbers, same bits."""
    records = map(packed, s[:9], (RUN, PAIR, MEMBER, KIND, BODY, NODE, CONTACT_ROW, MAP, TABLE))
    ledger = None if s.ledger is None else packed(s.ledger, LEDGER)
    return System._make([*records, np.array(s.answer), np.array(s.work), compiled_walls(s.walls), ledger])


def readable(s: System) -> System:
    """Return the same records of compiled code as interpreted code reads and writes them, slowly."""
    return System._make([*(records.view(np.recarray) for records in s[:9]), *s[9:]])





def new_system(
    columns: Any, kinds: Any, kind_of: Any, room: int, until: stop.Until | None, *, walls: Any = None, lift: Any = None,
    ledger: Any = None, **limits: Any,
) -> System:
    """Return the records at time 0 of one scene, or of many with one more axis, in front; `limits` are fields of `RUN`.

    The `columns` are inverse masses, velocities, gaps and gravity, the laws rows of `KIND`, `room` the places in the
    pool, which many scenes share; `walls` the driven walls and `lift` the accelerations by forces of one scene.
    """
    inverse_mass, velocity, gap, gravity = columns
    if walls is not None:
        velocity = with_walls(walls, velocity)
    n = gap.shape[-1]
    run, pairs, bodies = np.zeros((*gap.shape[:-1], 1), RUN), np.zeros(gap.shape, PAIR), np.zeros(velocity.shape, BODY)
    bodies["inverse_mass"], bodies["v"] = inverse_mass, velocity
    fall = np.where(inverse_mass > 0.0, gravity, 0.0)
    if lift is not None:
        fall = fall - lift
    bodies["fall"] = fall
    pairs["xi"], pairs["eta"], pairs["pull"] = -gap, -np.diff(velocity), np.diff(fall)
    if walls is not None:
        bodies["wall"][[0, -1]] = floor, ceiling = numbers_at_ends(walls)
        pairs["wall"][0] += floor
        pairs["wall"][-1] += ceiling
    pairs["kind_of"], pairs["slot"], pairs["due"] = kind_of, -1, math.inf
    pairs["first"], pairs["hi"] = np.arange(n), np.arange(1, n + 1)
    stops = (until.pair, until.nth) if isinstance(until, stop.Contact) else (-1, 0)
    limits |= {"until_pair": stops[0], "until_nth": stops[1], "separated": isinstance(until, stop.Separated)}
    limits |= {"first": -1, "disturbed": math.nan, "alone": -1}
    for name, value in limits.items():
        run[name] = value
    log = np.zeros(min(max(LOG_ROWS, 2 * n), MOST_ROWS), CONTACT_ROW)
    work = np.zeros((DEEPEST + 1, ORDER + 2))
    has = np.take_along_axis(kinds["map"], pairs["kind_of"].astype(int), -1) if gap.ndim > 1 else kinds["map"][kind_of]
    pairs["map"] = -1
    lacks = (has == NO_MAP) | ((pairs["pull"] != 0.0) & (has != DASHPOT))
    if n <= MOST_MAPS:  # every pair may have tables of its own; of many, those that are alike share them: `system_of`
        pairs["map"] = np.where(lacks & (pairs["wall"] == 0), np.arange(n), -1)
    known = np.zeros(min(n, MOST_MAPS), MAP), np.zeros(TABLES, TABLE), np.zeros(6)
    pool = empty_pool(min(room, n) + SPARE)
    return System(run, pairs, pool, kinds, bodies, tournament(n), log, *known, work, walls, ledger)


def empty_pool(room: int) -> np.ndarray[Any, Any]:
    """Return a pool of which no place is taken."""
    pool = np.zeros(room, MEMBER)
    pool["spare"] = np.arange(room)
    return pool


def with_more_room(s: System) -> System:
    """Return the run with a pool of twice the size; all of its places were taken."""
    more = empty_pool(2 * len(s.pool))[len(s.pool) :]
    return s._replace(pool=s.pool + plain(more) if isinstance(s.pool, list) else np.concatenate([s.pool, more]))


def with_room_for_a_table(s: System, i: int = 0) -> System:
    """Return the run, or many of which it is the i-th, with tables twice as many if all are taken."""
    of_many = isinstance(s.run[0], list) or np.ndim(s.run) > 1
    if int((s.run[i][0] if of_many else s.run[0])["tables"]) < len(s.tables):
        return s
    fresh = np.zeros(len(s.tables), TABLE)
    return s._replace(tables=s.tables + plain(fresh) if isinstance(s.tables, list) else np.append(s.tables, fresh))


def with_longer_log(s: System) -> System:
    """Return the run with a log buffer of twice the size; most of its rows are of contacts that go on."""
    more = np.zeros(len(s.log), CONTACT_ROW)
    return s._replace(log=s.log + plain(more) if isinstance(s.log, list) else np.append(s.log, more))


def system_of(scene: Scene, laws: SceneLaws, until: stop.Until | None, start: float = 0.0, **limits: Any) -> System:
    """Return the records of a scene at the start of its run, the time `start` in s."""
    if not np.isfinite(sum(scene.sides(scene.inverse_mass))).all():
        raise OverflowError("the inverse of a mass")
    speed = speed_scale(scene)
    kinds = np.zeros(len(laws.each), KIND)
    pull = scene.gravity if scene.external_force is None else float(np.abs(scene.pull).max())
    described = zip(*(_described(law, speed, pull) for law in laws.each), strict=True)
    for name, values in zip(KIND.names or (), described, strict=False):
        kinds[name] = values
    kinds["elastic"] = [not (law.rate_dependent or law.memory) for law in laws.each]
    _write_maps(kinds, laws, scene)
    if (kinds["kind"] == GENERAL).any():  # one law beyond powers, and every law is evaluated as it stands
        kinds["kind"], kinds["s"] = GENERAL, 0.0
    room = 3 * int(np.count_nonzero(scene.gap <= 0.0)) + ROOM  # so many pairs may join islands at once, and some later
    walls, lift = walls_of(scene, start, ROW), None
    if scene.external_force is not None:
        lift = scene.external_force * scene.inverse_mass
    columns: tuple[Any, ...] = scene.inverse_mass, scene.velocity, scene.gap, scene.gravity
    if scene.ring:  # ball 0 once more behind the last one
        lift = lift if lift is None else np.append(lift, lift[0])
        columns = *(np.append(column, column[0]) for column in columns[:2]), *columns[2:]
    ledger = np.zeros(1, LEDGER) if scene.driven or scene.heated else None
    s = new_system(columns, kinds, laws.kind, room, until, walls=walls, lift=lift, ledger=ledger, **limits)
    if scene.heated:
        _heat(s, scene)
    if scene.n_pairs > MOST_MAPS:
        _share_tables(s, laws, scene)
    if scene.ring:
        s.run["length"] = math.fsum(scene.gap)
        return s._replace(pairs=np.append(s.pairs, s.pairs))
    return _hung(s, scene) if scene.pendulum > 0.0 else s


def _heat(s: System, scene: Scene) -> None:
    """Note the thermal walls of a scene."""
    for side, thermal in enumerate(scene.heat):
        if thermal is not None:
            s.pairs["wall"][-side], s.pairs["map"][-side] = -1 - side, -1
            s.ledger["temperature"][0, side], s.ledger["seed"][0, side] = thermal.temperature, thermal.seed
            s.ledger["mass"][0, side] = scene.mass[-2 if side else 1]


def _hung(s: System, scene: Scene) -> System:
    """Return the records of a scene whose balls are pendula: the pull is that at gap 0, -Ω² d; there are no tables."""
    square = scene.pendulum * scene.pendulum
    assert scene.rest_gap is not None
    s.bodies["fall"] = square * scene.displacement
    s.pairs["pull"], s.pairs["map"], s.run["omega"] = -square * scene.rest_gap, -1, scene.pendulum
    return s._replace(walls=Hung(scene.pendulum, square))


def mapped(kinds: Any, m_eff: Array) -> None:
    """Note which maps isolated contacts of laws that are power forms have, and their shapes."""
    k, p, gamma, d = (kinds[name] for name in ("k", "p", "gamma", "d"))
    linear = p == 1.0
    kinds["map"] = np.where(linear, DASHPOT, np.where((p == 1.5) & (gamma > 0.0) & (d == 0.5), VISCOELASTIC, NO_MAP))
    if linear.all():
        return
    shapes = np.full((*k.shape, len(Shape._fields)), np.nan)
    for one in np.unique(p[~linear]):
        free, alike = (p == one) & (gamma == 0.0), (p == one) & (gamma > 0.0) & (d == 0.5 * (p - 1.0))
        shapes[free] = np.transpose(elastic(one))
        if alike.any():
            zeta = gamma[alike] / np.sqrt(2.0 * (one + 1.0) * k[alike] * m_eff[alike])
            shapes[alike] = np.transpose(damped(one, zeta))
    kinds["map"][shapes[..., 0] > 0.0] = SIMILAR
    for name, values in zip(Shape._fields, np.moveaxis(shapes, -1, 0), strict=True):
        kinds[name] = values


def _write_maps(kinds: Any, laws: SceneLaws, scene: Scene) -> None:
    """Note the maps of all kinds of laws that have one; a damping ratio must be the same in all pairs of a kind."""
    mapped(kinds, np.array([law.pair.m_eff for law in laws.each]))
    kinds["map"][kinds["kind"] == GENERAL] = NO_MAP
    damped = (kinds["map"] == SIMILAR) & (kinds["gamma"] > 0.0)
    if damped.any():
        lightest, heaviest = np.full(len(kinds), np.inf), np.zeros(len(kinds))
        np.minimum.at(lightest, laws.kind, scene.pairs.m_eff)
        np.maximum.at(heaviest, laws.kind, scene.pairs.m_eff)
        kinds["map"][damped & (lightest < heaviest)] = NO_MAP


def _share_tables(s: System, laws: SceneLaws, scene: Scene) -> None:
    """Let pairs without a map that are alike share their tables, if there are not too many of them."""
    known = s.kinds["map"][laws.kind]
    lacking = np.flatnonzero(((known == NO_MAP) | ((scene.pull != 0.0) & (known != DASHPOT))) & (s.pairs["wall"] == 0))
    if len(lacking):
        number, first = alike(laws.kind[lacking], scene.pairs.m_eff[lacking], scene.pull[lacking])
        if len(first) <= MOST_MAPS:
            s.pairs["map"][lacking] = number


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
    typical = xi
    for factor in (4.0, 0.25):
        while 1e-100 < xi < 1e100 and speed + gravity > 0.0:
            stops = abs(_bounded(law, xi)) * xi >= pair.m_eff * (speed * speed + gravity * xi)
            if stops == (factor > 1.0):
                break
            xi *= factor
    if not 1e-100 < xi < 1e100:  # it cannot bear the weight, or stops nothing
        return _rough_form(law, speed, 0.0) if gravity > 0.0 else _at_overlap(law, typical)
    return _at_overlap(law, xi)


def _at_overlap(law: PairLaw, xi: float) -> tuple[float, float, int]:
    """Return k and p of a power law of about the size of `law` at an overlap in m, and q, see `_rough_form`."""
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


@cache
def _denominator(exponent: float) -> int:
    """Return the smallest q with q·exponent whole, or one that is too large."""
    found = (q for q in range(1, LARGEST_Q + 1) if abs(q * exponent - round(q * exponent)) < 1e-12)
    return next(found, LARGEST_Q + 1)

"""All records of a run as one `System`: creation, conversion and growth.

`numbering` explains the records of a ring.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._engine.compiler_state import ByReference
from granular._engine.kernels import RING, kernel
from granular._engine.records import NODE, plain, record_array, tournament
from granular._engine.roots import MAX_SUBDIVISIONS, workspace
from granular.laws.kinds import SceneLaws, number_distinct_rows
from granular.md.located.numbering import pair_count
from granular.md.located.power_form import law_kinds
from granular.md.located.records import (
    CONTACT_TABLE_RECORD,
    DASHPOT,
    ENERGY_ACCOUNT_RECORD,
    EXTRA_PLACES,
    INITIAL_TABLES,
    LAW_KIND_RECORD,
    MAX_INITIAL_LOG_ROWS,
    MAX_TABLED_PAIRS,
    MEMBER_RECORD,
    MIN_LOG_ROWS,
    MIN_LOG_ROWS_OF_MANY,
    NO_MAP,
    OCTAVE_MAP_RECORD,
    OPEN,
    ROW_LENGTH,
    SERIES_ORDER,
    SOFT_BODY_RECORD,
    SOFT_PAIR_RECORD,
    SOFT_RUN_RECORD,
    SPARE_PLACES,
)
from granular.md.located.walls import Pendula, compiled_walls, numbers_at_ends, plain_walls, walls_of, with_walls
from granular.run import until as stop
from granular.run.contact_log import CONTACT_ROW
from granular.scene.state import Scene

SystemFields = namedtuple(
    "SystemFields", "run pairs pool kinds bodies queue log maps tables answer scratch field ledger"
)
"""Fields of a `System`, in this order."""


class System(ByReference, SystemFields):
    """All records of a run.

    `run` has one record with counters and limits, `pairs` one per pair, `bodies` one per body and `kinds` one per force
    law. `pool` has the records of pairs in islands. `queue` is the tournament tree of blocks, ordered by the times of
    their next events. `log` is the buffer of the contact log. `maps` and `tables` are tables of isolated contacts,
    `answer` is the last contact integrated alone for `one_contact.meet`. `scratch` is temporary storage of the root
    finder. `field` describes free flight: driven `Walls`, `Pendula`, or None. `ledger` is the energy balance, or None.
    """

    _plain = SystemFields


def to_plain(s: System) -> System:
    """Convert the records of a run to plain objects and lists for interpreted code."""
    ledger = None if s.ledger is None else plain(s.ledger)
    others = list(s.answer), workspace(SERIES_ORDER), plain_walls(s.field), ledger
    return System._make([*map(plain, s[:9]), *others])


def to_compiled(s: System) -> System:
    """Convert the records of a run to numpy arrays for compiled code.

    The numbers are bitwise identical. Records that are arrays already are returned unchanged.
    """
    if isinstance(s.run, np.ndarray):
        return s
    records = map(
        record_array,
        s[:9],
        (
            SOFT_RUN_RECORD,
            SOFT_PAIR_RECORD,
            MEMBER_RECORD,
            LAW_KIND_RECORD,
            SOFT_BODY_RECORD,
            NODE,
            CONTACT_ROW,
            OCTAVE_MAP_RECORD,
            CONTACT_TABLE_RECORD,
        ),
    )
    ledger = None if s.ledger is None else record_array(s.ledger, ENERGY_ACCOUNT_RECORD)
    return System._make([*records, np.array(s.answer), np.array(s.scratch), compiled_walls(s.field), ledger])


def record_views(s: System) -> System:
    """Return views of numpy records that interpreted code can use, slowly.

    The memory is shared, not copied.
    """
    return System._make([*(records.view(np.recarray) for records in s[:9]), *s[9:]])


def new_system(
    columns: Any, kinds: Any, kind_of: Any, room: int, until: stop.Until | None, *, walls: Any = None, lift: Any = None,
    ledger: Any = None, **limits: Any,
) -> System:
    """Create the records of one scene, or of many scenes, at time 0.

    Arrays of many scenes have one more axis, in front.

    Parameters
    ----------
    columns : (inverse_mass, velocity, gap, gravity)
        Inverse masses in 1/kg, velocities in m/s, gaps in m, and gravity in m/s².
    kinds, kind_of : array, array of int
        Laws as records `LAW_KIND_RECORD`, and the index of the law of each pair.
    room : int
        Number of places in the pool, which many scenes share.
    until : stop condition, optional
        Stop condition of the run.
    walls : Walls, optional
        Driven walls (one scene only).
    lift : (n,) array, optional
        Upward accelerations of the bodies in m/s² by external forces (one scene only).
    ledger : array, optional
        Energy balance, for driven or thermal walls.
    **limits
        Fields of `SOFT_RUN_RECORD` and their values.
    """
    inverse_mass, velocity, gap, gravity = columns
    if walls is not None:
        velocity = with_walls(walls, velocity)
    n = gap.shape[-1]
    run, pairs, bodies = (
        np.zeros((*gap.shape[:-1], 1), SOFT_RUN_RECORD),
        np.zeros(gap.shape, SOFT_PAIR_RECORD),
        np.zeros(velocity.shape, SOFT_BODY_RECORD),
    )
    bodies["inverse_mass"], bodies["v"] = inverse_mass, velocity
    fall = np.where(inverse_mass > 0.0, gravity, 0.0)
    if lift is not None:
        fall = fall - lift
    bodies["fall"] = fall
    pairs["xi"], pairs["pull"] = -gap, fall[..., 1:] - fall[..., :-1]
    pairs["eta"] = -(velocity[..., 1:] - velocity[..., :-1])
    if walls is not None:
        bodies["wall"][[0, -1]] = floor, ceiling = numbers_at_ends(walls)
        pairs["wall"][0] += floor
        pairs["wall"][-1] += ceiling
    pairs["kind_of"], pairs["slot"], pairs["due"] = kind_of, -1, math.inf
    pairs["first"], pairs["hi"] = np.arange(n), np.arange(1, n + 1)
    stops = (until.pair, until.nth) if isinstance(until, stop.Contact) else (limits.get("until_pair", -1), 0)
    limits |= {"until_pair": stops[0], "until_nth": stops[1], "separated": isinstance(until, stop.Separated)}
    # -1 and nan mean "none yet"
    limits |= {"first": -1, "disturbed": math.nan, "solo": -1}
    for name, value in limits.items():
        run[name] = value
    log = np.zeros(
        min(max(MIN_LOG_ROWS if gap.ndim == 1 else MIN_LOG_ROWS_OF_MANY, 2 * n), MAX_INITIAL_LOG_ROWS), CONTACT_ROW
    )
    scratch = np.zeros((MAX_SUBDIVISIONS + 1, SERIES_ORDER + 2))
    _number_tables(pairs, kinds, kind_of)
    contact_tables = (
        np.zeros(min(n, MAX_TABLED_PAIRS), OCTAVE_MAP_RECORD),
        np.zeros(INITIAL_TABLES, CONTACT_TABLE_RECORD),
        np.zeros(6),
    )
    pool = empty_pool(min(room, n) + SPARE_PLACES)
    return System(run, pairs, pool, kinds, bodies, tournament(n), log, *contact_tables, scratch, walls, ledger)


def _number_tables(pairs: Any, kinds: Any, kind_of: Any) -> None:
    """Number the sets of contact tables, which replace missing closed-form maps.

    `map` is the number of a pair's set of tables, or -1. Every pair can have its own set in a scene of at most
    `MAX_TABLED_PAIRS` pairs, see `_share_tables` for more. `kinds` and `kind_of` are as in `new_system`.
    """
    n, of_many = pairs.shape[-1], pairs.ndim > 1
    maps = np.take_along_axis(kinds["map"], pairs["kind_of"].astype(int), -1) if of_many else kinds["map"][kind_of]
    pairs["map"] = -1
    if n <= MAX_TABLED_PAIRS and (maps != DASHPOT).any():
        # under a pull only the dashpot has a map; pairs at driven walls have no tables
        without_map = (maps == NO_MAP) | ((pairs["pull"] != 0.0) & (maps != DASHPOT))
        pairs["map"] = np.where(without_map & (pairs["wall"] == 0), np.arange(n), -1)


def empty_pool(room: int) -> np.ndarray[Any, Any]:
    """Create a pool with `room` free places."""
    pool = np.zeros(room, MEMBER_RECORD)
    pool["spare"] = np.arange(room)
    return pool


def with_more_room(s: System) -> System:
    """Return the run with a pool of twice the size. All places must be taken."""
    places = empty_pool(2 * len(s.pool))[len(s.pool) :]
    return s._replace(pool=s.pool + plain(places) if isinstance(s.pool, list) else np.concatenate([s.pool, places]))


def with_room_for_a_table(s: System, i: int = 0) -> System:
    """Return the run with room for one more table of contacts.

    The number of tables doubles if all of them are in use. For many scenes, `i` is the index of the scene that needs a
    table.
    """
    of_many = isinstance(s.run[0], list) or np.ndim(s.run) > 1
    if int((s.run[i][0] if of_many else s.run[0])["tables"]) < len(s.tables):
        return s
    tables = np.zeros(len(s.tables), CONTACT_TABLE_RECORD)
    return s._replace(tables=s.tables + plain(tables) if isinstance(s.tables, list) else np.append(s.tables, tables))


def with_longer_log(s: System) -> System:
    """Return the run with a log buffer of twice the size.

    This is necessary if most of its rows belong to contacts that have not ended.
    """
    rows = np.zeros(len(s.log), CONTACT_ROW)
    return s._replace(log=s.log + plain(rows) if isinstance(s.log, list) else np.append(s.log, rows))


def system_of(scene: Scene, laws: SceneLaws, until: stop.Until | None, start: float = 0.0, **limits: Any) -> System:
    """Create the records of a scene for a run that starts at time `start` in s.

    Records are cached if the laws are cached. A scene that differs from the previous one only in gaps and velocities
    uses copies of the cached records. `limits` are fields of `SOFT_RUN_RECORD`.
    """
    # a touching pair and its two neighbours, and some later
    room = 3 * int(np.count_nonzero(scene.gap <= 0.0)) + EXTRA_PLACES
    if "records" not in laws.notes or scene._flags:
        return _new_records(scene, laws, until, start, room, limits)
    shape = scene.mass.tobytes(), scene.gravity, until, room, *limits.values()
    cached = laws.notes["records"]
    if cached is None or cached[0] != shape:
        fresh = _new_records(scene, laws, until, start, room, limits)
        if "kinds" not in laws.notes:  # the kinds depend on the speeds
            return fresh
        cached = laws.notes["records"] = shape, fresh, [records.tobytes() for records in fresh[:-2]]
    copies = [
        np.frombuffer(bytearray(data), records.dtype) for data, records in zip(cached[2], cached[1], strict=False)
    ]
    s = System._make([*copies[:-1], copies[-1].reshape(cached[1].scratch.shape), None, None])
    s.bodies["v"], s.pairs["xi"] = scene.velocity, -scene.gap
    s.pairs["eta"] = -(scene.velocity[1:] - scene.velocity[:-1])
    return s


def _new_records(
    scene: Scene, laws: SceneLaws, until: stop.Until | None, start: float, room: int, limits: dict[str, Any]
) -> System:
    """Create the records of `system_of` without using its cache.

    `room` is the number of places in the pool. Raises `OverflowError` if the inverse of a mass is too large.
    """
    # the sum of two inverse masses has to be finite
    if not 2.0 * float(scene.inverse_mass.max()) < math.inf:
        raise OverflowError("the inverse of a mass")
    kinds = law_kinds(laws, scene)
    walls = walls_of(scene, start, ROW_LENGTH) if scene.driven else None
    lift = scene.lift if scene.external_force is not None else None
    per_body: tuple[Any, ...] = scene.inverse_mass, scene.velocity
    if scene.ring:  # ball 0 again after the last ball
        lift = lift if lift is None else np.append(lift, lift[0])
        per_body = tuple(np.append(column, column[0]) for column in per_body)
    ledger = np.zeros(1, ENERGY_ACCOUNT_RECORD) if scene.driven or scene.heated else None
    s = new_system((*per_body, scene.gap, scene.gravity), kinds, laws.kind, room, until,
                   walls=walls, lift=lift, ledger=ledger, **limits)
    if scene.heated:
        _set_thermal_walls(s, scene)
    if scene.n_pairs > MAX_TABLED_PAIRS:
        _share_tables(s, laws, scene)
    if scene.ring:
        s.run["length"] = math.fsum(scene.gap)
        # two copies of the pairs, so that an island lo … hi-1 can contain the pair that closes the ring
        return s._replace(pairs=np.append(s.pairs, s.pairs))
    return _with_pendula(s, scene) if scene.pendulum > 0.0 else s


def _set_thermal_walls(s: System, scene: Scene) -> None:
    """Write the thermal walls of a scene into its records."""
    for side, thermal in enumerate(scene.thermal_walls):
        if thermal is not None:
            s.pairs["wall"][-side], s.pairs["map"][-side] = -1 - side, -1
            s.ledger["temperature"][0, side], s.ledger["seed"][0, side] = thermal.temperature, thermal.seed
            s.ledger["mass"][0, side] = scene.mass[-2 if side else 1]


def _with_pendula(s: System, scene: Scene) -> System:
    """Return the records of a scene with the quantities of pendula.

    The pull of a pair is its closing acceleration at gap 0, -Ω² d, where d is its gap at rest. There are no tables of
    contacts.
    """
    square = scene.pendulum * scene.pendulum
    assert scene.rest_gap is not None
    s.bodies["fall"] = square * scene.displacement
    s.pairs["pull"], s.pairs["map"], s.run["omega"] = -square * scene.rest_gap, -1, scene.pendulum
    return s._replace(field=Pendula(scene.pendulum, square))


def _share_tables(s: System, laws: SceneLaws, scene: Scene) -> None:
    """Assign common tables of contacts to equal pairs without a closed-form map.

    Equal pairs have equal law, m_eff and closing acceleration. Nothing is assigned if there are more than
    `MAX_TABLED_PAIRS` different kinds of such pairs.
    """
    maps = s.kinds["map"][laws.kind]
    without_map = (maps == NO_MAP) | ((scene.closing_acceleration != 0.0) & (maps != DASHPOT))
    lacking = np.flatnonzero(without_map & (s.pairs["wall"] == 0))
    if len(lacking):
        number, first = number_distinct_rows(
            laws.kind[lacking], scene.pairs.m_eff[lacking], scene.closing_acceleration[lacking]
        )
        if len(first) <= MAX_TABLED_PAIRS:
            s.pairs["map"][lacking] = number


@kernel
def join_pool(run: Any, pairs: Any, pool: Any, kinds: Any, bodies: Any, c: int) -> None:
    """Move pair `c` from free flight into the pool.

    Its record in the pool receives its state, its law and its clock.
    """
    pair, law = pairs[c], kinds[pairs[c].kind_of]
    pair.slot = pool[run.members].spare
    run.members += 1
    if RING:
        pairs[c + pair_count(pairs)].slot = pair.slot
    member = pool[pair.slot]
    if pair.mode == OPEN:
        pair.isolated = 0
    member.lower, member.upper = bodies[c].inverse_mass, bodies[c + 1].inverse_mass
    member.inverse, member.pull, member.wall = member.lower + member.upper, pair.pull, pair.wall
    member.kind, member.q, member.memory = law.kind, law.q, law.memory
    member.k, member.gamma, member.p, member.d, member.s = law.k, law.gamma, law.p, law.d, law.s
    member.xi, member.eta, member.mode, member.noise = pair.xi, pair.eta, pair.mode, pair.noise
    member.exact, member.wake, member.xi_peak, member.loading = pair.exact, pair.wake, 0.0, 1
    member.t, member.tail, member.last_step = pair.t, pair.tail, pair.last_step
    member.fired, member.event = c, pair.event
    member.clock, member.h, member.tau, member.speed, member.going_on = 1, 0.0, 0.0, 0.0, 0
    member.number, member.doubt, member.largest, member.deepest, member.sway = c, 0.0, 0.0, 0.0, 0.0
    member.head, member.manner, member.doubts = -1, 0, 0
    member.x[0], member.e[0], member.f[0] = pair.xi, pair.eta, 0.0


@kernel
def leave_pool(run: Any, pairs: Any, pool: Any, c: int) -> None:
    """Free the place of pair `c` in the pool."""
    run.members -= 1
    pool[run.members].spare, pairs[c].slot = pairs[c].slot, -1
    if RING:
        pairs[c + pair_count(pairs)].slot = -1

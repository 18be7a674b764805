"""Many small scenes in one compiled call, for parameter maps (`solve_many`)."""

from __future__ import annotations

import itertools
import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from granular._engine.check import Array
from granular._engine.compiler_state import REFERENCE_WORDS, by_reference
from granular._engine.kernels import compiled, interpreted, kernel
from granular._engine.records import set_event_time
from granular.md.located.blocks import advance, advance_islands_to_end, continue_contacts_by_pieces, start_blocks
from granular.md.located.log import drop_settled_rows
from granular.md.located.one_contact.inside import write_states
from granular.md.located.pace import MAX_PIECES_COMPILED, PAUSE_REASONS, rarely_called_kernel, test_current_block
from granular.md.located.plan import make_table
from granular.md.located.power_form import kind_and_q, set_contact_maps
from granular.md.located.records import (
    BINDING,
    CRAMPED,
    CREEPS,
    GENERAL,
    LAW_KIND_RECORD,
    LINEAR,
    MORE,
    NEEDS_CREEP_TEST,
    QUIET,
    REACHED,
    REST,
    ROWS,
    SPEED_OCTAVES,
    STOPPED,
    WANTS_REST_TEST,
    WANTS_TABLE,
)
from granular.md.located.system import System, SystemFields, new_system, to_plain, with_room_for_a_table
from granular.run import until as stop
from granular.run.trajectory import Status

STATUS_CODES = {why: list(Status).index(pause.value) for why, pause in PAUSE_REASONS.items() if why != REST} | {
    REACHED: 0,
    MORE: -1,
}
"""Index in `Status` for each return code of `blocks.advance` that ends a scene.

It is -1 for a scene that has not ended."""
SCENES_PER_BATCH = 10_000
"""Maximum number of scenes whose records are in memory at the same time."""
RESULT_RECORD = np.dtype([("why", int), ("time", float)])
LAST_CONTACT_RECORD = np.dtype(
    [
        ("counts", int), ("ongoing", np.bool_),
        ("t_end", float), ("v_lower", float), ("v_upper", float), ("longest", float), ("rate", float),
    ],
    align=True,
)
"""Results of a scene (`RESULT_RECORD`), and of each of its pairs, see `Many`."""


class Scenes(NamedTuple):
    """S scenes with the same number n of bodies.

    Arrays that are equal for all scenes can omit the first axis.

    Attributes
    ----------
    mass, velocity : (S, n) or (n,) arrays
        Masses in kg (``inf``: wall) and velocities in m/s.
    gap : (S, n-1) or (n-1,) array
        Gaps in m.
    law : (S, n-1, 4) or (n-1, 4) array
        (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ for each pair.
    gravity : (S,) array or float
        Acceleration in m/s².
    """

    mass: ArrayLike
    gap: ArrayLike
    velocity: ArrayLike
    law: ArrayLike
    gravity: ArrayLike = 0.0


class Many(NamedTuple):
    """Results of `solve_many`, one entry per scene.

    Attributes
    ----------
    status : (S,) int array
        Index in `Status` of the reason for the end. It is -1 if the scene requires `granular.md.simulate`. This applies
        to piles that creep at the end, to balls proved to rest whose overlaps are not static yet, and to laws that no
        power series represents.
    time : (S,) array
        End of the run in s.
    counts : (S, n-1) int array
        Number of contacts of each pair that began.
    ongoing : (S, n-1) bool array
        Whether a contact of the pair had not ended when the run ended.
    t_end, v_lower, v_upper : (S, n-1) arrays
        End in s of the last finished contact of each pair, and the velocities of its lower and upper body in m/s then.
        They are nan without a finished contact.
    longest : (S, n-1) array
        Duration in s of the longest finished contact of each pair, nan without one.
    rate : (S, n-1) array
        Rate in m/s at which each gap grows at the end.
    """

    status: np.ndarray[Any, np.dtype[np.int64]]
    time: Array
    counts: np.ndarray[Any, np.dtype[np.int64]]
    ongoing: np.ndarray[Any, np.dtype[np.bool_]]
    t_end: Array
    v_lower: Array
    v_upper: Array
    longest: Array
    rate: Array


def solve_many(
    scenes: Scenes, *, until: stop.Until | None = None, t_end: ArrayLike = math.inf, tol: float = 1e-16,
    max_events: int = 1_000_000, max_steps: int = 20_000_000,
    engine: str = "compiled",
) -> Many:
    """Simulate many scenes, each bitwise identical to `granular.md.simulate`.

    Parameters
    ----------
    scenes : Scenes
        Initial states and laws.
    until : stop condition, optional
        Stop condition of all scenes.
    t_end : float or (S,) array
        End time in s. Defaults to inf.
    tol, max_events, max_steps : float, int, int
        As in `granular.md.simulate`.
    engine : {"compiled", "plain"}
        Compiled by numba, or interpreted.

    Returns
    -------
    Many
        Results.
    """
    mass, gap, velocity, law, gravity = (np.asarray(column, np.float64) for column in scenes)
    m_eff = 1.0 / (1.0 / mass[..., :-1] + 1.0 / mass[..., 1:])
    end = np.asarray(t_end, np.float64)[..., None]
    columns = [1.0 / mass, velocity, gap, gravity[..., None], _kind_records(law, m_eff), end]
    (count,) = np.broadcast_shapes(*(column.shape[:-1] for column in columns), (1,))
    columns = [np.broadcast_to(column, (count, column.shape[-1])) for column in columns]
    limits: dict[str, Any] = {"tol": tol, "max_events": max_events, "max_steps": max_steps, "log_level": ROWS}
    parts = []
    for first in range(0, max(1, count), SCENES_PER_BATCH):
        *part, kinds, end = (column[first : first + SCENES_PER_BATCH].copy() for column in columns)
        n = kinds.shape[-1]
        s = new_system(part, kinds, np.arange(n), n, until, **limits)
        parts.append(_solve_batch(s, end[:, 0].copy(), engine))
    return Many(*map(np.concatenate, zip(*parts, strict=True)))


def _solve_batch(s: System, end: Array, engine: str) -> Many:
    """Solve the scenes with the records `s`, until the times `end` in s."""
    result, last = np.zeros(len(end), RESULT_RECORD), np.zeros(s.pairs.shape, LAST_CONTACT_RECORD)
    result["why"] = MORE
    for name in ("t_end", "v_lower", "v_upper", "longest"):
        last[name] = math.nan
    seen, many, i, room = np.zeros((3, last.shape[-1])), s, 0, np.zeros(REFERENCE_WORDS, np.int64)
    arguments: Any = end, MAX_PIECES_COMPILED, result, last, seen
    kernels: Any = compiled  # with the types of a single run, so fewer kernels are compiled
    if engine == "plain":
        rows, many = (result.view(np.recarray), last.view(np.recarray)), to_plain(s)
        arguments, kernels = (end.tolist(), MAX_PIECES_COMPILED, *rows, seen.tolist()), interpreted
    while (i := kernels(solve_rows)(many, room, *arguments, i)) < len(result):
        if result["why"][i] == WANTS_REST_TEST:
            rare_kernel: Any = kernels if kernels is interpreted else partial(rarely_called_kernel, kernels=kernels)
            result["why"][i] = test_current_block(
                System._make(scene_records(many, i, None)), float(end[i]), kernels, rare_kernel
            )
            continue
        many = with_room_for_a_table(many, i)
        make_table(System._make(scene_records(many, i, None)), None, kernels)
    status = np.array([STATUS_CODES.get(code, -1) for code in range(WANTS_REST_TEST + 1)])[result["why"]]
    status[(result["why"] == QUIET) & (end < math.inf)] = STATUS_CODES[REACHED]
    return Many(status, result["time"], *(last[name] for name in Many._fields[2:]))


def _kind_records(law: Array, m_eff: Array) -> Any:
    """Return the laws of pairs as records of `LAW_KIND_RECORD`.

    `law` has shape (…, 4) with (k, p, γ, d) in its last axis. `m_eff` are the effective masses of the pairs in kg.
    """
    kinds = np.zeros(np.broadcast_shapes(law.shape[:-1], m_eff.shape), LAW_KIND_RECORD)
    for i, name in enumerate(("k", "p", "gamma", "d")):
        kinds[name] = law[..., i]
    with np.errstate(all="ignore"):  # invalid laws are rejected later
        set_contact_maps(kinds, np.broadcast_to(m_eff, kinds.shape))
    kinds["elastic"] = elastic = kinds["gamma"] == 0.0
    # without damping d is arbitrary, chosen as in `damping_exponent`
    kinds["d"] = np.where(elastic, np.where(kinds["p"] == 1.5, 0.5, 0.0), kinds["d"])
    kinds["s"] = kinds["p"] - kinds["d"]  # exponent of F = ξ^d (k ξ^s + γ ξ̇)
    # the kind depends on p, d and on whether γ is 0, so one value of each is enough
    for p, d, gamma in itertools.product(np.unique(kinds["p"]), np.unique(kinds["d"]), (0.0, 1.0)):
        selected = (kinds["p"] == p) & (kinds["d"] == d) & (elastic == (gamma == 0.0))
        kinds["kind"][selected], kinds["q"][selected] = kind_and_q(1.0, p, gamma, d)
    kinds["kind"][(kinds["kind"] != LINEAR) & ~(kinds["k"] > 0.0)] = GENERAL
    return kinds


@kernel
def scene_records(many: Any, i: int, room: Any) -> Any:
    """Return the records of scene `i` as one `System` for kernels.

    Only run, pairs, kinds and bodies belong to the scene. All other records are shared by all scenes. `room` is storage
    for the table of their addresses. Interpreted code does not use it.
    """
    own_records = many.run[i], many.pairs[i], many.pool, many.kinds[i], many.bodies[i]
    shared_records = many.queue, many.log, many.maps, many.tables, many.answer, many.scratch, None, None
    return by_reference(SystemFields(*own_records, *shared_records), room)


@kernel
def solve_rows(many: Any, room: Any, t_end: Any, chunk: int, result: Any, last: Any, seen: Any, first: int) -> int:
    """Solve the scenes from number `first` onwards, one after the other.

    Returns the number of the first scene that requires a table of contacts or a test for rest or creep, or the number
    of scenes. The caller provides the requirement and calls the function again with this number. `t_end` has the end
    times in s, and `chunk` is the maximum number of pieces per call of `advance`. `seen` is temporary storage of shape
    (3, pairs).
    """
    for i in range(first, len(t_end)):
        s = scene_records(many, i, room)
        if result[i].why == MORE:
            for c in range(len(many.pool)):
                many.pool[c].spare = c
            for c in range(len(many.maps)):
                for octave in range(SPEED_OCTAVES):
                    many.maps[c].table[octave], many.maps[c].met[octave] = 0, 0
            for c in range(len(s.pairs)):
                set_event_time(many.queue, c, math.inf)
        solve(s, t_end[i], chunk, result[i], last[i], seen)
        if result[i].why in (WANTS_TABLE, WANTS_REST_TEST):
            return i
    return len(t_end)


@kernel
def solve(s: Any, t_end: float, chunk: int, result: Any, last: Any, seen: Any) -> None:
    """Solve one scene until it ends, or until it requires a table or a test.

    A scene with a law that no power series represents is skipped. The parameters are as in `solve_rows`, for one
    scene.
    """
    run, n = s.run[0], len(s.pairs)
    if result.why == MORE:
        for c in range(n):
            if s.kinds[c].kind == GENERAL:
                return
        if not start_blocks(s, None):
            result.why = STOPPED
        collect_results(s, last, 0.0)
    code = result.why if result.why in (STOPPED, REST, BINDING) else MORE
    while code == MORE:
        code = advance(s, t_end, chunk, None)
        collect_results(s, last, run.t)
    result.why, result.time = code, run.t
    if code in (WANTS_TABLE, WANTS_REST_TEST):
        return
    if code == REACHED or (code == QUIET and t_end < math.inf):
        result.time = t_end
    continue_contacts_by_pieces(s, result.time, None)
    advance_islands_to_end(s, result.time, None)
    collect_results(s, last, result.time)
    write_states(s, result.time, seen[0], seen[1], seen[2], None, None)
    for c in range(n):
        pair = s.pairs[c]
        last[c].counts, last[c].rate = pair.contacts, -seen[1][c]
        last[c].ongoing = pair.slot >= 0 and s.pool[pair.slot].going_on == 1
        if pair.first == c and pair.slot >= 0 and s.pool[pair.slot].manner in (CREEPS, NEEDS_CREEP_TEST):
            result.why = CRAMPED  # left to a single run


@kernel
def collect_results(s: Any, last: Any, t: float) -> None:
    """Move the contacts that ended by time `t` (s) from the log buffer to the results.

    `last` has one record per pair. End time and final velocities of a contact replace the values of the previous
    contact of its pair, and the longest duration is updated. The rows are removed from the buffer.
    """
    for i in range(s.run[0].rows):
        row = s.log[i]
        if row.pair >= 0 and row.t_end <= t:
            pair = last[row.pair]
            pair.t_end, pair.v_lower, pair.v_upper = row.t_end, row.lower_out, row.upper_out
            if not pair.longest >= row.duration:
                pair.longest = row.duration
    drop_settled_rows(s, t)


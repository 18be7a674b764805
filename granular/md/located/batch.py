"""`solve_many`: many small scenes in one compiled call, for parameter maps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from granular import until as stop
from granular._check import Array
from granular._kernels import compiled, kernel
from granular.md.located.build import kind_and_q, limit
from granular.md.located.loop import (
    MORE,
    QUIET,
    REACHED,
    STOPPED,
    advance,
    clear_log,
    gather,
    is_begun,
    launch,
    pause_later,
)
from granular.md.located.powers import power
from granular.md.located.readout import look
from granular.md.located.records import ACTIVE, GENERAL, LINEAR, NO_PAUSE, OPEN, RESIDUAL, new_system, to_plain
from granular.md.located.run import COMPILED_CHUNK, FIRST_LOOK, WHY
from granular.trajectory import Status

INPUT = 7
"""Numbers of a pair in a row of input: ξ, k, p, γ, d, kind, q."""
ENDED, TIME, HEAD = 0, 1, 2
COUNT, ONGOING, T_END, LOWER, UPPER, LONGEST, RATE, OUTPUT = range(8)
"""A row of output: two numbers of the run, then these of each pair."""
CODES = {why: list(Status).index(pause.value) for why, pause in WHY.items()} | {REACHED: 0, MORE: -1}
"""Places in `Status` of the reasons for which `advance` returns."""


class Scenes(NamedTuple):
    """S scenes of the same number n of bodies; what all have in common may lack the first axis.

    Attributes
    ----------
    mass, velocity : (S, n) or (n,) arrays
        Masses in kg (``inf``: wall) and velocities in m/s.
    gap : (S, n-1) or (n-1,) array
        Gaps in m.
    law : (S, n-1, 4) or (n-1, 4) array
        (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ for each pair.
    gravity : (S,) array or float
        In m/s².
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
        Place in `Status` of why the run ended; -1 if it is left to `granular.md.simulate`, as piles that may creep and
        laws that no power series follows.
    time : (S,) array
        When it ended, in s.
    counts : (S, n-1) int array
        Contacts of each pair that began.
    ongoing : (S, n-1) bool array
        Whether a contact of the pair was still running at the end.
    t_end, v_lower, v_upper : (S, n-1) arrays
        End in s of the last contact of each pair that ended, and the velocities of its bodies in m/s then; nan without.
    longest : (S, n-1) array
        Duration in s of the longest contact of each pair that ended; nan without.
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
    leave_piles: bool = True, engine: str = "compiled",
) -> Many:  # fmt: skip
    """Run many scenes, each as `granular.md.simulate` would, bit for bit.

    Parameters
    ----------
    scenes : Scenes
        Where they start, and their laws.
    until, t_end : stop condition, float or (S,) array
        When to stop.
    tol, max_events, max_steps : float, int, int
        As in `granular.md.simulate`.
    leave_piles : bool
        Whether a pile that may creep is left to `granular.md.simulate`, which needs no steps for it.
    engine : {"compiled", "plain"}
        Compiled by numba, or interpreted.
    """
    table, pairs = _rows(scenes)
    end = np.broadcast_to(np.asarray(t_end, np.float64), len(table))
    s = new_system(pairs, pairs, pairs)
    limit(s, until, tol, max_events, max_steps, 1)
    s.run["pause"] = FIRST_LOOK if leave_piles else NO_PAUSE
    out, scratch = np.zeros((len(table), HEAD + OUTPUT * pairs)), np.zeros((3, pairs))
    if engine == "plain":
        rows = out.tolist()
        solve_rows(to_plain(s), table.tolist(), end.tolist(), rows, scratch.tolist())
        out = np.array(rows)
    else:
        compiled(solve_rows)(s, table, np.ascontiguousarray(end), out, scratch)
    why, each = out[:, ENDED].astype(np.int64), np.moveaxis(out[:, HEAD:].reshape(len(out), -1, OUTPUT), 2, 0)
    status = np.array([CODES.get(code, -1) for code in range(max(CODES) + 1)])[why]
    status[(why == QUIET) & (end < math.inf)] = CODES[REACHED]
    return Many(status, out[:, TIME], each[COUNT].astype(np.int64), each[ONGOING] != 0.0, *each[T_END:])


def _rows(scenes: Scenes) -> tuple[Array, int]:
    """One row per scene (g; 1/m and v of every body; seven numbers of every pair), and the count of pairs."""
    m, x, v, f, g = (np.asarray(column, np.float64) for column in scenes)
    n, n_pairs = m.shape[-1], x.shape[-1]
    size = np.broadcast_shapes(m.shape[:-1], x.shape[:-1], v.shape[:-1], f.shape[:-2], g.shape, (1,))
    table = np.zeros((*size, 1 + 2 * n + INPUT * n_pairs))
    bodies = table[:, 1 : 1 + 2 * n].reshape(*size, n, 2)
    pairs = table[:, 1 + 2 * n :].reshape(*size, n_pairs, INPUT)
    table[:, 0], bodies[..., 0], bodies[..., 1] = g, 1.0 / m, v
    pairs[..., 0], pairs[..., 1:5] = -x, f
    elastic = pairs[..., 3] == 0.0
    pairs[..., 4] = np.where(elastic, np.where(pairs[..., 2] == 1.5, 0.5, 0.0), pairs[..., 4])
    for p in np.unique(pairs[..., 2]):
        for d in np.unique(pairs[..., 4]):
            these = (pairs[..., 2] == p) & (pairs[..., 4] == d)
            pairs[these & elastic, 5:7] = kind_and_q(1.0, p, 0.0, d)
            pairs[these & ~elastic, 5:7] = kind_and_q(1.0, p, 1.0, d)
    pairs[(pairs[..., 5] != LINEAR) & ~(pairs[..., 1] > 0.0), 5] = GENERAL
    return table, n_pairs


@kernel
def solve_rows(s: Any, table: Any, t_end: Any, out: Any, scratch: Any) -> None:
    """Solve every scene of `table` in the workspace `s`, from start to end."""
    n, first_look = len(s.pairs), s.run[0].pause
    for i in range(len(table)):
        row = out[i]
        for c in range(n):
            at = HEAD + OUTPUT * c
            for k in range(T_END, RATE):
                row[at + k] = math.nan
        row[ENDED] = MORE
        if not reset(s, table[i]):
            continue
        why = MORE if launch(s, None) else STOPPED
        harvest(s, row)
        s.run[0].pause = first_look
        while why == MORE and not may_creep(s):
            if s.run[0].steps >= s.run[0].pause:
                pause_later(s)
            why = advance(s, t_end[i], COMPILED_CHUNK, None)
            harvest(s, row)
        row[ENDED] = why
        row[TIME] = t_end[i] if why == REACHED or (why == QUIET and t_end[i] < math.inf) else s.run[0].t
        finish(s, n, row, scratch)


@kernel
def reset(s: Any, row: Any) -> bool:
    """Put the scene of a table row into the workspace; false if a law of it is none that a power series follows."""
    run = s.run[0]
    n = len(s.pairs)
    run.pairs, run.events, run.steps, run.begun, run.rows, run.error, run.t = n, 0, 0, 0, 0, 0.0, 0.0
    run.piled, run.rests, run.members, run.waits, run.tail = 0, 0, 0, 0, 0.0
    for b in range(n + 1):
        body = s.bodies[b]
        body.inverse_mass, body.v, body.t, body.tail = row[1 + 2 * b], row[2 + 2 * b], 0.0, 0.0
        body.fall = row[0] if body.inverse_mass > 0.0 else 0.0
    for c in range(n):
        at = 1 + 2 * (n + 1) + INPUT * c
        pair, law, s.pool[c].spare = s.pairs[c], s.kinds[c], c
        law.k, law.p, law.gamma, law.d = row[at + 1], row[at + 2], row[at + 3], row[at + 4]
        law.s, law.kind, law.q = law.p - law.d, int(row[at + 5]), int(row[at + 6])
        if law.kind == GENERAL:
            return False
        pair.pull, pair.kind_of = s.bodies[c + 1].fall - s.bodies[c].fall, c
        pair.xi, pair.eta = row[at], s.bodies[c].v - s.bodies[c + 1].v
        pair.mode, pair.exact, pair.count = first_mode(pair.xi, pair.eta, law), 0, 0
        pair.t, pair.tail, pair.stride, pair.noise, pair.wake = 0.0, 0.0, 0.0, 0.0, 0.0
    return True


@kernel
def first_mode(xi: float, eta: float, law: Any) -> int:
    """Return the mode in which a pair starts."""
    if xi < 0.0 or (xi == 0.0 and eta <= 0.0):
        return OPEN
    if xi > 0.0 and law.k * power(xi, law.s) + law.gamma * eta <= 0.0:
        return RESIDUAL
    return ACTIVE


@kernel
def may_creep(s: Any) -> bool:
    """Return whether a run by itself would now look whether a pile creeps, and go on by its modes; left to that."""
    if s.run[0].steps < s.run[0].pause or s.bodies[0].inverse_mass > 0.0 or s.pairs[0].slot < 0:
        return False
    first = s.pool[s.pairs[0].slot]
    return bool(first.mode == ACTIVE and first.kind == LINEAR and first.gamma > 0.0)


@kernel
def harvest(s: Any, row: Any) -> None:
    """Take what is asked out of the log."""
    for i in range(s.run[0].rows):
        contact = s.log[i]
        at = HEAD + OUTPUT * contact.pair
        row[at + T_END], row[at + LOWER], row[at + UPPER] = contact.t_end, contact.lower_out, contact.upper_out
        if not row[at + LONGEST] >= contact.duration:
            row[at + LONGEST] = contact.duration
    clear_log(s)


@kernel
def finish(s: Any, n: int, row: Any, scratch: Any) -> None:
    """Write counts, contacts still running and final rates."""
    t = row[TIME]
    gather(s, t, None)
    look(s, t, scratch[0], scratch[1], scratch[2])
    for c in range(n):
        at = HEAD + OUTPUT * c
        row[at + COUNT], row[at + ONGOING] = s.pairs[c].count, is_begun(s, c)
        row[at + RATE] = -scratch[1][c]

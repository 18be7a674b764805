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
from granular.md.located.loop import REACHED, advance, is_begun, launch
from granular.md.located.powers import power
from granular.md.located.records import ACTIVE, OPEN, RESIDUAL, System, new_system, to_plain

PER_PAIR = 7
RESULT = 6


class Many(NamedTuple):
    """Results of `solve_many`, one entry per scene.

    Attributes
    ----------
    why : (S,) int array
        Why the run ended: a code of `granular.md.located.loop`.
    time : (S,) array
        When it ended, in s.
    counts : (S, n-1) int array
        Contacts of each pair that began.
    t_end, v_lower, v_upper : (S,) arrays
        End in s of the last logged contact of the observed pair, and the velocities of its bodies in m/s then; nan if
        there was none.
    ongoing : (S,) bool array
        Whether a contact of the observed pair was still running at the end.
    """

    why: np.ndarray[Any, np.dtype[np.int64]]
    time: Array
    counts: np.ndarray[Any, np.dtype[np.int64]]
    t_end: Array
    v_lower: Array
    v_upper: Array
    ongoing: np.ndarray[Any, np.dtype[np.bool_]]


def solve_many(
    mass: ArrayLike, gap: ArrayLike, velocity: ArrayLike, law: ArrayLike, *, gravity: ArrayLike = 0.0,
    until: stop.Contact | None = None, observe: int = -1, t_end: float = math.inf, tol: float = 1e-16,
    max_events: int = 10_000, max_steps: int = 100_000, engine: str = "compiled",
) -> Many:  # fmt: skip
    """Run many scenes of the same number n of bodies, each as `granular.md.simulate` would, bit for bit.

    Parameters
    ----------
    mass, velocity : (S, n) or (n,) arrays
        Masses in kg (``inf``: wall) and velocities in m/s.
    gap : (S, n-1) or (n-1,) array
        Gaps in m.
    law : (S, n-1, 4) or (n-1, 4) array
        (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ for each pair.
    gravity : (S,) array or float
        In m/s².
    until : stop condition, optional
        From `granular.until.contact`.
    observe : int
        Pair whose last contact is reported; the last pair if not given.
    engine : {"compiled", "plain"}
        Compiled by numba, or interpreted.
    """
    table, p = scene_rows(mass, gap, velocity, law, gravity)
    s = workspace(p, until, tol, max_events, max_steps)
    out = np.zeros((len(table), RESULT + p))
    if engine == "plain":
        plain_out = out.tolist()
        solve_rows(to_plain(s), table.tolist(), plain_out, observe % p, t_end)
        out = np.array(plain_out)
    else:
        compiled(solve_rows)(s, table, out, observe % p, t_end)
    return Many(
        out[:, 0].astype(np.int64), out[:, 1], out[:, RESULT:].astype(np.int64), out[:, 2], out[:, 3], out[:, 4],
        out[:, 5] != 0.0,
    )  # fmt: skip


def workspace(n_pairs: int, until: stop.Until | None, tol: float, max_events: int, max_steps: int) -> System:
    """Return the workspace in which scenes of `n_pairs` pairs are solved one after the other."""
    s = new_system(n_pairs, n_pairs, n_pairs)
    limit(s, until, tol, max_events, max_steps, 1)
    return s


def scene_rows(mass: Any, gap: Any, velocity: Any, law: Any, gravity: Any) -> tuple[Array, int]:
    """One row per scene (g; 1/m and v of every body; ξ, k, p, γ, d, kind, q of every pair), and the count of pairs."""
    m, x, v, f, g = (np.asarray(a, np.float64) for a in (mass, gap, velocity, law, gravity))
    n, n_pairs = m.shape[-1], x.shape[-1]
    size = np.broadcast_shapes(m.shape[:-1], x.shape[:-1], v.shape[:-1], f.shape[:-2], g.shape, (1,))
    table = np.zeros((*size, 1 + 2 * n + PER_PAIR * n_pairs))
    bodies = table[:, 1 : 1 + 2 * n].reshape(*size, n, 2)
    pairs = table[:, 1 + 2 * n :].reshape(*size, n_pairs, PER_PAIR)
    table[:, 0], bodies[..., 0], bodies[..., 1] = g, 1.0 / m, v
    pairs[..., 0], pairs[..., 1:5] = -x, f
    elastic = pairs[..., 3] == 0.0
    pairs[..., 4] = np.where(elastic, np.where(pairs[..., 2] == 1.5, 0.5, 0.0), pairs[..., 4])
    for p in np.unique(pairs[..., 2]):
        for d in np.unique(pairs[..., 4]):
            these = (pairs[..., 2] == p) & (pairs[..., 4] == d)
            pairs[these & elastic, 5:7] = kind_and_q(1.0, p, 0.0, d)
            pairs[these & ~elastic, 5:7] = kind_and_q(1.0, p, 1.0, d)
    return table, n_pairs


@kernel
def solve_rows(s: Any, table: Any, out: Any, observe: int, t_end: float) -> None:
    """Solve every scene of `table` in the workspace `s`."""
    for i in range(len(table)):
        reset(s, table[i])
        why = advance(s, t_end, s.run[0].max_steps, None) if launch(s, None) else -1
        report(s, why, observe, t_end, out[i])


@kernel
def reset(s: Any, row: Any) -> None:
    """Put the scene of a table row into the workspace."""
    run = s.run[0]
    n = len(s.pairs)
    run.pairs, run.events, run.steps, run.begun, run.rows, run.error, run.t = n, 0, 0, 0, 0, 0.0, 0.0
    run.piled, run.rests, run.members, run.waits, run.tail = 0, 0, 0, 0, 0.0
    for b in range(n + 1):
        body = s.bodies[b]
        body.inverse_mass, body.v, body.t, body.tail = row[1 + 2 * b], row[2 + 2 * b], 0.0, 0.0
        body.fall = row[0] if body.inverse_mass > 0.0 else 0.0
    for c in range(n):
        at = 1 + 2 * (n + 1) + 7 * c
        pair, law, s.pool[c].spare = s.pairs[c], s.kinds[c], c
        law.k, law.p, law.gamma, law.d = row[at + 1], row[at + 2], row[at + 3], row[at + 4]
        law.s, law.kind, law.q = law.p - law.d, int(row[at + 5]), int(row[at + 6])
        pair.pull, pair.kind_of = s.bodies[c + 1].fall - s.bodies[c].fall, c
        pair.xi, pair.eta = row[at], s.bodies[c].v - s.bodies[c + 1].v
        pair.mode, pair.exact, pair.count = first_mode(pair.xi, pair.eta, law), 0, 0
        pair.t, pair.tail, pair.stride, pair.noise, pair.wake = 0.0, 0.0, 0.0, 0.0, 0.0


@kernel
def first_mode(xi: float, eta: float, law: Any) -> int:
    """Return the mode in which a pair starts."""
    if xi < 0.0 or (xi == 0.0 and eta <= 0.0):
        return OPEN
    if xi > 0.0 and law.k * power(xi, law.s) + law.gamma * eta <= 0.0:
        return RESIDUAL
    return ACTIVE


@kernel
def report(s: Any, why: int, observe: int, t_end: float, out: Any) -> None:
    """Write what a solved scene has come to."""
    run = s.run[0]
    out[0], out[1] = why, t_end if why == REACHED else run.t
    out[2], out[3], out[4] = math.nan, math.nan, math.nan
    for i in range(run.rows):
        row = s.log[i]
        if row.pair == observe:
            out[2], out[3], out[4] = row.t_end, row.lower_out, row.upper_out
    out[5] = is_begun(s, observe)
    for c in range(run.pairs):
        out[6 + c] = s.pairs[c].count

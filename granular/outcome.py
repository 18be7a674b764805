"""What a run comes to, read from its contact log: how pairs part, how balls leave, and how far two runs differ."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granular._check import Array
from granular.trajectory import Trajectory

SAME = 0.01
"""Outcomes closer than this share of the fastest impact are called the same."""
INSTANT = 1e-12
"""Collisions closer than this share of the time since the start are in one instant: rounding decides which is first."""


@dataclass(frozen=True)
class PairOutcome:
    """What one pair has done under both engines by the end of its last contact that counts.

    Attributes
    ----------
    pair : int
        Number of the pair.
    hard_contacts, soft_contacts : int
        Number of contacts, without those that are rounding (`granular.components.without_rounding`).
    hard_v_rel, soft_v_rel : float
        Separation speed v[c+1] - v[c] in m/s at the end of the pair's last contact; nan without contacts.
    hard_t_f, soft_t_f : float
        When that was, in s.
    ongoing : bool
        The last soft contact was still running at `until` and was followed to its end (v_rel is nan if it rests).
    """

    pair: int
    hard_contacts: int
    soft_contacts: int
    hard_v_rel: float
    soft_v_rel: float
    hard_t_f: float
    soft_t_f: float
    ongoing: bool


def pair_outcomes(hard: Trajectory, soft: Trajectory, cut: Trajectory) -> tuple[PairOutcome, ...]:
    """Outcome of every pair of two runs that are `end_time.levelled`; `cut` is the soft run as it was cut."""
    ongoing = np.zeros(soft.scene.n_pairs, dtype=np.bool_)
    ongoing[cut.contacts["pair"][np.isnan(cut.contacts["t_end"])]] = True
    columns = [counts(hard), counts(soft), *separations(hard), *separations(soft), ongoing]
    n_hard, n_soft, hard_v, hard_t, soft_v, soft_t, open_ = (column.tolist() for column in columns)
    return tuple(map(PairOutcome, range(len(n_hard)), n_hard, n_soft, hard_v, soft_v, hard_t, soft_t, open_))


def counts(run: Trajectory) -> Any:
    """Number of contacts of every pair, shape (n-1,)."""
    return np.diff(run.by_pair[1])


def partings(run: Trajectory) -> Array:
    """Separation speed v′ in m/s at the end of the last contact of every pair; nan without one."""
    return separations(run)[0]


def separations(run: Trajectory) -> tuple[Array, Array]:
    """Separation speed in m/s and time in s at the end of the last contact of every pair; nan without one."""
    order, edge = run.by_pair
    met = np.flatnonzero(np.diff(edge))
    last = run.contacts[order[edge[met + 1] - 1]]
    speed, time = np.full((2, len(edge) - 1), math.nan)
    speed[met], time[met] = last["v_out"][:, 1] - last["v_out"][:, 0], last["t_end"]
    return speed, time


def leaving(run: Trajectory) -> tuple[Array, Array]:
    """Velocity u in m/s with which each body leaves the last of its contacts that ends, and when in s, shapes (n,).

    The initial velocity, at the start, without contacts; nan where the last contact to begin has no end.
    """
    u, log = run.scene.velocity.copy(), run.contacts
    at = np.full(len(u), float(run.time[0]))
    rank = np.where(np.isnan(log["t_end"]), math.inf, log["t_end"])
    order = np.argsort(rank, kind="stable")
    met = np.column_stack(run.scene.bodies(log["pair"][order])).ravel()
    u[met], at[met] = log["v_out"][order].ravel(), np.repeat(log["t_end"][order], 2)  # the last assignment stays
    return u, at


def leaving_velocities(run: Trajectory) -> Array:
    """Velocity u in m/s with which each body leaves, see `leaving`."""
    return leaving(run)[0]


def at_once(hard: Trajectory) -> Trajectory:
    """The run of hard spheres with the collisions of a pair in one instant as one, at whose end the instant is over.

    What a rule does within an instant, such as ball after ball, is no physics: a pair parts with the velocities that
    its bodies have after all collisions of that instant. Collisions within `INSTANT` of the time are in one.
    """
    log = hard.contacts
    if len(log) < 2:
        return hard
    time, rows = log["t_begin"], np.arange(len(log))
    instant = np.cumsum(np.diff(time, prepend=time[0]) > INSTANT * (time - hard.time[0]))
    after = log["v_out"].copy()
    body, k = np.column_stack(hard.scene.bodies(log["pair"])).ravel(), np.repeat(rows, 2)
    by_body = np.lexsort((k, instant[k], body))
    ends = np.append((np.diff(body[by_body]) != 0) | (np.diff(instant[k][by_body]) != 0), True)
    final = by_body[np.flatnonzero(ends)[np.cumsum(np.append(False, ends[:-1]))]]  # its body's last of the instant
    after.ravel()[by_body] = log["v_out"].ravel()[final]
    order = np.lexsort((rows, instant, log["pair"]))
    again = np.append(False, (np.diff(log["pair"][order]) == 0) & (np.diff(instant[order]) == 0))
    if not again.any() and (after == log["v_out"]).all():
        return hard
    log = log.copy()
    log["v_out"] = after
    return replace(hard, contacts=log[np.sort(order[~again])])


def strengths(run: Trajectory) -> Array:
    """How hard each contact of the log is, in m/s: by approach, and by impulse / m_eff, as touching balls have none."""
    log = run.contacts
    m_eff = run.scene.pairs.m_eff[log["pair"]]
    strength: Array = np.maximum(approach(run), log["impulse"] / m_eff)
    return strength


def approach(run: Trajectory) -> Array:
    """Speeds in m/s at which the contacts of the log close at their onset."""
    return np.asarray(run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1])

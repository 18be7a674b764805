"""What a run comes to, read from its contact log: how pairs part, how balls leave, and how far two runs differ."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granular import md
from granular._check import Array
from granular.binary import collision
from granular.laws.kinds import resolved
from granular.trajectory import Status, Trajectory
from granular.walls import ends

SAME = 0.01
"""Outcomes closer than this share of the impact speed are called the same."""
PATIENCE = 20.0
"""A contact still running at the end of a run is followed for so many of its isolated durations."""


@dataclass(frozen=True)
class PairOutcome:
    """What one pair has done under both engines by the end of its last contact that began before `until`.

    Attributes
    ----------
    pair : int
        Number of the pair.
    hard_contacts, soft_contacts : int
        Number of contacts, without those that are rounding (`granular.measures.without_rounding`).
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


def pair_outcomes(hard: Trajectory, soft: Trajectory, to_the_end: Trajectory) -> tuple[PairOutcome, ...]:
    """Outcome of every pair; `to_the_end` is the soft run with its running contacts `followed`."""
    ongoing = np.zeros(soft.scene.n_pairs, dtype=np.bool_)
    ongoing[soft.contacts["pair"][np.isnan(soft.contacts["t_end"])]] = True
    columns = [counts(hard), counts(soft), *separations(hard), *separations(to_the_end), ongoing]
    n_hard, n_soft, hard_v, hard_t, soft_v, soft_t, open_ = (column.tolist() for column in columns)
    return tuple(map(PairOutcome, range(len(n_hard)), n_hard, n_soft, hard_v, soft_v, hard_t, soft_t, open_))


def counts(run: Trajectory) -> Any:
    """Number of contacts of every pair, shape (n-1,)."""
    return np.diff(run.by_pair[1])


def separations(run: Trajectory) -> tuple[Array, Array]:
    """Separation speed in m/s and time in s at the end of the last contact of every pair; nan without one."""
    order, edge = run.by_pair
    met = np.flatnonzero(np.diff(edge))
    last = run.contacts[order[edge[met + 1] - 1]]
    speed, time = np.full((2, len(edge) - 1), math.nan)
    speed[met], time[met] = last["v_out"][:, 1] - last["v_out"][:, 0], last["t_end"]
    return speed, time


def leaving_velocities(run: Trajectory) -> Array:
    """Velocity u in m/s with which each body leaves the last of its contacts that ends, shape (n,).

    The initial velocity without contacts; nan where none has an end.
    """
    u, log = run.scene.velocity.copy(), run.contacts
    u[np.concatenate(run.scene.bodies(log["pair"]))] = math.nan
    over = np.flatnonzero(~np.isnan(log["t_end"]))
    over = over[np.argsort(log["t_end"][over], kind="stable")]
    met = np.column_stack(run.scene.bodies(log["pair"][over])).ravel()
    u[met] = log["v_out"][over].ravel()  # the last assignment stays
    return u


def largest_difference(one: Trajectory, other: Trajectory) -> float:
    """Largest difference in m/s of a leaving velocity of a ball, or of a separation speed of a pair.

    max( max_i |u_i - u_i*|, max_c |v′_c - v′_c*| ) over balls i, without walls, and pairs c. What is nan is left out;
    nan if that is all.
    """
    balls = np.abs(leaving_velocities(one) - leaving_velocities(other))[~one.scene.is_wall]
    pairs = np.abs(separations(one)[0] - separations(other)[0])
    known = np.concatenate([balls, pairs])
    known = known[~np.isnan(known)]
    return float(known.max()) if len(known) else math.nan


def followed(soft: Trajectory, options: Mapping[str, Any]) -> Trajectory:
    """The run with contacts that were still running at its end followed to theirs, in its log.

    Given up after `PATIENCE` times their isolated duration, where the path of a wall ends, and for laws with memory and
    beside thermal walls, which cannot be gone on with.

    Parameters
    ----------
    soft : Trajectory
        A soft-sphere run without contacts that are rounding.
    options : mapping
        Those of `granular.md.simulate` with which it was made.
    """
    assert soft.law is not None
    running = np.flatnonzero(np.isnan(soft.contacts["t_end"]))
    if not len(running) or soft.scene.heated or has_memory(soft) or soft.status not in (Status.until, Status.time):
        return soft
    log = soft.contacts.copy()
    patience = PATIENCE * _durations(soft, running)
    left = running[log["duration"][running] <= patience]
    patience = patience[log["duration"][running] <= patience]
    scene, now = soft.scene, float(soft.time[-1])
    velocity = np.where(scene.is_wall, scene.velocity, soft.velocity[-1])  # walls add how they are shaken
    rest = scene.replace(gap=soft.gap[-1], velocity=velocity, origin=float(soft.position[-1][0]))
    start = now if scene.driven else 0.0  # a clock that begins anew is finer, but walls have theirs
    for share in (0.1, 1.0):  # most are over soon
        end = min(start + share * float(patience.max(initial=0.0)), ends(*scene.motions))
        if len(left) and end > start:
            later = md.simulate(rest, soft.law, t_start=start, t_end=end, **options)
            ended = _end(log, left, later, patience, now)
            left, patience = left[~ended], patience[~ended]
    return replace(soft, contacts=log)


def has_memory(soft: Trajectory) -> bool:
    """Whether a law of a soft-sphere run has memory, so that its last state does not tell how it goes on."""
    return soft.law is not None and any(law.memory for law in resolved(soft.law, soft.scene).each)


def _end(log: Any, rows: Any, later: Trajectory, patience: Array, start: float) -> Any:
    """Write the ends of contacts, as a run from `start` (s) on has them, into `log`; return which have one."""
    ended = np.zeros(len(rows), dtype=np.bool_)
    for i, row in enumerate(rows):
        first = later.of(int(log["pair"][row]))[:1]
        if len(first) and (after := first["t_end"][0] - later.time[0]) <= patience[i]:
            ended[i] = True
            log["t_end"][row] = start + after
            log["duration"][row] += first["duration"][0]
            log["v_out"][row] = first["v_out"][0]
    return ended


def _durations(soft: Trajectory, rows: Any) -> Array:
    """Durations in s of some contacts had they been isolated, judged by approach and by impulse so far."""
    assert soft.law is not None
    speed, pair = strengths(soft)[rows], soft.contacts["pair"][rows].tolist()
    return np.array([_alone(soft, c, v) for c, v in zip(pair, speed.tolist(), strict=True)])


def _alone(soft: Trajectory, c: int, speed: float) -> float:
    """Duration in s of an isolated contact of pair `c`; 0 if it is none, as one that began at rest, or has no end."""
    assert soft.law is not None
    try:
        return collision(soft.law[c], soft.scene.pairs[c], speed).duration
    except ValueError:
        return 0.0


def strengths(run: Trajectory) -> Array:
    """How hard each contact of the log is, in m/s: by approach, and by impulse / m_eff, as touching balls have none."""
    log = run.contacts
    m_eff = run.scene.pairs.m_eff[log["pair"]]
    strength: Array = np.maximum(log["v_in"][:, 0] - log["v_in"][:, 1], log["impulse"] / m_eff)
    return strength

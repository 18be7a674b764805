"""Whether two runs cut at one end time differ only by contacts that fall on the other side of it.
May be skipped: rarer, contacts about the end time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular.measures import durations
from granular.outcome import counts
from granular.trajectory import Status, Trajectory

SMALL = 0.1
"""Up to this share of a run, or of the time between contacts, a contact or a lag is called short."""


def same_but_for_timing(soft: Trajectory, hard: Trajectory, tolerance: float) -> bool:
    """Whether two runs cut at one end time differ only by contacts within the lag of soft spheres before it.

    The lag is one duration per collision of the busiest pair, and must be small beside the time between its contacts.
    From the contacts that both runs have the balls must leave at the same velocities, within `tolerance` in m/s.
    """
    if not soft.status is hard.status is Status.time:
        return False
    end, span = float(soft.time[-1]), float(soft.time[-1] - soft.time[0])
    more, fewer = np.maximum(counts(soft), counts(hard)), np.minimum(counts(soft), counts(hard))
    busiest = int(more.max())
    lag = _longest(soft, hard) * (1.0 + busiest)
    early = np.maximum(_counts_before(soft, end - lag), _counts_before(hard, end - lag))
    only_late = lag * busiest <= SMALL * span and (more > fewer).any() and (early <= fewer).all()
    return bool(only_late) and _same_velocities(soft, hard, tolerance)


def _counts_before(run: Trajectory, time: float) -> Any:
    """Number of contacts of each pair that began before `time`."""
    log = run.contacts
    return np.bincount(log["pair"][log["t_begin"] < time], minlength=run.scene.n_pairs)


def _longest(soft: Trajectory, hard: Trajectory) -> float:
    """Longest contact in s: of those of the soft run, and of those of the hard run had they been isolated."""
    assert soft.law is not None
    isolated = durations(hard, soft.law)
    return max(float(soft.contacts["duration"].max(initial=0.0)), float(isolated.max(initial=0.0)))


def _same_velocities(one: Trajectory, other: Trajectory, tolerance: float) -> bool:
    """Whether from all contacts that both runs have, and that are over, balls leave at the same velocities."""
    common = np.minimum(counts(one), counts(other))
    nth = np.concatenate([np.arange(n) for n in common])
    rows = [run.by_pair[0][np.repeat(run.by_pair[1][:-1], common) + nth] for run in (one, other)]
    apart = np.abs(one.contacts["v_out"][rows[0]] - other.contacts["v_out"][rows[1]])
    return not bool((apart > tolerance).any())

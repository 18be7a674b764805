"""What one pair has done under both engines, read from the contact logs at the end of its last contact."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from granular import md
from granular.binary import collision
from granular.scene import Scene
from granular.trajectory import Status, Trajectory


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


def pair_outcome(hard: Trajectory, soft: Trajectory, c: int, options: Mapping[str, Any]) -> PairOutcome:
    """Outcome of pair `c`; `options` of `granular.md.simulate` are those of the soft run."""
    hard_v, hard_t = last_separation(hard, c)
    soft_v, soft_t = last_separation(soft, c)
    ongoing = soft.count(c) > 0 and math.isnan(soft.of(c)[-1]["t_end"])
    if ongoing and soft.status in (Status.until, Status.time):
        soft_v, soft_t = _followed(soft, c, options)
    return PairOutcome(c, hard.count(c), soft.count(c), hard_v, soft_v, hard_t, soft_t, ongoing)


def last_separation(run: Trajectory, c: int) -> tuple[float, float]:
    """Separation speed and time at the end of the last contact of pair `c`; nan without one."""
    log = run.of(c)
    if not len(log):
        return math.nan, math.nan
    row = log[-1]
    return float(row["v_out"][1] - row["v_out"][0]), float(row["t_end"])


def _followed(soft: Trajectory, c: int, options: Mapping[str, Any]) -> tuple[float, float]:
    """Follow a contact still running at the end of the run to its own end, for at most 20 times its isolated t_c."""
    scene, law = soft.scene, soft.law
    assert law is not None
    if any(getattr(one, "memory", False) for one in law):
        return math.nan, math.nan
    rest = Scene(scene.mass, scene.radius, soft.gap[-1], soft.velocity[-1], scene.gravity, float(soft.position[-1][0]))
    start = float(soft.time[-1])
    row = soft.of(c)[-1]
    try:
        patience = 20.0 * collision(law[c], scene.pairs[c], max(abs(row["v_in"][0] - row["v_in"][1]), 1e-300)).duration
    except ValueError:  # begun at rest, or never to end: there is no such contact alone
        patience = 0.0
    if row["duration"] > patience:
        return math.nan, math.nan
    run = md.simulate(rest, law, t_end=patience, **options)
    first = run.of(c)[:1]
    if not len(first) or math.isnan(first[0]["t_end"]):
        return math.nan, math.nan
    return float(first[0]["v_out"][1] - first[0]["v_out"][0]), start + float(first[0]["t_end"])

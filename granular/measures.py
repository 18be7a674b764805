"""How far event-driven simulation is wrong, as numbers: pure functions of two trajectories of one scene.

=========  ===========================================================================================================
φ          share of the contact impulse exchanged while a neighbouring pair is active (0: every contact is binary)
p          share of EDMD events with an event of a neighbouring pair within t_c
Λ          mean t_c × rate of collisions of a pair: the share of time a pair spends in contact
D          √(Σ m (Δv)² / Σ m v₀²) between final velocities, brought to a common time by free fall
K_cm       ratio (soft / hard) of the restitution of the centre of mass, scenes with one wall
=========  ===========================================================================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from granular import binary
from granular._check import Array
from granular.laws import traits
from granular.md.stability import expected_overlap
from granular.scene import Scene
from granular.trajectory import Status, Trajectory

SAME = 0.01
"""Outcomes closer than this share of the impact speed are called the same."""
SMALL = 0.1
"""Up to this share of a run, or of the time between contacts, a contact or a lag is called short."""
ROUNDING = 1e-12
"""Impacts weaker than this share of the fastest are rounding: a contact leaves some 1e-15, a thousand leave this."""


@dataclass(frozen=True)
class Overlap:
    """Two contacts of neighbouring pairs that share a span of time: the reason why the engines differ.

    Attributes
    ----------
    lower, upper : int
        Rows of the contact log; the pair of `upper` is the next one up.
    begin, end : float
        The shared span in s.
    """

    lower: int
    upper: int
    begin: float
    end: float


def overlapping(run: Trajectory) -> tuple[Overlap, ...]:
    """All overlaps in time of contacts of neighbouring pairs, in order of time."""
    log, found = run.contacts, []
    finish = np.where(np.isnan(log["t_end"]), run.time[-1], log["t_end"])
    rows = [np.flatnonzero(log["pair"] == c) for c in range(run.scene.n - 1)]
    for below, above in pairwise(rows):
        if not len(below) or not len(above):
            continue
        first = np.searchsorted(finish[above], log["t_begin"][below], side="right")
        last = np.searchsorted(log["t_begin"][above], finish[below], side="left")
        for i, a, b in zip(below, first, last, strict=True):
            for j in above[a:b]:
                span = max(log["t_begin"][i], log["t_begin"][j]), min(finish[i], finish[j])
                found.append(Overlap(int(i), int(j), float(span[0]), float(span[1])))
    return tuple(sorted(found, key=lambda o: o.begin))


def shared_impulse(run: Trajectory) -> float:
    """φ in [0, 1]; nan without contacts."""
    total = float(run.contacts["impulse"].sum())
    return float(run.stats["shared_impulse"]) / total if total > 0.0 else math.nan


def crowding(hard: Trajectory, laws: tuple[Any, ...]) -> float:
    """p in [0, 1]: share of EDMD events with an event of a neighbouring pair within t_c; nan without events."""
    log, pairs = hard.contacts, hard.scene.pairs
    if not len(log):
        return math.nan
    times = [log["t_begin"][log["pair"] == c] for c in range(len(pairs))]
    crowded = 0
    for c in range(len(pairs)):
        beside = [times[side] for side in (c - 1, c + 1) if 0 <= side < len(pairs) and len(times[side])]
        if len(times[c]) and beside:
            nearest = np.min([_distance(times[c], others) for others in beside], axis=0)
            crowded += int((nearest < durations(hard, laws, c)).sum())
    return crowded / len(log)


def durations(hard: Trajectory, laws: tuple[Any, ...], c: int) -> Array:
    """Durations in s that the EDMD events of pair `c` would have as isolated contacts under its law."""
    log = hard.of(c)
    speed = np.abs(log["v_in"][:, 0] - log["v_in"][:, 1])
    law, pair = laws[c], hard.scene.pairs[c]
    if hasattr(law, "linear"):
        return np.full(len(log), binary.collision(law, pair, 1.0).duration)
    if not speed.max() > 0.0:
        return np.zeros(len(log))
    speed = np.maximum(speed, 1e-9 * speed.max())
    grid = np.unique(np.geomspace(speed.min(), speed.max(), 17))
    table = [binary.collision(law, pair, float(v)).duration for v in grid]
    lasting: Array = np.exp(np.interp(np.log(speed), np.log(grid), np.log(table)))
    return lasting


def occupation(soft: Trajectory) -> float:
    """Λ: share of time a pair spends in contact, from the soft log; nan for an empty span."""
    span = float(soft.time[-1] - soft.time[0])
    return float(soft.contacts["duration"].sum()) / (span * (soft.scene.n - 1)) if span > 0.0 else math.nan


def distance(one: Trajectory, other: Trajectory) -> float:
    """D between two runs of one scene: √(Σ m (Δv)² / Σ m v₀²), v₀ at the first contact of `other`."""
    scene, balls = one.scene, ~one.scene.is_wall
    m, dv = scene.mass[balls], velocity_differences(one, other)
    scale = float(m @ impact_velocities(scene, other)[balls] ** 2)
    return math.sqrt(float(m @ dv**2) / scale) if scale > 0.0 else math.nan


def predictability(twin: Trajectory, hard: Trajectory) -> float:
    """D of hard spheres against themselves; cut at an end time, just before it, lest a contact there decide."""
    if not twin.status is hard.status is Status.time:
        return distance(twin, hard)
    before = hard.time[-1] - 1e-9 * (hard.time[-1] - hard.time[0])
    return distance(_rolled_back(twin, before), _rolled_back(hard, before))


def velocity_differences(one: Trajectory, other: Trajectory) -> Array:
    """Differences in m/s of the balls' final velocities, brought to a common time by free fall."""
    balls = ~one.scene.is_wall
    lag = one.scene.gravity * float(one.time[-1] - other.time[-1])
    difference: Array = one.velocity[-1][balls] - other.velocity[-1][balls] + lag
    return difference


def without_rounding(run: Trajectory, fastest: float) -> Trajectory:
    """The run with only those contacts in its log whose impact is more than rounding beside one at `fastest` m/s.

    Balls that an engine leaves with a relative speed of 1e-16 m/s meet again after some 1e12 s. Such contacts count
    for nothing. Touching balls begin at rest, so an impact is judged by approach and by impulse / m_eff.
    """
    log = run.contacts
    m_eff = np.array([pair.m_eff for pair in run.scene.pairs])[log["pair"]]
    strength = np.maximum(_approach(log), log["impulse"] / m_eff)
    return replace(run, contacts=log[strength > ROUNDING * fastest])


def fastest_approach(*runs: Trajectory) -> float:
    """Largest speed in m/s at which a contact of these runs begins; 0 without contacts."""
    return max(float(_approach(run.contacts).max(initial=0.0)) for run in runs)


def same_but_for_timing(soft: Trajectory, hard: Trajectory, tolerance: float) -> bool:
    """Whether two runs cut at one end time differ only by contacts within the lag of soft spheres before it.

    The lag is one duration per collision of the busiest pair, and must be small beside the time between its contacts.
    The contacts that both runs have must part at the same speeds, within `tolerance` in m/s.
    """
    if not soft.status is hard.status is Status.time:
        return False
    end, span = float(soft.time[-1]), float(soft.time[-1] - soft.time[0])
    counts = [_counts(run, math.inf) for run in (soft, hard)]
    busiest = max(int(count.max()) for count in counts)
    lag = _longest(soft, hard) * (1.0 + busiest)
    if lag * busiest > SMALL * span:
        return False
    early = [_counts(run, end - lag) for run in (soft, hard)]
    more, fewer = np.maximum(*counts), np.minimum(*counts)
    only_late = (more > fewer).any() and (np.maximum(*early) <= fewer).all()
    return bool(only_late) and _same_partings(soft, hard, tolerance)


def impact_velocities(scene: Scene, run: Trajectory) -> Array:
    """Velocities in m/s just before the first contact of `run` (the initial ones without any)."""
    fall = float(run.contacts["t_begin"][0] - run.time[0]) if len(run.contacts) else 0.0
    velocity: Array = scene.velocity - np.where(scene.is_wall, 0.0, scene.gravity * fall)
    return velocity


def mass_centre_restitution(run: Trajectory) -> float:
    """-V_cm after / V_cm before all contacts; nan unless the scene has exactly one wall, and contacts that end."""
    scene, balls = run.scene, ~run.scene.is_wall
    if scene.is_wall.sum() != 1 or not len(run.contacts) or run.status in (Status.collapse, Status.resting):
        return math.nan
    m = scene.mass[balls]
    wall = float(scene.velocity[scene.is_wall][0])
    before = float(m @ (impact_velocities(scene, run)[balls] - wall))
    last = np.nanmax(np.append(run.contacts["t_end"], run.contacts["t_begin"]))
    fall = scene.gravity * float(run.time[-1] - last)
    after = float(m @ (run.velocity[-1][balls] + fall - wall))
    return -after / before if before != 0.0 else math.nan


def groups(scene: Scene, laws: tuple[Any, ...], speed: float) -> dict[str, float]:
    """Dimensionless groups of a scene whose balls meet at `speed` in m/s.

    Mass ratio (largest over smallest ball), stiffness ratio over the pairs, the largest Δh·ω₀/v (a gap between balls
    against the slower neighbouring contact, which is over before the gap has closed beyond about π) and g/(ω₀ v)
    (gravity against the contact force), with ω₀ = √(∂F/∂ξ / m_eff) at the expected overlap.
    """
    m = scene.mass[~scene.is_wall]
    slope, omega = [], []
    for law, pair in zip(laws, scene.pairs, strict=True):
        depth = expected_overlap(law, pair, speed)
        slope.append(traits.tangent(law, depth, pair)[0] if depth > 0.0 else math.nan)
        omega.append(math.sqrt(slope[-1] / pair.m_eff))
    inner = [c for c in range(scene.n - 1) if not (scene.is_wall[c] or scene.is_wall[c + 1])]
    beside = [min((omega[i] for i in (c - 1, c + 1) if 0 <= i < len(omega)), default=omega[c]) for c in inner]
    gaps = [float(scene.gap[c]) * slow / speed for c, slow in zip(inner, beside, strict=True)] if speed > 0.0 else []
    return {
        "mass_ratio": float(m.max() / m.min()),
        "stiffness_ratio": max(slope) / min(slope),
        "gap_omega_over_speed": max(gaps, default=math.nan),
        "gravity_over_omega_speed": scene.gravity / (min(omega) * speed) if speed > 0.0 else math.nan,
    }


def _approach(log: Any) -> Array:
    """Approach speeds in m/s at the begin of contacts."""
    speed: Array = log["v_in"][:, 0] - log["v_in"][:, 1]
    return speed


def _counts(run: Trajectory, time: float) -> Any:
    """Number of contacts of each pair that began before `time`."""
    log = run.contacts
    return np.bincount(log["pair"][log["t_begin"] < time], minlength=run.scene.n - 1)


def _longest(soft: Trajectory, hard: Trajectory) -> float:
    """Longest contact in s: of those of the soft run, and of those of the hard run had they been isolated."""
    assert soft.law is not None
    isolated = [durations(hard, soft.law, c).max() for c in range(hard.scene.n - 1) if hard.count(c)]
    return max([float(soft.contacts["duration"].max(initial=0.0)), *map(float, isolated)])


def _same_partings(one: Trajectory, other: Trajectory, tolerance: float) -> bool:
    """Whether all contacts that both runs have, and that are over, end at the same separation speeds."""
    for c in range(one.scene.n - 1):
        a, b = one.of(c)["v_out"], other.of(c)["v_out"]
        n = min(len(a), len(b))
        miss = np.abs((a[:n, 1] - a[:n, 0]) - (b[:n, 1] - b[:n, 0]))
        if (miss > tolerance).any():
            return False
    return True


def _rolled_back(run: Trajectory, time: float) -> Trajectory:
    """The run with the final velocities it had just before `time`, undoing the collisions (hard spheres) since."""
    scene, velocity, clock = run.scene, run.velocity.copy(), np.full(run.scene.n, run.time[-1])
    for row in run.contacts[np.searchsorted(run.contacts["t_begin"], time) :][::-1]:
        pair = [row["pair"], row["pair"] + 1]
        velocity[-1, pair], clock[pair] = row["v_in"], row["t_begin"]
    velocity[-1] += np.where(scene.is_wall, 0.0, scene.gravity * (clock - time))
    return replace(run, velocity=velocity, time=np.append(run.time[:-1], time))


def _distance(times: Array, others: Array) -> Array:
    """Distance in s from each time to the nearest of `others` (sorted)."""
    at = np.searchsorted(others, times)
    left = np.abs(times - others[np.maximum(at - 1, 0)])
    right = np.abs(others[np.minimum(at, len(others) - 1)] - times)
    return np.minimum(left, right)

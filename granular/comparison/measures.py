"""Measures of the error of event-driven simulation, as functions of trajectories.

=========  ===========================================================================================================
φ          fraction of the contact impulse exchanged while a neighbouring pair is active (0: every contact is binary)
p          fraction of EDMD events with an event of a neighbouring pair within t_c
Λ          mean t_c times the collision rate of a pair: fraction of time that a pair spends in contact
D          √(Σ m (Δu)² / Σ m U²), u the velocity with which a ball leaves its last contact, U the unit
K_cm       ratio (soft / hard) of the restitution of the centre of mass, scenes with one wall at constant velocity
T          Σ m (v - V)² / (N - 1) of N balls, V the velocity of their centre of mass
=========  ===========================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.callables import check_argument_types
from granular._engine.check import Array
from granular.comparison.outcome import approach, counts
from granular.laws.kinds import resolved
from granular.md.isolation import Durations
from granular.run.contact_log import is_logged
from granular.run.trajectory import Status, Trajectory, points
from granular.scene import Scene, walls

__all__ = [
    "Overlap", "balance", "before_the_end", "crowding", "durations", "fastest_approach", "groups", "height",
    "impact_speed", "impact_velocities", "mass_centre_restitution", "occupation", "overlapping", "section",
    "shared_impulse", "static_overlaps", "temperature",
]
__dir__ = __all__.copy

BALANCE_LABELS = {
    "start": "at the start", "floor": "work of the floor", "ceiling": "work of the ceiling", "heat": "heat of walls",
    "dissipated": "dissipated", "end": "at the end", "remainder": "remainder",
}
"""Descriptions of the terms of a `balance`."""


@signature.face
@dataclass(frozen=True)
class Overlap:
    """Two contacts of neighbouring pairs that overlap in time.

    Attributes
    ----------
    lower, upper : int
        Row of each contact in the contact log. The pair of `upper` is the next one above the pair of `lower`.
    begin, end : float
        Start and end in s of the time interval that the contacts share.
    """

    lower: int
    upper: int
    begin: float
    end: float


def overlapping(run: Trajectory) -> tuple[Overlap, ...]:
    """Return all overlaps in time of contacts of neighbouring pairs, in time order.

    A contact without end lasts until the end of the run.
    """
    begin, end = run.contacts["t_begin"], np.nan_to_num(run.contacts["t_end"], nan=run.time[-1])
    overlaps = []
    for below, above in _neighbouring_rows(run):
        first = np.searchsorted(end[above], begin[below], side="right")
        last = np.searchsorted(begin[above], end[below], side="left")
        overlaps += [Overlap(int(i), int(j), float(max(begin[i], begin[j])), float(min(end[i], end[j])))
                  for i, a, b in zip(below, first, last, strict=True) for j in above[a:b]]
    return tuple(sorted(overlaps, key=lambda o: o.begin))


def shared_impulse(run: Trajectory) -> float:
    """Shared impulse φ in [0, 1]: impulse exchanged during neighbouring contacts.

    It is the fraction of the total contact impulse that is exchanged while a neighbouring pair is active. 0 for hard
    spheres. nan without contacts, and for a run resumed from another run with contacts.
    """
    total, known = float(run.contacts["impulse"].sum()), run.stats.get("contacts", 0) <= len(run.contacts)
    return float(run.stats.get("shared_impulse", 0.0)) / total if total > 0.0 and known else math.nan


def crowding(hard: Trajectory, laws: tuple[Any, ...]) -> float:
    """Fraction p in [0, 1] of EDMD events with a neighbour's event within t_c.

    t_c is the isolated duration of an event under the force law of its pair. An event of a neighbouring pair counts if
    it occurs less than t_c earlier or later. nan without events.
    """
    begin, t_c = hard.contacts["t_begin"].copy(), durations(hard, laws)
    crowded = np.zeros(len(begin), dtype=np.bool_)
    for below, above in _neighbouring_rows(hard):
        crowded[below] |= _distance(begin[below], begin[above]) < t_c[below]
        crowded[above] |= _distance(begin[above], begin[below]) < t_c[above]
    return float(crowded.mean()) if len(begin) else math.nan


def durations(hard: Trajectory, laws: tuple[Any, ...]) -> Array:
    """Isolated duration in s of each EDMD event under the force law of its pair, (m,).

    It is the duration of an isolated contact at the approach speed of the event.
    """
    return Durations(laws, hard.scene)(hard.contacts["pair"], np.abs(approach(hard)))


def _neighbouring_rows(run: Trajectory) -> Iterator[tuple[Any, Any]]:
    """Yield the log rows of two neighbouring pairs that both have contacts."""
    below, above = run.scene.neighbours
    have_contacts = (counts(run)[below] > 0) & (counts(run)[above] > 0)
    below, above = below[have_contacts], above[have_contacts]
    return zip(map(run.rows, below.tolist()), map(run.rows, above.tolist()), strict=True)


def occupation(soft: Trajectory) -> float:
    """Mean fraction Λ of time that a pair of soft spheres spends in contact.

    nan for an empty time interval, and without a contact log.
    """
    span = float(soft.time[-1] - soft.time[0])
    is_known = span > 0.0 and is_logged(soft)
    return float(soft.contacts["duration"].sum()) / (span * soft.scene.n_pairs) if is_known else math.nan


def before_the_end(twin: Trajectory, hard: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Remove contacts just before a common end time from both runs.

    Rounding errors decide whether such contacts are in the log. A contact is removed if it begins within the last 1e-9
    of the run. If the status of one run is not `time`, both runs are returned unchanged.
    """
    if not twin.status is hard.status is Status.time:
        return twin, hard
    before = hard.time[-1] - 1e-9 * (hard.time[-1] - hard.time[0])
    twin, hard = (replace(run, contacts=run.contacts[run.contacts["t_begin"] < before]) for run in (twin, hard))
    return twin, hard


def fastest_approach(*runs: Trajectory) -> float:
    """Largest approach speed in m/s of all contacts of these runs; 0 without contacts."""
    return max(float(approach(run).max(initial=0.0)) for run in runs)


def impact_speed(run: Trajectory) -> float:
    """Approach speed v₁ in m/s of the first collision of hard spheres.

    For simultaneous collisions it is the fastest approach of these pairs before any of the collisions. The result
    depends neither on the tie rule nor on the order of the contact log. nan without contacts.
    """
    log = run.contacts[run.contacts["t_begin"] == run.contacts["t_begin"][:1]]
    body = np.column_stack(run.scene.bodies(log["pair"])).ravel()
    _, first, which = np.unique(body, return_index=True, return_inverse=True)
    before = log["v_in"].ravel()[first][which].reshape(-1, 2)
    return float((before[:, 0] - before[:, 1]).max()) if len(log) else math.nan


def impact_velocities(scene: Scene, run: Trajectory) -> Array:
    """Velocities in m/s of all bodies just before the first contact of `run`, (n,).

    They are the initial velocities if there is no contact, and nan if the first sample is later than the first contact.
    """
    fall = float(run.contacts["t_begin"][0] - run.time[0]) if len(run.contacts) else 0.0
    if fall < 0.0:
        return np.full(scene.n, math.nan)
    return np.asarray(scene.free_velocity(fall) + (run.velocity[0] - scene.velocity))


def mass_centre_restitution(run: Trajectory) -> float:
    """Restitution of the centre of mass, -V_cm after all contacts / V_cm before them.

    The velocities are relative to the wall. nan unless the scene has exactly one wall, which moves at constant velocity
    and is not thermal. Also nan for pendula, without contacts, after a collapse, and if a contact with the wall has no
    end.
    """
    scene, balls, log = run.scene, ~run.scene.is_wall, run.contacts
    at_wall = run.of(0 if scene.is_wall[0] else scene.n_pairs - 1)
    not_finished = run.status in (Status.collapse, Status.bounded) or np.isnan(at_wall["t_end"]).any()
    if scene.is_wall.sum() != 1 or scene.endless or not len(log) or not_finished:
        return math.nan
    m, wall = scene.mass[balls], float(scene.velocity[scene.is_wall][0])
    before = float(m @ (impact_velocities(scene, run)[balls] - wall))
    fall = scene.fall[balls] * float(run.time[-1] - np.nanmax(np.append(log["t_end"], log["t_begin"])))
    after = float(m @ (run.velocity[-1][balls] - fall - wall))
    return -after / before if before != 0.0 else math.nan


def static_overlaps(soft: Trajectory) -> Array:
    """Overlap in m of each pair at rest in static equilibrium, (n-1,).

    The contact of pair c carries F_c = Σ (m_i a + m_i g - f_i) over the balls above it in its pile. On a floor a = 0.
    In a pile without a wall, a is the acceleration of its centre of mass. Below a ceiling, the sum is over the balls
    below the contact. nan for pairs that are not at rest, under laws with memory, and between two walls. All values
    are nan with driven or thermal walls, for pendula and on a ring.
    """
    scene, overlap = soft.scene, np.full(soft.scene.n_pairs, math.nan)
    log = soft.contacts
    has_no_end = np.zeros(scene.n_pairs, np.bool_)
    has_no_end[log["pair"][np.isnan(log["t_end"])]] = True
    if scene.endless or not has_no_end.any():
        return overlap
    from granular.laws.springs import static_overlap

    laws = resolved(soft.law or (), scene)
    external = scene.external_force if scene.external_force is not None else np.zeros(scene.n)
    m = np.where(scene.is_wall, 0.0, scene.mass)
    weight = m * scene.gravity - np.where(scene.is_wall, 0.0, external)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], has_no_end, [False]])))
    for a, b in edges.reshape(-1, 2).tolist():  # pairs a … b - 1, bodies a … b of a pile
        ends_at_wall = scene.is_wall[[a, b]].tolist()
        if ends_at_wall == [True, True]:
            continue
        lift = 0.0 if any(ends_at_wall) else -weight[a : b + 1].sum() / m[a : b + 1].sum()
        load = -np.cumsum(weight[a:b]) if ends_at_wall[1] else np.cumsum((weight + m * lift)[b:a:-1])[::-1]
        for c, carried in zip(range(a, b), load.tolist(), strict=True):
            with suppress(ValueError):
                overlap[c] = static_overlap(laws[c], carried) if carried > 0.0 and not laws[c].memory else math.nan
    return overlap


def groups(scene: Scene, laws: tuple[Any, ...], speed: float) -> dict[str, float]:
    """Dimensionless groups of a scene at an impact `speed` in m/s.

    The keys are "mass_ratio" (largest over smallest ball), "stiffness_ratio" (over the pairs), "gap_omega_over_speed"
    (largest Δh·ω₀/v), "gravity_over_omega_speed" (g/(ω₀ v)), "shaking" (Γ = A ω²/g) and "shaking_omega" (ω/ω₀ of the
    contact with the wall). Here ω₀ = √(∂F/∂ξ / m_eff) at the overlap expected for this speed.

    Δh·ω₀/v compares the time Δh/v in which a gap between two balls closes with the duration π/ω₀ of a contact. ω₀ is
    the value of the slower neighbouring pair. Above about π, the contact of this pair ends before the gap has closed.
    g/(ω₀ v) compares gravity with the contact force. The last two groups are the larger values of the harmonically
    shaken walls, and nan without such a wall. Values are also nan if the balls do not meet.
    """
    m, (below, above) = scene.mass[~scene.is_wall], scene.neighbours
    speed = speed if isinstance(speed, float) and math.isnan(speed) else check.number("speed", speed, at_least=0.0)
    slope = resolved(laws, scene).column(lambda law: law.impact_stiffness(speed))
    omega = np.sqrt(slope / scene.pairs.m_eff)
    # lowest ω₀ of the pairs next to each pair
    slower_omega = np.full(scene.n_pairs, math.inf) if len(below) else omega
    slower_omega[above] = omega[below]
    slower_omega[below] = np.minimum(slower_omega[below], omega[above])
    inner = ~np.logical_or(*scene.sides(scene.is_wall))
    gaps = scene.gap[inner] * slower_omega[inner]
    return {
        "mass_ratio": float(m.max() / m.min()),
        "stiffness_ratio": float(slope.max() / slope.min()),
        "gap_omega_over_speed": float(gaps.max() / speed) if len(gaps) and speed > 0.0 else math.nan,
        "gravity_over_omega_speed": scene.gravity / (float(omega.min()) * speed) if speed > 0.0 else math.nan,
        **_shaking(scene, omega),
    }


def _shaking(scene: Scene, omega: Array) -> dict[str, float]:
    """Γ = A ω²/g and ω/ω₀ of harmonically shaken walls, nan without such a wall.

    Parameters
    ----------
    omega : (n-1,) array
        Contact frequency ω₀ in rad/s of each pair.
    """
    shaken = [(motion, omega_0) for motion, omega_0 in zip(scene.motions, omega[[0, -1]].tolist(), strict=True)
              if motion is not None and isinstance(motion, walls.Sine)]
    largest = max((motion.omega * motion.omega * motion.amplitude for motion, _ in shaken), default=math.nan)
    return {"shaking": largest / scene.gravity if scene.gravity > 0.0 else math.nan,
            "shaking_omega": max((motion.omega / omega_0 for motion, omega_0 in shaken), default=math.nan)}


def section(run: Trajectory, pair: int = 0) -> dict[str, Array]:
    """Stroboscopic data at each contact with a shaken wall (Poincaré section).

    Parameters
    ----------
    run : Trajectory
        Run of hard or soft spheres, with its contact log.
    pair : int
        0 for the floor, ``scene.n_pairs - 1`` for the ceiling. Defaults to 0.

    Returns
    -------
    dict
        *time* of the onset in s, *phase* of the wall as a fraction of a period from 0 to 1 (nan unless the motion is a
        `granular.walls.Sine`), and velocities in m/s of the *wall* at the onset and of the ball *before* and *after*.

    Raises
    ------
    ValueError
        If `pair` does not contain a wall.
    """
    scene = run.scene
    at_walls = [c for c, end in ((0, 0), (scene.n_pairs - 1, -1)) if scene.is_wall[end]]
    if check.integer("pair", pair) not in at_walls:
        raise ValueError(f"`pair` must be the pair of a wall, {' or '.join(map(str, at_walls))}, got {pair!r}."
                         if at_walls else f"`run` must be of a scene with a wall, got {scene}.")
    log, side = run.of(pair), int(pair == scene.n_pairs - 1 and bool(scene.is_wall[-1]))
    motion, time = scene.motions[side], log["t_begin"]
    phase = motion.phases(time) if isinstance(motion, walls.Sine) else np.full(len(log), math.nan)
    return {"time": time, "phase": phase, "wall": log["v_in"][:, side], "before": log["v_in"][:, 1 - side],
            "after": log["v_out"][:, 1 - side]}


def temperature(run: Trajectory) -> Array:
    """Temperature T = Σ m (v - V)² / (N - 1) of N balls in J, per sample, (T,).

    V = Σ m v / Σ m is the velocity of the centre of mass. Its motion is one of N degrees of freedom and is subtracted.
    T is k_B times an absolute temperature, like the temperature of `granular.walls.Thermal`: in equilibrium its mean
    equals the temperature of the wall, for any masses. The granular temperature is often defined per unit mass, as T/m
    in m²/s². nan for a single ball.
    """
    balls = ~run.scene.is_wall
    m, v = run.scene.mass[balls], run.velocity[:, balls]
    relative = v - (v @ m / m.sum())[:, None]
    return np.asarray((relative * relative) @ m / (len(m) - 1 or math.nan))


def height(run: Trajectory) -> Array:
    """Height h = Σ m s / Σ m in m of the centre of mass, radii subtracted, (T,).

    s_i is the sum of the gaps below ball i, s_i = x_i - r_i - 2 Σ r_j over the balls j below. It is measured from the
    initial position of body 0, which is the floor if there is one. Balls that lie on a floor have the height 0
    while the floor is at its initial position.
    """
    balls = ~run.scene.is_wall
    m = run.scene.mass[balls]
    return np.asarray(points(run)[:, balls] @ m / m.sum())


def balance(run: Trajectory) -> dict[str, float]:
    """Energy balance in J from the first to the last sample of a run.

    The keys are "start" and "end" (energy), "floor" and "ceiling" (work of the walls on the balls), "heat" (from both
    walls), "dissipated" (energy), and "remainder" = end - start - floor - ceiling - heat + dissipated. The remainder is
    rounding error. Terms that the run did not record are nan, see `Trajectory.account`.
    """
    account = run.account()
    work, heats, losses = (account[name][-1] - account[name][0] for name in ("work", "heat", "dissipated"))
    (floor, ceiling), heat, lost = work.tolist(), float(heats.sum()), float(losses)
    start, end = account["energy"][[0, -1]].tolist()
    return {"start": start, "floor": floor, "ceiling": ceiling, "heat": heat, "dissipated": lost, "end": end,
            "remainder": end - start - (floor + ceiling + heat - lost)}


def _distance(times: Array, others: Array) -> Array:
    """Time in s from each of `times` to the nearest of the sorted times `others`."""
    at = np.searchsorted(others, times)
    left = np.abs(times - others[np.maximum(at - 1, 0)])
    return np.minimum(left, np.abs(others[np.minimum(at, len(others) - 1)] - times))


check_argument_types(globals(), Scene, Trajectory)

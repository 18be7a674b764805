"""References without another engine: closed forms, invariants, symmetries."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bench.stability.cell import Rerun, Truth, compared_with
from granular._engine.check import Array
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene

LATE_START = 2.0**40
"""Start time in s, 1.1e12 s, at which a float resolves 0.24 ms."""
RELATIVE_PERTURBATION = 1e-11
"""Relative change of velocities and gaps that measures a condition number."""


@compared_with("closed form of one contact")
def restitution(run: Trajectory, rerun: Rerun, eps: float, speed: float) -> float:
    """Error of the restitution `eps` of one contact at `speed` in m/s.

    The error is infinite for another number of contacts.
    """
    parting = run.velocity[-1, 1] - run.velocity[-1, 0]
    return float(abs(parting / speed - eps)) if len(run.contacts) == 1 else math.inf


@compared_with("closed form of one contact and of its log row")
def one_contact(run: Trajectory, rerun: Rerun, /, eps: float, speed: float, **fields: float) -> float:
    """Error of one contact with a wall: restitution and fields of its log row.

    `speed` is the approach speed in m/s.
    """
    if len(run.contacts) != 1:
        return math.inf
    errors = [abs(run.contacts[name][0] / value - 1.0) for name, value in fields.items()]
    return float(max([*errors, abs(run.velocity[-1, 1] / speed - eps)]))


def velocities(expected: Sequence[float] | Array, scale: float = 1.0, words: str = "closed form") -> Truth:
    """Reference: final velocities in m/s, with errors in units of `scale`."""
    return Truth(words, lambda run, rerun: float(np.abs(run.velocity[-1] - expected).max()) / scale)


@compared_with("sum of all bounce times")
def comes_to_rest(run: Trajectory, rerun: Rerun, time: float) -> float:
    """Relative error of the time in s at which all balls are at rest.

    The run ends in a collapse, or quietly if the last bounces are too small for a float.
    """
    still = run.status in (Status.collapse, Status.quiet) and not run.velocity[-1].any() and not run.gap[-1].any()
    return float(abs(run.time[-1] / time - 1.0)) if still else math.inf


@compared_with("energy conservation")
def energy(run: Trajectory, rerun: Rerun) -> float:
    """Relative change of energy."""
    return abs(energy_gain(run, rerun))


def energy_gain(run: Trajectory, rerun: Rerun) -> float:
    """Relative growth of energy."""
    e = run.energy()
    return float((e[-1] - e[0]) / abs(e[0]))


ENERGY_LOSS = Truth("no energy gain", energy_gain)


@compared_with("momentum conservation")
def momentum(run: Trajectory, rerun: Rerun) -> float:
    """Change of the total momentum, as a share of the initial Σ m |v|."""
    p = run.momentum()
    return float(abs(p[-1] - p[0]) / (run.scene.mass @ np.abs(run.scene.velocity)))


@compared_with("time reversal")
def reversal(run: Trajectory, rerun: Rerun) -> float:
    """Velocity error of elastic motion after time reversal, over the speed."""
    turned = run.scene.replace(gap=run.gap[-1], velocity=-run.velocity[-1])
    back = rerun(scene=turned, t_end=run.time[-1] - run.time[0], until=None, max_events=10**8)
    return float(np.abs(back.velocity[-1] + run.scene.velocity).max()) / largest_speed(run)


@compared_with("scaling by a power of two")
def scaled(run: Trajectory, rerun: Rerun) -> float:
    """Velocity error after lengths and velocities are scaled by 2^5.

    The results must be bitwise identical. This holds for g = 0 with linear laws, and for hard spheres.
    """
    s = run.scene
    other = rerun(scene=s.replace(gap=s.gap * 32.0, velocity=s.velocity * 32.0))
    return float(np.abs(other.velocity[-1] / 32.0 - run.velocity[-1]).max()) / largest_speed(run)


@compared_with("mirror image")
def mirrored(run: Trajectory, rerun: Rerun) -> float:
    """Difference from the mirror image without gravity, over the condition number."""
    s = run.scene
    mirror = Scene(s.mass[::-1], s.radius[::-1], s.gap[::-1], 0.0 - s.velocity[::-1])
    other = rerun(scene=mirror, **({} if run.law is None else {"law": run.law[::-1]}))
    return outcome_difference(run, -other.velocity[-1][::-1], other, rerun)


@compared_with("late start")
def late_start(run: Trajectory, rerun: Rerun, span: float) -> float:
    """Difference from a run begun at t = 2^40 s, over the condition number.

    `span` is the length of the run in s.
    """
    other = rerun(t_start=LATE_START, t_end=LATE_START + span)
    return outcome_difference(run, other.velocity[-1], other, rerun)


@compared_with("gap below rounding as zero gap")
def nearby_scene(run: Trajectory, rerun: Rerun, scene: Scene) -> float:
    """Difference from a scene equal to within rounding, over the condition number."""
    other = rerun(scene=scene)
    return outcome_difference(run, other.velocity[-1], other, rerun)


def outcome_difference(run: Trajectory, velocity: Array, other: Trajectory, rerun: Rerun) -> float:
    """Difference of velocities over the largest speed and the condition number.

    Another status gives an infinite difference. A difference up to 1e-14 is not divided by the condition number.
    """
    if run.status is not other.status:
        return math.inf
    difference = float(np.abs(velocity - run.velocity[-1]).max()) / largest_speed(run)
    # the condition number costs two more runs
    return difference if difference <= 1e-14 else difference / max(1.0, condition(run, rerun))


def condition(run: Trajectory, rerun: Rerun) -> float:
    """Condition number of the final velocities, from two random perturbations."""
    s, changes = run.scene, [0.0]
    for seed in (1, 2):
        sign = np.random.default_rng(seed).choice([-RELATIVE_PERTURBATION, RELATIVE_PERTURBATION], (2, s.n))
        nudged = rerun(scene=s.replace(velocity=s.velocity * (1.0 + sign[0]), gap=s.gap * (1.0 + sign[1, :-1])))
        change = float(np.abs(nudged.velocity[-1] - run.velocity[-1]).max() / largest_speed(run))
        changes.append(change / RELATIVE_PERTURBATION)
    return max(changes)


def largest_speed(run: Trajectory) -> float:
    """Largest speed in m/s at the start or the end."""
    return float(np.abs(run.velocity[[0, -1]]).max())

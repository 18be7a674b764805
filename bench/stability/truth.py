"""Truths that need no other engine: closed forms, invariants, and symmetries of Newton's equation."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bench.stability.cell import Rerun, Truth, compared_with
from granular._engine.check import Array
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene

LATE_START = 2.0**40
"""A start time in s at which one float resolves 0.24 ms; 1.1e12."""
RELATIVE_PERTURBATION = 1e-11
"""Relative change of velocities and gaps by which a condition number is measured."""


@compared_with("closed form of one contact, counted once")
def restitution(run: Trajectory, rerun: Rerun, eps: float, speed: float) -> float:
    """One contact, which returns `eps` of the approach speed in m/s."""
    parting = run.velocity[-1, 1] - run.velocity[-1, 0]
    return float(abs(parting / speed - eps)) if len(run.contacts) == 1 else math.inf


@compared_with("closed form of one contact and its row of the log")
def one_contact(run: Trajectory, rerun: Rerun, /, eps: float, speed: float, **fields: float) -> float:
    """One contact on a wall at approach speed `speed` in m/s: restitution, and fields of its row of the log."""
    if len(run.contacts) != 1:
        return math.inf
    errors = [abs(run.contacts[name][0] / value - 1.0) for name, value in fields.items()]
    return float(max([*errors, abs(run.velocity[-1, 1] / speed - eps)]))


def velocities(expected: Sequence[float] | Array, scale: float = 1.0, words: str = "closed form") -> Truth:
    """Final velocities in m/s; the error is a part of the speed `scale`."""
    return Truth(words, lambda run, rerun: float(np.abs(run.velocity[-1] - expected).max()) / scale)


@compared_with("the sum of all bounces")
def comes_to_rest(run: Trajectory, rerun: Rerun, time: float) -> float:
    """At `time` in s, all lie still: in a collapse, or, where the last bounces are too small for a float, quietly."""
    still = run.status in (Status.collapse, Status.quiet) and not run.velocity[-1].any() and not run.gap[-1].any()
    return float(abs(run.time[-1] / time - 1.0)) if still else math.inf


@compared_with("energy is kept")
def energy(run: Trajectory, rerun: Rerun) -> float:
    """Energy is kept. Part of the energy at the start."""
    return abs(energy_gain(run, rerun))


def energy_gain(run: Trajectory, rerun: Rerun) -> float:
    """Return how much the energy grows, as a part of that at the start."""
    e = run.energy()
    return float((e[-1] - e[0]) / abs(e[0]))


ENERGY_LOSS = Truth("energy does not grow", energy_gain)


@compared_with("momentum is kept")
def momentum(run: Trajectory, rerun: Rerun) -> float:
    """Total momentum is kept, as a part of Σ m |v| of the start."""
    p = run.momentum()
    return float(abs(p[-1] - p[0]) / (run.scene.mass @ np.abs(run.scene.velocity)))


@compared_with("turned round, it returns to its start")
def reversal(run: Trajectory, rerun: Rerun) -> float:
    """Elastic motion, turned round at the end, returns to where it began."""
    turned = run.scene.replace(gap=run.gap[-1], velocity=-run.velocity[-1])
    back = rerun(scene=turned, t_end=run.time[-1] - run.time[0], until=None, max_events=10**8)
    return float(np.abs(back.velocity[-1] + run.scene.velocity).max()) / largest_speed(run)


@compared_with("scaled by a power of two it is the same")
def scaled(run: Trajectory, rerun: Rerun) -> float:
    """Lengths times 2^s, s = 5: velocities times 2^s and the same bits. Only for g = 0 and linear laws, or edmd."""
    s = run.scene
    other = rerun(scene=s.replace(gap=s.gap * 32.0, velocity=s.velocity * 32.0))
    return float(np.abs(other.velocity[-1] / 32.0 - run.velocity[-1]).max()) / largest_speed(run)


@compared_with("mirror image")
def mirrored(run: Trajectory, rerun: Rerun) -> float:
    """Left and right exchanged (no gravity). Divided by the condition number."""
    s = run.scene
    mirror = Scene(s.mass[::-1], s.radius[::-1], s.gap[::-1], 0.0 - s.velocity[::-1])
    other = rerun(scene=mirror, **({} if run.law is None else {"law": run.law[::-1]}))
    return outcome_difference(run, -other.velocity[-1][::-1], other, rerun)


@compared_with("the same at a late start")
def late_start(run: Trajectory, rerun: Rerun, span: float) -> float:
    """Begun at t = 2^40 s in place of 0, for `span` in s. Divided by the condition number."""
    other = rerun(t_start=LATE_START, t_end=LATE_START + span)
    return outcome_difference(run, other.velocity[-1], other, rerun)


@compared_with("a gap below rounding is no gap")
def nearby_scene(run: Trajectory, rerun: Rerun, scene: Scene) -> float:
    """The same outcome as a scene that differs by less than rounding. Divided by the condition number."""
    other = rerun(scene=scene)
    return outcome_difference(run, other.velocity[-1], other, rerun)


def outcome_difference(run: Trajectory, velocity: Array, other: Trajectory, rerun: Rerun) -> float:
    """Return how much the velocities differ, per speed of the scene and condition number; status must be equal."""
    if run.status is not other.status:
        return math.inf
    difference = float(np.abs(velocity - run.velocity[-1]).max()) / largest_speed(run)
    return difference if difference <= 1e-14 else difference / max(1.0, condition(run, rerun))


def condition(run: Trajectory, rerun: Rerun) -> float:
    """Return the condition number of the final velocities: their change over that of the start, of two nudges."""
    s, changes = run.scene, [0.0]
    for seed in (1, 2):
        sign = np.random.default_rng(seed).choice([-RELATIVE_PERTURBATION, RELATIVE_PERTURBATION], (2, s.n))
        nudged = rerun(scene=s.replace(velocity=s.velocity * (1.0 + sign[0]), gap=s.gap * (1.0 + sign[1, :-1])))
        change = float(np.abs(nudged.velocity[-1] - run.velocity[-1]).max() / largest_speed(run))
        changes.append(change / RELATIVE_PERTURBATION)
    return max(changes)


def largest_speed(run: Trajectory) -> float:
    """Return the largest speed in m/s at the start or the end."""
    return float(np.abs(run.velocity[[0, -1]]).max())

"""Status and message of a finished fixed-step run, with a check of its time step."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular.laws.kinds import number_distinct_rows
from granular.md.fixed.walls import MAX_HITS_PER_STEP
from granular.md.fixed.window import BESIDE, DEEPEST, XI
from granular.md.time_step import DOUBTFUL_DT_LAMBDA, expected_rate, highest_rate_bound
from granular.run.trajectory import Status
from granular.run.until import raised
from granular.scene import positions


@np.errstate(all="ignore")
def status_and_message(run: Any, status: Status, end: float) -> tuple[Status, str, float]:
    """Return status, message and dt·λ of a run that ended at `end` in s with `status`.

    λ is the highest rate of the contacts that took place, see `granular.md.time_step`. The status becomes
    ``unstable`` if dt·λ exceeds the stability limit of the integrator, or if the final kinetic energy exceeds 1.5
    times the available energy. For a smaller dt·λ above `DOUBTFUL_DT_LAMBDA`, `step_warning` of the run is set.
    """
    scene, dt, laws, pairs = run.scene, run.dt, run.stepper.laws, run.stepper.pairs
    dt_lambda = dt * highest_rate_bound(scene, laws, pairs(DEEPEST), pairs(BESIDE)) if pairs(DEEPEST).any() else 0.0
    # contacts shorter than a step leave no overlap
    if dt_lambda == 0.0 and run.steps and _is_any_ball_deflected(run):
        dt_lambda = dt * expected_rate(scene, laws)
    gain = _energy_gain(run) if run.steps else 0.0
    limit = f"dt = {dt:.3g} s times the highest rate of the contacts is {dt_lambda:.3g}"
    if run.has_too_many_hits:
        return status, (f"dt = {dt:.3g} s is so long that a ball hits a thermal wall more than {MAX_HITS_PER_STEP} "
                        "times per step; use a shorter step."), dt_lambda
    # an energy gain of 50 % cannot be truncation error of a stable step
    if dt_lambda > (stability_limit := run.integrator.limit) or status is Status.unstable or gain > 0.5:
        growth = f"{gain + 1.0:.3g}-fold" if gain < math.inf else "beyond the range of numbers"
        growth_note = f", and the energy grew {growth}" * (gain > 0.5)
        is_rate_known = 0.0 < dt_lambda < math.inf  # otherwise the force jumps or is constant at its last overlap
        advice = f"use dt ≤ {DOUBTFUL_DT_LAMBDA * dt / dt_lambda:.2g} s" if dt_lambda > DOUBTFUL_DT_LAMBDA else (
            "the force of a law jumps or is not finite")
        return Status.unstable, (
            f"{limit}, the stability limit is {stability_limit:g}{growth_note}; {advice}." if is_rate_known else
            f"dt = {dt:.3g} s is too long for a force that jumps{growth_note}; use a shorter step."), dt_lambda
    if dt_lambda > DOUBTFUL_DT_LAMBDA:
        run.step_warning = (f"{limit}; above {DOUBTFUL_DT_LAMBDA} errors are visible, so use "
                      f"dt ≤ {DOUBTFUL_DT_LAMBDA * dt / dt_lambda:.2g} s.")
    if status is Status.max_events:
        option = "max_steps" if run.steps >= run.request.max_steps else "max_events"
        work = f"{run.contacts} contacts, {run.steps} steps"
        return status, f"{status.value} (t = {end:.6g} s, {work}); {raised(option, run.request.end)}.", dt_lambda
    return status, f"{status.value} at t = {end:.6g} s.", dt_lambda


def _is_any_ball_deflected(run: Any) -> bool:
    """Return whether any velocity differs from the motion without contacts.

    The result is always False in a scene with thermal walls.
    """
    scene, balls = run.scene, ~run.scene.is_wall
    if scene.heated:
        return False
    free, v = scene.free_velocity(run.k * run.dt)[balls], run.stepper.balls()[balls]
    return not bool((np.abs(v - free) <= 1e-9 * float(np.abs(free).max())).all())


def _energy_gain(run: Any) -> float:
    """Return the relative excess of final kinetic energy over available energy.

    The available energy is the initial kinetic and elastic energy plus the work of gravity and external forces. For
    pendula it includes their initial potential energy. The result is 0 if walls supply energy.
    """
    scene, balls = run.scene, ~run.scene.is_wall
    if scene.fed:
        return 0.0
    m, v0, v = scene.mass[balls], scene.velocity[balls], run.stepper.balls()[balls]
    x = positions(scene, -run.stepper.pairs(XI)[None], np.array([run.k * run.dt]), run.start)[0][balls]
    (kind, each), begun = run.stepper.laws.in_pairs, np.flatnonzero(scene.gap < 0.0)
    number, first = number_distinct_rows(kind[begun], scene.gap[begun]) if len(begun) else (begun, begun)
    stored = np.array([each[kind[c]].energy(-float(scene.gap[c])) for c in begun[first].tolist()])[number].tolist()
    fallen = max(0.0, (m * scene.fall[balls]) @ (x - scene.position[balls])) if scene.pendulum == 0.0 else (
        0.5 * scene.pendulum**2 * (m @ scene.displacement[balls] ** 2))
    supply = 0.5 * m @ v0**2 + sum(stored) + fallen
    return float(0.5 * m @ v**2 / supply - 1.0) if supply > 0.0 else 0.0

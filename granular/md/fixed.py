"""Run a scene with a fixed time step and report honestly how far the step could be trusted."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from granular import until as stop
from granular._check import Array
from granular.laws.kinds import SceneLaws
from granular.md.log_rows import contact_log, logged
from granular.md.stability import LIMIT, WARN, expected_rate, sharpest_rate
from granular.md.stepper import Row, Stepper
from granular.md.steps import EVALUATIONS
from granular.scene import Scene, positions
from granular.trajectory import Status, Trajectory


def run(
    scene: Scene,
    laws: SceneLaws,
    *,
    method: str,
    dt: float,
    t_start: float,
    t_end: float,
    until: stop.Until | None,
    samples: Array | None,
    log: bool,
    max_events: int,
    max_steps: int,
    on_event: Callable[[Any], object] | None,
    on_progress: Callable[[float, int], object] | None,
    engine: str,
) -> Trajectory:
    """Run checked arguments; see `granular.md.simulate`."""
    stepper = Stepper(scene, laws, method, dt, t_start, engine, log or on_event is not None)
    rows: list[Row] = [stepper.row(t_start)] if samples is None else []
    wanted = [] if samples is None else samples.tolist()
    status = Status.until if stepper.halts_at_start(until) else None
    told = taken = 0
    last_step = math.floor((t_end - t_start) / dt) if t_end < math.inf else math.inf
    while status is None:
        target = wanted[taken] if taken < len(wanted) else t_end
        limit = math.floor((target - t_start) / dt) if target < math.inf else math.inf
        if stepper.k < limit:
            status = stepper.advance(limit, last_step, until, max_events)
        elif taken < len(wanted):
            rows.append(stepper.row(target))
            taken += 1
        else:
            status = Status.time
        if not all(math.isfinite(v) for v in stepper.s.v):
            status = Status.unstable
        if status is None and stepper.steps >= max_steps:
            status = Status.max_events
        if on_event is not None and len(stepper.rows) > told:
            for contact in logged(stepper, stepper.rows[told:]):
                on_event(contact)
            told = len(stepper.rows)
        if on_progress is not None:
            on_progress(stepper.time(), stepper.contacts)
    last = stepper.last_row(status, t_end)
    if samples is None or not rows or rows[-1][0] < last[0]:
        rows.append(last)
    return _trajectory(stepper, rows, status, last[0], log)


def _trajectory(stepper: Stepper, rows: list[Row], status: Status, t_stop: float, log: bool) -> Trajectory:
    scene, dt = stepper.scene, stepper.dt
    status, message, trust = _judge(stepper, status, t_stop)
    time = np.array([row[0] for row in rows])
    gap = -np.array([row[1] for row in rows])
    stats = {
        "method": stepper.name,
        "dt": dt,
        "dt_lambda": trust,
        "steps": stepper.steps,
        "flights": stepper.flights,
        "evaluations": stepper.steps * EVALUATIONS[stepper.method],
        "contacts": stepper.contacts,
        "shared_impulse": math.fsum(stepper.now.shared),
        "engine": "compiled" if stepper.compiled else "plain",
    } | ({"note": stepper.note} if stepper.note else {})
    return Trajectory(
        scene, stepper.laws.given, None, time, positions(scene, gap, time - stepper.t_start),
        np.array([row[2] for row in rows]), gap, np.array([row[3] for row in rows]),
        contact_log(stepper, t_stop) if log else logged(stepper, []), status, message, stats, stepper.checkpoint(),
    )  # fmt: skip


def _judge(stepper: Stepper, status: Status, t_stop: float) -> tuple[Status, str, float]:
    """Status, message and dt·λ of the contacts that took place, and a warning if the step was too long."""
    scene, dt = stepper.scene, stepper.dt
    trust = dt * sharpest_rate(scene, stepper.laws, stepper.now.deepest, stepper.now.beside)
    if trust == 0.0 and _deflected(stepper):  # contacts shorter than a step leave no overlap behind
        trust = dt * expected_rate(scene, stepper.laws)
    gain = _energy_gain(stepper)
    limit = f"dt = {dt:.3g} s is {trust:.3g} times the inverse of the sharpest rate of the contacts that took place"
    most = LIMIT[stepper.name]
    if trust > most or status is Status.unstable or gain > 0.5:
        grown = f" and the energy grew {gain + 1.0:.3g}-fold" if gain > 0.5 else ""
        return Status.unstable, f"{limit}, the limit is {most:g}{grown}: take dt ≤ {WARN * dt / trust:.2g} s.", trust
    if trust > WARN:
        warnings.warn(f"{limit}; above {WARN} expect visible errors.", RuntimeWarning, stacklevel=5)
    if status is Status.max_events:
        work = f"{stepper.contacts} contacts, {stepper.steps} steps"
        return status, f"{status.value}: {work} by t = {t_stop:.6g} s.", trust
    return status, f"{status.value} at t = {t_stop:.6g} s.", trust


def _deflected(stepper: Stepper) -> bool:
    """Whether any ball moves otherwise than it would have fallen freely."""
    scene, v = stepper.scene, np.array(stepper.s.v)
    free = scene.velocity - np.where(scene.is_wall, 0.0, scene.gravity * stepper.k * stepper.dt)
    scale = float(np.abs(free).max())
    return not bool((np.abs(v - free) <= 1e-9 * scale).all())


def _energy_gain(stepper: Stepper) -> float:
    """Growth of kinetic energy beyond what gravity gave, relative to the largest supply; 0 with moving walls."""
    scene, balls = stepper.scene, ~stepper.scene.is_wall
    if scene.velocity[~balls].any():
        return 0.0
    m, v0, v = scene.mass[balls], scene.velocity[balls], np.array(stepper.s.v)[balls]
    x0 = scene.position[balls]
    x = positions(scene, -np.array([stepper.s.xi]), np.array([stepper.k * stepper.dt]))[0][balls]
    before = 0.5 * m @ v0**2 + sum(
        stepper.laws[c].energy(-float(scene.gap[c])) for c in np.flatnonzero(scene.gap < 0.0).tolist()
    )
    supply = before + scene.gravity * max(0.0, m @ (x0 - x))
    with np.errstate(all="ignore"):
        return float(0.5 * m @ v**2 / supply - 1.0) if supply > 0.0 else 0.0

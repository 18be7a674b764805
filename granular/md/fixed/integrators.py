"""Fixed-step integrators, as kernels that advance a window by one step.

The state is the overlap ξ of each pair and the velocity v of each body, with ``overlap rate = v[c] - v[c+1]``. The
signature of a step is ``step(physics, lo, m, a)``: it advances the first `m` pairs of the window `a`, which begins at
pair `lo`. In the rows of the window (see `window`), pair lo + j has index j + 1. Body lo + i has index i + 1.

Every step stores the unclipped contact forces of the new state in `a.raw`, and the next step reuses them. Verlet, Euler
and Gear evaluate each force once per step, Runge-Kutta four times. A step returns the flags `CHANGED` (a force or an
overlap appears or vanishes) and `CLOSED` (an overlap exists).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from granular._engine.kernels import DRIVEN, HUNG, WORKED, kernel
from granular.md.fixed.contact_force import object_force as force
from granular.md.fixed.window import (
    END,
    ENERGIES,
    HALF,
    HAS_DAMPING,
    KEEPS_LOG,
    LAST,
    MIDDLE,
    START,
    WHOLE,
    connect_ring_ends,
    set_wall_speeds,
)

CHANGED, CLOSED = 1, 2


@kernel
def ball_acceleration(i: int, below: float, above: float, a: Any) -> Any:
    """Return the acceleration of body i in m/s², a_i = (F_{i-1} - F_i) / m_i - g.

    `below` and `above` are the unclipped forces F_{i-1} and F_i in N. For a wall the acceleration is 0. For a pendulum,
    -Ω² y_i replaces -g, where `a.square` is Ω² in 1/s² and `a.off` is y in m.
    """
    push = (below if below > 0.0 else 0.0) - (above if above > 0.0 else 0.0)
    if HUNG:
        return a.w[i + 1] * push - a.square[i + 1] * a.off[i + 1]
    return a.w[i + 1] * push + a.fall[i + 1]


@kernel
def update_peaks(j: int, was_xi: float, xi: float, was: float, raw: float, a: Any) -> int:
    """Update the largest overlap and force of pair `j`, and return its flags.

    `was_xi` and `xi` are its overlaps in m, `was` and `raw` its unclipped forces in N, before and after the step. The
    flags are `CHANGED` (bit 0) if the overlap or the force has begun or ended, and `CLOSED` (bit 1) if the pair now
    overlaps.
    """
    # the sums with 0.0 change no value, but prevent masked stores, which are slow on some processors
    a.deepest[j + 1] = (xi if xi > a.deepest[j + 1] else a.deepest[j + 1]) + 0.0
    if KEEPS_LOG:
        a.xi_max[j + 1] = (xi if xi > a.xi_max[j + 1] else a.xi_max[j + 1]) + 0.0
        if KEEPS_LOG != ENERGIES:
            a.force_max[j + 1] = (raw if raw > a.force_max[j + 1] else a.force_max[j + 1]) + 0.0
    was_overlapping, is_overlapping = 1 if was_xi > 0.0 else 0, 1 if xi > 0.0 else 0
    return (was_overlapping ^ is_overlapping) | ((1 if was > 0.0 else 0) ^ (1 if raw > 0.0 else 0)) | 2 * is_overlapping


@kernel
def update_common_overlap(m: int, a: Any) -> None:
    """Update the largest common overlap `beside` of each pair and the next pair.

    For pair c, `beside` is the largest value so far of min(ξ_c, ξ_(c+1)) in m. It is positive if both pairs overlapped
    at the same time. The update takes place at the start of a window, and after steps in which an overlap or a force
    appears or vanishes.
    """
    for j in range(m):
        common_overlap = a.xi[j + 1] if a.xi[j + 1] < a.xi[j + 2] else a.xi[j + 2]
        a.beside[j + 1] = common_overlap if common_overlap > a.beside[j + 1] else a.beside[j + 1]


@kernel
def add_impulse(j: int, half: float, a: Any) -> None:
    """Add the impulse of pair `j` in a step of length 2·`half` in s to its sums.

    The impulse is added to `a.shared` if a neighbouring pair exerts a force. If a log is kept, it is always added to
    `a.impulse`. The energies ∫ F dξ by the trapezoidal rule are consistent with Verlet's method: their sum over all
    pairs is the energy that the balls lose between two free flights, to rounding.
    """
    before, after = a.was_raw[j + 1] if a.was_raw[j + 1] > 0.0 else 0.0, a.raw[j + 1] if a.raw[j + 1] > 0.0 else 0.0
    # trapezoidal rule
    neighbour_force, impulse = a.raw[j] if a.raw[j] > a.raw[j + 2] else a.raw[j + 2], half * (before + after)
    a.shared[j + 1] += impulse if neighbour_force > 0.0 else 0.0
    if KEEPS_LOG:
        a.impulse[j + 1] += impulse
    if KEEPS_LOG == ENERGIES:
        a.force_max[j + 1] += 0.5 * (before + after) * (a.xi[j + 1] - a.was_xi[j + 1])


@kernel
def move_pair(physics: Any, lo: int, j: int, a: Any) -> int:
    """Advance pair `j` by one step, evaluate its force, and return its flags.

    The bodies move at the velocities `a.half`. The force is evaluated with the velocities `a.guess`. The flags
    `CHANGED` and `CLOSED` are explained in the module docstring.
    """
    was_xi, was = a.xi[j + 1], a.raw[j + 1]
    xi = was_xi + physics.dt * (a.half[j + 1] - a.half[j + 2])
    raw = force(physics, lo, j, xi, a.guess[j + 1] - a.guess[j + 2], a)
    if KEEPS_LOG or WORKED:
        a.was_xi[j + 1] = was_xi
    a.was_raw[j + 1], a.xi[j + 1], a.raw[j + 1] = was, xi, raw
    return update_peaks(j, was_xi, xi, was, raw, a)


@kernel
def prepare_nothing(dt: float, m: int, a: Any) -> None:
    """Do nothing. This integrator needs no preparation of its first step."""


@kernel
def prepare_verlet(dt: float, m: int, a: Any) -> None:
    """Prepare the first of several Verlet steps of length `dt` in s.

    The velocities at half a step are stored in `a.half`, and the predicted velocities in `a.guess`.
    """
    for i in range(m + 1):
        acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        a.half[i + 1] = a.v[i + 1] + 0.5 * dt * acc
        if HAS_DAMPING:
            a.guess[i + 1] = a.v[i + 1] + dt * acc


@kernel
def finish_verlet_step(i: int, dt: float, a: Any) -> None:
    """Finish the Verlet step of body i, and add the next half step to its velocity."""
    if HUNG:
        a.off[i + 1] += dt * a.half[i + 1]
    acc, half = ball_acceleration(i, a.raw[i], a.raw[i + 1], a), 0.5 * dt
    v = a.half[i + 1] + half * acc
    a.v[i + 1], a.half[i + 1] = v, v + half * acc
    if HAS_DAMPING:
        a.guess[i + 1] = v + dt * acc


@kernel
def verlet(physics: Any, lo: int, m: int, a: Any) -> int:
    """Advance a window by one step of velocity Verlet, and return its flags.

    The velocities also advance by the first half of the next step. A force that depends on the overlap rate is
    evaluated with the predicted velocity v + a·dt. The velocities one step ago are stored only if a contact begins or
    ends, or if walls do work.
    """
    if DRIVEN:
        set_wall_speeds(physics, lo, m, a.half, WHOLE, a.guess, END)
    flags, dt, half = 0, physics.dt, 0.5 * physics.dt
    for j in range(m):
        flags |= move_pair(physics, lo, j, a)
    connect_ring_ends(physics, m, a)
    if WORKED or (KEEPS_LOG and flags & CHANGED):
        for i in range(m + 1):
            a.was_v[i + 1] = a.v[i + 1]
    for j in range(m):
        finish_verlet_step(j, dt, a)
        add_impulse(j, half, a)
    finish_verlet_step(m, dt, a)
    if DRIVEN:
        set_wall_speeds(physics, lo, m, a.was_v, START, a.v, END)
    return flags


@kernel
def symplectic_euler(physics: Any, lo: int, m: int, a: Any) -> int:
    """Advance a window by one step of symplectic Euler, and return its flags.

    The method is also called semi-implicit Euler. The velocities advance with the old forces, and then the overlaps
    with the new velocities.
    """
    flags, dt = 0, physics.dt
    for i in range(m + 1):
        v = a.v[i + 1] + dt * ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        if KEEPS_LOG or WORKED:
            a.was_v[i + 1] = a.v[i + 1]
        a.v[i + 1] = a.half[i + 1] = a.guess[i + 1] = v
    if DRIVEN:
        set_wall_speeds(physics, lo, m, a.was_v, START, a.v, END)
        set_wall_speeds(physics, lo, m, a.half, WHOLE, a.guess, END)
    for j in range(m):
        flags |= move_pair(physics, lo, j, a)
    if HUNG:
        for i in range(m + 1):
            a.off[i + 1] += dt * a.half[i + 1]
    connect_ring_ends(physics, m, a)
    for j in range(m):
        add_impulse(j, 0.5 * dt, a)
    return flags


@kernel
def _add_stage(
    physics: Any, lo: int, m: int, elapsed: float, weight: float, drift_kind: int, speed_kind: int, a: Any
) -> None:
    """Add the derivatives of a Runge-Kutta stage, and evaluate the next stage.

    Parameters
    ----------
    elapsed : float
        Time of the next stage in s after the start of the step.
    weight : float
        Weight of the derivatives in the sum over all stages.
    drift_kind, speed_kind : int
        Velocities of driven walls in the next stage, `window.HALF` to `END`: for the motion and for the forces.
    """
    for i in range(m + 1):
        acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        a.acc[i + 1] += weight * acc
        a.half[i + 1], a.guess[i + 1] = a.guess[i + 1], a.v[i + 1] + elapsed * acc
        if HUNG:
            a.sway[i + 1] += weight * a.half[i + 1]
            a.off[i + 1] = a.start[i + 1] + elapsed * a.half[i + 1]
    if DRIVEN:
        set_wall_speeds(physics, lo, m, a.half, drift_kind, a.guess, speed_kind)
    for j in range(m):
        rate = a.half[j + 1] - a.half[j + 2]
        a.rate[j + 1] += weight * rate
        a.raw[j + 1] = force(physics, lo, j, a.xi[j + 1] + elapsed * rate, a.guess[j + 1] - a.guess[j + 2], a)
    connect_ring_ends(physics, m, a)


@kernel
def rk4(physics: Any, lo: int, m: int, a: Any) -> int:
    """Advance a window by one Runge-Kutta step of order 4, and return its flags."""
    flags, dt, half, sixth = 0, physics.dt, 0.5 * physics.dt, physics.dt / 6.0
    for i in range(m + 1):
        a.was_v[i + 1], a.guess[i + 1], a.acc[i + 1] = a.v[i + 1], a.v[i + 1], 0.0
        if HUNG:
            a.start[i + 1], a.sway[i + 1] = a.off[i + 1], 0.0
    for j in range(m):
        a.was_xi[j + 1], a.was_raw[j + 1], a.rate[j + 1] = a.xi[j + 1], a.raw[j + 1], 0.0
    _add_stage(physics, lo, m, half, 1.0, HALF, MIDDLE, a)
    _add_stage(physics, lo, m, half, 2.0, HALF, MIDDLE, a)
    _add_stage(physics, lo, m, dt, 2.0, WHOLE, END, a)
    for i in range(m + 1):
        v = a.v[i + 1] + sixth * (a.acc[i + 1] + ball_acceleration(i, a.raw[i], a.raw[i + 1], a))
        a.half[i + 1], a.v[i + 1] = a.guess[i + 1], v
        if HUNG:
            a.off[i + 1] = a.start[i + 1] + sixth * (a.sway[i + 1] + a.half[i + 1])
    if DRIVEN:
        set_wall_speeds(physics, lo, m, a.half, LAST, a.guess, END)
        set_wall_speeds(physics, lo, m, a.was_v, START, a.v, END)
    for j in range(m):
        xi = a.xi[j + 1] + sixth * (a.rate[j + 1] + (a.half[j + 1] - a.half[j + 2]))
        raw = force(physics, lo, j, xi, a.v[j + 1] - a.v[j + 2], a)
        flags |= update_peaks(j, a.xi[j + 1], xi, a.was_raw[j + 1], raw, a)
        a.xi[j + 1], a.raw[j + 1] = xi, raw
    connect_ring_ends(physics, m, a)
    for j in range(m):
        add_impulse(j, half, a)
    return flags


@kernel
def gear5(physics: Any, lo: int, m: int, a: Any) -> int:
    """Advance a window by one step of Gear's five-value method, and return its flags.

    This predictor-corrector method for second-order equations stores ξ, v, a and two more derivatives (`jerk`, `snap`).
    The coefficients of its corrector are 19/90, 3/4, 1, 1/2, 1/12. `jerk` and `snap` start at 0. A run that starts in
    contact therefore converges with order 2, as does a contact after its onset.
    """
    flags, dt, half = 0, physics.dt, 0.5 * physics.dt
    # Taylor coefficients of the predictor
    d2, d3, d4 = dt * dt / 2.0, dt * dt * dt / 6.0, dt * dt * dt * dt / 24.0
    if DRIVEN:
        set_wall_speeds(physics, lo, m, a.was_v, START, a.v, WHOLE)
    for j in range(m):
        rate, pull = a.v[j + 1] - a.v[j + 2], a.acc[j + 1] - a.acc[j + 2]
        third_order = d3 * (a.jerk[j + 1] - a.jerk[j + 2])
        a.was_xi[j + 1] = a.xi[j + 1]
        a.xi[j + 1] += dt * rate + d2 * pull + third_order + d4 * (a.snap[j + 1] - a.snap[j + 2])
    for i in range(m + 1):
        v, acc, jerk, snap = a.v[i + 1], a.acc[i + 1], a.jerk[i + 1], a.snap[i + 1]
        if HUNG:
            a.off[i + 1] += dt * v + d2 * acc + d3 * jerk + d4 * snap
        a.was_v[i + 1], a.v[i + 1] = v, v + (dt * acc + d2 * jerk + d3 * snap)
        a.acc[i + 1], a.jerk[i + 1] = acc + dt * jerk + d2 * snap, jerk + dt * snap
    if DRIVEN:
        set_wall_speeds(physics, lo, m, a.was_v, START, a.v, END)
    for j in range(m):
        a.was_raw[j + 1] = a.raw[j + 1]
        a.raw[j + 1] = force(physics, lo, j, a.xi[j + 1], a.v[j + 1] - a.v[j + 2], a)
    connect_ring_ends(physics, m, a)
    for i in range(m + 1):
        acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        correction = acc - a.acc[i + 1]
        a.half[i + 1], a.acc[i + 1] = correction, acc
        # coefficient c_k of the scaled k-th derivative becomes c_k k!/2 dt^(2-k): 3/4 · dt/2, and so on
        a.v[i + 1] += 0.375 * dt * correction
        a.jerk[i + 1] += 1.5 / dt * correction
        a.snap[i + 1] += 1.0 / (dt * dt) * correction
        if HUNG:
            a.off[i + 1] += 19.0 / 180.0 * dt * dt * correction
    for j in range(m):
        # 19/90 · dt²/2
        xi = a.xi[j + 1] + 19.0 / 180.0 * dt * dt * (a.half[j + 1] - a.half[j + 2])
        a.xi[j + 1] = xi
        flags |= update_peaks(j, a.was_xi[j + 1], xi, a.was_raw[j + 1], a.raw[j + 1], a)
    connect_ring_ends(physics, m, a)
    for j in range(m):
        add_impulse(j, half, a)
    return flags


class Integrator(NamedTuple):
    """A fixed-step method.

    Attributes
    ----------
    name : str
        Name in `granular.md.simulate`.
    step : kernel
        ``step(physics, lo, m, a)`` advances the `m` pairs of a window that starts at pair `lo`, and returns flags.
    begin : kernel
        ``begin(dt, m, a)`` prepares the first of several steps.
    order : float
        Order of the error for smooth forces. Gear's method reaches it once its derivatives are known.
    evaluations : int
        Evaluations of each force per step, equal to the number of pairs by which a force propagates per step.
    limit : float
        dt·λ above which results are meaningless. λ in 1/s is the highest rate of the contacts, see
        `granular.md.time_step`. Runge-Kutta becomes unstable only above 2√2, but at 2 it damps by a quarter per step.
    label : str
        Full name for figures.
    derivatives : bool
        Whether the method stores accelerations and higher derivatives of the velocities.
    """

    name: str
    step: Callable[..., int]
    begin: Callable[..., None]
    order: float
    evaluations: int
    limit: float
    label: str
    derivatives: bool = False


INTEGRATORS = {
    integrator.name: integrator
    for integrator in (
        Integrator("verlet", verlet, prepare_verlet, 2.0, 1, 2.0, "velocity Verlet"),
        Integrator("symplectic-euler", symplectic_euler, prepare_nothing, 1.0, 1, 2.0, "symplectic Euler"),
        Integrator("rk4", rk4, prepare_nothing, 4.0, 4, 2.0, "Runge–Kutta 4"),
        Integrator("gear5", gear5, prepare_nothing, 4.0, 1, 1.05, "Gear, 5 values", derivatives=True),
    )
}
"""All integrators by name."""

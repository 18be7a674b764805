"""Fixed-step integrators, as kernels that advance a window by one step.

The state is the overlap ξ of each pair and the velocity v of each body, with ``overlap rate = v[c] - v[c+1]``. Every
step stores in `raw` the unclipped contact forces of the new state, which the next step reuses. Verlet, Euler and Gear
evaluate each force once per step, Runge-Kutta four times. A step calls `noted` and returns the flags `CHANGED` (a force
or an overlap appears or vanishes) and `CLOSED` (an overlap exists).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from granular._engine.kernels import DRIVEN, HUNG, WORKED, kernel
from granular.md.fixed.contact_force import object_force as force
from granular.md.fixed.window import END, HALF, HAS_DAMPING, KEEPS_LOG, LAST, MIDDLE, START, WHOLE, close, steer

CHANGED, CLOSED = 1, 2


@kernel
def ball_acceleration(i: int, below: float, above: float, a: Any) -> Any:
    """Return the acceleration of ball i in m/s², a_i = (F_{i-1} - F_i) / m_i - g.

    Walls (1/m = 0, no fall) keep their velocity. For a pendulum, -Ω² y_i replaces -g, where `a.square` is Ω² in 1/s²
    and `a.off` is y in m.
    """
    push = (below if below > 0.0 else 0.0) - (above if above > 0.0 else 0.0)
    if HUNG:
        return a.w[i + 1] * push - a.square[i + 1] * a.off[i + 1]
    return a.w[i + 1] * push + a.fall[i + 1]


@kernel
def noted(j: int, was_xi: float, xi: float, was: float, raw: float, a: Any) -> int:
    """Update the largest overlap of pair `j`, for a log also peaks, and return flags."""
    a.deepest[j + 1] = xi if xi > a.deepest[j + 1] else a.deepest[j + 1]
    if KEEPS_LOG:
        a.xi_max[j + 1] = xi if xi > a.xi_max[j + 1] else a.xi_max[j + 1]
        a.force_max[j + 1] = raw if raw > a.force_max[j + 1] else a.force_max[j + 1]
    opened, closed = 1 if was_xi > 0.0 else 0, 1 if xi > 0.0 else 0
    return (opened ^ closed) | ((1 if was > 0.0 else 0) ^ (1 if raw > 0.0 else 0)) | 2 * closed


@kernel
def beside(m: int, a: Any) -> None:
    """Update the common overlap of each pair and the next one.

    It is called only after steps in which this can change.
    """
    for j in range(m):
        both = a.xi[j + 1] if a.xi[j + 1] < a.xi[j + 2] else a.xi[j + 2]
        a.beside[j + 1] = both if both > a.beside[j + 1] else a.beside[j + 1]


@kernel
def share(j: int, half: float, a: Any) -> None:
    """Add the impulse of pair `j` in a step of length 2·`half`.

    It counts as shared if a neighbouring pair exerts a force. For a log the total is kept as well.
    """
    before, after = a.was_raw[j + 1] if a.was_raw[j + 1] > 0.0 else 0.0, a.raw[j + 1] if a.raw[j + 1] > 0.0 else 0.0
    # trapezoidal rule
    pushed, impulse = a.raw[j] if a.raw[j] > a.raw[j + 2] else a.raw[j + 2], half * (before + after)
    a.shared[j + 1] += impulse if pushed > 0.0 else 0.0
    if KEEPS_LOG:
        a.impulse[j + 1] += impulse


@kernel
def move_pair(physics: Any, lo: int, j: int, a: Any) -> int:
    """Move pair `j` with the velocities `half`, and evaluate its force.

    The force sees the velocities `guess`.
    """
    was_xi, was = a.xi[j + 1], a.raw[j + 1]
    xi = was_xi + physics.dt * (a.half[j + 1] - a.half[j + 2])
    raw = force(physics, lo, j, xi, a.guess[j + 1] - a.guess[j + 2], a)
    if KEEPS_LOG or WORKED:
        a.was_xi[j + 1] = was_xi
    a.was_raw[j + 1], a.xi[j + 1], a.raw[j + 1] = was, xi, raw
    return noted(j, was_xi, xi, was, raw, a)


@kernel
def idle(dt: float, m: int, a: Any) -> None:
    """Do nothing: no preparation is required."""


@kernel
def half_way(dt: float, m: int, a: Any) -> None:
    """Prepare the first of several Verlet steps."""
    for i in range(m + 1):
        acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        a.half[i + 1] = a.v[i + 1] + 0.5 * dt * acc
        if HAS_DAMPING:
            a.guess[i + 1] = a.v[i + 1] + dt * acc


@kernel
def kick(i: int, dt: float, a: Any) -> None:
    """Finish a Verlet step of ball i, and start the next one."""
    if HUNG:
        a.off[i + 1] += dt * a.half[i + 1]
    acc, half = ball_acceleration(i, a.raw[i], a.raw[i + 1], a), 0.5 * dt
    v = a.half[i + 1] + half * acc
    a.v[i + 1], a.half[i + 1] = v, v + half * acc
    if HAS_DAMPING:
        a.guess[i + 1] = v + dt * acc


@kernel
def verlet(physics: Any, lo: int, m: int, a: Any) -> int:
    """Velocity Verlet. It starts the next step as well.

    A rate-dependent force sees the predicted velocity v + a·dt. The velocities one step ago are stored only if a
    contact begins or ends, or if walls do work.
    """
    if DRIVEN:
        steer(physics, lo, m, a.half, WHOLE, a.guess, END)
    flags, dt, half = 0, physics.dt, 0.5 * physics.dt
    for j in range(m):
        flags |= move_pair(physics, lo, j, a)
    close(physics, m, a)
    if WORKED or (KEEPS_LOG and flags & CHANGED):
        for i in range(m + 1):
            a.was_v[i + 1] = a.v[i + 1]
    for j in range(m):
        kick(j, dt, a)
        share(j, half, a)
    kick(m, dt, a)
    if DRIVEN:
        steer(physics, lo, m, a.was_v, START, a.v, END)
    return flags


@kernel
def symplectic_euler(physics: Any, lo: int, m: int, a: Any) -> int:
    """Symplectic (semi-implicit) Euler.

    It kicks with the old force and drifts with the new velocity.
    """
    flags, dt = 0, physics.dt
    for i in range(m + 1):
        v = a.v[i + 1] + dt * ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        if KEEPS_LOG or WORKED:
            a.was_v[i + 1] = a.v[i + 1]
        a.v[i + 1] = a.half[i + 1] = a.guess[i + 1] = v
    if DRIVEN:
        steer(physics, lo, m, a.was_v, START, a.v, END)
        steer(physics, lo, m, a.half, WHOLE, a.guess, END)
    for j in range(m):
        flags |= move_pair(physics, lo, j, a)
    if HUNG:
        for i in range(m + 1):
            a.off[i + 1] += dt * a.half[i + 1]
    close(physics, m, a)
    for j in range(m):
        share(j, 0.5 * dt, a)
    return flags


@kernel
def _stage(physics: Any, lo: int, m: int, reach: float, weight: float, drift: int, speed: int, a: Any) -> None:
    """Add the derivatives of a Runge-Kutta stage, and evaluate the next stage.

    The next stage is `reach` seconds after the start of the step.
    """
    for i in range(m + 1):
        acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        a.acc[i + 1] += weight * acc
        a.half[i + 1], a.guess[i + 1] = a.guess[i + 1], a.v[i + 1] + reach * acc
        if HUNG:
            a.sway[i + 1] += weight * a.half[i + 1]
            a.off[i + 1] = a.start[i + 1] + reach * a.half[i + 1]
    if DRIVEN:
        steer(physics, lo, m, a.half, drift, a.guess, speed)
    for j in range(m):
        rate = a.half[j + 1] - a.half[j + 2]
        a.rate[j + 1] += weight * rate
        a.raw[j + 1] = force(physics, lo, j, a.xi[j + 1] + reach * rate, a.guess[j + 1] - a.guess[j + 2], a)
    close(physics, m, a)


@kernel
def rk4(physics: Any, lo: int, m: int, a: Any) -> int:
    """Classical Runge-Kutta of order 4."""
    flags, dt, half, sixth = 0, physics.dt, 0.5 * physics.dt, physics.dt / 6.0
    for i in range(m + 1):
        a.was_v[i + 1], a.guess[i + 1], a.acc[i + 1] = a.v[i + 1], a.v[i + 1], 0.0
        if HUNG:
            a.start[i + 1], a.sway[i + 1] = a.off[i + 1], 0.0
    for j in range(m):
        a.was_xi[j + 1], a.was_raw[j + 1], a.rate[j + 1] = a.xi[j + 1], a.raw[j + 1], 0.0
    _stage(physics, lo, m, half, 1.0, HALF, MIDDLE, a)
    _stage(physics, lo, m, half, 2.0, HALF, MIDDLE, a)
    _stage(physics, lo, m, dt, 2.0, WHOLE, END, a)
    for i in range(m + 1):
        v = a.v[i + 1] + sixth * (a.acc[i + 1] + ball_acceleration(i, a.raw[i], a.raw[i + 1], a))
        a.half[i + 1], a.v[i + 1] = a.guess[i + 1], v
        if HUNG:
            a.off[i + 1] = a.start[i + 1] + sixth * (a.sway[i + 1] + a.half[i + 1])
    if DRIVEN:
        steer(physics, lo, m, a.half, LAST, a.guess, END)
        steer(physics, lo, m, a.was_v, START, a.v, END)
    for j in range(m):
        xi = a.xi[j + 1] + sixth * (a.rate[j + 1] + (a.half[j + 1] - a.half[j + 2]))
        raw = force(physics, lo, j, xi, a.v[j + 1] - a.v[j + 2], a)
        flags |= noted(j, a.xi[j + 1], xi, a.was_raw[j + 1], raw, a)
        a.xi[j + 1], a.raw[j + 1] = xi, raw
    close(physics, m, a)
    for j in range(m):
        share(j, half, a)
    return flags


@kernel
def gear5(physics: Any, lo: int, m: int, a: Any) -> int:
    """Gear's five-value predictor-corrector for second-order equations.

    The corrector is 19/90, 3/4, 1, 1/2, 1/12. The values are ξ, v, a and the next two derivatives of v (`jerk`,
    `snap`). The last two start at 0, so a run that starts in contact converges with order 2, as it does after an onset.
    """
    flags, dt, half = 0, physics.dt, 0.5 * physics.dt
    # Taylor coefficients of the predictor
    d2, d3, d4 = dt * dt / 2.0, dt * dt * dt / 6.0, dt * dt * dt * dt / 24.0
    if DRIVEN:
        steer(physics, lo, m, a.was_v, START, a.v, WHOLE)
    for j in range(m):
        rate, pull = a.v[j + 1] - a.v[j + 2], a.acc[j + 1] - a.acc[j + 2]
        later = d3 * (a.jerk[j + 1] - a.jerk[j + 2])
        a.was_xi[j + 1] = a.xi[j + 1]
        a.xi[j + 1] += dt * rate + d2 * pull + later + d4 * (a.snap[j + 1] - a.snap[j + 2])
    for i in range(m + 1):
        v, acc, jerk, snap = a.v[i + 1], a.acc[i + 1], a.jerk[i + 1], a.snap[i + 1]
        if HUNG:
            a.off[i + 1] += dt * v + d2 * acc + d3 * jerk + d4 * snap
        a.was_v[i + 1], a.v[i + 1] = v, v + (dt * acc + d2 * jerk + d3 * snap)
        a.acc[i + 1], a.jerk[i + 1] = acc + dt * jerk + d2 * snap, jerk + dt * snap
    if DRIVEN:
        steer(physics, lo, m, a.was_v, START, a.v, END)
    for j in range(m):
        a.was_raw[j + 1] = a.raw[j + 1]
        a.raw[j + 1] = force(physics, lo, j, a.xi[j + 1], a.v[j + 1] - a.v[j + 2], a)
    close(physics, m, a)
    for i in range(m + 1):
        acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        miss = acc - a.acc[i + 1]
        a.half[i + 1], a.acc[i + 1] = miss, acc
        # coefficient c_k of the scaled k-th derivative becomes c_k k!/2 dt^(2-k): 3/4 · dt/2, and so on
        a.v[i + 1] += 0.375 * dt * miss
        a.jerk[i + 1] += 1.5 / dt * miss
        a.snap[i + 1] += 1.0 / (dt * dt) * miss
        if HUNG:
            a.off[i + 1] += 19.0 / 180.0 * dt * dt * miss
    for j in range(m):
        # 19/90 · dt²/2
        xi = a.xi[j + 1] + 19.0 / 180.0 * dt * dt * (a.half[j + 1] - a.half[j + 2])
        a.xi[j + 1] = xi
        flags |= noted(j, a.was_xi[j + 1], xi, a.was_raw[j + 1], a.raw[j + 1], a)
    close(physics, m, a)
    for j in range(m):
        share(j, half, a)
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
        Order of its error for smooth forces. Gear's method reaches it once its derivatives are known.
    evaluations : int
        Evaluations of each force per step, equal to the number of pairs by which a force propagates per step.
    limit : float
        dt·λ above which results are meaningless (λ: sharpest rate of the contacts). Runge-Kutta grows only from 2√2,
        but at 2 it damps by a quarter per step.
    label : str
        Full name.
    derivatives : bool
        Whether it stores accelerations and higher derivatives of the velocities.
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
        Integrator("verlet", verlet, half_way, 2.0, 1, 2.0, "velocity Verlet"),
        Integrator("symplectic-euler", symplectic_euler, idle, 1.0, 1, 2.0, "symplectic Euler"),
        Integrator("rk4", rk4, idle, 4.0, 4, 2.0, "Runge–Kutta 4"),
        Integrator("gear5", gear5, idle, 4.0, 1, 1.05, "Gear, 5 values", derivatives=True),
    )
}
"""All integrators by name."""

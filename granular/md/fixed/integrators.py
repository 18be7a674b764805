"""What a fixed-step integrator is, and one step of each, as kernels that move a window on.

The state is the overlap ξ of each pair and the velocity v of each body; ``overlap rate = v[c] - v[c+1]``. Every step
leaves in `raw` the (unclipped) contact forces that belong to the new state, which the next step reuses: Verlet, Euler
and Gear evaluate each force once a step, Runge-Kutta four times. A step ends with the notes of `noted`, and returns the
flags `CHANGED` (a force or an overlap comes or goes) and `CLOSED` (there is an overlap).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from granular._engine.kernels import DRIVEN, HUNG, WORKED, kernel
from granular.md.fixed.contact_force import asked as force
from granular.md.fixed.window import DAMPED, END, HALF, LAST, LOGGED, MIDDLE, START, WHOLE, close, steer

CHANGED, CLOSED = 1, 2


@kernel
def ball_acceleration(i: int, below: float, above: float, a: Any) -> Any:
    """Acceleration of ball i in m/s², a_i = (F_{i-1} - F_i) / m_i - g; walls (1/m = 0, no fall) keep their speed.

    Of a pendulum -Ω² y_i stands in place of -g: `a.square` is Ω² in 1/s², `a.off` y in m.
    """
    push = (below if below > 0.0 else 0.0) - (above if above > 0.0 else 0.0)
    if HUNG:
        return a.w[i + 1] * push - a.square[i + 1] * a.off[i + 1]
    return a.w[i + 1] * push + a.fall[i + 1]


@kernel
def noted(j: int, was_xi: float, xi: float, was: float, raw: float, a: Any) -> int:
    """Note the largest overlap of pair `j` after a step, for a log also peaks; return flags."""
    a.deepest[j + 1] = xi if xi > a.deepest[j + 1] else a.deepest[j + 1]
    if LOGGED:
        a.xi_max[j + 1] = xi if xi > a.xi_max[j + 1] else a.xi_max[j + 1]
        a.force_max[j + 1] = raw if raw > a.force_max[j + 1] else a.force_max[j + 1]
    opened, closed = 1 if was_xi > 0.0 else 0, 1 if xi > 0.0 else 0
    return (opened ^ closed) | ((1 if was > 0.0 else 0) ^ (1 if raw > 0.0 else 0)) | 2 * closed


@kernel
def beside(m: int, a: Any) -> None:
    """Note which pairs are closed together with the next one: asked only where that may have changed."""
    for j in range(m):
        both = a.xi[j + 1] if a.xi[j + 1] < a.xi[j + 2] else a.xi[j + 2]
        a.beside[j + 1] = both if both > a.beside[j + 1] else a.beside[j + 1]


@kernel
def share(j: int, half: float, a: Any) -> None:
    """Note the impulse of pair `j` in a step of twice `half`: beside a neighbour that pushes, for a log all."""
    before, after = a.was_raw[j + 1] if a.was_raw[j + 1] > 0.0 else 0.0, a.raw[j + 1] if a.raw[j + 1] > 0.0 else 0.0
    pushed, impulse = a.raw[j] if a.raw[j] > a.raw[j + 2] else a.raw[j + 2], half * (before + after)
    a.shared[j + 1] += impulse if pushed > 0.0 else 0.0
    if LOGGED:
        a.impulse[j + 1] += impulse


@kernel
def move_pair(physics: Any, lo: int, j: int, a: Any) -> int:
    """Move pair `j` by the velocities `half` and evaluate the force there, which sees the velocities `guess`."""
    was_xi, was = a.xi[j + 1], a.raw[j + 1]
    xi = was_xi + physics.dt * (a.half[j + 1] - a.half[j + 2])
    raw = force(physics, lo, j, xi, a.guess[j + 1] - a.guess[j + 2], a)
    if LOGGED or WORKED:
        a.was_xi[j + 1] = was_xi
    a.was_raw[j + 1], a.xi[j + 1], a.raw[j + 1] = was, xi, raw
    return noted(j, was_xi, xi, was, raw, a)


@kernel
def idle(dt: float, m: int, a: Any) -> None:
    """Nothing is to be made ready."""


@kernel
def half_way(dt: float, m: int, a: Any) -> None:
    """Begin the first of several Verlet steps."""
    for i in range(m + 1):
        acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        a.half[i + 1] = a.v[i + 1] + 0.5 * dt * acc
        if DAMPED:
            a.guess[i + 1] = a.v[i + 1] + dt * acc


@kernel
def kick(i: int, dt: float, a: Any) -> None:
    """End a Verlet step of ball i, and begin the next."""
    if HUNG:
        a.off[i + 1] += dt * a.half[i + 1]
    acc, half = ball_acceleration(i, a.raw[i], a.raw[i + 1], a), 0.5 * dt
    v = a.half[i + 1] + half * acc
    a.v[i + 1], a.half[i + 1] = v, v + half * acc
    if DAMPED:
        a.guess[i + 1] = v + dt * acc


@kernel
def verlet(physics: Any, lo: int, m: int, a: Any) -> int:
    """Velocity Verlet; a rate-dependent force sees the predicted velocity v + a·dt. It begins the next step, too.

    The velocities of a step ago are kept only where a contact begins or ends, or walls do work.
    """
    if DRIVEN:
        steer(physics, lo, m, a.half, WHOLE, a.guess, END)
    flags, dt, half = 0, physics.dt, 0.5 * physics.dt
    for j in range(m):
        flags |= move_pair(physics, lo, j, a)
    close(physics, m, a)
    if WORKED or (LOGGED and flags & CHANGED):
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
    """Symplectic (semi-implicit) Euler: kick with the old force, then drift with the new velocity."""
    flags, dt = 0, physics.dt
    for i in range(m + 1):
        v = a.v[i + 1] + dt * ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
        if LOGGED or WORKED:
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
    """Add the derivatives of a stage of Runge-Kutta, and go on from the start to the next one, `reach` in s away."""
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
    """Gear's five-value predictor-corrector for second-order equations, corrector 19/90, 3/4, 1, 1/2, 1/12.

    The values are ξ, v, a and the next two derivatives of v (`jerk`, `snap`). These two begin at 0: a run that starts
    in contact converges with order 2, as one does after an onset.
    """
    flags, dt, half = 0, physics.dt, 0.5 * physics.dt
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
        a.v[i + 1] += 0.375 * dt * miss
        a.jerk[i + 1] += 1.5 / dt * miss
        a.snap[i + 1] += 1.0 / (dt * dt) * miss
        if HUNG:
            a.off[i + 1] += 19.0 / 180.0 * dt * dt * miss
    for j in range(m):
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
        As `granular.md.simulate` calls it.
    step : kernel
        ``step(physics, lo, m, a)``: move the `m` pairs of a window that begins at pair `lo`, and return flags.
    begin : kernel
        ``begin(dt, m, a)``: what is to be done before the first of several steps.
    order : float
        Of its error for smooth forces; Gear's once its derivatives are known.
    evaluations : int
        Of each force in a step: so many balls far a push goes in it.
    limit : float
        dt·λ from which results mean nothing (λ: sharpest rate of the contacts). Runge-Kutta grows only from 2√2, but at
        2 it damps by a quarter a step.
    label : str
        Its full name.
    derivatives : bool
        Whether it remembers accelerations and higher derivatives of the velocities.
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
"""All of them, by name."""

"""What a fixed-step integrator is, and one step of each, as kernels from one state to the next.

The state is the overlap ξ of each pair and the velocity v of each body; ``overlap rate = v[c] - v[c+1]``. Every step
leaves in `raw` the (unclipped) contact forces that belong to the new state, which the next step reuses: Verlet, Euler
and Gear evaluate each force once a step, Runge-Kutta four times. Each loop writes few columns: compilers turn it into
vector code where they can tell at run time that those are not the ones it reads.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from typing import Any, NamedTuple

from granular._kernels import kernel
from granular.md.contact_force import asked as force

State = namedtuple("State", "xi v acc raw top jerk snap")
"""Overlap (P,), velocity and acceleration (n,), unclipped force (P,), largest overlap of the running contact (P,; no
values if no law has memory), Gear's higher derivatives of the velocity (n,; no values for the others)."""
Scratch = namedtuple("Scratch", "v rate acc")
"""Work space: predicted velocity (n,), sums of Runge-Kutta (P,) and (n,)."""
Physics = namedtuple("Physics", "laws w fall dt")
"""What does not change: what the kernel `force` takes for laws, inverse masses, free accelerations, time step."""


@kernel
def forces(laws: Any, xi: Any, v: Any, top: Any, raw: Any) -> None:
    """Evaluate the force of every pair that is closed; it acts as max(0, F)."""
    for c in range(len(xi)):
        x = xi[c]
        f = 0.0
        if x > 0.0:
            f = force(laws, c, x, v[c] - v[c + 1], top[c] if c < len(top) and top[c] > x else x)
        raw[c] = f


@kernel
def accelerations(raw: Any, w: Any, fall: Any, acc: Any) -> None:
    """a_i = (F_{i-1} - F_i) / m_i - g; walls (1/m = 0, no fall) keep their speed."""
    last = len(raw)
    acc[0] = w[0] * (0.0 - (raw[0] if raw[0] > 0.0 else 0.0)) + fall[0]
    for i in range(1, last):
        below = raw[i - 1] if raw[i - 1] > 0.0 else 0.0
        above = raw[i] if raw[i] > 0.0 else 0.0
        acc[i] = w[i] * (below - above) + fall[i]
    acc[last] = w[last] * (raw[last - 1] if raw[last - 1] > 0.0 else 0.0) + fall[last]


@kernel
def drift(dt: float, xi: Any, v: Any, out: Any) -> None:
    """Move the pairs from `xi` to `out`."""
    for c in range(len(xi)):
        out[c] = xi[c] + dt * (v[c] - v[c + 1])


@kernel
def kick(dt: float, v: Any, acc: Any, out: Any) -> None:
    """Change the velocities from `v` to `out`."""
    for i in range(len(v)):
        out[i] = v[i] + dt * acc[i]


@kernel
def add(dt: float, acc: Any, v: Any) -> None:
    """Change the velocities `v` in place."""
    for i in range(len(v)):
        v[i] += dt * acc[i]


@kernel
def verlet(physics: Any, old: Any, s: Any, work: Any) -> None:
    """Velocity Verlet; a rate-dependent force sees the predicted velocity v + a·dt."""
    dt = physics.dt
    kick(dt, old.v, old.acc, work.v)
    kick(0.5 * dt, old.v, old.acc, s.v)
    drift(dt, old.xi, s.v, s.xi)
    forces(physics.laws, s.xi, work.v, old.top, s.raw)
    accelerations(s.raw, physics.w, physics.fall, s.acc)
    add(0.5 * dt, s.acc, s.v)


@kernel
def symplectic_euler(physics: Any, old: Any, s: Any, work: Any) -> None:
    """Symplectic (semi-implicit) Euler: kick with the old force, then drift with the new velocity."""
    kick(physics.dt, old.v, old.acc, s.v)
    drift(physics.dt, old.xi, s.v, s.xi)
    forces(physics.laws, s.xi, s.v, old.top, s.raw)
    accelerations(s.raw, physics.w, physics.fall, s.acc)


@kernel
def rk4(physics: Any, old: Any, s: Any, work: Any) -> None:
    """Classical Runge-Kutta of order 4."""
    dt = physics.dt
    for c in range(len(work.rate)):
        work.rate[c] = old.v[c] - old.v[c + 1]
    for i in range(len(old.v)):
        work.acc[i] = old.acc[i]
    drift(0.5 * dt, old.xi, old.v, s.xi)
    kick(0.5 * dt, old.v, old.acc, s.v)
    _derivatives(physics, old, s)
    _sum_up(2.0, s, work)
    for reach, weight in ((0.5 * dt, 2.0), (dt, 1.0)):
        drift(reach, old.xi, s.v, s.xi)
        kick(reach, old.v, s.acc, s.v)
        _derivatives(physics, old, s)
        _sum_up(weight, s, work)
    kick(dt / 6.0, old.xi, work.rate, s.xi)
    kick(dt / 6.0, old.v, work.acc, s.v)
    _derivatives(physics, old, s)


@kernel
def _derivatives(physics: Any, old: Any, s: Any) -> None:
    forces(physics.laws, s.xi, s.v, old.top, s.raw)
    accelerations(s.raw, physics.w, physics.fall, s.acc)


@kernel
def _sum_up(weight: float, s: Any, work: Any) -> None:
    """Add the derivatives of a stage of Runge-Kutta."""
    for c in range(len(work.rate)):
        work.rate[c] += weight * (s.v[c] - s.v[c + 1])
    add(weight, s.acc, work.acc)


@kernel
def gear5(physics: Any, old: Any, s: Any, work: Any) -> None:
    """Gear's five-value predictor-corrector for second-order equations, corrector 19/90, 3/4, 1, 1/2, 1/12.

    The values are ξ, v, a and the next two derivatives of v (`jerk`, `snap`).
    """
    dt = physics.dt
    d2, d3, d4 = dt * dt / 2.0, dt * dt * dt / 6.0, dt * dt * dt * dt / 24.0
    v, acc, jerk, snap = old.v, old.acc, old.jerk, old.snap
    for c in range(len(old.xi)):
        rate, pull = v[c] - v[c + 1], acc[c] - acc[c + 1]
        later = d3 * (jerk[c] - jerk[c + 1])
        s.xi[c] = old.xi[c] + (dt * rate + d2 * pull + later + d4 * (snap[c] - snap[c + 1]))
    for i in range(len(v)):
        s.v[i] = v[i] + (dt * acc[i] + d2 * jerk[i] + d3 * snap[i])
    for i in range(len(v)):
        work.acc[i] = acc[i] + dt * jerk[i] + d2 * snap[i]
    kick(dt, jerk, snap, s.jerk)
    _derivatives(physics, old, s)
    for i in range(len(v)):
        work.acc[i] = s.acc[i] - work.acc[i]
    add(0.375 * dt, work.acc, s.v)
    add(1.5 / dt, work.acc, s.jerk)
    kick(1.0 / (dt * dt), snap, work.acc, s.snap)
    for c in range(len(old.xi)):
        s.xi[c] += 19.0 / 180.0 * dt * dt * (work.acc[c] - work.acc[c + 1])


@kernel
def remember(old: Any, s: Any) -> None:
    """Note the largest overlaps of running contacts, which laws with memory ask for."""
    for c in range(len(s.top)):
        s.top[c] = 0.0 if s.xi[c] <= 0.0 else (s.xi[c] if s.xi[c] > old.top[c] else old.top[c])


class Integrator(NamedTuple):
    """A fixed-step method.

    Attributes
    ----------
    name : str
        As `granular.md.simulate` calls it.
    step : kernel
        ``step(physics, old, s, work)``: from the state `old` to the state `s`, a step later.
    order : float
        Of its error for smooth forces.
    evaluations : int
        Of each force in a step: so many balls far a push goes in it.
    limit : float
        dt·λ from which results mean nothing (λ: sharpest rate of the contacts). Runge-Kutta grows only from 2√2, but at
        2 it damps by a quarter a step.
    label : str
        Its full name.
    kicks : tuple of float
        Parts of a step for which each ball is kicked before and after the drift; none for methods of another kind.
    """

    name: str
    step: Callable[..., None]
    order: float
    evaluations: int
    limit: float
    label: str
    kicks: tuple[float, ...] = ()


INTEGRATORS = {
    integrator.name: integrator
    for integrator in (
        Integrator("verlet", verlet, 2.0, 1, 2.0, "velocity Verlet", (0.5, 0.5)),
        Integrator("symplectic-euler", symplectic_euler, 1.0, 1, 2.0, "symplectic Euler", (1.0, 0.0)),
        Integrator("rk4", rk4, 4.0, 4, 2.0, "Runge–Kutta 4"),
        Integrator("gear5", gear5, 4.0, 1, 1.05, "Gear, 5 values"),
    )
}
"""All of them, by name."""

"""One step of each fixed-step integrator, as kernels.

The state is the overlap ξ of each pair and the velocity v of each body; ``overlap rate = v[c] - v[c+1]``. Every step
leaves in `raw` and `force` the (unclipped and clipped) contact force that belongs to the new state, which the next
step reuses: Verlet, Euler and Gear evaluate each force once a step, Runge-Kutta four times.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from granular._kernels import kernel

VERLET, EULER, RK4, GEAR5 = range(4)
METHODS = {"verlet": VERLET, "symplectic-euler": EULER, "rk4": RK4, "gear5": GEAR5}
EVALUATIONS = {VERLET: 1, EULER: 1, RK4: 4, GEAR5: 1}

Motion = namedtuple("Motion", "xi v acc raw force top jerk snap")
"""State: overlap (P,), velocity, acceleration (n,), forces, largest overlap of the running contact (P,; no values if no
law has memory), Gear's higher derivatives (n,)."""
Stages = namedtuple("Stages", "xi v rate acc raw force")
"""Work space of Runge-Kutta and of the predictors."""


@kernel
def contact_forces(force: Any, laws: Any, pairs: Any, xi: Any, v: Any, top: Any, raw: Any, out: Any) -> None:
    """Evaluate the unclipped force `raw` and the clipped force `out` of every pair: max(0, F) where ξ > 0, else 0."""
    for c in range(len(xi)):
        x = xi[c]
        if x > 0.0:
            f = force(laws[c], x, v[c] - v[c + 1], top[c] if c < len(top) and top[c] > x else x, pairs[c])
            raw[c] = f
            out[c] = f if f > 0.0 else 0.0
        else:
            raw[c] = 0.0
            out[c] = 0.0


@kernel
def accelerations(force: Any, inverse_mass: Any, fall: Any, acc: Any) -> None:
    """a_i = (F_{i-1} - F_i) / m_i - g; walls (1/m = 0, no fall) keep their speed."""
    below = 0.0
    last = len(inverse_mass) - 1
    for i in range(last):
        acc[i] = inverse_mass[i] * (below - force[i]) + fall[i]
        below = force[i]
    acc[last] = inverse_mass[last] * below + fall[last]


@kernel
def verlet(force: Any, laws: Any, pairs: Any, w: Any, fall: Any, dt: float, s: Any, work: Any) -> None:
    """Velocity Verlet; a rate-dependent force sees the predicted velocity v + a·dt."""
    xi, v, acc, guess = s.xi, s.v, s.acc, work.v
    for i in range(len(v)):
        guess[i] = v[i] + dt * acc[i]
        v[i] += 0.5 * dt * acc[i]
    for c in range(len(xi)):
        xi[c] += dt * (v[c] - v[c + 1])
    contact_forces(force, laws, pairs, xi, guess, s.top, s.raw, s.force)
    accelerations(s.force, w, fall, acc)
    for i in range(len(v)):
        v[i] += 0.5 * dt * acc[i]


@kernel
def symplectic_euler(force: Any, laws: Any, pairs: Any, w: Any, fall: Any, dt: float, s: Any, work: Any) -> None:
    """Symplectic (semi-implicit) Euler: kick with the old force, then drift with the new velocity."""
    xi, v, acc = s.xi, s.v, s.acc
    for i in range(len(v)):
        v[i] += dt * acc[i]
    for c in range(len(xi)):
        xi[c] += dt * (v[c] - v[c + 1])
    contact_forces(force, laws, pairs, xi, v, s.top, s.raw, s.force)
    accelerations(s.force, w, fall, acc)


@kernel
def rk4(force: Any, laws: Any, pairs: Any, w: Any, fall: Any, dt: float, s: Any, work: Any) -> None:
    """Classical Runge-Kutta of order 4."""
    xi, v, acc = s.xi, s.v, s.acc
    for c in range(len(xi)):
        work.rate[c] = v[c] - v[c + 1]
        work.xi[c] = xi[c]
    for i in range(len(v)):
        work.acc[i] = acc[i]
        work.v[i] = v[i]
    for stage in range(3):
        reach = dt if stage == 2 else 0.5 * dt
        weight = 1.0 if stage == 2 else 2.0
        # from here on work.xi, work.v hold the start of the step; xi, v the stage
        for c in range(len(xi)):
            xi[c] = work.xi[c] + reach * (v[c] - v[c + 1])
        for i in range(len(v)):
            v[i] = work.v[i] + reach * acc[i]
        contact_forces(force, laws, pairs, xi, v, s.top, work.raw, work.force)
        accelerations(work.force, w, fall, acc)
        for c in range(len(xi)):
            work.rate[c] += weight * (v[c] - v[c + 1])
        for i in range(len(v)):
            work.acc[i] += weight * acc[i]
    for c in range(len(xi)):
        xi[c] = work.xi[c] + dt / 6.0 * work.rate[c]
    for i in range(len(v)):
        v[i] = work.v[i] + dt / 6.0 * work.acc[i]
    contact_forces(force, laws, pairs, xi, v, s.top, s.raw, s.force)
    accelerations(s.force, w, fall, acc)


@kernel
def gear5(force: Any, laws: Any, pairs: Any, w: Any, fall: Any, dt: float, s: Any, work: Any) -> None:
    """Gear's five-value predictor-corrector for second-order equations, corrector 19/90, 3/4, 1, 1/2, 1/12.

    The values are ξ, v, a and the next two derivatives of v (`jerk`, `snap`).
    """
    xi, v, acc, jerk, snap = s.xi, s.v, s.acc, s.jerk, s.snap
    d2, d3, d4 = dt * dt / 2.0, dt * dt * dt / 6.0, dt * dt * dt * dt / 24.0
    for c in range(len(xi)):
        rate, pull = v[c] - v[c + 1], acc[c] - acc[c + 1]
        xi[c] += dt * rate + d2 * pull + d3 * (jerk[c] - jerk[c + 1]) + d4 * (snap[c] - snap[c + 1])
    for i in range(len(v)):
        v[i] += dt * acc[i] + d2 * jerk[i] + d3 * snap[i]
        work.acc[i] = acc[i] + dt * jerk[i] + d2 * snap[i]
        jerk[i] += dt * snap[i]
    contact_forces(force, laws, pairs, xi, v, s.top, s.raw, s.force)
    accelerations(s.force, w, fall, acc)
    for i in range(len(v)):
        miss = acc[i] - work.acc[i]
        work.acc[i] = miss
        v[i] += 0.375 * dt * miss
        jerk[i] += 1.5 / dt * miss
        snap[i] += 1.0 / (dt * dt) * miss
    for c in range(len(xi)):
        xi[c] += 19.0 / 180.0 * dt * dt * (work.acc[c] - work.acc[c + 1])


@kernel
def step(method: int, force: Any, laws: Any, pairs: Any, w: Any, fall: Any, dt: float, s: Any, work: Any) -> None:
    """Advance the state `s` by one step of the chosen method."""
    if method == 0:
        verlet(force, laws, pairs, w, fall, dt, s, work)
    elif method == 1:
        symplectic_euler(force, laws, pairs, w, fall, dt, s, work)
    elif method == 2:
        rk4(force, laws, pairs, w, fall, dt, s, work)
    else:
        gear5(force, laws, pairs, w, fall, dt, s, work)
    for c in range(len(s.top)):
        if s.xi[c] <= 0.0:
            s.top[c] = 0.0
        elif s.xi[c] > s.top[c]:
            s.top[c] = s.xi[c]

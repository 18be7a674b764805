"""Hard and soft frictionless spheres in a periodic box, also in shear flow.

Both programs are short and search all pairs, which is sufficient for about 500 spheres. Units are arbitrary. Positions
are not wrapped into the box of size L. In shear flow (Lees and Edwards), the image of a sphere in the next box in y is
displaced in x by the shear rate times L t, and is faster by the shear rate times L. Velocities
include the flow at the unwrapped position of a sphere.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

STEPS_PER_CONTACT = 80
"""Time steps of soft spheres per contact duration."""
RELAXATION_STEPS = 20_000
HARD_SKIN = 0.6
"""Maximum gap between neighbours in the neighbour list of hard spheres."""


@njit(cache=True)
def separation(x: Any, v: Any, i: int, j: int, box: float, shear: float, time: float) -> Any:
    """Position and velocity of the nearest image of sphere j relative to sphere i.

    Returns x, y, z, v_x, v_y, v_z.
    """
    r_x, r_y, r_z = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    layers = math.floor(r_y / box + 0.5)
    r_x -= layers * shear * box * time
    return (r_x - math.floor(r_x / box + 0.5) * box, r_y - layers * box, r_z - math.floor(r_z / box + 0.5) * box,
            v[j, 0] - v[i, 0] - layers * shear * box, v[j, 1] - v[i, 1], v[j, 2] - v[i, 2])


@njit(cache=True)
def meeting_time(x: Any, v: Any, radius: Any, i: int, j: int, box: float, shear: float, time: float) -> float:
    """Time until two hard spheres touch, or inf."""
    a, b, c, p, q, s = separation(x, v, i, j, box, shear, time)
    approach, squared = a * p + b * q + c * s, p * p + q * q + s * s
    excess = a * a + b * b + c * c - (radius[i] + radius[j]) ** 2
    if approach >= 0.0:
        return np.inf
    if excess <= 0.0:
        return 0.0
    root = approach * approach - squared * excess
    return excess / (-approach + math.sqrt(root)) if root >= 0.0 else np.inf


@njit(cache=True)
def neighbours(x: Any, v: Any, radius: Any, box: float, shear: float, time: float, skin: float) -> Any:
    """Pairs of spheres with gaps below `skin`."""
    n, count = len(radius), 0
    found = np.empty((100 * n, 2), np.int64)
    for i in range(n):
        for j in range(i + 1, n):
            a, b, c, _p, _q, _s = separation(x, v, i, j, box, shear, time)
            if a * a + b * b + c * c < (radius[i] + radius[j] + skin) ** 2:
                found[count] = i, j
                count += 1
    return found[:count].copy()


@njit(cache=True)
def predict(x: Any, v: Any, radius: Any, i: int, box: float, shear: float, time: float, near: Any, due: Any,
            partner: Any) -> None:
    """Find the next collision of sphere i, and update those of its neighbours."""
    due[i], partner[i] = np.inf, -1
    for k in range(1, near[i, 0] + 1):
        j = near[i, k]
        t = time + meeting_time(x, v, radius, i, j, box, shear, time)
        if t < due[i]:
            due[i], partner[i] = t, j
        if t < due[j]:
            due[j], partner[j] = t, i


@njit(cache=True)
def energy(x: Any, v: Any, mass: Any, shear: float) -> float:
    """Kinetic energy relative to the shear flow."""
    total = 0.0
    for i in range(len(mass)):
        total += 0.5 * mass[i] * ((v[i, 0] - shear * x[i, 1]) ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2)
    return total


@njit(cache=True)
def fastest(x: Any, v: Any, shear: float) -> float:
    """Largest speed relative to the shear flow."""
    largest = 0.0
    for i in range(len(x)):
        largest = max(largest, (v[i, 0] - shear * x[i, 1]) ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2)
    return math.sqrt(largest)


@njit(cache=True)
def hard(x: Any, v: Any, radius: Any, mass: Any, restitution: float, box: float, shear: float, start: float,
         end: float, most: int) -> Any:
    """Simulate hard spheres by events. Changes x and v.

    Returns the number of collisions, Σ J (R₁ + R₂), Σ J_x r_y, ∫ K dt of the kinetic energy K, and the final time. J is
    the impulse and r the vector between the centres. The run ends at `end` or after `most` collisions.
    """
    n, time, count, virial, stress, heat = len(radius), start, 0, 0.0, 0.0, 0.0
    due, partner, near = np.full(n, np.inf), np.full(n, -1), np.zeros((n, 200), np.int64)
    skin, refresh, limit = HARD_SKIN, start, 0.0
    while count < most:
        if time >= refresh:
            # only neighbours can touch before `refresh`, unless a sphere becomes faster than the limit
            limit = 1.3 * fastest(x, v, shear)
            refresh = time + skin / (2.0 * limit + shear * (2.0 * radius.max() + skin))
            near[:, 0], due[:] = 0, np.inf
            for a, b in neighbours(x, v, radius, box, shear, time, skin):
                near[a, 0] += 1
                near[b, 0] += 1
                near[a, near[a, 0]], near[b, near[b, 0]] = b, a
            for i in range(n):
                predict(x, v, radius, i, box, shear, time, near, due, partner)
        i = np.argmin(due)
        until = min(due[i], refresh, end)
        x += v * (until - time)
        heat += energy(x, v, mass, shear) * (until - time)
        time = until
        if time >= end:
            break
        if time >= refresh:
            continue
        j = partner[i]
        found = separation(x, v, i, j, box, shear, time)
        r, u = np.array(found[:3]), np.array(found[3:])
        r /= math.sqrt(np.dot(r, r))
        impulse = -(1.0 + restitution) * np.dot(r, u) * mass[i] * mass[j] / (mass[i] + mass[j])
        v[i] -= r * impulse / mass[i]
        v[j] += r * impulse / mass[j]
        count += 1
        virial += impulse * (radius[i] + radius[j])
        stress += impulse * (radius[i] + radius[j]) * r[0] * r[1]
        for k in range(n):
            if k in (i, j) or partner[k] in (i, j):
                due[k] = np.inf
        for k in range(n):
            if k in (i, j) or partner[k] in (i, j):
                predict(x, v, radius, k, box, shear, time, near, due, partner)
        for k in (i, j):
            if (v[k, 0] - shear * x[k, 1]) ** 2 + v[k, 1] ** 2 + v[k, 2] ** 2 > limit * limit:
                refresh = time
    return count, virial, stress, heat, time


@njit(cache=True)
def forces(x: Any, v: Any, radius: Any, mass: Any, stiffness: float, loss: float, box: float, shear: float,
           time: float, step: int, near: Any, since: Any, deepest: Any, log: Any, n_log: int) -> Any:
    """Accelerations, elastic energy, virial and shear stress of soft spheres.

    Forces are those of linear dashpots with the damping ratio `loss`. Contacts that have ended are
    appended to `log`: both spheres, first and last step, and largest overlap relative to R₁ + R₂.
    """
    a, elastic, virial, stress = np.zeros_like(x), 0.0, 0.0, 0.0
    for p in range(len(near)):
        i, j = near[p]
        b, c, d, p_x, p_y, p_z = separation(x, v, i, j, box, shear, time)
        squared, length = b * b + c * c + d * d, radius[i] + radius[j]
        if squared < length * length:
            size = math.sqrt(squared)
            xi, r, u = length - size, np.array((b, c, d)) / size, np.array((p_x, p_y, p_z))
            m = mass[i] * mass[j] / (mass[i] + mass[j])
            f = max(0.0, stiffness * xi - 2.0 * loss * math.sqrt(stiffness * m) * np.dot(r, u))
            a[i] -= r * f / mass[i]
            a[j] += r * f / mass[j]
            elastic += 0.5 * stiffness * xi * xi
            virial += f * size
            stress += f * size * r[0] * r[1]
            if since[i, j] < 0:
                since[i, j], deepest[i, j] = step, 0.0
            deepest[i, j] = max(deepest[i, j], xi / length)
        elif since[i, j] >= 0:
            log[n_log] = np.array((i, j, since[i, j], step, deepest[i, j]))
            n_log += 1
            since[i, j] = -1
    return a, elastic, virial, stress, n_log


@njit(cache=True)
def soft(x: Any, v: Any, radius: Any, mass: Any, stiffness: float, loss: float, box: float, shear: float, start: float,
         dt: float, steps: int) -> Any:
    """Simulate soft spheres by velocity Verlet. Changes x and v.

    Returns ∫ Σ F r dt, ∫ Σ F_x r_y dt, ∫ K dt of the kinetic energy K, the elastic energy at the end, and the log of
    contacts. Contacts that have not ended have an end of -1 in the log.
    """
    n, skin, virial, stress, heat, n_log = len(radius), 0.3 * radius.min(), 0.0, 0.0, 0.0, 0
    since, deepest, log = np.full((n, n), -1), np.zeros((n, n)), np.empty((2_000_000, 5))
    near, room, elastic = neighbours(x, v, radius, box, shear, start, skin), skin, 0.0
    a, elastic, w, s, n_log = forces(
        x, v, radius, mass, stiffness, loss, box, shear, start, 0, near, since, deepest, log, n_log)
    for step in range(1, steps + 1):
        time = start + step * dt
        v += 0.5 * dt * a
        x += dt * v
        room -= (2.0 * fastest(x, v, shear) + shear * (2.0 * radius.max() + skin)) * dt
        if room < 0.0:
            near, room = neighbours(x, v, radius, box, shear, time, skin), skin
        a, elastic, w, s, n_log = forces(
            x, v, radius, mass, stiffness, loss, box, shear, time, step, near, since, deepest, log, n_log)
        v += 0.5 * dt * a
        virial += w * dt
        stress += s * dt
        heat += energy(x, v, mass, shear) * dt
    for i in range(n):
        for j in range(n):
            if since[i, j] >= 0:
                log[n_log] = np.array((i, j, since[i, j], -1, deepest[i, j]))
                n_log += 1
    return virial, stress, heat, elastic, log[:n_log].copy()


@njit(cache=True)
def separate(x: Any, radius: Any, box: float, steps: int) -> float:
    """Move spheres apart until none overlap, and return the largest overlap."""
    deepest, zero = 1.0, np.zeros_like(x)
    for _ in range(steps):
        push, deepest = np.zeros_like(x), 0.0
        for i in range(len(radius)):
            for j in range(i + 1, len(radius)):
                a, b, c, _p, _q, _s = separation(x, zero, i, j, box, 0.0, 0.0)
                squared, length = a * a + b * b + c * c, radius[i] + radius[j]
                if squared < length * length:
                    size, r = math.sqrt(squared), np.array((a, b, c))
                    xi = length - size
                    deepest = max(deepest, xi)
                    push[i] -= 0.5 * r * (xi + 1e-3) / size
                    push[j] += 0.5 * r * (xi + 1e-3) / size
        if deepest == 0.0:
            break
        x += 0.8 * push
    return deepest


def start(n: int, packing: float, seed: int, small: float = 0.0, shear: float = 0.0) -> tuple[Any, ...]:
    """Random spheres in equilibrium with T = 1: x, v, radius, mass and box.

    Parameters
    ----------
    n, packing, seed
        Number of spheres, packing fraction, and seed.
    small : float
        Fraction of spheres with half the diameter. The others have diameter 1 and mass 1.
    shear : float
        Shear rate of the flow that is added to the velocities.
    """
    random = np.random.default_rng(seed)
    radius = np.where(np.arange(n) < small * n, 0.25, 0.5)
    mass, box = (2.0 * radius) ** 3, float((4.0 / 3.0 * math.pi * (radius**3).sum() / packing) ** (1.0 / 3.0))
    x = random.uniform(0.0, box, (n, 3))
    if separate(x, radius, box, RELAXATION_STEPS) > 0.0:
        raise ValueError("The spheres still overlap.")
    v = random.normal(0.0, 1.0, (n, 3)) / np.sqrt(mass)[:, None]
    thermalise(v, mass)
    hard(x, v, radius, mass, 1.0, box, 0.0, 0.0, np.inf, 10 * n)
    thermalise(v, mass)
    v[:, 0] += shear * x[:, 1]
    return x, v, radius, mass, box


def thermalise(v: Any, mass: Any) -> None:
    """Remove the total momentum, and scale velocities to T = 1."""
    v -= (mass[:, None] * v).sum(axis=0) / mass.sum()
    v *= math.sqrt(3.0 * len(mass) / (mass[:, None] * v**2).sum())


"""An independent twin of hard spheres on lines, rings and strings in 30 digits: positions, all pairs, the first hit.

It knows no gaps, no panels, no queue and no rest: a wall and a pendulum are their formulas, and a hit is stepped to
from below by the parabola of the largest acceleration there is. Thermal walls draw the numbers of the package.
"""

import math

import mpmath as mp

from granular.scene.walls import Sine, Thermal

STEPS = 20_000
"""Towards one hit of a moving wall or a pendulum, at most."""

class Wall:
    """x(t) = x0 + V (t - t0) + m(t) - m(t0), m(t) = A sin(2π f t + φ); no m for a wall at constant speed."""

    def __init__(self, scene, body, motion, t0):
        self.x0, self.v0, self.t0 = mp.mpf(scene.position[body]), mp.mpf(scene.velocity[body]), mp.mpf(t0)
        sine = isinstance(motion, Sine)
        self.a, self.phi = (mp.mpf(motion.amplitude), mp.mpf(motion.phase)) if sine else (mp.mpf(0), mp.mpf(0))
        self.omega = 2 * mp.pi * mp.mpf(motion.frequency) if sine else mp.mpf(0)
        self.most = self.a * self.omega**2

    def at(self, t):
        angle, begin = self.omega * t + self.phi, self.omega * self.t0 + self.phi
        x = self.x0 + self.v0 * (t - self.t0) + self.a * (mp.sin(angle) - mp.sin(begin))
        return x, self.v0 + self.a * self.omega * mp.cos(angle)


def closes(gap, rate, pull):
    """When a gap under constant acceleration closes, by the formula of the textbook."""
    if gap <= 0 and rate < 0:
        return mp.mpf(0)
    if pull == 0:
        return gap / -rate if rate < 0 else mp.inf
    square = rate * rate + 2 * pull * gap
    if square < 0:
        return mp.inf
    roots = [(rate + sign * mp.sqrt(square)) / pull for sign in (-1, 1)]
    return min((t for t in roots if t > mp.mpf(10) ** -24), default=mp.inf)


def events(scene, eps, t_end, most, t0=0.0):
    """Rows (time, pair, closing speed) of the first collisions, at most `most` of them."""
    n, t, omega = scene.n, mp.mpf(t0), mp.mpf(scene.pendulum)
    rest, hits = [mp.mpf(q) for q in scene.at_rest], [0] * scene.n_pairs
    around = sum(map(mp.mpf, scene.gap)) + 2 * sum(map(mp.mpf, scene.radius)) if scene.ring else mp.mpf(0)
    mass, radius = [mp.mpf(m) for m in scene.mass], [mp.mpf(r) for r in scene.radius]
    x, v = [mp.mpf(q) for q in scene.position], [mp.mpf(q) for q in scene.velocity]
    walls = {i: Wall(scene, i, motion, t0) for i, motion in ((0, scene.floor), (n - 1, scene.ceiling))
             if math.isinf(scene.mass[i])}
    for c in range(n - 1):  # positions of floats, when rounded, are not those of the gaps
        x[c + 1] = x[c] + mp.mpf(scene.gap[c]) + radius[c] + radius[c + 1]
        rest[c + 1] = rest[c] + radius[c] + radius[c + 1] + mp.mpf(0.0 if omega == 0 else scene.rest_gap[c])
    if n - 1 in walls:
        rest = [q + x[-1] - rest[-1] for q in rest]
    force = [0.0] * n if scene.external_force is None else scene.external_force
    fall = [mp.mpf(0) if mp.isinf(m) else mp.mpf(f) / m - mp.mpf(scene.gravity)
            for m, f in zip(mass, force, strict=True)]

    def state(i, s):
        if i in walls:
            return walls[i].at(t + s)
        if omega > 0:
            y, cos, sin = x[i] - rest[i], mp.cos(omega * s), mp.sin(omega * s)
            return rest[i] + y * cos + v[i] / omega * sin, v[i] * cos - y * omega * sin
        return x[i] + s * (v[i] + fall[i] * s / 2), v[i] + fall[i] * s

    def pair(c, s):
        (a, va), (b, vb) = state(c, s), state((c + 1) % n, s)
        return b - a - radius[c] - radius[(c + 1) % n] + (around if c + 1 == n else 0), vb - va

    def first(c, limit):
        driven = [walls[i].most for i in (c, c + 1) if i in walls]
        pull = sum(sign * fall[i % n] for i, sign in ((c, 1), (c + 1, -1)))
        gap, rate = pair(c, mp.mpf(0))
        if omega > 0:
            driven = [omega * mp.hypot(omega * (gap - mp.mpf(scene.rest_gap[c])), rate) + mp.mpf(10) ** -6]
            limit = min(limit, 7 / omega)
        if not any(driven):
            return closes(max(gap, mp.mpf(0)), rate, pull)
        s, bound = mp.mpf(0), pull + sum(driven)
        just = abs(gap) < mp.mpf(10) ** -22
        for _ in range(STEPS):
            if s >= limit:
                return mp.inf
            gap, rate = pair(c, s)
            if gap < mp.mpf(10) ** -26 and rate < 0 and not (just and s == 0 and rate > -mp.mpf(10) ** -22):
                return s
            gap = max(gap, mp.mpf(10) ** -30)
            square = rate * rate + 2 * bound * gap
            if square < 0 or (bound <= 0 and rate >= 0):
                return mp.inf
            root = mp.sqrt(square)
            s += (rate + root) / bound if rate > 0 else 2 * gap / (root - rate)  # neither is a difference
        raise RuntimeError(f"the twin comes to no hit of pair {c} in {STEPS} steps")

    rows = []
    while len(rows) < most:
        dt, c = min((first(c, mp.mpf(t_end) - t), c) for c in range(scene.n_pairs))
        if t + dt > t_end:
            break
        x, v = map(list, zip(*(state(i, dt) for i in range(n)), strict=True))
        t += dt
        up = (c + 1) % n
        w = v[up] - v[c]
        rows.append((t, c, -w))
        weights = [0 if mp.isinf(mass[i]) else 1 / mass[i] for i in (c, up)]
        heat = [(side, c + side) for side, end in ((0, 0), (1, n - 1)) if c + side == end]
        heat = [(side, body) for side, body in heat if isinstance((scene.floor, scene.ceiling)[side], Thermal)]
        for side, body in heat:
            wall, ball = (scene.floor, scene.ceiling)[side], 1 if side == 0 else n - 2
            v[ball] = v[body] + (1 - 2 * side) * mp.mpf(wall.drawn(side, hits[c], scene.mass[ball]))
        if not heat:
            jump = (1 + mp.mpf(eps)) * w / sum(weights)
            v[c] += jump * weights[0]
            v[up] -= jump * weights[1]
        hits[c] += 1
        if c + 1 == n:
            x[0] = x[c] + radius[c] + radius[0] - around
        elif up not in walls:
            x[up] = x[c] + radius[c] + radius[up]
        else:
            x[c] = x[up] - radius[c] - radius[up]
    return rows

"""Walls as kernels see them, and random ones: sines with balls of all sorts beside them, a spline."""

import math

import numpy as np
from scipy.interpolate import CubicSpline

from granular._engine.records import plain
from granular.scene.walls import Sine

G = 9.81
INF = math.inf


def records(wall, side=1.0, t_end=INF, **more):
    """Plain records of a wall."""
    one_wall, panels = wall.panels(more.get("t_start", 0.0), t_end).records(side, **more)
    return plain(one_wall)[0], plain(panels)


def scenes(n, seed):
    """Walls and balls of all sorts: (wall, side, t, tail, pull), the amplitude apart from gravity by up to 100."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        f, side = 10 ** rng.uniform(-1, 2), float(rng.choice([1.0, -1.0]))
        wall = Sine(10 ** rng.uniform(-4, 0), f, rng.uniform(-4, 4))
        g = wall.amplitude * wall.omega**2 / 10 ** rng.uniform(-0.5, 2) if rng.random() < 0.85 else 0.0
        t = float(rng.choice([0.0, rng.uniform(0, 100) / f, 1e6 / f]))
        yield rng, wall, side, t, float(rng.uniform(0, 3)) / f, side * g


def any_gap(rng, wall):
    sort = rng.integers(3)
    gap = [wall.amplitude * 10 ** rng.uniform(-8, 3), 0.0, wall.amplitude * 10 ** rng.uniform(-3, 3)][sort]
    rate = wall.amplitude * wall.omega * [rng.normal(), 10 ** rng.uniform(-6, 2), 0.0][sort]
    return float(gap), float(rate)


def spline(seed=5):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.05, 0.3, 30))
    return t, CubicSpline(t, rng.normal(size=30) * 0.01)

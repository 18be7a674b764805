"""Soft balls on rings, as pendula, between thermal walls: by scipy's DOP853 in positions, begun anew at every event.

Beside some events its steps collapse, on one machine and not on another: then it gives up.
"""

import math

import numpy as np
from condition import response

import granular as gr

MOST = 20_000
"""Evaluations of all forces; what it can do takes half of them."""
TOLERANCE = 5e-12
"""Of gaps in m and velocities in m/s, per unit of the scene's condition."""
OFTEN, FINER = (1e-13, 1e-14), (5e-14, 1e-14)
"""Relative and absolute tolerances of its steps; it is asked again where it says something else than the engine."""


class GivesUp(Exception):
    """The integrator stands still, needs more than its evaluations, or says two things at two tolerances."""


def counted(slope, most=None):
    """The slope of an equation of motion; the integrator gives up after `most` evaluations."""
    left = iter(range(MOST if most is None else most))

    def one(*args):
        if next(left, None) is None:
            raise GivesUp
        return slope(*args)

    return one


def beside(scene, laws, t_end):
    """Whether it can judge this scene; if so, the engine's gaps and velocities at `t_end` are found to be the same."""

    def last(other):
        run = gr.md.simulate(other, laws, t_end=t_end)
        return np.concatenate([run.gap[-1], run.velocity[-1]])

    allowed = TOLERANCE * (1.0 + response(last, scene).max())
    try:
        wanted = solved(scene, laws, t_end)
        off = abs(last(scene) - wanted).max()
        if off > allowed and abs(solved(scene, laws, t_end, FINER) - wanted).max() > allowed:
            raise GivesUp
    except GivesUp:
        return False
    assert off < allowed
    return True


def solved(scene, laws, t_end, tolerances=OFTEN):
    """Gaps and velocities at `t_end`, one array."""
    motion, t = Motion(scene, laws, tolerances), 0.0
    y = np.concatenate([np.zeros(scene.n), scene.velocity])
    while t < t_end:
        t, y = motion.to_next_event(t, y, t_end)
        for side in motion.hot:
            gap, closing = motion.pairs(y)
            if abs(gap[-side]) < 1e-12 and closing[-side] > 0.0:
                ball = -2 if side else 1
                away = scene.heat[side].drawn(side, motion.hits[side], float(scene.mass[ball]))
                motion.hits[side] += 1
                y[scene.n + ball % scene.n] = -away if side else away
    return np.concatenate([motion.pairs(y)[0], y[scene.n :]])


class Motion:
    def __init__(self, scene, laws, tolerances):
        self.rtol, self.atol = tolerances
        self.counted = counted(self.slope)
        self.scene, self.laws, self.hits, self.hung = scene, laws, [0, 0], scene.displacement
        self.hot = [side for side in range(2) if scene.heat[side] is not None]
        self.cold = np.ones(scene.n_pairs, bool)
        self.cold[[-side for side in self.hot]] = False

    def pairs(self, y):
        """Gaps, and the rates at which they close."""
        n = self.scene.n
        return self.scene.gap + self.scene.across(y[:n]), -self.scene.across(y[n:])

    def push(self, c, gap, closing):
        """What the law of a pair says, not clipped."""
        return self.laws[c].force(max(-gap[c], 0.0), closing[c], self.scene.pairs[c])

    def slope(self, t, y, acting):
        scene, (gap, closing) = self.scene, self.pairs(y)
        a = scene.fall - scene.pendulum**2 * (self.hung + y[: scene.n])
        for c in np.flatnonzero(acting):
            force = self.push(c, gap, closing)
            lower, upper = scene.bodies(c)
            a[lower] -= force * scene.inverse_mass[lower]
            a[upper] += force * scene.inverse_mass[upper]
        return np.concatenate([y[scene.n :], np.where(scene.is_wall, 0.0, a)])

    def to_next_event(self, t, y, t_end):
        """Go on to where a force begins or ends, a gap closes or opens."""
        from scipy.integrate import solve_ivp

        gap, closing = self.pairs(y + 1e-9 * self.slope(t, y, ()) * t_end)
        pushes = np.array([self.push(c, gap, closing) for c in range(len(gap))])
        acting, events = (gap < 0.0) & (pushes > 0.0) & self.cold, []
        for c in range(len(gap)):
            side = math.copysign(1.0, gap[c])
            events.append(lambda t, y, _, c=c, side=side: side * self.pairs(y)[0][c])
            if gap[c] < 0.0 and self.cold[c]:
                way = math.copysign(1.0, pushes[c])
                events.append(lambda t, y, _, c=c, way=way: way * self.push(c, *self.pairs(y)))
        for event in events:
            event.terminal, event.direction = True, -1
        out = solve_ivp(self.counted, (t, t_end), y, "DOP853", rtol=self.rtol, atol=self.atol, events=events,
                        args=(acting,))
        if out.status < 0:
            raise GivesUp
        return float(out.t[-1]), out.y[:, -1]


def drawn(seed, **more):
    """A random row of balls and laws."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    pairs = n - 1 + bool(more.get("ring"))
    scene = gr.Scene(np.exp(rng.uniform(-1.0, 1.0, n)), np.full(n, 0.1), rng.uniform(0.0, 0.1, pairs),
                     rng.normal(size=n), **more)
    kinds = [gr.LinearDashpot(2e3, 8.0), gr.Hertz(2e4), gr.LinearDashpot(1e3), gr.ViscoelasticHertz(2e4, 60.0)]
    return scene, [kinds[int(i)] for i in rng.integers(4, size=pairs)]

"""Newton's equation in overlaps and their rates, for a general-purpose solver such as those of scipy."""

from __future__ import annotations

import numpy as np

from granular._check import Array
from granular.laws.kinds import SceneLaws
from granular.scene import Scene, speed_scale, velocities


class Newton:
    """The right-hand side d(ξ, ξ̇)/dt of all pairs, as a user of a solver would write it.

    Parameters
    ----------
    scene : Scene
        Where it starts.
    laws : SceneLaws
        One per pair.
    most : int
        Number of evaluations after which `TooMuchWork` is raised.

    Attributes
    ----------
    evaluations : int
        So far; each costs one force per closed pair.
    deepest : list of float
        Largest overlap in m of the current contact, for laws with memory.
    """

    def __init__(self, scene: Scene, laws: SceneLaws, most: int = 2_000_000) -> None:
        self.scene, self.laws, self.pairs = scene, laws, scene.n_pairs
        self.each, self.neighbours = list(laws), np.transpose(scene.neighbours).tolist()
        self.w: list[float] = scene.inverse_mass.tolist()
        self.pull: list[float] = scene.pull.tolist()
        self.deepest = np.maximum(-scene.gap, 0.0).tolist()
        self.evaluations, self.most = 0, most

    def start(self) -> Array:
        """The state at the start: overlaps in m (negative: gaps), rates in m/s."""
        return np.concatenate([-self.scene.gap, -self.scene.across(self.scene.velocity)])

    def scales(self) -> Array:
        """What overlaps and rates are about, in m and m/s: those of an impact at the scene's largest speed."""
        speed = speed_scale(self.scene) or 1.0
        depth = self.laws.column(lambda law: law.overlap_at(speed))
        return np.concatenate([depth, np.full(self.pairs, speed)])

    def bracket(self, c: int, xi: float, eta: float) -> float:
        """Force of pair c in N before it is clipped."""
        xi = max(xi, 0.0)
        return self.each[c].force(xi, eta, max(self.deepest[c], xi))

    def force(self, c: int, xi: float, eta: float) -> float:
        """Force of pair c in N, clipped."""
        return max(0.0, self.bracket(c, xi, eta)) if xi > 0.0 else 0.0

    def __call__(self, t: float, y: Array) -> Array:
        """The rates of change of the state `y`."""
        self.evaluations += 1
        if self.evaluations > self.most:
            raise TooMuchWork
        n, w = self.pairs, self.w
        state = y.tolist()
        force = [self.force(c, state[c], state[n + c]) for c in range(n)]
        out = state[n:] + self.pull
        for c, f in enumerate(force):
            lower, upper = self.scene.bodies(c)
            out[n + c] -= (w[lower] + w[upper]) * f
        for below, above in self.neighbours:
            shared = w[self.scene.bodies(below)[1]]
            out[n + above] += shared * force[below]
            out[n + below] += shared * force[above]
        return np.array(out)

    def velocities(self, y: Array, t: float) -> Array:
        """Velocities of the bodies in m/s at time `t` after the start, from a wall's or the mass centre's."""
        return np.asarray(velocities(self.scene, -y[None, self.pairs :], np.array([t]))[0])


class TooMuchWork(RuntimeError):
    """A solver was stopped because it needed too many evaluations."""

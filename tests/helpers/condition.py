"""How much the results of a scene answer to its inputs, measured where a test runs: what its tolerance is judged by."""

import numpy as np

STEP = 2.0**-48
"""Sixteen units in the last place: beyond rounding, and more than `noise` takes back."""


def nudged(scene, rng):
    """The scene, its masses, open gaps and velocities moved by ± `STEP` of themselves; equal ones alike."""

    def moved(x, given):
        sizes, which = np.unique(abs(x), return_inverse=True)
        way = rng.choice([-STEP, STEP], len(sizes))[which.reshape(np.shape(x))]
        return x + np.where(given, x, 0.0) * way

    return scene.replace(mass=np.where(scene.is_wall, np.inf, moved(np.where(scene.is_wall, 1.0, scene.mass), True)),
                         gap=moved(scene.gap, scene.gap > 0.0), velocity=moved(scene.velocity, True))


def response(results, scene, copies=3):
    """How far `results(scene)`, an array, goes per unit relative change of the inputs, at most, entry by entry."""
    rng, here = np.random.default_rng(0), np.asarray(results(scene))
    others = [np.asarray(results(nudged(scene, rng))) for _ in range(copies)]
    assert all(other.shape == here.shape for other in others), "ill-conditioned: the last digits decide what happens"
    return np.max([np.abs(other - here) for other in others], axis=0) / STEP

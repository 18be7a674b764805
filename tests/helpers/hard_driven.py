"""Hard spheres beside driven walls: scenes, runs by the reference queue, and what their account leaves over."""

import math

import numpy as np

import granular as gr
from granular.scene.walls import Sine

INF = math.inf


def run(scene, eps=0.9, **options):
    """A run with one coefficient of restitution, by the reference queue."""
    return gr.edmd.simulate(scene, gr.ConstantRestitution(eps), **{"engine": "sorted"} | options)


def plate(balls, motion, gravity=1.0, gap=0.5, velocity=0.0, mass=1.0, **more):
    """Balls above a moving floor."""
    return gr.Scene([INF] + [mass] * balls, [0.0] + [0.1] * balls, [gap] * balls, [0.0] + [velocity] * balls, gravity,
                    floor=motion, **more)


def shaken(gamma, omega=1.0, gravity=1.0, phase=0.0):
    """A sine of so many g."""
    return Sine.from_acceleration(gamma, omega / (2.0 * math.pi), gravity, phase)


def remainder(result):
    """What the account leaves over, at most, in units of the energy that came and went."""
    account = result.account()
    rest = account["energy"] - account["work"].sum(axis=1) + account["dissipated"]
    return np.abs(rest - rest[0]).max() / (np.abs(account["work"]).max() + np.abs(account["energy"]).max())


def drawn(seed, touching=0.0):
    """One to five balls between walls of which one or two shake, under gravity and forces."""
    rng = np.random.default_rng(seed)
    n, (floor, ceiling) = int(rng.integers(1, 6)), [(1, 0), (0, 1), (1, 1)][int(rng.integers(3))]
    bodies, pairs = n + floor + ceiling, n + floor + ceiling - 1

    def sine():
        return Sine(float(10 ** rng.uniform(-3, -0.7)), float(10 ** rng.uniform(-0.5, 1)), float(rng.uniform(0, 6.28)))

    ball = np.r_[[0.0] * floor, [1.0] * n, [0.0] * ceiling]
    mass = np.where(ball > 0.0, np.exp(rng.normal(size=bodies)), INF)
    gap = rng.uniform(0.5, 1.0, pairs) * (rng.random(pairs) >= touching)
    force = rng.normal(size=bodies) * 3.0 * ball if rng.random() < 0.4 else None
    return gr.Scene(mass, 0.05 * ball, gap, rng.normal(size=bodies) * ball, float(rng.choice([0.0, 1.0, 9.81])),
                    float(rng.normal()), external_force=force, floor=sine() if floor else None,
                    ceiling=sine() if ceiling and (not floor or rng.random() < 0.5) else None)

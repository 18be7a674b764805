"""Random scenes with forces and driven walls, a ball on a shaken floor, and its closed form while it rides."""

import math

import mpmath
import numpy as np

import granular as gr

MP = mpmath.MPContext()
MP.dps = 45
ONE_RADIAN = 1.0 / (2.0 * math.pi)


def shaken(gamma, restitution, ratio, *, phase=0.0, gap=0.0, velocity=0.0):
    """A ball of 1 kg on a soft floor shaken at 1 rad/s under g = 1: the scene, its law."""
    floor = gr.walls.Sine.from_acceleration(gamma, ONE_RADIAN, gravity=1.0, phase=phase)
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [gap], [0.0, velocity], gravity=1.0, floor=floor)
    return scene, gr.LinearDashpot.from_restitution(restitution, ratio**2, scene.pairs[0])


def steady(gamma, restitution, ratio):
    """A ball that rides steadily from the start."""
    scene, law = shaken(gamma, restitution, ratio)
    omega, square, damping = scene.floor.omega, law.k, law.gamma
    sway = -scene.floor.amplitude * omega**2 / (square - omega**2 + 1j * damping * omega)
    velocity = scene.floor.velocity(0.0) - (1j * omega * sway).imag
    return scene.replace(gap=[-(1.0 / square + sway.imag)], velocity=[0.0, velocity]), law


def riding(scene, law, t):
    """Overlap and rate at time t of a ball that rides for good, in closed form."""
    floor, mp = scene.floor, MP
    omega, phase, m = 2 * mp.pi * floor.frequency, mp.mpf(floor.phase), mp.mpf(scene.mass[1])
    square, damping = law.k / m, mp.mpf(law.gamma) / m
    sway = -floor.amplitude * omega**2 / (square - omega**2 + 1j * damping * omega)
    push = scene.gravity - mp.mpf(0.0 if scene.external_force is None else scene.external_force[1]) / m

    def steady(t):
        turn = sway * mp.expj(omega * t + phase)
        return push / square + turn.imag, (1j * omega * turn).imag

    xi, eta = -mp.mpf(scene.gap[0]), floor.amplitude * omega * mp.cos(phase) - mp.mpf(scene.velocity[1])
    a, rate = xi - steady(mp.zero)[0], eta - steady(mp.zero)[1]
    fall, swing = damping / 2, mp.sqrt(square - damping**2 / 4)
    b = (rate + fall * a) / swing
    c, s, e = mp.cos(swing * t), mp.sin(swing * t), mp.exp(-fall * t)
    free = e * (a * c + b * s), e * (swing * (b * c - a * s) - fall * (a * c + b * s))
    return [x + y for x, y in zip(steady(t), free, strict=True)]


def scenes(seed):
    """A random scene with forces, one or two driven walls, and laws."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 6))
    mass = np.exp(rng.uniform(-1.0, 1.0, n))
    mass[0], both = math.inf, rng.random() < 0.5
    mass[-1] = math.inf if both else mass[-1]
    breaks = np.linspace(0.0, 1.0, 6)
    heights = rng.uniform(-0.05, 0.05, 6)
    sine = gr.walls.Sine(rng.uniform(0.01, 0.05), rng.uniform(1.0, 4.0), rng.uniform(0.0, 6.0))
    corners = gr.walls.Piecewise(breaks, [np.diff(heights) / np.diff(breaks), heights[:-1]])
    smooth = gr.walls.Motion(lambda t: 0.03 * math.exp(-t) * math.sin(9.0 * t), 1e-13)
    floor, ceiling = ([sine, corners, smooth][i] for i in rng.permutation(3)[:2])
    force = np.where(np.isinf(mass), 0.0, rng.uniform(-2.0, 2.0, n))
    scene = gr.Scene(mass, np.where(np.isinf(mass), 0.0, 0.01), rng.uniform(0.01, 0.08, n - 1),
                     np.where(np.isinf(mass), 0.1, rng.normal(size=n)), gravity=float(rng.choice([0.0, 3.0])),
                     external_force=force, floor=floor, ceiling=ceiling if both else None)
    laws = [gr.LinearDashpot(3e3, 10.0), gr.ViscoelasticHertz(3e4, 100.0), gr.Hertz(3e4)]
    return scene, [laws[int(i)] for i in rng.integers(3, size=n - 1)]

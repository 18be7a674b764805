"""Crossing waves and a light intruder: what only duration makes

Forty equal beads touch. If both ends are struck at once, two waves meet in the middle: do they leave as they came? If
only one is, and a light bead sits in the middle, how much comes back?

:Published: Two waves that cross leave small *secondary waves* behind, larger if they meet at a contact, in a chain with
    an even number of beads (Santibáñez, Muñoz, Caussarieu, Job & Melo, Phys. Rev. E 84, 026604 (2011)). A light intruder
    oscillates, and gaps open beside it (Job, Santibáñez, Tapia & Melo, Phys. Rev. E 80, 025602 (2009)).
:Hard spheres: HARD
:Newton: NEWTON
:New: NEW
:Read: The abstract of the paper of 2011, and the beginning of its text; that of 2009 is quoted from memory.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

SPRING, RADIUS = gr.Hertz(k=1e9), 0.05
BLUE, RED, SAND = "#1f4e79", "#c1440e", "#c8963e"


def waves(n, engine=gr.md, until=gr.until.separated(), **asked):
    """A run of n beads that are struck at both ends."""
    gap = 0.0 if engine is gr.md else 1e-6
    scene = gr.Scene([1.0] * n, [RADIUS] * n, [gap] * (n - 1), [1.0, *[0.0] * (n - 2), -1.0])
    law = SPRING if engine is gr.md else gr.ConstantRestitution(1.0)
    return engine.simulate(scene, law, until=until, **asked)


def force(n, samples=4001, end=0.02):
    """Times, and the force between beads a quarter of the way along the chain."""
    run = waves(n, until=None, t_end=end, samples=samples)
    overlap = 2.0 * RADIUS - (run.position[:, n // 4 + 1] - run.position[:, n // 4])
    return run.time, SPRING.k * np.maximum(overlap, 0.0) ** 1.5


def secondary(n):
    """Peak of the secondary wave, of the force of the first one."""
    _, push = force(n)
    peaks = push[1:-1][(push[1:-1] > push[:-2]) & (push[1:-1] >= push[2:])]
    return peaks[2] / peaks[0]


def intruder(mu, engine=gr.md, n=40):
    """Energy sent back by a bead of mass mu amid n equal ones, and its contacts with the beads before and after it."""
    mass = np.where(np.arange(n) == n // 2, mu, 1.0)
    gap = 0.0 if engine is gr.md else 1e-6
    scene = gr.Scene(mass, RADIUS * np.cbrt(mass), [gap] * (n - 1), [1.0] + [0.0] * (n - 1))
    law = SPRING if engine is gr.md else gr.ConstantRestitution(1.0)
    run = engine.simulate(scene, law, until=gr.until.separated())
    back = np.sum(run.velocity[-1, : n // 2] ** 2)
    return back, run.count(n // 2 - 1), run.count(n // 2)

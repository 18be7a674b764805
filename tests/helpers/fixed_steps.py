"""Fixed-step methods and the pair on which their errors are measured."""

from functools import partial

import granular as gr
from granular.md.fixed.integrators import INTEGRATORS

ALL = tuple(INTEGRATORS)
verlet = partial(gr.md.simulate, method="verlet")


def pair_scene(gap=0.0, speed=1.0):
    """Two free balls with m_eff = 1 that close at `speed`."""
    return gr.Scene([2.0, 2.0], [0.5, 0.5], [gap], [speed, 0.0])


def restitution(run):
    return (run.velocity[-1][1] - run.velocity[-1][0]) / (run.velocity[0][0] - run.velocity[0][1])

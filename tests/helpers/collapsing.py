"""Columns that collapse, and their runs."""

import math

import numpy as np

from granular import edmd
from granular.laws.rules import ConstantRestitution
from granular.scene import Scene


def column(n, seed=1):
    gap = np.random.default_rng(seed).uniform(0.5, 1.5, n)
    return Scene([math.inf] + [1.0] * n, [0.0] * (n + 1), gap, [0.0] * (n + 1), gravity=1.0)


def run(scene, eps, **options):
    return edmd.simulate(scene, ConstantRestitution(eps), **options)

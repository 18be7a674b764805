"""A scene with a driven wall, as objects and as the text of a file."""

import math

import granular as gr
from granular.laws import LinearDashpot

INF = math.inf
LAW = LinearDashpot(1e4, 1.0)
RULE = gr.ConstantRestitution(0.8)
TEXT = """
[scene]
mass = [inf, 1.0, 2.0]
radius = [0.0, 0.1, 0.1]
gap = [0.1, 0.2]
velocity = [0.0, -1.0, 0.0]
gravity = 9.81
{}

[law]
type = "LinearDashpot"
k = 1e4
gamma = 1.0

[run]
t_end = 1.0
"""


def shake(t):
    return 1e-3 * math.sin(40.0 * t)


def scene(**more):
    return gr.Scene([INF, 1.0, 2.0], [0.0, 0.1, 0.1], [0.1, 0.2], [0.0, -1.0, 0.0], 9.81, **more)

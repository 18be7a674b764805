"""Newton's cradle in physics engines: five touching balls

Five equal balls touch, and the first one moves. Game and robotics engines give four different results for elastic
balls. None of them is the result of Newton's equation with a contact force.

:Published: Many reports of users: a cradle that moves as one block, or whose first ball bounces back (box2d issue 76,
    rapier issue 630). Simultaneous collisions have no unique result for rigid bodies (Glocker & Pfeiffer, Nonlinear
    Dyn. 7, 471 (1995)). The engines were run by the scripts in examples/peers; their results are stored here.
:Hard spheres: `ties="left"` gives (0, 0, 0, 0, 1), "newton" and "poisson" (-0.6, 0.4, 0.4, 0.4, 0.4), in units of the
    speed of the first ball.
:Soft spheres: (-0.132, -0.075, -0.031, 0.296, 0.942) with linear springs and (-0.071, -0.030, -0.014, 0.127, 0.989)
    with Hertz's law, at any speed and stiffness. Both conserve momentum and energy.
:New: pymunk 7.3 gives (-0.333, 0, 0, 0.667, 0.667) for a radius of 0.05 m and (0, 0, 0, 0, 1) for a radius of 1 m,
    because rounding of the positions decides which balls touch. Box2D 2.3 at 3 m/s and MuJoCo 4.0 with springs without
    damping give the result of one simultaneous collision. Box2D at 0.5 m/s gives 0.2 for every ball, because its
    contacts have no restitution below 1 m/s.
:Read: The documentation of the engines. The paper is quoted from memory.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

BALLS = 5
ENGINES = {
    "pymunk 7.3.1, R = 5 cm": (-0.3333, 0.0, 0.0, 0.6667, 0.6667),
    "pymunk 7.3.1, R = 1 m": (0.0, 0.0, 0.0, 0.0, 1.0),
    "Box2D 2.3.10, 3 m/s": (-0.5885, 0.3964, 0.3964, 0.3971, 0.3986),
    "Box2D 2.3.10, 0.5 m/s": (0.1944, 0.1944, 0.1974, 0.2033, 0.2106),
    "MuJoCo 4.0.0, springs": (-0.6001, 0.3998, 0.4, 0.4001, 0.4002),
}
"""Final velocities over the initial speed, by the scripts in examples/peers."""


def row(speed=1.0):
    """Five touching balls of 1 kg, the first of which moves."""
    return gr.Scene([1.0] * BALLS, [0.05] * BALLS, [0.0] * (BALLS - 1), [speed] + [0.0] * (BALLS - 1))


def hard_speeds(ties):
    """Final velocities of hard spheres in units of the initial speed."""
    return gr.edmd.simulate(row(), gr.ConstantRestitution(1.0), ties=ties).velocity[-1]


def soft_speeds(law, speed=1.0):
    """Final velocities of soft spheres, in units of the initial speed."""
    return gr.md.simulate(row(speed), law, until=gr.until.separated()).velocity[-1] / speed


if __name__ == "__main__":
    models = {"hard, left": hard_speeds("left"), "hard, poisson": hard_speeds("poisson"),
              "soft, linear": soft_speeds(gr.LinearDashpot(1e6)), "soft, Hertz": soft_speeds(gr.Hertz(1e9))}
    for name, values in (ENGINES | models).items():
        print(f"{name:24}", " ".join(f"{value:7.3f}" for value in values))
    plt.style.use("granular.journal")
    figure, axis = plt.subplots(figsize=(6, 3), layout="constrained")
    ball = np.arange(1, BALLS + 1)
    colours = {"hard": "#c1440e", "soft": "#1f4e79"}
    for marker, (name, values) in zip("osD^v", ENGINES.items(), strict=True):
        axis.plot(ball, values, marker, color="#777777", markersize=5, fillstyle="none", label=name)
    for name, values in models.items():
        style = "-" if name in ("hard, left", "soft, Hertz") else "--"
        axis.plot(ball, values, style, color=colours[name[:4]], label=name)
    axis.set(xlabel="ball", ylabel="final velocity / initial speed of ball 1", xticks=ball)
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig("engines.png")

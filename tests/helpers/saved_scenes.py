"""Small runs of every kind that a file can hold, cut in two: what a file has to bring back.

``python tests/helpers/saved_scenes.py FOLDER`` writes those of the version that is imported.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import granular as gr


@dataclass(frozen=True)
class Own:
    """A law of one's own."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi ** 1.7 * (1.0 + 0.1 * xi_dot)


@dataclass(frozen=True)
class OwnRule:
    """A rule of one's own."""

    eps: float

    def __call__(self, speed, pair):
        return self.eps / (1.0 + 0.1 * speed)


INF = math.inf
FLOOR = gr.Scene([INF, 1.0, 2.0], [0.0, 0.05, 0.05], [0.1, 0.2], [0.0, 0.5, -1.0], gravity=9.81)
LINE = gr.Scene([1.0, 2.0, 0.5], [0.05] * 3, [0.01, 0.02], [2.0, 0.0, -1.0])
RING = gr.Scene([1.0, 2.0, 0.5], [0.05] * 3, [0.02, 0.03, 0.01], [2.0, 0.0, -1.0], ring=True)
HUNG = gr.Scene([1.0, 2.0, 0.5], [0.05] * 3, [0.02, 0.03], [1.0, 0.0, -0.5], pendulum=4.0)
BOX = gr.Scene([INF, 1.0, 2.0, INF], [0.0, 0.05, 0.05, 0.0], [0.1, 0.2, 0.1], [0.0, 1.0, -1.0, 0.0])
PILE = gr.Scene([INF, 1.0, 1.0], [0.0, 0.05, 0.05], [-1e-5, -1e-5], [0.0] * 3, gravity=9.81)
CAGE = gr.Scene([INF, 1.0, INF], [0.0, 0.05, 0.0], [0.1, 0.1], [0.0, 1.0, 0.0], gravity=0.1)
HOT, COLD = gr.walls.Thermal(1.0, seed=3), gr.walls.Thermal(0.3, seed=5)
SINE = gr.walls.Sine(1e-3, 30.0, 0.5)
SLOW = gr.walls.Sine(1e-3, 5.0, 1.57)
SPLINE = gr.walls.Piecewise([0.0, 0.2, 5.0], [[0.05, 0.0], [0.0, 0.01], [0.0, 0.002]])
MOTION = gr.walls.Motion(lambda t: 1e-3 * math.sin(40.0 * t) * t)
FIRM, LOOSE = gr.LinearDashpot(1e5, 300.0), gr.LinearDashpot(1e4, 3.0)

HARD = {
    "floor": (FLOOR, gr.ConstantRestitution([0.9, 0.8]), 0.4, 0.9, {}),
    "closer-look": (gr.scenes.three_balls(), gr.ConstantRestitution(0.1), None, None, {"max_events": 9}),
    "table": (BOX, gr.TabulatedRestitution([0.1, 1.0, 3.0], [0.9, 0.8, 0.7]), 0.7, 2.0, {}),
    "thornton": (BOX, gr.ThorntonRestitution(0.2), 0.7, 2.0, {}),
    "of-law": (BOX, gr.restitution_of([gr.ViscoelasticHertz(1e6, 3e3)] * 3), 0.7, 2.0, {}),
    "own-rule": (BOX, OwnRule(0.9), 0.7, 2.0, {}),
    "sine": (FLOOR.replace(floor=SINE), gr.ConstantRestitution(0.9), 0.4, 0.9, {"collapse": "merge"}),
    "piecewise": (FLOOR.replace(floor=SPLINE), gr.ConstantRestitution(0.9), 0.4, 0.9, {}),
    "thermal": (BOX.replace(floor=HOT, ceiling=COLD), gr.ConstantRestitution(0.9), 0.7, 2.0, {"ties": "random"}),
    "ring": (RING, gr.ConstantRestitution(0.9), 0.1, 0.4, {"tc": 1e-6}),
    "pendula": (HUNG, gr.ConstantRestitution(0.9), 0.3, 1.0, {}),
    "forces": (BOX.replace(external_force=[0.0, 1.0, -2.0, 0.0]), gr.ConstantRestitution(0.9), 0.7, 2.0, {}),
}
SOFT = {
    "contact": (FLOOR, [FIRM, LOOSE], 0.151, 0.5, {}),
    "hertz": (LINE, gr.Hertz(1e6), 0.02, 0.05, {}),
    "viscoelastic": (FLOOR, gr.ViscoelasticHertz(1e6, 3e3), 0.151, 0.3, {"t_start": 0.05}),
    "tsuji": (LINE, gr.TsujiHertz(1e6, 0.2), 0.005, 0.03, {}),
    "power": (LINE, gr.PowerLaw(1e6, 1.8), 0.005, 0.03, {}),
    "walton-braun": (LINE, gr.WaltonBraun(1e5, 2e5), 0.006, 0.03, {}),
    "own-law": (LINE, Own(1e6), 0.005, 0.03, {}),
    "creeping": (gr.scenes.column(4, gravity=9.81), gr.LinearDashpot(1e5, 3e4), 2.0, 3.0, {}),
    "riding": (PILE.replace(floor=SLOW), FIRM, 1.0, 1.3, {}),
    "motion": (FLOOR.replace(floor=MOTION), gr.Hertz(1e6), 0.3, 0.3, {}),
    "thermal": (BOX.replace(floor=HOT, ceiling=COLD), gr.Hertz(1e6), 0.3, 0.6, {}),
    "ring": (RING, gr.Hertz(1e6), 0.005, 0.03, {}),
    "pendula": (HUNG, LOOSE, 0.03, 0.2, {}),
    "tables": (CAGE, gr.Hertz(1e6), 20.0, 20.4, {}),
    "matched": (gr.Scene([1.0, 1.0, INF], [0.05, 0.05, 0.0], [0.0, -1e-4], [0.2, 0.0, 0.0]),
                [gr.Hertz(1e6), gr.MatchedEnd(1.0, 1e4)], 0.005, 0.02, {}),
}
ALL = [("hard", name) for name in HARD] + [("soft", name) for name in SOFT]


def of(kind, name):
    """Engine, scene, physics, the times of the cut and of the end, options."""
    return (gr.edmd, *HARD[name]) if kind == "hard" else (gr.md, *SOFT[name])


def cut(kind, name, **more):
    """The first part of the run."""
    engine, scene, physics, end, _, options = of(kind, name)
    return engine.simulate(scene, physics, t_end=end, **options, **more)


def whole(kind, name, **more):
    """The run in one."""
    engine, scene, physics, _, end, options = of(kind, name)
    options = {key: value for key, value in options.items() if key != "max_events"} | more
    return engine.simulate(scene, physics, t_end=end, **options)


def given(kind, name):
    """What a file cannot bring back, for `Trajectory.load`."""
    physics = of(kind, name)[2]
    return {"law" if kind == "soft" else "rule": physics} if isinstance(physics, (Own, OwnRule)) else {}


if __name__ == "__main__":
    for kind, name in ALL:
        cut(kind, name).save(Path(sys.argv[1]) / f"run_{kind}_{name}.npz")

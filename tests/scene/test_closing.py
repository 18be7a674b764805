"""Walls that meet: one certified look for all engines, against dense samples of where the walls are."""

import math

import numpy as np
import pytest

import granular as gr
from bench import reference
from granular.scene.places import CLOSING_MARGIN, WallMeeting, with_fitted_walls

LAW = gr.LinearDashpot(1e4, 1.0)
POINTS, BALLS = [0.0, 0.0, 0.0], [0.0, 0.01, 0.0]
SINE = gr.walls.Sine(0.3, 1.0)
SAW = gr.walls.Piecewise([0.0, 1.0, 2.0, 3.0], [[0.0, 0.5, -0.5], [0.0, 0.0, 0.5]])
FAR = gr.walls.Motion(lambda t: 0.2 * t * t * math.exp(-t))


def box(radius, **walls):
    return gr.Scene([math.inf, 1.0, math.inf], radius, [0.05, 0.05], walls.pop("velocity", [0.0] * 3), **walls)


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("scene", "t_end", "soft", "hard"),
    [
        (box(POINTS, floor=SINE), 0.25, math.asin(1 / 3) / math.tau, math.asin(1 / 3) / math.tau),
        (box(BALLS, floor=SINE), 0.5, math.asin(0.4) / math.tau, math.asin(1 / 3) / math.tau),
        (box(POINTS, floor=SAW), 2.95, 1.2, 1.2),
        (box(POINTS, velocity=[0.2, 0.0, 0.0]), 0.9, 0.5, 0.5),
    ],
)
def test_every_engine_says_the_same(scene, t_end, soft, hard):
    """Points too; and where the walls are apart again at the end."""
    said = set()
    for run in (
        lambda: gr.md.simulate(scene, LAW, t_end=t_end),
        lambda: gr.md.simulate(scene, LAW, t_end=t_end, samples=7),
        lambda: gr.md.simulate(scene, LAW, t_end=t_end, method="verlet", dt=1e-4, engine="plain"),
        lambda: reference.solve(scene, LAW, t_end=t_end, digits=20),
    ):
        with pytest.raises(ValueError, match="the walls meet at t = ") as error:
            run()
        said.add(str(error.value))
    assert len(said) == 1
    assert float(said.pop().split("t = ")[1].split()[0]) == pytest.approx(soft, rel=1e-8)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), t_end=t_end, collapse="merge")
    assert run.status is gr.Status.collapse
    assert run.time[-1] == pytest.approx(hard, rel=1e-8)


def test_points_that_stand_beyond_each_other_from_the_start_are_a_compressed_chain():
    scene = gr.Scene([math.inf, 1.0, math.inf], POINTS, [-0.01, -0.01], [0.0] * 3, floor=gr.walls.Sine(1e-3, 5.0))
    assert gr.md.simulate(scene, LAW, t_end=0.3).status is gr.Status.time


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(60))
def test_the_look_is_certified(seed):
    """Never later than a sample shows the walls beyond each other, and never while they are apart."""
    rng = np.random.default_rng(seed)
    heights = rng.uniform(-0.1, 0.1, 9)
    corners = gr.walls.Piecewise(np.linspace(1.0, 9.0, 9), [np.diff(heights), heights[:-1]])
    kinds = [gr.walls.Sine(rng.uniform(0.01, 0.1), rng.uniform(0.1, 3.0), rng.uniform(0.0, 6.0)), corners, FAR, None]
    floor, ceiling = (kinds[i] for i in rng.permutation(4)[:2])
    start = rng.uniform(1.0, 3.0)
    scene = box(POINTS, floor=floor, ceiling=ceiling, velocity=[rng.uniform(-0.02, 0.02), 0.0, 0.0])

    def apart(t):
        up, down = (0.0 if m is None else m.displacement(t) - m.displacement(start) for m in (floor, ceiling))
        return 0.1 - scene.velocity[0] * (t - start) - up + down

    look = WallMeeting(with_fitted_walls(scene, start, 8.0), start, flattened=True)
    for until in np.linspace(start, 8.0, 5):  # as far as it is asked for
        look.search_until(until)
    met = look.start + look.after
    assert all(apart(t) >= 0.0 for t in np.linspace(start, 8.0, 2001) if t < met)
    if met < math.inf:
        assert abs(apart(met)) <= CLOSING_MARGIN

"""A run without an end that ends as resting goes on until its overlaps are static."""

import math

import numpy as np
import pytest

import granular as gr
from granular.md.located.ending import STATIC_OVERLAP_TOLERANCE

FLOOR = gr.Scene([math.inf, 1.0], [0.0, 0.1], [1.0], [0.0, 0.0], 9.81)
PILE = gr.Scene([math.inf, 1.0, 0.5, 2.0], [0.0, 0.1, 0.1, 0.1], [0.3, 0.1, 0.05], [0.0] * 4, 9.81)
HUNG = gr.Scene([1.0, math.inf], [0.1, 0.0], [0.2], [0.0, 0.0], external_force=[5.0, 0.0])
CASES = {
    "one ball": (FLOOR, gr.LinearDashpot(1e3, 2.0)), "a pile": (PILE, gr.LinearDashpot(1e5, 60.0)),
    "over-damped": (FLOOR, gr.LinearDashpot(1e3, 2e3)), "viscoelastic": (FLOOR, gr.ViscoelasticHertz(1e6, 1e3)),
    "Tsuji": (PILE, gr.TsujiHertz(1e7, 0.4)), "a ceiling": (HUNG, gr.LinearDashpot(1e4, 30.0)),
    "late": (FLOOR.replace(gap=[0.01]), gr.LinearDashpot(1e5, 200.0)),
}


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ["plain", "compiled"])
@pytest.mark.parametrize(("scene", "law"), CASES.values(), ids=CASES)
@pytest.mark.usefixtures("compiled_rest_tests")
def test_overlaps_are_static_and_resumed_runs_are_bitwise_identical(scene, law, engine):
    if engine == "compiled":
        pytest.importorskip("numba")
    run = gr.md.simulate(scene, law, engine=engine)
    assert run.status is gr.Status.resting
    still = gr.measures.static_overlaps(run)
    assert (abs(run.gap[-1] + still) <= 2.0 * STATIC_OVERLAP_TOLERANCE * still).all()
    longer = gr.md.simulate(scene, law, engine=engine, t_end=float(run.time[-1]))
    assert len(longer.contacts) == len(run.contacts)  # none is added
    for share in (0.05, 0.3, 0.6, 0.95, 1.0):
        cut = gr.md.simulate(scene, law, t_end=share * float(run.time[-1]), engine=engine)
        late = gr.md.resume(cut, engine=engine)
        assert (late.status, late.time[-1]) == (run.status, run.time[-1])
        assert late.gap[-1].tobytes() == run.gap[-1].tobytes()
        assert late.velocity[-1].tobytes() == run.velocity[-1].tobytes()


def test_samples_change_no_bit_of_the_end():
    scene, law = CASES["a pile"]
    plain = gr.md.simulate(scene, law)
    sampled = gr.md.simulate(scene, law, samples=np.linspace(0.0, 0.8 * float(plain.time[-1]), 40))
    assert sampled.time[-1] == plain.time[-1]
    assert sampled.gap[-1].tobytes() == plain.gap[-1].tobytes()


def test_a_scene_at_rest_from_the_start_ends_there_or_soon():
    law = gr.LinearDashpot(1e3, 20.0)
    run = gr.md.simulate(FLOOR.replace(gap=[-9.81e-3]), law)
    assert run.status is gr.Status.resting
    assert run.time[-1] < 0.05
    assert run.gap[-1, 0] == pytest.approx(-9.81e-3, rel=1e-12)

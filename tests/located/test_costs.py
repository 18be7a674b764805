"""What a run costs beside its kernels, in counts, which no load of a machine disturbs: calls, laws asked, looks whether
something rests."""

import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.laws import contact_law, kinds
from granular.md.located import many

HOUSE = str(Path(gr.__file__).parent)
SCENE = gr.scenes.three_balls(gap=1e-4)
LAW = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in SCENE.pairs]
END = gr.until.contact(pair=0, nth=2)


def calls(work):
    """How often functions of this package are called, except for compiled ones, once everything has been loaded."""
    work(), work()
    count = Counter()

    def note(frame, event, _):
        count["calls"] += event == "call" and frame.f_code.co_filename.startswith(HOUSE)

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(before)
    return count["calls"]


@pytest.mark.parametrize(("engine", "most"), [("plain", 2397), ("compiled", 107)])
def test_calls_of_a_soft_run(engine, most):
    """Of three balls, until the second contact with the floor; 6 300 and 424 before."""
    if engine == "compiled":
        pytest.importorskip("numba")
    assert calls(lambda: gr.md.simulate(SCENE, LAW, until=END, engine=engine)) <= most


def test_samples_and_balls_cost_calls_of_their_own_only():
    """A sample costs the same few calls in a scene of any size, and so does a ball none."""
    pytest.importorskip("numba")

    def run(n, samples):
        scene = gr.scenes.column(n, gap=0.01)
        return calls(lambda: gr.md.simulate(scene, gr.LinearDashpot(1e6, 10.0), t_end=0.01, samples=samples,
                                            engine="compiled"))

    assert run(40, 2) <= run(4, 2) + 30
    assert run(4, 22) - run(4, 2) <= 20 * 20


def test_laws_of_scenes_alike_are_asked_once(monkeypatch):
    asked = Counter()
    monkeypatch.setattr(kinds, "resolve", lambda *given: asked.update(laws=1) or contact_law.resolve(*given))
    kinds._cached_laws.cache_clear()
    for speed in (1.0, 2.0, 3.0):
        law = gr.ViscoelasticHertz(1e8, 1e3)
        gr.md.simulate(SCENE.replace(velocity=[0.0, -speed, -speed]), law, t_end=1e-3, engine="plain")
    once = asked["laws"]
    assert 0 < once <= 5
    gr.md.simulate(SCENE, gr.ViscoelasticHertz(1e8, 2e3), t_end=1e-3, engine="plain")
    assert asked["laws"] == 2 * once


@pytest.mark.rotating
@pytest.mark.parametrize("tol", [1e-16, 1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize(("p", "d"), [(1.5, 0.5), (1.5, 0.25), (1.0, 0.0)])
def test_nobody_looks_whether_a_scene_in_motion_rests(p, d, tol, monkeypatch):
    """Piece ends at turning points of contacts, where all stands still for a moment, are no reason to look."""
    looks = []
    monkeypatch.setattr(many, "test_current_block", lambda *given: looks.append(given) or pytest.fail("a look"))
    gap = np.stack([np.zeros(6), np.geomspace(1e-5, 1e-3, 6)], axis=1)
    law = np.broadcast_to([1e8, p, 2e3, d], (6, 2, 4))
    scenes = many.Scenes(np.array([np.inf, 0.6, 0.06]), gap, np.array([0.0, -3.0, -3.0]), law, np.float64(9.81))
    result = many.solve_many(scenes, until=END, tol=tol, engine="plain")
    assert not looks
    assert (result.counts >= 1).all()


def test_threads_at_once_give_the_same_bits():
    """Machine code runs without the interpreter's lock, and laws of scenes alike are shared."""
    pytest.importorskip("numba")

    def run(seed):
        rng = np.random.default_rng(seed % 4)
        scene = gr.Scene([np.inf, *rng.uniform(0.1, 1.0, 12)], [0.0] * 13, rng.uniform(0.0, 1e-3, 12),
                         [0.0, *rng.normal(size=12)], 9.81)
        law = gr.TsujiHertz(1e7, 0.1) if seed % 2 else gr.LinearDashpot(1e6, 10.0)
        soft = gr.md.simulate(scene, law, t_end=0.02, samples=50, engine="compiled")
        hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=0.02, samples=50, engine="compiled")
        return soft.gap.tobytes() + soft.contacts.tobytes() + hard.gap.tobytes()

    alone = [run(seed) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(run, range(24))) == alone * 6

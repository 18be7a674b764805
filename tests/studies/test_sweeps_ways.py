"""Sweeps: the compiled way and one by one give the same bits, on any executor, in any number of threads."""

import math
import threading
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import granular as gr
from granular.cases import Case
from granular.md.located import many as located
from granular.studies.sweeps import schedule
from granular.studies.sweeps.results import RESULTS

xr = pytest.importorskip("xarray")
ONE_BY_ONE = {"engine": "plain"}
FAST = [name for name, result in RESULTS.items() if result.many]


@pytest.mark.rotating
@pytest.mark.parametrize(("scene", "over", "fixed"), [
    ("three-balls", ["restitution=0.005:1:4", "gap=1e-7:1e-2:3:log"], {}),
    ("three-balls", ["radii[0]=0.009:0.2:6:log"], {"restitution": 0.8}),  # the first are ongoing at the end
    ("three-balls", ["law=LinearDashpot,TsujiHertz,ViscoelasticHertz,WaltonBraun", "restitution=0.5,1"], {}),
    ("ball-stack", ["n=2,4", "gap=0,1e-3"], {}),
    ("newtons-cradle", ["gap=0,1e-6,1e-3"], {}),
    ("gas", ["seed=1,2"], {"n": 8, "walls": False, "length": 8.0}),
    ("bouncing-ball", ["t_end=0.1,2,20"], {}),
])
@pytest.mark.usefixtures("compiled_rest_tests")
def test_compiled_is_one_by_one_bit_for_bit(scene, over, fixed, monkeypatch):
    monkeypatch.setattr(schedule, "is_in_memory", lambda kernel: True)
    fast = gr.sweep(scene, over, sorted(FAST), **fixed)
    slow = gr.sweep(scene, over, sorted(FAST), run=ONE_BY_ONE, **fixed)
    for name in fast:
        assert np.array_equal(fast[name].values, slow[name].values, equal_nan=True), name
    assert fast["contacts"].values.max() >= 1


@pytest.mark.parametrize("ceiling", [0.0, 0.3])
@pytest.mark.usefixtures("compiled_rest_tests")
def test_a_ceiling_has_exactly_its_velocity_in_either_way(ceiling, monkeypatch):
    """The sum of the rates of all gaps would miss it by rounding."""
    monkeypatch.setattr(schedule, "is_in_memory", lambda kernel: True)
    scene = gr.Scene([math.inf, 2.0, 3.0, 4.0, math.inf], [0.0, 0.01, 0.01, 0.01, 0.0], [0.2, 0.1, 0.3, 0.1],
                     [0.0, 1.0, -1.0, 2.0, ceiling])
    case = Case(scene, [gr.LinearDashpot(1e5, 1.0)] * 4, t_end=1.0)
    fast = gr.sweep(case, {"gap": np.linspace(0.05, 0.4, 8)}, "v_final")["v_final"].values
    slow = gr.sweep(case, {"gap": np.linspace(0.05, 0.4, 8)}, "v_final", run=ONE_BY_ONE)["v_final"].values
    assert fast.tobytes() == slow.tobytes()
    assert (fast[:, -1] == ceiling).all()


@pytest.mark.rotating
@pytest.mark.parametrize("making", [1e-3, 10.0])
def test_cells_do_not_wait_for_a_compiler_unless_they_take_longer(making, monkeypatch):
    """After 16 cells the others are compiled if one by one they would take longer than making the machine code."""
    solved, known = [], located.solve_many
    monkeypatch.setattr(schedule, "LOADING_SECONDS", making)
    monkeypatch.setattr(schedule, "COMPILING_SECONDS", making)
    monkeypatch.setattr(schedule, "is_in_memory", lambda kernel: False)

    def solve(many, **end):  # interpreted, because no machine code is wanted here
        solved.append(len(many.gap))
        return known(many, engine="plain", **end)

    monkeypatch.setattr(located, "solve_many", solve)
    data = gr.sweep("three-balls", ["gap=1e-7:1e-2:40:log"], "contacts")
    assert sum(solved) == (24 if making < 1.0 else 0)
    assert (data["status"].values >= 0).all()


def test_any_executor_gives_the_same_bits(monkeypatch):
    monkeypatch.setattr(schedule, "MIN_BATCH_SECONDS", 0.005)
    over = ["restitution=0.3:1:20", "gap=1e-7:1e-2:20:log"]
    here = gr.sweep("three-balls", over, sorted(FAST))
    with ProcessPoolExecutor(2) as pool:
        assert here.identical(gr.sweep("three-balls", over, sorted(FAST), executor=pool))


@pytest.mark.parametrize(("workers", "threads"), [(1, 0), (2, 2), (3, 3)])
def test_any_number_of_threads_gives_the_same_bits(workers, threads, monkeypatch):
    """Compiled calls run in threads, all that is Python in this one; where little is left, there are none."""
    names, known = set(), located.solve_many

    def solve_many(many, **end):
        names.add(threading.current_thread().name)
        return known(many, **end)

    over = ["restitution=0.5:1:10", "gap=1e-7:1e-2:10:log"]
    here = gr.sweep("three-balls", over, sorted(FAST), workers=1)
    monkeypatch.setattr(located, "solve_many", solve_many)
    monkeypatch.setattr(schedule, "is_in_memory", lambda kernel: True)
    monkeypatch.setattr(schedule, "MIN_THREADED_SECONDS", 0.0)
    assert here.identical(gr.sweep("three-balls", over, sorted(FAST), workers=workers))
    assert len(names - {"MainThread"}) <= threads
    assert (len(names) > 1) == (threads > 0)
    names.clear()
    monkeypatch.setattr(schedule, "MIN_THREADED_SECONDS", math.inf)
    gr.sweep("three-balls", over, "contacts", workers=workers)
    assert names == {"MainThread"}


def test_an_interrupted_sweep_in_threads_leaves_none_and_keeps_what_is_done(monkeypatch, tmp_path):
    monkeypatch.setattr(schedule, "MIN_THREADED_SECONDS", 0.0)
    monkeypatch.setattr(schedule, "MIN_BATCH_SECONDS", 0.0)  # several batches, whatever the machine's speed
    monkeypatch.setattr(schedule, "is_in_memory", lambda kernel: True)

    def interrupt(reached, count):
        if count > 16:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gr.sweep("three-balls", "gap=1e-7:1e-2:200:log", "contacts", workers=2, on_progress=interrupt,
                 save=tmp_path / "map.nc")
    assert not [thread for thread in threading.enumerate() if "ThreadPool" in thread.name]
    assert 16 < int((xr.load_dataset(tmp_path / "map.nc")["status"] >= 0).sum()) < 200


def pile_that_creeps(gamma):
    scene = gr.Scene([math.inf, 1.0, 0.1, 0.5], [0.0, 0.1, 0.1, 0.1], [0.0, 0.001, 0.002], [0.0] * 4, 9.81)
    return Case(scene, gr.LinearDashpot(1e5, gamma), t_end=0.5)


@pytest.mark.rotating
@pytest.mark.usefixtures("compiled_rest_tests")
def test_a_pile_that_creeps_ends_as_it_does_alone(monkeypatch):
    """In steps as long as the creep, where those of the fast decay would be millions; with one law for all pairs."""
    monkeypatch.setattr(schedule, "is_in_memory", lambda kernel: True)
    data = gr.sweep(pile_that_creeps, {"gamma": [1e3, 1e4]}, ("v_final", "contacts"))
    for i, gamma in enumerate([1e3, 1e4]):
        case = pile_that_creeps(gamma)
        alone = gr.md.simulate(case.scene, case.law, t_end=0.5)
        assert data.v_final.values[i].tobytes() == alone.velocity[-1].tobytes()
        assert alone.stats["steps"] <= 10_000

"""Speed of the engines (run with `pytest bench --benchmark-only`).

Sizes are geometric. Compare numbers within one run only. One benchmark is one run, and `extra_info` contains the
counters from which events/s, solves/s and ball-steps/s follow.
"""

import math

import numpy as np
import pytest

import granular as gr

METHODS = ("located", "verlet", "symplectic-euler", "rk4", "gear5")
RARE_METHODS = ("symplectic-euler", "gear5")


@pytest.fixture(autouse=True)
def skip_rare_kernels(request):
    """Skip compiled runs of rarely used methods unless they are timed."""
    timed, given = request.config.getoption("benchmark_only"), getattr(request.node, "callspec", None)
    if not timed and given and given.params.get("method") in RARE_METHODS and given.params["engine"] == "compiled":
        pytest.skip("compiled only in timed runs and in the soak")


def timed(benchmark, run):
    """Time `run` after a first call, and record its counters."""
    run()
    result = benchmark(run)
    kept = ("events", "contacts", "steps", "evaluations", "engine")
    benchmark.extra_info.update({name: result.stats[name] for name in kept if name in result.stats})
    return result


@pytest.mark.rotating
@pytest.mark.benchmark(group="three balls")
@pytest.mark.parametrize("engine", ["plain", "compiled"])
@pytest.mark.parametrize("method", METHODS)
def test_three_balls(benchmark, method, engine):
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    options = {"method": method, "engine": engine} | ({} if method == "located" else {"dt": 1e-6})
    run = timed(benchmark, lambda: gr.md.simulate(scene, law, until=gr.until.contact(0, 2), **options))
    assert run.count(1) == 4


@pytest.mark.rotating
@pytest.mark.benchmark(group="chain of Hertz balls, 100 steps")
@pytest.mark.parametrize(("engine", "n"), [("plain", 10), ("plain", 100)] + [("compiled", 10**e) for e in (1, 2, 3, 4)])
@pytest.mark.parametrize("method", METHODS[1:])
def test_chain(benchmark, method, engine, n):
    scene = gr.Scene([1.0] * n, [0.5] * n, np.full(n - 1, -1e-3), np.linspace(-1e-3, 1e-3, n))
    options = {"method": method, "engine": engine, "dt": 1e-3, "t_end": 0.1005, "log": False}
    assert timed(benchmark, lambda: gr.md.simulate(scene, gr.Hertz(1e4), **options)).stats["steps"] == 100


@pytest.mark.rotating
@pytest.mark.benchmark(group="cluster of touching balls, located")
@pytest.mark.parametrize("n", [2, 4, 8, 16])
@pytest.mark.parametrize("law", [gr.LinearDashpot(1e6), gr.Hertz(1e6)], ids=["spring", "Hertz"])
def test_cluster(benchmark, law, n):
    scene = gr.Scene([1.0] * n, [0.5] * n, [0.0] * (n - 1), [1.0] + [0.0] * (n - 1))
    run = timed(benchmark, lambda: gr.md.simulate(scene, law, engine="compiled"))
    assert run.stats["contacts"] >= n - 1


@pytest.mark.rotating
@pytest.mark.benchmark(group="soft gas, located")
@pytest.mark.parametrize("n", [10, 100, 1000])
def test_soft_gas(benchmark, n):
    scene, law = gr.scenes.gas(n=n, length=float(n), seed=1), gr.LinearDashpot(1e6)
    run = timed(benchmark, lambda: gr.md.simulate(scene, law, engine="compiled", max_events=1000, log=False))
    assert run.stats["contacts"] == 1000


@pytest.mark.rotating
@pytest.mark.benchmark(group="hard gas, 2000 collisions")
@pytest.mark.parametrize("n", [10, 100, 1000, 10_000])
@pytest.mark.parametrize("queue", ["sorted", "compiled"])
def test_hard_gas(benchmark, queue, n):
    scene, rule = gr.scenes.gas(n=n, length=float(n), seed=1), gr.ConstantRestitution(1.0)
    run = timed(benchmark, lambda: gr.edmd.simulate(scene, rule, engine=queue, max_events=2000, log=False))
    assert run.stats["events"] == 2000


@pytest.mark.rotating
@pytest.mark.benchmark(group="map of three balls")
@pytest.mark.parametrize("size", [4, 8, 16])
def test_map(benchmark, size):
    axes = {"restitution": np.linspace(0.3, 1.0, size), "gap": np.geomspace(1e-7, 1e-2, size)}
    gr.sweep("three-balls", axes, "contacts")
    data = benchmark(lambda: gr.sweep("three-balls", axes, "contacts"))
    assert math.isfinite(float(data["contacts"].sum()))

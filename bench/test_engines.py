"""Speed of the engines (run with: pytest bench --benchmark-enable). Sizes are geometric; compare within one run."""

import pytest

import granular as gr


@pytest.mark.benchmark(group="three balls")
@pytest.mark.parametrize("method", ["verlet", "symplectic-euler", "rk4", "gear5"])
@pytest.mark.parametrize("engine", ["plain", "compiled"])
def test_fixed_step(benchmark, method, engine):
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    options = {"until": gr.until.contact(0, 2), "method": method, "engine": engine, "dt": 1e-7}
    gr.md.simulate(scene, law, **options)
    assert benchmark(lambda: gr.md.simulate(scene, law, **options)).count(1) == 4


@pytest.mark.benchmark(group="event-driven gas")
@pytest.mark.parametrize("n", [10, 100, 1000])
def test_edmd_gas(benchmark, n):
    scene = gr.scenes.gas(n=n, length=float(n), seed=1)
    run = benchmark(lambda: gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), max_events=2000, log=False))
    assert run.stats["events"] == 2000

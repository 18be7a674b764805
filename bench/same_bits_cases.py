"""Random scenes, laws and options of `same_bits`, and the values it compares."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

REPO_ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(REPO_ROOT))  # the unpacked tree of REF has no `bench.reference`
WORK_LIMITS = {"max_events": 80, "max_steps": 3000}
GAS_SIZES = (60, 1000, 120_000)
"""Numbers of balls. With 1e5 balls or more, compiled hard spheres run in blocks."""
COMPILED_LAWS = 6
"""Number of laws, counted from the first, that the located method can compile."""
REFERENCE_MODULES = ("granular.reference.taylor", "bench.reference.taylor")
"""Module of the 34-digit solver, by version. Its package defines `solve`."""
FIXED_METHODS = ("verlet", "symplectic-euler", "rk4", "gear5")
Case = tuple[str, int, Callable[[], Any]]
"""Family, seed, and function to run."""


def own_rule(speed: float, pair: Any) -> float:
    """Collision rule as a user writes it."""
    return 1.0 / (1.0 + 0.3 * speed + 0.01 * float(pair.index))


# --- scenes, laws and options


def random_scene(rng: Any, *, overlaps: bool = False, walls: bool = True) -> Any:
    """Scene of one to six balls: ties, touching rows, piles, moving walls, gravity."""
    from tests.helpers.scenes_at_random import ALL, HARD, scene

    gaps = (*(ALL if overlaps else HARD), "uneven")
    return scene(rng, (1, 6), walls=(0.5, 0.2, 0.3) if walls else (0.5, 0.0, 0.0), gaps=gaps)


def soft_laws(rng: Any) -> dict[str, Any]:
    """One law of every kind, with stiffnesses from 1e2 to 1e6."""
    from tests.helpers.scenes_at_random import LAWS, POWERS

    k, zeta = float(10.0 ** rng.uniform(2.0, 6.0)), float(rng.choice([0.02, 0.2, 1.0]))
    return {name: LAWS[name](k, zeta, 1.0) for name in (*POWERS, "Walton-Braun", "own Hertz", "own with memory")}


def run_options(rng: Any, pairs: int) -> dict[str, Any]:
    """Random options of a run: its end, its samples and its log."""
    from granular import until

    end = float(rng.choice([0.1, 0.5, 1.0]))
    ways: list[dict[str, Any]] = [
        {"t_end": end}, {"t_end": end, "samples": 9}, {"t_end": end, "samples": [0.0, 0.01, 0.01, 0.5 * end]},
        {"t_end": end, "until": until.contact(int(rng.integers(pairs)), int(rng.integers(1, 4)))},
        {"t_end": 3.0, "until": until.separated()}, {"t_end": 2.0, "max_events": 3}, {"t_end": end, "log": False},
        {"t_end": end + 1e3, "t_start": 1e3}, {},
    ]
    return ways[int(rng.integers(len(ways)))]


def compared_values(run: Any) -> dict[str, Any]:
    """Values of a trajectory that are compared."""
    return {name: getattr(run, name) for name in ("time", "position", "velocity", "gap", "force", "message")} | {
        "status": run.status.name} | {f"contacts.{name}": run.contacts[name] for name in run.contacts.dtype.names} | {
        f"stats.{name}": value for name, value in run.stats.items()}


# --- families


def edmd(seeds: int) -> Iterator[Case]:
    """Hard spheres: rules, queues, ties, remedies, resumed runs, event callbacks."""
    import granular as gr

    options: list[dict[str, Any]] = [
        {}, {"ties": "right"}, {"ties": "random", "seed": 7}, {"ties": "newton"}, {"ties": "poisson"},
        {"ties": "reflect"}, {"collapse": "merge"}, {"tc": 1e-3}, {"elastic_below": 1e-2},
    ]
    for option in options:
        for queue in ("sorted", "compiled"):
            if queue == "compiled" and option.get("ties") in ("newton", "poisson", "reflect"):
                continue
            for seed in range(seeds):
                rng = np.random.default_rng([1, seed])
                scene, rule = random_scene(rng), gr.ConstantRestitution(float(rng.choice([0.05, 0.5, 0.9, 1.0])))
                settings = {"max_events": 300, "engine": queue} | run_options(rng, scene.n - 1) | option
                title = " ".join(str(x) for x in next(iter(option.items()), ("default",)))
                yield f"edmd {title}, {queue}", seed, lambda s=scene, r=rule, o=settings: gr.edmd.simulate(s, r, **o)
    eps = gr.ConstantRestitution(0.8)
    for seed in range(seeds):
        rng = np.random.default_rng([2, seed])
        scene, settings = random_scene(rng), {"max_events": 300, "t_end": 0.7}
        rules: dict[str, Any] = {"own rule": own_rule, "sticking": gr.ConstantRestitution(0.0),
                                 "one per pair": [gr.ConstantRestitution(1.0 - 0.1 * c) for c in range(scene.n - 1)]}
        for title, rule in rules.items():
            yield f"edmd {title}", seed, lambda s=scene, r=rule, o=settings: gr.edmd.simulate(s, r, **o)
        for queue in ("sorted", "compiled"):
            yield f"edmd resumed, {queue}", seed, lambda s=scene, q=queue: resumed_run(s, eps, q)
        yield "edmd on_event", seed, lambda s=scene: run_with_events(
            gr.edmd.simulate, s, eps, t_end=0.5, max_events=100)
    for n in GAS_SIZES:
        gas = gr.scenes.gas(n, float(n), mass_spread=4.0)
        for queue in ("auto", "compiled") if n > 1000 else ("auto", "sorted", "compiled"):
            yield f"edmd gas, {queue}", n, lambda s=gas, q=queue: gr.edmd.simulate(
                s, eps, t_end=2.0 if s.n < 100_000 else 0.2, engine=q, samples=4)


def resumed_run(scene: Any, rule: Any, queue: str) -> Any:
    """Run that is interrupted half-way and resumed."""
    import granular as gr

    first = gr.edmd.simulate(scene, rule, t_end=0.3, engine=queue, max_events=200)
    return gr.edmd.resume(first, t_end=0.6, engine=queue, max_events=200, samples=5)


def run_with_events(simulate: Any, scene: Any, physics: Any, **options: Any) -> Any:
    """Values of a run, with the rows passed to `on_event`."""
    rows: list[Any] = []
    run = simulate(scene, physics, on_event=lambda batch: rows.extend(np.atleast_1d(batch).tolist()), **options)
    return compared_values(run) | {"rows": repr(rows)}


def located(seeds: int) -> Iterator[Case]:
    """Every law under the located method, interpreted and compiled."""
    import granular as gr

    for seed in range(seeds):
        rng = np.random.default_rng([3, seed])
        scene, laws = random_scene(rng, overlaps=True), soft_laws(rng)
        settings, mixed = WORK_LIMITS | run_options(rng, scene.n - 1), rng.integers(len(laws), size=scene.n - 1)
        laws["mixed"] = [list(laws.values())[int(i)] for i in mixed]
        laws["mixed powers"] = [list(laws.values())[int(i)] for i in mixed % COMPILED_LAWS]
        for number, (name, law) in enumerate(laws.items()):
            for engine in ("plain", "compiled") if number < COMPILED_LAWS or name == "mixed powers" else ("plain",):
                yield f"located {name}, {engine}", seed, lambda s=scene, w=law, o=settings | {"engine": engine}: (
                    gr.md.simulate(s, w, **o))
        coarse, chosen = settings | {"tol": 1e-10}, laws["viscoelastic"]
        yield "located tol", seed, lambda s=scene, w=chosen, o=coarse: gr.md.simulate(s, w, **o)
        yield "located on_event", seed, lambda s=scene, w=chosen: run_with_events(
            gr.md.simulate, s, w, t_end=0.3, **WORK_LIMITS)
    yield from soft_gases("located", {})


def fixed(seeds: int) -> Iterator[Case]:
    """Every integrator with every law, interpreted and compiled."""
    import granular as gr

    for seed in range(max(1, seeds // 2)):
        for number, method in enumerate(FIXED_METHODS):
            rng = np.random.default_rng([4, number, seed])
            scene = random_scene(rng, overlaps=True)
            settings = run_options(rng, scene.n - 1)
            step = None if rng.random() < 0.3 else float(rng.choice([1e-4, 1e-3]))
            settings = WORK_LIMITS | {"method": method, "dt": step} | settings
            laws = soft_laws(rng)
            for law in laws.values():
                for engine in ("plain", "compiled"):
                    yield f"fixed {method}, {engine}", seed, lambda s=scene, w=law, o=settings | {"engine": engine}: (
                        gr.md.simulate(s, w, **o))
            yield f"fixed {method}, on_event", seed, lambda s=scene, w=laws["dashpot"], m=method: run_with_events(
                gr.md.simulate, s, w, t_end=0.2, method=m, dt=1e-3, **WORK_LIMITS)
    for log in (True, False):
        yield from soft_gases("fixed", {"method": "verlet", "dt": 1e-3, "log": log})


def soft_gases(family: str, settings: dict[str, Any]) -> Iterator[Case]:
    """Soft gases with a few collisions."""
    import granular as gr

    for n in GAS_SIZES[:2]:
        gas = gr.scenes.gas(n, float(n), mass_spread=4.0)
        for law in (gr.LinearDashpot(1e4, 10.0), gr.ViscoelasticHertz(1e5, 50.0)):
            yield f"{family} gas", n, lambda s=gas, w=law: gr.md.simulate(s, w, t_end=1.0, samples=4, **settings)


def compare(seeds: int) -> Iterator[Case]:
    """Functions built on the engines.

    These are comparisons, isolated contacts, the 34-digit solver, the adiabatic theory and sweeps.
    """
    import granular as gr

    for seed in range(seeds):
        rng = np.random.default_rng([5, seed])
        scene, laws = random_scene(rng, walls=False), soft_laws(rng)
        law = laws[str(rng.choice(["spring", "dashpot", "Hertz", "viscoelastic", "Tsuji"]))]
        yield "compare", seed, lambda s=scene, w=law: comparison_values(s, w)
        yield "binary", seed, lambda s=scene, w=law: [gr.restitution_of(w)(0.7, p) for p in s.pairs]
        few = gr.Scene([1.0, 2.0, 1.0], [0.1] * 3, [1e-3, 2e-3], [1.0, 0.0, -float(rng.uniform(0.1, 1.0))])
        yield "reference", seed, lambda s=few, w=law: reference_solution(s, w)
        ratio, eps = float(rng.uniform(2.0, 20.0)), float(rng.uniform(0.1, 1.0))
        yield "adiabatic", seed, lambda r=ratio, e=eps: adiabatic_values(r, e)
    for seed in range(max(1, seeds // 5)):
        rng = np.random.default_rng([6, seed])
        over = {"gap": 10.0 ** rng.uniform(-6, -3, 4), "restitution": rng.uniform(0.2, 1.0, 3)}
        for title, options in {"compiled": {}, "one by one": {"run": {"engine": "plain"}},
                               "both engines": {"results": ["error", "hard_contacts", "distance"]}}.items():
            yield f"sweep, {title}", seed, lambda g=over, o=options: sweep_values(g, o)


def comparison_values(scene: Any, law: Any) -> Any:
    """All numbers of a comparison."""
    import granular as gr

    report = gr.compare(scene, law, t_end=0.5, max_events=60, engine="plain").to_dict()
    return {name: repr(value) for name, value in report.items() if name != "provenance"}


def sweep_values(over: Any, options: Any) -> Any:
    """All numbers of a sweep."""
    import granular as gr

    data = gr.sweep("three-balls", over, **options)
    return {str(name): array.values for name, array in data.variables.items()}


def reference_solution(scene: Any, law: Any) -> Any:
    """Solution of the 34-digit solver, with 20 digits."""
    from granular import until

    reference = import_module(next(filter(is_module, REFERENCE_MODULES)).rpartition(".")[0])
    return repr(reference.solve(scene, law, until=until.separated(), digits=20))


def is_module(name: str) -> bool:
    """Whether a module can be found.

    Its packages are checked first, because `find_spec` imports them.
    """
    folders = [".".join(name.split(".")[: i + 1]) for i in range(name.count("."))]
    return all(map(find_spec, folders)) and find_spec(name) is not None


def adiabatic_values(ratio: float, eps: float) -> Any:
    """Adiabatic theory of a light ball on a heavy ball."""
    import granular as gr

    scene = gr.scenes.three_balls((0.01 * ratio, 0.01), 1e-5, 0.6)
    law = [gr.LinearDashpot.from_restitution(eps, 5e7, pair) for pair in scene.pairs]
    return {name: value for name, value in vars(gr.adiabatic.contacts(scene, law)).items() if name != "steps"}


PLAIN_FAMILIES = {"edmd": edmd, "located": located, "fixed": fixed, "compare": compare}

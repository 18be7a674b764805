"""Lines of balls: symmetries, invariants, chains and equal balls."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from bench.stability import own, truth
from bench.stability.cell import (
    ALL_METHODS,
    DEFAULT_METHODS,
    ELASTIC_RULE,
    FIXED_METHODS,
    SOFT_METHODS,
    Cell,
    Rerun,
    at_wall,
    compared_with,
)
from bench.stability.contact import LAW_FACTORIES
from granular import laws as built_in, md, scenes, until
from granular._engine.check import Array
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz, ViscoelasticHertz
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import Trajectory
from granular.scene import Scene

LINE_LAWS = ("linear", "linear", "viscoelastic", "tsuji", "hertz", "parabola")
"""Laws of the random lines, used in turn."""


def symmetries(seeds: int = 40) -> Iterator[Cell]:
    """Random lines of 2 to 6 balls over many decades of mass, gap and stiffness."""
    yield from close_in_time()
    for seed in range(seeds):
        scene, laws, eps = random_line(seed)
        each = [("symmetry", "mirror", truth.mirrored(), DEFAULT_METHODS),
                ("symmetry", "late", truth.late_start(4.0), DEFAULT_METHODS),
                ("invariants", "energy", truth.ENERGY_LOSS, ALL_METHODS),
                ("symmetry", "as located", as_located(), FIXED_METHODS)]
        if not scene.is_wall.any():
            each.append(("invariants", "momentum", truth.momentum(), ALL_METHODS))
        if isinstance(laws[0], LinearDashpot):
            each.append(("invariants", "scaling", truth.scaled(), DEFAULT_METHODS))
        for axis, what, expected, methods in each:
            case = f"line {seed}: {scene.n} bodies, {type(laws[0]).__name__}, {what}"
            yield Cell(axis, case, scene, expected, laws, ConstantRestitution(eps), 0.0 if what == "scaling" else 1e-11,
                       options={"t_end": 4.0, "max_events": 200}, methods=methods)


def close_in_time() -> Iterator[Cell]:
    """Two impacts at a late start, closer in time than a float resolves.

    The order of the impacts affects the outcome.
    """
    scene = Scene(np.ones(3), np.full(3, 0.1), [3e-5, 1e-5], [1.0, 0.0, -1.0])
    yield Cell("start time", "two impacts 2e-5 s apart at t = 2^40 s", scene, truth.late_start(1.0),
               LinearDashpot(1e10), ConstantRestitution(0.5), options={"t_end": 1.0}, methods=DEFAULT_METHODS)


def random_line(seed: int) -> tuple[Scene, list[Any], float]:
    """Random line without gravity: its scene, one law per pair, its restitution."""
    rng = np.random.default_rng(seed)
    n, decades = int(rng.integers(2, 7)), float(rng.choice([0.0, 0.5, 2.0]))
    mass = 10.0 ** rng.uniform(-decades, decades, n)
    radius, velocity = np.full(n, 0.1), rng.uniform(-1.0, 1.0, n)
    if rng.random() < 0.5:
        mass, radius, velocity = (np.insert(a, 0, x) for a, x in ((mass, math.inf), (radius, 0.0), (velocity, 0.0)))
    scene = Scene(mass, radius, 10.0 ** rng.uniform(-12.0, 0.0, len(mass) - 1), velocity)
    k, eps = 10.0 ** rng.uniform(4.0, 14.0), float(rng.choice([1.0, 0.9, 0.3]))
    return scene, [LAW_FACTORIES[LINE_LAWS[seed % len(LINE_LAWS)]](eps, k, 1.0, pair) for pair in scene.pairs], eps


@compared_with("located method")
def as_located(run: Trajectory, rerun: Rerun) -> float:
    """Difference from the located method, divided by the condition number.

    Other cells check the located method itself.
    """
    exact = md.simulate(run.scene, run.law, t_end=4.0, max_events=200)
    return truth.outcome_difference(run, exact.velocity[-1], exact, rerun)


def touching() -> Iterator[Cell]:
    """Three balls that touch to within rounding, hit from one side or from both."""
    laws = (LinearDashpot(1e6, 10.0), Hertz(1e6), ViscoelasticHertz(1e6, 1e3), TsujiHertz(1e6, 0.5),
            PowerLaw(1e6, 2.0), PowerLaw(1e6, 1.7))
    for law, last, gap in product(laws, (0.0, -1.0), (0.0, 5e-324, 1e-200, 1e-100, 1e-60, 1e-30, 1e-18)):
        scene = Scene(np.ones(3), np.full(3, 0.1), [0.0, gap], [1.0, 0.0, last])
        case = f"gaps 0 and {gap:g}, {'one side' if last == 0.0 else 'both sides'}, {law}"
        cell = Cell("touching", case, scene, truth.momentum(), law,
                    options={"until": until.separated(), "max_steps": 2_000})
        yield cell
        yield replace(cell, truth=truth.nearby_scene(scene.replace(gap=[0.0, 0.0])), tolerance=1e-11)


KNOWN_CRADLES: tuple[tuple[str, int, int, Any, tuple[float, ...], str, float], ...] = (
    *((f"3 touching balls, linear{more}", 3, 1, LinearDashpot(k), (-0.1302616951, 0.1502295694, 0.9800321256),
       "piecewise exact solution, 10 digits", 2e-10) for k, more in ((1.0, ""), (1e16, ", k = 1e16"))),
    *((f"5 touching balls, linear{more}", 5, 1, LinearDashpot(k),
       (-0.1322794847, -0.0753291698, -0.0310108290, 0.2962177501, 0.9424017334),
       "piecewise exact solution, 10 digits", 2e-10) for k, more in ((1.0, ""), (1e16, ", k = 1e16"))),
    ("two balls hit three touching balls, LinearDashpot", 5, 2, LinearDashpot(1.0),
     (-0.17089975, -0.04920079, 0.38202721, 0.66099500, 1.17707832), "independent solver, 8 digits", 2e-8),
    ("two balls hit three touching balls, Hertz", 5, 2, Hertz(1.0),
     (-0.11261497, -0.04195950, 0.21448578, 0.80036667, 1.13972203), "independent solver, 8 digits", 2e-8),
)
"""Cradles with final velocities computed by other programs.

The columns are name, balls, striking balls, law, velocities in m/s, source and tolerance. The velocities were computed
to more digits than are printed.
"""


def chains() -> Iterator[Cell]:
    """Cradles, and chains of up to 1e5 balls."""
    for case, n, arrive, law, after, words, tolerance in KNOWN_CRADLES:
        yield Cell("chains", case, scenes.newtons_cradle(n, arrive), truth.velocities(after, words=words), law,
                   tolerance=tolerance, options={"until": until.separated()}, methods=SOFT_METHODS)
    for n in (10, 100, 1_000, 10_000, 100_000):
        passed = truth.velocities(np.arange(n) == n - 1, words="exchange of velocities by equal elastic balls")
        yield Cell("chains", f"{n} balls, gaps", scenes.chain(n, gap=1e-3), passed, rule=ELASTIC_RULE, slow=n > 1_000,
                   options={"log": False, "max_events": 10 * n}, methods=("edmd",))
        for kept in (truth.energy(), truth.momentum()):
            yield Cell("chains", f"{n} touching balls, Hertz, t = 20", scenes.chain(n), kept, Hertz(1.0),
                       options={"log": False, "t_end": 20.0, "max_steps": 200_000, "samples": None},
                       methods=SOFT_METHODS, slow=n > 10)


def counts(draws: int = 8) -> Iterator[Cell]:
    """Equal elastic balls, whose number of contacts is known.

    They exchange velocities as if they passed through each other. The contacts last 1e-7 s and do not overlap in time.
    """
    each: list[tuple[str, Scene, int, Array]] = []
    for n, seed in product((2, 3, 4, 5, 8, 12), range(draws)):
        rng = np.random.default_rng([n, seed])
        v, gap = np.sort(rng.uniform(0.1, 1.0, n)), rng.uniform(0.1, 1.0, n)
        back, free = np.insert(v, 0, 0.0), Scene(np.ones(n), np.full(n, 0.1), gap[1:], v[::-1])
        each += [
            (f"{n} balls, all collide once, draw {seed}", free, n * (n - 1) // 2, v),
            (f"{n} balls, slow balls hit the wall first, draw {seed}", at_wall(gap, -v), n * n, back),
            (f"{n} balls, fast balls hit the wall first, draw {seed}", at_wall(gap, -v[::-1]), n * (n + 1) // 2, back),
        ]
    for n in range(2, 13):
        scene = at_wall(np.full(n, 0.1), [-1.0] * n, [2.0 / (k * (k + 1.0)) for k in range(1, n + 1)])
        each.append((f"each of {n} falling balls passes on all its momentum", scene, n, n * (np.arange(n + 1.0) == n)))
    for case, scene, many, after in each:
        yield Cell("counts", case, scene, known_outcome(many, after), LinearDashpot(1e14), ELASTIC_RULE,
                   options={"max_steps": 50_000}, methods=DEFAULT_METHODS)


@compared_with("number of contacts of balls that pass through each other")
def known_outcome(run: Trajectory, rerun: Rerun, many: int, velocity: Array) -> float:
    """Relative error of the final velocities in m/s.

    The error is infinite for another number of contacts.
    """
    off = float(np.abs(run.velocity[-1] - velocity).max() / np.abs(velocity).max())
    return off if len(run.contacts) == many else math.inf


COMPARED_FIELDS = ("t_begin", "duration", "v_out", "xi_max", "force_max", "impulse")
"""Fields of each contact that are compared in addition to its pair."""


@cache
def stored_scenes() -> tuple[dict[str, Any], ...]:
    """Lines solved by an independent solver in 18 digits.

    The solver of tests/helpers/fuzz uses long doubles and shares no code with the engines.
    ``python -m bench.stability.recorded`` writes the file.
    """
    return tuple(json.loads(Path(__file__).with_name("recorded.json").read_text("utf-8")))


def recorded() -> Iterator[Cell]:
    """Stored lines with difficult contacts.

    They contain second contacts inside an overlap, own laws in chains, reloading, simultaneous contacts and steep laws.
    The plain laws are written as users write them.
    """
    known = {name: getattr(built_in, name) for name in built_in.__all__} | vars(own)
    for i, one in enumerate(stored_scenes()):
        mass = [math.inf if m is None else m for m in one["mass"]]
        scene = Scene(mass, [0.0 if m == math.inf else 0.5 for m in mass], one["gap"], one["velocity"])
        names = ", ".join(dict.fromkeys(name for name, *_ in one["laws"]))
        yield Cell("recorded", f"{one['kind']}, scene {i}: {names}", scene, recorded_outcome(one),
                   [known[name](*numbers) for name, *numbers in one["laws"]],
                   options={"t_end": one["t_end"], "max_steps": 50_000})


@compared_with("independent solver with 18 digits")
def recorded_outcome(run: Trajectory, rerun: Rerun, one: Mapping[str, Any]) -> float:
    """Largest error of the contacts and of the final velocities.

    Errors are in units of scale times condition number. For another sequence of pairs the error is infinite.
    """
    rows = np.sort(run.contacts, order=("pair", "t_begin"))
    if rows["pair"].tolist() != one["pair"]:
        return math.inf
    found = {"final": run.velocity[-1]} | {name: rows[name].ravel() for name in COMPARED_FIELDS}
    return float(max(np.abs(found[name] - one[name]).max() / one["unit"][name] for name in found))

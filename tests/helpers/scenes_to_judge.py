"""Random scenes of every kind for the judge, with laws, a rule for hard spheres, and an end at any time."""

import math

import numpy as np

import granular as gr
from tests.helpers.own_laws import OwnDashpot

INF = math.inf
KINDS = ("free", "floor", "box", "drop", "ring", "pendula", "sine", "piecewise", "thermal", "touching", "resting")
LAWS = ("dashpot", "hertz", "viscoelastic", "tsuji", "power", "own")


def scene_of(kind, rng):
    """A scene of this kind and about how long it is worth looking at, in s."""
    few = kind in ("sine", "piecewise", "resting")  # many of those ride for long
    n = int(rng.integers(1, 4) if few else rng.integers(2, 11 if rng.random() < 0.3 else 6))
    mass = [1.0] * n if rng.random() < 0.4 else np.exp(rng.uniform(-1.5, 1.5, n)).tolist()
    gap = (10.0 ** rng.uniform(-4.5, -0.5, n + 1)).tolist()
    v = rng.uniform(-1.0, 1.0, n).tolist()
    radius = [0.05] * n
    floor, ceiling = {}, {}
    if kind == "free":
        v = sorted(v, reverse=True) if rng.random() < 0.5 else v
        return gr.Scene(mass, radius, gap[1:n], v), 1.0
    if kind == "floor":
        v = [-abs(x) for x in v]
        return gr.Scene([INF, *mass], [0.0, *radius], gap[:n], [0.0, *v]), 1.0
    if kind == "drop":
        lowest = float(rng.uniform(0.01, 0.3))
        v = [0.0] * n if rng.random() < 0.5 else v
        return gr.Scene([INF, *mass], [0.0, *radius], [lowest, *gap[1:n]], [0.0, *v], gravity=9.81), 0.6
    if kind == "ring":
        return gr.Scene(mass, [0.0] * n, gap[:n], v, ring=True), 0.5
    if kind == "pendula":
        gap = [float(rng.choice([1e-4, 1e-2, 0.05])) * x for x in rng.uniform(0.5, 1.5, n - 1)]
        return gr.Scene(mass, radius, gap, v, pendulum=3.0), 1.0
    if kind in ("sine", "piecewise"):
        amplitude, rate = float(10.0 ** rng.uniform(-4, -2)), float(rng.uniform(1.0, 20.0))
        path = gr.walls.Piecewise([0.0, 0.2, 0.5, 500.0], [[0.3, -0.1, 0.0], [0.0, 0.06, 0.03]])
        floor = {"floor": gr.walls.Sine(amplitude, rate) if kind == "sine" else path}
        low = gr.Scene([INF, *mass], [0.0, *radius], gap[:n], [0.0, *[-abs(x) for x in v]], gravity=9.81, **floor)
        return low, 0.2
    if kind == "thermal":
        floor = {"floor": gr.walls.Thermal(1.0)}
        return gr.Scene([INF, *mass, INF], [0.0, *radius, 0.0], gap, [0.0, *v, 0.0], **floor, **ceiling), 0.6
    if kind == "touching":
        gap = [0.0 if rng.random() < 0.6 else g for g in gap[1:n]]
        v = [1.0, *[0.0] * (n - 1)] if rng.random() < 0.5 else rng.integers(-2, 3, n).tolist()
        return gr.Scene(mass, radius, gap, v), 0.5
    if kind == "resting":
        v = [0.0] * n
        gap = [0.0 if rng.random() < 0.8 else float(10.0 ** rng.uniform(-9, -3)) for _ in range(n)]
        return gr.Scene([INF, *mass], [0.0, *radius], gap, [0.0, *v], gravity=9.81), 0.1
    return gr.Scene([INF, *mass, INF], [0.0, *radius, 0.0], gap, [0.0, *v, 0.0]), 1.0


def laws_of(rng, scene):
    """A law for each pair, all of one kind."""
    kind, k, eps = str(rng.choice(LAWS)), float(10.0 ** rng.uniform(4.5, 9.5)), float(rng.uniform(0.3, 1.0))
    if scene.heated:
        eps = max(eps, 0.8)
    if scene.gravity > 0.0 and not scene.velocity.any():
        kind, eps = str(rng.choice(["dashpot", "tsuji"])), min(eps, 0.8)
    if kind == "dashpot":
        return [gr.LinearDashpot.from_restitution(eps, k, pair) for pair in scene.pairs]
    if kind == "hertz":
        return gr.Hertz(10.0 * k)
    if kind == "viscoelastic":
        return [gr.ViscoelasticHertz.from_restitution(max(eps, 0.5), 1.0, 10.0 * k, pair) for pair in scene.pairs]
    if kind == "tsuji":
        return gr.TsujiHertz.from_restitution(eps, 10.0 * k)
    if kind == "power":
        return gr.PowerLaw(k, float(rng.choice([1.0, 1.5, 2.0])))
    return OwnDashpot(k, 0.3 * math.sqrt(k) * float(rng.random()))


def end_of(rng, scene, law, rule, span):
    """A random time, or the onset of a contact in one of the runs, before or after it by up to some lags."""
    if rng.random() < 0.3:
        return float(span * rng.uniform(0.05, 1.0))
    runs = (gr.edmd.simulate(scene, rule, t_end=span, max_events=300),
            gr.md.simulate(scene, law, t_end=span, max_events=300))
    soft = runs[1].contacts
    onset = np.concatenate([run.contacts["t_begin"] for run in runs])
    if not len(onset) or not len(soft):
        return span
    lag = float(rng.choice(soft["duration"])) * float(10.0 ** rng.uniform(-2.0, 0.5))
    end = float(rng.choice(onset)) + float(rng.choice([-1.0, 1.0])) * lag
    return min(max(end, 1e-3 * span), span)


def question(kind, seed):
    """Scene, law and end of a number."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    scene, span = scene_of(kind, rng)
    law = laws_of(rng, scene)
    rule = gr.restitution_of(law)
    return scene, law, end_of(rng, scene, law, rule, span)

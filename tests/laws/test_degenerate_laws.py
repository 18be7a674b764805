"""Laws of one's own under which contacts creep, chatter or never part: every run ends, with a status or a sentence."""

import math

import numpy as np
import pytest

import granular as gr
from granular.md.fixed import run as fixed
from granular.md.located import pace

SPRINGS = {
    "none": lambda k: lambda xi: 0.0,
    "linear": lambda k: lambda xi: k * xi,
    "Hertz": lambda k: lambda xi: k * xi**1.5,
    "late": lambda k: lambda xi: k * max(0.0, xi - 1e-6),
    "weak": lambda k: lambda xi: min(10.0, k * xi),
    "constant": lambda k: lambda xi: 1e-3 * k,
    "stair": lambda k: lambda xi: 1e-6 * k * math.floor(xi / 1e-6),
}
DAMPINGS = {
    "dashpot": lambda g: lambda xi, v: g * v,
    "one way": lambda g: lambda xi, v: g * max(0.0, v),
    "plastic": lambda g: lambda xi, v: 1e-3 * g * math.tanh(v / 1e-6),
    "jump": lambda g: lambda xi, v: 1e-3 * g * (v > 0.0),
    "cubic": lambda g: lambda xi, v: g * v**3,
    "of spheres": lambda g: lambda xi, v: g * math.sqrt(xi) * v,
}
SCENES = {
    "drop": (gr.scenes.three_balls(gap=1e-4, height=0.1001), {"t_end": 0.02}),
    "pile": (gr.Scene([math.inf, 1.0, 0.5], [0.0, 0.1, 0.1], [-1e-5, -1e-4], [0.0] * 3, gravity=9.81), {"t_end": 0.05}),
    "row": (gr.Scene([1.0, 0.5, 2.0], [0.1] * 3, [1e-4, 0.0], [1.0, 0.0, -1.0]), {}),
    "walls": (gr.Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [1e-3, 1e-3], [0.0, 1.0, 0.0]), {"t_end": 0.01}),
}
MOST = 3_000_000


class Endless(Exception):
    pass


class Degenerate:
    """A spring and a damping, drawn at random, that refuse to be asked forever."""

    def __init__(self, rng):
        self.words = str(rng.choice(list(SPRINGS))), str(rng.choice(list(DAMPINGS)))
        k, g = 10.0 ** rng.uniform(0.0, 8.0), 10.0 ** rng.uniform(-1.0, 8.0)
        self.spring, self.damping = SPRINGS[self.words[0]](k), DAMPINGS[self.words[1]](g)
        self.asked = 0

    def force(self, xi, xi_dot, pair):
        self.asked += 1
        if self.asked > MOST:
            raise Endless(self.words)
        return self.spring(xi) + self.damping(xi, xi_dot)


def ended(scene, law, **how):
    """How a run ended: its status, or the sentence with which it was refused."""
    try:
        run = gr.md.simulate(scene, law, **how)
    except ValueError as refusal:
        return str(refusal)
    assert run.time[-1] <= how.get("t_end", math.inf)
    assert run.status.name == "unstable" or np.isfinite(run.gap).all()
    if run.status.name == "max_events":
        assert "contacts creep or chatter" in run.message
    return run.status.name


@pytest.mark.rotating
@pytest.mark.parametrize("seed", [*range(2), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(2, 40))])
@pytest.mark.filterwarnings("ignore:dt = .* s times")
def test_every_run_ends(monkeypatch, seed):
    """In a number of force calls that does not depend on how strongly contacts creep."""
    monkeypatch.setattr(pace, "TRIALS_PER_TEST", 40)
    monkeypatch.setattr(pace, "MIN_PROGRESS_SHARE", 0.2)
    law = Degenerate(np.random.default_rng([31, seed]))
    for scene, end in SCENES.values():
        law.asked = 0
        assert ended(scene, law, **end)
        for method in ("verlet", "gear5"):
            law.asked = 0
            assert ended(scene, law, dt=1e-4, method=method, **{"t_end": 0.02} | end)


def own(force, **members):
    return type("Own", (), {"force": force, "__repr__": lambda self: "Own()"} | members)()


@pytest.mark.rotating
def test_contacts_that_creep_end_by_the_limit_and_can_be_gone_on_from(monkeypatch):
    monkeypatch.setattr(pace, "TRIALS_PER_TEST", 30)
    law = own(lambda self, xi, xi_dot, pair: 1e7 * xi**1.5 + 1e7 * xi_dot)
    scene, end = SCENES["pile"]
    run = gr.md.simulate(scene, law, **end)
    assert run.status.name == "max_events"
    assert run.message.endswith("s per trial step on average; use weaker damping or a force without a jump at rest, or "
                                "continue with granular.md.resume")
    on = gr.md.resume(run, t_end=0.05)
    assert run.time[-1] < on.time[-1] < 0.05
    whole = gr.md.simulate(scene, law, t_end=float(on.time[-1]))  # the net changes nothing that is found
    assert whole.gap[-1] == pytest.approx(on.gap[-1], rel=1e-12)
    assert whole.status.name == "time"


@pytest.mark.rotating
def test_kinks_without_number_are_no_creeping():
    saw = own(lambda self, xi, xi_dot, pair: 1e7 * xi * (1.0 + 0.5 * (xi / 2e-4 % 1.0)) + 10.0 * xi_dot)
    assert gr.md.simulate(SCENES["row"][0], saw).status.name == "quiet"


@pytest.mark.parametrize("force", [
    lambda self, xi, xi_dot, pair: 1e7 * xi_dot,
    lambda self, a, b, pair: 1e3 * math.tanh(b),
    lambda self, xi, xi_dot, pair: 1e7 * xi_dot - 1e-3,
    lambda self, xi, xi_dot, pair: max(0.0, xi_dot),
])
@pytest.mark.parametrize("how", [{}, {"dt": 1e-4}])
@pytest.mark.parametrize("scene", SCENES)
def test_force_that_hangs_on_the_rate_alone(scene, how, force):
    words = r", Own\(\), must repel bodies at rest at some overlap, got a force of .* N at rate .* m/s at every overlap"
    fix = r"Check that the arguments of `force` are \(xi, xi_dot, pair\)\."
    with pytest.raises(ValueError, match=words + r", and none at rest\. " + fix):
        gr.md.simulate(SCENES[scene][0], own(force), t_end=0.02, **how)


def test_trait_without_a_spring():
    law = own(lambda self, xi, xi_dot, pair: 1e7 * xi_dot, linear=lambda self, pair: (0.0, 1e7))
    with pytest.raises(ValueError, match=r"The law of pair 0–1, Own\(\), must repel bodies at rest at some overlap, "
                                         r"got a force of 10000000\.0 N at rate 1 m/s at every overlap, and none "
                                         r"at rest\. Check that the arguments of `force` are \(xi, xi_dot, pair\)\."):
        gr.md.simulate(SCENES["row"][0], law)


@pytest.mark.parametrize("how", [{}, {"dt": 1e-4}])
def test_force_that_is_not_a_pure_function(how):
    calls, rng = iter(range(10**9)), np.random.default_rng(0)
    changing = {
        "counts": lambda self, xi, xi_dot, pair: 1e7 * xi * (1.0 + 1e-6 * next(calls)),
        "chance": lambda self, xi, xi_dot, pair: 1e7 * xi**1.5 * (1.0 + 0.01 * rng.random()),
    }
    words = r"must be a pure function, without state or randomness, got \S+ and \S+ N from two calls with "
    for force in changing.values():
        with pytest.raises(ValueError, match=words + r"ξ = \S+ m and ξ̇ = \S+ m/s\."):
            gr.md.simulate(SCENES["row"][0], own(force), t_end=0.02, **how)


@pytest.mark.rotating
@pytest.mark.parametrize("how", [{"t_end": 0.5}, {"t_end": 0.05, "dt": 1e-6}])
def test_a_run_tells_how_far_it_is_however_slow_its_steps_are(monkeypatch, how):
    """A ball that overlaps from the start, and no contact ends: after a look that took a second fewer steps follow."""
    told, clock = {}, iter(range(10**9))
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [-1e-6], [0.0, 0.0], gravity=9.81)
    for slow in (True, False):
        monkeypatch.setattr(pace, "process_time", (lambda: float(next(clock))) if slow else lambda: 0.0)
        monkeypatch.setattr(fixed, "process_time", (lambda: float(next(clock))) if slow else lambda: 0.0)
        seen = []
        run = gr.md.simulate(scene, gr.Hertz(1e8), engine="plain", **how,
                             on_progress=lambda reached, count, seen=seen: seen.append(reached))
        assert run.status.name in ("time", "quiet")
        told[slow] = seen, run.gap[-1].tobytes(), run.stats["steps"]
    assert told[True][1] == told[False][1]
    assert len(told[True][0]) > 2 * len(told[False][0]) > 2
    assert told[True][0] == sorted(told[True][0])

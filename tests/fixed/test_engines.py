"""Fixed-step methods: interpreted or compiled, one window or many, in one go or in pieces: the same bits."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

import granular as gr
from granular.md.fixed import abreast
from granular.md.fixed.integrators import INTEGRATORS
from granular.md.fixed.stepper import Stepper
from tests.helpers.condition import response
from tests.helpers.own_laws import OwnDashpot

ALL = tuple(INTEGRATORS)
run = partial(gr.md.simulate, method="verlet")


@dataclass(frozen=True)
class OwnPower:
    """Computed with a power that may overflow."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * math.pow(xi, 1.75)


@dataclass(frozen=True)
class Swapped(OwnDashpot):
    """The same force, rounded otherwise."""

    def force(self, xi, xi_dot, pair):
        return (xi + self.gamma / self.k * xi_dot) * self.k


TO_COMPILE = dict.fromkeys(ALL, (0, 1, 2)) | {"verlet": (0, 1, 2, 3, 6, 8)}
"""Which of the laws in `drawn` run compiled, too: of each kind one, but such as are a C function with one method."""


LONG = {"verlet": (0, 3, 5, 7), "symplectic-euler": (3, 4, 10), "rk4": (2, 4, 5, 7), "gear5": (0, 5, 8)}
"""Seeds of chains that go in windows, by method: laws of all kinds, few contacts allowed or any number."""
SELDOM = ("symplectic-euler", "gear5")
"""Their machine code is made in the soak only."""


def same(one, other):
    """Same bits, also in what is judged from notes made on the way."""
    for name in ("time", "position", "velocity", "gap", "force"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.contacts.tobytes() == other.contacts.tobytes()
    for name in ("dt_lambda", "steps", "flights", "contacts", "shared_impulse"):
        np.testing.assert_equal(one.stats[name], other.stats[name])
    assert (one.status, one.message) == (other.status, other.message)


def some_chain(seed):
    """A random chain, some of it touching or overlapping, of one block or several, and laws that go in blocks."""
    random = np.random.default_rng(seed)
    n = int(random.choice([2, 3, 7, 40, 390, 900]))
    mass = np.exp(random.uniform(-1.0, 1.0, n))
    mass[0] = random.choice([mass[0], math.inf])
    v = np.where(np.isinf(mass), 0.0, random.normal(size=n) * (random.random(n) < 0.5))
    gap = random.choice([0.0, -2e-4, 1e-3, 1e-2], n - 1) * random.uniform(0.5, 1.0, n - 1)
    gravity = random.choice([0.0, 9.81]) * np.isinf(mass[0])
    scene = gr.Scene(mass, np.where(np.isinf(mass), 0.0, 0.1), gap, v, gravity)
    gamma = random.choice([0.0, 30.0])
    build = [
        lambda k: gr.Hertz(k), lambda k: gr.LinearDashpot(k, gamma), lambda k: gr.ViscoelasticHertz(k, gamma),
        lambda k: OwnDashpot(k, gamma),
    ][seed % 4]
    return scene, [build(1e6)] * (n - 1) if seed % 3 else [build(k) for k in 1e6 * np.exp(random.normal(size=n - 1))]


def in_windows(patch, pairs):
    """Let every window stand for so many pairs; a window of an interpreted run has room for all."""
    make = Stepper.__init__

    def make_in_windows(self, *given, **named):
        make(self, *given, **named)
        self.physics = self.physics._replace(block=pairs)

    patch.setattr(Stepper, "__init__", make_in_windows)


def drawn(seed):
    """A small scene, laws for it, and a way to run it; every third one far beyond the limit of stability."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 9))
    mass = np.exp(random.uniform(-1.0, 1.0, n))
    mass[0] = random.choice([mass[0], math.inf])
    wall = np.isinf(mass)
    v = np.where(wall, 0.0, random.normal(size=n) * (random.random(n) < 0.6))
    gap = random.choice([0.0, -2e-3, 1e-4, 1e-2], n - 1) * (1e60 if seed % 6 == 0 else 1.0)
    scene = gr.Scene(mass, np.where(wall, 0.0, 0.1), gap, v, random.choice([0.0, 9.81]) * wall[0])
    k, gamma = 10.0 ** random.uniform(3.0, 6.0), random.choice([0.0, 20.0])
    laws = [
        gr.LinearDashpot(k, gamma), gr.Hertz(k), gr.ViscoelasticHertz(k, gamma), gr.TsujiHertz(k, 0.3),
        gr.PowerLaw(k, 1.75), gr.PowerLaw(k, 3.0), gr.WaltonBraun(k, 2.0 * k), OwnDashpot(k, gamma), OwnPower(k),
        Swapped(k, gamma), [(gr.Hertz(k), gr.LinearDashpot(k, gamma))[c % 2] for c in range(n - 1)],
    ]
    t_end = float(random.uniform(0.01, 0.1))
    dt = float(10.0 ** random.uniform(-1.5, 1.0) if seed % 3 == 0 else random.uniform(0.1, 1.0)) / math.sqrt(k)
    options = {"t_end": t_end if seed % 3 else 1000.0 * dt, "dt": dt, "log": bool(random.random() < 0.7)}
    options["samples"] = [None, 7][int(random.integers(2))]
    pair, nth = int(random.integers(n - 1)), int(random.integers(1, 4))
    more = [{}, {"until": gr.until.contact(pair, nth)}, {"max_events": int(random.integers(1, 9))}]
    return scene, laws, options | more[int(random.integers(3))]


@pytest.mark.rotating
@pytest.mark.filterwarnings("ignore:dt = ", "ignore:invalid value", "ignore:overflow")
@pytest.mark.parametrize("third", range(3))
@pytest.mark.parametrize("machine_code", ["some", pytest.param("all", marks=pytest.mark.soak)])
@pytest.mark.parametrize("method", ["verlet", "rk4", *(pytest.param(method, marks=pytest.mark.soak) for method in
                                                       ("symplectic-euler", "gear5"))])
def test_engines_and_windows_give_the_same_bits(method, machine_code, third, monkeypatch):
    """Random scenes under a third of the laws, with and without log, samples, stop conditions; also past overflow.

    Outside the soak only the first law is compiled without a log, too: a kernel takes 2 s to compile.
    """
    beyond = 0
    for seed in range(24):
        scene, laws, options = drawn(seed)
        for number, law in enumerate(laws):
            if ((number + seed) % 4 and seed) or (number + number // 3) % 3 != third:
                continue
            given = partial(run, scene, law, method=method, **options)
            plain = given(engine="plain")
            beyond += not np.isfinite(plain.velocity).all()
            if number in TO_COMPILE[method] and (machine_code == "all" or options["log"] or number == 0):
                same(plain, given(engine="compiled"))
            with monkeypatch.context() as patch:
                in_windows(patch, 1 + seed % 3)
                same(plain, given(engine="plain"))
    assert beyond > 0


@pytest.mark.rotating
@pytest.mark.filterwarnings("ignore:dt = ")
@pytest.mark.parametrize(("method", "seed"), [
    pytest.param(method, seed, marks=[pytest.mark.soak] * (method in SELDOM))
    for method, seeds in LONG.items() for seed in seeds
])
def test_long_chains_give_the_bits_of_one_window(method, seed, monkeypatch):
    """Compiled, a long chain goes in windows; interpreted it is one."""
    scene, law = some_chain(seed)
    few = {"max_events": 1 + 5 * scene.n} if seed % 5 == 0 else {}
    for log in (True, False):
        options = {"method": method, "t_end": 0.004, "dt": 1e-4, "log": log, "samples": 3} | few
        plain = run(scene, law, engine="plain", **options)
        with monkeypatch.context() as patch:
            in_windows(patch, 274)
            same(plain, run(scene, law, engine="compiled", **options))


@pytest.mark.rotating
@pytest.mark.parametrize(("ring", "options"), [
    pytest.param(ring, options, marks=[pytest.mark.soak] * (ring and "log" not in options))
    for ring in (False, True)
    for options in ({"log": False}, {"samples": 5}, {"until": gr.until.contact(200, 2)}, {"max_events": 300})
])
def test_however_many_threads_step_a_chain_the_bits_are_the_same(ring, options, monkeypatch):
    """Windows, logs and limits as in one thread; a row at rest is hit on the way."""
    n, random = 900, np.random.default_rng(7)
    gap, v = np.where(random.random(n) < 0.3, 0.0, random.uniform(0.0, 1e-2, n)), random.normal(size=n)
    gap[300:320], v[301:320] = 0.0, 0.0
    scene = gr.Scene([1.0] * n, [0.1] * n, gap[: n - 1 + ring], v, ring=ring)
    monkeypatch.setattr(Stepper, "_block", lambda self: 90)
    runs, met = [], 0

    def counted(*given):
        nonlocal met
        met += 1
        return take_steps(*given)

    take_steps = abreast.MARCH_REPLACEMENTS["take_steps"]
    monkeypatch.setitem(abreast.MARCH_REPLACEMENTS, "take_steps", counted)
    for parts in (1, 2, 5):
        monkeypatch.setattr(abreast, "parts", lambda pairs, parts=parts: parts)
        runs.append(run(scene, gr.LinearDashpot(1e5, 5.0), dt=2e-4, t_end=0.05, engine="compiled", **options))
        assert (met > 0) is (parts > 1)
    same(*runs[:2])
    same(*runs[1:])
    assert runs[0].stats["contacts"] > 100


def test_short_chains_are_stepped_in_one_thread(monkeypatch):
    monkeypatch.setattr(abreast, "cores", lambda: 8)
    assert [abreast.parts(pairs) for pairs in (1, 39_999, 40_000, 60_000, 10**6)] == [1, 1, 2, 3, 8]


def test_a_log_that_is_full_is_handed_over_in_time(monkeypatch):
    """More contacts end at once than windows have room for."""
    scene, law = gr.scenes.gas(n=12, seed=2), gr.LinearDashpot(1e6)
    one = run(scene, law, dt=1e-5, t_end=1.0, engine="plain")
    in_windows(monkeypatch, 3)
    same(one, run(scene, law, dt=1e-5, t_end=1.0, engine="plain"))


@pytest.mark.rotating
def test_windows_stop_at_max_events_as_a_chain_does(monkeypatch):
    scene = gr.scenes.newtons_cradle(40)
    for few in (1, 2, 17, 37):
        options = {"max_events": few, "log": False, "dt": 2e-5, "engine": "plain"}
        one = run(scene, gr.Hertz(1e9), **options)
        with monkeypatch.context() as patch:
            in_windows(patch, 9)
            same(one, run(scene, gr.Hertz(1e9), **options))


def test_a_law_with_a_form_runs_by_its_form_in_every_engine():
    """Also if its own force is rounded otherwise."""
    scene = gr.scenes.newtons_cradle(3)
    for seed in range(10):
        k, gamma = np.random.default_rng(seed).uniform(1e6, 1e7, 2) * (1.0, 1e-4)
        simulated = partial(run, t_end=0.1, dt=2e-5, engine="plain")
        law = gr.LinearDashpot(k, gamma)
        laws = law, OwnDashpot(law.k, law.gamma), Swapped(law.k, law.gamma)
        by_form, own, swapped = (simulated(scene, one) for one in laws)
        same(own, by_form)
        moved = response(lambda one, law=law, simulated=simulated: simulated(one, law).velocity, scene)
        assert (np.abs(swapped.velocity - own.velocity) <= 2.0**-51 * (1.0 + moved)).all()

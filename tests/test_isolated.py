"""Isolated contacts, solved as one event each: against closed forms in 30 digits, and against pieces (`soft_twin`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scenes_at_random as at_random
from soft_twin import distance, in_other_units, nudged, twin

import granular as gr
from granular.md.located.one_contact import tables

mpmath = pytest.importorskip("mpmath")
MP = mpmath.MPContext()
MP.dps = 30
INF = math.inf


# ---- one contact of a ball and a wall, or of two balls, in many digits


@dataclass
class Exact:
    """A contact as `maps.encounter` describes it: times and speeds of the ends of force and overlap, and peaks."""

    t1: Any
    t2: Any
    v1: Any
    v2: Any
    xi_max: Any
    force_max: Any


def bisected(f: Callable[[Any], Any], low: Any, high: Any) -> Any:
    """Where f falls through zero."""
    for _ in range(150):
        middle = (low + high) / 2
        low, high = (middle, high) if f(middle) > 0 else (low, middle)
    return low


def after_force(t1: Any, xi: Any, v1: Any, pull: Any) -> tuple[Any, Any]:
    """When and how fast the overlap `xi` that is left at t1 has run off."""
    v2 = MP.sqrt(v1 * v1 - 2 * pull * xi)
    return t1 + 2 * xi / (v1 + v2), v2


def dashpot(law: gr.LinearDashpot, m: Any, v: Any, pull: Any) -> Exact:
    """Damped oscillation about its equilibrium, by complex exponentials."""
    k, gamma = MP.mpf(law.k), MP.mpf(law.gamma)
    rest, lam = pull * m / k, gamma / (2 * m)
    root = MP.sqrt(MP.mpc(lam * lam - k / m))
    one, two = -lam + root, -lam - root
    b = (v + one * rest) / (two - one)  # of y = a e^(one t) + b e^(two t), y(0) = -rest, y'(0) = v
    a = -rest - b

    def xi(t: Any) -> Any:
        return MP.re(a * MP.exp(one * t) + b * MP.exp(two * t)) + rest

    def rate(t: Any) -> Any:
        return MP.re(a * one * MP.exp(one * t) + b * two * MP.exp(two * t))

    def force(t: Any) -> Any:
        return k * xi(t) + gamma * rate(t)

    def slope(t: Any) -> Any:
        return k * rate(t) + gamma * (pull - force(t) / m)

    turn = bisected(rate, MP.mpf(0), MP.pi * MP.sqrt(m / k))
    t1 = bisected(force, turn, turn + 4 * MP.sqrt(m / k))
    top = bisected(slope, MP.mpf(0), turn) if slope(MP.mpf(0)) > 0 else MP.mpf(0)
    t2, v2 = after_force(t1, xi(t1), -rate(t1), pull)
    return Exact(t1, t2, -rate(t1), v2, xi(turn), max(force(top), gamma * v))


def elastic(force: Callable[[Any], Any], energy: Callable[[Any], Any]) -> Callable[..., Exact]:
    """The contact of any potential: t = 2 ∫ dξ/ξ̇, with ξ = ξ_max (1 - u²), which is smooth at the turn."""

    def exact(law: Any, m: Any, v: Any, pull: Any) -> Exact:
        def left(xi: Any) -> Any:
            return v * v + 2 * pull * xi - 2 * energy(xi) / m

        high = MP.mpf(1)
        while left(high) > 0:
            high *= 2
        deep = bisected(left, MP.mpf(0), high)
        slope = 2 * (force(deep) / m - pull)

        def integrand(u: Any) -> Any:
            xi = deep * (1 - u * u)
            return 2 * deep * u / MP.sqrt(left(xi)) if u > MP.mpf(10) ** -12 else 2 * MP.sqrt(deep / slope)

        t = 2 * MP.quad(integrand, [0, MP.mpf(1) / 2, 1])
        return Exact(t, t, v, v, deep, force(deep))

    return exact


def power(k: Any, p: Any) -> Callable[..., Exact]:
    return elastic(lambda x: MP.mpf(k) * x ** MP.mpf(p), lambda x: MP.mpf(k) * x ** (MP.mpf(p) + 1) / (MP.mpf(p) + 1))


def similar(k: Any, p: Any, gamma: Any) -> Callable[..., Exact]:
    """F = k ξ^p + γ ξ^d ξ̇, d = (p-1)/2: s = ξ^((p+1)/2) swings as a dashpot in the time dτ = ξ^d dt."""

    def exact(law: Any, m: Any, v: Any, pull: Any) -> Exact:
        assert pull == 0
        kk, pp, g = MP.mpf(k), MP.mpf(p), MP.mpf(gamma)
        omega = MP.sqrt((pp + 1) * kk / (2 * m))
        zeta = g / MP.sqrt(2 * (pp + 1) * kk * m)
        swing, beta, h = omega * MP.sqrt(1 - zeta**2), (pp - 1) / (pp + 1), (pp + 1) / 2

        def s(tau: Any) -> Any:
            return h * v / swing * MP.exp(-zeta * omega * tau) * MP.sin(swing * tau)

        def ds(tau: Any) -> Any:
            lean = zeta * omega / swing
            return h * v * MP.exp(-zeta * omega * tau) * (MP.cos(swing * tau) - lean * MP.sin(swing * tau))

        end = 2 * MP.atan2(MP.sqrt(1 - zeta**2), zeta) / swing
        turn = end / 2
        t1 = MP.quad(lambda tau: s(tau) ** -beta, [0, turn, end])
        v1 = -ds(end) / h
        xi = s(end) ** (1 / h)

        def force(tau: Any) -> Any:
            return s(tau) ** beta * (kk * s(tau) + g * ds(tau) / h)

        low, high = MP.mpf(0), turn
        for _ in range(120):
            a, b = low + (high - low) / 3, high - (high - low) / 3
            low, high = (a, high) if force(a) < force(b) else (low, b)
        return Exact(t1, t1 + xi / v1, v1, v1, s(turn) ** (1 / h), force(low))

    return exact


def walton_braun(law: gr.WaltonBraun, m: Any, v: Any, pull: Any) -> Exact:
    """Two arcs about two equilibria."""
    k1, k2 = MP.mpf(law.k_load), MP.mpf(law.k_unload)
    w1, w2 = MP.sqrt(k1 / m), MP.sqrt(k2 / m)
    rest = pull / w1**2
    top = rest + MP.sqrt(rest**2 + (v / w1) ** 2)
    gone = top * (1 - k1 / k2)
    low = pull / w2**2
    wide = top - gone - low
    angle = MP.acos(-low / wide)
    t1, v1 = (MP.pi / 2 + MP.atan(rest * w1 / v)) / w1 + angle / w2, wide * w2 * MP.sin(angle)
    t2, v2 = after_force(t1, gone, v1, pull)
    return Exact(t1, t2, v1, v2, top, k1 * top)


def stiffening(law: Any, m: Any, v: Any, pull: Any) -> Exact:
    k, k3 = MP.mpf(law.k), MP.mpf(law.k3)
    return elastic(lambda x: k * x + k3 * x**3, lambda x: k * x * x / 2 + k3 * x**4 / 4)(law, m, v, pull)


def softening(law: Any, m: Any, v: Any, pull: Any) -> Exact:
    k, x0 = MP.mpf(law.k), MP.mpf(law.x)
    return elastic(
        lambda x: k * x * (1 + x0 / (x0 + x)), lambda x: k * (x * x / 2 + x0 * (x - x0 * MP.log(1 + x / x0)))
    )(law, m, v, pull)


def cases() -> list[Any]:
    """(law, gravity, exact contact, digits)."""
    rng = np.random.default_rng(13)
    m, out = 1.0, []
    for zeta in (0.0, 1e-3, 0.1, 0.45, 0.55, 0.97, 1.0, 3.0):
        k = 10.0 ** rng.uniform(4.0, 9.0)
        law = gr.LinearDashpot(k, 2.0 * zeta * math.sqrt(k * m))
        out += [(law, 0.0, dashpot, 5e-15)] + [(law, 9.81, dashpot, 5e-15)] * (zeta < 0.5)
    for p in (1.5, 1.25, 2.0, 3.0):
        k = 10.0 ** rng.uniform(6.0, 10.0)
        law = gr.Hertz(k) if p == 1.5 else gr.PowerLaw(k, p)
        out += [(law, 0.0, power(k, p), 2e-15), (law, 9.81, power(k, p), 1e-14)]
    for alpha in (0.02, 0.3, 1.0, 1.9):
        k = 10.0 ** rng.uniform(6.0, 9.0)
        out.append((gr.TsujiHertz(k, alpha), 0.0, similar(k, 1.5, alpha * math.sqrt(k * m)), 4e-15))
    for ratio in (1.7, 9.0):
        law = gr.WaltonBraun(1e6, 1e6 * ratio)
        out += [(law, 0.0, walton_braun, 3e-14), (law, 9.81, walton_braun, 3e-14)]
    out += [(at_random.Stiffening(1e6, 1e12, 0.0), g, stiffening, 1e-14) for g in (0.0, 9.81)]
    out.append((at_random.Softening(1e6, 1e-3), 9.81, softening, 1e-14))
    return out


@pytest.mark.thirds
@pytest.mark.parametrize(("law", "gravity", "exact", "digits"), cases(), ids=lambda x: getattr(x, "__name__", str(x)))
def test_contact_against_thirty_digits(law, gravity, exact, digits, monkeypatch):
    """Duration, speeds, impulse, peaks, and where the ball is when all is over: delay and displacement."""
    monkeypatch.setattr(tables, "WARM", 1)
    gap, speed = 2.0**-10, 1.375
    scene = gr.Scene([INF, 1.0], [0.0, 0.1], [gap], [0.0, -speed], gravity)
    v = MP.sqrt(MP.mpf(speed) ** 2 + 2 * MP.mpf(gravity) * MP.mpf(gap))
    true = exact(law, MP.mpf(1), v, MP.mpf(gravity))
    onset = 2 * MP.mpf(gap) / (v + MP.mpf(speed))
    late = float(onset + true.t2 + true.v2 / 8 / max(gravity, 1))
    run = gr.md.simulate(scene, law, t_end=late, engine="plain")
    (row,) = run.contacts
    assert run.stats["isolated"] == 1
    by_pieces = type(law).__module__ == at_random.__name__  # the table of an own law may, by a rounding, not hold
    assert run.stats["steps"] == 1 or by_pieces, "one event, no piece"
    g, dt = MP.mpf(gravity), MP.mpf(late) - onset - true.t2
    for name, found, expected in (
        ("duration", row["duration"], true.t1), ("v_in", -row["v_in"][1], v), ("v_out", row["v_out"][1], true.v1),
        ("xi_max", row["xi_max"], true.xi_max), ("force_max", row["force_max"], true.force_max),
        ("impulse", row["impulse"], v + g * true.t1 + true.v1), ("t_end", row["t_end"], onset + true.t1),
        ("gap", run.gap[-1, 0], true.v2 * dt - g * dt * dt / 2), ("velocity", run.velocity[-1, 1], true.v2 - g * dt),
    ):
        assert found == pytest.approx(float(expected), rel=digits, abs=0), name


LAWS = [*at_random.LAWS]




SLOW = ("own Hertz", "softening", "own dashpot", "own with memory")


@pytest.mark.thirds
@pytest.mark.parametrize("name", [pytest.param(x, marks=[pytest.mark.soak] * (x in SLOW)) for x in LAWS])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_contact_against_pieces(name, gravity, monkeypatch):
    """Of every law, damped too, at random speeds and masses; samples in the contact, its run-off and its neighbours."""
    monkeypatch.setattr(tables, "WARM", 1)
    rng = np.random.default_rng([LAWS.index(name), int(gravity)])
    for zeta in (0.02, 0.2):
        masses, v = rng.uniform(0.5, 2.0, 2), 10.0 ** rng.uniform(-0.5, 0.5)
        law = at_random.LAWS[name](10.0 ** rng.uniform(5.0, 7.0), zeta, 1.0)
        floor = [INF] if gravity else [float(masses[1])]
        radius = [0.0 if gravity else 0.1, 0.1, 0.1]
        scene = gr.Scene([*floor, masses[0], 1.5], radius, [1e-3 * v, 10.0], [0.0, -v, -v], gravity)
        first = twin(scene, law, until=gr.until.contact(0, 2), engine="plain", t_end=2e-3 + 0.2)
        begin, end = first.contacts[0]["t_begin"], first.contacts[0]["t_end"]
        times = [*begin + np.array([0.03, 0.4, 0.9, 1.02, 1.5]) * (end - begin), end + 9.0 * (end - begin)]
        options = {"t_end": times[-1], "samples": times, "engine": "plain"}
        new, old = gr.md.simulate(scene, law, **options), twin(scene, law, **options)
        assert new.stats["isolated"] == old.stats["isolated"] == 1
        assert new.stats["steps"] == 1 or new.stats["tables"] == 1  # which does not hold
        length, force = old.contacts["xi_max"].max(), old.contacts["force_max"].max()
        for field in ("duration", "impulse", "xi_max", "force_max"):
            assert new.contacts[field] == pytest.approx(old.contacts[field], rel=4e-14, abs=0), field
        assert new.contacts["v_out"] == pytest.approx(old.contacts["v_out"], rel=0, abs=4e-14 * v)
        assert new.velocity == pytest.approx(old.velocity, rel=0, abs=1e-13 * v)
        assert new.gap == pytest.approx(old.gap, rel=2e-14, abs=1e-13 * length)  # over ten metres
        assert new.force == pytest.approx(old.force, rel=0, abs=1e-12 * force)


@dataclass(frozen=True)
class Bent:
    """F = k ξ, and 21 times as stiff beyond ξ = x."""

    k: float
    x: float

    def force(self, xi: float, xi_dot: float, pair: gr.Pair) -> float:
        return self.k * xi + (20.0 * self.k * (xi - self.x) if xi > self.x else 0.0)


def test_a_law_that_bends_has_no_table_where_it_does(monkeypatch):
    """Not even beyond the last point of an octave of speeds."""
    monkeypatch.setattr(tables, "WARM", 1)
    law = Bent(1e6, 0.9995 / math.sqrt(2e6))
    scene = gr.Scene([1.0, 1.0], [0.1, 0.1], [1e-3], [0.99995, 0.0])
    new, old = (run(scene, law, engine="plain").contacts for run in (gr.md.simulate, twin))
    assert new["duration"] == pytest.approx(old["duration"], rel=1e-14)


@dataclass(frozen=True)
class DeadBand:
    """A soft skin, then nothing, then F = k (ξ - b)."""

    k: float
    a: float
    b: float

    def force(self, xi: float, xi_dot: float, pair: gr.Pair) -> float:
        if xi < self.a:
            return self.k * xi * (self.a - xi) / self.a
        return self.k * (xi - self.b) if xi > self.b else 0.0


@pytest.mark.parametrize("disturbed", ["resolve", "stop", "ignore"])
def test_a_force_that_comes_back_is_another_contact(disturbed, monkeypatch):
    """In one overlap: the table of such a law was one contact where pieces have three."""
    monkeypatch.setattr(tables, "WARM", 1)
    scene, law = gr.Scene([1.0, 1.0], [0.1, 0.1], [1e-3], [1.0, 0.0]), DeadBand(1e6, 1e-4, 2e-4)
    new, old = gr.md.simulate(scene, law, disturbed=disturbed), twin(scene, law)
    assert new.stats["contacts"] == old.stats["contacts"] == 3
    assert new.contacts["duration"] == pytest.approx(old.contacts["duration"], rel=1e-13)


def test_a_sample_at_the_onset_shows_the_force_that_sets_in():
    """Rows are right-continuous: a dashpot pushes with γ v at once."""
    law = gr.LinearDashpot(1e6, 50.0)
    scene = gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [2.0**-10, 1.0], [1.0, 0.0, 0.0])
    new, old = (run(scene, law, t_end=2.0**-8, samples=[0.0, 2.0**-10, 2.0**-9]) for run in (gr.md.simulate, twin))
    assert new.stats["isolated"] == new.stats["steps"] == 1
    assert new.force[:, 0].tolist() == [0.0, 50.0, pytest.approx(old.force[2, 0], rel=1e-13)]
    assert new.gap[1] == pytest.approx([0.0, 1.0], rel=1e-15)


def test_the_error_of_a_table_counts_where_it_is_used(monkeypatch):
    """Not where the contact is disturbed, and solved by pieces after all."""
    monkeypatch.setattr(tables, "WARM", 1)
    law, mass, radius = gr.ViscoelasticHertz(1e7, 100.0), [INF, 1.0, 1.0], [0.0, 0.1, 0.1]
    far, near = (gr.Scene(mass, radius, [1e-3, gap], [0.0, -1.0, -1.0], 9.81) for gap in (1.0, 1e-6))
    run = gr.md.simulate(far, law, t_end=0.05, engine="plain")
    assert run.stats["isolated"] == 1
    assert run.stats["error_estimate"] == run.state["tables"]["error"][0] > 0.0
    new, old = (run(near, law, until=gr.until.contact(1, 1), engine="plain") for run in (gr.md.simulate, twin))
    assert new.stats["tables"] == 1
    assert new.stats["error_estimate"] == old.stats["error_estimate"]


# ---- scenes


def hall(seed: int, names: Any, balls: tuple[int, int] = (2, 8)) -> tuple[gr.Scene, tuple[Any, ...]]:
    """Balls, walls, gravity, a ceiling that moves, gaps of all sizes, residual overlaps."""
    rng = np.random.default_rng([13, seed])
    ways = ("wide", "wide", "overlapping", "uneven", "touching")
    scene = at_random.scene(rng, balls, walls=(0.6, 0.4, 0.3), gaps=ways, size=10.0 ** rng.uniform(-5.0, -2.0))
    return scene, at_random.laws(rng, scene, names, (3.0, 8.0))


def agree(seed: int, scene: gr.Scene, laws: Any, shifts: int = 8, **options: Any) -> float:
    """The same contacts as by pieces, as far as rounding is not blown up by the scene itself; return how far apart.

    What rounding does is measured by pieces: of the start, and, in other units of length, all the way. Slow contacts
    take thousands of steps, whose roundings add up: at seed 1977, 3900 of them, both ways are wrong by 1e-11 against 34
    digits (9.6e-12 and -6.2e-12), a hundred times what an ulp at the start does.
    """
    new, old = gr.md.simulate(scene, laws, **options), twin(scene, laws, **options)
    speed, off = float(np.abs(scene.velocity).max()) + scene.gravity * 1e-3, distance(new, old)
    own, rng = 1e-15 * speed + 1e-300, np.random.default_rng(seed)
    if new.status is not old.status and new.stats["contacts"] == old.stats["contacts"] == options["max_events"]:
        return 0.0  # the last contact is over at once where it is one event
    for _ in range(shifts):
        if off <= 30.0 * own:
            break
        one, same, unit = nudged(rng, scene), laws, 1.0
        if all(type(law).__module__.startswith("granular.") for law in laws):
            unit = float(rng.uniform(0.5, 2.0))
            one, same = in_other_units(one, laws, unit)
        own = max(own, distance(twin(one, same, **options), old, unit))
    if own < INF:  # predictable at all
        assert off <= 30.0 * own
        for name in ("contacts", "isolated"):
            assert new.stats[name] == old.stats[name]
        assert new.status == old.status
    return off / own


@pytest.mark.thirds
@pytest.mark.parametrize("seed", [*range(12), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(12, 25))])
def test_scene_at_random_against_pieces(seed):
    """Counts, which of them are isolated, velocities; powers for the most part, for the others take long."""
    scene, laws = hall(seed, at_random.LAWS if seed % 8 == 0 else at_random.POWERS)
    agree(seed, scene, laws, engine="plain", t_end=20.0, max_events=6 if seed % 8 == 0 else 10, max_steps=5000)


def test_a_ball_that_falls_beside_an_island_keeps_its_digits():
    """The roundings of many steps of slow contacts below it were added up, all of one sign: 4e-13 m/s in 2 800."""
    scene, laws = hall(1977, at_random.POWERS)
    run = gr.md.simulate(scene, laws, until=gr.until.contact(2, 1), engine="plain")
    assert run.stats["steps"] > 500
    fell = scene.velocity[3] - scene.gravity * run.time[-1]
    body = run.state["bodies"][3]
    assert body["v"] - scene.gravity * (run.time[-1] - body["t"]) == pytest.approx(fell, rel=1e-15, abs=0)


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(20))
def test_scenes_at_random_against_pieces(batch):
    """A thousand of them; the median is at the scene's own response to an ulp."""
    pytest.importorskip("numba")
    off = [
        agree(seed, *hall(seed, at_random.POWERS), engine="compiled", t_end=20.0, max_events=60, max_steps=20_000)
        for seed in range(1000 + 50 * batch, 1050 + 50 * batch)
    ]
    assert np.median(off) <= 3.0


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(5000, 5060))
def test_own_laws_at_random_against_pieces(seed):
    """Of functions, and with memory."""
    scene, laws = hall(seed, at_random.LAWS, balls=(2, 5))
    agree(seed, scene, laws, engine="plain", t_end=20.0, max_events=20, max_steps=2000)


@pytest.mark.thirds
@pytest.mark.parametrize("seed", range(6))
def test_stops_and_ends_inside_contacts(seed):
    """A time in the middle of one, the nth onset, all parted, so many events: what goes on has its peaks so far."""
    rng = np.random.default_rng([14, seed])
    gravity = 9.81 * (seed % 2)
    wall = [INF] if gravity else [1.0]
    scene = gr.Scene([*wall, 1.0, 2.0, 0.7], np.zeros(4) if gravity else np.full(4, 0.1), rng.uniform(0.01, 0.04, 3),
                     [0.0, *rng.normal(size=3)], gravity)
    law = at_random.LAWS[at_random.POWERS[seed]](1e6, 0.05, 1.0)
    whole = twin(scene, law, max_events=9, engine="plain")
    done = whole.contacts[~np.isnan(whole.contacts["t_end"])]
    middles = [row["t_begin"] + part * (row["t_end"] - row["t_begin"]) for row in done for part in (0.2, 0.9)]
    scale = done["force_max"].max(initial=0.0)
    asked: list[dict[str, Any]] = [{"t_end": t} for t in middles[:8]]
    asked += [{"until": gr.until.contact(pair, 1), "t_end": 3.0} for pair in range(3)]
    asked += [{"until": gr.until.separated(), "t_end": middles[-1] if middles else 1.0}]
    for options in asked:
        new, old = (run(scene, law, engine="plain", **options) for run in (gr.md.simulate, twin))
        assert new.status == old.status, options
        assert new.time[-1] == pytest.approx(old.time[-1], rel=1e-14)
        assert len(new.contacts) == len(old.contacts)
        for field in ("pair", "t_begin", "t_end", "duration", "v_in", "v_out", "xi_max", "force_max", "impulse"):
            wanted = old.contacts[field]
            tiny = 1e-11 * float(np.nanmax(np.abs(wanted), initial=0.0))
            assert new.contacts[field] == pytest.approx(wanted, rel=1e-12, abs=tiny, nan_ok=True), (field, options)
        assert new.velocity[-1] == pytest.approx(old.velocity[-1], rel=0, abs=1e-11)
        assert new.gap[-1] == pytest.approx(old.gap[-1], rel=0, abs=1e-13)
        assert new.force[-1] == pytest.approx(old.force[-1], rel=0, abs=1e-9 * scale)


@pytest.mark.parametrize("seed", [5, 6])
def test_energy_does_not_drift(seed):
    """Roundings of shares of impulse that add up were 1e-14 here, 6e-13 in a million contacts."""
    energy_of(20_000, gr.LinearDashpot(1e8), seed, 4e-15)


@pytest.mark.soak
@pytest.mark.parametrize("law", [gr.LinearDashpot(1e10), gr.Hertz(1e12), gr.PowerLaw(1e10, 2.0), gr.LinearDashpot(1e6)])
def test_energy_over_a_million_contacts(law):
    energy_of(1_000_000, law, 5, 1e-14)


def energy_of(count: int, law: Any, seed: int, drift: float) -> None:
    pytest.importorskip("numba")
    run = gr.md.simulate(at_random.gas(seed, 100, 0.5), law, max_events=count, log=False, engine="compiled")
    assert run.stats["contacts"] == count
    energy = run.energy()
    assert abs(energy[-1] / energy[0] - 1.0) <= drift


def test_critically_damped_balls_bounce_on_a_floor_whatever_rounding_makes_of_the_ratio():
    """ζ = 1 but for rounding, above and below; with the log's peaks, which compute ζ in another order."""
    rng = np.random.default_rng(9)
    for _ in range(60):
        k, m = 10.0 ** rng.uniform(3.0, 7.0), rng.uniform(0.1, 3.0)
        gamma = 2.0 * math.sqrt(k * m)
        for gamma_of in (np.nextafter(gamma, 0.0), gamma, np.nextafter(gamma, math.inf)):
            scene = gr.Scene([math.inf, m], [0.0, 0.1], [0.05], [0.0, -1.7], 9.81)
            run = gr.md.simulate(scene, gr.LinearDashpot(k, float(gamma_of)), t_end=0.06, engine="plain")
            peak = 1.7**2 + 2.0 * 9.81 * 0.05  # at the touch, v²
            assert run.contacts["force_max"][0] == pytest.approx(gamma * math.sqrt(peak), rel=1e-6)

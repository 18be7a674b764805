"""Isolated contacts, solved as one event each: against closed forms in 30 digits, and against pieces (`soft_twin`)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import granular as gr
from granular.md.located.one_contact import tables
from tests.helpers import scenes_at_random as at_random
from tests.helpers.exact_contact import MP, dashpot, power, similar, softening, stiffening, walton_braun
from tests.helpers.soft_twin import twin

INF = math.inf


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


@pytest.mark.rotating
@pytest.mark.parametrize(("law", "gravity", "exact", "digits"), cases(), ids=lambda x: getattr(x, "__name__", str(x)))
def test_contact_against_thirty_digits(law, gravity, exact, digits, monkeypatch):
    """Duration, speeds, impulse, peaks, and where the ball is when all is over: delay and displacement."""
    monkeypatch.setattr(tables, "CONTACTS_BEFORE_TABLE", 1)
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


@pytest.mark.rotating
@pytest.mark.parametrize("name", [pytest.param(x, marks=[pytest.mark.soak] * (x in SLOW)) for x in LAWS])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_contact_against_pieces(name, gravity, monkeypatch):
    """Of every law, damped too, at random speeds and masses; samples in the contact, its run-off and its neighbours."""
    monkeypatch.setattr(tables, "CONTACTS_BEFORE_TABLE", 1)
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
        assert new.stats["steps"] == 1 or new.stats["tables"] == 1 or (name, gravity) == ("softening", 9.81)
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


@pytest.mark.rotating
def test_a_law_that_bends_has_no_table_where_it_does(monkeypatch):
    """Not even beyond the last point of an octave of speeds."""
    monkeypatch.setattr(tables, "CONTACTS_BEFORE_TABLE", 1)
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


@pytest.mark.rotating
@pytest.mark.parametrize("disturbed", ["resolve", "stop", "ignore"])
def test_a_force_that_comes_back_is_another_contact(disturbed, monkeypatch):
    """In one overlap: the table of such a law was one contact where pieces have three."""
    monkeypatch.setattr(tables, "CONTACTS_BEFORE_TABLE", 1)
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
    monkeypatch.setattr(tables, "CONTACTS_BEFORE_TABLE", 1)
    law, mass, radius = gr.ViscoelasticHertz(1e7, 100.0), [INF, 1.0, 1.0], [0.0, 0.1, 0.1]
    far, near = (gr.Scene(mass, radius, [1e-3, gap], [0.0, -1.0, -1.0], 9.81) for gap in (1.0, 1e-6))
    run = gr.md.simulate(far, law, t_end=0.05, engine="plain")
    assert run.stats["isolated"] == 1
    assert run.stats["error_estimate"] == run.state["tables"]["error"][0] > 0.0
    new, old = (run(near, law, until=gr.until.contact(1, 1), engine="plain") for run in (gr.md.simulate, twin))
    assert new.stats["tables"] == 1
    assert new.stats["error_estimate"] == old.stats["error_estimate"]


@pytest.mark.rotating
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

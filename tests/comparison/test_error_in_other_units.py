"""Mirror images and systems of units change neither the error nor the ball that decides."""

import math
from functools import cache

import numpy as np
import pytest

import granular as gr
from tests.helpers.drawn_reports import INF, drawn


def mirror(report):
    scene = report.scene
    forces = None if scene.external_force is None else -scene.external_force[::-1]
    other = gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1],
                     external_force=forces)
    return gr.compare(other, report.law[::-1], report.rule[::-1] if isinstance(report.rule, list) else None,
                      t_end=report.t_end, ties="right", max_events=20_000)


@pytest.mark.rotating
@pytest.mark.parametrize("kind", ["free", "floor", "box"])
def test_mirror_image_has_the_same_error_and_the_mirrored_ball_decides(kind):
    seen = 0
    for seed in range(720, 745):
        report = drawn(kind, seed)
        if math.isnan(report.error) or max(report.shifts, default=0.0) > 1e-9:
            continue
        other = mirror(report)
        assert other.error == pytest.approx(report.error, rel=1e-5, abs=1e-10)
        one, two = report.deciding, other.deciding
        if one is not None and one.difference > 1e-6:
            assert two.contacts == one.contacts
            assert two.difference == pytest.approx(one.difference, rel=1e-5)
            seen += 1
    assert seen > 1


def scaled(report, length, duration, mass):
    """The same comparison in other units of length, time and mass; laws are dashpots."""
    s, force = report.scene, mass * length / duration**2
    forces = None if s.external_force is None else force * s.external_force
    scene = gr.Scene(mass * s.mass, length * s.radius, length * s.gap, length / duration * s.velocity,
                     gravity=length / duration**2 * s.gravity, external_force=forces)
    law = [gr.LinearDashpot(mass / duration**2 * one.k, mass / duration * one.gamma) for one in report.law]
    return gr.compare(scene, law, t_end=duration * report.t_end, max_events=20_000)


@cache
def dropped_stacks():
    """Comparisons of random stacks of two to four balls; those that depend on rounding are left out."""
    rng, reports = np.random.default_rng(9), []
    for _ in range(12):
        n = int(rng.integers(2, 5))
        scene = gr.Scene([INF, *rng.uniform(0.3, 3.0, n)], [0.0, *[0.05] * n], 10.0 ** rng.uniform(-4, -1, n),
                         [0.0] * (n + 1), gravity=9.81)
        law = [gr.LinearDashpot.from_restitution(float(rng.uniform(0.5, 1.0)), 10.0 ** rng.uniform(5, 8), p)
               for p in scene.pairs]
        reports.append(gr.compare(scene, law, t_end=0.5, max_events=20_000))
    return [one for one in reports if not math.isnan(one.error) and max(one.shifts, default=0.0) <= 1e-10]


@pytest.mark.rotating
@pytest.mark.parametrize(("units", "close"), [((2.0**10, 2.0**10, 2.0**6), 1e-12), ((1e3, 1e3, 1e9), 1e-6)])
def test_units_change_nothing(units, close):
    reports = dropped_stacks()
    assert len(reports) > 6
    for report in reports:
        other = scaled(report, *units)
        assert other.error == pytest.approx(report.error, rel=close, abs=1e-12)
        assert (other.deciding is None) == (report.deciding is None)


@pytest.mark.rotating
@pytest.mark.parametrize("make", [
    lambda k: gr.Hertz(1e7 * k(1.0, 1.5)), lambda k: gr.ViscoelasticHertz(1e7 * k(1.0, 1.5), 1e3 * k(1.0, 0.5, -1.0)),
    lambda k: gr.LinearDashpot(1e6 * k(1.0, 1.0), 50.0 * k(1.0, 0.0, -1.0)),
    lambda k: gr.PowerLaw(1e9 * k(1.0, 2.0), 2.0)])
@pytest.mark.parametrize("n", [1, 4])
def test_unit_of_a_pile_at_rest_does_not_depend_on_the_system_of_units(make, n):
    def unit(length, duration, mass):
        def k(force, power, rate=0.0):
            """Factor of a coefficient of N m^(-power) (m/s)^rate."""
            return (mass * length / duration**2) ** force * length**-power * (length / duration) ** rate

        scene = gr.Scene([INF, *mass * np.arange(1.0, n + 1.0)], [0.0] + [0.1 * length] * n, [0.0] * n, [0.0] * (n + 1),
                         gravity=9.81 * length / duration**2)
        report = gr.compare(scene, make(k), t_end=0.01 * duration)
        return float(report.units[0]) * duration / length

    for units in ((1e3, 1e3, 1e9), (2.0**10, 2.0**10, 2.0**-7), (1e-3, 1.0, 1e6)):
        assert unit(*units) == pytest.approx(unit(1.0, 1.0, 1.0), rel=1e-12)

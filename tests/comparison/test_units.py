"""Warnings of a report: numbers in other units than SI, of which no solid is, and forces that attract."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import granular as gr
from granular.comparison.input_warnings import warnings

SOLIDS = {"steel": (7850.0, 206e9, 0.3), "glass": (2500.0, 70e9, 0.22), "rubber": (1100.0, 5e6, 0.49),
          "tungsten carbide": (15_600.0, 600e9, 0.22), "ice": (917.0, 9e9, 0.33)}
"""Density in kg/m³, Young's modulus in Pa and Poisson's ratio."""


def of_solids(rng, mass=1.0, length=1.0, stress=1.0):
    """What a report says of two balls of one solid, or of real balls, whose numbers are in other units than SI."""
    radius, speed, gap = 10.0 ** rng.uniform(-3.5, -0.5, 2), 10.0 ** rng.uniform(-3.0, 1.0), 1e-3
    density, young, poisson = SOLIDS[rng.choice(list(SOLIDS))]
    m, law = 4.0 / 3.0 * math.pi * radius**3 * density, None
    if stress == 1.0 and rng.random() < 0.3:
        two = [gr.balls.BALLS[name] for name in rng.choice(list(gr.balls.BALLS), 2)]
        m, radius, law = np.array([b.mass for b in two]), np.array([b.radius for b in two]), two[0].stiffness * mass
    scene = gr.Scene(mass * m, length * radius, [length * gap], [length * speed, 0.0])
    law = gr.Hertz.from_material(stress * young, poisson, scene.pairs[0]) if law is None else gr.LinearDashpot(law)
    report = gr.compare(scene, law, until=gr.until.contact(0, 2), t_end=2.0 * gap / speed)
    return [w for w in warnings(report) if "solid" in w]


def test_solids_in_si_units_are_not_taken_for_others():
    rng = np.random.default_rng(6)
    assert not any(of_solids(rng) for _ in range(25))


@pytest.mark.parametrize(
    ("mass", "length", "stress", "words"),
    [(1.0, 1e3, 1e-9, "density of ball 0 (and of 1 more) is"), (1.0, 1e2, 1.0, "density of ball"),
     (1e3, 1.0, 1.0, "density of ball"), (1e-3, 1e3, 1.0, "density of ball")],
)
def test_numbers_in_other_units_are_warned_of_once(mass, length, stress, words):
    """mm with GPa; cm; grams; tonnes and mm."""
    rng = np.random.default_rng(7)
    for _ in range(3):
        (said,) = of_solids(rng, mass, length, stress)
        assert words in said
        assert said.endswith("which no solid has: are radii in m and masses in kg?")


def test_a_contact_faster_than_sound_in_solids_is_warned_of():
    """Grams and cm with a modulus in Pa: a density that aerogels have; points have neither, and can say nothing."""
    scene = gr.Scene([32.9] * 3, [1.0] * 3, [0.1] * 2, [100.0, 0.0, 0.0])
    report = gr.compare(scene, gr.Hertz.from_material(206e9, 0.3, scene.pairs[0]), t_end=0.1)
    (line,) = (line for line in str(report).splitlines() if line.startswith("warning: "))
    assert line in report.details()
    assert line == ("warning: waves in the contact of pair 0–1 (and of 1 more) travel at 5.3e+04 m/s, faster than "
                    "sound in any solid: is its stiffness in SI units?")
    points = gr.compare(scene.replace(radius=[0.0] * 3), gr.LinearDashpot(1e12), t_end=0.1)
    assert warnings(points) == []
    still = gr.compare(scene.replace(velocity=[0.0] * 3), gr.LinearDashpot(1e12), t_end=0.1)
    assert warnings(still) == []


@dataclass(frozen=True)
class Sticky:
    """A spring that pulls with a constant force."""

    k: float
    pull: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi + 10.0 * xi_dot - self.pull


def test_attraction_that_is_clipped_is_reported():
    scene, seen = gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.1, 0.1], [1.0, 0.0, 0.0]), []
    for pull in (0.0, 5.0, 50.0):
        report = gr.compare(scene, [gr.LinearDashpot(1e6, 10.0), Sticky(1e6, pull)], t_end=1.0)
        seen.append([line for line in warnings(report) if "attract" in line])
    assert [len(lines) for lines in seen] == [0, 1, 1]
    assert seen[2][0].startswith("the law of pair 1–2 attracts at an overlap of ")
    for law in (gr.LinearDashpot(1e6, 500.0), gr.WaltonBraun.from_restitution(0.6, 1e6), gr.Hertz(1e9),
                gr.TsujiHertz.from_restitution(0.3, 1e8), gr.ViscoelasticHertz(1e8, 1e4)):
        assert not warnings(gr.compare(scene, law, t_end=1.0))


@pytest.mark.usefixtures("interpreted")
def test_a_pull_is_reported_for_the_pair_with_the_contact_and_not_without_contacts():
    scene = gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.1, 0.1], [0.0, 0.0, -1.0])
    assert "the law of pair 1–2 attracts at" in warnings(gr.compare(scene, Sticky(1e6, 5.0), t_end=0.15))[0]
    assert warnings(gr.compare(scene, Sticky(1e6, 5.0), t_end=0.05)) == []


@pytest.mark.rotating
@pytest.mark.usefixtures("interpreted")
@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
@pytest.mark.parametrize("law", [Sticky(1e30, 1.0), gr.Hertz(1e300), gr.ViscoelasticHertz(1e30, 1e10)])
@pytest.mark.parametrize("scene", [
    gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.1, 0.1], [1.0, 0.0, 0.0]),
    gr.Scene([np.inf, 1.0, 1.0], [0.0, 0.1, 0.1], [0.1, 0.1], [0.0] * 3, gravity=9.81)], ids=["line", "floor"])
def test_an_unstable_run_has_a_report_and_details(law, scene):
    """Its speeds are nan, for which the table of contact durations raised a TypeError of numpy."""
    report = gr.compare(scene, law, gr.ConstantRestitution(1.0), t_end=0.3, dt=1e-2)
    assert str(report).startswith("No verdict: the soft-sphere run did not finish (unstable: ")
    assert "groups: " in report.details()

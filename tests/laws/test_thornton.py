"""Elastic, perfectly plastic spheres: Thornton's restitution against its printed form, its limit and the work done."""

import json
import math
from pathlib import Path

import mpmath
import numpy as np
import pytest

import granular as gr
from granular.laws.rules import ThorntonRestitution, constants
from granular.scene import Pair, Scene

ROW = json.loads((Path(__file__).parents[1] / "reference" / "catalogue.json").read_text(encoding="utf-8"))["rows"]["C7"]
PAIR = Pair(m_eff=0.02, r_eff=0.005, index=0)


def eps(r: float) -> float:
    return ThorntonRestitution(r)(1.0, PAIR)


def printed(r: float) -> mpmath.mpf:
    """Thornton's equation as printed, in 40 digits."""
    with mpmath.workdps(40):
        x = mpmath.mpf(r)
        front = mpmath.sqrt(6 * mpmath.sqrt(3) / 5 * (1 - x * x / 6))
        return front * (x / (x + 2 * mpmath.sqrt(mpmath.mpf(6) / 5 - x * x / 5))) ** (mpmath.mpf(1) / 4)


@pytest.mark.parametrize(("r", "value"), ROW["numbers"].items())
def test_reference_values(r, value):
    assert eps(float(r)) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("r", [*np.logspace(-12, 0, 25).tolist(), 0.2, 0.5, 1.0 - 1e-15])
def test_equals_the_printed_form(r):
    assert eps(r) == pytest.approx(float(printed(r)), rel=1e-15)


@pytest.mark.rotating
@pytest.mark.parametrize("r", [0.9, 0.5, 0.2, 0.01])
def test_equals_the_work_given_back_over_the_work_taken(r):
    """Load as Hertz, then linearly at the limiting pressure; unload as Hertz with the radius that fits."""
    e, radius, a_y = 3.0, 2.0, 0.5  # any modulus, radius and contact radius at first yield
    yield_depth = a_y * a_y / radius
    pressure = 2.0 * e * a_y / (math.pi * radius)

    def load(depth):
        hertz = 4.0 / 3.0 * e * math.sqrt(radius) * min(depth, yield_depth) ** 1.5
        return hertz + math.pi * pressure * radius * max(0.0, depth - yield_depth)

    def taken(depth):
        return mpmath.quad(load, [0, yield_depth]) + mpmath.quad(load, [yield_depth, depth])

    goal = taken(yield_depth) / r**2  # kinetic energy grows as the square of the speed
    depth = mpmath.findroot(lambda d: taken(d) - goal, (yield_depth, 3 * yield_depth / r))
    force = load(depth)
    flatter = radius * 4.0 / 3.0 * e * math.sqrt(radius) * depth**1.5 / force  # R_p F = R F_Hertz
    recovered = (force / (4.0 / 3.0 * e * mpmath.sqrt(flatter))) ** (mpmath.mpf(2) / 3)  # overlap given back
    given = mpmath.quad(lambda d: 4.0 / 3.0 * e * mpmath.sqrt(flatter) * d**1.5, [0, recovered])
    assert eps(r) == pytest.approx(float(mpmath.sqrt(given / goal)), rel=1e-10)


def test_fast_impacts_follow_the_fourth_root():
    rates = np.array([eps(r) / r**0.25 for r in (1e-6, 1e-9, 1e-12)])
    limit = math.sqrt(1.2) * (15 / 8) ** 0.125
    assert limit == pytest.approx(1.1849929922, abs=1e-10)
    np.testing.assert_allclose(rates, limit, rtol=1e-6)
    assert rates[-1] == pytest.approx(limit, rel=1e-12)
    assert ThorntonRestitution(1e-300)(1e300, PAIR) == 0.0


def test_elastic_up_to_the_yield_speed_and_falling_beyond():
    rule = ThorntonRestitution(0.1)
    assert [rule(v, PAIR) for v in (0.0, 1e-9, 0.1)] == [1.0, 1.0, 1.0]
    falling = [rule(v, PAIR) for v in np.linspace(0.1, 0.1 + 1e-9, 50)] + [rule(v, PAIR) for v in np.geomspace(0.11, 9)]
    assert max(falling) <= 1.0
    assert (np.diff(falling[50:]) < 0.0).all()


def test_yield_speed_from_material_is_where_the_hertz_pressure_reaches_its_limit():
    young, poisson, pressure = 2.1e11, 0.3, 1.0e9
    rule = ThorntonRestitution.from_material(young, poisson, pressure, PAIR)
    law = gr.Hertz.from_material(young, poisson, PAIR)
    depth = (1.25 * PAIR.m_eff * rule.yield_speed**2 / law.k) ** 0.4  # largest overlap of a Hertz contact
    radius = math.sqrt(PAIR.r_eff * depth)
    assert 1.5 * law.k * depth**1.5 / (math.pi * radius**2) == pytest.approx(pressure, rel=1e-12)


def test_sphere_on_a_wall_of_the_same_stuff():
    """Then m_eff = (4/3) π R³ ρ, and v_y = 1.56 √(p_y⁵/(E*⁴ ρ)) whatever the radius (Thornton 1997)."""
    density, modulus, pressure = 7800.0, 2.1e11 / (2 * (1 - 0.09)), 1e9
    for radius in (1e-3, 0.1):
        mass = 4 / 3 * math.pi * radius**3 * density
        pair = Scene([math.inf, mass], [0.0, radius], [1.0], [0.0, -1.0]).pairs[0]
        rule = ThorntonRestitution.from_material(2.1e11, 0.3, pressure, pair)
        assert rule.yield_speed == pytest.approx(1.56 * math.sqrt(pressure**5 / modulus**4 / density), rel=1e-3)


def test_hard_spheres_use_it():
    scene = Scene([1.0, 1.0], [0.01, 0.01], [0.1], [1.0, 0.0])
    rule = ThorntonRestitution(0.2)
    run = gr.edmd.simulate(scene, rule, until=gr.until.separated())
    assert np.diff(run.velocity[-1]) == pytest.approx(0.7733368990, abs=1e-10)
    assert constants([rule], scene.pairs) is None


@pytest.mark.parametrize(("make", "message"), [
    (lambda: ThorntonRestitution(0.0), r"`yield_speed` must be .*above 0, got 0\.0"),
    (lambda: ThorntonRestitution.from_material(1e9, 0.6, 1e6, PAIR),
        r"`poisson` must be a number in \[0, 0\.5\], got 0\.6\."),
    (lambda: ThorntonRestitution.from_material(1e9, 0.3, -1.0, PAIR), r"`yield_pressure` must be .*above 0, got -1\.0"),
    (lambda: ThorntonRestitution.from_material(1e9, 0.3, 1e6, Pair(1.0, math.inf, 2)),
     r"`r_eff` of pair 2–3 must be a finite number above 0, got inf\. Point particles cannot yield\."),
])
def test_misuse(make, message):
    with pytest.raises(ValueError, match=message):
        make()

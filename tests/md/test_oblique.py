"""Oblique impacts: values of a prototype, independent integration in Cartesian coordinates, invariants and limits."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import granular as gr
from granular.md.binary import collision, oblique

PAIR = gr.Pair(m_eff=0.5, r_eff=0.25, index=0)
DASHPOT = gr.LinearDashpot.from_restitution(0.9, k=4e3, pair=PAIR)


def spring(s):
    """Undamped spring with v t_c/l = s for v = l = 1."""
    return gr.LinearDashpot(0.5 * (math.pi / s) ** 2)


def impact(law, degrees, speed=1.0, distance=1.0, pair=PAIR):
    """Impact at an angle between the velocity and the line of centres."""
    angle = math.radians(degrees)
    return oblique(law, pair, distance, speed * math.cos(angle), speed * math.sin(angle))


CASES = {  # law, angle, rotation and its digits, estimate/rotation, normal and tangential restitution, deviation
    "spring, 45°": (spring(0.1), 45, 0.0716481919, 10, 0.06969764 / 0.0716481919, 0.925847, 1.069021, 0.071633),
    "spring, 85°": (spring(0.1), 85, 0.0776767, 7, 0.077567 / 0.0776767, 0.110028, 1.0038, 0.0777),
    "spring, 89°": (spring(0.1), 89, 0.0319296, 7, 0.031931 / 0.0319296, -0.829447, 1.0000, 0.0319),
    "soft spring": (spring(0.3), 75, 0.2316340, 7, 0.228617 / 0.2316340, 0.116532, 1.034805, 0.231117),
    "dashpot": (DASHPOT, 60, 0.029626567237, 12, 0.9944, 0.84930, 1.01532, 0.02861),
    "Hertz": (gr.Hertz(1e5), 85, 0.037159669429, 12, 0.9681, 0.57467, 1.00256, 0.03716),
    "viscoelastic": (gr.ViscoelasticHertz(1e5, 30.0), 85, 0.036908411815, 12, 0.9706, 0.55259, 1.00249, 0.03668),
    "Tsuji": (gr.TsujiHertz(1e5, 0.1), 60, 0.023380285981, 12, 0.9925, 0.83198, 1.01213, 0.02273),
}


@pytest.mark.parametrize("name", CASES)
def test_numbers_of_the_prototype_are_reproduced_to_their_digits(name):
    law, angle, rotation, digits, ratio, normal, tangential, deviation = CASES[name]
    hit = impact(law, angle)
    assert hit.rotation == pytest.approx(rotation, abs=0.6 * 10.0**-digits)
    assert hit.estimate / hit.rotation == pytest.approx(ratio, abs=6e-5)
    assert hit.restitution == pytest.approx(normal, abs=6e-6)
    assert hit.tangential == pytest.approx(tangential, abs=6e-5)
    assert hit.deviation == pytest.approx(deviation, abs=6e-5)


def test_a_spring_deviates_by_twice_the_sine_of_half_the_rotation():
    for angle in (10, 45, 85, 89.5):
        hit = impact(spring(0.1), angle)
        assert hit.deviation == pytest.approx(2.0 * math.sin(0.5 * hit.rotation), rel=1e-11)
        assert hit.radial == pytest.approx(1.0, abs=1e-12)


def cartesian(law, pair, distance, normal, tangential, duration):
    """Relative velocity after the contact, rotation and duration, from x, y, v_x, v_y of the relative motion."""
    deepest = [0.0]

    def force(state):
        x, y, vx, vy = state
        r = math.hypot(x, y)
        xi, rate = distance - r, -(x * vx + y * vy) / r
        if xi <= 0.0:
            return xi, r
        deepest[0] = xi if rate >= 0.0 else deepest[0]
        return (law.force(xi, rate, pair, deepest[0]) if getattr(law, "memory", False) else
                law.force(xi, rate, pair)), r

    def derivative(_, state):
        push, r = force(state)
        a = max(0.0, push) / pair.m_eff / r
        return state[2], state[3], a * state[0], a * state[1]

    def end(_, state):
        return force(state)[0]

    end.terminal, end.direction = True, -1.0
    found = solve_ivp(derivative, (0.0, 100.0 * duration), (0.0, distance, tangential, -normal), method="DOP853",
                      rtol=3e-14, atol=1e-15, events=end, max_step=duration / 64.0)
    x, y, vx, vy = found.y_events[0][0]
    return (vx, vy), math.atan2(x, y), found.t_events[0][0]


def random_impact(seed):
    random = np.random.default_rng(seed)
    distance, pair = 10.0 ** random.uniform(-0.5, 0.5), gr.Pair(10.0 ** random.uniform(-1, 1), 0.1, 0)
    speed, angle, softness = 10.0 ** random.uniform(-1, 1), random.uniform(0.0, 1.5), 10.0 ** random.uniform(-3, -1)
    k = pair.m_eff * (math.pi * speed / (softness * distance)) ** 2
    hertz = 0.5 * pair.m_eff * speed**2 * 2.5 / (0.3 * softness * distance) ** 2.5
    law = [gr.LinearDashpot(k), gr.LinearDashpot.from_restitution(random.uniform(0.3, 0.99), k=k, pair=pair),
           gr.Hertz(hertz), gr.ViscoelasticHertz(hertz, 0.05 * hertz * softness * distance / speed),
           gr.TsujiHertz(hertz, random.uniform(0.01, 0.5))][seed % 5]
    return law, pair, distance, speed * math.cos(angle), speed * math.sin(angle)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(15))
def test_an_independent_integration_in_cartesian_coordinates_agrees(seed):
    law, pair, distance, normal, tangential = random_impact(seed)
    hit = oblique(law, pair, distance, normal, tangential)
    (vx, vy), rotation, duration = cartesian(law, pair, distance, normal, tangential, hit.duration)
    speed = math.hypot(normal, tangential)
    assert hit.rotation == pytest.approx(rotation, abs=1e-11)
    assert hit.duration == pytest.approx(duration, rel=1e-9)
    assert (hit.restitution * normal, hit.tangential * tangential) == pytest.approx((vy, vx), abs=1e-10 * speed)
    hard = collision(law, pair, normal).restitution
    assert hit.deviation == pytest.approx(math.hypot(vy - hard * normal, vx - tangential) / speed, abs=1e-10)


@pytest.mark.parametrize("seed", [0, 2, 5, 7, 10, 12])
def test_energy_and_angular_momentum_of_elastic_impacts_are_kept(seed):
    law, pair, distance, normal, tangential = random_impact(seed)
    hit = oblique(law, pair, distance, normal, tangential)
    before, after = normal**2 + tangential**2, (hit.restitution * normal) ** 2 + (hit.tangential * tangential) ** 2
    assert after == pytest.approx(before, rel=1e-11)
    # the bodies separate at the distance l along the turned line of centres
    x, y = distance * math.sin(hit.rotation), distance * math.cos(hit.rotation)
    momentum = y * hit.tangential * tangential - x * hit.restitution * normal
    assert momentum == pytest.approx(distance * tangential, rel=1e-11, abs=1e-13 * distance * normal)


@pytest.mark.parametrize("law", [DASHPOT, gr.Hertz(1e5), gr.ViscoelasticHertz(1e5, 30.0), gr.TsujiHertz(1e5, 0.1),
                                 gr.WaltonBraun(4e3, 9e3)], ids=repr)
def test_a_head_on_impact_is_a_collision(law):
    hit, contact = oblique(law, PAIR, 1.0, 0.7, 0.0), collision(law, PAIR, 0.7)
    assert hit.rotation == hit.estimate == 0.0
    assert hit.restitution == hit.radial == pytest.approx(contact.restitution, rel=1e-10)
    assert hit.duration == pytest.approx(contact.duration, rel=1e-10)
    assert hit.xi_max == pytest.approx(contact.xi_max, rel=1e-10)
    assert hit.deviation < 1e-10
    assert hit.tangential == pytest.approx(oblique(law, PAIR, 1.0, 0.7, 1e-6).tangential, rel=1e-9)


def test_laws_with_memory_unload_from_the_largest_overlap():
    law = gr.WaltonBraun(4e3, 9e3)
    hit = impact(law, 60)
    (vx, vy), rotation, _ = cartesian(law, PAIR, 1.0, 0.5, math.sqrt(0.75), hit.duration)
    assert hit.rotation == pytest.approx(rotation, abs=1e-8)
    assert (hit.restitution, hit.tangential) == pytest.approx((2 * vy, vx / math.sqrt(0.75)), abs=1e-8)


@pytest.mark.parametrize(("s", "degrees", "ratio"), [
    (0.001, 89.95749, 0.742020), (0.01, 89.57486, 0.742050), (0.1, 85.75069, 0.745056)])
def test_normal_restitution_is_negative_beyond_an_angle(s, degrees, ratio):
    law = spring(s)
    found = brentq(lambda angle: impact(law, angle).restitution, degrees - 0.02, degrees + 0.02, xtol=1e-9)
    assert found == pytest.approx(degrees, abs=6e-6)
    assert math.cos(math.radians(found)) / (s * math.sin(math.radians(found)) ** 2) == pytest.approx(ratio, abs=6e-7)


def test_the_limit_of_the_angle_of_zero_restitution():
    q = brentq(lambda q: 2.0 * math.atan(q) - q, 1.0, 4.0, xtol=1e-14)
    assert (q, q / math.pi) == pytest.approx((2.33112, 0.7420193), abs=5e-6)


def test_elastic_impacts_mirror_the_velocity_at_the_turned_line_of_centres():
    for law in (spring(0.1), gr.Hertz(1e5), gr.PowerLaw(1e4, 2.0)):
        hit, angle = impact(law, 70), math.radians(70)
        assert hit.restitution == pytest.approx(math.cos(angle + hit.rotation) / math.cos(angle), abs=1e-10)
        assert hit.tangential == pytest.approx(math.sin(angle + hit.rotation) / math.sin(angle), abs=1e-10)


def test_grazing_impacts_turn_by_the_chord_through_the_overlap():
    for law in (spring(0.1), gr.Hertz(1e5), gr.PowerLaw(1e4, 2.0)):
        hit = oblique(law, PAIR, 1.0, 1e-4, 1.0)
        assert hit.rotation == pytest.approx(2e-4, rel=2e-3)
        assert hit.restitution == pytest.approx(-1.0, abs=5e-3)
    # a damped force ends before the overlap does
    assert oblique(DASHPOT, PAIR, 1.0, 1e-4, 1.0).rotation == pytest.approx(1e-4, rel=0.1)


def mean_rotation(law):
    """Mean over the squared impact parameter from 24 Gauss points, as in the prototype. The error is up to 2e-4."""
    node, weight = np.polynomial.legendre.leggauss(24)
    return sum(0.5 * w * oblique(law, PAIR, 1.0, math.sqrt(0.5 - 0.5 * u), math.sqrt(0.5 + 0.5 * u)).rotation
               for u, w in zip(node.tolist(), weight.tolist(), strict=True))


@pytest.mark.rotating
def test_means_over_impact_parameters():
    for s, ratio in ((0.003, 0.6665), (0.01, 0.6659), (0.03, 0.6644), (0.1, 0.6589)):
        assert mean_rotation(spring(s)) / s == pytest.approx(ratio, abs=6e-5)
    k = 1e7
    s = collision(gr.Hertz(k), PAIR, 1.0).duration
    law = gr.Hertz(k * (s / 0.01) ** 2.5)
    assert collision(law, PAIR, 1.0).duration == pytest.approx(0.01, rel=1e-9)
    assert mean_rotation(law) / 0.01 == pytest.approx(0.7615, abs=6e-5)


def test_real_grains_are_hard():
    """Glass spheres of 1 mm at 45°. The prototype has at most two digits."""
    glass, r = gr.materials.glass, 0.5e-3
    pair = gr.Pair(0.5 * 4.0 / 3.0 * math.pi * r**3 * glass.density, 0.5 * r, 0)
    law = gr.Hertz.from_material(*glass, pair)
    for speed, rotation in ((0.01, 6e-5), (0.1, 4e-4), (1.0, 0.0023), (10.0, 0.014)):
        assert impact(law, 45, speed, 2.0 * r, pair).rotation == pytest.approx(rotation, rel=0.1)


class NoForce:
    """Law that never repels."""

    def force(self, xi, xi_dot, pair):
        return 0.0


@pytest.mark.parametrize(("arguments", "match"), [
    ((spring(0.1), PAIR, 0.0, 1.0, 1.0), "^`distance` must be a finite number above 0, got 0.0.$"),
    ((spring(0.1), PAIR, math.nan, 1.0, 1.0), "^`distance` must be "),
    ((spring(0.1), PAIR, 1.0, 0.0, 1.0), "^`normal_speed` must be a finite number above 0, got 0.0.$"),
    ((spring(0.1), PAIR, 1.0, 1.0, -1.0), "^`tangential_speed` must be a finite number of at least 0, got -1.0.$"),
    ((spring(0.1), PAIR, 0.02, 1.0, 1.0), "^`distance` must be larger than the overlap 0.031"),
    ((spring(0.1), None, 1.0, 1.0, 1.0), "^`pair` must be a Pair"),
    ((None, PAIR, 1.0, 1.0, 1.0), "^`law` must be an object with force"),
    ((NoForce(), PAIR, 1e3, 1.0, 1.0), "^`law` must repel"),
])
def test_misuse_is_one_sentence(arguments, match):
    with pytest.raises((TypeError, ValueError), match=match):
        oblique(*arguments)

"""What rides on a moving wall: where it lifts off, what presses it; and the ball that bounces on a shaken plate."""

import json
import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

from granular.scene.walls import Piecewise, Sine, path
from granular.scene.walls.gap import GAP_NOISE, gap_at_time
from granular.scene.walls.hits import first_hit, lift_off, pressing_bounds
from granular.scene.walls.path import wall_at
from tests.helpers.exact_walls import Exact
from tests.helpers.walls_at_random import INF, G, records, scenes

DOUBLING = json.loads(
    (Path(__file__).parents[1] / "reference" / "plate_period_doubling.json").read_text(encoding="utf-8")
)
pytestmark = pytest.mark.usefixtures("forty_digits")


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("gamma", [1.0 + 1e-12, 1.0 + 1e-6, 1.01, 3.0, 100.0])
def test_lift_off_where_the_wall_falls_as_the_ball_does(gamma, side):
    wall = Sine.from_acceleration(gamma, 50.0, G, 0.0 if side > 0 else math.pi)
    floor = records(wall, side)
    s, rate = lift_off(*floor, 20.0, -1e-3, G, INF)
    a, omega = mp.mpf(wall.amplitude), 2 * mp.pi * 50
    off = 0 if side > 0 else mp.mpf(wall.phase) - mp.pi
    when = (mp.asin(G / (a * omega**2)) - off) / omega + mp.mpf(1e-3)
    allowed = 4 * GAP_NOISE * gamma / max(math.sqrt(gamma**2 - 1), 1e-7) / wall.omega
    assert rate == 0.0
    assert abs(s - when) <= allowed + 1e-16 * s
    x = gap_at_time(*floor, 20.0, -1e-3, 0.0, 0.0, G, s)
    assert x[0] < 0.0  # would have been pressed on until then
    left = first_hit(*floor, 20.0, s - 1e-3, 0.0, 0.0, G, INF)
    exact = Exact(wall, side, 20.0, s - 1e-3, mp.mpf(0), mp.mpf(0), G)
    if gamma > 1.0 + 1e-8:
        apart = 1e-9 if gamma > 1.005 else 1e-6
        assert left == pytest.approx(float(mp.findroot(lambda z: exact(z)[0] / z**3, left)), rel=apart)


def test_a_ball_lifted_off_leaves_though_rounding_moves_the_time():
    wall = Sine.from_acceleration(20.0, 50.0, G)
    plate, flights = records(wall), []
    for i in range(200):
        t = 64.0 + i / 7
        s, rate = lift_off(*plate, t, 0.013, G, INF)
        assert rate == 0.0
        flights.append(first_hit(*plate, t, 0.013 + s, 0.0, 0.0, G, INF))
    assert min(flights) > 1e-3
    assert max(flights) < 0.2
    for t in np.random.default_rng(0).uniform(0, 0.9, 200).tolist():  # without gravity, where a panel ends
        s, _ = lift_off(*plate, t, 0.0, 0.0, INF)
        again = first_hit(*plate, t, s, 0.0, 0.0, 0.0, INF)
        assert again == INF if s > 0.0 else again > 1e-4  # with the largest velocity of the wall, or a lower one


def test_under_a_ceiling_that_moves_gently_a_ball_once_falling_is_never_hit():
    plate = records(Sine.from_acceleration(0.5, 50.0, G), -1.0)
    for t, gap, rate in ((0.0, 0.0, 0.0), (0.003, 1e-9, 0.0), (0.0, 1e-3, 0.3), (0.0, 1.0, -4.0)):
        assert first_hit(*plate, t, 0.0, gap, rate, -G, INF) == INF
    drift = -4.5 - 0.5 * G / (100 * math.pi)  # seen from the ceiling at rest, which moves by 0.05 mm only
    still = (-drift - math.sqrt(drift**2 - 2 * G)) / G
    assert first_hit(*plate, 0.0, 0.0, 1.0, -4.5, -G, INF) == pytest.approx(still, abs=2e-4)


def test_no_lift_off_at_or_below_one_g_and_at_once_above():
    for gamma in (0.0, 0.5, 1.0 - 1e-12, 1.0):
        assert lift_off(*records(Sine.from_acceleration(gamma, 50.0, G)), 0.0, 0.0, G, INF) == (INF, 0.0)
    plate = records(Sine.from_acceleration(1.5, 50.0, G))
    assert lift_off(*plate, 0.005, 0.0, G, INF) == (0.0, 0.0)  # x'' = -1.5 g: at once
    assert lift_off(*plate, 0.0, 0.0, G, 1e-4) == (INF, 0.0)
    ceiling = records(Sine.from_acceleration(0.5, 50.0, G), -1.0)
    assert lift_off(*ceiling, 0.0, 0.0, -G, INF) == (0.0, 0.0)


def test_bounds_of_what_presses_are_certain_and_narrow():
    for rng, wall, side, t, tail, pull in scenes(40, 3):
        plate = records(wall, side)
        for span in 10.0 ** rng.uniform(-6, 0.5, 4) / wall.frequency:
            low, high = pressing_bounds(*plate, t, tail, pull, float(span))
            seen = [pull + path.moved(*plate, t, tail + float(s))[2] for s in np.linspace(0, span, 50)]
            largest, angle = wall.amplitude * wall.omega**2, min(wall.omega * span, 1.0)
            rounding = largest * wall.omega * math.ulp(tail + span)  # of the times asked for
            assert low <= min(seen) + rounding
            assert max(seen) - rounding <= high
            assert high - low <= max(seen) - min(seen) + largest * (0.5 * angle * angle + 1e-13)


def test_a_corner_kicks_or_leaves_what_rests():
    saw = Piecewise([0.0, 1.0, 2.0, 3.0], [[0.1, -0.1, 0.3], [0.0, 0.1, 0.0]])
    plate = records(saw, t_end=3.0)
    assert lift_off(*plate, 0.25, 0.0, G, INF) == (0.75, pytest.approx(0.2, rel=1e-14))
    assert lift_off(*plate, 1.5, 0.0, G, INF) == (0.5, pytest.approx(-0.4, rel=1e-14))
    assert lift_off(*plate, 1.5, 0.0, G, 0.4) == (INF, 0.0)
    assert lift_off(*plate, 2.5, 0.0, G, INF) == (INF, 0.0)
    hit = first_hit(*plate, 1.0, 0.0, 1e-9, 0.1 + 0.5e-9, 0.0, INF)  # rises with 0 beside a wall that falls, then rises
    assert hit == pytest.approx(1.0 + 1.0 / 3.0, rel=1e-8)


# --- the ball that bounces on a shaken plate -------------------------------------------------------------------------


def orbit(case, gamma):
    """The plate of Γ, and time, velocity of the impacts of the orbit that takes k periods a flight; g = ω = 1."""
    wall, k = Sine.from_acceleration(gamma, 0.5 / math.pi, 1.0), case["k"]
    when = math.acos(case["gamma_exists"] / gamma)
    return wall, when, k * math.pi


def bounce(plate, eps, t, tail, v):
    """Next impact from one at t + tail after which the ball has velocity v: its time and velocity after it."""
    _, w, _ = wall_at(*plate, t, tail)
    s = first_hit(*plate, t, tail, 0.0, v - w, 1.0, INF)
    _, closing = gap_at_time(*plate, t, tail, 0.0, v - w, 1.0, s)
    _, w, _ = wall_at(*plate, t, tail + s)
    return s, w - eps * closing


def multiplier(case, gamma):
    """1 + trace + determinant of the orbit's exact map; 0 where the period doubles."""
    eps, (wall, when, v) = case["restitution"], orbit(case, gamma)
    plate = records(wall)
    flight = 2 * v
    _, w, a = wall_at(*plate, when, 0.0)
    u = w + v  # speed of the impact
    of_t, of_v = (w + v) / u, flight / u  # the next impact's time, for v - g·flight = -v
    kick = (1 + eps) * a
    matrix = np.array([[of_t, of_v], [kick * of_t + eps * (of_t - 1), kick * of_v - eps + eps * of_v]])
    assert np.linalg.det(matrix) == pytest.approx(eps**2, rel=1e-11)
    return 1 + np.trace(matrix) + eps**2


@pytest.mark.parametrize("case", DOUBLING, ids=lambda case: f"eps={case['restitution']}, k={case['k']}")
def test_the_period_doubles_where_theory_says(case):
    exists, eps = case["k"] * math.pi * (1 - case["restitution"]) / (1 + case["restitution"]), case["restitution"]
    assert case["gamma_exists"] == pytest.approx(exists, rel=1e-13)
    found = brentq(lambda gamma: multiplier(case, gamma), 1.05 * exists, 2.0, xtol=1e-15, rtol=1e-15)
    assert found == pytest.approx(case["gamma_doubles"], rel=1e-12)
    for factor in (0.998, 1.002):  # a deviation dies out, or grows, from impact to impact, changing its sign
        wall, when, v0 = orbit(case, factor * case["gamma_doubles"])
        plate, off = records(wall), []
        t, tail, v = when, 0.0, v0 * (1 + 1e-7)
        for _ in range(40):
            s, v = bounce(plate, eps, t, tail, v)
            tail += s - 2 * v0
            off.append(v - v0)
        assert (abs(off[-1]) < abs(off[-21])) == (factor < 1.0)
        assert off[-1] * off[-2] < 0.0


@pytest.mark.parametrize("case", DOUBLING, ids=lambda case: f"eps={case['restitution']}, k={case['k']}")
def test_a_ball_started_on_the_orbit_stays_on_it(case):
    gamma = 0.5 * (case["gamma_exists"] + case["gamma_doubles"])
    wall, when, v0 = orbit(case, gamma)
    plate, tail, v = records(wall), 0.0, v0
    for period in range(200):
        t = 2 * math.pi * case["k"] * period
        drift = mp.mpf(t) + mp.mpf(when) - 2 * mp.pi * case["k"] * period  # the time's own rounding
        s, v = bounce(plate, case["restitution"], t, when + tail - float(drift - when), v)
        tail += s - 2 * v0
        assert abs(tail) < 1e-12
        assert abs(v - v0) < 1e-12

"""Moving walls: their path, first hits, riding and lift-off, against 40 digits and against each other."""

import dataclasses
import json
import math
import pickle
import re
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import CubicSpline, PPoly
from scipy.optimize import brentq

import granular as gr
from granular import _kernels
from granular._records import one, plain
from granular.walls import Motion, Panels, Piecewise, Sine, path
from granular.walls.gap import NOISE, after
from granular.walls.hits import first_hit, lift_off, pressing_bounds
from granular.walls.path import expansion, phase, wall_at

DOUBLING = json.loads((Path(__file__).parent / "reference" / "plate_period_doubling.json").read_text(encoding="utf-8"))
G = 9.81
INF = math.inf


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(40):
        yield


def records(wall, side=1.0, t_end=INF, **more):
    """Plain records of a wall."""
    one_wall, panels = wall.panels(more.get("t_start", 0.0), t_end).records(side, **more)
    return plain(one_wall)[0], plain(panels)


# --- the slow, obviously right twin: a sine in 40 digits -----------------------------------------------------------


class Exact:
    """A gap beside a shaken wall."""

    def __init__(self, wall, side, t, tail, gap, rate, pull):
        self.a, self.omega = side * mp.mpf(wall.amplitude), 2 * mp.pi * mp.mpf(wall.frequency)
        self.theta = self.omega * (mp.mpf(t) + mp.mpf(tail)) + mp.mpf(wall.phase)
        self.height = gap + self.a * mp.sin(self.theta)
        self.drift, self.pull = rate + self.a * self.omega * mp.cos(self.theta), mp.mpf(pull)
        size = gap + wall.amplitude
        self.noise = lambda s: NOISE * (size + s * (abs(rate) + wall.amplitude * wall.omega + 0.5 * abs(pull) * s))

    def __call__(self, s):
        s = mp.mpf(s)
        angle = self.theta + self.omega * s
        rate = self.drift - self.pull * s - self.a * self.omega * mp.cos(angle)
        return self.height + s * (self.drift - self.pull * s / 2) - self.a * mp.sin(angle), rate

    def first(self, limit):
        """The first hit, by steps of a parabola with the largest acceleration of all."""
        s, most = mp.mpf(0), self.pull + abs(self.a) * self.omega**2
        for _ in range(20_000):
            if s >= limit:
                return mp.inf
            above, fall = self.height + s * (self.drift - self.pull * s / 2) - abs(self.a), self.drift - self.pull * s
            s += closes(above, fall, self.pull) if above > 0 else 0
            if s == mp.inf:
                return mp.inf
            gap, rate = self(s)
            if gap < 1e-33 and rate < 0:
                return s
            s += closes(gap, rate, most) * (1 - mp.mpf(10) ** -30)
        raise RuntimeError("the twin comes to no hit")


def closes(gap, rate, a):
    """When a gap under constant acceleration closes."""
    square = rate * rate + 2 * a * gap
    if square < 0 or (a <= 0 and rate >= 0):
        return mp.inf
    return (rate + mp.sqrt(square)) / a if rate > 0 else 2 * gap / (mp.sqrt(square) - rate)


def scenes(n, seed):
    """Walls and balls of all sorts: (wall, side, t, tail, pull), the amplitude apart from gravity by up to 100."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        f, side = 10 ** rng.uniform(-1, 2), float(rng.choice([1.0, -1.0]))
        wall = Sine(10 ** rng.uniform(-4, 0), f, rng.uniform(-4, 4))
        g = wall.amplitude * wall.omega**2 / 10 ** rng.uniform(-0.5, 2) if rng.random() < 0.85 else 0.0
        t = float(rng.choice([0.0, rng.uniform(0, 100) / f, 1e6 / f]))
        yield rng, wall, side, t, float(rng.uniform(0, 3)) / f, side * g


def any_gap(rng, wall):
    sort = rng.integers(3)
    gap = [wall.amplitude * 10 ** rng.uniform(-8, 3), 0.0, wall.amplitude * 10 ** rng.uniform(-3, 3)][sort]
    rate = wall.amplitude * wall.omega * [rng.normal(), 10 ** rng.uniform(-6, 2), 0.0][sort]
    return float(gap), float(rate)


def grazing(rng, wall, side, t, tail, pull, margin):
    """A gap that comes as near as `margin` amplitudes at rate 0, while it opens faster and faster; or None."""
    for _ in range(200):
        s = 10 ** rng.uniform(-2, 1.3) / wall.frequency
        begin, end = (wall.omega * (t + tail + x) + wall.phase for x in (0.0, s))
        a, v = side * wall.amplitude, side * wall.amplitude * wall.omega
        drift = v * math.cos(end) + pull * s
        gap = a * math.sin(end) + margin * wall.amplitude - s * (drift - 0.5 * pull * s) - a * math.sin(begin)
        if pull < wall.omega**2 * a * math.sin(end) and gap > 0.0:
            return gap, drift - v * math.cos(begin)
    return None


def assert_first(exact, s, limit):
    """Nothing is missed; what is early is within rounding of a touch there."""
    first = exact.first(limit)
    if s > first:
        slope = abs(exact(first)[1])
        assert s - first <= exact.noise(float(first)) / slope + 4 * mp.mpf(2) ** -52 * first
    elif s < first:
        gap, rate = exact(s)
        assert gap <= 3 * (exact.noise(s) + abs(rate) * mp.mpf(2) ** -52 * s)


def test_first_hits_of_any_gap():
    for rng, wall, side, t, tail, pull in scenes(100, 0):
        gap, rate = any_gap(rng, wall)
        limit = 1e3 / wall.frequency
        s = first_hit(*records(wall, side), t, tail, gap, rate, pull, limit)
        assert_first(Exact(wall, side, t, tail, gap, rate, pull), s, limit)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("power", [-3, -6, -9, -12, -13, -14, -15])
def test_first_hits_of_grazing_balls(power, sign):
    for rng, wall, side, t, tail, pull in scenes(6, 100 - power):
        found = grazing(rng, wall, side, t, tail, pull, sign * 10.0**power)
        if found is not None:
            limit = 1e3 / wall.frequency
            s = first_hit(*records(wall, side), t, tail, *found, pull, limit)
            assert_first(Exact(wall, side, t, tail, *found, pull), s, limit)


def test_a_gap_later_on_is_right_to_rounding():
    for rng, wall, side, t, tail, pull in scenes(60, 12):
        gap, rate = any_gap(rng, wall)
        for s in (10.0 ** rng.uniform(-9, 1.5, 3) / wall.frequency).tolist():
            got = after(*records(wall, side), t, tail, gap, rate, pull, s)
            exact = Exact(wall, side, t, tail, gap, rate, pull)
            of_rate = abs(rate) + min(wall.omega * s, 2.0) * wall.amplitude * wall.omega + abs(pull) * s
            of_gap = gap + s * of_rate if wall.omega * s < 0.1 else exact.noise(s) / NOISE
            assert abs(got[0] - exact(s)[0]) <= NOISE * of_gap
            assert abs(got[1] - exact(s)[1]) <= NOISE * (of_rate + of_gap / s)


def test_small_bounces_keep_their_digits_anywhere_on_the_path():
    wall = Sine.from_acceleration(0.7, 50.0, G, 0.3)
    plate = records(wall)
    for i, u in enumerate(10.0 ** np.linspace(-12, -2, 60)):
        tail, rate = 0.02 * i / 60, float(u) * wall.amplitude * wall.omega
        s = first_hit(*plate, 1.0, tail, 0.0, rate, G, INF)
        exact = Exact(wall, 1.0, 1.0, tail, 0.0, rate, G).first(1.0) if rate > 1e-7 else 0
        pressed = G - wall.amplitude * wall.omega**2 * math.sin(wall.omega * (1.0 + tail) + wall.phase)
        assert s == pytest.approx(float(exact) or 2 * rate / pressed, rel=1e-14 if exact else 1e-3 * u**0.25)
        gap, closing = after(*plate, 1.0, tail, 0.0, rate, G, s)
        assert abs(gap) <= 4e-15 * rate * s
        assert closing < 0.0


def test_a_hit_just_left_is_not_found_again_and_a_closing_touch_is_now():
    plate = records(Sine(1e-3, 50.0))
    assert first_hit(*plate, 0.0, 0.0, 0.0, -1e-9, G, INF) == 0.0
    assert first_hit(*plate, 0.0, 0.0, 0.0, 1e-3, G, INF) > 1e-5
    assert first_hit(*plate, 0.015, 0.0, 0.0, 0.0, G, INF) == INF  # rests: pressed on
    later = first_hit(*plate, 0.0051, 0.0, 0.0, 0.0, G, INF)  # rests, but the wall falls away faster
    assert 1e-3 < later < 1.0
    assert first_hit(*plate, 0.0051, 0.0, 0.0, 0.0, G, 0.9 * later) == INF


def counted(function, asked):
    return lambda *given: asked.append(1) or function(*given)


def nearly_riding(seed):
    """Walls near and at 1 g, on which a ball is lifted off or bounces hardly at all; flat ones; free falls."""
    walls = [Sine.from_acceleration(gamma, 50.0, G) for gamma in (0, 0.5, 1, 1 + 1e-15, 1 + 1e-12, 1 + 1e-9, 1.5, 1e4)]
    fall = Motion(lambda t: G * (0.1 * t - 0.5 * t * t))
    rng = np.random.default_rng(seed)
    for wall in [*walls, Piecewise([0.0, 0.3, 1.0], np.zeros((2, 2))), fall, Piecewise(spline()[1])]:
        for side in (1.0, -1.0):
            plate = records(wall, side, 0.9, t_start=0.3)
            for pull in (side * G, 0.0):
                for t in rng.uniform(0.3, 0.9, 4):
                    yield rng, plate, float(t), pull


def test_nothing_crawls(monkeypatch):
    asked, worst = [], 0
    monkeypatch.setattr(gr.walls.hits, "flight", counted(gr.walls.hits.flight, asked))
    monkeypatch.setattr(gr.walls.hits, "pressed", counted(gr.walls.hits.pressed, asked))
    for rng, plate, t, pull in nearly_riding(9):
        s, rate = lift_off(*plate, t, 0.0, pull, INF)
        gaps = [(0.0, 0.0), (10.0 ** rng.uniform(-20, -2), rng.normal() * 10.0 ** rng.uniform(-10, 0)), (1e-3, -1e-15)]
        for gap, speed in gaps:
            first_hit(*plate, t, 0.0, gap, speed, pull, INF)
        if s < 0.9 - t and rate >= 0.0:
            assert first_hit(*plate, t, s, 0.0, rate, pull, INF) > 1e-12
        worst, asked[:] = max(worst, len(asked)), []
    assert worst < 1500


def test_a_high_ball_asks_for_few_places_of_the_wall(monkeypatch):
    wall, asked = Sine.from_acceleration(20.0, 50.0, G), []
    plate = records(wall)
    monkeypatch.setattr(gr.walls.hits, "flight", counted(gr.walls.hits.flight, asked))
    s = first_hit(*plate, 0.0, 0.0, 0.0, 500 * wall.amplitude * wall.omega, G, INF)
    assert s * wall.frequency > 60
    assert len(asked) < 12
    assert first_hit(*plate, 0.0, 0.0, 1e3, 1.0, -G, INF) == INF  # under a ceiling
    assert len(asked) < 14


@pytest.mark.parametrize("pull", [0.0, G])
def test_a_wall_that_does_not_move(pull):
    plate = records(Sine(0.0, 7.0))
    hit = first_hit(*plate, 3.0, 0.1, 2.0, -0.5, pull, INF)
    assert hit == pytest.approx(2.0 / 0.5 if pull == 0.0 else (math.sqrt(0.25 + 4 * G) - 0.5) / G, rel=1e-15)
    assert lift_off(*plate, 3.0, 0.1, G, INF) == (INF, 0.0)


# --- the path -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late", [0.0, 1.0, 1e3, 1e6])
def test_late_times_cost_no_digits(late):
    rng, wall = np.random.default_rng(1), Sine(0.7, 1.3, 0.4)
    plate, omega = records(wall, -1.0, start=2.0, velocity=0.5, t_start=0.25), 2 * mp.pi * mp.mpf(1.3)
    begin = mp.sin(omega * 0.25 + mp.mpf(0.4))
    for _ in range(40):
        t, tail = float(late / 1.3 * rng.uniform(1, 2)), float(rng.uniform(0, 10))
        time = mp.mpf(t) + mp.mpf(tail)
        theta = omega * time + mp.mpf(0.4)
        x, v, a = wall_at(*plate, t, tail)
        moved = mp.mpf(0.7) * (mp.sin(theta) - begin)
        assert abs(x - (2 + 0.5 * (time - 0.25) + moved)) <= 1e-15 * 0.7 + 4e-16 * abs(x)
        assert abs(v - 0.5 - mp.mpf(0.7) * omega * mp.cos(theta)) <= 1e-15 * 0.7 * omega
        assert abs(a + mp.mpf(0.7) * omega**2 * mp.sin(theta)) <= 1e-15 * 0.7 * omega**2
        turns = theta / (2 * mp.pi)
        assert abs(mp.sin(mp.pi * (phase(plate[0], t, tail) - turns))) < 2e-15


def test_where_the_wall_stands_at_the_start():
    wall = Sine(0.1, 3.0, 0.7)
    plate = records(wall, start=1.5, velocity=-0.2, t_start=0.4)
    x, v, _ = wall_at(*plate, 0.4, 0.0)
    assert x == pytest.approx(1.5, rel=1e-16)
    assert v == pytest.approx(-0.2 + wall.velocity(0.4), rel=1e-15)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_expansion_is_the_path(side):
    rng, plate = np.random.default_rng(2), records(Sine(0.7, 1.3, 0.4), side)
    for t in rng.uniform(0, 50, 20):
        series = [0.0] * 20
        end = expansion(*plate, float(t), 0.0, series)
        assert 0.0 < end <= 1.0 / (8 * 1.3)
        for s in (0.0, 0.3 * end, end):
            x, v, a = path.moved(*plate, float(t), s)
            p = Polynomial(series)
            assert [p(s), p.deriv()(s), p.deriv(2)(s)] == pytest.approx([x, v, a], rel=1e-13, abs=3e-14)


# --- riding -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("gamma", [1.0 + 1e-12, 1.0 + 1e-6, 1.01, 3.0, 100.0])
def test_lift_off_where_the_wall_falls_as_the_ball_does(gamma, side):
    wall = Sine.from_acceleration(gamma, 50.0, G, 0.0 if side > 0 else math.pi)
    floor = records(wall, side)
    s, rate = lift_off(*floor, 20.0, -1e-3, G, INF)
    a, omega = mp.mpf(wall.amplitude), 2 * mp.pi * 50
    off = 0 if side > 0 else mp.mpf(wall.phase) - mp.pi
    when = (mp.asin(G / (a * omega**2)) - off) / omega + mp.mpf(1e-3)
    allowed = 4 * NOISE * gamma / max(math.sqrt(gamma**2 - 1), 1e-7) / wall.omega
    assert rate == 0.0
    assert abs(s - when) <= allowed + 1e-16 * s
    x = after(*floor, 20.0, -1e-3, 0.0, 0.0, G, s)
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


# --- the ball that bounces on a shaken plate ------------------------------------------------------------------------


def orbit(case, gamma):
    """The plate of Γ, and time, velocity of the impacts of the orbit that takes k periods a flight; g = ω = 1."""
    wall, k = Sine.from_acceleration(gamma, 0.5 / math.pi, 1.0), case["k"]
    when = math.acos(case["gamma_exists"] / gamma)
    return wall, when, k * math.pi


def bounce(plate, eps, t, tail, v):
    """Next impact from one at t + tail after which the ball has velocity v: its time and velocity after it."""
    _, w, _ = wall_at(*plate, t, tail)
    s = first_hit(*plate, t, tail, 0.0, v - w, 1.0, INF)
    _, closing = after(*plate, t, tail, 0.0, v - w, 1.0, s)
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


# --- paths of other kinds -----------------------------------------------------------------------------------------


def spline(seed=5):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.05, 0.3, 30))
    return t, CubicSpline(t, rng.normal(size=30) * 0.01)


def test_a_spline_is_its_own_wall():
    t, cubic = spline()
    wall = Piecewise(cubic)
    assert wall == Piecewise(t, cubic.c)
    for x in np.random.default_rng(0).uniform(t[0], t[-1], 50):
        assert wall.displacement(x) == pytest.approx(float(cubic(x)), abs=1e-16)
        assert wall.velocity(x) == pytest.approx(float(cubic(x, 1)), abs=1e-14)
        assert wall.acceleration(x) == pytest.approx(float(cubic(x, 2)), abs=1e-12)
    assert not wall.panels(t[0], t[-1]).records()[1]["jump"].any()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_first_hits_on_a_spline(side):
    t, cubic = spline()
    wall, rng = Piecewise(cubic), np.random.default_rng(6)
    plate = records(wall, side, t[-1], t_start=t[0])
    hits = 0
    for _ in range(60):
        now, gap, rate = float(rng.uniform(t[0], t[-1])), 10.0 ** rng.uniform(-6, -1), rng.normal() * 0.1
        pull = side * float(rng.choice([0.0, 0.3]))
        found = first_hit(*plate, now, 0.0, gap, rate, pull, INF)
        first = INF
        for i in np.flatnonzero(t[1:] > now):
            start = max(now, t[i])
            m = side * Polynomial(cubic.c[::-1, i])(Polynomial([start - t[i], 1.0]))
            ball = Polynomial([gap + side * cubic(now), rate + side * cubic(now, 1), -0.5 * pull])
            roots = (ball(Polynomial([start - now, 1.0])) - m).roots()
            good = [r.real for r in roots if abs(r.imag) < 1e-12 and 0 <= r.real <= t[i + 1] - start]
            if good:
                first = min(good) + start - now
                break
        hits += found < INF
        assert found == pytest.approx(first, rel=1e-9)
    assert hits > 20


class ExactPieces:
    """A gap beside a path of polynomials, its panels taken as exact."""

    def __init__(self, panels, side, t, gap, rate, pull):
        self.t, self.side, self.edges, self.pull = mp.mpf(t), side, [mp.mpf(float(x)) for x in panels.edges], pull
        self.series = [[side * mp.mpf(float(c)) for c in row[::-1]] for row in panels.series]
        k = np.searchsorted(panels.edges, t, side="right") - 1
        self.first_piece, (m, v) = k, self.moved(k, mp.mpf(0))
        self.height, self.drift = gap + m, rate + v
        extent = float(np.abs(panels.series).sum(axis=1).max())
        self.noise = lambda s: NOISE * (gap + 2 * extent + s * (abs(rate) + 20 * extent + 0.5 * abs(pull) * s))

    def moved(self, k, s):
        half = (self.edges[k + 1] - self.edges[k]) / 2
        m, v, x = mp.mpf(0), mp.mpf(0), (self.t + s - self.edges[k]) / half - 1
        for c in self.series[k]:
            m, v = m * x + c, v * x + m
        return m, v / half

    def on(self, k, s):
        m, v = self.moved(k, mp.mpf(s))
        return self.height + s * (self.drift - self.pull * s / 2) - m, self.drift - self.pull * s - v

    def __call__(self, s):
        last = len(self.series) - 1
        return self.on(min(last, max(k for k in range(last + 1) if self.edges[k] <= self.t + s)), mp.mpf(s))

    def first(self, limit):
        for k in range(self.first_piece, len(self.series)):
            begin, end = max(mp.mpf(0), self.edges[k] - self.t), self.edges[k + 1] - self.t
            n = len(self.series[k])
            at = [begin + (end - begin) * mp.mpf(i) / (n - 1) for i in range(n)]
            values = mp.matrix([self.on(k, s)[0] for s in at])
            powers = mp.lu_solve(mp.matrix([[s**j for j in range(n)] for s in at]), values)
            roots = mp.polyroots(list(powers)[::-1], maxsteps=500, extraprec=200)
            good = [r.real for r in map(mp.mpc, roots) if abs(r.imag) < mp.mpf(10) ** -20 and begin <= r.real <= end]
            down = [s for s in good if self.on(k, s)[1] < 0]
            if down:
                return min(down)
        return mp.inf


@pytest.mark.filterwarnings("ignore:Descending")
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_first_hits_on_paths_with_corners(side):
    rng, hits, near = np.random.default_rng(11), 0, 0
    for _ in range(60):
        t = np.append(0.0, np.cumsum(rng.uniform(0.2, 1.0, 4)))
        c = rng.normal(size=(5, 4)) * [[0.3], [0.5], [1.0], [1.0], [0.0]]
        for i in range(3):  # positions go on, velocities do not
            c[4, i + 1] = np.polyval(c[:, i], t[i + 1] - t[i])
        panels = Piecewise(t, c).panels(0.0, t[-1])
        pull, now = side * float(rng.choice([0.0, 1.0])), float(rng.uniform(0, 0.5 * t[-1]))
        s = float(rng.uniform(0.0, t[-1] - now))  # a ball that comes near at s with the wall's velocity
        zero = ExactPieces(panels, side, now, 0.0, 0.0, pull)
        margin = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-15, -2))
        dip, closing = zero(s)
        rate = -float(closing)
        gap = float(margin - dip - rate * s)
        if gap <= 0.0:
            continue
        exact = ExactPieces(panels, side, now, gap, rate, pull)
        plate = records(panels, side, t[-1], t_start=0.0)
        found = first_hit(*plate, now, 0.0, gap, rate, pull, INF)
        hits, near = hits + (found < INF), near + 1
        assert_first(exact, found, INF)
    assert hits > 10
    assert near > 20


def test_a_corner_kicks_or_leaves_what_rests():
    saw = Piecewise([0.0, 1.0, 2.0, 3.0], [[0.1, -0.1, 0.3], [0.0, 0.1, 0.0]])
    plate = records(saw, t_end=3.0)
    assert lift_off(*plate, 0.25, 0.0, G, INF) == (0.75, pytest.approx(0.2, rel=1e-14))
    assert lift_off(*plate, 1.5, 0.0, G, INF) == (0.5, pytest.approx(-0.4, rel=1e-14))
    assert lift_off(*plate, 1.5, 0.0, G, 0.4) == (INF, 0.0)
    assert lift_off(*plate, 2.5, 0.0, G, INF) == (INF, 0.0)
    hit = first_hit(*plate, 1.0, 0.0, 1e-9, 0.1 + 0.5e-9, 0.0, INF)  # rises with 0 beside a wall that falls, then rises
    assert hit == pytest.approx(1.0 + 1.0 / 3.0, rel=1e-8)


def test_a_function_becomes_panels_and_is_saved_as_such():
    sine = Sine(0.01, 2.0, 0.3)
    wall = Motion(lambda t: 0.01 * math.sin(4 * math.pi * t + 0.3))
    panels = wall.panels(0.0, 3.0)
    assert panels.error < 1e-14 * 3
    assert wall.panels(0.0, 3.0) == panels
    for t in np.linspace(0, 3, 61):
        assert abs(panels.displacement(t) - sine.displacement(t)) <= panels.error
        assert panels.velocity(t) == pytest.approx(sine.velocity(t), abs=1e-11 * sine.omega * 0.01)
    saved = Motion(pickle.loads(pickle.dumps(panels)))
    assert saved.panels(0.0, 3.0) == panels
    plate, same = (records(x, t_end=3.0) for x in (wall, sine))
    for rate in np.linspace(0.05, 1.0, 20):
        one_hit, other = (first_hit(*x, 0.1, 0.0, 0.0, float(rate), G, INF) for x in (plate, same))
        assert one_hit == pytest.approx(other, rel=1e-10)


def test_a_motion_with_a_fast_part_has_panels_where_it_is():
    wall = Motion(lambda t: 0.01 * math.exp(-((t - 3.7) / 0.01) ** 2) + 0.1 * t)
    panels = wall.panels(0.0, 10.0)
    widths = np.diff(panels.edges)
    assert widths.min() < 0.03
    assert widths.max() > 0.2
    for t in np.linspace(3.6, 3.8, 50):
        assert abs(panels(t) - wall.displacement(t)) <= panels.error


# --- one source ---------------------------------------------------------------------------------------------------


@pytest.mark.soak
@pytest.mark.skipif(not _kernels.have_numba(), reason="numba is not installed")
def test_plain_and_compiled_give_the_same_bits():
    t, cubic = spline()
    fast = {f: _kernels.compiled(f) for f in (wall_at, after, first_hit, lift_off, pressing_bounds, expansion, phase)}
    for rng, sine, side, now, tail, pull in scenes(40, 8):
        for wall, time in ((sine, now), (Piecewise(cubic), float(rng.uniform(t[0], t[-1])))):
            w, p = wall.panels(time, time).records(side)
            slow, quick = (plain(w)[0], plain(p)), (one(w), p)
            gap, rate = any_gap(rng, sine)
            later = tail if wall is sine else 1e-4
            s = first_hit(*slow, time, later, gap, rate, pull, 1e3)
            assert fast[first_hit](*quick, time, later, gap, rate, pull, 1e3) == s
            s = min(s, 0.7)
            assert fast[after](*quick, time, later, gap, rate, pull, s) == after(*slow, time, later, gap, rate, pull, s)
            assert fast[wall_at](*quick, time, later) == wall_at(*slow, time, later)
            assert fast[lift_off](*quick, time, later, pull, 1e3) == lift_off(*slow, time, later, pull, 1e3)
            assert fast[pressing_bounds](*quick, time, later, pull, s) == pressing_bounds(*slow, time, later, pull, s)
            series, other = [0.0] * 20, np.zeros(20)
            assert fast[expansion](*quick, time, later, other) == expansion(*slow, time, later, series)
            assert series == other.tolist()
    w, _ = Sine(1.0, 3.0).panels().records()
    assert fast[phase](one(w), 1e5, 0.3) == phase(plain(w)[0], 1e5, 0.3)


def test_walls_of_one_scene_share_an_array():
    a, b = Sine(0.1, 3.0), Piecewise(spline()[1])
    floor, below = a.panels().records()
    ceiling, above = b.panels(1.0, 2.0).records(-1.0, first=len(below), t_start=1.0)
    rows = plain(np.concatenate([below, above]))
    assert wall_at(plain(ceiling)[0], rows, 1.5, 0.0) == wall_at(*records(b, -1.0, 2.0, t_start=1.0), 1.5, 0.0)
    assert wall_at(plain(floor)[0], rows, 1.5, 0.0) == wall_at(*records(a), 1.5, 0.0)


# --- values and what is refused -----------------------------------------------------------------------------------


def parabola(t):
    return t * t


@pytest.mark.parametrize("wall", [Sine(0.1, 3.0), Piecewise([0.0, 1.0, 2.0], [[1.0, -1.0], [0.0, 1.0]]),
                                  Motion(parabola), Motion(parabola).panels(0.0, 1.0)], ids=lambda w: type(w).__name__)
def test_walls_are_values(wall):
    same = pickle.loads(pickle.dumps(wall))
    assert same == wall
    assert hash(same) == hash(wall)
    assert wall != "wall"
    with pytest.raises(dataclasses.FrozenInstanceError):
        wall.anything = 1


def test_walls_differ_where_their_numbers_do():
    assert Sine(0.1, 3.0) != Sine(0.1, 3.0, 1e-9)
    assert Piecewise([0.0, 1.0], [[1.0]]) != Piecewise([0.0, 2.0], [[1.0]])
    assert Motion(parabola) != Motion(parabola, 1e-12)
    assert Sine.from_acceleration(2.0, 50.0).amplitude == pytest.approx(2.0 * 9.81 / (100 * math.pi) ** 2, rel=1e-15)


def jump(t):
    return 1.0 if t > 0.3 else 0.0


@pytest.mark.parametrize("gap", [1e15, 1e40, 1e300])
def test_a_fall_so_long_that_no_float_knows_the_phase_is_no_endless_search(gap):
    """It hangs no run: the wall is taken to be hit when the ball comes to it."""
    wall, panels = records(Sine(1e-3, 20.0))
    fall = first_hit(wall, panels, 0.0, 0.0, gap, -0.0, 9.81, math.inf)
    assert fall == pytest.approx(math.sqrt(2.0 * gap / 9.81), rel=1e-9)


MISUSE = [
    (lambda: Sine(-1.0, 3.0), r"amplitude is -1.0: a finite number of at least 0 and at most 1e\+150 is needed; a"),
    (lambda: Sine(math.nan, 3.0), "amplitude is nan: a finite number"),
    (lambda: Sine(1.0, 0.0), "frequency is 0.0: a finite number above 0 is needed; for a wall that does not move"),
    (lambda: Sine(1.0, "3"), "frequency is '3': a single number is needed"),
    (lambda: Sine(1.0, 3.0, INF), "phase is inf: a finite number"),
    (lambda: Sine(1e100, 1e30), r"\(2π frequency\)² amplitude is [0-9.]+e\+161: .* at most 1e\+150 is needed"),
    (lambda: Sine(1e300, 20.0), r"amplitude is 1e\+300: .* at most 1e\+150 is needed"),
    (lambda: Sine.from_acceleration(-1.0, 3.0), "gamma is -1.0: a finite number of at least 0"),
    (lambda: Sine.from_acceleration(1.0, -3.0), "frequency is -3.0: a finite number above 0"),
    (lambda: Sine.from_acceleration(1.0, 3.0, 0.0), "gravity is 0.0: a finite number above 0"),
    (lambda: Piecewise([0.0, 1.0]), "coefficients is None: an array .* is needed, or a scipy.interpolate.PPoly alone"),
    (lambda: Piecewise([0.0], [[]]), "breaks has 1 entries: at least 2 are needed"),
    (lambda: Piecewise([0.0, 0.0], [[1.0]]), r"breaks\[0\] is 0.0: breaks must increase"),
    (lambda: Piecewise([0.0, INF], [[1.0]]), r"breaks\[1\] is inf: a finite time"),
    (lambda: Piecewise([0.0, 1.0, 2.0], [[1.0]]), r"shape of coefficients is \(1, 1\): \(1, 2\) is needed; one column"),
    (lambda: Piecewise([0.0, 1.0], [[math.nan]]), r"coefficients\[0\] is nan: a finite number"),
    (lambda: Piecewise([0.0, 1.0], np.zeros((21, 1))), "coefficients has 21 rows: 1 to 20 are needed"),
    (lambda: Piecewise([0.0, 1.0, 2.0], [[0.0, 0.5]]),
     r"coefficients make the wall jump by 0.5 m at breaks\[1\] = 1: a continuous path is needed"),
    (lambda: Piecewise(PPoly(np.zeros((2, 1, 3)), [0.0, 1.0])), "shape of coefficients is"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(0.0, 1.5), "t_end is 1.5: a number .* at most 1 .*there the path"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(0.0, INF), "t_end is inf: .*there the path of the wall ends"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(-0.5, 1.0), "t_start is -0.5: .*there the path of the wall begins"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).velocity(3.0), "t is 3.0"),
    (lambda: Motion(3.0), "function is 3.0: a function m"),
    (lambda: Motion(parabola, 0.0), "accuracy is 0.0"),
    (lambda: Motion(parabola).panels(0.0, INF), "t_end is inf: a finite number of at least 0 is needed; .*give t_end"),
    (lambda: Motion(parabola).panels(1.0, 0.5), "t_end is 0.5"),
    (lambda: Motion(lambda t: math.nan).panels(0.0, 1.0), r"function\(\S+\) is nan: a finite number is needed"),
    (lambda: Motion(lambda t: "up").panels(0.0, 1.0), r"function\(\S+\) is 'up': a single number is needed"),
    (lambda: Motion(jump).panels(0.0, 1.0), r"function is not smooth near t = 0\.3"),
    (lambda: Motion(lambda t: abs(t - 0.3)).panels(0.0, 1.0), r"function is not smooth near t = 0\.3"),
    (lambda: Motion(Motion(parabola).panels(0.0, 1.0)).panels(0.0, 2.0), "t_end is 2.0: .*there the path"),
    (lambda: Panels([0.0], [[1.0]]), "edges has 1 entries"),
    (lambda: Panels([0.0, 1.0], np.zeros((1, 21))), "series has 21 coefficients"),
]


@pytest.mark.parametrize(("make", "message"), MISUSE)
def test_misuse_is_one_sentence(make, message):
    with pytest.raises((TypeError, ValueError), match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith((".", "?"))


@pytest.mark.parametrize("end", [3e-4, 0.01, 0.0464, 0.1, 0.15, 1.0])
@pytest.mark.parametrize("height", [0.0, 0.3])
def test_smooth_functions_are_fitted_over_any_span(end, height):
    panels = Motion(lambda t: height + 1e-3 * math.sin(200.0 * t)).panels(0.0, end)
    times = 0.2 * math.ulp(end)  # what the rounding of a time moves it by
    assert panels.error < 6e-15 * (height + 1e-3 * min(1.0, 200.0 * end)) + 10 * times
    for t in np.linspace(0.0, end, 23).tolist():
        exact = mp.mpf(height) + mp.mpf(1e-3) * mp.sin(200 * mp.mpf(t))
        assert abs(panels.displacement(t) - exact) <= 2 * panels.error + 2.0**-53 * height


def test_a_function_with_too_many_turns_is_refused(monkeypatch):
    monkeypatch.setattr("granular.walls.motion.MOST", 100)
    with pytest.raises(ValueError, match=r"takes more than 100 polynomials, .* up to t = 0\.0\d*: a motion"):
        Motion(lambda t: math.sin(2e4 * t)).panels(0.0, 1.0)


def some_panels(random, n, frequency):
    """Edges of n panels, and their ends, left and right: places in m and slopes in m per unit of the edges, (2, n)."""
    widths = 10.0 ** random.uniform(-2.0, 0.0, n)
    edges = np.append(0.0, np.cumsum(widths) / widths.sum())
    edges[-1] = 1.0
    ends = 10.0 ** random.uniform(-6.0, 3.0) * random.normal(size=(2, n + 1))
    if frequency:
        ends[:, -1] = ends[:, 0]
    return edges, ends[:, :-1].copy(), ends[:, 1:].copy()


def cubics(edges, left, right):
    """The cubics with those ends."""
    (a, b), (p, q) = (left[0], right[0]), 0.5 * np.diff(edges) * np.array([left[1], right[1]])
    return np.array([2 * (a + b) + p - q, 3 * (b - a) - p - q, q - p, a - b + p + q]).T / 4


@pytest.mark.parametrize("frequency", [0.0, 20.0])
@pytest.mark.parametrize("order", [0, 1])
def test_random_panels_that_do_not_join_are_refused(order, frequency):
    """A corner of a periodic path was left out without a word; a path that does not repeat itself may have some, and
    ends where it likes."""
    for seed in range(100):
        random = np.random.default_rng([order, seed])
        n = int(random.integers(1, 8))
        edges, left, right = some_panels(random, n, frequency)
        panels = Panels(edges, cubics(edges, left, right), frequency=frequency)
        turns = np.array([panels.displacement(t) for t in edges[:-1] / (frequency or 1.0)])
        assert turns == pytest.approx(left[0], rel=1e-12, abs=1e-12 * abs(right[0]).max())
        k = int(random.integers(n))
        left[order, k] += (by := random.choice([-1.0, 1.0]) * abs(left).max() * 10.0 ** random.uniform(-4.0, 2.0))
        if (k == 0 or order == 1) and not frequency:
            assert Panels(edges, cubics(edges, left, right)).velocity(edges[k]) == pytest.approx(left[1, k], rel=1e-12)
            continue
        said = ("series jumps by {:g} m", "velocity jumps by {:g} m/s")[order].format(by * (frequency or 1.0) ** order)
        with pytest.raises(ValueError, match=rf"^{re.escape(said)} where panel {k} begins: .*[^\n]\.$"):
            Panels(edges, cubics(edges, left, right), frequency=frequency)

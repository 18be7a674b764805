"""Where a moving wall is: late times in 40 digits, series, splines, functions and the panels made of them."""

import math
import pickle
import re

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from granular._engine.records import plain
from granular.scene.walls import Motion, Panels, Piecewise, Sine, path
from granular.scene.walls.hits import first_hit
from granular.scene.walls.path import expansion, phase, wall_at
from tests.helpers.walls_at_random import INF, G, records, spline

pytestmark = pytest.mark.usefixtures("forty_digits")


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


def test_walls_of_one_scene_share_an_array():
    a, b = Sine(0.1, 3.0), Piecewise(spline()[1])
    floor, below = a.panels().records()
    ceiling, above = b.panels(1.0, 2.0).records(-1.0, first=len(below), t_start=1.0)
    rows = plain(np.concatenate([below, above]))
    assert wall_at(plain(ceiling)[0], rows, 1.5, 0.0) == wall_at(*records(b, -1.0, 2.0, t_start=1.0), 1.5, 0.0)
    assert wall_at(plain(floor)[0], rows, 1.5, 0.0) == wall_at(*records(a), 1.5, 0.0)


# --- paths of other kinds --------------------------------------------------------------------------------------------


def test_a_spline_is_its_own_wall():
    t, cubic = spline()
    wall = Piecewise(cubic)
    assert wall == Piecewise(t, cubic.c)
    for x in np.random.default_rng(0).uniform(t[0], t[-1], 50):
        assert wall.displacement(x) == pytest.approx(float(cubic(x)), abs=1e-16)
        assert wall.velocity(x) == pytest.approx(float(cubic(x, 1)), abs=1e-14)
        assert wall.acceleration(x) == pytest.approx(float(cubic(x, 2)), abs=1e-12)
    assert not wall.panels(t[0], t[-1]).records()[1]["jump"].any()


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
    monkeypatch.setattr("granular.scene.walls.motion.MAX_WALL_PANELS", 100)
    with pytest.raises(ValueError, match="`function` must be representable by 100 polynomials, got 83 up to t = "
                                         r"0\.01171875 s\. Use a shorter run, or granular\.walls\.Sine for a "
                                         r"harmonic motion\."):
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


@pytest.mark.rotating
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
        said = f"got a jump of {by * (frequency or 1.0) ** order:g} {('m', 'm/s')[order]}"
        with pytest.raises(ValueError, match=rf"^`series` must .*{re.escape(said)} where panel {k} begins\. .*\.$"):
            Panels(edges, cubics(edges, left, right), frequency=frequency)

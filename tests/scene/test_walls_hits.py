"""First hits of moving walls: sines, splines and paths with corners, against 40 digits; the same bits compiled."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import granular as gr
from granular._engine import kernels
from granular._engine.records import one, plain
from granular.scene.walls import Motion, Piecewise, Sine
from granular.scene.walls.gap import GAP_NOISE, gap_at_time
from granular.scene.walls.hits import first_hit, lift_off, pressing_bounds
from granular.scene.walls.path import expansion, phase, wall_at
from tests.helpers.exact_walls import Exact, ExactPieces, assert_first
from tests.helpers.walls_at_random import INF, G, any_gap, records, scenes, spline

pytestmark = pytest.mark.usefixtures("forty_digits")


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


def test_first_hits_of_any_gap():
    for rng, wall, side, t, tail, pull in scenes(100, 0):
        gap, rate = any_gap(rng, wall)
        limit = 1e3 / wall.frequency
        s = first_hit(*records(wall, side), t, tail, gap, rate, pull, limit)
        assert_first(Exact(wall, side, t, tail, gap, rate, pull), s, limit)


@pytest.mark.rotating
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
            got = gap_at_time(*records(wall, side), t, tail, gap, rate, pull, s)
            exact = Exact(wall, side, t, tail, gap, rate, pull)
            of_rate = abs(rate) + min(wall.omega * s, 2.0) * wall.amplitude * wall.omega + abs(pull) * s
            of_gap = gap + s * of_rate if wall.omega * s < 0.1 else exact.noise(s) / GAP_NOISE
            assert abs(got[0] - exact(s)[0]) <= GAP_NOISE * of_gap
            assert abs(got[1] - exact(s)[1]) <= GAP_NOISE * (of_rate + of_gap / s)


def test_small_bounces_keep_their_digits_anywhere_on_the_path():
    wall = Sine.from_acceleration(0.7, 50.0, G, 0.3)
    plate = records(wall)
    for i, u in enumerate(10.0 ** np.linspace(-12, -2, 60)):
        tail, rate = 0.02 * i / 60, float(u) * wall.amplitude * wall.omega
        s = first_hit(*plate, 1.0, tail, 0.0, rate, G, INF)
        exact = Exact(wall, 1.0, 1.0, tail, 0.0, rate, G).first(1.0) if rate > 1e-7 else 0
        pressed = G - wall.amplitude * wall.omega**2 * math.sin(wall.omega * (1.0 + tail) + wall.phase)
        assert s == pytest.approx(float(exact) or 2 * rate / pressed, rel=1e-14 if exact else 1e-3 * u**0.25)
        gap, closing = gap_at_time(*plate, 1.0, tail, 0.0, rate, G, s)
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
    monkeypatch.setattr(gr.walls.hits, "closing_acceleration_at", counted(gr.walls.hits.closing_acceleration_at, asked))
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


@pytest.mark.parametrize("gap", [1e15, 1e40, 1e300])
def test_a_fall_so_long_that_no_float_knows_the_phase_is_no_endless_search(gap):
    """It hangs no run: the wall is taken to be hit when the ball comes to it."""
    wall, panels = records(Sine(1e-3, 20.0))
    fall = first_hit(wall, panels, 0.0, 0.0, gap, -0.0, 9.81, math.inf)
    assert fall == pytest.approx(math.sqrt(2.0 * gap / 9.81), rel=1e-9)


# --- paths of other kinds --------------------------------------------------------------------------------------------


@pytest.mark.rotating
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


@pytest.mark.rotating
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


# --- one source ------------------------------------------------------------------------------------------------------


@pytest.mark.soak
@pytest.mark.skipif(not kernels.have_numba(), reason="numba is not installed")
def test_plain_and_compiled_give_the_same_bits():
    t, cubic = spline()
    functions = wall_at, gap_at_time, first_hit, lift_off, pressing_bounds, expansion, phase
    fast = {f: kernels.compiled(f) for f in functions}
    for rng, sine, side, now, tail, pull in scenes(40, 8):
        for wall, time in ((sine, now), (Piecewise(cubic), float(rng.uniform(t[0], t[-1])))):
            w, p = wall.panels(time, time).records(side)
            slow, quick = (plain(w)[0], plain(p)), (one(w), p)
            gap, rate = any_gap(rng, sine)
            later = tail if wall is sine else 1e-4
            s = first_hit(*slow, time, later, gap, rate, pull, 1e3)
            assert fast[first_hit](*quick, time, later, gap, rate, pull, 1e3) == s
            s = min(s, 0.7)
            known = gap_at_time(*slow, time, later, gap, rate, pull, s)
            assert fast[gap_at_time](*quick, time, later, gap, rate, pull, s) == known
            assert fast[wall_at](*quick, time, later) == wall_at(*slow, time, later)
            assert fast[lift_off](*quick, time, later, pull, 1e3) == lift_off(*slow, time, later, pull, 1e3)
            assert fast[pressing_bounds](*quick, time, later, pull, s) == pressing_bounds(*slow, time, later, pull, s)
            series, other = [0.0] * 20, np.zeros(20)
            assert fast[expansion](*quick, time, later, other) == expansion(*slow, time, later, series)
            assert series == other.tolist()
    w, _ = Sine(1.0, 3.0).panels().records()
    assert fast[phase](one(w), 1e5, 0.3) == phase(plain(w)[0], 1e5, 0.3)

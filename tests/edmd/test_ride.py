"""Hard spheres on a driven wall: the bouncing ball, balls and piles that ride, and floors along straight lines."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import granular as gr
from granular.scene.walls import Piecewise, Sine
from tests.helpers.hard_driven import INF, drawn, plate, remainder, run, shaken

DOUBLING = json.loads(
    (Path(__file__).parents[1] / "reference" / "plate_period_doubling.json").read_text(encoding="utf-8")
)


# --- the bouncing ball


@pytest.mark.rotating
@pytest.mark.parametrize("case", DOUBLING, ids=str)
def test_period_doubling_where_the_exact_formula_says(case):
    """Γ = √(G_k² + [2(1+ε²)/(1+ε)²]²): a thousandth and more below it the orbit is stable, above it doubles."""
    eps, k = case["restitution"], case["k"]
    exists = k * math.pi * (1.0 - eps) / (1.0 + eps)
    assert math.isclose(exists, case["gamma_exists"], rel_tol=1e-13)
    doubles = math.hypot(exists, 2.0 * (1.0 + eps * eps) / (1.0 + eps) ** 2)
    assert math.isclose(doubles, case["gamma_doubles"], rel_tol=1e-13)
    for share, period in ((-0.002, 1), (0.002, 2)):
        gamma = doubles * (1.0 + share)
        phase = math.acos(exists / gamma)
        orbit = plate(1, shaken(gamma, phase=phase), gap=0.0, velocity=k * math.pi * (1.0 + 1e-4))
        log = run(orbit, eps, t_end=1e6, max_events=2000).contacts
        late = np.mod(log["t_begin"][-64:] / (2.0 * math.pi) + phase / (2.0 * math.pi), 1.0)
        assert np.ptp(late[::period]) < 1e-6 or np.ptp(late[::period]) < 1e-3 * abs(late[0] - late[1])
        assert (np.ptp(late) > 1e-3) == (period == 2)


# --- riding


def test_a_ball_rides_for_ever_below_one_g():
    result = run(plate(1, shaken(0.999)), 0.5, t_end=300.0, samples=np.linspace(100.0, 300.0, 41))
    assert result.status is gr.Status.time
    assert result.contacts["t_begin"][-1] < 60.0
    floor = 0.999 * np.sin(result.time)
    assert np.abs(result.position[:, 1] - floor - 0.1).max() < 1e-12
    assert np.abs(result.velocity[:, 1] - 0.999 * np.cos(result.time)).max() < 1e-13
    assert remainder(result) < 1e-14


@pytest.mark.parametrize("balls", [1, 3])
def test_what_rides_leaves_where_nothing_presses_it(balls):
    """From rest at Γ = 1.2: it leaves where sin ωt = 1/Γ, and comes back on a parabola; a pile as one ball does."""
    gamma = 1.2
    scene = plate(balls, shaken(gamma, phase=-0.5 * math.pi), gap=0.0)
    leaves = math.asin(1.0 / gamma)  # of the phase
    height, speed = gamma * math.sin(leaves), gamma * math.cos(leaves)

    def gap(t):
        return height + speed * t - 0.5 * t * t - gamma * math.sin(leaves + t)

    back = brentq(gap, 0.3, 6.0, xtol=1e-15, rtol=1e-15)
    result = run(scene, 0.5, t_end=leaves + 0.5 * math.pi + back + 1e-9, samples=400, collapse="merge")
    assert len(result.contacts) >= 1
    first = result.contacts[0]
    assert first["pair"] == 0
    assert abs(first["t_begin"] - (leaves + 0.5 * math.pi + back)) < 1e-13
    moving = (result.time > leaves + 0.5 * math.pi) & (result.time < first["t_begin"])
    flown = result.time[moving] - leaves - 0.5 * math.pi
    assert np.abs(result.gap[moving, 0] - [gap(t) for t in flown]).max() < 1e-13
    assert remainder(result) < 1e-14


def test_piles_ride_on_ceilings_too():
    """No gravity: a floor and its mirror image give mirrored runs, to the last bit for one ball."""
    for balls, eps in ((1, 0.5), (3, 0.5), (3, 0.0)):
        motion = Sine(0.1, 1.0, 2.0)
        m, v = [1.0, 2.0, 0.5][:balls], [-0.3, 0.1, -0.7][:balls]
        up = gr.Scene([INF, *m], [0.0] + [0.1] * balls, [0.5] * balls, [0.0, *v], floor=motion)
        down = gr.Scene([*m[::-1], INF], [0.1] * balls + [0.0], [0.5] * balls, [-x for x in v[::-1]] + [0.0],
                        ceiling=Sine(0.1, 1.0, 2.0 + math.pi))
        a, b = (run(s, eps, t_end=4.0, samples=30, max_events=400) for s in (up, down))
        assert len(a.contacts) == len(b.contacts) > 0
        assert np.abs(a.contacts["t_begin"] - b.contacts["t_begin"]).max() < 1e-11
        assert np.abs(a.gap - b.gap[:, ::-1]).max() < 1e-11
        assert np.abs(a.velocity + b.velocity[:, ::-1]).max() < 1e-11


def test_a_jump_of_the_wall_hits_or_leaves_what_rides():
    """A floor that starts and stops: it hits the ball on it, or lets it fly on."""
    rises = Piecewise([0.0, 1.0, 1.5, 3.0], [[0.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    result = run(plate(1, rises, gap=0.0), 0.5, t_end=2.9, samples=[0.99, 1.1, 1.4])
    assert result.contacts["t_begin"][0] == pytest.approx(1.0, abs=1e-14)
    assert result.contacts["v_in"][0].tolist() == [2.0, 0.0]
    assert result.velocity[1, 1] == pytest.approx(3.0 - 0.1, abs=1e-13)
    thrown = run(plate(1, Piecewise([0.0, 0.5, 3.0], [[2.0, 0.0], [0.0, 1.0]]), gap=0.0, velocity=2.0), 0.5, t_end=2.0,
                 samples=[0.49, 0.75])
    assert len(thrown.contacts) == 0
    assert thrown.gap[1, 0] == pytest.approx(0.25 * 2.0 - 0.5 * 0.25**2, abs=1e-14)


def test_a_floor_that_leaves_as_a_ball_arrives_does_not_pull_it():
    """No impulse, or that of a floor still at rest where rounding lets the ball arrive before the jump."""
    rng, pushed = np.random.default_rng(0), []
    for _ in range(40):
        arrives, speed, away = (float(rng.integers(1, 17)) / 8.0 for _ in range(3))
        g, eps = float(rng.choice([0.0, 1.0, 2.0])), float(rng.choice([0.0, 0.5, 1.0]))
        gap, impact = speed * arrives + 0.5 * g * arrives**2, speed + g * arrives
        leaves = Piecewise([0.0, arrives, arrives + 9.0], [[0.0, -impact - away], [0.0, 0.0]])
        scene = gr.Scene([INF, 1.0], [0.0, 0.0], [gap], [0.0, -speed], g, floor=leaves)
        t_end = arrives + (away / g if g else 1.0)  # half of the time to the next touch
        result = run(scene, eps, t_end=t_end, max_events=100)
        log = result.contacts
        exchanged = [impulse for impulse in log["impulse"] if impulse != 0.0]
        assert exchanged in ([], [pytest.approx((1.0 + eps) * impact, rel=1e-13)])
        assert (log["v_out"][:, 1] >= log["v_out"][:, 0]).all()
        if not exchanged:
            assert result.velocity[-1, 1] == pytest.approx(-speed - g * t_end, rel=1e-13)
        pushed.append(bool(exchanged))
    assert pushed.count(False) > 20


@pytest.mark.parametrize("up", [False, True])
def test_a_wall_that_leaves_pulls_no_ball_under_any_remedy(up):
    """Floors and ceilings, with and without a second ball, by both engines: free flight, and the same bits."""
    pytest.importorskip("numba")
    rng, sign = np.random.default_rng(1), 1.0 if up else -1.0
    remedies = [{}, {"tc": 1e-3}, {"elastic_below": 0.1}, {"collapse": "merge", "merge_below": 1e-3}]
    for remedy in remedies * 3:
        arrives, speed, away = (float(rng.integers(1, 17)) / 8.0 for _ in range(3))
        path = Piecewise([0.0, arrives, arrives + 9.0], [[0.0, sign * (speed + away)], [0.0, 0.0]])
        flip, second = slice(None, None, -1 if up else 1), int(rng.integers(2))
        scene = gr.Scene([INF, 1.0, 2.0][: 2 + second][flip], [0.0] * (2 + second),
                         [speed * arrives, 50.0][: 1 + second][flip],
                         [0.0, sign * speed, 0.0][: 2 + second][flip], **{"ceiling" if up else "floor": path})
        runs = [gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), engine=engine, t_end=arrives + 1.0, **remedy)
                for engine in ("sorted", "compiled")]
        assert len({(each.velocity.tobytes(), each.contacts.tobytes()) for each in runs}) == 1
        assert runs[0].velocity[-1][flip][1] == sign * speed
        assert len(runs[0].contacts) == 0
        stopped = gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), t_end=arrives + 1.0, **remedy,
                                   until=gr.until.contact(scene.n_pairs - 1 if up else 0, 1))
        assert stopped.status is gr.Status.time


def test_a_ball_hits_a_wall_that_left_it_when_the_wall_returns():
    """Before, the touch at 1 s was contact 1 for `until`, and a row without an impulse."""
    path = Piecewise([0.0, 1.0, 2.0, 9.0], [[0.0, 3.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, 0.0]])
    scene = gr.Scene([INF, 1.0, 2.0], [0.0] * 3, [1.0, 50.0], [0.0, -1.0, 0.0], floor=path)
    log = run(scene, 0.5, t_end=8.0).contacts
    returns = 1.0 + (3.0 - 1.0) / 3.0  # -3 s + 3 s² = -s
    assert log["t_begin"] == pytest.approx([returns], rel=1e-14)
    assert log["v_in"][0] == pytest.approx([-3.0 + 6.0 * (returns - 1.0), -1.0], rel=1e-13)
    assert run(scene, 0.5, t_end=8.0, until=gr.until.contact(0, 1)).time[-1] == pytest.approx(returns, rel=1e-14)
    assert gr.md.simulate(scene, gr.LinearDashpot(1e12), t_end=8.0).contacts["t_begin"] == pytest.approx([returns])


def test_what_rides_on_a_driven_floor_meets_a_driven_ceiling_when_there_is_no_room():
    """Both walls drive one ball: it rides on the floor until they leave it no room."""
    floor, ceiling = Sine(0.05, 0.5), Sine(0.5, 0.11, 0.3)
    scene = gr.Scene([INF, 1.0, INF], [0.0, 0.1, 0.0], [0.05, 0.55], [0.0] * 3, 9.81, floor=floor, ceiling=ceiling)

    def room(t):
        return 0.6 + ceiling.displacement(t) - ceiling.displacement(0.0) - floor.displacement(t)

    meet = brentq(room, 4.0, 6.0, xtol=1e-14)
    result = run(scene, 0.2, t_end=12.0, samples=60)
    assert result.status is gr.Status.collapse
    assert abs(result.time[-1] - meet) < 1e-8
    assert np.abs(result.gap.sum(axis=1) - [room(t) for t in result.time]).max() < 1e-14
    assert remainder(result) < 1e-13
    assert run(scene.replace(gap=[0.05, 0.65]), 0.2, t_end=40.0).status is gr.Status.time


def straight(breaks, slopes, gap, v, g, eps):
    """Hits (time, speed) of a ball above a floor that moves along straight lines, by hand."""
    t, x, y, j, rows, rests = 0.0, gap, 0.0, 0, [], False
    while j < len(slopes):
        w, left = slopes[j], breaks[j + 1] - t
        d, u = x - y, v - w
        if rests:
            v, h = w, math.inf
        elif d <= 0.0 and u < 0.0:
            h = 0.0
        elif g == 0.0:
            h = d / -u if u < 0.0 else math.inf
        else:
            s = math.sqrt(u * u + 2.0 * g * max(d, 0.0))
            h = (u + s) / g if u > 0.0 else 2.0 * max(d, 0.0) / (s - u)
        step = min(h, left)
        x, v = (x + w * step, v) if rests else (x + v * step - 0.5 * g * step * step, v - g * step)
        y, t = y + w * step, t + step
        if h <= left:
            rows.append((t, w - v))
            x, v = y, w + eps * (w - v)
            rests = v - w < 1e-13 and g > 0.0
        else:
            j, rests = j + 1, False
    return rows, x


@pytest.mark.parametrize("seed", range(20))
def test_floors_along_straight_lines(seed):
    """Every kind of jump, at times at which the clock is re-based too: all hits, and where the ball is at the end."""
    rng = np.random.default_rng(seed)
    breaks = np.r_[0.0, np.cumsum(rng.choice([0.25, 0.5, 1.0, 0.3], 6))]
    slopes = rng.normal(size=6) * rng.choice([0.2, 1.0])
    path = Piecewise(breaks, [slopes, np.r_[0.0, np.cumsum(slopes * np.diff(breaks))][:-1]])
    g, gap, v, eps = float(rng.choice([0.0, 1.0, 9.81])), float(rng.choice([0.3, 0.01])), float(rng.normal()), 0.3
    rows, x = straight(breaks, slopes, gap, v, g, eps)
    scene = gr.Scene([INF, 1.0], [0.0, 0.1], [gap], [0.0, v], g, floor=path)
    result = run(scene, eps, t_end=float(breaks[-1]))
    speed = result.contacts["v_in"][:, 0] - result.contacts["v_in"][:, 1]
    mine = [row for row in zip(result.contacts["t_begin"], speed, strict=True) if row[1] > 1e-9]
    assert np.allclose(mine, [row for row in rows if row[1] > 1e-9], rtol=0.0, atol=1e-12)
    assert abs(result.position[-1, 1] - 0.1 - x) < 1e-12
    assert remainder(result) < 1e-13


@pytest.mark.parametrize("seed", [210, 220])
def test_merging_at_an_instant_leaves_the_account_closed(seed):
    """Dozens of merges in one instant: what rounding may have left of velocities does not grow with each."""
    result = run(drawn(seed, touching=0.3), 0.5, t_end=5.0, samples=400, collapse="merge", merge_below=0.3,
                 max_events=2000)
    assert remainder(result) < 1e-12

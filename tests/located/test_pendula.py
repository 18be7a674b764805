"""Soft pendula by located events: the cradle's numbers, symmetries, resumed runs."""

import math

import numpy as np
import pytest

import granular as gr
from granular._engine.flight import hung_after, hung_rate_at_contact, hung_time_to_contact
from tests.helpers.soft_twin import distance, twin

CRADLE = gr.Scene([1.0] * 5, [0.1] * 5, [1.0, 0.0, 0.0, 0.0], [0.0] * 5, pendulum=1.0, origin=-1.0)
DASHPOT = gr.LinearDashpot.from_restitution(0.9, 1e6, CRADLE.pairs[0])


def test_the_touching_cradle_after_one_period():
    run = gr.md.simulate(CRADLE, DASHPOT, t_end=2.0 * math.pi, samples=101)
    y = run.position - CRADLE.at_rest
    assert np.abs(y.mean(axis=1) + 0.2 * np.cos(run.time)).max() < 1e-15  # the mass centre is one pendulum
    assert y[-1] == pytest.approx([-0.689972, -0.443893, -0.079961, 0.068495, 0.145331], abs=6e-7)
    assert run.energy()[-1] / run.energy()[0] == pytest.approx(0.705361, abs=6e-7)
    assert run.account()["dissipated"][-1] > 0.0


def test_the_next_contact_of_pendula_is_the_first_root():
    mp = pytest.importorskip("mpmath").MPContext()
    mp.dps = 40
    rng = np.random.default_rng(0)
    for _ in range(200):
        gap, d = (float(x) * (rng.random() < 0.8) for x in 10.0 ** rng.uniform(-9.0, 0.0, 2))
        omega, rate = float(rng.uniform(0.3, 3.0)), float(rng.normal() * 10.0 ** rng.uniform(-9.0, 0.0))
        t = hung_time_to_contact(gap, rate, omega, d)
        u, g, a = mp.mpf(rate) / omega, mp.mpf(gap), 2 * mp.mpf(d) - gap
        if not u * u > a * g:
            assert t == math.inf or u * u - a * g > -1e-16 * u * u
            continue
        center, swing = mp.mpf(d), mp.sqrt((g - d) ** 2 + u * u)
        now, touch = mp.atan2(-u, g - d), mp.acos(-center / swing)  # gap = d + swing cos(phase)
        first = min((way - now) % (2 * mp.pi) for way in (touch, 2 * mp.pi - touch)) / omega
        if gap == 0.0:
            first = (touch - now) % (2 * mp.pi) / omega if rate > 0.0 else mp.mpf(0)
        assert abs(t - first) <= 4e-15 * first + 1e-300
        assert hung_after(gap, rate, omega, d, t)[0] == pytest.approx(0.0, abs=4e-15 * float(swing))
        at_once = -omega * mp.sqrt(u * u - a * g)
        assert hung_rate_at_contact(gap, rate, omega, d) == pytest.approx(float(at_once), rel=1e-14, abs=1e-25)


@pytest.mark.rotating
@pytest.mark.parametrize("law", [DASHPOT, gr.Hertz(1e5), gr.TsujiHertz(1e6, 0.3), gr.WaltonBraun(1e4, 2e4)])
def test_what_the_log_says_of_balls_is_what_samples_show(law):
    scene = CRADLE.replace(mass=[1.0, 2.0, 0.5, 1.0, 3.0], rest_gap=[0.1, 0.0, 0.3, 0.0])
    end = 4.0 if isinstance(law, gr.WaltonBraun) else 10.0
    run = gr.md.simulate(scene, law, t_end=end)
    rows = run.contacts[:: max(1, len(run.contacts) // 5)]
    rows = np.sort(rows[rows["t_end"] < end], order="t_end")
    seen = gr.md.simulate(scene, law, t_end=end, samples=[0.0, *rows["t_end"]])
    assert len(rows) > 2
    for row, v in zip(rows, seen.velocity[1:], strict=True):
        stiff = 1e-15 * row["t_end"] * row["force_max"] / 0.5  # a rounding of the time
        assert v[row["pair"] :][:2] == pytest.approx(row["v_out"], abs=1e-13 + stiff)
    moment, fall = scene.mass @ scene.velocity, scene.mass @ scene.displacement
    want = moment * math.cos(end) - fall * math.sin(end)
    assert scene.mass @ run.velocity[-1] == pytest.approx(want, abs=1e-13 * abs(fall))


def test_mirrored_and_turned_back():
    scene = gr.Scene([1.0, 2.0, 0.7], [0.1] * 3, [0.2, 0.05], [0.4, -0.3, 0.1], pendulum=3.0, rest_gap=[0.1, 0.02])
    run = gr.md.simulate(scene, gr.Hertz(1e4), t_end=3.0)
    mirrored = scene.replace(mass=scene.mass[::-1], gap=scene.gap[::-1], rest_gap=scene.rest_gap[::-1],
                             velocity=-scene.velocity[::-1], origin=-float(scene.displacement[-1]))
    turned = gr.md.simulate(mirrored, gr.Hertz(1e4), t_end=3.0)
    assert turned.velocity[-1][::-1] == pytest.approx(-run.velocity[-1], abs=1e-12)
    back = scene.replace(gap=run.gap[-1], velocity=-run.velocity[-1],
                         origin=float(run.position[-1, 0] - scene.at_rest[0]))
    again = gr.md.simulate(back, gr.Hertz(1e4), t_end=3.0)
    assert len(run.contacts) >= 5
    assert again.velocity[-1] == pytest.approx(-scene.velocity, abs=1e-10)
    assert again.gap[-1] == pytest.approx(scene.gap, abs=1e-10)


@pytest.mark.rotating
def test_between_walls_and_swinging_together():
    scene = gr.Scene([math.inf, 1.0, 2.0, math.inf], [0.0, 0.1, 0.1, 0.0], [0.1, 0.2, 0.3], [0.0, 2.0, -1.0, 0.0],
                     pendulum=1.5, rest_gap=[0.3, 0.0, 0.3])
    boxed = gr.md.simulate(scene, gr.Hertz(1e4), t_end=9.0, samples=10)
    assert {0, 1, 2} == {*boxed.contacts["pair"]}
    assert boxed.energy() == pytest.approx(boxed.energy()[0], rel=1e-12)
    assert boxed.gap.sum(axis=1) == pytest.approx(0.6, abs=1e-13)
    together = gr.md.simulate(CRADLE, DASHPOT, t_end=60.0 * math.pi, samples=3)
    assert together.energy()[-1] == pytest.approx(together.energy()[0] / 5.0, rel=1e-2)
    assert together.status is gr.Status.time


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(6))
def test_isolated_contacts_are_those_by_pieces(seed):
    rng = np.random.default_rng([6, seed])
    n = 2 + seed % 4
    scene = gr.Scene(rng.uniform(0.5, 2.0, n), [0.1] * n, rng.uniform(0.05, 0.3, n - 1), rng.normal(size=n),
                     pendulum=float(rng.uniform(1.0, 9.0)),
                     rest_gap=rng.uniform(0.0, 0.1, n - 1) * (seed % 2))
    law = [gr.LinearDashpot(1e5, 3.0), gr.LinearDashpot(1e4), gr.Hertz(1e6)][seed % 3]
    other = twin(scene, law, t_end=1.6, samples=21)
    one = gr.md.simulate(scene, law, t_end=1.6, samples=21)
    assert distance(one, other) < 1e-11
    assert one.gap == pytest.approx(other.gap, abs=1e-12)
    assert one.stats["isolated"] == other.stats["isolated"] >= 1
    assert one.stats["steps"] < other.stats["steps"] or seed % 3 == 2
    for name in ("duration", "impulse", "xi_max", "force_max"):
        assert one.contacts[name] == pytest.approx(other.contacts[name], rel=1e-10)


def test_what_cannot_be_asked_of_pendula():
    with pytest.raises(ValueError, match=r"`disturbed` must be 'resolve' or 'stop' for pendula, got 'ignore'\. "
                                         "Setting pendula that touch early back to gap 0 would change their "
                                         r"energy\."):
        gr.md.simulate(CRADLE, DASHPOT, t_end=1.0, disturbed="ignore")
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run of pendula does not end by itself"):
        gr.md.simulate(CRADLE, DASHPOT)
    stop = gr.md.simulate(CRADLE, DASHPOT, t_end=9.0, disturbed="stop")
    assert (stop.status, stop.first_disturbed[1]) == (gr.Status.disturbed, 0)
    assert gr.md.simulate(CRADLE, DASHPOT, until=gr.until.contact(1, 2)).status is gr.Status.until

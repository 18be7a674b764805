"""Runs of other programs and recordings next to both engines: their clock, first sample, flights and bounces.

The truth is a run of one engine whose clock, positions or velocities are altered, or a fall with drag in small steps.
"""

import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

import granular as gr
from granular.comparison.input_warnings import warnings

INF = math.inf
SCENES = {
    "drop": (gr.Scene([INF, 1.0], [0.0, 0.05], [1.0], [0.0, 0.0], gravity=9.81), gr.LinearDashpot(1e6, 100.0), 2.0),
    "two balls": (gr.Scene([INF, 1.0, 0.3], [0.0, 0.05, 0.03], [0.5, 0.1], [0.0, 1.0, 0.0], gravity=9.81),
                  gr.Hertz(1e9), 1.0),
    "line": (gr.Scene([1.0, 2.0, 0.5], [0.05] * 3, [0.01, 0.2], [2.0, 0.0, -1.0]), gr.ViscoelasticHertz(1e8, 1e3), 0.5),
    "pendula": (gr.Scene([1.0, 2.0, 0.5], [0.05] * 3, [0.01, 0.02], [2.0, 0.0, -1.0], pendulum=4.0),
                gr.LinearDashpot(1e6, 100.0), 2.0),
}
DROP = SCENES["drop"][0]
REPORT = gr.compare(DROP, SCENES["drop"][1], t_end=2.0)
"""A ball that bounces three times in 2 s."""


def run_of(report, engine, times):
    options = {"t_end": float(times[-1]), "samples": times}
    return gr.edmd.simulate(report.scene, report.rule, **options) if engine == "hard" else gr.md.simulate(
        report.scene, report.law, **options)


def theirs(run, clock=0.0, position=0.0, velocity=0.0, unknown=()):
    """A run as another program would give it, on another clock, with velocities of some samples unknown."""
    other = gr.Trajectory.from_arrays(run.scene, run.time + clock, position=run.position + position,
                                      velocity=run.velocity + velocity)
    speeds = other.velocity.copy()
    speeds[list(unknown)] = math.nan
    return replace(other, velocity=speeds)


def offset_is_found(name, engine, rng, samples):
    scene, law, end = SCENES[name]
    report = REPORT if name == "drop" else gr.compare(scene, law, t_end=end)
    times = np.sort(rng.uniform(0.0, end, samples))
    clock, unknown = float(rng.uniform(-3.0, 3.0)), np.flatnonzero(rng.random(samples) < rng.choice([0.0, 0.5, 1.0]))
    apart = report.against(theirs(run_of(report, engine, times), clock, unknown=unknown))
    assert apart.offset == pytest.approx(clock, rel=0.0, abs=1e-12)
    assert np.allclose(apart.time, times, rtol=0.0, atol=1e-12)
    assert np.allclose(apart.gap[0], apart.gap[1 if engine == "hard" else 2], rtol=0.0, atol=1e-11)
    known = ~np.isin(np.arange(samples), unknown)
    balls = ~scene.is_wall
    difference = getattr(apart, engine)[:, balls]
    assert np.isnan(difference[~known]).all()
    # the state changes fast during a stiff contact
    assert np.abs(difference[known]).max(initial=0.0) < 1e-8
    assert not apart.notes
    assert f"Clock: their t = {apart.offset:.9g} s is t = 0 of the scene" in str(apart)


@pytest.mark.rotating
@pytest.mark.parametrize(("name", "engine"), [("drop", "hard"), ("line", "soft")])
def test_the_clock_of_a_run_is_found_to_rounding(name, engine):
    offset_is_found(name, engine, np.random.default_rng([7, len(name)]), 40)


@pytest.mark.soak
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("engine", ["hard", "soft"])
def test_clocks_are_found_to_rounding_over_scenes_and_samples(name, engine):
    rng = np.random.default_rng([8, len(name), len(engine)])
    for samples in (5, 20, 20, 100, 100, 1000):
        offset_is_found(name, engine, rng, samples)


def test_a_first_sample_in_the_initial_state_gives_the_clock_of_balls_that_touch():
    """No offset makes a model agree with (-1/3, 0, 0, 2/3, 2/3), and the report states that this is not an error."""
    scene = gr.Scene([1.0] * 5, [0.05] * 5, [0.0] * 4, [1.0, 0.0, 0.0, 0.0, 0.0])
    after = np.array([-1.0, 0.0, 0.0, 2.0, 2.0]) / 3.0
    other = gr.Trajectory.from_arrays(scene, [0.7, 0.8], position=scene.position + np.outer([0.0, 0.1], after),
                                      velocity=[scene.velocity, after])
    apart = gr.compare(scene, gr.LinearDashpot(1e6)).against(other)
    assert apart.offset == 0.7
    words = " ".join(str(apart).split())
    assert words.startswith("Not uniquely: ")
    assert "a difference from them is not an error of the other run" in words
    assert "velocity of ball 4, m/s 0.1 0.666667 1 0.9424" in words
    assert np.allclose(apart.velocity[:, 1, 3], [2 / 3, 0.0, 0.296218], atol=1e-6)


def test_a_run_without_motion_has_no_clock_and_one_before_the_scene_is_unknown_there():
    rest = gr.Scene([1.0, 2.0], [0.1, 0.1], [0.5], [0.0, 0.0])
    report = gr.compare(rest, gr.LinearDashpot(1e5), t_end=1.0)
    still = gr.Trajectory.from_arrays(rest, [-1.0, 0.5], gap=[[0.5]] * 2, velocity=np.zeros((2, 2)))
    apart = report.against(still)
    assert apart.offset == 0.0
    assert np.isnan(apart.soft[0]).all()
    assert not apart.soft[1].any()


@pytest.mark.rotating
@pytest.mark.parametrize(("altered", "sentence"), [
    ({"position": [0.0, 0.5]}, r"at t = 0 s the gap floor–1 is 1\.5 m, not 1 \(hard\) or 1 \(soft\)\."),
    ({"position": [0.0, -0.2]}, r"at t = 0 s the gap floor–1 is 0\.8 m, not 1 \(hard\) or 1 \(soft\)\."),
    ({"position": 0.5}, r"Positions: the wall is shifted by 0\.5 m\. Only gaps are compared\."),
    ({"velocity": [0.0, 1.0]}, r"the velocity of ball 1 is 1 m/s, not 0 \(hard\) or 0 \(soft\)\."),
])
@pytest.mark.parametrize("engine", ["hard", "soft"])
def test_shifted_positions_and_a_first_sample_that_contradicts_the_scene_are_reported(altered, sentence, engine):
    run = run_of(REPORT, engine, np.linspace(0.0, 2.0, 61))
    assert not REPORT.against(theirs(run)).notes
    apart = REPORT.against(theirs(run, **altered))
    assert apart.offset == 0.0
    (note,) = apart.notes
    assert re.search(sentence, note)
    assert note in " ".join(str(apart).split())


def test_a_table_has_the_numbers_side_by_side_with_units_in_80_columns():
    scene = gr.Scene([1.0] * 20, [0.05] * 20, [1e-3] * 19, [1.0] + [0.0] * 19)
    report = gr.compare(scene, gr.LinearDashpot(1e6, 10.0))
    run = run_of(report, "soft", np.linspace(0.0, 0.1, 11))
    text = str(report.against(theirs(run)))
    assert max(map(len, text.splitlines())) <= 80
    assert "velocity of ball 11, m/s" in text
    assert "gap 11–12, m" in text
    assert "gap 12–13, m" not in text
    assert "(8 balls with smaller differences not shown)" in text
    assert re.search(r"^ball 0, soft +1 +0 +0  never$", text, re.M)


def falling(drag, rate=60.0, noise=0.0, seed=0):
    """Positions of a ball dropped from 1 m with restitution 0.8, from at least 1000 semi-implicit steps per second."""
    height, speed, heights, steps = 1.0, 0.0, [], 40
    for _ in range(int(1.5 * rate)):
        heights.append(height)
        for _ in range(steps):
            speed -= (9.81 + drag * abs(speed) * speed) / (rate * steps)
            height += speed / (rate * steps)
            if height < 0.0:
                height, speed = -0.8 * height, -0.8 * speed
    places = np.array(heights) + np.random.default_rng(seed).normal(0.0, noise, len(heights))
    rows = np.stack([np.zeros(len(places)), 0.05 + places], axis=1)
    return gr.Trajectory.from_arrays(DROP, np.arange(len(places)) / rate, position=rows)


@pytest.mark.rotating
@pytest.mark.parametrize(("drag", "noise", "said"), [(0.0, 0.0, 0), (0.0, 1e-3, 0), (0.0, 5e-3, 0), (0.1, 0.0, 1),
                                                     (0.1, 1e-3, 1), (1.0, 1e-3, 1)])
def test_a_flight_that_is_not_a_parabola_is_reported(drag, noise, said):
    notes = [note for note in REPORT.against(falling(drag, noise=noise)).notes if "flight" in note]
    assert len(notes) == said
    for note in notes:
        found = re.search(r"changes from (\S+) to (\S+) m/s²\. Neither model has drag\.$", note)
        first, last = map(float, found.groups())
        assert first < last  # more than g on the way up, and less on the way down


@pytest.mark.rotating
@pytest.mark.parametrize("count", [100, 1000])
def test_balls_at_rest_and_in_flight_do_not_show_drag_at_any_sampling_rate(count):
    """Rounding errors of the positions of a ball at rest are not noise."""
    scene = gr.Scene([1.0] * 20, [0.01] * 20, [1e-4] * 19, [1.0] + [0.0] * 19)
    report = gr.compare(scene, gr.Hertz(1e9))
    times = np.linspace(0.0, float(report.soft.time[-1]), count)
    for engine in ("hard", "soft"):
        assert not report.against(theirs(run_of(report, engine, times))).notes


@pytest.mark.parametrize("digits", [2, 4])
def test_rounded_positions_do_not_show_drag(digits):
    """A slow ball has the same rounded position in several successive samples."""
    scene = gr.Scene([1.0] * 3, [0.05] * 3, [0.3, 0.2], [1.0, 0.02, -0.02])
    report = gr.compare(scene, gr.LinearDashpot(1e6, 100.0), t_end=1.0)
    run = run_of(report, "soft", np.linspace(0.0, 1.0, 400))
    other = gr.Trajectory.from_arrays(scene, run.time, position=np.round(run.position, digits), velocity=run.velocity)
    assert not [note for note in report.against(other).notes if "flight" in note]


@pytest.mark.soak
def test_noise_and_sampling_alone_do_not_show_drag():
    rng = np.random.default_rng(9)
    for seed in range(100):
        other = falling(0.0, rate=float(rng.uniform(20.0, 240.0)), noise=10.0 ** rng.uniform(-6.0, -2.0), seed=seed)
        assert not [note for note in REPORT.against(other).notes if "flight" in note]


def test_a_held_ball_that_is_filmed_has_the_clock_of_its_release():
    """30 frames per second, errors of 1 mm, and half a second before the ball is released."""
    time = np.arange(60) / 30.0
    run = run_of(REPORT, "soft", np.maximum(time - 0.5, 0.0)[15:])
    places = np.concatenate([np.repeat(run.position[:1], 15, axis=0), run.position])
    places[:, 1] += np.random.default_rng(1).normal(0.0, 1e-3, 60)
    apart = REPORT.against(gr.Trajectory.from_arrays(DROP, time + 3.0, position=places))
    assert apart.offset == pytest.approx(3.5, abs=5e-4)
    assert not apart.notes


def test_recorded_bounces_are_compared_with_both_engines():
    onsets = np.sort(REPORT.hard.contacts["t_begin"])[:3]
    tops = [REPORT.rises(k)[0] for k in (1, 2)]
    found = REPORT.against_bounces(np.cumsum([0.0, *np.diff(onsets)]), tops)
    assert found.offset == pytest.approx(-onsets[0], rel=1e-14)
    assert np.allclose(found.times[:2], onsets, rtol=0.0, atol=1e-15)
    assert np.array_equal(found.times[2], np.sort(REPORT.soft.contacts["t_begin"])[:3])
    assert np.array_equal(found.heights[:2], [tops, tops])
    assert found.heights[2] == pytest.approx([REPORT.rises(k)[1] for k in (1, 2)])
    words = " ".join(str(found).split())
    assert "bounce, t in s theirs hard soft minus hard minus soft 1 0.451524 0.451524 0.451524 " in words
    assert f"bounce, height in m theirs hard soft minus hard minus soft 1 {tops[0]:.6g} {tops[0]:.6g} 0.7367" in words
    assert max(map(len, str(found).splitlines())) <= 80
    assert REPORT.against_bounces(onsets).offset == 0.0


def test_an_engine_with_one_bounce_does_not_set_the_clock():
    """Its bounce agrees on some clock with any recording, which moved all others."""
    report = gr.compare(DROP, gr.LinearDashpot(1e5, 1e4), gr.ConstantRestitution(0.7), t_end=3.0)
    onsets, late = np.sort(report.hard.of(0)["t_begin"])[:5], np.array([0.01, 0.0, 0.0, 0.0, 0.0])
    assert report.soft.count(0) == 1
    assert report.against_bounces(onsets + late).offset == 0.0
    assert report.against_bounces(onsets + 2.0).offset == pytest.approx(2.0, rel=1e-14)
    single = gr.compare(DROP, gr.LinearDashpot(1e5), t_end=0.6)
    assert single.against_bounces([2.0, 3.0]).offset == pytest.approx(2.0 - onsets[0], rel=1e-14)


def test_bounces_that_an_engine_does_not_have_are_unknown():
    none = gr.compare(DROP, gr.LinearDashpot(1e6), t_end=0.1).against_bounces([0.5, 1.0])
    assert np.isnan(none.times[1:]).all()
    many = REPORT.against_bounces(np.arange(1.0, 50.0))
    assert np.isnan(many.times[2, -1])
    assert "…" in str(many)


@pytest.mark.parametrize(("given", "sentence"), [
    ({}, r"One of `times` and `heights` must be given, got neither\."),
    ({"times": [0.0]}, r"`times` must be an array of at least 2 entries, got 1\."),
    ({"times": [0.0, 1.0, 0.5]}, r"`times\[2\]` must be larger than the entry before it, got 0\.5"),
    ({"times": [0.0, math.nan]}, r"`times\[1\]` must be a finite time in s, got nan"),
    ({"heights": [0.5, -0.1]}, r"`heights\[1\]` must be a height in m of at least 0, got -0\.1"),
    ({"heights": [0.5], "ball": 2}, r"`ball` must be an integer from 1 to 1, got 2"),
])
def test_wrong_bounces_are_refused(given, sentence):
    with pytest.raises(ValueError, match=sentence):
        REPORT.against_bounces(**given)


@dataclass(frozen=True)
class Adhesive:
    """A spring with a constant pull."""

    pull: float

    def force(self, xi, xi_dot, pair):
        return 1e3 * xi - self.pull


@pytest.mark.parametrize("pull", [1e-6, 1e-3, 1.0])
def test_a_pull_that_is_cut_to_zero_is_in_the_short_report(pull):
    report = gr.compare(gr.Scene([0.01, 0.01], [1e-3, 1e-3], [1e-3], [1.0, 0.0]), Adhesive(pull))
    assert warnings(report)[0].endswith(" m; the attraction is clipped to 0, so neither model has adhesion")
    assert "the attraction is clipped to 0" in str(report)

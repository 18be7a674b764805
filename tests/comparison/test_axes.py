"""The figure of a comparison: contacts however short or many are in it, and its axis spans those that count."""

import numpy as np
import pytest

import granular as gr


@pytest.fixture(scope="module")
def gas():
    scene = gr.scenes.gas(6)
    law = [gr.LinearDashpot.from_restitution(0.9, k=5e7, pair=p) for p in scene.pairs]
    return gr.compare(scene, law, t_end=150.0)


def test_figure_shows_contacts_however_short_beside_its_span(gas):
    timeline, forces = gas.plot().axes[:2]
    (ticks,) = (c for c in timeline.collections if hasattr(c, "get_segments"))
    assert ticks.get_linewidths()[0] >= 1.5
    assert len(ticks.get_segments()) == len(gas.soft.contacts)
    low, high = forces.images[0].get_clim()
    assert low == 0.0
    assert forces.images[0].get_array().max() == high > 0.0
    assert high * 1e3 == pytest.approx(gas.soft.contacts["force_max"].max(), rel=1e-12)  # in kN


@pytest.mark.rotating
def test_force_map_loses_no_contact_of_very_many():
    busy = gr.compare(gr.scenes.gas(40), gr.LinearDashpot(1e12), t_end=200.0)
    log = busy.soft.contacts
    assert len(log) > 2000
    shown = np.asarray(busy.plot().axes[1].images[0].get_array())
    assert shown.max() * 1e6 == pytest.approx(log["force_max"].max(), rel=1e-12)  # in MN
    for c in range(busy.scene.n - 1):
        assert shown[c].max() * 1e6 == pytest.approx(busy.soft.of(c)["force_max"].max(), rel=1e-12)


def test_time_axis_begins_with_the_run_at_the_earliest(gas):
    assert {axis.get_xlabel() for axis in gas.plot().axes} == {"", "time (s)"}


def test_force_curve_meets_contacts_shorter_than_its_samples():
    ball = gr.compare(gr.scenes.bouncing_ball(height=1.0), gr.LinearDashpot(1e12), t_end=3.0)
    curve = ball.plot().axes[1].lines[0].get_ydata()
    assert np.count_nonzero(np.diff((curve > 0.0).astype(int)) == 1) == len(ball.soft.contacts)


def test_time_axis_ends_with_the_last_contact_that_counts():
    from granular.comparison.view import window

    view = window(gr.compare(gr.scenes.newtons_cradle(5, gap=1e-3), gr.Hertz(1e9)))
    assert 0.0 <= view.begin < view.end < 0.1


def test_hard_balls_fly_on_to_the_end_of_the_axis():
    cradle = gr.compare(gr.scenes.newtons_cradle(5), gr.Hertz(1e9), until=gr.until.separated())
    assert cradle.hard.time[-1] == 0.0
    paths = next(axis for axis in cradle.plot().axes if axis.get_ylabel().startswith("position"))
    hard = [line for line in paths.lines if line.get_linestyle() == "--" and len(line.get_xdata()) > 2]
    assert len(hard) == 5
    for line, velocity in zip(hard, cradle.hard.velocity[-1], strict=True):
        t, x = line.get_xdata(), line.get_ydata()  # µs or ms, µm or mm
        assert t[-1] > 0.95 * paths.get_xlim()[1]
        assert (abs(x[-1] - x[0]) < 1e-9) == (velocity == 0.0)  # but for rounding, 1e-17 m


def test_hard_marks_at_the_start_are_not_cut():
    from granular.comparison.view import window

    cradle = gr.compare(gr.scenes.newtons_cradle(5), gr.Hertz(1e9), until=gr.until.separated())
    assert window(cradle).begin == 0.0 == cradle.hard.contacts["t_begin"].max()
    assert cradle.plot().axes[0].get_xlim()[0] < 0.0


@pytest.mark.rotating
def test_late_straggler_does_not_squeeze_the_picture():
    from granular.comparison.view import window

    scene = gr.scenes.chain(n=12, dimer=0.4)
    chain = gr.compare(scene, gr.TsujiHertz(2e10, 0.0), until=gr.until.separated())
    last = chain.soft.contacts["t_begin"].max()
    end = window(chain).end
    assert end < 0.2 * last
    assert chain.soft.of(0)["t_end"].max() < end
    assert chain.plot().axes[0].get_title(loc="right") == f"1 later contact, the last at t = {1e3 * last:.4g} ms ▸"


def test_plot_shows_the_tie_rule_of_the_run():
    from granular.comparison.further import repeat_with_samples

    cradle = gr.compare(gr.scenes.newtons_cradle(3), gr.Hertz(1e9), ties="poisson", until=gr.until.separated())
    again = repeat_with_samples(cradle, "hard", np.linspace(0.0, 1e-3, 5))
    assert again.velocity[-1].tolist() == cradle.hard.velocity[-1].tolist()

"""Films of a comparison: three times and their rates, clock and words within the frame, balls where they are."""

import numpy as np
import pytest

import granular as gr
from granular.comparison.acts import FREEZE, HOLD, pictures
from granular.comparison.film import pages
from granular.comparison.view import window

pytest.importorskip("matplotlib")


def compared(scene, **options):
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    return gr.compare(scene, law, **options)


@pytest.fixture(scope="module")
def two():
    return window(compared(gr.scenes.three_balls(gap=1e-4), until=gr.until.contact(0, 2)))


@pytest.fixture(scope="module")
def cradle():
    return window(gr.compare(gr.scenes.newtons_cradle(5), gr.Hertz(1e9), until=gr.until.separated()))


def test_a_fall_has_three_times_each_with_its_own_rate(two):
    fps = 20
    shown = pictures(two, 6.0, fps, True)
    assert list(dict.fromkeys(shown.act)) == ["fall", "stop", "slow", "flight", "end"]
    assert (np.diff(shown.time) >= 0.0).all()
    assert shown.time[0] == 0.0
    for act in ("fall", "flight"):
        assert np.diff(shown.of(act))[:-1] == pytest.approx(1.0 / fps)
    assert (len(shown.of("stop")), len(shown.of("end"))) == (FREEZE * fps, HOLD * fps)
    assert set(shown.of("stop")) == {two.begin}
    assert len(shown.of("slow")) == 6 * fps
    assert 1.0 / (fps * np.diff(shown.of("slow"))) == pytest.approx(shown.slower, rel=0.01)
    assert shown.slower == pytest.approx(6.0 / 900e-6, rel=0.01)
    top = gr.edmd.simulate(two.report.scene, two.report.rule, t_end=1.2, samples=np.linspace(0.4, 1.2, 801))
    highest = top.time[top.position[:, 2].argmax()]
    assert shown.time[-1] == pytest.approx(highest, abs=0.04)  # 1.04 of the flight


def test_no_ball_hangs_in_the_air_because_hard_spheres_have_collapsed():
    stack = gr.scenes.ball_stack(4, 0.3, gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.3, k=5e7, pair=pair) for pair in stack.pairs]
    view = window(gr.compare(stack, law, until=gr.until.contact(0, 2)))
    end = pictures(view, 5.0, 10, True).time[-1]
    run = gr.edmd.simulate(stack, view.report.rule, t_end=3.0)
    assert run.status is gr.Status.collapse
    assert view.end < end <= run.time[-1]


def test_one_slow_motion_where_it_is_asked_for_or_nothing_falls(two, cradle):
    for view, whole in ((two, False), (cradle, True)):
        shown = pictures(view, 3.0, 10, whole)
        assert set(shown.act) == {"slow"}
        assert (len(shown.time), shown.time[0], shown.time[-1]) == (30, view.begin, view.end)
        assert shown.slower == pytest.approx(3.0 / (view.end - view.begin))
    bouncing = compared(gr.scenes.bouncing_ball(height=1.0), t_end=3.0)
    assert set(pictures(window(bouncing), 5.0, 10, True).act) == {"slow"}  # contacts and flights take turns


@pytest.mark.parametrize("name", ["two", "cradle"])
def test_clock_and_words_are_within_the_frame_in_every_picture(name, request):
    view = request.getfixturevalue(name)
    reel = pages(view, pictures(view, 1.0, 10, True))
    for made, k in reel:
        if k == 0:
            made.open()
        pixels = np.asarray(made.show(k))
        for artist, path in made.moving:
            if artist.get_gid() == "clock":
                left, right = artist.axes.get_xlim()
                assert left <= path[k][0] <= right
        for artist, words in made.saying:
            assert artist.get_text() == words[k] != ""
            box = artist.get_window_extent(made.canvas.get_renderer())
            assert 0.0 <= box.x0 < box.x1 <= pixels.shape[1]
            assert 0.0 <= box.y0 < box.y1 <= pixels.shape[0]
    assert reel[-1][1] == len(reel[-1][0].saying[0][1]) - 1


def test_balls_stand_in_a_row_without_gravity_and_upright_with_it(two, cradle):
    for view, along in ((two, 1), (cradle, 0)):
        shown = pictures(view, 1.0, 10, False)
        (made,) = {page for page, _ in pages(view, shown)}
        balls = [path for artist, path in made.moving if type(artist).__name__ == "Circle"]
        soft = np.array(balls[-5:] if along == 0 else balls)
        assert np.ptp(soft[:, :, 1 - along]) == 0.0
        assert np.ptp(soft[:, :, along]) > 0.1


def test_the_ruler_reads_the_heights_of_the_balls(two):
    shown = pictures(two, 1.0, 10, True)
    (far,) = {page for (page, _), act in zip(pages(two, shown), shown.act, strict=True) if act == "fall"}
    hard = [path[:, 1] for artist, path in far.moving if artist.get_gid() != "clock"][:2]
    times = shown.of("fall", "stop", "flight", "end")
    run = gr.edmd.simulate(two.report.scene, two.report.rule, t_end=times[-1], samples=np.unique(times))
    expected = np.interp(times, run.time, run.gap[:, 0] + run.gap[:, 1])
    assert hard[1] == pytest.approx(expected, abs=1e-9)
    low, high = far.figure.axes[0].get_ylim()
    assert low == 0.0 <= hard[1].min()
    assert hard[1].max() < high < 1.1 * hard[1].max()


def test_a_drop_from_above_the_picture_leaves_the_ruler_its_place():
    """Before, the words at a height that is not shown pushed all axes out of the layout."""
    high = window(compared(gr.scenes.three_balls(gap=1e-4, height=1e5), until=gr.until.contact(0, 2)))
    made = pages(high, pictures(high, 1.0, 5, True))[0][0]
    made.open()
    title = made.figure.axes[0].title.get_window_extent()
    assert title.y1 < min(text.get_window_extent().y0 for text in made.figure.texts)

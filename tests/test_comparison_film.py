"""Films of a comparison: three times and their rates, clock and words within the frame, balls where they are."""

import numpy as np
import pytest

import granular as gr
from granular.comparison.film import FREEZE, HOLD, acts, film
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
    shown = acts(two, 6.0, fps, True)
    times = np.concatenate(list(shown.values()))
    assert list(shown) == ["fall", "stop", "slow", "flight", "end"]
    assert (np.diff(times) >= 0.0).all()
    assert times[0] == 0.0
    for act in ("fall", "flight"):
        assert np.diff(shown[act])[:-1] == pytest.approx(1.0 / fps)
    assert (len(shown["stop"]), len(shown["end"])) == (FREEZE * fps, HOLD * fps)
    assert set(shown["stop"]) == {two.begin}
    assert len(shown["slow"]) == 6 * fps
    assert 1.0 / (fps * np.diff(shown["slow"])) == pytest.approx(6.0 / 900e-6, rel=0.02)
    contacts = film(two, shown, fps)[len(shown["fall"]) + len(shown["stop"])][0]
    assert contacts.words[0].startswith("6 700 × slower")
    top = gr.edmd.simulate(two.report.scene, two.report.rule, t_end=1.2, samples=np.linspace(0.4, 1.2, 801))
    highest = top.time[top.position[:, 2].argmax()]
    assert times[-1] == pytest.approx(highest, abs=0.04)  # 1.04 of the flight


def test_no_ball_hangs_in_the_air_because_hard_spheres_have_collapsed():
    stack = gr.scenes.ball_stack(4, 0.3, gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.3, k=5e7, pair=pair) for pair in stack.pairs]
    view = window(gr.compare(stack, law, until=gr.until.contact(0, 2)))
    end = acts(view, 5.0, 10, True)["end"][-1]
    run = gr.edmd.simulate(stack, view.report.rule, t_end=3.0)
    assert run.status is gr.Status.collapse
    assert view.end < end <= run.time[-1]


def test_one_slow_motion_where_it_is_asked_for_or_nothing_falls(two, cradle):
    for view, whole in ((two, False), (cradle, True)):
        shown = acts(view, 3.0, 10, whole)
        assert list(shown) == ["slow"]
        assert (len(shown["slow"]), shown["slow"][0], shown["slow"][-1]) == (30, view.begin, view.end)
    bouncing = compared(gr.scenes.bouncing_ball(height=1.0), t_end=3.0)
    assert list(acts(window(bouncing), 5.0, 10, True)) == ["slow"]  # contacts and flights take turns


@pytest.mark.parametrize("name", ["two", "cradle"])
def test_clock_and_words_are_within_the_frame_in_every_picture(name, request):
    view = request.getfixturevalue(name)
    pictures = film(view, acts(view, 1.0, 10, True), 10)
    for page, k in pictures:
        pixels = np.asarray(page.show(k))
        for artist, path in page.moving:
            if artist.get_gid() == "clock":
                left, right = artist.axes.get_xlim()
                assert left <= path[k][0] <= right
        title = page.moving[-1][0]
        assert title.get_text() == page.words[k] != ""
        box = title.get_window_extent(page.canvas.get_renderer())
        assert 0.0 <= box.x0 < box.x1 <= pixels.shape[1]
        assert 0.0 <= box.y0 < box.y1 <= pixels.shape[0]
    assert pictures[-1][1] == len(pictures[-1][0].words) - 1


def test_balls_stand_in_a_row_without_gravity_and_upright_with_it(two, cradle):
    for view, along in ((two, 1), (cradle, 0)):
        (page,) = {page for page, _ in film(view, acts(view, 1.0, 10, False), 10)}
        balls = [path for artist, path in page.moving if type(artist).__name__ == "Circle"]
        soft = np.array(balls[-5:] if along == 0 else balls)
        assert np.ptp(soft[:, :, 1 - along]) == 0.0
        assert np.ptp(soft[:, :, along]) > 0.1


def test_the_ruler_reads_the_heights_of_the_balls(two):
    shown = acts(two, 1.0, 10, True)
    page = film(two, shown, 10)[0][0]
    hard = [path[:, 1] for artist, path in page.moving if artist.axes is page.axes["hard"]]
    times = np.concatenate([time for act, time in shown.items() if act != "slow"])
    run = gr.edmd.simulate(two.report.scene, two.report.rule, t_end=times[-1], samples=np.unique(times))
    expected = np.interp(times, run.time, run.gap[:, 0] + run.gap[:, 1])
    assert hard[1] == pytest.approx(expected, abs=1e-9)
    low, high = page.axes["hard"].get_ylim()
    assert low == 0.0 <= hard[1].min()
    assert hard[1].max() < high < 1.1 * hard[1].max()


def test_a_drop_from_above_the_picture_leaves_the_ruler_its_place():
    """Before, the words at a height that is not shown pushed all axes out of the layout."""
    high = window(compared(gr.scenes.three_balls(gap=1e-4, height=1e5), until=gr.until.contact(0, 2)))
    page = film(high, acts(high, 1.0, 5, True), 5)[0][0]
    page.show(0)
    title = page.axes["hard"].title.get_window_extent()
    assert title.y1 < min(text.get_window_extent().y0 for text in page.figure.texts)


def test_the_number_of_a_ball_leaves_the_picture_with_it():
    """Before, the number of a ball above the stage stood over the words."""
    stack = window(compared(gr.scenes.ball_stack(4, 0.1, gap=1e-4), until=gr.until.contact(0, 2)))
    page = film(stack, acts(stack, 1.0, 10, False), 10)[0][0]
    page.show(0)
    places = [path[:, 1].max() for artist, path in page.moving if artist.axes is page.axes["hard"]]
    assert max(places) > page.axes["hard"].get_ylim()[1]
    assert all(artist.get_clip_on() for artist, _ in page.moving if artist.axes is page.axes["hard"])

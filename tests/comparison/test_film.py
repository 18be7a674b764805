"""Films of a comparison: three times and their rates, clock and words within the frame, balls where they are, each at
its own apex in the end."""

import numpy as np
import pytest

import granular as gr
from granular.comparison import further
from granular.comparison.film import END_SECONDS, MAX_SHOWN_SECONDS, STOP_SECONDS, Story, flight_page, stack_points
from granular.comparison.view import window
from granular.comparison.zoom import ZOOM_SECONDS, Zoom
from granular.run.films import flattened

pytest.importorskip("matplotlib")


def compared(scene, **options):
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    return gr.compare(scene, law, **options)


def pages_of(story):
    """The pictures of a film without those between two pages."""
    return [(page, k) for page, k in story.pictures() if not isinstance(page, Zoom)]


@pytest.fixture(scope="module")
def two():
    return window(compared(gr.scenes.three_balls(gap=1e-4), until=gr.until.contact(0, 2)))


@pytest.fixture(scope="module")
def cradle():
    return window(gr.compare(gr.scenes.newtons_cradle(5), gr.Hertz(1e9), until=gr.until.separated()))


@pytest.mark.rotating
def test_a_fall_has_three_times_each_with_its_own_rate(two):
    fps = 20
    story = Story(two, 6.0, fps)
    shown = story.acts
    times = np.concatenate(list(shown.values()))
    assert list(shown) == ["fall", "stop", "slow", "flight", "end"]
    assert (np.diff(times) >= 0.0).all()
    assert times[0] == 0.0
    for act in ("fall", "flight"):
        assert np.diff(shown[act])[:-1] == pytest.approx(1.0 / fps, rel=0.05)
    assert (len(shown["stop"]), len(shown["end"])) == (STOP_SECONDS * fps, END_SECONDS * fps)
    assert set(shown["stop"]) == {two.begin}
    assert len(shown["slow"]) == 6 * fps
    assert 1.0 / (fps * np.diff(shown["slow"])) == pytest.approx(6.0 / 900e-6, rel=0.02)
    pictures = story.pictures()
    contacts = pictures[len(shown["fall"]) + len(shown["stop"]) + round(ZOOM_SECONDS * fps)][0]
    assert contacts.titles[0].startswith("slowed 6 700 ×")
    assert pictures[-15][0].titles[-25:-24] == ["flying, in real time"]
    top = gr.edmd.simulate(two.report.scene, two.report.rule, t_end=1.2, samples=np.linspace(0.4, 1.2, 801))
    assert times[-1] == pytest.approx(top.time[top.position[:, 2].argmax()], abs=1e-3)


def test_no_ball_hangs_in_the_air_because_hard_spheres_have_collapsed():
    stack = gr.scenes.ball_stack(4, 0.3, gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.3, k=5e7, pair=pair) for pair in stack.pairs]
    view = window(gr.compare(stack, law, until=gr.until.contact(0, 2)))
    story = Story(view, 5.0, 10)
    run = gr.edmd.simulate(stack, view.report.rule, t_end=3.0)
    assert run.status is gr.Status.collapse
    assert run.time[-1] < story.acts["end"][-1]  # those that would collide forever stick, and fall
    top = story.tops["hard"][:, 1]
    assert top[-1] == view.report.rises[0] > 0.0
    assert story.heights("hard", story.acts["end"][:1])[0] == pytest.approx(top)


def test_one_slow_motion_where_it_is_asked_for_or_nothing_falls(two, cradle):
    for view, whole in ((two, False), (cradle, True)):
        shown = Story(view, 3.0, 10, whole).acts
        assert list(shown) == ["slow"]
        assert (len(shown["slow"]), shown["slow"][0], shown["slow"][-1]) == (30, view.begin, view.end)
    bouncing = compared(gr.scenes.bouncing_ball(height=1.0), t_end=3.0)
    assert list(Story(window(bouncing), 5.0, 10).acts) == ["slow"]  # contacts and flights take turns


@pytest.mark.rotating
@pytest.mark.parametrize(("name", "charts"), [("two", True), ("cradle", False)])
def test_clock_and_words_are_within_the_frame_in_every_picture(name, charts, request):
    pictures = pages_of(Story(request.getfixturevalue(name), 1.0, 10, charts=charts))
    assert all(("time" in page.axes) is not charts and len(page.axes) >= 3 for page, _ in pictures)
    for page, k in pictures:
        pixels = np.asarray(page.show(k))
        for artist, path in page.moving:
            if artist.get_gid() == "clock":
                left, right = artist.axes.get_xlim()
                assert left <= path[k][0] <= right
        title = page.moving[-1][0]
        assert title.get_text() == page.titles[k] != ""
        box = title.get_window_extent(page.canvas.get_renderer())
        assert 0.0 <= box.x0 < box.x1 <= pixels.shape[1]
        assert 0.0 <= box.y0 < box.y1 <= pixels.shape[0]
    assert pictures[-1][1] == len(pictures[-1][0].titles) - 1


@pytest.mark.rotating
def test_balls_stand_in_a_row_without_gravity_and_upright_with_it(two, cradle):
    for view, along in ((two, 1), (cradle, 0)):
        (page,) = {page for page, _ in Story(view, 1.0, 10, whole=False).pictures()}
        balls = [path for artist, path in page.moving if type(artist).__name__ == "Circle"]
        soft = np.array(balls[-5:] if along == 0 else balls)
        assert np.ptp(soft[:, :, 1 - along]) == 0.0
        assert np.ptp(soft[:, :, along]) > 0.1


def test_the_ruler_reads_the_heights_of_the_balls(two):
    story = Story(two, 1.0, 10)
    page = flight_page(story)
    hard = balls_of(page, "hard")
    times = np.concatenate([time for act, time in story.acts.items() if act != "slow"])
    run = gr.edmd.simulate(two.report.scene, two.report.rule, t_end=times[-1], samples=np.unique(times))
    flown = np.interp(times, run.time, run.gap[:, 0] + run.gap[:, 1])
    assert hard[1] == pytest.approx(flown, abs=1e-9)
    lower = np.interp(times, run.time, run.gap[:, 0])
    before = times < story.tops["hard"][1, 0]
    assert hard[0][before] == pytest.approx(lower[before], abs=1e-9)
    low, high = page.axes["hard"].get_ylim()
    assert low < 0.0 <= hard[1].min()  # the lower ball stands below the zero of the upper ball
    assert 1.1 * hard[1].max() < high < 1.2 * hard[1].max()
    for name, body in (("hard", 1), ("hard", 2), ("soft", 1), ("soft", 2)):  # numbers are out of sight before
        when, top = story.tops[name][body]
        (path,) = [path[:, 1] for artist, path in page.moving
                   if artist.get_gid() == f"apex {body}" and artist.axes is page.axes[name]]
        assert (path[times >= when] == top).all()
        assert (path[times < when] < 0.0).all()


def balls_of(page, name):
    """Heights of the balls of one engine on the ruler, picture by picture."""
    return [path[:, 1] for artist, path in page.moving if artist.axes is page.axes[name] and artist.get_gid() == "ball"]


@pytest.mark.rotating
@pytest.mark.parametrize("third", range(3))
@pytest.mark.usefixtures("interpreted")
def test_the_last_picture_is_what_the_report_says_of_random_drops(third):
    """Each engine by itself, to the time of that picture's apex, has the ball there, at rest."""
    random, shown = np.random.default_rng(32), 0
    for i in range(50):
        n, eps, gap = (1, 2)[i % 2], random.uniform(0.6, 0.9), 10.0 ** random.uniform(-6.0, -1.5)
        scene = gr.scenes.ball_stack(n, 10.0 ** random.uniform(-2.0, 0.0), gap=gap, height=random.uniform(0.2, 2.0))
        law = [gr.LinearDashpot.from_restitution(eps, 10.0 ** random.uniform(6, 8), pair) for pair in scene.pairs]
        if i % 3 != third:
            continue
        report = gr.compare(scene, law, until=gr.until.contact(0, 2))
        story = Story(window(report), 1e3, 5)
        for name, rise in zip(("hard", "soft"), report.rises, strict=True):
            last = story.heights(name, story.acts["end"][-1:])[0]
            assert last[-1] == pytest.approx(rise, rel=1e-12)
            options = {"t_end": float(story.tops[name][-1, 0])}
            alone = (gr.edmd.simulate(scene, report.rule, **options) if name == "hard" else
                     gr.md.simulate(scene, law, **options))
            if alone.status is gr.Status.time:
                shown += 1
                assert alone.gap[-1].sum() == pytest.approx(rise, rel=1e-9)
                assert abs(alone.velocity[-1, -1]) < 1e-9 * report.impact_speed
                assert alone.count(n - 1) > 0
    assert shown > 28


@pytest.mark.rotating
def test_ticks_and_numbers_of_the_last_picture_are_the_rises(two):
    page, k = Story(two, 1.0, 10, charts=False).pictures()[-1]
    page.show(0)
    pixels = np.asarray(page.show(k)).astype(int)
    for name, rise in zip(("hard", "soft"), two.report.rises, strict=True):
        axis, colour = page.axes[name], np.array([0xc1, 0x44, 0x0e] if name == "hard" else [0x1f, 0x4e, 0x79])
        assert balls_of(page, name)[-1][-1] == pytest.approx(rise)
        (said,) = [path[-1] for artist, path in page.moving if artist.get_gid() == "apex 2" and artist.axes is axis]
        (words,) = [artist.get_text() for artist, _ in page.moving
                    if artist.get_gid() == "apex 2" and artist.axes is axis]
        assert said[1] == pytest.approx(rise)
        assert float(words) == pytest.approx(rise, rel=5e-3)
        left, right = axis.transData.transform([(0.22, 0.0), (0.38, 0.0)])[:, 0].astype(int)  # beside the ball
        rows = np.flatnonzero((np.abs(pixels[:, left:right, :3] - colour).max(axis=2) < 40).all(axis=1))
        heights = axis.transData.inverted().transform([(left, len(pixels) - row - 0.5) for row in rows])[:, 1]
        heights = heights[heights > heights.max() - 0.02 * axis.get_ylim()[1]]  # the lower ball has its own
        assert heights.mean() == pytest.approx(rise, abs=1.2 * axis.get_ylim()[1] / len(pixels))
        assert np.ptp(heights) < 0.01 * axis.get_ylim()[1]


def test_a_flight_that_takes_long_is_told_to_be_faster_than_life():
    case = gr.cases.make("ball-stack", n=5)
    report = gr.compare(case.scene, case.law, case.rule, until=case.until)
    story = Story(window(report), 1.0, 5)
    page = flight_page(story)
    assert report.rises[0] > 200.0
    assert page.axes["hard"].get_ylim()[1] > report.rises[0]
    assert len(story.acts["flight"]) == 5 * MAX_SHOWN_SECONDS
    assert page.titles[-8:-6] == ["flying, 1.2 × faster than real time"] * 2
    assert page.titles[-1] == "the highest point of each ball"


def test_what_is_followed_no_farther_leaves_the_picture(two, monkeypatch):
    monkeypatch.setattr(further, "MAX_EVENTS_PER_RUN", 3)
    story = Story(two, 1.0, 10)
    assert np.isnan(story.heights("hard", np.array([0.1, 20.0, 30.0]))[1:, 1]).sum() == 0  # at their apexes
    assert np.isnan(further.Continuation(two.report, "hard").heights(np.array([0.1, 20.0, 30.0]))).sum() == 6


@pytest.mark.rotating
def test_a_drop_from_above_the_picture_leaves_the_ruler_its_place():
    """Before, the words at a height that is not shown pushed all axes out of the layout."""
    high = window(compared(gr.scenes.three_balls(gap=1e-4, height=1e5), until=gr.until.contact(0, 2)))
    page = Story(high, 1.0, 5).pictures()[0][0]
    page.show(0)
    title = page.axes["hard"].title.get_window_extent()
    assert title.y1 < min(text.get_window_extent().y0 for text in page.figure.texts)


@pytest.mark.rotating
def test_the_number_of_a_ball_leaves_the_picture_with_it():
    """Before, the number of a ball above the stage stood over the words."""
    stack = window(compared(gr.scenes.ball_stack(4, 0.1, gap=1e-4), until=gr.until.contact(0, 2)))
    page = Story(stack, 1.0, 10, whole=False).pictures()[0][0]
    page.show(0)
    places = [path[:, 1].max() for artist, path in page.moving if artist.axes is page.axes["hard"]]
    assert max(places) > page.axes["hard"].get_ylim()[1]
    assert all(artist.get_clip_on() for artist, _ in page.moving if artist.axes is page.axes["hard"])


def test_balls_in_contact_are_flattened_and_never_below_the_floor():
    """The whole disc sank through the floor before. Two balls share an overlap so that they still touch."""
    wall, radius = np.array([True, False, False]), np.array([0.0, 2.0, 1.0])
    shift, factor = flattened(np.array([[0.0, 0.0, 0.0], [0.0, -0.6, -0.9]]), radius, wall)
    assert (shift[0].tolist(), factor[0].tolist()) == ([0.0] * 3, [1.0] * 3)
    middle = np.cumsum(2.0 * radius) - radius + [0.0, -0.6, -0.9] + shift[1]
    assert (middle - radius * factor[1])[1:] == pytest.approx([0.0, (middle + radius * factor[1])[1]])
    assert (factor[1][1:] < 1.0).all()


def test_stages_keep_their_places_and_balls_stand_on_each_other(two):
    pages = {page for page, _ in pages_of(Story(two, 1.0, 5))}
    assert len(pages) == 2
    for page in pages:
        page.show(0)
    middles = [[float(np.mean(page.axes[name].get_position().intervalx)) for name in ("hard", "soft")]
               for page in pages]
    assert middles[0] == pytest.approx(middles[1], abs=0.02)
    size, stacked = stack_points(two.report.scene)
    assert stacked == pytest.approx([0.0, size[0]])


def test_one_camera_moves_between_the_far_and_the_near_view(two):
    """From picture to picture balls grow by less than a fifth, and the lower one is as near to its floor."""
    fps = 25
    story = Story(two, 1.0, fps)
    pictures = story.pictures()
    inward, outward = dict.fromkeys(page for page, _ in pictures if isinstance(page, Zoom))
    assert len(pictures) == sum(map(len, story.acts.values())) + 2 * inward.count
    assert 0.5 <= inward.count / fps <= 0.8
    pages = [page for page, _ in pictures]
    first = len(story.acts["fall"]) + len(story.acts["stop"])
    assert pages.index(inward) == first
    assert pages[first + inward.count + len(story.acts["slow"])] is outward
    for zoom in (inward, outward):
        heights = []
        for k in range(zoom.count):
            assert np.asarray(zoom.show(k)).shape == np.asarray(zoom.far[0].show(zoom.far[1])).shape
            for drawn in zoom.drawn:
                lower, floor = drawn["ball"][0], drawn["floor"][0].get_ydata()[0]
                if zoom is inward:  # the balls are about to touch the floor
                    assert -0.5 < lower.center[1] - 0.5 * lower.height - floor < 0.08 * lower.height
            heights.append(zoom.drawn[0]["ball"][0].height)
        ends = [end[0]["ball"][0][2] for end in zoom.ends]
        sizes = np.array([ends[0], *heights, ends[1]] if zoom is inward else [ends[1], *heights, ends[0]])
        growth = sizes[1:] / sizes[:-1] if zoom is inward else sizes[:-1] / sizes[1:]
        assert (growth >= 1.0).all()
        assert growth.max() < 1.2
        assert sizes.max() / sizes.min() > 3.0

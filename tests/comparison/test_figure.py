"""The picture of a comparison: the lens on the hops, names of pairs and balls, parameters, paths to the axis' end."""

import math
import re

import numpy as np
import pytest

import granular as gr
from granular.comparison.figure import repeat_both_runs
from granular.comparison.view import closeup, number, parameters, window

pytest.importorskip("matplotlib")


def compared(scene, eps=0.7, k=5e7, **options):
    law = [gr.LinearDashpot.from_restitution(eps, k=k, pair=pair) for pair in scene.pairs]
    return gr.compare(scene, law, **options)


@pytest.fixture(scope="module")
def two():
    return compared(gr.scenes.three_balls(gap=1e-4), until=gr.until.contact(0, 2))


@pytest.fixture(scope="module")
def drawn(two):
    return two.plot()


def panel(figure, name):
    return next(axis for axis in figure.axes if axis.get_ylabel().startswith(name))


def texts(axis):
    return [text.get_text() for text in axis.texts]


def test_the_lens_shows_the_four_hops_on_their_own_scale(two, drawn):
    look, lens = closeup(window(two)), panel(drawn, "gap")
    assert look.pair == 1
    hops = look.hops(repeat_both_runs(two, look.moments)["soft"])
    assert [1e6 * height for _, height in hops] == pytest.approx([34.4, 16.0, 8.63], rel=5e-3)  # by the page too
    assert [said for said in texts(lens) if said.endswith("µm")] == ["34 µm", "16 µm", "8.6 µm"]
    assert [said for said in texts(lens) if said.isdigit()] == ["1", "2", "3", "4"]
    low, high = lens.get_ylim()
    assert low < -10.0 < 34.4 < high < 2.0 * 34.4
    soft = next(line for line in lens.lines if line.get_linestyle() == "-" and len(line.get_xdata()) > 100)
    t, y = soft.get_data()
    after = t > 1e6 * (two.soft.of(1)["t_begin"][0] - two.soft.of(0)["t_begin"][0])
    assert low < y[after].min() < 0.0 < y[after].max() < high
    assert lens.get_xlim() == panel(drawn, "position").get_xlim()


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(5))
def test_every_hop_is_on_the_axis_and_of_the_right_height(seed):
    random = np.random.default_rng([16, seed])
    n, ratio, gap = int(random.integers(2, 6)), random.uniform(0.05, 0.5), 10.0 ** random.uniform(-5, -4)
    stack = gr.scenes.ball_stack(n, ratio, gap=gap)
    report = compared(stack, random.uniform(0.6, 1.0), until=gr.until.contact(0, 2))
    look = closeup(window(report))
    lens = panel(report.plot(), "gap")
    unit = {"mm": 1e-3, "µm": 1e-6, "nm": 1e-9}[lens.get_ylabel()[-3:-1]]
    low, high = lens.get_ylim()
    for time, height in look.hops(repeat_both_runs(report, look.moments)["soft"]):
        again = gr.md.simulate(stack, report.law, t_end=time)
        assert height == pytest.approx(again.gap[-1][look.pair], rel=1e-6)
        assert low < 0.0 < height / unit < 0.8 * high
        assert lens.get_xlim()[0] < look.view.clock(time) < lens.get_xlim()[1]


@pytest.mark.rotating
def test_the_lens_looks_where_contacts_overlap_and_not_at_the_whole_run():
    row = gr.Scene([1.0] * 4, [0.0] * 4, [0.1, 0.2, 0.15], [1.0, 0.3, 0.0, -1.0])
    report = compared(row, 0.1, 1e5, t_end=2.0)
    view = window(report)
    look = closeup(view)
    assert look.view.end - look.view.begin < 0.2 * (view.end - view.begin)
    assert look.view.begin < report.overlaps[0].begin < look.view.end
    figure = report.plot()
    assert panel(figure, "gap").get_xlim() != panel(figure, "position").get_xlim()
    marks = [line for line in panel(figure, "position").lines if line.get_marker() == "x"]
    assert [line.get_label() for line in marks] == ["end of the hard run: collapse"]


@pytest.mark.rotating
def test_the_end_of_a_hard_path_that_goes_on_to_a_collapse_is_marked():
    scene = gr.scenes.three_balls()
    report = gr.compare(scene, gr.LinearDashpot(5e7, 1e6), gr.ConstantRestitution(0.1), until=gr.until.contact(0, 2),
                        t_end=2.0)
    assert report.hard.status is gr.Status.until
    marks = [line.get_label() for line in panel(report.plot(), "position").lines if line.get_marker() == "x"]
    assert marks == ["end of the hard run: collapse"]


def test_no_lens_where_every_contact_is_binary():
    far = compared(gr.scenes.three_balls(gap=1e-2), until=gr.until.contact(0, 2))
    assert closeup(window(far)) is None
    assert not [axis for axis in far.plot().axes if axis.get_ylabel().startswith("gap")]


def test_the_picture_says_with_what_it_was_made(two, drawn):
    said = " ".join(text.get_text() for text in drawn.texts)
    assert two.verdict in said
    for word in ("2 balls, m = 3.77 kg and 3.77 g (1000 : 1)", "gap 100 µm", "first impact at 3.132 m/s",
                 "g = 9.81 m/s²", "LinearDashpot, k = 5·10⁷ N/m, ε = 0.7", "lasts 801 µs and 25.3 µs"):
        assert word in said
    assert [label.get_text() for label in drawn.axes[0].get_yticklabels()] == ["pair 0: floor–1", "pair 1: 1–2"]
    assert texts(panel(drawn, "position")) == ["1, 2"]
    assert {axis.get_ylabel() for axis in drawn.axes} >= {"force of\n1–2 (N)", "force of\nfloor–1 (kN)"}


@pytest.mark.rotating
def test_words_stay_within_the_picture(drawn):
    canvas = pytest.importorskip("matplotlib.backends.backend_agg").FigureCanvasAgg(drawn)
    canvas.draw()
    width, height = canvas.get_width_height()
    top = max(axis.get_window_extent().y1 for axis in drawn.axes)
    for text in drawn.texts:
        box = text.get_window_extent()
        assert 0.0 <= box.x0 < box.x1 <= width
        assert top < box.y0 < box.y1 <= height


def test_parameters_of_many_kinds_of_scene():
    assert number(5e7) == "5·10⁷"
    assert number(1e-12) == "10⁻¹²"
    cradle = gr.compare(gr.scenes.newtons_cradle(3), gr.Hertz(1e9), until=gr.until.separated())
    scene, laws = parameters(cradle).split("\n")
    assert scene == "3 balls, m = 1 kg, touching, first impact at 1 m/s"
    assert laws.startswith("Hertz, k = 10$^{9}$ N/m$^{1.5}$, ε = 1, an isolated contact lasts ")
    real = gr.cases.make("real-balls", gap=0.05)
    report = gr.compare(real.scene, real.law, real.rule, until=real.until)
    assert "m = 624 g and 57.7 g" in parameters(report)
    assert re.search(r"an isolated contact lasts 12 ms and 7\.44 ms", parameters(report))
    rule, end = gr.ConstantRestitution(0.5), gr.until.contact(0, 2)
    own = gr.compare(gr.scenes.three_balls(), gr.LinearDashpot(5e7), rule, until=end)
    assert "ε = 1 (hard spheres 0.5)" in parameters(own)
    pushed = gr.Scene([math.inf, 1.0, 1.000001], [0.0, 0.1, 0.1], [0.1, 0.1], [0.0, -1.0, -1.0], 0.0,
                      external_force=[0.0, -1.0, 0.0], floor=gr.walls.Sine(1e-3, 50.0))
    scene, laws = parameters(gr.compare(pushed, gr.LinearDashpot(1e6), t_end=0.2)).split("\n")
    assert scene.endswith("constant forces, floor Sine(amplitude=0.001, frequency=50, phase=0)")
    assert "m = 1 kg (" in scene  # two masses that print alike


@pytest.mark.parametrize("k", [1e4, 3e5, 1e6, 1e7, 1.5e8, 1e9])
def test_every_letter_of_a_title_is_in_the_font(k, caplog):
    """A title with the unit N/m^1.5 is set by another engine of matplotlib, which lacks the superscripts 4 to 9."""
    canvas = pytest.importorskip("matplotlib.backends.backend_agg").FigureCanvasAgg
    for law in (gr.Hertz(k), gr.PowerLaw(k, 1.25), gr.LinearDashpot(k)):
        report = gr.compare(gr.scenes.newtons_cradle(2), law, until=gr.until.separated())
        canvas(report.plot()).draw()
    assert "glyph" not in caplog.text


def test_pairs_have_the_names_of_the_player():
    box = gr.scenes.gas(2)
    assert [pair.name for pair in box.pairs] == ["wall–1", "1–2", "2–wall"]
    assert [pair.name for pair in gr.scenes.ring_gas(3).pairs] == ["0–1", "1–2", "2–0"]


@pytest.mark.parametrize("seed", range(6))
def test_the_panel_of_contacts_shows_the_contacts_of_the_other_panels(seed):
    """A run that ends at `t_end` is drawn to the last compared contact, with a bar or a mark for every contact."""
    rng = np.random.default_rng(seed)
    scene = gr.Scene([math.inf, *rng.uniform(0.1, 2.0, 3)], [0.0, 0.1, 0.1, 0.1], rng.uniform(0.01, 0.1, 3),
                     [0.0, *rng.uniform(-1.0, 1.0, 3)], 9.81)
    law, rule = gr.LinearDashpot(1e5, 5.0), gr.ConstantRestitution(0.9)
    report = gr.compare(scene, law, rule, t_end=float(rng.uniform(0.1, 0.3)))
    axis = report.plot().axes[0]
    end = max(axis.get_xlim())
    view = window(report)
    assert view.clock(view.end) <= end
    soft = gr.md.simulate(scene, law, t_end=view.end).contacts["pair"]
    hard = gr.edmd.simulate(scene, rule, t_end=view.end).contacts["pair"]
    bars = [len(bar.get_paths()) for bar in axis.collections if hasattr(bar, "get_paths")][: scene.n_pairs]
    assert bars == np.bincount(soft, minlength=scene.n_pairs).tolist()
    (marks,) = [x for x in axis.collections if type(x).__name__ == "PathCollection"]
    shown = np.round(marks.get_offsets()[:, 1]).astype(int)
    assert np.bincount(shown, minlength=scene.n_pairs).tolist() == np.bincount(hard, minlength=scene.n_pairs).tolist()


def test_a_run_without_contacts_is_drawn_to_its_end():
    """Later contacts would contradict the title, "nothing collides"."""
    report = gr.compare(gr.scenes.three_balls(), gr.LinearDashpot(1e6), t_end=0.1)
    assert report.verdict == "Yes, trivially: nothing collides."
    assert window(report).end == 0.1
    forces = [line.get_ydata() for axis in report.plot().axes if axis.get_ylabel().startswith("force")
              for line in axis.get_lines()]
    assert forces
    assert not any(np.any(values) for values in forces)

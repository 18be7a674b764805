"""Figure and film of one run: paths that follow from the log are those of rows, and what is not known is not drawn."""

import numpy as np
import pytest

import granular as gr
from granular.run import figures
from granular.run.trajectory import points

pytest.importorskip("matplotlib")
RULE = gr.ConstantRestitution(0.8)


def gas(n):
    rng = np.random.default_rng(n)
    mass, gap = np.r_[np.inf, rng.uniform(0.5, 2.0, n), np.inf], rng.uniform(0.01, 0.1, n + 1)
    return gr.Scene(mass, np.where(np.isinf(mass), 0.0, 0.01), gap, np.r_[0.0, rng.normal(size=n), 0.0], gravity=9.81)


RING = gr.Scene([1.0] * 4, [0.01] * 4, [0.1] * 4, [1.0, 0.0, 0.0, -0.3], ring=True)
PUSHED = gr.Scene([1.0, 2.0], [0.1, 0.1], [0.5], [1.0, 0.0], external_force=[0.0, -3.0], origin=1e3)


@pytest.mark.parametrize("scene", [gas(1), gas(20), RING, PUSHED, gr.scenes.three_balls()], ids=str)
def test_paths_of_hard_spheres_follow_from_the_log(scene):
    times = np.linspace(0.0, 0.7, 300)
    rule = gr.ConstantRestitution(0.97)
    few, many = (gr.edmd.simulate(scene, rule, t_end=0.7, samples=samples) for samples in (None, times))
    assert (len(few.time), len(few.contacts) > 0) == (2, True)
    assert figures.paths(few, times) == pytest.approx(points(many), rel=1e-9, abs=1e-9)


def test_paths_of_soft_spheres_with_rows_are_those_of_all_rows():
    scene = gr.scenes.newtons_cradle(5)
    some, many = (gr.md.simulate(scene, gr.Hertz(1e9), t_end=2e-3, samples=count) for count in (201, 1001))
    assert figures.paths(some, many.time) == pytest.approx(points(many), abs=1e-3 * np.ptp(points(many)))


def test_a_figure_has_a_panel_for_contacts_that_take_a_small_part_of_the_run():
    scene = gr.Scene([1.0] * 3, [0.1] * 3, [1e-3, 2e-3], [1.0, 0.0, -1.0])
    whole, near = gr.edmd.simulate(scene, RULE, t_end=10.0).plot().axes
    assert (whole.get_xlabel(), near.get_xlabel()) == ("time (s)", "time since the first contact at t = 0.001 s (µs)")
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    fallen = gr.md.simulate(scene, law, until=gr.until.contact(0, 2))  # its rows do not tell what contacts look like
    assert [axis.get_xlabel() for axis in fallen.plot().axes] == ["time (ms)"]
    late = gr.md.simulate(scene, law, t_end=0.3202, samples=np.linspace(0.3192, 0.3202, 200))
    said = "time since the first contact at t = 0.319275 s (µs)"
    assert [axis.get_xlabel() for axis in late.plot().axes] == [said]
    assert len(gr.edmd.simulate(gas(3), RULE, t_end=0.5).plot().axes) == 1


@pytest.mark.parametrize("n", [1, 3, 20, 200])
def test_every_contact_is_marked_and_few_balls_have_names(n):
    run = gr.edmd.simulate(gas(n), RULE, t_end=0.1 if n > 1 else 1.0)
    axis = run.plot().axes[0]
    marks = next(line for line in axis.lines if line.get_marker() == ".")
    assert len(marks.get_xdata()) == len(run.contacts) > 0
    assert bool(axis.texts) == (n <= 10)
    low, high = axis.get_ylim()
    assert ((low < marks.get_ydata()) & (marks.get_ydata() < high)).all()


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_scales_and_an_empty_log(size):
    scene = gr.Scene([1.0] * 2, [size] * 2, [size], [0.0, size])
    axis = gr.edmd.simulate(scene, RULE, t_end=1.0).plot().axes[0]
    low, high = axis.get_ylim()
    assert high - low == pytest.approx(1.08 * 2.0 * size / (1.0 if size > 1.0 else 1e-9))
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ["hard spheres"]


def test_of_many_contacts_some_are_marked_which_is_said():
    run = gr.edmd.simulate(gas(20), gr.ConstantRestitution(1.0), t_end=12.0)
    assert len(run.contacts) > figures.MAX_MARKS
    every = 1 + len(run.contacts) // figures.MAX_MARKS
    said = [text.get_text() for text in run.plot().axes[0].get_legend().get_texts()]
    assert said[1] == f"a contact begins (one of {every} shown)"


@pytest.mark.parametrize("run", [
    gr.md.simulate(gr.scenes.newtons_cradle(3), gr.Hertz(1e9), t_end=1e-3),
    gr.edmd.simulate(gas(2).replace(floor=gr.walls.Sine(0.01, 5.0)), RULE, t_end=1e-3),
    gr.edmd.simulate(gas(20), RULE, t_end=1e-1, log=False),
], ids=["long contacts", "shaken wall", "no log"])
def test_what_the_log_does_not_tell_is_refused(run, tmp_path):
    for draw in (run.plot, lambda: run.animate(tmp_path / "run.gif")):
        with pytest.raises(ValueError, match=r"must have more samples to draw its paths, got 2\. Simulate with "
                                             "samples=np"):
            draw()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.rotating
def test_a_film_has_its_pictures_and_is_refused_for_too_many(tmp_path):
    image = pytest.importorskip("PIL.Image")
    for scene in (gas(2), RING):
        gr.edmd.simulate(scene, RULE, t_end=0.5).animate(tmp_path / "run.gif", seconds=0.5, fps=6)
        with image.open(tmp_path / "run.gif") as film:
            assert film.n_frames == 3
    with pytest.raises(ValueError, match=r"`scene` must have at most 60 bodies for a film, got 72\. Play larger "
                                         r"runs with granular view\."):
        gr.edmd.simulate(gas(70), RULE, t_end=0.01).animate(tmp_path / "more.gif")
    with pytest.raises(ValueError, match=r"The suffix of run\.avi must be one of \.gif, \.mp4, got '\.avi'\."):
        gr.edmd.simulate(RING, RULE, t_end=0.5).animate(tmp_path / "run.avi")

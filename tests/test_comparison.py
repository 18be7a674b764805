"""The main job: one scene under both engines, and the discrepancy."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular import measures


@pytest.fixture(scope="module")
def report():
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    return gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))


def test_three_balls_of_the_paper(report):
    floor, top = report.pairs
    assert (floor.hard_contacts, floor.soft_contacts) == (1, 1)
    assert (top.hard_contacts, top.soft_contacts) == (1, 4)
    assert top.hard_v_rel == pytest.approx(3.7271894236810663, rel=1e-13)
    assert top.soft_v_rel == pytest.approx(0.17728241069, rel=1e-3)
    assert report.restitution_ratio == pytest.approx(0.0767377994, rel=1e-3)
    assert report.verdict.startswith("No: pair 1 has 4 contacts, not 1")


def test_every_contact_of_the_upper_pair_overlaps_the_floor_contact(report):
    assert len(report.overlaps) == 4
    log = report.soft.contacts
    for overlap in report.overlaps:
        assert (log[overlap.lower]["pair"], log[overlap.upper]["pair"]) == (0, 1)
        assert overlap.end - overlap.begin == pytest.approx(log[overlap.upper]["duration"], rel=1e-9)
    assert report.measures["crowding"] == 1.0
    assert 0.13 < report.measures["shared_impulse"] < 0.15


def test_effective_restitution_by_root_is_the_closed_form(report):
    (eps,) = report.effective_restitution()
    assert eps == pytest.approx(0.7 * report.restitution_ratio, rel=1e-9)
    assert report.effective_restitution(lambda run: float(run.count(1))) == ()  # EDMD has one contact for any ε


def test_far_apart_is_binary():
    scene = gr.scenes.three_balls(gap=1e-2)
    law = [gr.LinearDashpot.from_restitution(0.9, k=5e7, pair=p) for p in scene.pairs]
    far = gr.compare(scene, law, until=gr.until.contact(0, 2))
    assert far.overlaps == ()
    assert far.measures["shared_impulse"] == 0.0
    assert far.restitution_ratio == pytest.approx(1.000926, abs=2e-3)
    assert far.verdict.startswith("Yes: every contact is binary")


def test_touching_cradle_has_no_unique_hard_sphere_answer():
    scene = gr.scenes.newtons_cradle(3)
    cradle = gr.compare(scene, gr.Hertz(1e9))
    np.testing.assert_allclose(cradle.hard.velocity[-1], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(cradle.soft.velocity[-1], [-0.071, 0.076, 0.995], atol=1e-3)
    assert cradle.verdict.startswith("No")


def test_what_cannot_be_predicted_is_told_from_a_wrong_model(report):
    shifted = report.scene.replace(gap=report.scene.gap * [1.0, 200.0])
    lost = replace(report, twin=gr.edmd.simulate(shifted, gr.ConstantRestitution(1.0), until=report.until))
    assert lost.measures["predictability"] > 0.01
    assert "compare ensembles" in lost.verdict


def test_ongoing_contact_is_followed_to_its_end():
    scene = gr.scenes.three_balls(radii=(0.0105, 0.01), gap=1e-7)
    law = [gr.LinearDashpot.from_restitution(0.9, k=5e7, pair=p) for p in scene.pairs]
    begins = gr.md.simulate(scene, law, until=gr.until.contact(0, 2)).of(1)[0]["t_begin"]
    cut = gr.compare(scene, law, t_end=begins + 1e-6)
    assert cut.pairs[1].ongoing
    assert math.isfinite(cut.pairs[1].soft_v_rel)
    assert cut.pairs[1].soft_t_f > cut.soft.time[-1]


def test_measures_of_a_scene_without_contacts():
    apart = gr.Scene([1.0, 1.0], [0.1, 0.1], [1.0], [-1.0, 1.0])
    nothing = gr.compare(apart, gr.LinearDashpot(1e4))
    assert nothing.verdict == "Yes, trivially: nothing collides."
    assert "nothing collides" in str(nothing)
    assert math.isnan(nothing.measures["shared_impulse"])


def test_table_reads_well(report):
    text = str(report)
    for line in ("hard spheres    soft spheres", "contacts of pair 1                   1               4",
                 "Why: 4 contacts overlap in time", "φ   = 0.14"):
        assert line in text
    assert max(map(len, text.splitlines())) <= 120


def test_json_is_whole_and_strict(report, tmp_path):
    path = tmp_path / "report.json"
    report.to_json(path)
    numbers = json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    assert numbers["pairs"][1]["soft_contacts"] == 4
    assert numbers["provenance"]["versions"]["numpy"] == np.__version__
    assert numbers["scene"]["mass"][0] == "inf"
    with pytest.raises(OSError, match=r"output path is .*writable place is needed"):
        report.to_json(tmp_path / "no" / "such" / "folder.json")
    assert list(tmp_path.iterdir()) == [path]


def test_figure_is_drawn(report, tmp_path):
    report.plot(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    figure = gr.compare(gr.scenes.newtons_cradle(9), gr.Hertz(1e9)).plot()
    assert "pair" in {axis.get_ylabel() for axis in figure.axes}


def test_distance_counts_only_outcome_not_the_fall():
    scene = gr.scenes.bouncing_ball(height=1.0)
    one, two = (gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=t) for t in (0.5, 0.6))
    assert measures.distance(one, two) < 1e-12


def test_answer_that_hangs_on_the_tie_rule_is_not_called_chaos():
    cradle = gr.compare(gr.scenes.newtons_cradle(n=5), gr.Hertz(1e9), ties="newton")
    assert "tie rule" in cradle.verdict


def test_timing_at_the_end_time_is_not_an_error_of_outcome():
    scene = gr.scenes.bouncing_ball(height=1.0)
    law = gr.LinearDashpot(1e6)
    hit = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), max_events=2).contacts[1]["t_begin"]
    cut = gr.compare(scene, law, t_end=float(hit) + 1e-6)
    assert [p.hard_contacts - p.soft_contacts for p in cut.pairs] == [1]
    assert cut.verdict.startswith("Yes, but for timing")

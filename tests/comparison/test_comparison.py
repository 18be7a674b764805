"""The main job: one scene under both engines, the discrepancy, and how it is told."""

import copy
import json
import math
import pickle
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.comparison.input_warnings import warnings


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
    assert report.verdict.startswith("No: pair 1–2 has 4 contacts, not 1")


def test_every_contact_of_the_upper_pair_overlaps_the_floor_contact(report):
    assert len(report.overlaps) == 4
    log = report.soft.contacts
    for overlap in report.overlaps:
        assert (log[overlap.lower]["pair"], log[overlap.upper]["pair"]) == (0, 1)
        assert overlap.end - overlap.begin == pytest.approx(log[overlap.upper]["duration"], rel=1e-9)
    assert report.measures["crowding"] == 1.0
    assert 0.13 < report.measures["shared_impulse"] < 0.15


def test_report_certifies_isolated_contacts(report):
    log = report.soft.contacts
    first = report.overlaps[0]
    assert report.soft.first_disturbed == (log["t_begin"][first.upper], 0)
    when = f"pairs floor–1 and 1–2 at t = {first.begin:.9g} s"
    assert f"certified: 0 of 5 contacts isolated; first disturbed: {when}" in report.details()
    said = report.to_dict()
    assert (said["isolated"], said["contacts"]) == (0, 5)
    assert said["first_disturbed"] == [first.begin, 0]
    assert said["measures"]["isolated_share"] == report.measures["isolated_share"] == 0.0


def test_effective_restitution_by_root_is_the_closed_form(report):
    (eps,) = report.effective_restitution()
    assert eps == pytest.approx(0.7 * report.restitution_ratio, rel=1e-9)
    assert report.effective_restitution(lambda run: float(run.count(1))) == ()  # EDMD has one contact for any ε


def test_what_cannot_be_predicted_is_told_from_a_wrong_model(report):
    shifted = report.scene.replace(gap=report.scene.gap * [1.0, 200.0])
    lost = replace(report)
    vars(lost)["twin"] = gr.edmd.simulate(shifted, gr.ConstantRestitution(1.0), until=report.until)
    assert lost.measures["predictability"] > 0.01
    assert "compare ensembles" in lost.verdict


def test_table_reads_well(report):
    text = report.details()
    for line in ("hard spheres   soft spheres", "contacts of pair 1–2                    1              4",
                 "Why: 5 contacts of neighbouring pairs overlap in time", "φ = 0.14"):
        assert line in text
    assert max(map(len, text.splitlines())) <= 120
    assert text.splitlines()[0] == str(report).splitlines()[0] == report.verdict


@pytest.mark.rotating
@pytest.mark.parametrize("name", ["three-balls", "newtons-cradle", "ball-stack", "bouncing-ball", "heated-gas"])
def test_what_one_needs_is_within_twenty_lines(name):
    report = gr.cases.make(name, **({"n": 8, "t_end": 0.5} if name == "heated-gas" else {}))
    report = gr.compare(report.scene, report.physics("md"), until=report.until, t_end=report.t_end)
    first, *lines, last = str(report).splitlines()
    assert first == report.verdict
    assert last.endswith("report.details().")
    assert len(lines) <= 18
    own = [line for line in lines if line not in report.details().splitlines()]
    assert all(line.startswith(("2 balls", "5 balls", "1 ball", "8 balls", "3 balls", "(")) for line in own)


def test_every_warning_is_a_line_of_what_one_needs():
    """The short report named the first one only. Pairs with the same warning share a line."""
    scene, end = gr.scenes.three_balls(density=9e6), gr.until.contact(0, 2)
    report = gr.compare(scene, gr.LinearDashpot(5e7, 100.0), gr.ConstantRestitution(0.5), until=end)
    first, *more = warnings(report)
    facts = "; ".join(one.partition(";")[0] for one in more)
    assert [one.split()[0] for one in more] == ["density", "pair", "pair"]
    assert str(report).splitlines()[-3:-1] == [f"warning: {first}", f"warning: {facts}"]
    assert len(str(report).splitlines()) <= 20
    assert report.details().splitlines()[-4:] == [f"warning: {one}" for one in (first, *more)]
    scene = gr.scenes.ball_stack(5, 0.5, gap=1e-3)
    soft = [gr.LinearDashpot.from_restitution(0.7, 1e4, pair) for pair in scene.pairs]
    report = gr.compare(scene, soft, until=gr.until.contact(0, 2))
    (line,) = [one for one in str(report).splitlines() if "overlaps by" in one]
    assert line.endswith("force laws are valid up to about 10 %")
    pairs = re.findall(r"(\w+–\w+)(?: overlaps by|:) (\d+) %", line)
    assert [name for name, _ in pairs] == ["floor–1", "1–2", "2–3"]
    assert sorted((int(share) for _, share in pairs), reverse=True) == [int(share) for _, share in pairs]
    assert line.count(" more") == 1


@pytest.mark.parametrize("seed", range(8))
def test_pairs_that_are_shown_differ_most(seed):
    rng = np.random.default_rng(seed)
    scene = gr.Scene([1.0] * 7, [0.1] * 7, rng.uniform(0.0, 1e-3, 6), rng.normal(0.0, 1.0, 7))
    report = gr.compare(scene, gr.LinearDashpot.from_restitution(0.8, k=1e6, pair=scene.pairs[0]))
    shown = {int(pair) for pair in re.findall(r"^contacts of pair (\d+)–", str(report), re.MULTILINE)}
    assert "(4 more pairs, which differ less)" in str(report)
    other = {p.pair for p in report.pairs if p.soft_contacts != p.hard_contacts}
    assert len(shown & other) == min(2, len(other))
    for group in (other, set(range(6)) - other):
        far = {p.pair: abs(p.soft_v_rel - p.hard_v_rel) for p in report.pairs if p.pair in group}
        assert all(far[c] >= far[d] for c in group & shown for d in group - shown if far[d] == far[d])


@pytest.mark.parametrize("seed", range(8))
def test_pairs_that_are_shown_in_details_differ_most(seed):
    rng = np.random.default_rng(seed)
    scene = gr.Scene([1.0] * 13, [0.1] * 13, rng.uniform(0.0, 1e-3, 12), rng.normal(0.0, 1.0, 13))
    report = gr.compare(scene, gr.LinearDashpot.from_restitution(0.8, k=1e6, pair=scene.pairs[0]))
    text = report.details()
    shown = {int(pair) for pair in re.findall(r"^contacts of pair (\d+)–", text, re.MULTILINE)}
    assert "(4 more pairs, which differ less)" in text
    other = {p.pair for p in report.pairs if p.soft_contacts != p.hard_contacts}
    assert len(shown & other) == min(8, len(other))
    for group in (other, set(range(12)) - other):
        far = {p.pair: abs(p.soft_v_rel - p.hard_v_rel) for p in report.pairs if p.pair in group}
        assert all(far[c] >= far[d] for c in group & shown for d in group - shown if far[d] == far[d])
    soft = report.continued[1]
    for p in (report.pairs[c] for c in shown):
        (line,) = (line for line in text.splitlines() if line.startswith(f"v_r′ of pair {p.pair}–{p.pair + 1},"))
        beside = [row for c in (p.pair - 1, p.pair + 1) for row in soft.of(c)]
        running = any(row["t_begin"] < p.soft_t_f and not row["t_end"] <= p.soft_t_f for row in beside)
        assert running == ("in contact" in line)


def test_short_report_shows_the_ball_and_the_episode_that_decide(report):
    text, one = str(report), report.deciding
    assert (one.ball, one.episode, one.contacts, one.pairs) == (2, 0, 5, (0, 1))
    assert "v_rel" not in text
    assert "ball 2 leaves, m/s                5.91043        2.28181  error 68 %\n" in text
    assert "at t, s                       0.319294209    0.320000487  episode 0, 5 contacts\n" in text
    assert "v_r′ of pair 1–2, m/s             3.72719       0.177282  pair floor–1 in contact\n" in report.details()
    assert report.to_dict()["deciding"]["hard_velocity"] == one.hard_velocity


def test_json_is_whole_and_strict(report, tmp_path):
    path = tmp_path / "report.json"
    report.to_json(path)
    numbers = json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    assert numbers["pairs"][1]["soft_contacts"] == 4
    assert numbers["provenance"]["versions"]["numpy"] == np.__version__
    assert numbers["scene"]["mass"][0] == "inf"
    with pytest.raises(OSError, match=r"The output path must be writable, got '.*folder\.json' \(No such file or "
                                      r"directory\)\."):
        report.to_json(tmp_path / "no" / "such" / "folder.json")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.rotating
def test_figure_is_drawn(report, tmp_path):
    report.plot(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    figure = gr.compare(gr.scenes.newtons_cradle(9), gr.Hertz(1e9)).plot()
    assert "pair" in {axis.get_ylabel() for axis in figure.axes}


@dataclass(frozen=True)
class Active:
    k: float = 1e6

    def force(self, xi, xi_dot, pair):
        return (self.k - 5e4 * xi_dot) * xi


def test_law_that_gives_no_rule_is_named_rather_than_a_rule():
    scene = gr.scenes.newtons_cradle(2, 1.0, 0.5, speed=0.5)
    with pytest.raises(ValueError, match=r"The law of pair 0–1, Active\(k=1000000\.0\), must not gain energy, got "
                                         r"1\.60312e-06 N while the bodies separate and 1\.52492e-06 N while they "
                                         r"approach, at overlap ξ = 1\.56402e-12 m and 0\.5 m/s\. Damping must not "
                                         r"be negative\."):
        gr.compare(scene, Active(), t_end=2.0)


def test_hard_spheres_that_collapse_may_be_merged():
    """As in `edmd.simulate`; by default the run ends there, and the report says which."""
    row = gr.Scene([1.0] * 4, [0.0] * 4, [0.1, 0.2, 0.15], [1.0, 0.3, 0.0, -1.0])
    law = [gr.LinearDashpot.from_restitution(0.1, k=1e5, pair=pair) for pair in row.pairs]
    plain = gr.compare(row, law, t_end=2.0)
    assert plain.hard.status is gr.Status.collapse
    merged = gr.compare(row, law, t_end=2.0, collapse="merge", merge_below=1e-3)
    alone = gr.edmd.simulate(row, merged.rule, t_end=2.0, collapse="merge", merge_below=1e-3)
    assert merged.hard.status is gr.Status.time
    assert (merged.hard.velocity == alone.velocity).all()
    assert "hard collisions below 0.001 m/s were merged" in str(merged)
    assert "merged" not in plain.details()
    with pytest.raises(ValueError, match=r"`merge_below` must be None unless collapse='merge', got 0\.001\."):
        gr.compare(row, law, t_end=2.0, merge_below=1e-3)


def test_the_command_merges_too(granular):
    line = "compare vibrated-column --n 2 --restitution 0.5 --t-end 0.1 --collapse merge --merge-below 0.01 --json o"
    assert granular(line)[0] == 0
    assert json.loads(Path("o").read_text(encoding="utf-8"))["hard"]["stats"]["merge_below"] == 0.01


def test_a_root_beside_a_jump_is_found_whatever_rounding_says():
    from granular.comparison.further import roots

    grid = np.linspace(0.0, 1.0, 21)
    for rounding in (-3e-16, 0.0, 3e-16):  # at 0.95, and a jump upwards beyond
        found = roots(lambda x, r=rounding: math.nan if x == 0.0 else 2.0 if x > 0.96 else 0.95 - x + r, grid, 1.0)
        assert found == pytest.approx([0.95], abs=1e-12)


def test_balls_that_never_meet_have_a_report_too():
    scene = gr.Scene([1.0, 2.0, 1.0], [0.1] * 3, [0.1, 0.1], [-1.0, 0.0, 1.0])
    groups = gr.compare(scene, gr.LinearDashpot(1e5, 10.0), t_end=1.0).to_dict()["groups"]
    assert (groups["mass_ratio"], groups["gap_omega_over_speed"]) == (2.0, None)


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))],
                         ids=["copy", "deepcopy", "pickle"])
def test_a_report_and_its_runs_can_be_copied_and_sent_to_another_process(report, again):
    """What a comparison stores in its runs stays behind."""
    assert str(report)
    assert str(again(report)) == str(report)
    for run in (report.hard, report.soft, *report.continued, *report.counted):
        back = again(run)
        assert back.contacts.tobytes() == run.contacts.tobytes()
        assert not [name for name in vars(back) if name.startswith("_")]

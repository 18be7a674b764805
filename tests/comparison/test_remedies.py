"""Remedies for an inelastic collapse as options of a comparison, and beside Newton in one table."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.app.cli import main
from granular.comparison import remedies
from granular.comparison.input_warnings import warnings

LAW = gr.LinearDashpot.from_restitution(0.9, k=1e6, pair=gr.Scene([1.0, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0]).pairs[0])
T_C = gr.binary.collision(LAW, gr.Scene([1.0, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0]).pairs[0], 1.0).duration
"""Duration in s of a contact of two beads of 1 kg."""


def beads(mean, seed, n=5):
    """Beads thrown on a wall at 1 m/s, mean gap in v t_c: scene and laws."""
    gap = mean * T_C * np.random.default_rng(seed).uniform(0.5, 1.5, n)
    scene = gr.scenes.column(n, gap=gap.tolist(), speed=1.0)
    return scene, [gr.LinearDashpot.from_restitution(0.9, k=1e6, pair=pair) for pair in scene.pairs]


@pytest.fixture(scope="module")
def crowded():
    return gr.compare(*beads(0.5, 0))


def left(run):
    """Share of the kinetic energy that a run without gravity has left, walls left out."""
    balls = ~run.scene.is_wall
    before, after = (float(run.scene.mass[balls] @ v[balls] ** 2) for v in (run.scene.velocity, run.velocity[-1]))
    return after / before


@pytest.mark.parametrize("mean", [0.3, 3.0])
def test_rows_are_runs_with_one_option_each(mean):
    scene, law = beads(mean, 0)
    table, rule = gr.compare(scene, law).remedies(), gr.ConstantRestitution(0.9)
    runs = [gr.md.simulate(scene, law), *(gr.edmd.simulate(scene, rule, **one) for one in (
        {}, {"collapse": "merge", "merge_below": table.rows[2].setting}, {"tc": T_C},
        {"elastic_below": table.rows[4].setting})), gr.edmd.simulate(scene, gr.ConstantRestitution(0.0))]
    for row, run in zip(table.rows, runs, strict=False):
        assert row.value == pytest.approx(left(run), rel=1e-12)
        assert (row.contacts, row.status) == (len(run.contacts), run.status.name)
    assert table.rows[3].setting == pytest.approx(T_C, rel=1e-9)
    fastest = max(float((run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1]).max()) for run in runs[1:2])
    assert [table.rows[k].setting for k in (2, 4)] == pytest.approx([0.01 * fastest] * 2)
    ends = np.array([run.velocity[-1] for run in runs])  # all contacts are over: nothing pulls on a ball
    unit = max(fastest, float((runs[0].contacts["v_in"][:, 0] - runs[0].contacts["v_in"][:, 1]).max()))
    balls = np.abs(ends - ends[0]).max(axis=1) / unit
    assert table.rows[0].error == 0.0
    assert [row.name for row in table.rows[:2]] == ["soft spheres", "hard spheres"]
    assert all(row.error >= off - 1e-12 for row, off in zip(table.rows[:6], balls.tolist(), strict=True))
    assert table.rows[1].error == gr.compare(scene, law).error


def row(tc, value):
    """What the table says of a run that has this value."""
    return remedies.Remedy("", tc, value, 0.0, 0, "")


@pytest.mark.parametrize("seed", range(20))
def test_the_best_tc_of_a_value_that_grows_in_steps(seed):
    rng = np.random.default_rng(seed)
    places = np.sort(10.0 ** rng.uniform(-3.4, 1.4, 12))
    steps = np.cumsum(rng.uniform(0.0, 0.1, 13)) * rng.choice([-1.0, 1.0])
    newton = row(0.0, float(rng.uniform(*np.sort(steps[[0, -1]]))))
    found = remedies._best(lambda tc: row(tc, float(steps[np.searchsorted(places, tc / T_C)])), newton, T_C)
    reached = np.abs(steps[np.searchsorted(places, 1e-3) : np.searchsorted(places, 10.0) + 1] - newton.value)
    narrow = np.diff(np.log(np.append(places, math.inf))).min() < 2e-3
    assert abs(found.value - newton.value) == pytest.approx(reached.min(), abs=1e-15) or narrow


@pytest.mark.parametrize(("mean", "seed", "right"), [(0.5, 0, False), (1.0, 3, True), (3.0, 0, None)])
def test_the_tc_with_which_the_energy_is_that_of_newton(mean, seed, right):
    scene, law = beads(mean, seed)
    table = gr.compare(scene, law).remedies()
    newton, last = left(gr.md.simulate(scene, law)), table.rows[-1]
    assert table.rows[0].value == pytest.approx(newton, rel=1e-12)
    if right is None:
        assert (table.tc, len(table.rows)) == (0.0, 6)
        assert abs(table.rows[1].value - newton) <= 0.01
        assert str(table).splitlines()[0].endswith("No tc is required.")
        return
    assert last.value == pytest.approx(
        left(gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), tc=last.setting)), rel=1e-12)
    assert abs(last.value - newton) <= min(abs(one.value - newton) for one in table.rows[1:])
    assert (abs(last.value - newton) <= 0.01) is right
    assert table.tc == last.setting if right else math.isnan(table.tc)
    said = "is right" if right else "comes nearest, but none is right"
    assert str(table).splitlines()[0].endswith(f"Of all tc, {last.setting:.3g} s {said}.")


@pytest.mark.soak
@pytest.mark.parametrize(("mean", "newton", "tc", "best"), [
    (0.1, 0.863, 0.981, 0.071), (0.3, 0.643, 0.980, 0.169), (1.0, 0.198, 0.980, 0.333), (3.0, 0.109, 0.214, 0.0),
    (10.0, 0.108, 0.109, 0.0)])
def test_ten_beads_on_a_wall(mean, newton, tc, best):
    """Means of ten seeds: below 0.3 v t_c the TC model is nearer to Newton, from 1 v t_c on farther than hard spheres.
    """
    tables = [gr.compare(*beads(mean, seed, n=10)).remedies() for seed in range(10)]
    found = np.array([[table.rows[k].value for k in (0, 1, 3)] for table in tables]).mean(axis=0)
    assert found == pytest.approx([newton, 0.108, tc], abs=5.1e-4)
    settings = np.mean([table.rows[-1].setting * (len(table.rows) > 6) for table in tables]) / T_C
    assert settings == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize(("name", "value", "unit"), [("tc", 0.3 * T_C, "s"), ("elastic_below", 0.05, "m/s")])
def test_remedies_are_options_of_a_comparison(crowded, name, value, unit):
    scene, law = beads(0.5, 0)
    report, options = gr.compare(scene, law, **{name: value}), {name: value}
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), **options)
    assert report.hard.contacts.tobytes() == run.contacts.tobytes() != crowded.hard.contacts.tobytes()
    assert report.hard.velocity.tobytes() == run.velocity.tobytes()
    said = f"hard spheres run with {name} = {value:.3g} {unit}; the result depends on it, see remedies()"
    assert said in warnings(report)
    rows = report.remedies(tc=T_C).rows
    assert rows[3].setting == T_C
    assert rows[4].setting == (value if unit == "m/s" else pytest.approx(0.01 * measures.fastest_approach(run)))
    assert rows[1].contacts == len(crowded.hard.contacts)


def test_a_rise_is_not_told_of_hard_spheres_that_are_elastic_for_a_while():
    scene, law = gr.scenes.three_balls(), gr.LinearDashpot(5e7, 100.0)
    report = gr.compare(scene, law, until=gr.until.contact(0, 2), tc=1e-6)
    assert math.isnan(report.rises[0])
    assert report.rises[1] > 0.0


def test_a_collapse_is_taken_as_it_stops_and_costs_no_run_beyond_it(monkeypatch):
    scene = gr.scenes.newtons_cradle(3, gap=1.0)
    law = gr.LinearDashpot.from_restitution(0.05, k=1e6, pair=scene.pairs[0])
    report = gr.compare(scene, law)
    assert report.hard.status is gr.Status.collapse
    monkeypatch.setattr(type(report), "_carried_on", lambda self, run, _: run if "verdict" not in run.stats
                        else pytest.fail("carried on"))
    row = report.remedies().rows[1]
    assert (row.status, row.contacts) == ("collapse", len(report.hard.contacts))
    assert row.value == pytest.approx(left(report.hard), rel=1e-12)
    assert 0.0 < row.error < 1.0


def test_the_verdict_where_hard_spheres_collapse_and_soft_ones_part():
    scene = gr.scenes.newtons_cradle(3, gap=1.0)
    law = gr.LinearDashpot.from_restitution(0.05, k=1e6, pair=scene.pairs[0])
    report = gr.compare(scene, law)
    assert report.verdict.startswith("No: hard spheres collide forever (proved), soft spheres separate after ")
    unknown = replace(report, hard=replace(report.hard, status=gr.Status.bounded))
    assert unknown.verdict.startswith("No: hard spheres possibly collide forever (proved), soft spheres separate ")


def test_an_observable_of_ones_own():
    scene, law = beads(1.0, 3)

    def fastest(run):
        return float(np.abs(run.velocity[-1]).max())

    table = gr.compare(scene, law).remedies(fastest)
    assert table.what == "fastest"
    assert table.rows[0].value == float(np.abs(gr.md.simulate(scene, law).velocity[-1]).max())
    best, newton = table.rows[-1], table.rows[0]
    assert math.isnan(table.tc) is (abs(best.value - newton.value) > 0.01 * newton.value)


def test_what_the_engine_refuses_says_so():
    rows = gr.compare(*beads(0.5, 0), ties="newton").remedies().rows
    assert [row.status.partition(":")[0] for row in rows] == ["quiet"] * 2 + ["refused"] * 5
    assert "`ties` must be 'left', 'right' or 'random'" in rows[2].status


def test_a_scene_in_which_nothing_collides():
    table = gr.compare(gr.Scene([1.0, 1.0], [0.1, 0.1], [1.0], [-1.0, 1.0]), LAW).remedies()
    assert [row.contacts for row in table.rows] == [0] * 6
    assert table.tc == 0.0


def test_words_html_and_json(crowded, tmp_path, capsys):
    table = crowded.remedies()
    lines = str(table).splitlines()
    assert lines[2].split() == ["s,", "m/s", "E/E0", "worst", "error", "contacts", "status"]
    assert len(lines) == 3 + len(table.rows)
    assert f"<b>{lines[0]}</b>" in table._repr_html_()
    assert "<img" not in table._repr_html_()
    table.to_json(tmp_path / "remedies.json")
    kept = json.loads((tmp_path / "remedies.json").read_text())
    assert [row["name"] for row in kept["rows"]] == [row.name for row in table.rows]
    assert kept["scene"]["mass"][0] == "inf"
    assert main(["compare", "column", "--n", "3", "--remedies"]) == 0
    report, _, rest = capsys.readouterr().out.partition("\n\nSoft spheres have E/E0 = ")
    assert report.endswith("report.details().")
    assert "\nsticky " in rest


@pytest.mark.parametrize(("options", "sentence"), [
    ({"tc": -1.0}, r"`tc` must be a finite number of at least 0, got -1\.0"),
    ({"elastic_below": math.nan}, r"`elastic_below` must be a finite number of at least 0, got nan\."),
    ({"tc": 1e-3, "collapse": "merge"},
        r"Only one remedy for an inelastic collapse can be given, got sticking or collapse='merge' and tc\."),
])
def test_misuse_of_options(options, sentence):
    with pytest.raises(ValueError, match=sentence):
        gr.compare(*beads(1.0, 0), **options)


def test_misuse_of_remedies():
    report = gr.compare(*beads(10.0, 0, n=2))
    with pytest.raises(ValueError, match=r"`merge_below` must be a finite number above 0, got 0"):
        report.remedies(merge_below=0)
    with pytest.raises(TypeError, match=r"`observable` must be a function or None, got 'E'"):
        report.remedies("E")

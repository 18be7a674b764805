"""Error against run time: what the numbers mean, that they repeat, and what is written and drawn."""

import dataclasses
import json
import math
from xml.etree import ElementTree

import numpy as np
import pytest

import granular as gr
from bench.reference import solve
from granular import cases
from granular._engine.reports import duration
from granular.app import cli
from granular.app.cli import output
from granular.studies import reference
from granular.studies.frontier_methods import (
    FRONTIER_METHODS,
    Task,
    contacts_of,
    errors,
    expected_orders,
    package_method,
)
from granular.studies.frontiers import Frontier, Row

QUICK = ("located", "verlet", "edmd", "dop853+events", "dop853")


def scene_and_law(law=None):
    scene = gr.scenes.three_balls()
    chosen = law or (lambda pair: gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair))
    return scene, [chosen(pair) for pair in scene.pairs], {"until": gr.until.contact(0, 2)}


@pytest.fixture(scope="module")
def coarse():
    """Fewer and coarser points than by default, so that tests are quick."""
    patch = pytest.MonkeyPatch()
    patch.setattr("granular.studies.frontier_methods.STEP_COUNT", 5)
    patch.setattr("granular.studies.frontier_methods.MAX_STEPS_BY_ENGINE", {"compiled": 100_000, "plain": 20_000})
    yield
    patch.undo()


@pytest.fixture(scope="module")
def report(coarse):
    scene, law, end = scene_and_law()
    pytest.importorskip("mpmath")
    truth = solve(scene, law, **end, digits=24)
    return gr.frontier(scene, law, **end, methods=QUICK, repeats=1, reference=truth)


@pytest.mark.rotating
def test_located_is_at_rounding_level_and_the_fastest_below_1e_6(report):
    (located,) = report.of("located")
    assert located.rounding
    assert located.velocity_error < 2e-15
    assert report.fastest(1e-6) is located


def test_errors_fall_with_the_setting_and_orders_are_those_of_theory(report):
    for method in ("verlet", "dop853+events", "dop853"):
        rows = [row for row in report.of(method) if row.good]
        assert [row.setting for row in rows] == sorted((row.setting for row in rows), reverse=True)
        assert rows[-1].velocity_error < 0.1 * rows[0].velocity_error
    assert report.orders["verlet"] == (2.0, 1.0)  # a jump of the force leaves order 1, with much scatter
    assert 0.5 < report.order("dop853+events") < 1.5
    assert math.isnan(report.order("located"))


def test_hard_spheres_have_the_wrong_count_here(report):
    (hard,) = report.of("edmd")
    assert hard.wrong_count
    assert math.isnan(hard.time_error)
    assert hard.velocity_error > 0.1


def test_errors_repeat_to_the_last_digit(report, coarse):
    again = gr.frontier(report.scene, report.law, until=report.until, methods=QUICK[:4], repeats=1,
                        reference=report.reference)
    kept = [row for row in report.rows if row.method in QUICK[:4]]
    for one, other in zip(kept, again.rows, strict=True):
        for name in ("setting", "velocity_error", "time_error", "wrong_count", "rounding", "work", "status"):
            assert repr(getattr(one, name)) == repr(getattr(other, name))


def test_measured_order_is_a_regression_that_leaves_out_what_does_not_count(report):
    def row(dt, error, wrong=False, rounding=False):
        return Row("verlet", dt, error, error, wrong, rounding, 1.0, 1, "steps", "until")

    rows = [row(1e-1, 5.0, wrong=True), *(row(10.0**-k, 3.0 * 10.0 ** (-2.0 * k)) for k in range(2, 6)),
            row(1e-9, 1e-16, rounding=True)]
    made = Frontier(report.scene, report.law, None, None, report.reference, tuple(rows), {"verlet": "dt"})
    assert made.order("verlet") == pytest.approx(2.0, abs=1e-12)
    assert made.fastest(1e-6, without=("verlet",)) is None


def test_contacts_of_another_number_are_wrong_and_missing_ones_leave_no_error():
    scene, law, end = scene_and_law()
    soft = gr.md.simulate(scene, law, **end)
    contacts = contacts_of(soft)
    truth = reference.Reference(contacts, 1.0, "until", "itself")
    assert errors(truth, contacts, 2) == (0.0, 0.0, False)
    velocity, time, wrong = errors(truth, contacts[:-1], 2)
    assert wrong
    assert velocity > 0.0
    assert math.isnan(time)
    assert math.isnan(errors(truth, contacts[:1], 2)[0])


def test_expected_orders_follow_from_how_forces_begin():
    def orders(law, name):
        scene, laws, end = scene_and_law(lambda pair: law)
        return expected_orders(Task(scene, tuple(laws), end["until"], None, None), [name])[name]

    assert orders(gr.LinearDashpot(5e7), "rk4") == (4.0, 2.0)
    assert orders(gr.Hertz(1e9), "rk4") == (4.0, 2.5)
    assert orders(gr.ViscoelasticHertz(1e9, 1e4), "gear5") == (4.0, 1.5)
    assert orders(gr.TsujiHertz(1e9, 0.1), "verlet") == (2.0, 1.25)
    assert orders(gr.WaltonBraun(1e6, 2e6), "verlet") == (2.0, 2.0)


@pytest.mark.rotating
def test_nonlinear_laws_have_a_tolerance_and_laws_with_memory_no_solver_without_events():
    scene, law, end = scene_and_law(lambda pair: gr.Hertz(1e9))
    truth = reference.Reference(contacts_of(gr.md.simulate(scene, law, **end)), 0.8, "until", "")
    method = package_method(Task(scene, tuple(law), end["until"], None, truth), "located")
    assert (method.setting_name, len(method.settings)) == ("tol", 7)
    scene, law, end = scene_and_law(lambda pair: gr.WaltonBraun(5e7, 1e8))
    report = gr.frontier(scene, law, **end, methods=("located", "dop853"), repeats=1)
    assert report.methods == ("located",)
    assert "DOP853" in report.reference.solver


def test_the_table_says_what_it_is_about(report):
    text = str(report)
    for words in ("reference: Taylor series", "its error", "WRONG", "(not resolved)", "min(p, 1+s)", "fastest other"):
        assert words in text
    hard = dataclasses.replace(report, rows=tuple(row for row in report.rows if row.method == "edmd"))
    assert "order in" in text
    assert "order in" not in str(hard)  # no table without rows
    assert [duration(x) for x in (2.0, 3.1e-3, 4.25e-6, 5e-9)] == ["2 s", "3.1 ms", "4.25 µs", "5 ns"]


def test_json_has_provenance_and_every_digit(report, tmp_path):
    report.to_json(tmp_path / "out.json")
    data = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert data["provenance"]["versions"]["numpy"]
    assert data["provenance"]["run_on"]["processor"]
    assert data["scene"]["mass"][0] == "inf"
    assert len(data["reference"]["contacts"][0]["t_begin"]) > 20
    assert [row["velocity_error"] for row in data["rows"]] == [
        None if math.isnan(row.velocity_error) else row.velocity_error for row in report.rows]


@pytest.mark.rotating
def test_plot_writes_a_figure(report, tmp_path):
    for ending in ("png", "svg"):
        report.plot(tmp_path / f"out.{ending}")
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "out.png").stat().st_size < 150_000
    assert ElementTree.parse(tmp_path / "out.svg").getroot().tag == "{http://www.w3.org/2000/svg}svg"
    figure = report.plot()
    assert [axis.get_xlabel() for axis in figure.axes] == ["run time (ms)"] * 2


@pytest.mark.parametrize(("options", "sentence"), [
    ({"methods": ["euler"]}, "`methods` must be one of located, .*, got 'euler'"),
    ({"repeats": 0}, "`repeats` must be an integer of at least 1.*, got 0"),
    ({"until": None, "t_end": 0.1}, "a contact that ends within the run"),
])
def test_misuse_is_one_sentence(options, sentence):
    scene, law, end = scene_and_law()
    with pytest.raises(ValueError, match=sentence):
        gr.frontier(scene, law, **(end | options))


def test_errors_below_that_of_the_reference_are_not_resolved(coarse):
    scene, law, end = scene_and_law()
    report = gr.frontier(scene, law, **end, methods=("located",), repeats=1)
    (located,) = report.rows
    assert located.velocity_error < report.floor == report.reference.velocity_error < 1e-9
    assert located.rounding
    text = str(report)
    assert f"errors below {report.floor:.1g} are not resolved" in text
    assert "1e-09" in text
    assert "\n1e-12 " not in text


def test_no_scene_is_one_sentence():
    for call in (gr.frontier, reference.solve, solve):
        with pytest.raises(TypeError, match=r"`scene` must be a granular\.Scene, such as "
                                            r"granular\.scenes\.three_balls\(\), got None\."):
            call(None, gr.LinearDashpot(1e6))


def test_command(coarse, capsys, tmp_path):
    out = tmp_path / "out.json"
    line = f"frontier three-balls --restitution 1 --methods located edmd --repeats 1 --json {out}"
    assert cli.main(line.split()) == 0
    assert "located" in capsys.readouterr().out
    assert json.loads(out.read_text(encoding="utf-8"))["rows"]


def test_command_measures_the_first_contacts_of_a_scene_that_only_its_time_ends(capsys, monkeypatch):
    """And ends where no contact begins or ends."""
    asked = []
    monkeypatch.setattr(gr, "frontier", lambda scene, law, **options: asked.append(options["t_end"]))
    monkeypatch.setattr(output, "write_report", lambda report, given: None)
    for line in ("frontier vibrated-column", "frontier vibrated-column --t-end 0.03", "frontier three-balls"):
        assert cli.main(line.split()) == 0
    end, given, default = asked
    assert given == 0.03
    assert default == cases.make("three-balls").t_end
    assert capsys.readouterr().err == f"granular: up to t = {end:.6g} s; give --t-end for another end\n"
    contacts = cases.make("vibrated-column", t_end=1.2 * end).simulate("md").contacts
    times = np.concatenate([contacts["t_begin"], contacts["t_end"]])
    assert 4 <= (contacts["t_end"] < end).sum() <= 16
    assert np.nanmin(np.abs(times - end)) > 2e-5


@pytest.mark.parametrize("line", ["compressed-chain --ends walls", "bouncing-ball --height 0"])
def test_command_says_at_once_that_no_contact_ends(line, capsys, monkeypatch):
    """And nothing else; the reference would follow a ball at rest forever."""
    monkeypatch.setattr(reference, "solve_with", lambda *a, **b: pytest.fail("it was solved"))
    assert cli.main(["frontier", *line.split()]) == 2
    err = capsys.readouterr().err
    assert err.startswith("granular: `scene` must have a contact that ends within the run, got none for Scene(")


def test_rest_without_an_end_is_refused():
    ball = gr.scenes.bouncing_ball()
    with pytest.raises(ValueError, match=r"`t_end` or `until` must be given if the balls come to rest, got None\. "
                                         r"The reference solution would not end\."):
        gr.frontier(ball, gr.LinearDashpot.from_restitution(0.5, k=1e5, pair=ball.pairs[0]))


def test_command_names_its_mistakes(capsys):
    assert cli.main(["frontier"]) == 2
    assert "frontier requires a scene" in capsys.readouterr().err
    assert cli.main(["frontier", "three-balls", "--methods", "euler"]) == 2
    assert "one of located" in capsys.readouterr().err
    assert cli.main(["frontier", "three-balls", "--help"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in ("--plot", "--methods", "--restitution", *FRONTIER_METHODS[:3]))

"""Study of stiff and extreme cases: references, verdicts, tables, detection."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pytest

import granular as gr
from bench import docs_data
from bench.stability import AXES, StabilityReport, contact, line, rest, stability
from bench.stability.__main__ import main
from bench.stability.cell import ALL_METHODS, FIXED_METHODS, Cell, Truth, Verdict, rerun_function
from bench.stability.contact import two_body_cell
from bench.stability.hard import rational_run
from bench.stability.long import limits
from bench.stability.study import deadline, run_cell as run_cell_at_full_length
from granular.run.trajectory import Trajectory
from granular.studies import extremes

run_cell = partial(run_cell_at_full_length, plain=True)  # a deadline must not interrupt a compiler


@pytest.fixture(scope="module")
def quick() -> StabilityReport:
    return stability(quick=True)


@pytest.mark.soak
def test_quick_study_of_every_axis_and_method(quick: StabilityReport) -> None:
    assert set(quick.methods) == set(ALL_METHODS)
    assert set(AXES) <= set(quick.axes)
    assert len(quick.cells) > 150


@pytest.mark.soak
def test_default_methods_are_never_silently_wrong(quick: StabilityReport) -> None:
    for method in ("located", "edmd"):
        wrong = [(c.axis, c.case, c.error) for c in quick.of(Verdict.wrong, method=method)]
        assert wrong == []


@pytest.mark.soak
def test_verdicts_are_those_of_the_docs(quick: StabilityReport) -> None:
    stored = json.loads((docs_data.DATA_FOLDER / "stability.json").read_text("utf-8"))
    assert sorted(docs_data.verdicts(quick)) == sorted(stored), "stale: python bench/docs_data.py stability"


@pytest.mark.soak
def test_every_flag_says_why(quick: StabilityReport) -> None:
    assert all(len(cell.said) > 20 for cell in quick.of(Verdict.flagged))


@pytest.mark.soak
def test_tables_count_every_cell(quick: StabilityReport) -> None:
    rows = quick.tables()["cells"][1:]
    assert sum(int(row[1]) for row in rows) == len(quick.cells)
    assert all(sum(map(int, row[2:])) == int(row[1]) for row in rows)
    assert "silently wrong" in str(quick)
    assert quick.markdown().startswith("**cells**\n\n| method |")


@pytest.mark.soak
def test_json_has_every_cell_and_where_it_was_made(quick: StabilityReport, tmp_path) -> None:
    path = tmp_path / "table.json"
    quick.to_json(path)
    stored = json.loads(path.read_text("utf-8"))
    assert len(stored["cells"]) == len(quick.cells)
    assert stored["provenance"]["versions"]["numpy"]
    assert {"axis", "case", "method", "truth", "verdict", "error", "tolerance", "said"} <= set(stored["cells"][0])


def test_running_twice_gives_the_same_errors() -> None:
    pick = {"methods": ("located", "verlet"), "axes": "stiffness", "quick": True}
    first, second = stability(**pick), stability(**pick)
    assert [cell.error for cell in first.cells] == [cell.error for cell in second.cells]


@pytest.mark.rotating
def test_stability_limits_against_theory() -> None:
    for row in limits((1, 5)):
        if math.isfinite(row.theory):
            assert row.measured == pytest.approx(row.theory, rel=0.01)


def test_a_long_chain_tends_to_the_step_of_two_contacts() -> None:
    assert 2.0 / (2.0 * math.cos(0.5 * math.pi / 21)) == pytest.approx(1.0, rel=0.003)


def sample(error: float) -> Cell:
    return replace(two_body_cell("a", "b", "linear"), truth=Truth("test", lambda run, rerun: error))


@pytest.mark.parametrize(("error", "verdict"), [(0.0, "right"), (1.0, "wrong"), (math.nan, "wrong")])
def test_verdict_on_an_error(error: float, verdict: str) -> None:
    assert run_cell(sample(error), "located", 5.0).verdict is Verdict[verdict]


def test_a_limit_on_work_is_a_flag() -> None:
    cell = replace(sample(1.0), options={"max_events": 0})
    result = run_cell(cell, "located", 5.0)
    assert result.verdict is Verdict.flagged
    assert "limit on the amount of work" in result.said


def test_a_warning_is_a_flag() -> None:
    cell = replace(two_body_cell("a", "b", "linear"), methods=FIXED_METHODS)
    dt = 0.5 / math.sqrt(1e6)
    result = run_cell(replace(cell, options={"dt": dt, "t_end": 0.1}, loose=0.0), "verlet", 5.0)
    assert result.verdict is Verdict.flagged
    assert "errors are visible" in result.said


def test_a_sentence_is_a_flag_and_any_other_error_a_crash() -> None:
    def fails(run: object, rerun: object) -> float:
        raise ZeroDivisionError("float division by zero")

    result = run_cell(replace(sample(0.0), truth=Truth("test", fails)), "located", 5.0)
    assert result.verdict is Verdict.crashed
    touching = gr.Scene([math.inf, 1, 1, math.inf], [0, 0.1, 0.1, 0], [0, 0, 0], [0, 1, -1, 0])
    refused = replace(sample(0.0), scene=touching, options={"ties": "reflect"})
    assert run_cell(refused, "edmd", 5.0).verdict is Verdict.flagged


def test_no_cell_hangs() -> None:
    def waits(run: object, rerun: object) -> float:
        while True:
            pass

    result = run_cell(replace(sample(0.0), truth=Truth("test", waits)), "located", 0.05)
    assert result.verdict is Verdict.limit


def test_a_deadline_leaves_nothing_behind() -> None:
    with deadline(0.05):
        pass
    end = time.process_time() + 0.1
    while time.process_time() < end:
        pass


def test_rational_runs_by_hand() -> None:
    pairs, velocity = rational_run(gr.scenes.newtons_cradle(3, gap=1.0), 1.0, 10)
    assert pairs == [0, 1]
    assert velocity.tolist() == [0.0, 0.0, 1.0]


def shifted(name: str, by: float) -> Callable[[Trajectory], Trajectory]:
    """The same run with the last row of an array shifted."""

    def change(run: Trajectory) -> Trajectory:
        array = np.array(getattr(run, name))
        array[-1] += by
        return replace(run, **{name: array})

    return change


def logged(name: str, by: float) -> Callable[[Trajectory], Trajectory]:
    """The same run with one number of its last contact changed by a share."""

    def change(run: Trajectory) -> Trajectory:
        rows = run.contacts.copy()
        rows[name][-1] *= 1.0 + by
        return replace(run, contacts=rows)

    return change


def twice(run: Trajectory) -> Trajectory:
    """The same run with its last contact logged twice."""
    return replace(run, contacts=np.concatenate([run.contacts, run.contacts[-1:]]))


@cache
def some(cells: Callable[[], Any]) -> list[tuple[Cell, Trajectory]]:
    """Some cells and their runs, each computed once for all changes."""
    every = [cell for cell in cells() if not cell.slow and "max_events" not in cell.options]
    return [(cell, rerun_function(cell, "located", plain=True)()) for cell in every[:: 1 + len(every) // 4]]


@pytest.mark.rotating
@pytest.mark.parametrize(("cells", "change"), [
    (contact.powers, shifted("velocity", 1e-9)), (contact.powers, logged("duration", 1e-9)), (contact.powers, twice),
    (contact.kinks, shifted("velocity", 1e-9)), (contact.kinks, logged("xi_max", 1e-9)),
    (contact.kinks, logged("impulse", 1e-9)),
    (line.recorded, shifted("velocity", 1e-7)), (line.recorded, logged("force_max", 1e-7)),
    (line.recorded, logged("t_begin", 1e-7)), (line.recorded, logged("v_out", 1e-7)), (line.recorded, twice),
    (rest.rests, shifted("gap", 1e-9)), (rest.rests, shifted("velocity", 1e-9)), (rest.rests, shifted("time", 1e-9)),
    (rest.rests, logged("impulse", 1e-9)),
    (line.counts, shifted("velocity", 1e-9)), (line.counts, twice),
    (rest.last_rows, shifted("time", 1e-9)),
])
def test_a_small_change_of_a_run_is_found(
    cells: Callable[[], Any], change: Callable[[Trajectory], Trajectory]
) -> None:
    for cell, run in some(cells):
        assert cell.truth.error(run, None) <= cell.tolerance
        assert not cell.truth.error(change(run), None) <= cell.tolerance, cell.case


def test_a_row_of_the_next_sample_is_found() -> None:
    cell = next(cell for cell in rest.last_rows() if "10 rows" in cell.case)
    run = rerun_function(cell, "edmd", plain=True)()
    asked = np.linspace(0.0, 30.0, 10)
    late = replace(run, time=asked[: len(run.time)])
    assert cell.truth.error(run, None) <= cell.tolerance < cell.truth.error(late, None)


def test_a_run_that_ends_at_rest_before_its_end_is_found() -> None:
    cell = next(cell for cell in rest.rests() if "balls from" in cell.case)
    run = rerun_function(replace(cell, options={}), "located", plain=True)()
    assert run.status.name == "resting"
    assert cell.truth.error(run, None) == math.inf


@pytest.mark.rotating
@pytest.mark.parametrize("tol", [1e-4, 1e-9])
def test_the_error_estimate_is_never_below_the_error(tol: float) -> None:
    estimates = []
    for one, cell in [*zip(line.stored_scenes(), line.recorded(), strict=True)][3:90:12]:
        run = rerun_function(cell, "located", plain=True)(tol=tol)
        estimates.append(run.stats["error_estimate"])
        error = float(np.abs(run.velocity[-1] - one["final"]).max()) / one["unit"]["final"]
        assert error <= estimates[-1] + 2e-14, cell.case
    assert max(estimates) > 0.1 * tol


def test_every_kind_of_recorded_scene_is_there() -> None:
    kinds = {one["kind"] for one in line.stored_scenes()}
    assert len(kinds) == 7
    assert len(line.stored_scenes()) > 90
    second = [one for one in line.stored_scenes() if one["kind"].startswith("second")]
    assert all(any(b > 0.0 for b in one["t_begin"]) for one in second)


@pytest.mark.soak
def test_recorded_scenes_are_those_of_the_independent_solver() -> None:
    from bench.stability import recorded

    for kind, one in recorded.chosen_cases():
        fresh = recorded.entry(kind, one)
        start = fresh["gap"], fresh["velocity"]
        stored = next(e for e in line.stored_scenes() if (e["gap"], e["velocity"]) == start)
        for name in ("pair", "final", *line.COMPARED_FIELDS):
            assert fresh[name] == pytest.approx(stored[name], rel=1e-13)


def test_misuse_is_one_sentence() -> None:
    with pytest.raises(ValueError, match=r"`methods` must be .*, got 'verlett'\. Did you mean 'verlet'\?"):
        stability(methods="verlett")
    with pytest.raises(ValueError, match=r"`axes` must be .*, got 'stiffnes'\. Did you mean 'stiffness'\?"):
        stability(axes=("stiffnes",))
    with pytest.raises(ValueError, match="`axes` must contain at least one"):
        stability(axes=())
    with pytest.raises(ValueError, match=r"`seconds` must be .*, got 0"):
        stability(seconds=0)


@pytest.mark.rotating
def test_the_command(capsys: pytest.CaptureFixture[str], tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("bench.stability.__main__.PAGE_PATH", tmp_path / "a part of it is no page")
    path = tmp_path / "table.json"
    main(["--quick", "--json", str(path), "time step"])
    out = capsys.readouterr().out
    assert "silently wrong / all cells" in out
    assert "stability limit" in out
    stored = json.loads(path.read_text("utf-8"))
    assert stored["quick"] is True
    assert {cell["axis"] for cell in stored["cells"]} == {"time step"}


def test_the_command_explains_misuse(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["foo"])
    assert "unknown axis foo" in " ".join(capsys.readouterr().err.split())


def test_the_page_holds_the_tables(monkeypatch, tmp_path) -> None:
    page, stored = tmp_path / "stability.md", []
    page.write_text("# Title\n<!-- tables -->\nold\n<!-- end -->\nafter\n", "utf-8")
    monkeypatch.setattr("bench.stability.__main__.PAGE_PATH", page)
    monkeypatch.setattr("bench.stability.__main__.measured", lambda *_: stability("edmd", "ties", quick=True))
    monkeypatch.setattr("bench.stability.__main__.FIGURE_PATH", tmp_path / "figure.png")
    monkeypatch.setattr(gr, "stability", lambda scene: extremes.stability(scene, axes=(), methods="located"), False)
    monkeypatch.setattr(docs_data, "store", lambda name, data=None: stored.append(name))
    main([])
    text = page.read_text("utf-8")
    assert text.startswith("# Title\n<!-- tables -->\n**cells**\n\n| method | cells |")
    assert text.endswith("\n<!-- end -->\nafter\n")
    assert "old" not in text
    assert stored == ["stability", "stability-three-balls"]
    assert (tmp_path / "figure.png").stat().st_size > 1_000


@pytest.mark.soak
@pytest.mark.parametrize("axis", AXES)
def test_the_full_table(axis: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        report = stability(axes=axis)
    assert len(report.cells) > len(stability(axes=axis, quick=True).cells)
    for method in ("located", "edmd"):
        assert report.of(Verdict.wrong, Verdict.crashed, method=method) == []
        assert all("100000" in cell.case for cell in report.of(Verdict.limit, method=method))

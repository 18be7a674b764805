"""Sweeps: axes, cells as a comparison says them, results of one's own, jumps between cells, the command, misuse."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.cases import Case, make
from granular.studies.sweeps import axis
from granular.studies.sweeps.results import RESULTS, STATUS_CODES

xr = pytest.importorskip("xarray")
REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "paper_points.json").read_text(encoding="utf-8"))
FAST = [name for name, result in RESULTS.items() if result.many]


def drop(gap: float = 1e-4, restitution: float = 0.7) -> Case:
    return make("three-balls", gap=gap, restitution=restitution)


def energy_left(case: Case) -> float:
    """Energy at the end over energy at the start."""
    energy = case.simulate("md").energy()
    return energy[-1] / energy[0]


@pytest.mark.parametrize(("text", "values"), [
    ("gap=1:3:3", [1.0, 2.0, 3.0]),
    ("gap=1e-2:1:3:log", [0.01, 0.1, 1.0]),
    ("n=2,3", [2, 3]),
    ("walls=True,False", [True, False]),
    ("law=LinearDashpot,TsujiHertz", ["LinearDashpot", "TsujiHertz"]),
])
def test_axes_from_text(text, values):
    name, found = axis(text)
    assert name == text.partition("=")[0]
    assert found.tolist() == (values if isinstance(values[0], (str, int)) else pytest.approx(values, rel=1e-15))


def test_a_cell_is_what_compare_says():
    scene = gr.scenes.three_balls(gap=3e-4)
    law = [gr.LinearDashpot.from_restitution(0.8, k=5e7, pair=pair) for pair in scene.pairs]
    report = gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))
    cell = gr.sweep("three-balls", {"gap": [3e-4]}, list(RESULTS), restitution=0.8).isel(gap=0)
    assert cell["contacts"].values.tolist() == [pair.soft_contacts for pair in report.pairs]
    assert cell["hard_contacts"].values.tolist() == [pair.hard_contacts for pair in report.pairs]
    assert cell["v_rel"].values.tolist() == [pair.soft_v_rel for pair in report.pairs]
    assert float(cell["eps_ratio"]) == pytest.approx(report.restitution_ratio, rel=1e-15)
    assert float(cell["shared_impulse"]) == pytest.approx(report.measures["shared_impulse"], rel=1e-12)
    assert float(cell["error"]) == report.error


@pytest.mark.rotating
@pytest.mark.parametrize(("name", "over"), [
    ("ball-stack", {"gap": [1e-5, 1e-2]}), ("newtons-cradle", {"gap": [0.0, 1e-6]}), ("gas", {"t_end": [0.5, 3.0]}),
    ("three-balls", {"t_end": [0.3197, 0.32]}), ("column", {"restitution": [0.1, 0.9]}),
])
def test_the_error_of_a_cell_is_that_of_the_comparison(name, over):
    ((parameter, values),) = over.items()
    data = gr.sweep(name, over, "error")["error"].values
    for value, error in zip(values, data, strict=True):
        case = gr.cases.make(name, **{parameter: value})
        report = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
        assert np.array_equal(error, report.error, equal_nan=True)


def test_units_and_provenance():
    data = gr.sweep("three-balls", "height=0.5,0.6", ("v_final", "duration"))
    assert data["height"].attrs["units"] == "m"
    assert data["v_final"].attrs["units"] == "m s-1"
    assert data["duration"].dims == ("height", "pair")
    assert "granular" in json.loads(data.attrs["provenance"])["versions"]
    assert data["status"].attrs["flag_meanings"].split()[2] == "until"


@pytest.mark.usefixtures("compiled_rest_tests")
def test_failing_cells_carry_their_status():
    data = gr.sweep("three-balls", {"height": [0.05, 0.6]}, ("contacts", "hard_status"))
    assert data["status"].values.tolist() == [STATUS_CODES["misuse"], STATUS_CODES["until"]]
    assert data["contacts"].values.tolist() == [[-1, -1], [1, 4]]
    assert data.attrs["refusal"].startswith("`height` must be a finite number of at least 0.1, got 0.05. ")
    heavy = gr.sweep("three-balls", "restitution=0.005,0.7", "contacts")
    # it rests, and is followed to t_end
    assert heavy["status"].values.tolist() == [STATUS_CODES["time"], STATUS_CODES["until"]]


def test_cases_and_results_of_ones_own():
    data = gr.sweep(drop, {"restitution": [0.5, 1.0]}, ["contacts", energy_left], gap=1e-3)
    assert data["contacts"].values[:, 1].tolist() == [1, 1]
    assert data["energy_left"].values[0] < data["energy_left"].values[1] == pytest.approx(1.0, abs=1e-12)
    about = {"units": "", "long_name": "energy left", "comment": "Energy at the end over energy at the start."}
    assert data["energy_left"].attrs == about
    same = gr.sweep(drop, {"restitution": [0.5, 1.0]}, sorted(FAST), gap=1e-3)
    named = gr.sweep("three-balls", {"restitution": [0.5, 1.0]}, sorted(FAST), gap=1e-3)
    assert all(np.array_equal(same[name].values, named[name].values, equal_nan=True) for name in same)


@pytest.mark.rotating
def test_boundaries_are_bisected():
    data = gr.sweep("three-balls", {"restitution": np.arange(0.5, 1.0, 0.005)}, refine="restitution", precision=1e-7)
    ends, counts = data["edge"].values, data["edge_contacts"].values[:, :, 1]
    assert counts.tolist() == [[4, 5], [5, 6], [6, 7], [7, 6], [6, 5], [5, 4], [4, 3]]
    assert (np.diff(ends, axis=1) < 1e-7).all()
    for _, end, count in REFERENCE["spike_windows"]:
        jump = ends[counts[:, 0] == count][-1]
        assert abs(jump - end).max() < 1e-6


def test_a_third_count_between_two_cells_is_found():
    data = gr.sweep("three-balls", {"gap": [1e-4], "restitution": [0.55, 1.0]}, refine="restitution")
    assert data["edge_contacts"].values[:, :, 1].tolist() == [[4, 3]]
    data = gr.sweep("three-balls", {"gap": [1e-4], "restitution": [0.55, 0.61, 1.0]}, refine="restitution")
    assert data["edge_contacts"].values[0, 0, 1] == 4
    assert data["edge_contacts"].values[:, :, 1].max() == 7
    assert data["edge_gap"].values.tolist() == [1e-4] * data.sizes["jump"]


@pytest.mark.parametrize(("arguments", "sentence"), [
    ({"scene": "three-bals", "over": "gap=1,2"},
        "`scene` must be a known name, got 'three-bals'. Did you mean 'three-balls'?"),
    ({"over": "gab=1,2"}, "three-balls has no parameter `gab`; did you mean `gap`?"),
    ({"over": "height[0]=1,2"}, "height is a single value"),
    ({"over": "radii[2]=1,2"}, "The index of radii[2] must be below 2, the number of entries, got 2."),
    ({"over": "gap=1:2:0"}, "The count of gap must be an integer of at least 1, got 0."),
    ({"over": "gap=-1:2:3:log"}, "A logarithmic axis must have positive ends, got"),
    ({"over": "gap=1:2:3:lin"}, "must end after first:last:count or with ':log', got 'gap=1:2:3:lin'"),
    ({"over": "gap"}, "name=first:last:count"),
    ({"over": "gap=1:2"}, "such as gap=0.5:1:101"),
    ({"over": "gap=1:2:1e9:log"}, "The count of gap must be an integer from 1 to 100000000, got 1000000000.0"),
    ({"over": ["gap=1e-4:1:20000", "height=0.5:1:20000"]}, "`over` must have at most 1e+08 cells, got 4e+08"),
    ({"over": {}}, "`over` must have at least one parameter with its values, got none"),
    ({"over": [gr.Hertz(1e5)]}, "Every entry of `over` must be a text such as gap=0:1:11, got Hertz(k=100000.0)"),
    ({"over": None}, "Every entry of `over` must be a text such as gap=0:1:11, got None"),
    ({"over": {"gap": [1e-4, 1e-4]}}, "The values of gap must all be different"),
    ({"over": {"gap": [[1e-4]]}}, "The values of gap must be a list of numbers or words, got [["),
    ({"over": ["gap=1,2", "gap=3,4"]}, "`over` must have one axis per parameter, got two of gap"),
    ({"over": "gap=1,2", "gap": 3.0}, "both varied and fixed"),
    ({"over": "gap=1,2", "results": "contact"}, "Did you mean 'contacts'?"),
    ({"over": "gap=1,2", "refine": "height"}, "`refine` must be one of gap, got 'height'"),
    ({"over": "gap=1,2", "results": "time", "refine": "gap"}, "result to refine by"),
    ({"over": "restitution=-1,-2"}, "`restitution` must be a number in (0, 1], got -1"),
])
def test_misuse_in_one_sentence(arguments, sentence):
    with pytest.raises((TypeError, ValueError), match=re.escape(sentence)):
        gr.sweep(**({"scene": "three-balls"} | arguments))


def test_the_command(tmp_path, capsys):
    from granular.app.cli import main

    file = tmp_path / "map.nc"
    assert main(["sweep", "three-balls", "--over", "restitution=0.76:0.82:5", "--refine", "restitution", "--save",
                 str(file), "--gap", "1e-4", "--workers", "1"]) == 0
    out = capsys.readouterr().out
    assert "status           5 × until" in out
    assert "(1, 4) to (1, 3)" in out
    assert xr.load_dataset(file).attrs["title"] == "granular sweep of three-balls"
    assert main(["sweep", "three-balls"]) == 2
    assert "--over" in capsys.readouterr().err


def test_executor_by_name_is_refused():
    with pytest.raises(TypeError, match=r"`executor` must be an object with submit\(\), such as a "
                                        r"ProcessPoolExecutor or client\.get_executor\(\) of dask, got 'dask'\."):
        gr.sweep("three-balls", "gap=1e-4,1e-3", executor="dask")


def test_labels_are_short_and_pairs_have_numbers():
    data = gr.sweep("three-balls", "restitution=0.5,0.6", "contacts")
    assert data["restitution"].attrs["long_name"] == "restitution"
    assert data["restitution"].attrs["comment"].startswith("Coefficient of restitution in (0, 1]")
    assert data["pair"].values.tolist() == [0, 1]
    case = gr.Case(gr.scenes.newtons_cradle(3), gr.Hertz(1e9), until=gr.until.separated())
    data = gr.sweep(case, {"law.k": [1e9, 2e9]}, "shared_impulse")
    assert (data["law.k"].attrs["units"], data["shared_impulse"].attrs["long_name"]) == ("N/m³ᐟ²", "shared impulse")


def test_threads_are_a_whole_number():
    with pytest.raises(ValueError, match=r"`workers` must be an integer of at least 1, got 0\."):
        gr.sweep("three-balls", "gap=1e-4,1e-3", workers=0)


def test_status_codes_in_files_keep_their_meaning():
    from granular.studies.sweeps.results import STATUS_NAMES

    names = ["time", "until", "quiet", "resting", "collapse", "disturbed", "max_events", "unstable", "misuse", "broken",
             "bounded"]
    assert dict(enumerate(names)) | {-1: "not_run"} == {code: STATUS_NAMES[code] for code in range(-1, len(names))}

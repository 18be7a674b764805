"""Rings, thermal walls and pendula in every verb: recordings, frontier, threshold (fronts: test_fronts)."""

import math

import numpy as np
import pytest

import granular as gr

pytest.importorskip("xarray")
pytest.importorskip("mpmath")
CASES = [
    ("ring-gas", {"n": 4, "length": 4.0, "t_end": 4.0}),
    ("heated-gas", {"n": 3, "length": 3.0, "t_end": 4.0}),
    ("heated-gas", {"n": 3, "gravity": 4.0, "packing": 0.0, "t_end": 3.0}),
    ("pendulum-cradle", {"n": 3, "rest_gap": 1e-3, "t_end": 2.0}),
]
EACH = pytest.mark.parametrize(("name", "options"), CASES)
STIFF = {"stiffness": 1e5, "law": "LinearDashpot"}


@EACH
def test_both_engines_and_fixed_steps_tell_of_the_same_hits(name, options):
    case = gr.cases.make(name, **options | {"stiffness": 1e7, "law": "LinearDashpot", "restitution": 1.0})
    hard = case.simulate("edmd", t_end=0.5 * case.t_end)
    soft = case.simulate("md", t_end=0.5 * case.t_end)
    steps = gr.md.simulate(case.scene, case.law, t_end=0.5 * case.t_end, method="rk4", dt=2e-5, engine="plain")
    assert hard.contacts["pair"].tolist() == soft.contacts["pair"].tolist() == steps.contacts["pair"].tolist()
    np.testing.assert_allclose(soft.velocity[-1], steps.velocity[-1], rtol=0.0, atol=1e-3)
    for one in (hard, soft):
        account = one.account()
        balance = account["energy"] - account["heat"].sum(axis=1) + account["dissipated"]
        assert balance[-1] == pytest.approx(balance[0], abs=1e-11)
        hits = one.contacts[np.isin(one.contacts["pair"], [c for c, w in ((0, one.scene.floor),) if w is not None])]
        assert not hits["duration"].any()


@pytest.mark.parametrize(("name", "options"), [
    pytest.param(*case, marks=pytest.mark.soak) for case in (CASES[0], CASES[2], CASES[3])])
def test_the_frontier_knows_the_scene(name, options):
    case = gr.cases.make(name, **options | STIFF)
    methods = ["located", "dop853+events", "dop853"]
    found = gr.frontier(case.scene, case.law, t_end=0.3 * case.t_end, methods=methods, repeats=1)
    assert min(row.velocity_error for row in found.rows if row.method == "located") < 1e-12
    assert ("dop853" in {row.method for row in found.rows}) is not case.scene.heated


@pytest.mark.rotating
@EACH
@pytest.mark.parametrize("engine", ["edmd", "md"])
def test_a_recording_holds_the_whole_run(name, options, engine, granular, tmp_path):
    flags = " ".join(f"--{key.replace('_', '-')} {value}" for key, value in options.items())
    code, _, errors = granular(f"run {name} {flags} --engine {engine} --samples 9 --save run.npz")
    assert (code, errors) == (0, "")
    assert granular("view run.npz --output run.html")[0] == 0
    assert (tmp_path / "run.html").stat().st_size > 10_000


@pytest.mark.parametrize(("line", "sentence"), [
    ("run ring-gas --gravity 1", "unknown option --gravity"),
    ("run heated-gas --lower=-1", "`lower` must be a finite number above 0, got -1.0. It is k_B T in J"),
    ("run pendulum-cradle --moving 7", "`moving` must be an integer from 1 to 4, got 7"),
])
def test_bad_input_is_a_sentence(line, sentence, granular):
    code, _, errors = granular(line)
    assert code == 2
    assert sentence in errors


def test_a_run_without_an_end_is_refused():
    kinds = {"ring-gas": "on a ring", "heated-gas": "with a thermal wall", "pendulum-cradle": "of pendula"}
    for name, options in CASES:
        case = gr.cases.make(name, **options)
        with pytest.raises(ValueError, match=rf"`t_end` must be given, got None\. A run {kinds[name]} does not end by "
                                             r"itself\. Give t_end=, until= or max_events=\."):
            gr.md.simulate(case.scene, case.law)
        assert math.isfinite(gr.cases.make(name).t_end)

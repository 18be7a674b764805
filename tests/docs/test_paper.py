"""The paper: every reference point on its figure, and each claim decided by the program."""

import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular import adiabatic, theory

pytest.importorskip("xarray")
pytest.importorskip("matplotlib")
SCRIPTS = Path(__file__).parents[2] / "examples" / "paper"
sys.path.append(str(SCRIPTS))
forces, gap, sequence, setting, viscoelastic, viscoelastic_material = map(
    import_module, ("forces", "gap", "sequence", "setting", "viscoelastic", "viscoelastic_material"))
REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "paper_points.json").read_text(encoding="utf-8"))
END = gr.until.contact(pair=0, nth=2)


def cell(results, **parameters):
    """One cell of a sweep."""
    return gr.sweep("three-balls", {"gap": [parameters.pop("gap", 1e-4)]}, results, **parameters).isel(gap=0)


def parameters(inputs):
    """What the scene calls the inputs of a reference point."""
    names = {"gap": "dh", "height": "z1", "density": "rho", "gravity": "g", "stiffness": "k", "restitution": "eps_spec"}
    return {"radii": (inputs["R1"], inputs["R2"]), **{name: inputs[letter] for name, letter in names.items()}}


@pytest.mark.rotating
@pytest.mark.parametrize("point", REFERENCE["linear"], ids=lambda point: point["id"])
def test_every_reference_point(point):
    found = cell(("contacts", "v_rel", "eps_ratio"), **parameters(point["inputs"]))
    assert int(found["contacts"][1]) == point["n"]
    good = 1e-13 * max(1.0, point["condition"]) * abs(point["v10"])
    assert float(found["v_rel"][1]) == pytest.approx(point["vr"], rel=0.0, abs=good)
    eps = point["inputs"]["eps_spec"]
    assert float(found["eps_ratio"]) == pytest.approx(point["eps_ratio"], rel=0.0, abs=4e-13 / eps * max(1.0, good))


def test_figure_2_has_the_reference_forces():
    scene, samples = gr.scenes.three_balls(), REFERENCE["forces"]
    law = setting.dashpot_laws(scene, forces.RESTITUTION)
    start = gr.md.simulate(scene, law, until=END).of(0)["t_begin"][0]
    run = gr.md.simulate(scene, law, t_end=1.0, samples=start + np.array(samples["t"]))
    for pair, name in enumerate(("F01", "F12")):
        steep = np.gradient(samples[name], samples["t"]).max()
        assert run.force[:, pair] == pytest.approx(samples[name], rel=1e-10, abs=10 * steep * np.spacing(start))


@pytest.mark.rotating
@pytest.mark.parametrize("point", REFERENCE["viscoelastic"], ids=lambda point: point["id"])
def test_figures_7_and_8_have_the_reference_points(point):
    inputs = point["inputs"]
    universal = inputs["eps"] is not None
    law = (viscoelastic.laws(float(inputs["eps"])) if universal else viscoelastic_material.laws(float(inputs["A"])))
    run = gr.md.simulate(viscoelastic.LIGHT_SCENE, law, until=END)
    assert run.count(1) == point["n"]
    touches, _ = setting.contacts(viscoelastic.LIGHT_SCENE, law)
    assert touches == pytest.approx(np.array(point["contacts"]), rel=1e-9, abs=0.0)
    assert run.of(1)["v_out"][-1] == pytest.approx([point["v1"], point["v2"]], rel=0.0, abs=1e-10)


@pytest.mark.rotating
def test_dips_of_figure_5_go_below_its_axis_in_nature_and_are_drawn_so():
    def found(power):
        data = cell(("contacts", "eps_ratio"), gap=10.0**power, restitution=0.9)
        return int(data["contacts"][1]), float(data["eps_ratio"])

    low, high = -3.4, -3.3  # log10 of the gap in m
    assert (found(low)[0], found(high)[0]) == (2, 1)
    ratios = []
    for _ in range(20):
        middle = 0.5 * (low + high)
        count, ratio = found(middle)
        low, high = (middle, high) if count == 2 else (low, middle)
        ratios += [ratio] if count == 2 else []
    assert ratios[-1] == min(ratios) == pytest.approx(2.17e-4, rel=0.01)
    assert ratios[-1] < gap.AXIS_MINIMUM < 0.6 < found(high)[1]
    grid = np.geomspace(1e-7, 1e-1, 40)
    coarse = gap.compute(40)
    x, y = gap.curve_with_dips(grid, coarse["eps_ratio"], coarse["contacts"])
    added = x[y < gap.AXIS_MINIMUM]
    assert ((added > grid[0]) & (added < grid[-1])).all()
    assert (added[-1] < 10.0**high * (grid[1] / grid[0])) & (added[-1] > 10.0**low / (grid[1] / grid[0]))
    flat, _ = gap.curve_with_dips([1.0, 2.0, 3.0], [0.5, 0.5, 0.5], [2, 1, 1])
    assert flat.tolist() == [1.0, 2.0, 3.0]  # nothing jumps


@pytest.mark.rotating
def test_claim_contacts_and_spikes_over_restitution():
    grid = np.linspace(0.3, 1.0, 71)
    numerical = sequence.numerical_sequence(sequence.dashpot_contacts, grid)
    found, windows = numerical["numerical"], numerical["spikes"]
    assert len(found[-1]["contacts"]) == 3  # at ε = 1
    assert max(len(stretch["contacts"]) for stretch in found) == 7
    most = np.concatenate([stretch["parameter"] for stretch in found if len(stretch["contacts"]) == 7])
    assert [most[0], most[-1]] == pytest.approx([0.60426, 0.61245], abs=1e-5)
    for low, high, count in REFERENCE["spike_windows"]:
        near = min(windows, key=lambda window: abs(window[1] - high))
        assert near == [pytest.approx(low, abs=1e-6), pytest.approx(high, abs=1e-6), count]


@pytest.mark.rotating
def test_claim_one_maximum_of_contacts_over_restitution():
    base = gr.sweep("three-balls", {"restitution": np.linspace(0.1, 1.0, 181)}, "contacts")["contacts"].values[:, 1]
    turns = np.diff(base[np.append(True, np.diff(base) != 0)])
    assert (np.diff(np.sign(turns)) <= 0).all()  # true of the base case
    other = gr.sweep("three-balls", {"restitution": [0.642, 0.645, 0.648]}, "contacts", radii=(0.115, 0.01))
    assert other["contacts"].values[:, 1].tolist() == [8, 7, 8]  # refuted in general


def test_claim_more_contacts_with_growing_ratio():
    ratio = gr.sweep("three-balls", {"radii[0]": 0.01 * np.linspace(1.0, 20.0, 60)}, "contacts", restitution=0.8)
    assert (np.diff(ratio["contacts"].values[:, 1]) >= 0).all()
    assert ratio["contacts"].values[-1, 1] == 9


    dashed = gr.sweep("three-balls", {"radii[0]": [0.074, 0.08, 0.1, 0.15, 0.2]}, "contacts", restitution=0.5)
    assert dashed["contacts"].values[:, 1].tolist() == [5, 4, 4, 4, 4]  # refuted in general


def test_effective_restitution_over_the_gap():
    data = gr.sweep("three-balls", {"gap": [5e-6, 2e-4, 5e-2]}, ("contacts", "eps_ratio"), restitution=0.9)
    assert data["contacts"].values[:, 1].tolist() == [6, 2, 1]
    assert data["eps_ratio"].values == pytest.approx([0.003199, 0.351862, 1.000926], rel=0.0, abs=5e-7)


def test_claim_limit_at_large_gap_is_above_one():
    limit = float(cell("eps_ratio", gap=0.05, restitution=0.9)["eps_ratio"])
    assert limit == pytest.approx(1.0009257655540613, abs=1e-12)
    weightless = gr.scenes.three_balls(gap=0.05, gravity=0.0, height=0.1).replace(velocity=[0.0, -3.0, -3.0])
    run = gr.md.simulate(weightless, setting.dashpot_laws(weightless, 0.9), until=gr.until.separated())
    v_rel = np.diff(run.of(1)["v_out"][-1])[0]
    assert theory.effective_restitution(v_rel, 3.0) == pytest.approx(0.9, abs=1e-12)  # gravity is the reason


def test_claim_peak_over_the_ratio_of_radii():
    ratio = np.linspace(1.39, 1.396, 61)
    data = gr.sweep("three-balls", {"radii[0]": 0.01 * ratio}, "eps_ratio", restitution=0.8)["eps_ratio"].values
    assert ratio[data.argmax()] == pytest.approx(1.39323, abs=1e-4)
    assert data.max() == pytest.approx(1.0023030, abs=1e-7)


@pytest.mark.rotating
@pytest.mark.parametrize(("ratio", "within"), [(10.0, 5e-3), (5.0, 1.5e-2)])
def test_claim_adiabatic_solution_agrees(ratio, within):
    scene, worst, differing = gr.scenes.three_balls(radii=(0.01 * ratio, 0.01)), 0.0, 0
    for eps in np.linspace(0.3, 1.0, 29):
        law = setting.dashpot_laws(scene, float(eps))
        run, theirs = gr.md.simulate(scene, law, until=END), adiabatic.contacts(scene, law)
        differing += run.count(1) != theirs.count
        worst = max(worst, abs(run.of(1)["v_out"][-1][1] - theirs.v2) / abs(theirs.v10))
    assert worst < within
    assert differing == (0 if ratio == 10.0 else 1)


def test_adiabatic_solution_of_figure_2():
    scene = gr.scenes.three_balls()
    law = setting.dashpot_laws(scene, 0.7)
    run, theirs = gr.md.simulate(scene, law, until=END), adiabatic.contacts(scene, law)
    assert theirs.count == run.count(1) == 4
    assert theirs.v2 == pytest.approx(run.of(1)["v_out"][-1][1], rel=0.0, abs=1e-3 * abs(theirs.v10))


def test_independent_collisions_give_one_form_of_v_rel():
    for mass_ratio, gap, gravity in ((0.0, 1e-4, 9.81), (0.3, 1e-2, 1.0), (2.0, 0.0, 20.0)):
        drop = theory.two_ball_drop(mass_ratio, 0.7, 0.5, gap, gravity)
        assert drop.v_rel_after == pytest.approx(0.7 * 1.7 * abs(drop.v10), rel=1e-15)
        assert theory.effective_restitution(drop.v_rel_after, abs(drop.v10)) == pytest.approx(0.7, rel=1e-15)


def test_stacks_follow_the_closed_formula_only_with_gaps():
    wide, touching = (gr.scenes.ball_stack(3, 1.0 / 3.0, speed=3.0, gap=gap, gravity=0.0) for gap in (1e-2, 1e-6))
    formula = 3.0 * theory.stack_velocities(wide.mass[1:], 1.0)[-1]
    for scene, right in ((wide, True), (touching, False)):
        law = setting.dashpot_laws(scene, 1.0)
        top = gr.md.simulate(scene, law, until=gr.until.separated()).velocity[-1][-1]
        assert (abs(top / formula - 1.0) < 1e-9) == right
        assert right or top < 0.8 * formula


@pytest.mark.parametrize(("ratio", "eps", "holds"), [(0.05, 1.0, True), (0.3, 0.5, True), (0.9, 0.9, True),
                                                     (1.0, 0.9, False)])
def test_hard_stacks_follow_the_closed_formula_where_each_ball_is_lighter(ratio, eps, holds):
    stack = gr.scenes.ball_stack(5, ratio, speed=1.0, gap=1e-9, gravity=0.0)
    run = gr.edmd.simulate(stack, gr.ConstantRestitution(eps), until=gr.until.separated())
    off = abs(run.velocity[-1, -1] - theory.stack_velocities(stack.mass[1:], eps)[-1])
    assert off < 1e-12 if holds else off > 0.06


@pytest.mark.rotating
@pytest.mark.parametrize("name", sorted(path.stem for path in SCRIPTS.glob("*.py") if path.stem != "setting"))
def test_every_script_draws_its_figure_and_writes_its_numbers(name, tmp_path, monkeypatch):
    few = {"sketch": 1, "forces": 100, "sequence": 2, "viscoelastic": 2, "viscoelastic_material": 1, "breakdown": 3,
           "predictors": 1, "validity": 6, "counts": 6}.get(name, 9)
    script, picture, numbers = import_module(name), tmp_path / "x.png", tmp_path / "x.json"
    monkeypatch.setattr(sys, "argv", [name, "-o", str(picture), "--json", str(numbers), "--points", str(few)])
    setting.main(script.compute, script.draw, 1)
    assert picture.read_bytes()[:4] == b"\x89PNG"
    found = json.loads(numbers.read_text(encoding="utf-8"))
    assert found.pop("granular") == gr.__version__
    stored = SCRIPTS.parents[1] / "docs" / "figures" / "data" / f"paper-{name.replace('_', '-')}.json"
    assert found.keys() == json.loads(stored.read_text(encoding="utf-8")).keys()


@pytest.mark.rotating
def test_a_script_is_run_by_its_path(tmp_path):
    run = [sys.executable, str(SCRIPTS / "sketch.py"), "-o", "x.png"]
    assert subprocess.run(run, cwd=tmp_path, capture_output=True, check=False).returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["x.png"]

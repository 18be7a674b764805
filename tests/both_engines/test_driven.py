"""Driven scenes: sweeps by name, what a saved path allows, frontier and threshold (all fronts: test_fronts)."""

import math

import pytest

import granular as gr
from bench.reference import solve
from granular.laws.kinds import checked
from granular.scene.walls import Motion, Sine
from granular.studies import frontier_methods as methods
from granular.studies.frontier_methods import Task, scipy_method

pytest.importorskip("xarray")


def test_a_sweep_by_name_varies_a_plate():
    plate = {"type": "Sine", "gamma": 2.0, "frequency": 50.0}
    data = gr.sweep("bouncing-ball", {"plate.gamma": [0.5, 2.0]}, "hard_v_final", plate=plate, height=0.01, t_end=0.2)
    for gamma, found in zip((0.5, 2.0), data["hard_v_final"].values, strict=True):
        case = gr.cases.make("bouncing-ball", plate=plate | {"gamma": gamma}, height=0.01, t_end=0.2)
        assert found.tolist() == case.simulate("edmd").velocity[-1].tolist()


@pytest.mark.parametrize("engine", [gr.edmd, gr.md])
def test_a_saved_run_goes_on_as_far_as_its_path_was_kept(engine, tmp_path):
    scene = gr.scenes.bouncing_ball(0.01, plate=Motion(lambda t: 1e-3 * math.sin(200.0 * t)))
    touch = gr.ConstantRestitution(0.7) if engine is gr.edmd else gr.LinearDashpot(1e5, 5.0)
    part = engine.simulate(scene, touch, t_end=0.15)
    part.save(tmp_path / "part.npz")
    loaded = gr.Trajectory.load(tmp_path / "part.npz")
    assert loaded.scene == part.scene
    assert loaded.account()["work"].tolist() == part.account()["work"].tolist()
    with pytest.raises(ValueError, match=r"`t_end` must be a number in \[0, 0\.15\], got 0\.3\. The path of the "
                                         r"wall covers only this interval\."):
        engine.resume(loaded, t_end=0.3)


def test_from_which_shaking_on():
    scene = gr.scenes.bouncing_ball(0.01, plate=Sine(1e-5, 50.0))
    case = gr.Case(scene, gr.LinearDashpot(1e5, 5.0), t_end=0.1)
    found = gr.threshold(case, "floor.amplitude", (1e-6, 1e-3), "error", points=3, within=0.5)
    assert found.units == "m"
    for value in found.values:
        shaken = scene.replace(floor=Sine(value.value, 50.0))
        assert value.measure == gr.compare(shaken, case.law, t_end=0.1).error
        assert value.verdict == ("holds" if value.measure <= 0.01 else "fails")


@pytest.mark.rotating
def test_up_to_which_shaking_contacts_are_isolated():
    column = gr.scenes.vibrated_column(2, gamma=1.0, frequency=30.0)
    case = gr.Case(column, gr.LinearDashpot.from_restitution(0.7, k=1e4, pair=column.pairs[0]), t_end=0.5)
    found = gr.threshold(case, "floor.amplitude", (1e-4, 1e-2), points=4, within=0.3)
    for value in found.values:
        run = gr.md.simulate(column.replace(floor=Sine(value.value, 30.0, column.floor.phase)), case.law, t_end=0.5)
        assert value.verdict == ("holds" if run.stats["isolated"] == run.stats["contacts"] else "fails")


def test_error_against_run_time_of_a_driven_scene(monkeypatch):
    monkeypatch.setattr(methods, "_engine", lambda task, name: "plain")  # errors are asked for, not times
    scene = gr.scenes.bouncing_ball(0.005, plate=Sine.from_acceleration(2.0, 50.0, phase=1.0))
    law = gr.LinearDashpot.from_restitution(0.6, k=1e3, pair=scene.pairs[0])
    report = gr.frontier(scene, law, t_end=0.1, methods=("located", "edmd"), repeats=1)
    located, hard = (report.of(name)[0] for name in ("located", "edmd"))
    assert located.velocity_error < 1e-11
    assert 1e-3 < hard.velocity_error < 1.0


@pytest.mark.rotating
@pytest.mark.parametrize("name", ["dop853", "dop853+events"])
def test_scipy_s_answers_beside_a_driven_wall(name):
    pytest.importorskip("mpmath")
    scene = gr.scenes.bouncing_ball(0.005, plate=Sine.from_acceleration(2.0, 50.0, phase=1.0))
    law = gr.LinearDashpot.from_restitution(0.6, k=1e3, pair=scene.pairs[0])
    truth = solve(scene, law, t_end=0.2)
    laws = checked(law, scene).given
    found = scipy_method(Task(scene, laws, None, 0.2, truth), name).run(1e-10).contacts()
    assert len(found) == len(truth.contacts) >= 2
    for one, other in zip(found, truth.contacts, strict=True):
        assert float(one.t_begin) == pytest.approx(float(other.t_begin), abs=1e-7)
        assert [float(v) for v in one.v_in] == pytest.approx([float(v) for v in other.v_in], abs=1e-5)

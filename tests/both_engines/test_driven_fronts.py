"""Driven walls and forces in files, by name, in the command, in sweeps: one scene, whoever says it."""

import json
import math
import pickle

import numpy as np
import pytest

import granular as gr
from granular import cases
from granular._engine.describe import from_json, scene_to_json
from granular.cases import ready
from granular.run.trajectory import CONTACT, Status, Trajectory
from granular.scene.places import with_fitted_walls
from granular.scene.walls import Motion, Piecewise, Sine
from granular.studies.sweeps.plan import make_plan
from tests.helpers import scenes_at_random
from tests.helpers.driven_fronts import INF, LAW, RULE, TEXT, scene, shake


def at_random(seed):
    """A random scene with driven walls, forces, or both; functions have a name."""
    rng = np.random.default_rng(seed)
    one = scenes_at_random.driven(rng, scenes_at_random.scene(rng, walls=(0.9, 0.5, 0.3)))
    named = [Motion(shake, motion.accuracy) if isinstance(motion, Motion) else motion for motion in one.motions]
    return one.replace(floor=named[0], ceiling=named[1])


def trajectory(of, **more):
    """A run of two rows in which nothing happens."""
    rows = {name: np.zeros((2, n)) for name, n in (("position", of.n), ("velocity", of.n), ("gap", of.n_pairs))}
    rule = (gr.ConstantRestitution(1.0),) * of.n_pairs
    return Trajectory(of, None, rule, np.array([0.0, 1.0]), **rows, force=None, contacts=np.zeros(0, CONTACT),
                      status=Status.time, message="", **more)


# --- one scene, whoever keeps it ----------------------------------------------------------------------------------

@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(40))
def test_a_scene_comes_back_from_every_file(seed, tmp_path):
    one = at_random(seed)
    assert cases.loads(cases.dumps(gr.Case(one, LAW))).scene.replace(floor=one.floor, ceiling=one.ceiling) == one
    copy = pickle.loads(pickle.dumps(one))
    assert copy == one
    assert hash(copy) == hash(one)
    assert one.replace() == one
    as_json = json.loads(json.dumps(scene_to_json(one)))
    if any(isinstance(motion, Motion) for motion in one.motions):
        with pytest.raises(LookupError, match="shake"):
            [from_json("wall", as_json[side]) for side in ("floor", "ceiling") if as_json[side]]
    else:
        assert cases.loads(cases.dumps(gr.Case(one, LAW))).scene == one
        walls = {side: as_json[side] and from_json("wall", as_json[side]) for side in ("floor", "ceiling")}
        assert gr.Scene(**as_json | walls) == one
    ledger = np.arange(10.0).reshape(2, 5)
    trajectory(one, ledger=ledger).save(tmp_path / "run.npz")
    loaded = Trajectory.load(tmp_path / "run.npz")
    assert loaded.scene == with_fitted_walls(one, 0.0, 1.0)
    assert loaded.ledger.tolist() == ledger.tolist()
    assert loaded.account()["work"].tolist() == ledger[:, :2].tolist()


def test_a_function_by_its_name_is_the_same_motion():
    one = scene(floor=Motion(shake))
    read = cases.loads(cases.dumps(gr.Case(one, LAW))).scene
    assert with_fitted_walls(read, 0.0, 1.0) == with_fitted_walls(one, 0.0, 1.0)
    assert cases.loads(cases.dumps(gr.Case(read, LAW))).scene == read == pickle.loads(pickle.dumps(read))


def test_a_function_in_a_file_beside_the_case(tmp_path):
    (tmp_path / "motion.py").write_text("def shake(t):\n    return 0.5 * t * t\n", encoding="utf-8")
    (tmp_path / "case.toml").write_text(
        TEXT.format('floor = { type = "Motion", function = "motion.py:shake" }'), encoding="utf-8")
    case = cases.load(tmp_path / "case.toml")
    assert case.scene.floor.displacement(2.0) == 2.0
    assert repr(case.scene.floor) == "Motion(motion.py:shake)"
    plan = make_plan(tmp_path / "case.toml", {"gravity": np.array([1.0])}, ("contacts",), {}, {})
    assert pickle.loads(pickle.dumps(plan)).case((1.0,)).scene == case.scene.replace(gravity=1.0)


def test_what_a_motion_of_ones_own_raises_passes_through():
    for run in (lambda one: gr.md.simulate(one, LAW, t_end=1.0), lambda one: gr.edmd.simulate(one, RULE, t_end=1.0),
                lambda one: gr.md.simulate(one, LAW, t_end=1.0, dt=1e-3)):
        with pytest.raises(ZeroDivisionError, match=r"^float division by zero$"):
            run(scene(floor=Motion(lambda t: 1.0 / (t - t))))


@pytest.mark.parametrize(("text", "said"), [
    ("def shake(t):\n    return 1.0 / (t - t)\n", "ZeroDivisionError: float division by zero"),
    ("def shake(t):\n    return LOST\n", "NameError: name 'LOST'"),
    ("shake = {1.0: 2.0}.__getitem__\n", "KeyError: 6."), ("1 / 0\n", "ZeroDivisionError: division by zero"),
    ("def shake(t)\n", "SyntaxError: expected ':'"),
])
@pytest.mark.parametrize("verb", ["run", "compare", "sweep --over gravity=1,2"])
def test_the_command_names_a_motion_of_ones_own_and_its_error(text, said, verb, granular, tmp_path):
    (tmp_path / "motion.py").write_text(text, encoding="utf-8")
    wall = 'floor = { type = "Motion", function = "motion.py:shake" }'
    (tmp_path / "case.toml").write_text(TEXT.format(wall), encoding="utf-8")
    word, _, options = verb.partition(" ")
    code, _, error = granular(f"{word} case.toml {options}")
    assert code == 2
    told, _, error = error.partition("\n")  # what Python it runs, before it runs it
    assert "motion.py" in told
    assert error.startswith(f"granular: The function motion.py:shake raised {said}")
    assert error.count("\n") == 1


@pytest.mark.parametrize("start", [0.0, 0.5, -3e5])
def test_a_run_of_no_length_beside_a_motion(start):
    one = scene(floor=Motion(lambda t: 1e-3 * math.sin(3.0 * t)))
    speed = 3e-3 * math.cos(3.0 * start)
    hard = gr.edmd.simulate(one, RULE, t_start=start, t_end=start)
    for run in (hard, gr.md.simulate(one, LAW, t_start=start, t_end=start),
                gr.md.simulate(one, LAW, t_start=start, t_end=start, dt=1e-4)):
        assert run.status is gr.Status.time
        assert run.time[-1] == start
        assert run.velocity[-1, 0] == pytest.approx(speed, rel=1e-6)
        assert (run.gap[-1] == one.gap).all()


def test_numbers_of_walls_and_forces_tell_scenes_apart():
    one = scene(floor=Sine(1e-3, 50.0), external_force=[0.0, 1.0, 0.0])
    others = [scene(floor=Sine(1e-3, 50.0)), scene(external_force=[0.0, 1.0, 0.0]),
              scene(floor=Sine(1e-3, 51.0), external_force=[0.0, 1.0, 0.0]),
              scene(floor=Sine(1e-3, 50.0), external_force=[0.0, 1.0, 1.0])]
    assert one == scene(floor=Sine(1e-3, 50.0), external_force=[0, 1, 0])
    assert len({one, *others}) == 5
    assert scene(external_force=[0.0, 0.0, -0.0]) == scene()
    line = {"breaks": [0.0, 1.0], "coefficients": [[1.0], [0.0]]}
    assert Piecewise(**line) == Piecewise([-0.0, 1.0], [[1.0], [-0.0]])
    assert hash(Piecewise(**line)) == hash(Piecewise([-0.0, 1.0], [[1.0], [-0.0]]))
    assert str(scene(floor=Piecewise(**line), external_force=[0, 1, 0])) == (
        "Scene(2 balls, floor, g = 9.81 m/s², forces, floor Piecewise(1 piece, 0 … 1 s))")


def test_positions_in_place_of_gaps_take_walls_and_forces():
    more = {"floor": Sine(1e-3, 50.0), "external_force": [0.0, 1.0, 0.0]}
    one = gr.Scene.from_positions([INF, 1.0], [0.0, 0.25], [0.0, 0.5], [0.0, 0.0], 9.81, floor=more["floor"])
    assert one == gr.Scene([INF, 1.0], [0.0, 0.25], [0.25], [0.0, 0.0], 9.81, floor=more["floor"])
    text = 'external_force = [0.0, 1.0, 0.0]\nfloor = { type = "Sine", amplitude = 1e-3, frequency = 50.0 }'
    assert cases.loads(TEXT.format(text)).scene == scene(**more)
    assert cases.loads(TEXT.format(text).replace("gap = [0.1, 0.2]", "position = [0.0, 0.2, 0.6]")).scene.motions == (
        more["floor"], None)


def test_work_that_nobody_counted_is_unknown():
    account = trajectory(scene(floor=Sine(1e-3, 50.0))).account()
    assert np.isnan(account["work"][:, 0]).all()
    assert np.isnan(account["dissipated"]).all()
    assert not np.isnan(account["energy"]).any()
    assert not trajectory(scene()).account()["work"].any()


# --- by name, in tables, and varied -------------------------------------------------------------------------------

def test_scenes_of_a_shaken_plate():
    column = gr.scenes.vibrated_column(4, gamma=2.0, frequency=30.0, gravity=10.0)
    assert column.floor == Sine.from_acceleration(2.0, 30.0, 10.0, 0.5 * math.pi)
    assert column.floor.velocity(0.0) == pytest.approx(0.0, abs=1e-15)  # no jolt
    assert (column.radius[1:] == 0.005).all()
    assert gr.scenes.vibrated_column(amplitude=1e-3).floor.amplitude == 1e-3
    plate, plain = Sine(1e-3, 50.0), gr.scenes.bouncing_ball()
    assert gr.scenes.bouncing_ball(1.0, plate=plate) == plain.replace(floor=plate)
    assert gr.scenes.bouncing_ball(plate=plate) == plain.replace(floor=plate, gap=[0.0])
    assert plain.gap[0] == 1.0
    assert cases.make("vibrated-column", frequency=25.0).t_end == pytest.approx(20 / 25.0)
    plate = {"type": "Sine", "gamma": 2.0, "frequency": 50.0}
    case = cases.make("bouncing-ball", plate=plate)
    assert case.scene.floor == Sine.from_acceleration(2.0, 50.0)
    assert case.t_end == 1.0
    assert cases.make("bouncing-ball", plate=Piecewise([0.0, 3.0], [[0.0]])).t_end == 3.0
    assert cases.make("bouncing-ball", plate=Motion(shake)).t_end is None


def test_an_impact_on_a_wall_is_at_most_as_fast_as_both():
    case = cases.make("bouncing-ball", plate=Sine(1e-2, 50.0), height=1.0, law="ViscoelasticHertz", restitution=0.8)
    fall, wall = math.sqrt(2.0 * 9.81), 2.0 * math.pi * 50.0 * 1e-2
    assert ready.first_impact_speed(case.scene) == pytest.approx(fall + wall, rel=0.2)
    assert gr.scene.speed_scale(case.scene) == pytest.approx(fall + wall, rel=1e-3)


WALL = 'floor = { type = "Sine", amplitude = 1e-3, frequency = 50.0 }\nexternal_force = [0.0, 1.0, -2.0]'
VARIED = [("floor.amplitude", 2e-3, {"floor": Sine(2e-3, 50.0)}),
          ("floor.phase", 1.0, {"floor": Sine(1e-3, 50.0, 1.0)}),
          ("scene.floor.frequency", 7.0, {"floor": Sine(1e-3, 7.0)}),
          ("external_force[1]", 3.0, {"external_force": [0.0, 3.0, -2.0]})]


@pytest.mark.parametrize(("name", "value", "changed"), VARIED)
def test_numbers_of_walls_and_forces_are_parameters(name, value, changed, tmp_path):
    (tmp_path / "case.toml").write_text(TEXT.format(WALL), encoding="utf-8")
    case = cases.load(tmp_path / "case.toml")
    for subject in (case, tmp_path / "case.toml"):
        plan = make_plan(subject, {name: np.array([value])}, ("contacts",), {}, {})
        assert plan.case((value,)).scene == case.scene.replace(**changed)
    assert make_plan(gr.Case(scene(), LAW), {"external_force[2]": np.array([1.0])}, ("contacts",), {}, {}).case(
        (1.0,)).scene == scene(external_force=[0.0, 0.0, 1.0])


def test_a_plate_by_name_is_varied_too():
    fixed = {"plate": {"type": "Sine", "amplitude": 1.0, "frequency": 50.0}}
    plan = make_plan("bouncing-ball", {"plate.amplitude": np.array([1e-3])}, ("contacts",), fixed, {})
    assert plan.case((1e-3,)).scene == gr.scenes.bouncing_ball(plate=Sine(1e-3, 50.0))
    assert plan.subject.attributes("plate.amplitude")["units"] == "m"
    assert plan.subject.attributes("plate.frequency")["units"] == "Hz"

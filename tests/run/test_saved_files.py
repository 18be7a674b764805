"""A file of a saved run brings back that run, or is refused in one sentence."""

import dataclasses
import json
import math
import os

import numpy as np
import pytest

import granular as gr
from granular._engine import describe
from granular.app.cli import main
from granular.app.page import assemble, player_page
from granular.edmd import wall_state
from tests.helpers import saved_scenes
from tests.helpers.rewritten_files import ENGINE, rewritten
from tests.helpers.saved_scenes import ALL


@pytest.mark.rotating
@pytest.mark.exact
@pytest.mark.parametrize(("kind", "name"), ALL)
def test_runs_of_every_kind_come_back_and_go_on_as_if_nothing_had_been(kind, name, older, files):
    """To the bit those of today; those of another machine to what its last digits were."""
    engine, scene, _, _, end, _ = saved_scenes.of(kind, name)
    whole = saved_scenes.whole(kind, name, **ENGINE[kind])
    for file in (older / f"run_{kind}_{name}.npz", files / f"{kind}_{name}.npz"):
        back = gr.Trajectory.load(file, **saved_scenes.given(kind, name))
        if file.parent == older and not isinstance(back.scene.floor, gr.walls.Panels):
            assert scene.replace(mass=back.scene.mass) == back.scene
            np.testing.assert_allclose(back.scene.mass, scene.mass, rtol=1e-15)  # by another machine's power
        else:
            assert back.scene == scene or isinstance(back.scene.floor, gr.walls.Panels)
        onward = engine.resume(back, t_end=end, **ENGINE[kind])
        assert onward.status is whole.status
        for one, other in ((onward.gap, whole.gap), (onward.velocity, whole.velocity)):
            np.testing.assert_allclose(one[-1], other[-1], rtol=1e-9, atol=1e-9 * abs(other[-1]).max())
            assert file.parent == older or one[-1].tobytes() == other[-1].tobytes()
        assert file.parent == older or onward.message == whole.message


def test_the_table_holds_all_that_is_public_and_nothing_that_is_a_function(files):
    public = [getattr(module, name) for module in (gr, gr.walls) for name in module.__all__]
    names = ["force", "__call__", "panels", "drawn"]
    physics = [one for one in public if dataclasses.is_dataclass(one) and any(map(vars(one).__contains__, names))]
    places = {f"{one.__module__}:{one.__qualname__}" for one in physics if one is not gr.walls.Motion}
    assert places | {"granular.md.binary:LawRestitution"} == describe.CLASS_WORDS.keys()
    moved = gr.Trajectory.load(files / "soft_motion.npz").scene.floor
    assert isinstance(moved, gr.walls.Panels)
    assert moved.displacement(0.1) == pytest.approx(saved_scenes.MOTION.displacement(0.1), rel=1e-13)


def test_a_toml_file_that_names_python_says_so_before_it_runs(tmp_path, capsys):
    (tmp_path / "mine.py").write_text("import sys\nprint('runs', file=sys.stderr)\ndef still(t):\n    return 0.0 * t\n")
    case = tmp_path / "case.toml"
    case.write_text("""[scene]
mass = [inf, 1.0]
radius = [0.0, 0.1]
gap = [0.1]
velocity = [0.0, 0.0]
gravity = 9.81
floor = { type = "Motion", function = "mine.py:still" }
[rule]
type = "ConstantRestitution"
restitution = 0.9
[run]
t_end = 0.2
""")
    assert main(["run", str(case), "--engine", "edmd"]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said[0] == f"granular: {str(case)!r} names Python code: running {str(tmp_path / 'mine.py')!r}"
    assert said[1] == "runs"
    gr.cases.load(case)
    assert capsys.readouterr().err.splitlines()[-1] == "runs"


def test_a_hard_run_of_balls_that_overlap_is_not_gone_on_with(files):
    run = gr.Trajectory.load(files / "hard_floor.npz")
    scene = run.scene.replace(gap=[-1.0, 0.2])
    with pytest.raises(ValueError, match=r"`gap\[0\]` must be non-negative, got -1\.0\. Hard spheres cannot "
                                         r"overlap\. Set the gap to 0, or use granular\.md\."):
        gr.edmd.resume(dataclasses.replace(run, scene=scene), t_end=1.0)


OLDER = {"noise", *wall_state.BALANCE_FIELDS}
"""What files of some release lack."""
HARD_NAMES = [name for name in saved_scenes.cut("hard", "sine").state if name not in OLDER]


@pytest.mark.rotating
@pytest.mark.parametrize("name", HARD_NAMES)
def test_a_hard_state_without_a_part_or_with_a_wrong_one_is_not_gone_on_from(name, files):
    run = gr.Trajectory.load(files / "hard_sine.npz")
    lacking = {key: value for key, value in run.state.items() if key != name}
    for state in (lacking, lacking | {name: "x"}, lacking | {name: np.zeros((3, 3))}, lacking | {name: math.nan}):
        with pytest.raises(ValueError, match=f"'{name}' in the state of `trajectory` must be|must be a run of hard "
                                             "spheres"):
            gr.edmd.resume(dataclasses.replace(run, state=state), t_end=1.0)


@pytest.mark.rotating
@pytest.mark.parametrize(("field", "value"), [
    ("pairs.slot", 99), ("pairs.slot", -5), ("pairs.first", 7), ("pairs.hi", 9), ("pairs.kind_of", 5), ("pairs.map", 9),
    ("pairs.wall", 3), ("pairs.mode", 9), ("pool.number", 8), ("pool.fired", 99), ("pool.head", 50), ("pool.manner", 9),
    ("pool.clock", 0), ("pool.k", 1.0), ("maps.table", 5), ("run.members", 50), ("run.wanted", 9),
    ("run.solo", 9), ("run.rows", 9), ("run.tables", 9), ("run.t", math.nan), ("bodies.inverse_mass", 3.0),
    ("bodies.v", math.inf), ("pool.xi", math.nan), ("pool.e", 1e6), ("pool.x", 1.0),
])
def test_a_soft_state_whose_places_are_not_there_is_not_gone_on_from(field, value, files):
    run = gr.Trajectory.load(files / "soft_riding.npz")
    records, name = field.split(".")
    edited = run.state[records].copy()
    edited[name][run.state["pairs"]["slot"][0] if records == "pool" else -1] = value
    with pytest.raises(ValueError, match=r"state of `trajectory` (has numbers|belongs to another|must agree with its "
                                         "last)"):
        gr.md.resume(dataclasses.replace(run, state=dict(run.state) | {records: edited}), t_end=1.0, engine="plain")
    for state in ({key: x for key, x in run.state.items() if key != records}, dict(run.state) | {records: np.zeros(3)}):
        with pytest.raises(ValueError, match=rf"'{records}' in the state of `trajectory` must be .*, got (nothing|"
                                             "other records)"):
            gr.md.resume(dataclasses.replace(run, state=state), t_end=1.0, engine="plain")


def test_a_state_that_does_not_belong_to_the_last_row_or_the_laws_is_not_gone_on_from(files):
    run = gr.Trajectory.load(files / "hard_floor.npz")
    with pytest.raises(ValueError, match=r"The state of `trajectory` must agree with its last sample\. One of them "
                                         r"was changed after the run\."):
        gr.edmd.resume(dataclasses.replace(run, velocity=run.velocity * 1.001), t_end=1.0)
    soft = gr.Trajectory.load(files / "soft_contact.npz", law=saved_scenes.LOOSE)
    with pytest.raises(ValueError, match=r"The state of `trajectory` belongs to another scene or other laws\. The "
                                         r"file was edited after it was saved, or loaded with other laws\."):
        gr.md.resume(soft, t_end=1.0, engine="plain")


def test_texts_of_a_file_reach_terminal_and_page_without_control_characters(files, tmp_path):
    text = "\x1b[31mred\x9b2J\u202eevil\nline\x00</script><!--<script>" + "x" * 1000
    back = gr.Trajectory.load(rewritten(files, tmp_path, message=text))
    assert back.message.startswith(" [31mred 2J evil line </script>")
    assert back.message.isprintable()
    assert len(back.message) == 500
    own = {"class": "thing:Own", "shown": text}
    with pytest.raises(ValueError, match=r"the rule in the file is your own, .*evil line .*, which is not stored\. "
                                         r"Pass load\(path, rule=\.\.\.\)\.") as caught:
        gr.Trajectory.load(rewritten(files, tmp_path, rule=own))
    assert str(caught.value).isprintable()
    player_page(tmp_path / "page.html", [back], [text], "<b>\x1b")
    data = (tmp_path / "page.html").read_text().split('id="data">')[1].split("</script>")[0]
    assert "<" not in data
    assert json.loads(data)["runs"][0]["message"] == back.message
    assert json.loads(assemble.embedded({"name": "</script><b>"})) == {"name": "</script><b>"}


@pytest.mark.parametrize("path", [5, None, 1.5])
def test_a_number_is_no_file(path):
    with pytest.raises(TypeError, match=r"`path` must be the name of a file, got .*"):
        gr.Trajectory.load(path)


def test_a_device_is_no_file(tmp_path):
    link = tmp_path / "run.npz"
    if not os.path.exists("/dev/zero"):
        pytest.skip("this system has no such device")
    link.symlink_to("/dev/zero")
    for path in ("/dev/zero", link):
        with pytest.raises(ValueError, match=r"`path` must be a regular file, got '.*\. A device or a pipe "
                                             r"cannot be read here\."):
            gr.Trajectory.load(path)


@pytest.mark.parametrize("walls", [{"floor": gr.walls.Sine(1e-3, 5.0)}, {"ceiling": gr.walls.Thermal(1.0, 3)}])
def test_laws_with_memory_go_on_beside_walls_whose_account_nobody_can_close(walls, tmp_path):
    scene = gr.Scene([math.inf, 1.0, math.inf], [0.0, 0.05, 0.0], [0.05, 0.05], [0.0, -1.0, 0.0], **walls)
    law = gr.WaltonBraun(1e5, 2e5)
    run, whole = (gr.md.simulate(scene, law, t_end=t, engine="plain") for t in (0.2, 0.5))
    run.save(tmp_path / "run.npz")
    for back in (run, gr.Trajectory.load(tmp_path / "run.npz")):
        assert len(run.contacts) > 0
        onward = gr.md.resume(back, t_end=0.5, engine="plain")
        assert onward.velocity[-1].tobytes() == whole.velocity[-1].tobytes()

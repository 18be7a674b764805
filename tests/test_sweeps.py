"""Sweeps: the compiled way and one by one give the same bits, on any executor, in one go or resumed."""

import json
import math
import re
import threading
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.cases import Case, make
from granular.md.located import many as located
from granular.sweeps import axis, schedule
from granular.sweeps.results import CODE, RESULTS

xr = pytest.importorskip("xarray")
REFERENCE = json.loads((Path(__file__).parent / "reference" / "paper_points.json").read_text(encoding="utf-8"))
ONE_BY_ONE = {"engine": "plain"}
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


@pytest.mark.parametrize(("scene", "over", "fixed"), [
    ("three-balls", ["restitution=0.005:1:4", "gap=1e-7:1e-2:3:log"], {}),
    ("three-balls", ["radii[0]=0.009:0.2:6:log"], {"restitution": 0.8}),  # the first are ongoing at the end
    ("three-balls", ["law=LinearDashpot,TsujiHertz,ViscoelasticHertz,WaltonBraun", "restitution=0.5,1"], {}),
    ("ball-stack", ["n=2,4", "gap=0,1e-3"], {}),
    ("newtons-cradle", ["gap=0,1e-6,1e-3"], {}),
    ("gas", ["seed=1,2"], {"n": 8, "walls": False, "length": 8.0}),
    ("bouncing-ball", ["t_end=0.1,2,20"], {}),
])
@pytest.mark.usefixtures("interpreted")
def test_compiled_is_one_by_one_bit_for_bit(scene, over, fixed, monkeypatch):
    monkeypatch.setattr(schedule, "in_memory", lambda kernel: True)
    fast = gr.sweep(scene, over, sorted(FAST), **fixed)
    slow = gr.sweep(scene, over, sorted(FAST), run=ONE_BY_ONE, **fixed)
    for name in fast:
        assert np.array_equal(fast[name].values, slow[name].values, equal_nan=True), name
    assert fast["contacts"].values.max() >= 1


@pytest.mark.parametrize("making", [1e-3, 10.0])
def test_cells_do_not_wait_for_a_compiler_unless_they_take_longer(making, monkeypatch):
    """After 16 cells the others are compiled if one by one they would take longer than making the machine code."""
    solved, known = [], located.solve_many
    monkeypatch.setattr(schedule, "LOADING", making)
    monkeypatch.setattr(schedule, "MAKING", making)
    monkeypatch.setattr(schedule, "in_memory", lambda kernel: False)
    monkeypatch.setattr(located, "solve_many", lambda many, **end: solved.append(len(many.gap)) or known(many, **end))
    data = gr.sweep("three-balls", ["gap=1e-7:1e-2:40:log"], "contacts")
    assert sum(solved) == (24 if making < 1.0 else 0)
    assert (data["status"].values >= 0).all()


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


@pytest.mark.thirds
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


@pytest.mark.usefixtures("interpreted")
def test_failing_cells_carry_their_status():
    data = gr.sweep("three-balls", {"height": [0.05, 0.6]}, ("contacts", "hard_status"))
    assert data["status"].values.tolist() == [CODE["misuse"], CODE["until"]]
    assert data["contacts"].values.tolist() == [[-1, -1], [1, 4]]
    assert data.attrs["refusal"].startswith("height is 0.05")
    heavy = gr.sweep("three-balls", "restitution=0.005,0.7", "contacts")
    assert heavy["status"].values.tolist() == [CODE["time"], CODE["until"]]  # it rests, and is followed to t_end


def test_cases_and_results_of_ones_own():
    data = gr.sweep(drop, {"restitution": [0.5, 1.0]}, ["contacts", energy_left], gap=1e-3)
    assert data["contacts"].values[:, 1].tolist() == [1, 1]
    assert data["energy_left"].values[0] < data["energy_left"].values[1] == pytest.approx(1.0, abs=1e-12)
    about = {"units": "", "long_name": "energy left", "comment": "Energy at the end over energy at the start."}
    assert data["energy_left"].attrs == about
    same = gr.sweep(drop, {"restitution": [0.5, 1.0]}, sorted(FAST), gap=1e-3)
    named = gr.sweep("three-balls", {"restitution": [0.5, 1.0]}, sorted(FAST), gap=1e-3)
    assert all(np.array_equal(same[name].values, named[name].values, equal_nan=True) for name in same)


def test_any_executor_gives_the_same_bits(monkeypatch):
    monkeypatch.setattr(schedule, "SHORTEST", 0.005)
    over = ["restitution=0.3:1:20", "gap=1e-7:1e-2:20:log"]
    here = gr.sweep("three-balls", over, sorted(FAST))
    with ProcessPoolExecutor(2) as pool:
        assert here.identical(gr.sweep("three-balls", over, sorted(FAST), executor=pool))


def test_an_interrupted_sweep_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(schedule, "LONGEST", 0.0)  # batches of one cell, whatever the machine's speed
    over, file = ["restitution=0.3:1:20", "gap=1e-6:1e-3:20:log"], tmp_path / "map.nc"
    seen = []

    def watch(reached, done):
        seen.append((reached, done))
        if done > 100 and len(seen) > 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gr.sweep("three-balls", over, save=file, on_progress=watch)
    stopped = xr.load_dataset(file)
    left = int((stopped["status"] == CODE["not_run"]).sum())
    assert 0 < left < 400
    again = []
    data = gr.sweep("three-balls", over, save=file, on_progress=lambda *so_far: again.append(so_far))
    assert again[0] == (pytest.approx(1.0 / left), 400 - left + 1)
    assert again[-1] == (1.0, 400)
    assert [reached for reached, _ in seen] == [done / 400 for _, done in seen]
    assert data.identical(gr.sweep("three-balls", over))
    stored = xr.load_dataset(file)
    assert all(np.array_equal(stored[name].values, data[name].values, equal_nan=True) for name in data)
    with pytest.raises(ValueError, match="holds another sweep"):
        gr.sweep("three-balls", over, save=file, height=0.7)


def test_a_sweep_of_the_release_before_goes_on_and_a_later_one_is_refused(tmp_path):
    file, over = tmp_path / "older.nc", {"gap": [1e-5, 1e-4], "restitution": [0.5, 0.9]}
    file.write_bytes((Path(__file__).parent / "reference" / "older_sweep.nc").read_bytes())
    solved = []
    data = gr.sweep("three-balls", over, save=file, on_progress=lambda *so_far: solved.append(so_far))
    assert not solved
    np.testing.assert_allclose(data["v_rel"], gr.sweep("three-balls", over)["v_rel"], rtol=1e-12)
    later = data.assign_attrs(provenance=json.dumps({"format": 99}))
    later.to_netcdf(file, engine="netcdf4")
    with pytest.raises(ValueError, match=r"format of .*older\.nc is 99"):
        gr.sweep("three-balls", over, save=file)


def test_a_map_whose_file_was_changed_is_refused_in_a_sentence(tmp_path):
    file, over = tmp_path / "map.nc", {"gap": [1e-5, 1e-4], "restitution": [0.5, 0.9]}
    data = gr.sweep("three-balls", over, save=file, results=["v_rel"]).load()
    for other, sentence in [
        (data.drop_vars("v_rel"), "it has no v_rel as a sweep of shape"),
        (data.assign(v_rel=data["v_rel"].astype(str)), "it has no v_rel"),
        (data.assign(v_rel=data["v_rel"].mean("restitution")), "it has no v_rel"),
        (data.assign(status=data["status"] + 50), "its status is none of not_run"),
        (data.assign_attrs(provenance="[["), r"format of .*map\.nc is None"),
        (data.assign_attrs(provenance="[1]"), r"format of .*map\.nc is None"),
    ]:
        other.to_netcdf(file, engine="netcdf4")
        with pytest.raises(ValueError, match=sentence):
            gr.sweep("three-balls", over, save=file, results=["v_rel"])
    with pytest.raises(TypeError, match="save is 5: the name of a file is needed"):
        gr.sweep("three-balls", over, save=5, results=["v_rel"])


def test_a_map_beside_a_driven_wall_of_the_release_before_goes_on(tmp_path):
    """Its question called the wall by the place of its class."""
    scene = gr.scenes.bouncing_ball(plate=gr.walls.Sine(1e-3, 20.0))
    case, file = gr.Case(scene, None, gr.ConstantRestitution(0.9), t_end=0.5), tmp_path / "map.nc"
    data = gr.sweep(case, {"velocity[1]": [0.0, 0.1]}, save=file, results=["hard_contacts"])
    assert '"sine"' in data.attrs["question"]
    older = data.attrs["question"].replace('"sine"', '"granular.walls.sine:Sine"')
    data.assign_attrs(question=older).to_netcdf(file, engine="netcdf4")
    solved = []
    gr.sweep(case, {"velocity[1]": [0.0, 0.1]}, save=file, results=["hard_contacts"],
             on_progress=lambda *so_far: solved.append(so_far))
    assert not solved


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
    ({"scene": "three-bals", "over": "gap=1,2"}, "did you mean three-balls"),
    ({"over": "gab=1,2"}, "'gab' is no parameter of three-balls; did you mean gap"),
    ({"over": "height[0]=1,2"}, "height is a single value"),
    ({"over": "radii[2]=1,2"}, "radii has 2 entries"),
    ({"over": "gap=1:2:0"}, "count of gap is 0"),
    ({"over": "gap=-1:2:3:log"}, "positive ends"),
    ({"over": "gap=1:2:3:lin"}, "only ':log' may follow"),
    ({"over": "gap"}, "name=first:last:count"),
    ({"over": "gap=1:2"}, "such as gap=0.5:1:101"),
    ({"over": "gap=1:2:1e9:log"}, "count of gap is 1000000000.0"),
    ({"over": ["gap=1e-4:1:20000", "height=0.5:1:20000"]}, "over has 4e+08 cells: at most 1e+08 fit"),
    ({"over": {}}, "over is empty"),
    ({"over": [gr.Hertz(1e5)]}, "over has Hertz(k=100000.0): a mapping of names to values"),
    ({"over": None}, "over has None: a mapping of names to values"),
    ({"over": {"gap": [1e-4, 1e-4]}}, "not all different"),
    ({"over": {"gap": [[1e-4]]}}, "a list of numbers or words is needed"),
    ({"over": ["gap=1,2", "gap=3,4"]}, "gap is given twice"),
    ({"over": "gap=1,2", "gap": 3.0}, "both varied and fixed"),
    ({"over": "gap=1,2", "results": "contact"}, "did you mean contacts"),
    ({"over": "gap=1,2", "refine": "height"}, "refine is 'height'"),
    ({"over": "gap=1,2", "results": "time", "refine": "gap"}, "result to refine by"),
    ({"over": "restitution=-1,-2"}, "restitution is -1"),
])
def test_misuse_in_one_sentence(arguments, sentence):
    with pytest.raises((TypeError, ValueError), match=re.escape(sentence)):
        gr.sweep(**({"scene": "three-balls"} | arguments))


def test_the_command(tmp_path, capsys):
    from granular.cli import main

    file = tmp_path / "map.nc"
    assert main(["sweep", "three-balls", "--over", "restitution=0.76:0.82:5", "--refine", "restitution", "--save",
                 str(file), "--gap", "1e-4", "--workers", "1"]) == 0
    out = capsys.readouterr().out
    assert "status           until 5" in out
    assert "(1, 4) to (1, 3)" in out
    assert xr.load_dataset(file).attrs["title"] == "granular sweep of three-balls"
    assert main(["sweep", "three-balls"]) == 2
    assert "--over" in capsys.readouterr().err


def test_executor_by_name_is_refused():
    with pytest.raises(TypeError, match=r"executor is 'dask': an object with submit\(\) is needed"):
        gr.sweep("three-balls", "gap=1e-4,1e-3", executor="dask")


def test_labels_are_short_and_pairs_have_numbers():
    data = gr.sweep("three-balls", "restitution=0.5,0.6", "contacts")
    assert data["restitution"].attrs["long_name"] == "restitution"
    assert data["restitution"].attrs["comment"].startswith("Coefficient of restitution in (0, 1]")
    assert data["pair"].values.tolist() == [0, 1]
    case = gr.Case(gr.scenes.newtons_cradle(3), gr.Hertz(1e9), until=gr.until.separated())
    data = gr.sweep(case, {"law.k": [1e9, 2e9]}, "shared_impulse")
    assert (data["law.k"].attrs["units"], data["shared_impulse"].attrs["long_name"]) == ("N/m³ᐟ²", "shared impulse")


@pytest.mark.parametrize(("workers", "threads"), [(1, 0), (2, 2), (3, 3)])
def test_any_number_of_threads_gives_the_same_bits(workers, threads, monkeypatch):
    """Compiled calls run in threads, all that is Python in this one; where little is left, there are none."""
    names, known = set(), located.solve_many

    def solve_many(many, **end):
        names.add(threading.current_thread().name)
        return known(many, **end)

    over = ["restitution=0.5:1:10", "gap=1e-7:1e-2:10:log"]
    here = gr.sweep("three-balls", over, sorted(FAST), workers=1)
    monkeypatch.setattr(located, "solve_many", solve_many)
    monkeypatch.setattr(schedule, "in_memory", lambda kernel: True)
    monkeypatch.setattr(schedule, "WORTH", 0.0)
    assert here.identical(gr.sweep("three-balls", over, sorted(FAST), workers=workers))
    assert len(names - {"MainThread"}) <= threads
    assert (len(names) > 1) == (threads > 0)
    names.clear()
    monkeypatch.setattr(schedule, "WORTH", math.inf)
    gr.sweep("three-balls", over, "contacts", workers=workers)
    assert names == {"MainThread"}


def test_an_interrupted_sweep_in_threads_leaves_none_and_keeps_what_is_done(monkeypatch, tmp_path):
    monkeypatch.setattr(schedule, "WORTH", 0.0)
    monkeypatch.setattr(schedule, "in_memory", lambda kernel: True)

    def interrupt(reached, count):
        if count > 16:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gr.sweep("three-balls", "gap=1e-7:1e-2:200:log", "contacts", workers=2, on_progress=interrupt,
                 save=tmp_path / "map.nc")
    assert not [thread for thread in threading.enumerate() if "ThreadPool" in thread.name]
    assert 16 < int((xr.load_dataset(tmp_path / "map.nc")["status"] >= 0).sum()) < 200


def test_threads_are_a_whole_number():
    with pytest.raises(ValueError, match="workers is 0"):
        gr.sweep("three-balls", "gap=1e-4,1e-3", workers=0)


def pile_that_creeps(gamma):
    scene = gr.Scene([math.inf, 1.0, 0.1, 0.5], [0.0, 0.1, 0.1, 0.1], [0.0, 0.001, 0.002], [0.0] * 4, 9.81)
    return Case(scene, gr.LinearDashpot(1e5, gamma), t_end=0.5)


@pytest.mark.usefixtures("interpreted")
def test_a_pile_that_creeps_ends_as_it_does_alone(monkeypatch):
    """A run by itself goes on by the pile's modes, where steps would take millions; here with one law for all pairs."""
    monkeypatch.setattr(schedule, "in_memory", lambda kernel: True)
    data = gr.sweep(pile_that_creeps, {"gamma": [1e3, 1e4]}, ("v_final", "contacts"))
    for i, gamma in enumerate([1e3, 1e4]):
        case = pile_that_creeps(gamma)
        alone = gr.md.simulate(case.scene, case.law, t_end=0.5)
        assert data.v_final.values[i].tobytes() == alone.velocity[-1].tobytes()
        assert alone.stats["steps"] <= 2048


# a case, a scene, a file

MINE = """about = "mine"
[scene]
mass = [inf, 4.0, 0.004]
radius = [0.0, 0.1, 0.01]
gap = [0.5, 1e-4]
velocity = [0.0, 0.0, 0.0]
gravity = 9.81
[[law]]
type = "LinearDashpot"
restitution = 0.7
k = 5e7
[[law]]
type = "Hertz"
k = 1e8
[run]
until = { pair = 0, nth = 2 }
"""
WAYS = ["gap[1]", "mass[2]", "gravity", "velocity[2]", "t_end", "law[0].k", "law[1].k", "law.k", "k", "scene.gap[0]"]


@pytest.fixture
def mine(tmp_path):
    (tmp_path / "mine.toml").write_text(MINE, encoding="utf-8")
    return tmp_path / "mine.toml"


@pytest.mark.parametrize("seed", range(6))
def test_a_file_its_case_and_the_case_built_by_hand_give_the_same_cells(seed, mine):
    """Two numbers at random vary by random shares; every cell is the run of the scene and laws made with them."""
    random = np.random.default_rng(seed)
    case = gr.cases.load(mine)
    known = {"gap[1]": 1e-4, "mass[2]": 0.004, "gravity": 9.81, "velocity[2]": -0.1, "t_end": 0.35, "law[0].k": 5e7,
             "law[1].k": 1e8, "law.k": 5e7, "k": 5e7, "scene.gap[0]": 0.5}
    one, other = random.choice(WAYS, 2, replace=False)
    if {one, other} <= {"k", "law.k"}:
        other = "gap[1]"
    over = {name: known[name] * random.uniform(0.5, 1.5, 2) for name in (one, other)}
    results = ["contacts", "v_rel", "t_f", "v_final", "time"]
    laws = [gr.LinearDashpot(law.k, law.gamma) if i == 0 else law for i, law in enumerate(case.law)]
    swept = gr.sweep(gr.Case(case.scene, laws, until=case.until), over, results)
    for i, a in enumerate(over[one]):
        for j, b in enumerate(over[other]):
            scene, law, t_end = by_hand(case, {one: float(a), other: float(b)})
            run = gr.md.simulate(scene, law, until=case.until, t_end=t_end)
            cell = swept.isel({one: i, other: j})
            assert cell["v_final"].values.tobytes() == run.velocity[-1].tobytes()
            assert float(cell["time"]) == run.time[-1]
            assert cell["contacts"].values.tolist() == [run.count(0), run.count(1)]
    if not {"law[0].k", "law.k", "k"} & {one, other}:  # in the file k of pair 0 keeps restitution, not γ
        of_file = gr.sweep(mine, over, results)
        of_scene = gr.sweep(case.scene, over, results, law=laws, until=case.until)
        for name in (*results, "status"):
            assert np.array_equal(of_file[name].values, swept[name].values, equal_nan=True)
            assert np.array_equal(of_scene[name].values, swept[name].values, equal_nan=True)


def by_hand(case, values):
    """Scene, laws and end with these numbers in place of the file's."""
    arrays = {name: getattr(case.scene, name).copy() for name in ("mass", "gap", "velocity")}
    stiffness, t_end, gravity = [law.k for law in case.law], None, 9.81
    for name, value in values.items():
        plain, index = re.fullmatch(r"(?:scene\.)?(\w+)(?:\[(\d)\])?(?:\.k)?", name).groups()
        if name in ("k", "law.k"):
            stiffness = [value, value]
        elif plain == "law":
            stiffness[int(index)] = value
        elif name == "t_end":
            t_end = value
        elif name == "gravity":
            gravity = value
        else:
            arrays[plain][int(index)] = value
    laws = [gr.LinearDashpot(stiffness[0], case.law[0].gamma), gr.Hertz(stiffness[1])]
    return case.scene.replace(**arrays, gravity=gravity), laws, t_end


def test_numbers_of_a_file_are_varied_as_if_it_were_edited(mine, tmp_path):
    """In a file, k goes with the restitution beside it, a ready-made scene with its own parameters."""
    eps = [0.5, 0.9]
    edited = []
    for value in eps:
        (tmp_path / "edited.toml").write_text(MINE.replace("restitution = 0.7", f"restitution = {value}"))
        edited.append(gr.cases.load(tmp_path / "edited.toml").simulate("md").velocity[-1])
    swept = gr.sweep(mine, {"law[0].restitution": eps}, "v_final")["v_final"].values
    assert swept.tobytes() == np.array(edited).tobytes()
    ready = tmp_path / "ready.toml"
    ready.write_text('[scene]\nname = "three-balls"\n')
    for over in ("gap=1e-4,1e-3", "radii[0]=0.1,0.12"):
        assert np.array_equal(gr.sweep(ready, over, "v_rel")["v_rel"], gr.sweep("three-balls", over, "v_rel")["v_rel"])


def test_a_sweep_of_a_case_names_it_and_goes_on_only_with_itself(mine, tmp_path):
    case, file = gr.cases.load(mine), tmp_path / "map.nc"
    data = gr.sweep(case, "gap[1]=1e-4,2e-4", "contacts", save=file)
    assert data["gap[1]"].attrs == {"units": "m", "long_name": "gap[1]", "comment": data["gap[1]"].attrs["comment"]}
    assert data.attrs["title"] == "granular sweep of mine"
    again = []
    gr.sweep(case, "gap[1]=1e-4,2e-4", "contacts", save=file, on_progress=lambda *so_far: again.append(so_far))
    assert not again
    other = gr.Case(case.scene.replace(gravity=9.8), case.law, case.rule, case.until)
    with pytest.raises(ValueError, match="holds another sweep"):
        gr.sweep(other, "gap[1]=1e-4,2e-4", "contacts", save=file)
    with ProcessPoolExecutor(2) as pool:
        assert data.identical(gr.sweep(case, "gap[1]=1e-4,2e-4", "contacts", executor=pool))


def test_the_command_sweeps_a_file(mine, capsys):
    from granular.cli import main

    assert main(["sweep", str(mine), "--over", "gap[1]=1e-4:1e-3:3", "--result", "contacts", "--t-end", "1"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("granular sweep of mine: 3 cells\n")
    counts = gr.sweep(mine, "gap[1]=1e-4:1e-3:3", "contacts", t_end=1.0)["contacts"].values
    assert f"  contacts         {counts.min()} … {counts.max()} " in out


@pytest.mark.parametrize(("over", "sentence"), [
    ("gab[1]=1,2", "'gab' is no parameter of Scene("),
    ("gap[7]=1,2", "gap[7] is asked for, and gap has 2 entries, counted from 0"),
    ("mass=1,2", "mass is one parameter for 3 entries: name one of them, such as mass[0]."),
    ("gravity[0]=1,2", "'gravity[0]' is no parameter: gravity is a single value"),
    ("law[0].kk=1,2", "'kk' is no parameter of LinearDashpot("),
    ("mass[1]=-1,-2", "mass[1] is -1.0: a mass must be positive"),
    ("gap..x=1,2", "'gap..x' is no name of a parameter"),
])
def test_a_wrong_name_in_a_case_is_one_sentence(over, sentence, mine):
    with pytest.raises((TypeError, ValueError), match=re.escape(sentence)):
        gr.sweep(gr.cases.load(mine), over)


@pytest.mark.parametrize(("walls", "ring"), [((), False), ((0,), False), ((0, 4), False), ((), True)])
def test_one_gap_for_all_pairs_of_balls_of_a_scene_of_ones_own(walls, ring):
    """Beside walls balls start where they stood; by hand to the bit."""
    mass, gap = [math.inf if i in walls else 1.0 + i for i in range(5)], np.array([0.2, 0.1, 0.3, 0.1, 0.2][: 4 + ring])
    scene = gr.Scene(mass, [0.0 if i in walls else 0.01 for i in range(5)], gap, [0.0, 1.0, -1.0, 2.0, 0.0], ring=ring)
    law = [gr.LinearDashpot(1e5, 1.0)] * len(gap)
    swept = gr.sweep(gr.Case(scene, law, t_end=1.0), {"gap": [0.05, 0.4]}, "v_final")
    beside = [bool({c, (c + 1) % 5} & set(walls)) for c in range(len(gap))]
    for i, value in enumerate((0.05, 0.4)):
        run = gr.md.simulate(scene.replace(gap=np.where(beside, gap, value)), law, t_end=1.0)
        assert swept["v_final"].values[i].tobytes() == run.velocity[-1].tobytes()
    assert swept["gap"].attrs["units"] == "m"


def test_one_gap_for_all_pairs_of_balls_of_a_file(mine):
    one, all_ = (gr.sweep(mine, f"{name}=1e-4,2e-4", "v_final")["v_final"].values for name in ("gap[1]", "gap"))
    assert one.tobytes() == all_.tobytes()
    with pytest.raises(ValueError, match=r"gap is one parameter for all pairs of balls, and there are none: name one"):
        gr.sweep(gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.5], [0.0, -1.0]), "gap=1,2", law=gr.Hertz(1e6))


def test_a_threshold_over_one_gap_is_that_of_the_ready_made_scene():
    asked = {"between": (1e-6, 1e-3), "points": 3, "within": 0.2}
    own = gr.threshold(gr.cases.make("newtons-cradle"), "gap", **asked)
    assert [(one.value, one.verdict) for one in own.values] == [
        (one.value, one.verdict) for one in gr.threshold("newtons-cradle", "gap", **asked).values]


LIKE = [
    (lambda e, k, pair: gr.LinearDashpot.from_restitution(e, k, pair), True),
    (lambda e, k, pair: gr.TsujiHertz.from_restitution(e, k), True),
    (lambda e, k, pair: gr.WaltonBraun.from_restitution(e, k), False),
    (lambda e, k, pair: gr.ViscoelasticHertz.from_restitution(e, 2.0, k, pair), False),
]


@pytest.mark.parametrize(("make", "ruled"), LIKE)
def test_one_restitution_for_all_laws_and_the_rule_of_a_case(make, ruled):
    """The laws keep their stiffness, whatever else is varied or fixed, in whichever order."""
    scene = gr.Scene([1.0, 2.0, 3.0], [0.01] * 3, [0.1, 0.2], [2.0, 0.0, -1.0])  # the first impact is one of 2 m/s
    rule = gr.ConstantRestitution(0.5) if ruled else None
    case = gr.Case(scene, [make(0.5, 1e5, p) for p in scene.pairs], rule, t_end=1.0)
    by_hand = [make(0.9, 1e5, p) for p in scene.pairs]
    found = gr.sweep(case, {"restitution": [0.9]}, ("v_final", "hard_v_final"))
    soft = gr.md.simulate(scene, by_hand, t_end=1.0)
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9) if ruled else gr.restitution_of(by_hand), t_end=1.0)
    assert found["v_final"].values[0].tobytes() == soft.velocity[-1].tobytes()
    assert found["hard_v_final"].values[0].tobytes() == hard.velocity[-1].tobytes()
    if isinstance(by_hand[0], gr.LinearDashpot):
        stiff = gr.md.simulate(scene, [make(0.9, 1e6, p) for p in scene.pairs], t_end=1.0).velocity[-1].tobytes()
        for over, fixed in (({"restitution": [0.9], "k": [1e6]}, {}), ({"k": [1e6]}, {"restitution": 0.9}),
                            ({"restitution": [0.9]}, {"law.k": 1e6})):
            assert gr.sweep(case, over, "v_final", **fixed)["v_final"].values.tobytes() == stiff


def test_what_all_pairs_share_is_the_number_that_a_case_has():
    from granular.sweeps.subject import shared

    scene = gr.Scene([math.inf, 1.0, 2.0, 3.0], [0.0] * 4, [0.5, 0.1, 0.1], [0.0, 2.0, 0.0, -1.0])
    case = gr.Case(scene, [gr.LinearDashpot.from_restitution(0.9, 1e5, p) for p in scene.pairs])
    assert shared(case) == {"gap": 0.1, "restitution": pytest.approx(0.9, rel=1e-13)}
    uneven = gr.Case(scene.replace(gap=[0.1, 0.1, 0.2]), [gr.LinearDashpot(1e5, 30.0)] * 3)
    assert shared(uneven) == {}
    assert shared(gr.Case(scene, gr.Hertz(1e6))) == {"gap": 0.1}


def test_what_has_no_restitution_of_its_own_is_one_sentence_and_a_rule_alone_may_have_one():
    scene = gr.Scene([1.0, 2.0], [0.01] * 2, [0.1], [2.0, 0.0])
    ruled = gr.Case(scene, gr.Hertz(1e6), gr.ConstantRestitution(0.5), t_end=1.0)
    last = gr.sweep(ruled, "restitution=0.9", "hard_v_final")["hard_v_final"].values[0]
    assert last[1] - last[0] == pytest.approx(1.8)
    for rule, sentence in ((None, "restitution is no parameter of Hertz(k=1000000.0): vary numbers of its own"),
                           (lambda speed, pair: 0.5, "'restitution' is no parameter of <function")):
        with pytest.raises(TypeError, match=re.escape(sentence)):
            gr.sweep(gr.Case(scene, gr.Hertz(1e6), rule, t_end=1.0), "restitution=0.9", "v_final")


def test_a_mistake_in_a_file_or_its_numbers_names_the_place(mine):
    with pytest.raises(ValueError, match=r"\[scene\]: 'gab' is no key; did you mean gap\?"):
        gr.sweep(mine, "gab=1,2")
    mine.write_text("[scene\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"mine\.toml: is not valid TOML"):
        gr.sweep(mine, "gap[0]=1,2")
    with pytest.raises(FileNotFoundError):
        gr.sweep("none.toml", "gap[0]=1,2")


def test_status_codes_in_files_keep_their_meaning():
    from granular.sweeps.results import STATUS

    names = ["time", "until", "quiet", "resting", "collapse", "disturbed", "max_events", "unstable", "misuse", "broken",
             "bounded"]
    assert dict(enumerate(names)) | {-1: "not_run"} == {code: STATUS[code] for code in range(-1, len(names))}

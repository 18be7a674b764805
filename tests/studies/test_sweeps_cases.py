"""Sweeps of a case, a scene or a file: their numbers by name, and what all pairs share as one number."""

import math
import re
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import granular as gr

pytest.importorskip("xarray")
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
    with pytest.raises(ValueError, match=r"must be a new file or a file of the same sweep, got .* of another sweep"):
        gr.sweep(other, "gap[1]=1e-4,2e-4", "contacts", save=file)
    with ProcessPoolExecutor(2) as pool:
        assert data.identical(gr.sweep(case, "gap[1]=1e-4,2e-4", "contacts", executor=pool))


def test_the_command_sweeps_a_file(mine, capsys):
    from granular.app.cli import main

    assert main(["sweep", str(mine), "--over", "gap[1]=1e-4:1e-3:3", "--result", "contacts", "--t-end", "1"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("granular sweep of mine: 3 cells\n")
    counts = gr.sweep(mine, "gap[1]=1e-4:1e-3:3", "contacts", t_end=1.0)["contacts"].values
    rows = [line.split() for line in out.splitlines()]
    assert ["gap[1],", "m", "contacts[0]", "contacts[1]", "status"] in rows
    assert [row[1:-1] for row in rows if row[-1:] == ["until"] and "×" not in row] == counts.astype(str).tolist()


@pytest.mark.parametrize(("over", "sentence"), [
    ("gab[1]=1,2", "Scene has no parameter `gab`; did you mean `gap`?"),
    ("gap[7]=1,2", "The index of gap[7] must be below 2, the number of entries, got 7."),
    ("mass=1,2", "The parameter mass has 3 entries. Name one of them, such as mass[0]."),
    ("gravity[0]=1,2", "gravity[0] is not a parameter, because gravity is a single value."),
    ("law[0].kk=1,2", "LinearDashpot has no parameter `kk`; did you mean `k`?"),
    ("mass[1]=-1,-2", "`mass[1]` must be positive, got -1.0. Use math.inf for a wall."),
    ("gap..x=1,2", "A parameter must be a name such as gap or radii[0], got 'gap..x'."),
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
    with pytest.raises(ValueError, match="The parameter gap stands for all pairs of balls, but this scene has "
                                         r"none\. Name one entry, such as gap\[0\]\."):
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
    from granular.studies.sweeps.subject import common_parameters

    scene = gr.Scene([math.inf, 1.0, 2.0, 3.0], [0.0] * 4, [0.5, 0.1, 0.1], [0.0, 2.0, 0.0, -1.0])
    case = gr.Case(scene, [gr.LinearDashpot.from_restitution(0.9, 1e5, p) for p in scene.pairs])
    assert common_parameters(case) == {"gap": 0.1, "restitution": pytest.approx(0.9, rel=1e-13)}
    uneven = gr.Case(scene.replace(gap=[0.1, 0.1, 0.2]), [gr.LinearDashpot(1e5, 30.0)] * 3)
    assert common_parameters(uneven) == {}
    assert common_parameters(gr.Case(scene, gr.Hertz(1e6))) == {"gap": 0.1}


def test_what_has_no_restitution_of_its_own_is_one_sentence_and_a_rule_alone_may_have_one():
    scene = gr.Scene([1.0, 2.0], [0.01] * 2, [0.1], [2.0, 0.0])
    ruled = gr.Case(scene, gr.Hertz(1e6), gr.ConstantRestitution(0.5), t_end=1.0)
    last = gr.sweep(ruled, "restitution=0.9", "hard_v_final")["hard_v_final"].values[0]
    assert last[1] - last[0] == pytest.approx(1.8)
    for rule, sentence in ((None,
        "restitution is not a parameter of Hertz(k=1000000.0). Vary its own numbers, such as law.k."),
                           (lambda speed, pair: 0.5, "function has no parameter `restitution`; there is none.")):
        with pytest.raises(TypeError, match=re.escape(sentence)):
            gr.sweep(gr.Case(scene, gr.Hertz(1e6), rule, t_end=1.0), "restitution=0.9", "v_final")


def test_a_mistake_in_a_file_or_its_numbers_names_the_place(mine):
    with pytest.raises(ValueError, match=r"\[scene\]: unknown key gab; did you mean gap\?"):
        gr.sweep(mine, "gab=1,2")
    mine.write_text("[scene\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"mine\.toml: The file is not valid TOML: Expected '\]' at the end of a "
                                         r"table declaration \(at line 1, column 7\)\."):
        gr.sweep(mine, "gap[0]=1,2")
    with pytest.raises(FileNotFoundError):
        gr.sweep("none.toml", "gap[0]=1,2")

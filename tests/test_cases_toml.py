"""Cases from TOML files and back: nothing is lost, every mistake is named with its place, odd files are refused."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from same_scene import assert_same_scene

from granular import binary, cases, scenes, until
from granular.laws import Hertz, LinearDashpot, ViscoelasticHertz, WaltonBraun
from granular.laws.rules import ConstantRestitution, TabulatedRestitution
from granular.run.trajectory import Status

pytestmark = pytest.mark.core
OWN = """
[scene]
mass = [inf, 4.0, "inf"]
radius = [0.0, 0.1, 0.0]
gap = [0.5, 0.25]
velocity = [0.0, -1.0, 0.0]
"""
LAW = """
[law]
type = "LinearDashpot"
k = 1e6
"""


@pytest.fixture
def read(tmp_path):
    def from_text(text: str) -> cases.Case:
        path = tmp_path / "own.toml"
        path.write_text(text, encoding="utf-8")
        return cases.load(path)

    return from_text


@pytest.mark.exact
@pytest.mark.parametrize("name", cases.names())
def test_a_template_has_one_restitution_which_law_and_rule_follow(name, read):
    text = cases.dumps(cases.make(name))
    assert "[rule]" not in text
    assert "gamma" not in text
    pairs = 2 if name == "real-balls" else 1  # each of its pairs has its own
    assert text.count("restitution = ") == pairs
    eps = 0.6
    edited = read(re.sub("restitution = .*", f"restitution = {eps}", re.sub("k = .*", "k = 123456.0", text)))
    assert edited.rule == ConstantRestitution(eps)
    for law, pair in zip(edited.law, edited.scene.pairs, strict=True):
        assert binary.restitution(law, pair, 1.0) == pytest.approx(eps, rel=1e-12)


@pytest.mark.parametrize("case", [
    cases.make("three-balls", restitution=[0.9, 0.5], law="WaltonBraun"),
    cases.make("chain", n=4, dimer=0.4, restitution=0.9),
    cases.make("three-balls", law="ViscoelasticHertz"),
    replace(cases.make("three-balls"), rule=ConstantRestitution(0.6)),
    replace(cases.make("three-balls"), law=(LinearDashpot(1e6, 1.0),) * 2),
    cases.Case(scenes.three_balls(), None, ConstantRestitution(0.6)),
], ids=str)
def test_every_case_comes_back_as_it_was(case, read):
    again = read(cases.dumps(case))
    assert (again.law, again.rule) == (case.law, case.rule)


@pytest.mark.parametrize("name", cases.names())
def test_saved_and_loaded_is_equal_bit_for_bit(name, tmp_path):
    case = cases.make(name, run={"samples": [0.0, 0.1], "method": "rk4", "dt": 1e-7, "ties": "right"})
    cases.save(case, tmp_path / "case.toml")
    again = cases.load(tmp_path / "case.toml")
    assert_same_scene(again.scene, case.scene)
    assert (again.law, again.rule, again.until, again.t_end, again.about) == (
        case.law, case.rule, case.until, case.t_end, case.about)
    assert again.run == case.run
    assert [p.name for p in tmp_path.iterdir()] == ["case.toml"]


def test_a_table_and_one_rule_per_pair_survive_too(tmp_path):
    scene = scenes.three_balls()
    table = TabulatedRestitution([0.0, 1.0, 2.0], [1.0, 0.9, 0.8])
    case = cases.Case(scene, (Hertz(1e9), WaltonBraun(1e6, 2e6)), (ConstantRestitution(0.5), table))
    cases.save(case, tmp_path / "case.toml")
    again = cases.load(tmp_path / "case.toml")
    assert again.law == case.law
    assert again.rule[0] == ConstantRestitution(0.5)
    assert again.rule[1].speed.tolist() == [0.0, 1.0, 2.0]
    assert (again.until, again.t_end) == (None, None)


def test_arrays_of_one_s_own_with_walls_as_words_or_numbers(read):
    case = read(OWN + LAW + '[run]\nuntil = "separated"\nt_end = 1\n')
    assert np.isinf(case.scene.mass[[0, 2]]).all()
    assert case.law == (LinearDashpot(1e6), LinearDashpot(1e6))
    assert case.rule is None
    assert (case.until, case.t_end) == (until.separated(), 1.0)


def test_positions_in_place_of_gaps(read):
    case = read(LAW + "[scene]\nmass = [1, 1]\nradius = [0.5, 0.5]\nposition = [2, 5]\nvelocity = [1, 0]\n")
    assert case.scene.gap.tolist() == [2.0]
    assert case.scene.origin == 2.0


def test_a_ready_made_scene_keeps_its_law_rule_and_stop(read):
    case = read('[scene]\nname = "three-balls"\ngap = 1e-3\n')
    assert case.scene.gap[1] == 1e-3
    assert case.law == cases.make("three-balls").law
    assert case.until == until.contact(0, 2)


def test_an_own_law_replaces_the_rule_too(read):
    case = read('[scene]\nname = "three-balls"\n[law]\ntype = "LinearDashpot"\nrestitution = 0.5\nk = 1e6\n')
    assert case.law == tuple(LinearDashpot.from_restitution(0.5, 1e6, pair) for pair in case.scene.pairs)
    assert case.rule == ConstantRestitution(0.5)
    damped = read('[scene]\nname = "three-balls"\n[law]\ntype = "LinearDashpot"\ngamma = 10.0\nk = 1e6\n')
    assert damped.rule is None


def test_laws_from_what_people_know(read):
    case = read('[scene]\nname = "three-balls"\n'
                '[[law]]\ntype = "ViscoelasticHertz"\nyoung = 5e7\npoisson = 0.45\ndissipation = 1e-5\n'
                '[[law]]\ntype = "ViscoelasticHertz"\nrestitution = 0.8\nspeed = 3\nk = 1e7\n')
    floor, balls = case.scene.pairs
    assert case.law == (ViscoelasticHertz.from_material(5e7, 0.45, 1e-5, floor),
                        ViscoelasticHertz.from_restitution(0.8, 3.0, 1e7, balls))


def test_hard_spheres_alone_need_no_law(read):
    case = read(OWN + '[rule]\ntype = "ConstantRestitution"\nrestitution = [0.5, 1.0]\n[run]\nt_end = 2.0\n')
    assert case.law is None
    assert case.simulate("edmd").status is Status.time


READY = '[scene]\nname = "three-balls"\n'


@pytest.mark.parametrize(("text", "sentence"), [
    ("[scene\n", r"own\.toml: is not valid TOML: .*line 1"),
    ("[scen]\n", r"own\.toml: table or key is 'scen': one of scene, law, .* did you mean scene\?"),
    ("[law]\n", r"own\.toml: table \[scene\] is missing"),
    ("scene = 3\n", r"own\.toml: \[scene\]: 3 is no table: write it in \[brackets\]"),
    ('[scene]\nname = "three-ball"\n', r"own\.toml: \[scene\]: name is 'three-ball': .* did you mean three-balls\?"),
    (READY + "gapp = 1\n", r"own\.toml: \[scene\]: 'gapp' is no key; did you mean gap\?"),
    (READY + "gravity = -1\n", r"own\.toml: \[scene\]: gravity is -1: .*at least 0 is needed"),
    ("[scene]\nmass = [1, 1]\nradius = [0, 0]\ngap = [1]\n",
     r"\[scene\]: the keys given are \(mass, radius, gap\): \(mass, radius, gap, velocity\) or \(mass, .* is needed"),
    ("[scene]\nmas = [1, 1]\n", r"own\.toml: \[scene\]: 'mas' is no key; did you mean mass\?"),
    (OWN.replace("4.0", "-4.0"), r"own\.toml: \[scene\]: mass\[1\] is -4\.0: a mass must be positive"),
    (OWN.replace("4.0", '"four"'), r"own\.toml: \[scene\]: mass is .*: an array of numbers is needed"),
    (OWN.replace("0.25", ""), r"own\.toml: \[scene\]: shape of gap is \(1,\): \(2,\) is needed"),
    (OWN, r"own\.toml: table \[law\] is missing: give a force law, or at least a \[rule\]"),
    (READY + "[law]\nk = 1.0\n", r"own\.toml: \[law\]: key 'type' is missing; needed is one of Hertz, LinearDashpot"),
    (READY + '[law]\ntype = "Herz"\n', r"own\.toml: \[law\]: type is 'Herz': one of .* did you mean Hertz\?"),
    (READY + '[law]\ntype = "Hertz"\nkk = 1\n', r"own\.toml: \[law\]: 'kk' is no key; did you mean k\?"),
    (READY + '[law]\ntype = "LinearDashpot"\nrestitution = 0.5\n',
     r"\[law\]: the keys given are \(restitution\): \(k\) or \(restitution, k\) is needed"),
    (READY + '[law]\ntype = "LinearDashpot"\nrestitution = 1.2\nk = 1\n', r"\[law\]: restitution is 1\.2: .*at most 1"),
    (READY + '[law]\ntype = "LinearDashpot"\nk = "stiff"\n', r"\[law\]: k is 'stiff': a single number is needed"),
    (READY + '[[law]]\ntype = "Hertz"\nk = 1\n', r"length of \[\[law\]\] is 1: 2 \(the number of pairs\) is needed"),
    (READY + '[[law]]\ntype = "Hertz"\nk = 1\n[[law]]\ntype = "Hertz"\nk = -1\n', r"\[\[law\]\] of pair 1: k is -1: "),
    (READY + '[rule]\ntype = "ConstantRestitution"\n', r"\[rule\]: the keys given are \(\): \(restitution\) is needed"),
    (READY + '[rule]\ntype = "ConstantRestitution"\nrestitution = 2\n', r"\[rule\]: restitution is 2: .*at most 1"),
    (READY + '[rule]\ntype = "TabulatedRestitution"\nspeed = [1, 0]\nrestitution = [1, 1]\n', r"\[rule\]: speed\["),
    (READY + "[run]\ndtt = 1e-7\n", r"own\.toml: \[run\]: 'dtt' is no option of a run; did you mean dt\?"),
    (READY + '[run]\nt_end = "soon"\n', r"own\.toml: \[run\]: t_end is 'soon': a single number is needed"),
    (READY + '[run]\nuntil = "sepparated"\n', r"\[run\]: until is 'sepparated': \"separated\" or a table such as"),
    (READY + "[run]\nuntil = { pair = 7 }\n", r"\[run\]: pair of until\.contact is 7: .*at most 1 is needed"),
    (READY + "[run]\nuntil = { pair = 0, nht = 2 }\n", r"\[run\]: until: 'nht' is no key; did you mean nth\?"),
    (READY + "[run]\nuntil = { nth = 2 }\n", r"\[run\]: until: the keys given are \(nth\): \(pair\) is needed"),
    ("about = 3\n" + READY, r"own\.toml: about is 3: a text in quotes is needed"),
])
def test_every_mistake_in_a_file_is_named_with_its_place(read, text, sentence):
    with pytest.raises((ValueError, TypeError), match=sentence):
        read(text)


def test_a_file_that_is_not_there_or_not_text(tmp_path):
    with pytest.raises(FileNotFoundError):
        cases.load(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"binary\.toml: is no text in UTF-8"):
        cases.load(tmp_path / "binary.toml")


def test_a_law_of_one_s_own_cannot_be_saved(tmp_path):
    @dataclass(frozen=True)
    class Mine:
        k: float

    case = cases.Case(scenes.bouncing_ball(), (Mine(1.0),))
    with pytest.raises(TypeError, match=r"law is .*Mine\(k=1\.0\): only Hertz, .* can be written to TOML"):
        cases.save(case, tmp_path / "case.toml")
    assert list(tmp_path.iterdir()) == []


def test_text_keeps_its_quotes_and_letters(tmp_path):
    case = cases.make("gas")
    odd = cases.Case(case.scene, case.law, about='ε = 0.7, "hard"\tand \\ soft')
    cases.save(odd, tmp_path / "case.toml")
    assert cases.load(tmp_path / "case.toml").about == odd.about


# --- odd files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "sentence"), [
    ("k = " + "9" * 400, r"own\.toml: \[law\]: k is 9999.*: a finite number above 0 is needed"),
    ("k = " + "9" * 9000, r"own\.toml: is not valid TOML: Exceeds the limit"),
    ("k = " + "[" * 900 + "]" * 900, r"own\.toml: is not a case: lists or tables are nested too deeply"),
    (".".join("a" * 50_000) + " = 1", r"own\.toml: is not a case: a key of more than 50 parts"),
    ("k = 1 # " + "x" * 33_000_000, r"own\.toml: is larger than 32 MB; build such a scene in Python"),
], ids=["400 digits", "9000 digits", "nested", "dots", "large"])
def test_a_file_that_would_eat_the_machine_is_refused(read, text, sentence):
    with pytest.raises(ValueError, match=sentence):
        read('[scene]\nname = "three-balls"\n[law]\ntype = "LinearDashpot"\n' + text)


def test_a_long_array_is_no_long_key():
    masses = ", ".join(["1.5"] * 400)
    zeros = ", ".join(["0.0"] * 400)
    gaps = ", ".join(["0.1"] * 399)
    text = f"[scene]\nmass = [{masses}]\nradius = [{zeros}]\nvelocity = [{zeros}]\ngap = [\n{gaps}\n]\n{LAW}"
    assert cases.loads(text).scene.n == 400


def test_a_file_saved_by_an_editor_on_windows_is_read(tmp_path):
    path = tmp_path / "own.toml"
    path.write_bytes(b"\xef\xbb\xbf" + (OWN + LAW).replace("\n", "\r\n").encode())
    assert cases.load(path).scene == cases.loads(OWN + LAW).scene


def test_overlap_beyond_the_radii_in_a_file_is_refused(read):
    with pytest.raises(ValueError, match=r"\[scene\]: gap\[0\] is -0\.5: an overlap cannot be deeper"):
        read(OWN.replace("[0.5, 0.25]", "[-0.5, 0.25]") + LAW)

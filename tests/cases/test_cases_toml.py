"""Cases from TOML files and back: nothing is lost, every mistake is named with its place, odd files are refused."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from granular import binary, cases, scenes, until
from granular.laws import Hertz, LinearDashpot, ViscoelasticHertz, WaltonBraun
from granular.laws.rules import ConstantRestitution, TabulatedRestitution
from granular.run.trajectory import Status
from tests.helpers.same_scene import assert_same_scene

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
    ("[scene\n",
        r"own\.toml: The file is not valid TOML: Expected '\]' at the end of a table declaration \(at line 1, "
        r"column 7\)\."),
    ("[scen]\n", r"own\.toml: unknown table or key scen; did you mean scene\?"),
    ("[law]\n",
        r"own\.toml: The table \[scene\] is missing\. It names a ready-made scene, or gives mass, radius, gap and "
        r"velocity\."),
    ("scene = 3\n",
        r"own\.toml: \[scene\]: A table must be written in \[brackets\] on a line of its own, then one key per "
        r"line, got 3\."),
    ('[scene]\nname = "three-ball"\n',
        r"own\.toml: \[scene\]: `name` must be a known name, got 'three-ball'\. Did you mean 'three-balls'\?"),
    (READY + "gapp = 1\n", r"own\.toml: \[scene\]: unknown key gapp; did you mean gap\?"),
    (READY + "gravity = -1\n",
        r"own\.toml: \[scene\]: `gravity` must be a finite number of at least 0, got -1\. It always "
        r"points downwards\."),
    ("[scene]\nmass = [1, 1]\nradius = [0, 0]\ngap = [1]\n",
     r"own\.toml: \[scene\]: The keys must be \(mass, radius, gap, velocity\) or \(mass, radius, position, "
     r"velocity\), got \(mass, radius, gap\)\."),
    ("[scene]\nmas = [1, 1]\n", r"own\.toml: \[scene\]: unknown key mas; did you mean mass\?"),
    (OWN.replace("4.0", "-4.0"),
        r"own\.toml: \[scene\]: `mass\[1\]` must be positive, got -4\.0\. Use math\.inf for a wall\."),
    (OWN.replace("4.0", '"four"'),
        r"own\.toml: \[scene\]: `mass` must be an array of numbers, got \[inf, 'four', 'inf'\]\."),
    (OWN.replace("0.25", ""),
        r"own\.toml: \[scene\]: `gap` must be an array of shape \(2,\), got an array of shape \(1,\)\. Give one "
        r"gap per pair of neighbours\."),
    (OWN, r"own\.toml: The table \[law\] is missing\. Give a force law, or at least a \[rule\] for hard spheres\."),
    (READY + "[law]\nk = 1.0\n",
        r"own\.toml: \[law\]: The key 'type' is missing\. It must be one of Hertz, LinearDashpot, MatchedEnd, "
        r"PowerLaw, TsujiHertz, ViscoelasticHertz, WaltonBraun\."),
    (READY + '[law]\ntype = "Herz"\n',
        r"own\.toml: \[law\]: `type` must be one of Hertz, LinearDashpot, MatchedEnd, PowerLaw, TsujiHertz, "
        r"ViscoelasticHertz, WaltonBraun, got 'Herz'\. Did you mean 'Hertz'\?"),
    (READY + '[law]\ntype = "Hertz"\nkk = 1\n', r"own\.toml: \[law\]: unknown key kk; did you mean k\?"),
    (READY + '[law]\ntype = "LinearDashpot"\nrestitution = 0.5\n',
     r"own\.toml: \[law\]: Exactly one of `k` and `duration` must be given, got neither\. Give the stiffness or the "
     r"contact duration\."),
    (READY + '[law]\ntype = "LinearDashpot"\nrestitution = 1.2\nk = 1\n',
        r"own\.toml: \[law\]: `restitution` must be a number in \(0, 1\], got 1\.2\."),
    (READY + '[law]\ntype = "LinearDashpot"\nk = "stiff"\n',
        r"own\.toml: \[law\]: `k` must be a single number, got 'stiff'\."),
    (READY + '[[law]]\ntype = "Hertz"\nk = 1\n',
        r"own\.toml: The length of \[\[law\]\] must be 2 \(the number of pairs\), got 1\. Give one for all pairs, "
        r"or one per pair from the bottom up\."),
    (READY + '[[law]]\ntype = "Hertz"\nk = 1\n[[law]]\ntype = "Hertz"\nk = -1\n',
        r"own\.toml: \[\[law\]\] of pair 1–2: `k` must be a finite number above 0, got -1\."),
    (READY + '[rule]\ntype = "ConstantRestitution"\n',
        r"own\.toml: \[rule\]: The keys must be \(restitution\), got \(\)\."),
    (READY + '[rule]\ntype = "ConstantRestitution"\nrestitution = 2\n',
        r"own\.toml: \[rule\]: `restitution` must be a number in \[0, 1\], got 2\. 1 is elastic, 0 sticks\."),
    (READY + '[rule]\ntype = "TabulatedRestitution"\nspeed = [1, 0]\nrestitution = [1, 1]\n',
        r"own\.toml: \[rule\]: `speed\[1\]` must be larger than the entry before it, got 0\.0\."),
    (READY + "[run]\ndtt = 1e-7\n", r"own\.toml: \[run\]: unknown option dtt; did you mean dt\?"),
    (READY + '[run]\nt_end = "soon"\n', r"own\.toml: \[run\]: `t_end` must be a single number, got 'soon'\."),
    (READY + '[run]\nuntil = "sepparated"\n',
        r'own\.toml: \[run\]: `until` must be "separated" or a table such as \{ pair = 0, nth = 2 \}, got '
        r"'sepparated'\."),
    (READY + "[run]\nuntil = { pair = 7 }\n",
        r"own\.toml: \[run\]: `pair` of until\.contact must be an integer from 0 to 1, got 7\. The lowest pair is "
        r"0\."),
    (READY + "[run]\nuntil = { pair = 0, nht = 2 }\n",
        r"own\.toml: \[run\]: until: unknown key nht; did you mean nth\?"),
    (READY + "[run]\nuntil = { nth = 2 }\n", r"own\.toml: \[run\]: until: The keys must be \(pair\), got \(nth\)\."),
    ("about = 3\n" + READY, r"own\.toml: `about` must be a text in quotes, got 3\."),
])
def test_every_mistake_in_a_file_is_named_with_its_place(read, text, sentence):
    with pytest.raises((ValueError, TypeError), match=sentence):
        read(text)


def test_a_file_that_is_not_there_or_not_text(tmp_path):
    with pytest.raises(FileNotFoundError):
        cases.load(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"binary\.toml: The file is not UTF-8 text, so it is not TOML\. To play a "
                                         r"recorded run, use granular view\."):
        cases.load(tmp_path / "binary.toml")


def test_a_law_of_one_s_own_cannot_be_saved(tmp_path):
    @dataclass(frozen=True)
    class Mine:
        k: float

    case = cases.Case(scenes.bouncing_ball(), (Mine(1.0),))
    with pytest.raises(TypeError, match="`law` must be one of Hertz, LinearDashpot, MatchedEnd, PowerLaw, "
                                        "TsujiHertz, ViscoelasticHertz, WaltonBraun to be written to TOML, got "
                                        r"test_a_law_of_one_s_own_cannot_be_saved\.<locals>\.Mine\(k=1\.0\)\."):
        cases.save(case, tmp_path / "case.toml")
    assert list(tmp_path.iterdir()) == []


def test_text_keeps_its_quotes_and_letters(tmp_path):
    case = cases.make("gas")
    odd = cases.Case(case.scene, case.law, about='ε = 0.7, "hard"\tand \\ soft')
    cases.save(odd, tmp_path / "case.toml")
    assert cases.load(tmp_path / "case.toml").about == odd.about


# --- odd files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "sentence"), [
    ("k = " + "9" * 400,
        r"own\.toml: \[law\]: `k` must be a finite number above 0, got "
        r"999999999999999999999999999999999999999999999999999999999\.\.\.\."),
    ("k = " + "9" * 9000,
        r"own\.toml: The file is not valid TOML: Exceeds the limit \(4300 digits\) for integer string conversion: "
        r"value has 9000 digits; use sys\.set_int_max_str_digits\(\) to increase the limit\."),
    ("k = " + "[" * 900 + "]" * 900, r"own\.toml: The file is not a case: lists or tables are nested too deeply\."),
    (".".join("a" * 50_000) + " = 1",
        r"own\.toml: The file is not a case: a key has more than 50 parts\. Keys such as scene\.mass have two\."),
    ("k = 1 # " + "x" * 33_000_000, r"own\.toml: The file is larger than 32 MB\. Build such a scene in Python\."),
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
    with pytest.raises(ValueError, match=r"own\.toml: \[scene\]: `gap\[0\]` must be at least minus the sum of both "
                                         r"radii, got -0\.5\. Deeper overlaps would exchange the centres\."):
        read(OWN.replace("[0.5, 0.25]", "[-0.5, 0.25]") + LAW)

"""Materials, and force laws made of them with a restitution: in Python, in TOML files and by the command."""

import math
from fractions import Fraction

import pytest

import granular as gr
from granular import cases, materials
from granular.cases.materials import MATERIALS, Material

PAIR = gr.Pair(m_eff=0.02, r_eff=0.007, index=0)
ROD = {"steel": 5050.0, "glass": 5200.0, "brass": 3480.0, "aluminium": 5050.0, "nylon": 1700.0}
"""Speed of sound in thin rods in m/s, as tables of acoustics have it: √(E/ρ)."""


@pytest.mark.parametrize("name", MATERIALS)
def test_the_table_says_what_is_certain(name):
    one = MATERIALS[name]
    assert one is getattr(gr.materials, name) is materials.named(name) is materials.named(one)
    assert one.young_range[0] <= one.young <= one.young_range[1]
    assert tuple(one) == (one.young, one.poisson)
    if name in ROD:
        assert math.sqrt(one.young / one.density) == pytest.approx(ROD[name], rel=0.07)


@pytest.mark.parametrize("restitution", [1.0, 0.9, 0.3])
def test_laws_of_a_material_have_the_restitution_and_the_stiffness(restitution):
    tsuji = gr.TsujiHertz.from_material(*materials.glass, restitution=restitution, pair=PAIR)
    viscoelastic = gr.ViscoelasticHertz.from_material(*materials.glass, restitution=restitution, speed=0.8, pair=PAIR)
    assert tsuji.k == viscoelastic.k == gr.Hertz.from_material(*materials.glass, PAIR).k
    for law in (tsuji, viscoelastic):
        assert gr.binary.restitution(law, PAIR, 0.8) == pytest.approx(restitution, rel=1e-12)


def test_bodies_of_two_materials_press_as_their_softness_adds():
    young, poisson = materials.both("steel", "rubber")
    softness = sum((1 - Fraction(nu) ** 2) / Fraction(y) for y, nu in (materials.steel, materials.rubber))
    law = gr.Hertz.from_material(young, poisson, PAIR)
    assert law.k == pytest.approx(4.0 / 3.0 * math.sqrt(PAIR.r_eff) / float(softness), rel=1e-15)
    assert law == gr.Hertz.from_material(young[::-1], poisson[::-1], PAIR)
    for kind, more in ((gr.TsujiHertz, {"restitution": 0.7}), (gr.ViscoelasticHertz, {"dissipation": 1e-6})):
        assert kind.from_material(young, poisson, pair=PAIR, **more).k == law.k


def test_two_bodies_of_one_material_are_the_law_of_that_material():
    for name in MATERIALS:
        assert gr.Hertz.from_material(*materials.both(name, name), PAIR) == gr.Hertz.from_material(
            *materials.named(name), PAIR)
    soft = gr.Hertz.from_material(*materials.rubber, PAIR)
    against_rigid = gr.Hertz.from_material((materials.rubber.young, 1e300), materials.rubber.poisson, PAIR)
    assert against_rigid.k == pytest.approx(2.0 * soft.k, rel=1e-14)


WAYS = "Either `dissipation`, or `restitution` with the `speed` at which it holds, must be given, got"
REFUSED = {
    "no way": (lambda: gr.ViscoelasticHertz.from_material(1e9, 0.3, pair=PAIR),
        f"{WAYS} dissipation = None, restitution = None and speed = None"),
    "both ways": (lambda: gr.ViscoelasticHertz.from_material(1e9, 0.3, 1e-6, PAIR, restitution=0.9, speed=1.0), WAYS),
    "no speed": (lambda: gr.ViscoelasticHertz.from_material(1e9, 0.3, pair=PAIR, restitution=0.9), WAYS),
    "speed alone": (lambda: gr.ViscoelasticHertz.from_material(1e9, 0.3, 1e-6, PAIR, speed=1.0), WAYS),
    "no pair": (lambda: gr.ViscoelasticHertz.from_material(1e9, 0.3, 1e-6),
        r"`pair` must be a Pair, such as scene\.pairs\[0\], got None\."),
    "three": (lambda: gr.Hertz.from_material((1e9, 1e9, 1e9), 0.3, PAIR),
              r"`young` must be an array of shape \(2,\), got an array of shape \(3,\)\. Give one for both bodies, "
              r"or \(lower, upper\)\."),
    "negative": (lambda: gr.Hertz.from_material((1e9, -1e9), 0.3, PAIR),
        r"`young\[1\]` must be .*above 0.*, got -1000000000\.0"),
    "poisson": (lambda: gr.Hertz.from_material(1e9, (0.3, 0.6), PAIR),
        r"`poisson\[1\]` must be a number in \[0, 0\.5\], got 0\.6\."),
    "restitution": (lambda: gr.TsujiHertz.from_material(1e9, 0.3, 1.5, PAIR),
        r"`restitution` must be a number in \(0, 1\], got 1\.5\."),
    "material": (lambda: materials.named("stel"),
        r"`material` must be one of steel, glass, brass, aluminium, nylon, rubber, got 'stel'\. Did you mean "
        r"'steel'\?"),
    "no material": (lambda: Material(1e9, 0.7, 1e3, (1e9, 1e9)),
        r"`poisson` must be a number in \[0, 0\.5\], got 0\.7\."),
    "no density": (lambda: Material(1e9, 0.3, 0.0, (1e9, 1e9)), r"`density` must be .*above 0.*, got 0\.0"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_misuse_is_said_in_one_sentence(name):
    call, sentence = REFUSED[name]
    with pytest.raises((TypeError, ValueError), match=sentence):
        call()


def law_of(text):
    return cases.loads(f'[scene]\nname = "three-balls"\n[law]\n{text}\n')


@pytest.mark.parametrize(("text", "make"), [
    ('type = "TsujiHertz"\nyoung = 1e9\npoisson = 0.3\nrestitution = 0.8',
     lambda p: gr.TsujiHertz.from_material(1e9, 0.3, 0.8, p)),
    ('type = "TsujiHertz"\nmaterial = "brass"\nrestitution = 0.8',
     lambda p: gr.TsujiHertz.from_material(*materials.brass, 0.8, p)),
    ('type = "ViscoelasticHertz"\nmaterial = "brass"\nrestitution = 0.8\nspeed = 2',
     lambda p: gr.ViscoelasticHertz.from_material(*materials.brass, restitution=0.8, speed=2.0, pair=p)),
    ('type = "Hertz"\nmaterial = ["steel", "rubber"]',
     lambda p: gr.Hertz.from_material(*materials.both("steel", "rubber"), p)),
    ('type = "Hertz"\nyoung = [1e9, 2e9]\npoisson = 0.3', lambda p: gr.Hertz.from_material((1e9, 2e9), 0.3, p)),
])
def test_files_say_materials_too(text, make):
    case = law_of(text)
    assert case.law == tuple(map(make, case.scene.pairs))
    assert case.rule == (gr.ConstantRestitution(0.8) if "Tsuji" in text else None)
    assert cases.loads(cases.dumps(case)).law == case.law


@pytest.mark.parametrize(("text", "sentence"), [
    ('type = "Hertz"\nmaterial = "stel"',
        r"\[law\]: `material` must be one of steel, glass, brass, aluminium, nylon, rubber, got 'stel'\. Did you "
        r"mean 'steel'\?"),
    ('type = "Hertz"\nmaterial = ["steel"]',
        r"\[law\]: `material` must have one entry, or two \(lower, upper\), got a list of length 1\."),
    ('type = "Hertz"\nmaterial = "steel"\nyoung = 1e9',
        r"\[law\]: Only one of the keys material and young can be given, got both\."),
    ('type = "ViscoelasticHertz"\nmaterial = "steel"\nrestitution = 0.9', WAYS),
    ('type = "LinearDashpot"\nmaterial = "steel"',
        r"\[law\]: The type of a law of a material must be one of Hertz, TsujiHertz, ViscoelasticHertz, got "
        r"'LinearDashpot'\."),
])
def test_files_with_other_materials_are_refused(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        law_of(text)


def test_the_command_takes_a_material(granular):
    code, _, _ = granular("run newtons-cradle --material glass --law TsujiHertz --restitution 0.9 --save run.npz")
    assert code == 0
    run = gr.Trajectory.load("run.npz")
    assert tuple(run.law) == tuple(gr.TsujiHertz.from_material(*materials.glass, 0.9, p) for p in run.scene.pairs)
    for law in ("Hertz", "ViscoelasticHertz"):
        assert cases.make("chain", material="steel", law=law, restitution=1.0).law[0].k == pytest.approx(
            gr.Hertz.from_material(*materials.steel, cases.make("chain").scene.pairs[0]).k)


@pytest.mark.parametrize(("words", "sentence"), [
    ("--material stel", "Did you mean 'steel'?"),
    ("--material steel --stiffness 1e9", "Only one of `material` and `stiffness` can be given, got both."),
    ("--material steel --law LinearDashpot", "The law of a material must be one of Hertz, TsujiHertz"),
])
def test_the_command_refuses_other_materials(granular, words, sentence):
    code, _, error = granular(f"run chain {words}")
    assert code == 2
    assert sentence in error

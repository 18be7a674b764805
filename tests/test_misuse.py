"""Every kind of misuse of the public face ends in one clear sentence: the name, the value got, what is needed."""

import math
import re
from dataclasses import dataclass
from inspect import signature

import numpy as np
import pytest

import granular as gr
from granular import binary, cases, edmd, laws, md, scenes, theory, until
from granular.comparison import compare
from granular.laws import rules
from granular.scene import Pair, Scene

STACK = scenes.three_balls()
PAIR = STACK.pairs[1]
SOFT = laws.LinearDashpot(5e7, 100.0)
HARD = rules.ConstantRestitution(0.7)
OVERLAP = Scene([1.0, 1.0], [0.1, 0.1], [-0.01], [0.0, 0.0])


def scene(**changes):
    values = {"mass": [math.inf, 2.0, 1.0], "radius": [0.0, 0.1, 0.2], "gap": [0.5, 1e-3], "velocity": [0.0, -1.0, 2.0]}
    return Scene(**(values | changes))


def soft(*arguments, **options):
    return md.simulate(*(arguments or (STACK, SOFT)), **({"t_end": 0.01} | options))


def hard(*arguments, **options):
    return edmd.simulate(*(arguments or (STACK, HARD)), **({"t_end": 0.01} | options))


@dataclass(frozen=True)
class Forceless:
    k: float = 1.0


@dataclass(frozen=True)
class Contradiction:
    """Its force and its trait disagree."""

    k: float = 1.0

    def force(self, xi, xi_dot, pair):
        return self.k * xi

    def linear(self, pair):
        return 2.0 * self.k, 0.0


SCENES = {
    "truth is a mass": (
        lambda: scene(mass=[math.inf, True, 0.5]), r"mass is \[inf, True, 0\.5\]: an array of"),
    "numpy's truth is a mass": (
        lambda: scene(mass=[np.True_, 1.0, 1.0]),
        r"mass is \[.*True.*, .*: an array of numbers"),
    "truths are masses": (lambda: scene(mass=np.array([True] * 3)), r"mass is array\(.*: an array of numbers"),
    "truth is gravity": (lambda: scene(gravity=np.array(True)), r"gravity is array\(True\): a single number is needed"),
    "masses are words": (lambda: scene(mass=["1", "2", "3"]), r"mass is \['1', '2', '3'\]: an array of numbers"),
    "a mass is missing": (lambda: scene(mass=[1.0, None, 1.0]), r"mass is \[1\.0, None, 1\.0\]: an array of numbers"),
    "negative mass": (lambda: scene(mass=[math.inf, -2.0, 1.0]), r"mass\[1\] is -2\.0: a mass must be positive"),
    "massless ball": (lambda: scene(mass=[math.inf, 0.0, 1.0]), r"mass\[1\] is 0\.0: a mass must be positive"),
    "mass is nan": (lambda: scene(mass=[math.inf, math.nan, 1.0]), r"mass\[1\] is nan: a mass must be positive"),
    "wall in the middle": (lambda: scene(mass=[1.0, math.inf, 1.0]), r"mass\[1\] is inf: only the first and the last"),
    "walls only": (
        lambda: Scene([math.inf] * 2, [0, 0], [1], [0, 0]),
        r"mass is inf for every body: at least one ball"),
    "one body": (lambda: Scene([1.0], [0.1], [], [0.0]), r"mass has 1 entries: at least 2 bodies are needed"),
    "mass is a word": (lambda: scene(mass="heavy"), r"mass is 'heavy': an array of numbers is needed"),
    "mass is a matrix": (lambda: scene(mass=np.ones((2, 2))), r"shape of mass is \(2, 2\): one dimension is needed"),
    "negative radius": (lambda: scene(radius=[0, -0.1, 0.2]), r"radius\[1\] is -0\.1: a radius must be finite and not"),
    "thick wall": (lambda: scene(radius=[0.1, 0.1, 0.2]), r"radius\[0\] is 0\.1: a wall is flat and has radius 0"),
    "too few radii": (lambda: scene(radius=[0, 0.1]), r"shape of radius is \(2,\): \(3,\) is needed"),
    "one gap per body": (
        lambda: scene(gap=[0.5, 0.1, 0.1]),
        r"shape of gap is \(3,\): \(2,\) is needed; one gap per pair"),
    "endless gap": (lambda: scene(gap=[0.5, math.inf]), r"gap\[1\] is inf: a gap must be finite"),
    "velocity is nan": (lambda: scene(velocity=[0, 0, math.nan]), r"velocity\[2\] is nan: a velocity must be finite"),
    "gravity upwards": (lambda: scene(gravity=-9.81), r"gravity is -9\.81: .*at least 0 is needed; gravity pulls down"),
    "gravity as a vector": (lambda: scene(gravity=[0, -9.81]), r"gravity is \[0, -9\.81\]: a single number is needed"),
    "positions fall": (
        lambda: Scene.from_positions([1, 1], [0, 0], [1, 0], [0, 0]),
        r"position\[\d\] is .*not decrease"),
    "three radii": (lambda: scenes.three_balls((1, 1, 1)), r"shape of radii is \(3,\): \(2,\) is needed"),
    "ball in the floor": (lambda: scenes.three_balls(height=0.01), r"height is 0\.01: .*at least 0\.1 is needed"),
    "stack of nothing": (lambda: scenes.ball_stack(0), r"n is 0: a whole number of at least 1 is needed"),
    "dropped and thrown": (
        lambda: scenes.ball_stack(height=1, speed=1),
        r"height is 1 and speed is 1: give one of the"),
    "all balls arrive": (lambda: scenes.newtons_cradle(3, moving=3), r"moving is 3: .*at most 2 is needed"),
    "overfull gas": (lambda: scenes.gas(packing=1.5), r"packing is 1\.5: a share of the length below 1 is needed"),
    "masked masses": (
        lambda: scene(mass=np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0])),
        r"mass is masked_array.*: an array without a mask is needed; leave out what is masked"),
    "complex masses": (lambda: scene(mass=np.array([1, 2, 1 + 1j])), r"mass is array.*: an array of numbers is needed"),
    "velocity of dates": (
        lambda: scene(velocity=np.array(["2020"] * 3, "datetime64")),
        r"velocity is array.*: an array of numbers is needed"),
    "a gap beyond the floats": (lambda: scene(gap=[0.5, 10**400]), r"gap is .*: an array of numbers is needed"),
    "gravity beyond the floats": (lambda: scene(gravity=10**400), r"gravity is 1000.*: a finite number"),
    "gravity of 9000 digits": (lambda: scene(gravity=10**9000), r"gravity is a number of .* digits: a finite number"),
    "ball within a ball": (lambda: scenes.three_balls(gap=-1), r"gap\[1\] is -1\.0: an overlap cannot be deeper"),
    "cradle turned over": (lambda: scenes.newtons_cradle(3, gap=-1), r"gap\[0\] is -1\.0: an overlap cannot be deeper"),
    "seed beyond count": (lambda: scenes.gas(seed=2**70), r"seed is 118059162\d*: .*at most 9223372036854775807"),
    "unknown speeds": (lambda: scenes.gas(speeds="maxwel"), r"speeds is 'maxwel': .*did you mean maxwell\?"),
}

LAWS = {
    "restitution above 1": (
        lambda: laws.LinearDashpot.from_restitution(1.2, 1e6, PAIR),
        r"restitution is 1\.2: .*at most 1"),
    "dashpot that sticks": (
        lambda: laws.LinearDashpot.from_restitution(0.0, 1e6, PAIR),
        r"restitution is 0\.0: .*above 0"),
    "dashpot of no pair": (
        lambda: laws.LinearDashpot.from_restitution(0.7, k=5e7, pair=0),
        r"pair is 0: a Pair is needed, such as scene\.pairs\[0\]"),
    "viscoelastic law of no pair": (
        lambda: laws.ViscoelasticHertz.from_restitution(0.7, 1.0, 5e7, None), r"pair is None: a Pair is needed"),
    "material of no pair": (lambda: laws.Hertz.from_material(1e9, 0.3, None), r"pair is None: a Pair is needed"),
    "rule of no pair": (
        lambda: rules.ThorntonRestitution.from_material(1e9, 0.3, 1e6, 1), r"pair is 1: a Pair is needed"),
    "collision of no pair": (lambda: binary.collision(SOFT, 0, 1.0), r"pair is 0: a Pair is needed"),
    "collision of no law": (
        lambda: binary.collision([1, 2], PAIR, 1.0), r"law is \[1, 2\]: an object with force\(self, xi"),
    "restoring stiffness": (
        lambda: laws.LinearDashpot.from_restitution(0.7, k=-1, pair=PAIR), r"k is -1: a finite number above 0"),
    "stiffness in words": (
        lambda: laws.ViscoelasticHertz.from_restitution(0.7, 1.0, "1e7", PAIR), r"k is '1e7': a single number"),
    "plastic stiffness in words": (
        lambda: laws.WaltonBraun.from_restitution(0.7, "1e7"), r"k_load is '1e7': a single number is needed"),
    "weightless pair": (lambda: Pair(0.0, 1.0, 0), r"m_eff is 0\.0: a finite number above 0 is needed"),
    "restitution at rest": (lambda: binary.restitution(SOFT, PAIR, 0.0), r"speed is 0\.0: .*above 0 is needed"),
    "restitution of parting balls": (lambda: binary.restitution(SOFT, PAIR, -1), r"speed is -1: .*above 0 is needed"),
    "restitution of some parting balls": (
        lambda: binary.restitution(SOFT, PAIR, [1.0, -1.0]), r"speed is .*-1\.0.*: .*above 0 is needed"),
    "restitution at nan": (lambda: binary.restitution(SOFT, PAIR, math.nan), r"speed is nan: .*above 0 is needed"),
    "collision slower than numbers": (
        lambda: binary.collision(laws.ViscoelasticHertz(1e9, 1e3), PAIR, 1e-300),
        r"speed is 1e-300: overlap, force or duration of the contact is beyond the range"),
    "collision faster than numbers": (
        lambda: binary.collision(laws.Hertz(1e9), PAIR, 1e300), r"speed is 1e\+300: overlap, force or duration"),
    "no stiffness": (lambda: laws.Hertz(0.0), r"k is 0\.0: a finite number above 0 is needed"),
    "driving dashpot": (lambda: laws.LinearDashpot(1e6, -1.0), r"gamma is -1\.0: .*at least 0 is needed"),
    "stiffness is nan": (lambda: laws.TsujiHertz(math.nan, 0.1), r"k is nan: a finite number above 0 is needed"),
    "too soft a power": (lambda: laws.PowerLaw(1.0, 0.5), r"exponent is 0\.5: .*at least 1 is needed"),
    "softer unloading": (
        lambda: laws.WaltonBraun(2.0, 1.0),
        r"k_unload is 1\.0: .*at least 2 is needed; unloading must"),
    "Poisson's ratio 0.6": (
        lambda: laws.Hertz.from_material(1e9, 0.6, PAIR),
        r"poisson is 0\.6: .*at most 0\.5 is needed"),
    "rule above 1": (lambda: rules.ConstantRestitution(1.2), r"restitution is 1\.2: .*at most 1 is needed"),
    "rule is a word": (lambda: rules.ConstantRestitution("hard"), r"restitution is 'hard': a single number is needed"),
    "rule of nothing": (lambda: rules.ConstantRestitution([]), r"restitution is empty: one number for all pairs"),
    "rule of words": (lambda: rules.ConstantRestitution(["1"]), r"restitution is \['1'\]: an array of numbers"),
    "table that falls back": (
        lambda: rules.TabulatedRestitution([0, 2, 1], [1, 1, 1]),
        r"speed\[\d\] is .*must increase"),
    "table of one": (lambda: rules.TabulatedRestitution([1], [1]), r"speed has 1 entries: at least 2 are needed"),
    "standing collision": (lambda: binary.collision(SOFT, PAIR, 0.0), r"speed is 0\.0: .*above 0 is needed"),
    "separating balls": (lambda: theory.effective_restitution(-1, 3), r"v_rel_after is -1: .*at least 0 is needed"),
}

BEYOND = np.broadcast_to(0.1, 10**13)
"""More than any memory holds, made of one number."""

RUNS = {
    "md rows beyond memory": (lambda: soft(samples=1e12), r"samples is 1.*: .* at least 2 and at most 10000000 is"),
    "edmd rows beyond memory": (lambda: hard(samples=10**30), r"samples is 1000.*: .* and at most 10000000 is needed"),
    "times beyond memory": (
        lambda: soft(samples=BEYOND),
        r"shape of samples is \(1000.*: an array that fits into memory"),
    "gaps beyond memory": (lambda: scene(gap=BEYOND), r"shape of gap is \(1000.*: an array that fits into memory is"),
    "log is a word": (lambda: soft(log="no"), r"log is 'no': True, False or the name of a file that ends in \.npy"),
    "log is a number": (lambda: hard(log=1), r"log is 1: True or False is needed"),
    "tolerance of a fixed step": (
        lambda: soft(tol=1e-3, method="verlet"), r"tol is 0\.001: method 'verlet' has no tolerance; give dt"),
    "clock beyond the floats": (
        lambda: soft(t_start=-1e308, t_end=1e308),
        r"t_end is 1e\+308: a time .* t_start = -1e"),
    "steps beyond the floats": (
        lambda: soft(t_end=1e308, dt=1e-6), r"dt is 1e-06: step inf is more than can be counted; take a longer"),
    "flight of too many steps": (
        lambda: soft(t_end=None, until=until.contact(0), dt=1e-60), r"dt is 1e-60: step .* is more than can be"),
    "law without force": (
        lambda: soft(STACK, Forceless()),
        r"law of pair 0 is .*Forceless.*: an object with force\(self"),
    "law is a class": (
        lambda: soft(STACK, laws.Hertz),
        r"law of pair 0 is the class Hertz: an instance is needed, such as Hertz\(k="),
    "md calls a number": (lambda: soft(on_event=3), r"on_event is 3: a function, or None, is needed"),
    "edmd calls a number": (lambda: hard(on_progress=3), r"on_progress is 3: a function, or None, is needed"),
    "md without rows": (lambda: soft(samples=[]), r"samples is empty: at least one time is needed"),
    "edmd without rows": (lambda: hard(samples=[]), r"samples is empty: at least one time is needed"),
    "law is a number": (lambda: soft(STACK, 5e7), r"law of pair 0 is 50000000\.0: an object with force\(self"),
    "law that contradicts itself": (
        lambda: soft(STACK, Contradiction()),
        r"law of pair 0 is .*force\(0\.25, 0\.5\) gives"),
    "contacts beyond count": (
        lambda: soft(max_events=10**400), r"max_events is 1000.*: a whole number of at least 0 and at most 922"),
    "steps beyond count": (lambda: soft(max_steps=10**30), r"max_steps is 1000.*: a whole number of at least 1 and at"),
    "finer than rounding": (
        lambda: soft(tol=1e-300), r"tol is 1e-300: a finite number of at least 1e-17 and at most 0\.001"),
    "mass beyond the floats": (
        lambda: soft(Scene([1e-320, 1.0], [0.1, 0.1], [1e-3], [1.0, 0.0]), SOFT, t_end=1.0),
        r"law is LinearDashpot.*: rates or overlaps of its contacts in this scene are beyond the range of numbers"),
    "too few laws": (lambda: soft(STACK, [SOFT]), r"length of law is 1: 2 \(the number of pairs\) is needed"),
    "unknown method": (lambda: soft(method="verlett"), r"method is 'verlett': one of .* did you mean verlet\?"),
    "no time step": (lambda: soft(dt=0.0), r"dt is 0\.0: a finite number of at least 1e-60 is"),
    "md into the past": (lambda: soft(t_end=-1.0), r"t_end is -1\.0: .*at least 0 is needed"),
    "md of a word": (lambda: soft("three-balls", SOFT), r"scene is 'three-balls': a .*Scene is needed"),
    "md until no pair": (lambda: soft(until=until.contact(7)), r"pair of until\.contact is 7: .*at most 1 is needed"),
    "until is a word": (lambda: soft(until="separated"), r"until is 'separated': a condition from granular\.until"),
    "md samples outside": (lambda: soft(samples=[0.0, 0.5]), r"samples\[1\] is 0\.5: "),
    "zeroth contact": (lambda: until.contact(0, nth=0), r"nth is 0: a whole number of at least 1 is needed"),
    "overlap in edmd": (lambda: hard(OVERLAP, HARD), r"gap\[0\] is -0\.01: "),
    "rule is a bare number": (
        lambda: hard(STACK, 0.7),
        r"rule is 0\.7: a callable .* write granular\.ConstantRestitution"),
    "law as a rule": (lambda: hard(STACK, SOFT), r"rule is LinearDashpot.*: a callable of \(speed, pair\) is needed"),
    "rule out of range": (
        lambda: hard(STACK, lambda v, p: 1.5, t_end=1.0),
        r"returned 1\.5 at impact speed .*\[0, 1\]"),
    "too few restitutions": (
        lambda: hard(STACK, rules.ConstantRestitution([0.7])),
        r"length of restitution is 1: 2 \(the"),
    "edmd until no pair": (lambda: hard(until=until.contact(7)), r"pair of until\.contact is 7: .*at most 1 is needed"),
    "edmd into the past": (lambda: hard(t_end=-1.0), r"t_end is -1\.0: "),
    "edmd samples outside": (lambda: hard(samples=[0.0, 0.5]), r"samples\[1\] is 0\.5: "),
    "unknown tie rule": (lambda: hard(ties="lefft"), r"ties is 'lefft': one of .* did you mean left\?"),
    "unknown remedy": (lambda: hard(collapse="stopp"), r"collapse is 'stopp': "),
    "unknown engine": (lambda: hard(engine="fast"), r"engine is 'fast': one of "),
    "overlap in compare": (lambda: compare(OVERLAP, SOFT, t_end=1.0), r"gap\[0\] is -0\.01: "),
    "compare of no scene": (lambda: compare(None, SOFT), r"scene is None: a granular\.Scene is needed, such as"),
    "compare without force": (lambda: compare(STACK, Forceless(), t_end=1.0), r"law of pair 0 is .*Forceless"),
    "compare into the past": (lambda: compare(STACK, SOFT, t_end=-1.0), r"t_end is -1\.0: "),
    "unknown case": (lambda: cases.make("three-bals"), r"scene is 'three-bals': .*did you mean three-balls\?"),
    "unknown option": (lambda: cases.make("gas", sead=1), r"'sead' is no option of gas; did you mean seed\?"),
    "option of the other engine": (lambda: cases.make("gas").simulate("edmd", dt=1), r"'dt' is no option of edmd"),
}


@pytest.mark.parametrize("name", [
    name for name in scenes.__all__ if "n" in signature(getattr(scenes, name)).parameters])
@pytest.mark.parametrize(("n", "sentence"), [
    (10**9, "n is 1000000000: a whole number of at least . and at most 10000000 is needed"),
    (1e12, "at most 10000000 is needed"), (10**400, "at most 10000000 is needed"), (0, "n is 0: a whole number"),
    (-3, "n is -3: a whole number"), (2.5, "n is 2.5: a whole number"),
    (True, "n is True: a single"), ("5", "n is '5'"),
])
def test_a_ready_made_scene_says_how_many_balls_it_may_have(name, n, sentence):
    law = {"law": None} if name == "compressed_chain" else {}
    with pytest.raises((ValueError, TypeError), match=sentence):
        getattr(scenes, name)(n=n, **law)


@pytest.mark.parametrize("method", ["verlet", "symplectic-euler", "rk4", "gear5"])
@pytest.mark.parametrize("scene_", [STACK, OVERLAP])
@pytest.mark.parametrize("end", [{"t_end": 1.0}, {"t_end": None, "until": until.separated()}])
def test_a_step_too_short_for_numbers_is_one_sentence(method, scene_, end):
    with pytest.raises(ValueError, match="dt is 1e-320: a finite number of at least 1e-60 is needed"):
        soft(scene_, SOFT, method=method, dt=1e-320, **end)


@pytest.mark.parametrize(("call", "sentence"), [
    pytest.param(*row, id=name) for table in (SCENES, LAWS, RUNS) for name, row in table.items()])
def test_misuse_is_one_clear_sentence(call, sentence):
    with pytest.raises((ValueError, TypeError)) as caught:
        call()
    message = str(caught.value)
    assert re.search(sentence, message), message
    assert message[-1] in ".?"
    assert "\n" not in message


def test_a_user_s_own_exception_passes_through_unwrapped():
    class Own(Exception):
        pass

    def raising(speed, pair):
        raise Own("mine")

    with pytest.raises(Own, match="mine"):
        hard(STACK, raising, t_end=1.0)


class Own:
    """A law whose methods are given."""

    def __init__(self, **methods):
        self.__dict__.update(methods)


THREE, RULE = gr.scenes.three_balls(gap=1e-3), gr.ConstantRestitution(0.5)
NEEDED = r"\(xi, xi_dot, pair\) is needed; with xi_max set memory = True\."
ARITIES = {
    "force": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, xi_dot: 1.0)),
              rf"force of law of pair 0 takes \(xi, xi_dot\): {NEEDED}"),
    "order": (lambda: gr.compare(THREE, Own(force=lambda pair, xi, xi_dot: 1.0), t_end=1.0),
              rf"force of law of pair 0 takes \(pair, xi, xi_dot\): {NEEDED}"),
    "no memory": (lambda: gr.binary.restitution(Own(force=lambda xi, v, p, top: 1.0), THREE.pairs[0], 1.0),
                  rf"force of law takes \(xi, v, p, top\): {NEEDED}"),
    "memory": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, v, p: 1.0, memory=True)),
               r"takes \(xi, v, p\): \(xi, xi_dot, pair, xi_max\) is needed; without it leave memory out\."),
    "trait": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, v, p: xi, linear=lambda: (1.0, 0.0))),
              r"linear of law of pair 0 takes \(\): \(pair\) is needed\."),
    "watch": (lambda: gr.edmd.simulate(THREE, RULE, t_end=0.1, watch=Own(force=lambda xi: 1.0)),
              rf"force of watch takes \(xi\): {NEEDED}"),
    "rule": (lambda: gr.edmd.simulate(THREE, lambda v: 0.5, t_end=0.1),
             r"rule takes \(v\): \(speed, pair\) is needed\."),
    "class": (lambda: gr.edmd.simulate(THREE, gr.ConstantRestitution, t_end=0.1),
              r"rule takes \(restitution\): \(speed, pair\) is needed\."),
    "on_event": (lambda: gr.edmd.simulate(THREE, RULE, t_end=0.1, on_event=lambda: 0),
                 r"on_event takes \(\): \(row\) is needed\."),
    "keyword": (lambda: gr.md.simulate(THREE, gr.Hertz(1e7), t_end=0.1, on_event=lambda row, *, more: 0),
                r"on_event takes \(row, \*, more\): \(row\) is needed\."),
    "motion": (lambda: gr.walls.Motion(lambda: 0.0), r"function takes \(\): \(t\) is needed\."),
    "result": (lambda: gr.sweep("three-balls", {"gap": [1e-3]}, results=[lambda: 0.0]),
               r"result takes \(\): \(case\) is needed\."),
    "observable": (lambda: gr.compare(THREE, gr.Hertz(1e7), t_end=0.1).effective_restitution(lambda: 0.0),
                   r"observable takes \(\): \(run\) is needed\."),
    "pressed": (lambda: gr.scenes.rows._pressed(THREE, lambda: gr.Hertz(1e7), 1.0, 0),
                r"law takes \(\): \(pair\) is needed\."),
}


@pytest.mark.parametrize("case", ARITIES)
def test_functions_of_other_arguments(case):
    act, sentence = ARITIES[case]
    with pytest.raises(TypeError, match=sentence):
        act()


def test_what_takes_anything_or_says_nothing_of_itself_is_let_through():
    seen = []
    run = gr.edmd.simulate(THREE, lambda *given: 0.5, t_end=0.5, on_event=seen.append, on_progress=lambda *so_far: 0)
    assert len(seen) == len(run.contacts) > 0
    assert gr.md.simulate(THREE, Own(force=lambda *given: 1e7 * given[0]), t_end=0.1).status.name == "time"


def test_mistakes_within_a_function_pass_through():
    with pytest.raises(TypeError, match="has no len"):
        gr.edmd.simulate(THREE, lambda speed, pair: len(3), t_end=0.5)
    with pytest.raises(TypeError, match="has no len"):
        gr.md.simulate(THREE, Own(force=lambda xi, xi_dot, pair: len(3)), t_end=0.5)

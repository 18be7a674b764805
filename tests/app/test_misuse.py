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
        lambda: scene(mass=[math.inf, True, 0.5]), r"`mass` must be an array of.*, got \[inf, True, 0\.5\]"),
    "numpy's truth is a mass": (
        lambda: scene(mass=[np.True_, 1.0, 1.0]),
        r"`mass` must be an array of numbers.*, got \[.*True.*, .*"),
    "truths are masses": (lambda: scene(mass=np.array([True] * 3)),
        r"`mass` must be an array of numbers.*, got array\(.*"),
    "truth is gravity": (lambda: scene(gravity=np.array(True)),
        r"`gravity` must be a single number, got array\(True\)"),
    "masses are words": (lambda: scene(mass=["1",
        "2", "3"]), r"`mass` must be an array of numbers.*, got \['1', '2', '3'\]"),
    "a mass is missing": (lambda: scene(mass=[1.0, None, 1.0]),
        r"`mass` must be an array of numbers.*, got \[1\.0, None, 1\.0\]"),
    "negative mass": (lambda: scene(mass=[math.inf, -2.0, 1.0]), r"`mass\[1\]` must be positive.*, got -2\.0"),
    "massless ball": (lambda: scene(mass=[math.inf, 0.0, 1.0]), r"`mass\[1\]` must be positive.*, got 0\.0"),
    "mass is nan": (lambda: scene(mass=[math.inf, math.nan, 1.0]), r"`mass\[1\]` must be positive.*, got nan"),
    "wall in the middle": (lambda: scene(mass=[1.0, math.inf, 1.0]),
        r"`mass\[1\]` must be finite, got inf\. Only the first and the last body can be walls\."),
    "walls only": (
        lambda: Scene([math.inf] * 2, [0, 0], [1], [0, 0]),
        r"`mass` must be finite for at least one body, got inf for every body\."),
    "one body": (lambda: Scene([1.0], [0.1], [], [0.0]),
        r"`mass` must be an array of at least 2 bodies, got 1\. A floor counts as a body \(mass inf\)\."),
    "mass is a word": (lambda: scene(mass="heavy"), r"`mass` must be an array of numbers, got 'heavy'"),
    "mass is a matrix": (lambda: scene(mass=np.ones((2, 2))),
        r"`mass` must be a one-dimensional array, got an array of shape \(2, 2\)"),
    "negative radius": (lambda: scene(radius=[0, -0.1, 0.2]), r"`radius\[1\]` must be finite and non.*, got -0\.1"),
    "thick wall": (lambda: scene(radius=[0.1, 0.1, 0.2]),
        r"`radius\[0\]` must be 0, got 0\.1\. A wall is flat and has radius 0\."),
    "too few radii": (lambda: scene(radius=[0, 0.1]),
        r"`radius` must be an array of shape \(3,\), got an array of shape \(2,\)"),
    "one gap per body": (
        lambda: scene(gap=[0.5, 0.1, 0.1]),
        r"`gap` must be an array of shape \(2,\), got an array of shape \(3,\)\. Give one gap per pair of "
        r"neighbours\."),
    "endless gap": (lambda: scene(gap=[0.5, math.inf]), r"`gap\[1\]` must be finite.*, got inf"),
    "velocity is nan": (lambda: scene(velocity=[0, 0, math.nan]), r"`velocity\[2\]` must be finite.*, got nan"),
    "gravity upwards": (lambda: scene(gravity=-9.81),
        r"`gravity` must be a finite number of at least 0, got -9\.81\. It always points downwards\."),
    "gravity as a vector": (lambda: scene(gravity=[0, -9.81]), r"`gravity` must be a single number, got \[0, -9\.81\]"),
    "positions fall": (
        lambda: Scene.from_positions([1, 1], [0, 0], [1, 0], [0, 0]),
        r"`position\[1\]` must be at least as large as the entry before it, got 0\.0\. Number the bodies from "
        r"bottom to top\."),
    "three radii": (lambda: scenes.three_balls((1, 1, 1)),
        r"`radii` must be an array of shape \(2,\), got an array of shape \(3,\)"),
    "ball in the floor": (lambda: scenes.three_balls(height=0.01), r"`height` must be .*at least 0\.1, got 0\.01"),
    "stack of nothing": (lambda: scenes.ball_stack(0), r"`n` must be an integer of at least 1, got 0"),
    "dropped and thrown": (
        lambda: scenes.ball_stack(height=1, speed=1),
        r"Only one of `height` and `speed` can be given, got 1 and 1\. A stack with a speed starts at the floor\."),
    "all balls arrive": (lambda: scenes.newtons_cradle(3, moving=3),
        r"`moving` must be an integer from 1 to 2, got 3\. At least one ball has to be at rest\."),
    "overfull gas": (lambda: scenes.gas(packing=1.5),
        r"`packing` must be a fraction of the length below 1, got 1\.5\."),
    "masked masses": (
        lambda: scene(mass=np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0])),
        r"`mass` must be an array without a mask, got masked_array\(data=\[1\.0, --, 3\.0\], mask=\[False, True, "
        r"Fals\.\.\.\. Leave out the masked entries\."),
    "complex masses": (lambda: scene(mass=np.array([1, 2, 1 + 1j])),
        r"`mass` must be an array of numbers, got array.*"),
    "velocity of dates": (
        lambda: scene(velocity=np.array(["2020"] * 3, "datetime64")),
        r"`velocity` must be an array of numbers, got array.*"),
    "a gap beyond the floats": (lambda: scene(gap=[0.5, 10**400]), r"`gap` must be an array of numbers, got .*"),
    "gravity beyond the floats": (lambda: scene(gravity=10**400), r"`gravity` must be a finite number.*, got 1000.*"),
    "gravity of 9000 digits": (lambda: scene(gravity=10**9000),
        r"`gravity` must be a finite number.*, got a number of .* digits"),
    "ball within a ball": (lambda: scenes.three_balls(gap=-1),
        r"`gap\[1\]` must be at least minus the sum of both radii, got -1\.0\. Deeper overlaps would exchange the "
        r"centres\."),
    "cradle turned over": (lambda: scenes.newtons_cradle(3, gap=-1),
        r"`gap\[0\]` must be at least minus the sum of both radii, got -1\.0\. Deeper overlaps would exchange the "
        r"centres\."),
    "seed beyond count": (lambda: scenes.gas(seed=2**70),
        r"`seed` must be an integer from 0 to 9223372036854775807, got 1180591620717411303424\."),
    "unknown speeds": (lambda: scenes.gas(speeds="maxwel"),
        r"`speeds` must be one of maxwell, uniform, two, got 'maxwel'\. Did you mean 'maxwell'\?"),
}

LAWS = {
    "restitution above 1": (
        lambda: laws.LinearDashpot.from_restitution(1.2, 1e6, PAIR),
        r"`restitution` must be a number in \(0, 1\], got 1\.2\."),
    "dashpot that sticks": (
        lambda: laws.LinearDashpot.from_restitution(0.0, 1e6, PAIR),
        r"`restitution` must be a number in \(0, 1\], got 0\.0\."),
    "dashpot of no pair": (
        lambda: laws.LinearDashpot.from_restitution(0.7, k=5e7, pair=0),
        r"`pair` must be a Pair, such as scene\.pairs\[0\], got 0\."),
    "viscoelastic law of no pair": (
        lambda: laws.ViscoelasticHertz.from_restitution(0.7, 1.0, 5e7, None),
            r"`pair` must be a Pair, such as scene\.pairs\[0\], got None\."),
    "material of no pair": (lambda: laws.Hertz.from_material(1e9, 0.3, None),
        r"`pair` must be a Pair, such as scene\.pairs\[0\], got None\."),
    "rule of no pair": (
        lambda: rules.ThorntonRestitution.from_material(1e9, 0.3, 1e6, 1),
            r"`pair` must be a Pair, such as scene\.pairs\[0\], got 1\."),
    "collision of no pair": (lambda: binary.collision(SOFT, 0, 1.0),
        r"`pair` must be a Pair, such as scene\.pairs\[0\], got 0\."),
    "collision of no law": (
        lambda: binary.collision([1, 2], PAIR, 1.0), r"`law` must be an object with force\(self, xi.*, got \[1, 2\]"),
    "restoring stiffness": (
        lambda: laws.LinearDashpot.from_restitution(0.7, k=-1, pair=PAIR),
            r"`k` must be a finite number above 0.*, got -1"),
    "stiffness in words": (
        lambda: laws.ViscoelasticHertz.from_restitution(0.7, 1.0,
            "1e7", PAIR), r"`k` must be a single number.*, got '1e7'"),
    "plastic stiffness in words": (
        lambda: laws.WaltonBraun.from_restitution(0.7, "1e7"), r"`k_load` must be a single number, got '1e7'"),
    "weightless pair": (lambda: Pair(0.0, 1.0, 0), r"`m_eff` must be a finite number above 0, got 0\.0"),
    "restitution at rest": (lambda: binary.restitution(SOFT, PAIR, 0.0), r"`speed` must be .*above 0, got 0\.0"),
    "restitution of parting balls": (lambda: binary.restitution(SOFT, PAIR, -1), r"`speed` must be .*above 0, got -1"),
    "restitution of some parting balls": (
        lambda: binary.restitution(SOFT, PAIR, [1.0, -1.0]), r"`speed` must be .*above 0, got .*-1\.0.*"),
    "restitution at nan": (lambda: binary.restitution(SOFT, PAIR, math.nan), r"`speed` must be .*above 0, got nan"),
    "collision slower than numbers": (
        lambda: binary.collision(laws.ViscoelasticHertz(1e9, 1e3), PAIR, 1e-300),
        "`speed` must lead to a contact within the range of floating-point numbers, got 1e-300: its overlap, "
        r"force or duration exceeds it\. Use SI units\."),
    "collision faster than numbers": (
        lambda: binary.collision(laws.Hertz(1e9), PAIR, 1e300),
            r"`speed` must lead to a contact within the range of floating-point numbers, got 1e\+300: its overlap, "
            r"force or duration exceeds it\. Use SI units\."),
    "no stiffness": (lambda: laws.Hertz(0.0), r"`k` must be a finite number above 0, got 0\.0"),
    "driving dashpot": (lambda: laws.LinearDashpot(1e6, -1.0), r"`gamma` must be .*at least 0, got -1\.0"),
    "stiffness is nan": (lambda: laws.TsujiHertz(math.nan, 0.1), r"`k` must be a finite number above 0, got nan"),
    "too soft a power": (lambda: laws.PowerLaw(1.0, 0.5), r"`exponent` must be .*at least 1, got 0\.5"),
    "softer unloading": (
        lambda: laws.WaltonBraun(2.0, 1.0),
        r"`k_unload` must be .*at least 2, got 1\.0\. Unloading must"),
    "Poisson's ratio 0.6": (
        lambda: laws.Hertz.from_material(1e9, 0.6, PAIR),
        r"`poisson` must be a number in \[0, 0\.5\], got 0\.6\."),
    "rule above 1": (lambda: rules.ConstantRestitution(1.2),
        r"`restitution` must be a number in \[0, 1\], got 1\.2\. 1 is elastic, 0 sticks\."),
    "rule is a word": (lambda: rules.ConstantRestitution("hard"), r"`restitution` must be a single number, got 'hard'"),
    "rule of nothing": (lambda: rules.ConstantRestitution([]),
        r"`restitution` must be one number for all pairs, or one per pair, got an empty array\."),
    "rule of words": (lambda: rules.ConstantRestitution(["1"]),
        r"`restitution` must be an array of numbers.*, got \['1'\]"),
    "table that falls back": (
        lambda: rules.TabulatedRestitution([0, 2, 1], [1, 1, 1]),
        r"`speed\[2\]` must be larger than the entry before it, got 1\.0\."),
    "table of one": (lambda: rules.TabulatedRestitution([1], [1]),
        r"`speed` must be an array of at least 2 entries, got 1\."),
    "standing collision": (lambda: binary.collision(SOFT, PAIR, 0.0), r"`speed` must be .*above 0, got 0\.0"),
    "separating balls": (lambda: theory.effective_restitution(-1, 3), r"`v_rel_after` must be .*at least 0, got -1"),
}

BEYOND = np.broadcast_to(0.1, 10**13)
"""More than any memory holds, made of one number."""

RUNS = {
    "md rows beyond memory": (lambda: soft(samples=1e12),
        r"`samples` must be an integer from 2 to 10000000, got 1000000000000\.0\. Give None for the first and the "
        r"last state\."),
    "edmd rows beyond memory": (lambda: hard(samples=10**30),
        r"`samples` must be an integer from 2 to 10000000, got 1000000000000000000000000000000\. Give None for the "
        r"first and the last state\."),
    "times beyond memory": (
        lambda: soft(samples=BEYOND),
        r"`samples` must be an array that fits into memory.*, got an array of shape \(1000.*"),
    "gaps beyond memory": (lambda: scene(gap=BEYOND),
        r"`gap` must be an array that fits into memory.*, got an array of shape \(1000.*"),
    "log is a word": (lambda: soft(log="no"),
        r"`log` must be True, False or the name of a file that ends in \.npy.*, got 'no'"),
    "log is a number": (lambda: hard(log=1), r"`log` must be True or False, got 1"),
    "tolerance of a fixed step": (
        lambda: soft(tol=1e-3, method="verlet"),
            r"`tol` must be left out for method 'verlet', which has a fixed step, got 0\.001\. Give `dt`, or use "
            r"method='located'\."),
    "clock beyond the floats": (
        lambda: soft(t_start=-1e308, t_end=1e308),
        r"`t_end` must be less than 1\.8e\+308 s after the start of the run, -1e\+308 s, got "
        r"1e\+308\."),
    "steps beyond the floats": (
        lambda: soft(t_end=1e308, dt=1e-6),
            r"`dt` must be large enough that the steps can be counted, got 1e-06: the run reaches step inf\. Use a "
            r"larger dt, or method='located'\."),
    "flight of too many steps": (
        lambda: soft(t_end=None, until=until.contact(0), dt=1e-60),
            "`dt` must be large enough that the steps can be counted, got 1e-60: the run reaches step "
            r"3\.19e\+59\. Use a larger dt, or method='located'\."),
    "law without force": (
        lambda: soft(STACK, Forceless()),
        r"The law of pair floor–1 must be an object with force\(self, xi, xi_dot, pair\), got Forceless\(k=1\.0\)\. "
        r"For hard spheres use granular\.edmd\."),
    "law is a class": (
        lambda: soft(STACK, laws.Hertz),
        r"The law of pair floor–1 must be an instance, such as Hertz\(k=\.\.\.\), got the class Hertz\."),
    "md calls a number": (lambda: soft(on_event=3), r"`on_event` must be a function or None, got 3"),
    "edmd calls a number": (lambda: hard(on_progress=3), r"`on_progress` must be a function or None, got 3"),
    "md without rows": (lambda: soft(samples=[]),
        r"`samples` must have at least one time, got an empty array\. Give None for the first and the last "
        r"state\."),
    "edmd without rows": (lambda: hard(samples=[]),
        r"`samples` must have at least one time, got an empty array\. Give None for the first and the last "
        r"state\."),
    "law is a number": (lambda: soft(STACK, 5e7),
        r"The law of pair floor–1 must be an object with force\(self, xi, xi_dot, pair\), got 50000000\.0\. For hard "
        r"spheres use granular\.edmd\."),
    "law that contradicts itself": (
        lambda: soft(STACK, Contradiction()),
        r"The law of pair floor–1, Contradiction\(k=1\.0\), must have a force that agrees with its linear or power "
        r"trait, got force\(0\.25, 0\.5\) = 0\.25 and 0\.5 by the trait\. Fix the trait or leave it out\."),
    "contacts beyond count": (
        lambda: soft(max_events=10**400), r"`max_events` must be an integer from 0 to 922.*, got 1000.*"),
    "steps beyond count": (lambda: soft(max_steps=10**30),
        r"`max_steps` must be an integer from 1 to 9223372036854775807, got 1000000000000000000000000000000\."),
    "finer than rounding": (
        lambda: soft(tol=1e-300), r"`tol` must be a number in \[1e-17, 0\.001\].*, got 1e-300"),
    "mass beyond the floats": (
        lambda: soft(Scene([1e-320, 1.0], [0.1, 0.1], [1e-3], [1.0, 0.0]), SOFT, t_end=1.0),
        "`law` must lead to contacts within the range of floating-point numbers, got "
        r"LinearDashpot\(k=50000000\.0, gamma=100\.0\), …: their rates or overlaps in this scene exceed it \(the "
        r"inverse of a mass\)\. Give coefficients, masses and speeds in SI units\."),
    "too few laws": (lambda: soft(STACK, [SOFT]), r"The length of `law` must be 2 \(the number of pairs\), got 1"),
    "unknown method": (lambda: soft(method="verlett"),
        r"`method` must be one of located, verlet, symplectic-euler, rk4, gear5, got 'verlett'\. Did you mean "
        r"'verlet'\?"),
    "no time step": (lambda: soft(dt=0.0), r"`dt` must be a finite number of at least 1e-60.*, got 0\.0"),
    "md into the past": (lambda: soft(t_end=-1.0), r"`t_end` must be .*at least 0, got -1\.0"),
    "md of a word": (lambda: soft("three-balls", SOFT),
        r"`scene` must be a granular\.Scene, such as granular\.scenes\.three_balls\(\), got 'three-balls'\."),
    "md until no pair": (lambda: soft(until=until.contact(7)),
        r"`pair` of until\.contact must be an integer from 0 to 1, got 7\. The lowest pair is 0\."),
    "until is a word": (lambda: soft(until="separated"),
        r"`until` must be a condition from granular\.until.*, got 'separated'"),
    "md samples outside": (lambda: soft(samples=[0.0, 0.5]), r"`samples\[1\]` must be .*, got 0\.5"),
    "zeroth contact": (lambda: until.contact(0, nth=0), r"`nth` must be an integer of at least 1, got 0"),
    "overlap in edmd": (lambda: hard(OVERLAP, HARD), r"`gap\[0\]` must be .*, got -0\.01"),
    "rule is a bare number": (
        lambda: hard(STACK, 0.7),
        r"`rule` must be a function of \(speed, pair\), got 0\.7\. Use granular\.ConstantRestitution\(0\.7\)\."),
    "law as a rule": (lambda: hard(STACK, SOFT), r"`rule` must be a function of \(speed, pair\), got LinearDashpot.*"),
    "rule out of range": (
        lambda: hard(STACK, lambda v, p: 1.5, t_end=1.0),
        r"The restitution rule of pair floor–1 must return a number in \[0, 1\], got 1\.5 at an approach speed of "
        r"3\.13209 m/s\."),
    "too few restitutions": (
        lambda: hard(STACK, rules.ConstantRestitution([0.7])),
        r"The length of `restitution` must be 2 \(the.*, got 1"),
    "edmd until no pair": (lambda: hard(until=until.contact(7)),
        r"`pair` of until\.contact must be an integer from 0 to 1, got 7\. The lowest pair is 0\."),
    "edmd into the past": (lambda: hard(t_end=-1.0), r"`t_end` must be .*, got -1\.0"),
    "edmd samples outside": (lambda: hard(samples=[0.0, 0.5]), r"`samples\[1\]` must be .*, got 0\.5"),
    "unknown tie rule": (lambda: hard(ties="lefft"),
        r"`ties` must be one of left, right, random, newton, poisson, reflect, got 'lefft'\. Did you mean "
        r"'left'\?"),
    "unknown remedy": (lambda: hard(collapse="stopp"), r"`collapse` must be .*, got 'stopp'"),
    "unknown engine": (lambda: hard(engine="fast"), r"`engine` must be one of .*, got 'fast'"),
    "overlap in compare": (lambda: compare(OVERLAP, SOFT, t_end=1.0), r"`gap\[0\]` must be .*, got -0\.01"),
    "compare of no scene": (lambda: compare(None, SOFT),
        r"`scene` must be a granular\.Scene, such as granular\.scenes\.three_balls\(\), got None\."),
    "compare without force": (lambda: compare(STACK, Forceless(), t_end=1.0),
        r"The law of pair floor–1 must be an object with force\(self, xi, xi_dot, pair\), got Forceless\(k=1\.0\)\. "
        r"For hard spheres use granular\.edmd\."),
    "compare into the past": (lambda: compare(STACK, SOFT, t_end=-1.0), r"`t_end` must be .*, got -1\.0"),
    "unknown case": (lambda: cases.make("three-bals"),
        r"`scene` must be a known name, got 'three-bals'\. Did you mean 'three-balls'\?"),
    "unknown option": (lambda: cases.make("gas", sead=1), r"gas has no option `sead`; did you mean `seed`\?"),
    "option of the other engine": (lambda: cases.make("gas").simulate("edmd", dt=1),
        r"edmd\.simulate has no option `dt`; available: collapse, elastic_below, engine, log, max_events, "
        r"merge_below, on_event, on_progress, progress, samples, seed, t_end, t_start, tc, ties, until, watch\."),
}


@pytest.mark.parametrize("name", [
    name for name in scenes.__all__ if "n" in signature(getattr(scenes, name)).parameters])
@pytest.mark.parametrize(("n", "sentence"), [
    (10**9, "`n` must be an integer from . to 10000000, got 1000000000"),
    (1e12, r"`n` must be an integer from . to 10000000, got 1000000000000\.0"),
    (10**400, "`n` must be an integer from . to 10000000, got 1000"), (0, "`n` must be an integer.*, got 0"),
    (-3, "`n` must be an integer.*, got -3"), (2.5, "`n` must be an integer.*, got 2.5"),
    (True, "`n` must be a single.*, got True"), ("5", r"`n` must be a single number, got '5'\."),
])
def test_a_ready_made_scene_says_how_many_balls_it_may_have(name, n, sentence):
    law = {"law": None} if name == "compressed_chain" else {}
    with pytest.raises((ValueError, TypeError), match=sentence):
        getattr(scenes, name)(n=n, **law)


@pytest.mark.parametrize("method", ["verlet", "symplectic-euler", "rk4", "gear5"])
@pytest.mark.parametrize("scene_", [STACK, OVERLAP])
@pytest.mark.parametrize("end", [{"t_end": 1.0}, {"t_end": None, "until": until.separated()}])
def test_a_step_too_short_for_numbers_is_one_sentence(method, scene_, end):
    with pytest.raises(ValueError, match="`dt` must be a finite number of at least 1e-60, got 1e-320"):
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
NEEDED = r"must be a function with the arguments \(xi, xi_dot, pair\), got"
HINT = r"\. With xi_max, set memory = True\."
ARITIES = {
    "force": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, xi_dot: 1.0)),
              rf"`force` of the law of pair floor–1 {NEEDED} \(xi, xi_dot\){HINT}"),
    "order": (lambda: gr.compare(THREE, Own(force=lambda pair, xi, xi_dot: 1.0), t_end=1.0),
              rf"`force` of the law of pair floor–1 {NEEDED} \(pair, xi, xi_dot\){HINT}"),
    "no memory": (lambda: gr.binary.restitution(Own(force=lambda xi, v, p, top: 1.0), THREE.pairs[0], 1.0),
                  rf"`force` of `law` {NEEDED} \(xi, v, p, top\){HINT}"),
    "memory": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, v, p: 1.0, memory=True)),
               r"`force` of the law of pair floor–1 must be a function with the arguments \(xi, xi_dot, pair, "
               r"xi_max\), got \(xi, v, p\)\. Without xi_max, leave `memory` out\."),
    "trait": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, v, p: xi, linear=lambda: (1.0, 0.0))),
              r"`linear` of the law of pair floor–1 must be a function with the argument \(pair\), got \(\)\."),
    "watch": (lambda: gr.edmd.simulate(THREE, RULE, t_end=0.1, watch=Own(force=lambda xi: 1.0)),
              rf"`force` of `watch` {NEEDED} \(xi\){HINT}"),
    "rule": (lambda: gr.edmd.simulate(THREE, lambda v: 0.5, t_end=0.1),
             r"`rule` must be a function with the arguments \(speed, pair\), got \(v\)"),
    "class": (lambda: gr.edmd.simulate(THREE, gr.ConstantRestitution, t_end=0.1),
              r"`rule` must be a function with the arguments \(speed, pair\), got \(restitution\)"),
    "on_event": (lambda: gr.edmd.simulate(THREE, RULE, t_end=0.1, on_event=lambda: 0),
                 r"`on_event` must be a function with the argument \(row\), got \(\)"),
    "keyword": (lambda: gr.md.simulate(THREE, gr.Hertz(1e7), t_end=0.1, on_event=lambda row, *, more: 0),
                r"`on_event` must be a function with the argument \(row\), got \(row, \*, more\)"),
    "motion": (lambda: gr.walls.Motion(lambda: 0.0),
        r"`function` must be a function with the argument \(t\), got \(\)"),
    "result": (lambda: gr.sweep("three-balls", {"gap": [1e-3]}, results=[lambda: 0.0]),
               r"`results` must be a function with the argument \(case\), got \(\)"),
    "observable": (lambda: gr.compare(THREE, gr.Hertz(1e7), t_end=0.1).effective_restitution(lambda: 0.0),
                   r"`observable` must be a function with the argument \(run\), got \(\)"),
    "pressed": (lambda: gr.scenes.rows._pressed(THREE, lambda: gr.Hertz(1e7), 1.0, 0),
                r"`law` must be a function with the argument \(pair\), got \(\)"),
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

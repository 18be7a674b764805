"""Every kind of misuse of the public face ends in one clear sentence: the name, the value got, what is needed."""

import math
from inspect import signature

import numpy as np
import pytest

from granular import binary, laws, scenes, theory
from granular.laws import rules
from granular.scene import Pair, Scene
from tests.helpers.misused import PAIR, SOFT, check_sentence, scene

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


@pytest.mark.parametrize(("call", "sentence"), [
    pytest.param(*row, id=name) for table in (SCENES, LAWS) for name, row in table.items()])
def test_misuse_is_one_clear_sentence(call, sentence):
    check_sentence(call, sentence)

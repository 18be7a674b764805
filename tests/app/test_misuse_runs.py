"""Misuse of the runs and of functions beside them ends in one clear sentence."""

import numpy as np
import pytest

from granular import cases, laws, until
from granular.comparison import compare
from granular.laws import rules
from granular.scene import Scene
from tests.helpers.misused import (
    HARD,
    OVERLAP,
    SOFT,
    STACK,
    Contradiction,
    Forceless,
    check_sentence,
    hard,
    scene,
    soft,
)

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


@pytest.mark.parametrize(("call", "sentence"), [
    pytest.param(*row, id=name) for name, row in RUNS.items()])
def test_misuse_is_one_clear_sentence(call, sentence):
    check_sentence(call, sentence)


@pytest.mark.parametrize("method", ["verlet", "symplectic-euler", "rk4", "gear5"])
@pytest.mark.parametrize("scene_", [STACK, OVERLAP])
@pytest.mark.parametrize("end", [{"t_end": 1.0}, {"t_end": None, "until": until.separated()}])
def test_a_step_too_short_for_numbers_is_one_sentence(method, scene_, end):
    with pytest.raises(ValueError, match="`dt` must be a finite number of at least 1e-60, got 1e-320"):
        soft(scene_, SOFT, method=method, dt=1e-320, **end)


def test_a_user_s_own_exception_passes_through_unwrapped():
    class Own(Exception):
        pass

    def raising(speed, pair):
        raise Own("mine")

    with pytest.raises(Own, match="mine"):
        hard(STACK, raising, t_end=1.0)

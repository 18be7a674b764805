"""Misuse ends in one sentence."""

import math

import numpy as np
import pytest

from granular import edmd, until
from granular.laws.rules import ConstantRestitution
from granular.scene import Scene

pytestmark = pytest.mark.core
SCENE = Scene([math.inf, 1.0, 2.0], [0.0, 0.1, 0.1], [1.0, 0.5], [0.0, 0.0, -1.0], gravity=9.81)
RULE = ConstantRestitution(0.5)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"t_end": -1.0}, "t_end is -1.0: a finite number of at least 0 is needed; t_start is the earliest"),
        ({"t_end": math.nan}, "t_end is nan"),
        ({"t_end": math.inf}, "t_end is inf"),
        ({"t_start": math.inf}, "t_start is inf"),
        ({"samples": 1, "t_end": 1.0}, "samples is 1: a whole number of at least 2"),
        ({"samples": [0.5, 2.0], "t_end": 1.0}, r"samples\[1\] is 2.0: a time from 0 to 1 s is needed"),
        ({"samples": [0.5, 0.2], "t_end": 1.0}, r"samples\[0\] is 0.2: times must not decrease"),
        ({"samples": [], "t_end": 1.0}, "samples is empty: at least one time is needed"),
        ({"max_events": -1}, "max_events is -1: a whole number of at least 0"),
        ({"max_events": 10**400}, "max_events is 1000+...: a whole number of at least 0 and at most"),
        ({"max_events": 1.5}, "max_events is 1.5"),
        ({"engine": "fast"}, "engine is 'fast': one of auto, sorted, compiled is needed"),
        ({"ties": "lft"}, "ties is 'lft': .* did you mean left"),
        ({"seed": -1}, "seed is -1"),
        ({"collapse": "ignore"}, "collapse is 'ignore': one of stop, merge is needed"),
        ({"merge_below": 0.1}, "merge_below is 0.1: it needs collapse='merge'"),
        ({"merge_below": 0.0, "collapse": "merge"}, "merge_below is 0.0: a finite number above 0"),
        ({"tc": -1.0}, "tc is -1.0"),
        ({"elastic_below": -1.0}, "elastic_below is -1.0"),
        ({"tc": 0.1, "elastic_below": 0.1}, "tc and elastic_below are given together: one remedy at a time"),
        ({"until": until.contact(5)}, "pair of until.contact is 5"),
    ],
)
def test_options_that_do_not_fit(options, sentence) -> None:
    with pytest.raises(ValueError, match=sentence):
        edmd.simulate(SCENE, RULE, **options)


@pytest.mark.parametrize(
    ("scene", "rule", "options", "sentence"),
    [
        ("three-balls", RULE, {}, "scene is .three-balls.: a granular.Scene is needed, such as"),
        (SCENE, 0.5, {}, "rule is 0.5: a callable"),
        (SCENE, RULE, {"until": 3.0}, "until is 3.0: a condition from granular.until is needed"),
        (SCENE, RULE, {"t_end": "late"}, "t_end is 'late': a single number is needed"),
        (SCENE, RULE, {"samples": ["a"], "t_end": 1.0}, "samples is"),
        (SCENE, RULE, {"tc": None}, "tc is None"),
    ],
)
def test_kinds_that_do_not_fit(scene, rule, options, sentence) -> None:
    with pytest.raises(TypeError, match=sentence):
        edmd.simulate(scene, rule, **options)


def test_hard_spheres_cannot_overlap() -> None:
    scene = SCENE.replace(gap=[1.0, -1e-9])
    with pytest.raises(ValueError, match=r"gap\[1\] is -1e-09: a gap must not be negative; hard"):
        edmd.simulate(scene, RULE)


@pytest.mark.exact
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"velocity": [0.0, 1e308, -1e308]}, r"velocity\[1\] is 1e\+308: 0 or a size from 1e-75 to 1e\+75 is"),
        ({"velocity": [0.0, 0.0, -5e-324]}, r"velocity\[2\] is -5e-324: 0 or a size from 1e-75"),
        ({"gap": [1e300, 1.0]}, r"gap\[0\] is 1e\+300"),
        ({"mass": [math.inf, 1e-300, 1e300]}, r"mass\[2\] is 1e\+300"),
        ({"gravity": 1e-320}, r"gravity\[0\] is 1e-320"),
    ],
)
def test_numbers_whose_squares_are_none(change, sentence) -> None:
    with pytest.raises(ValueError, match=sentence):
        edmd.simulate(SCENE.replace(**change), RULE)


@pytest.mark.parametrize("v", [1e75, 1e-75])
@pytest.mark.parametrize("gravity", [0.0, 1e75, 1e-75])
def test_the_largest_and_the_smallest_numbers_run(v, gravity) -> None:
    scene = Scene([math.inf, 1e-75, 1e75], [0.0] * 3, [1e75, 1e-300], [0.0, v, -v], gravity)
    for eps in (1.0, 0.5):
        end = edmd.simulate(scene, ConstantRestitution(eps), max_events=300)
        for values in (end.velocity, end.gap, end.position, end.time):
            assert np.isfinite(values).all()
        assert (end.gap >= 0.0).all()
        assert (np.diff(end.contacts["t_begin"]) >= 0.0).all()


def test_sticking_for_some_pairs_only_is_refused() -> None:
    with pytest.raises(ValueError, match=r"restitution of pair 1 is 0.0 but not of all pairs"):
        edmd.simulate(SCENE, ConstantRestitution([0.5, 0.0]))


def test_a_rule_that_leaves_its_range_is_named_when_it_happens() -> None:
    with pytest.raises(ValueError, match=r"the rule of pair 0 returned 1.2 at impact speed"):
        edmd.simulate(SCENE, [lambda v, p: 1.2, RULE])


def test_a_warning_free_run_of_everything_at_rest() -> None:
    still = Scene([1.0, 1.0], [0.0, 0.0], [0.0], [0.0, 0.0])
    run = edmd.simulate(still, RULE, t_end=1.0, samples=3)
    assert run.position.tolist() == [[0.0, 0.0]] * 3
    assert np.isfinite(run.energy()).all()
    assert "no collision can follow" in run.message

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
        ({"t_end": -1.0}, r"`t_end` must be a finite number of at least 0, got -1\.0\. The run starts there\."),
        ({"t_end": math.nan}, r"`t_end` must be a finite number, got nan\."),
        ({"t_end": math.inf}, r"`t_end` must be a finite number, got inf\."),
        ({"t_start": math.inf}, r"`t_start` must be a finite number, got inf\."),
        ({"samples": 1, "t_end": 1.0}, "`samples` must be an integer of at least 2.*, got 1"),
        ({"samples": [0.5, 2.0], "t_end": 1.0}, r"`samples\[1\]` must be a time in \[0, 1\] s, got 2\.0\."),
        ({"samples": [0.5, 0.2], "t_end": 1.0},
            r"`samples\[1\]` must be at least as large as the entry before it, got 0\.2\. Sort the times\."),
        ({"samples": [], "t_end": 1.0},
            r"`samples` must have at least one time, got an empty array\. Give None for the first and the last "
            r"state\."),
        ({"max_events": -1}, "`max_events` must be an integer of at least 0.*, got -1"),
        ({"max_events": 10**400}, r"`max_events` must be an integer from 0 to 9223372036854775807, got 1000.*\."),
        ({"max_events": 1.5}, r"`max_events` must be an integer of at least 0, got 1\.5\."),
        ({"engine": "fast"}, "`engine` must be one of auto, sorted, compiled, got 'fast'"),
        ({"ties": "lft"},
            r"`ties` must be one of left, right, random, newton, poisson, reflect, got 'lft'\. Did you mean "
            r"'left'\?"),
        ({"seed": -1}, r"`seed` must be an integer of at least 0, got -1\."),
        ({"collapse": "ignore"}, "`collapse` must be one of stop, merge, got 'ignore'"),
        ({"merge_below": 0.1}, r"`merge_below` must be None unless collapse='merge', got 0\.1\."),
        ({"merge_below": 0.0, "collapse": "merge"}, "`merge_below` must be a finite number above 0.*, got 0.0"),
        ({"tc": -1.0}, r"`tc` must be a finite number of at least 0, got -1\.0\."),
        ({"elastic_below": -1.0}, r"`elastic_below` must be a finite number of at least 0, got -1\.0\."),
        ({"tc": 0.1, "elastic_below": 0.1},
            r"Only one remedy for an inelastic collapse can be given, got tc and elastic_below\."),
        ({"until": until.contact(5)},
            r"`pair` of until\.contact must be an integer from 0 to 1, got 5\. The lowest pair is 0\."),
    ],
)
def test_options_that_do_not_fit(options, sentence) -> None:
    with pytest.raises(ValueError, match=sentence):
        edmd.simulate(SCENE, RULE, **options)


@pytest.mark.parametrize(
    ("scene", "rule", "options", "sentence"),
    [
        ("three-balls", RULE, {},
            r"`scene` must be a granular\.Scene, such as granular\.scenes\.three_balls\(\), got 'three-balls'\."),
        (SCENE, 0.5, {},
            r"`rule` must be a function of \(speed, pair\), got 0\.5\. Use "
            r"granular\.ConstantRestitution\(0\.5\)\."),
        (SCENE, RULE, {"until": 3.0},
            r"`until` must be a condition from granular\.until, such as until\.contact\(0, 2\), got 3\.0\."),
        (SCENE, RULE, {"t_end": "late"}, "`t_end` must be a single number, got 'late'"),
        (SCENE, RULE, {"samples": ["a"], "t_end": 1.0}, r"`samples` must be an array of numbers, got \['a'\]\."),
        (SCENE, RULE, {"tc": None}, r"`tc` must be a single number, got None\."),
    ],
)
def test_kinds_that_do_not_fit(scene, rule, options, sentence) -> None:
    with pytest.raises(TypeError, match=sentence):
        edmd.simulate(scene, rule, **options)


def test_hard_spheres_cannot_overlap() -> None:
    scene = SCENE.replace(gap=[1.0, -1e-9])
    with pytest.raises(ValueError, match=r"`gap\[1\]` must be non-negative, got -1e-09\. Hard spheres cannot "
                                         r"overlap\. Set the gap to 0, or use granular\.md\."):
        edmd.simulate(scene, RULE)


@pytest.mark.exact
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"velocity": [0.0, 1e308, -1e308]},
            r"`velocity\[1\]` must be 0 or a number of magnitude 1e-75 to 1e\+75, got 1e\+308\. "
            r"Check that it is in SI units\."),
        ({"velocity": [0.0, 0.0, -5e-324]},
            r"`velocity\[2\]` must be 0 or a number of magnitude 1e-75 to 1e\+75, got -5e-324\. "
            r"Check that it is in SI units\."),
        ({"gap": [1e300, 1.0]},
            r"`gap\[0\]` must be a number of at most 1e\+75, got 1e\+300\. "
            r"Check that it is in SI units\."),
        ({"mass": [math.inf, 1e-300, 1e300]},
            r"`mass\[2\]` must be a number of at most 1e\+75, got 1e\+300\. "
            r"Check that it is in SI units\."),
        ({"gravity": 1e-320},
            r"`gravity` must be 0 or a number of magnitude 1e-75 to 1e\+75, got 1e-320\. "
            r"Check that it is in SI units\."),
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
    with pytest.raises(ValueError, match="The restitution must be 0 for all pairs or for none, got 0 only for "
                                         r"some \(pair 1–2\)\. 0 makes balls stick; use a small number, such as "
                                         r"0\.01\."):
        edmd.simulate(SCENE, ConstantRestitution([0.5, 0.0]))


def test_a_rule_that_leaves_its_range_is_named_when_it_happens() -> None:
    with pytest.raises(ValueError, match=r"The restitution rule of pair floor–1 must return a number in \[0, 1\], got "
                                         r"1\.2 at an approach speed of 4\.42945 m/s\."):
        edmd.simulate(SCENE, [lambda v, p: 1.2, RULE])


def test_a_warning_free_run_of_everything_at_rest() -> None:
    still = Scene([1.0, 1.0], [0.0, 0.0], [0.0], [0.0, 0.0])
    run = edmd.simulate(still, RULE, t_end=1.0, samples=3)
    assert run.position.tolist() == [[0.0, 0.0]] * 3
    assert np.isfinite(run.energy()).all()
    assert "no further collision is possible" in run.message

"""Collision rules: numbers, tables, callables, and what is said of those that do not fit."""

import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

import granular as gr
from granular.laws import rules
from granular.laws.rules import ConstantRestitution, TabulatedRestitution
from granular.scene import Pair, Scene

pytestmark = pytest.mark.core
PAIRS = Scene([math.inf, 1.0, 2.0], [0.0, 0.1, 0.1], [1.0, 1.0], [0.0, 0.0, 0.0]).pairs


def test_one_number_for_all_pairs() -> None:
    rule = ConstantRestitution(0.7)
    assert [rule(speed, pair) for speed in (0.0, 3.0) for pair in PAIRS] == [0.7] * 4


def test_one_number_per_pair() -> None:
    rule = ConstantRestitution([0.7, 1.0])
    assert [rule(1.0, pair) for pair in PAIRS] == [0.7, 1.0]
    assert rules.constants((rule, rule), PAIRS) == [0.7, 1.0]


def test_a_table_is_linear_inside_and_holds_its_ends() -> None:
    rule = TabulatedRestitution([1.0, 2.0, 4.0], [0.9, 0.8, 0.4])
    speed = np.array([0.0, 1.0, 1.25, 2.0, 3.0, 4.0, 9.0])
    got = [rule(v, PAIRS[0]) for v in speed.tolist()]
    np.testing.assert_allclose(got, np.interp(speed, [1.0, 2.0, 4.0], [0.9, 0.8, 0.4]), rtol=1e-15)


def test_rules_are_frozen_and_constants_compare() -> None:
    assert ConstantRestitution(0.5) == ConstantRestitution(0.5)
    with pytest.raises(FrozenInstanceError):
        ConstantRestitution(0.5).restitution = 1.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: ConstantRestitution(1.2), "restitution is 1.2: a finite number of at least 0 and at most 1 is needed"),
        (lambda: ConstantRestitution(-0.1), "restitution is -0.1"),
        (lambda: ConstantRestitution(math.nan), "restitution is nan"),
        (lambda: ConstantRestitution([0.5, 2.0]), r"restitution\[1\] is 2.0: a number in \[0, 1\] is needed"),
        (lambda: TabulatedRestitution([1.0], [0.5]), "speed has 1 entries: at least 2 are needed"),
        (lambda: TabulatedRestitution([1.0, 1.0], [0.5, 0.5]), r"speed\[0\] is 1.0: speed must increase"),
        (lambda: TabulatedRestitution([-1.0, 1.0], [0.5, 0.5]), r"speed\[0\] is -1.0: a speed must be finite"),
        (lambda: TabulatedRestitution([0.0, 1.0], [0.5, 1.5]), r"restitution\[1\] is 1.5"),
        (lambda: TabulatedRestitution([0.0, 1.0], [0.5]), "shape of restitution"),
        (lambda: rules.checked([ConstantRestitution(1.0)], PAIRS), "length of rule is 1: 2"),
        (lambda: rules.checked(ConstantRestitution([1.0]), PAIRS), "length of restitution is 1: 2"),
        (lambda: rules.restitution_at(lambda v, p: 1.5, 2.0, PAIRS[1]), "the rule of pair 1 returned 1.5 at"),
        (lambda: rules.restitution_at(lambda v, p: math.nan, 2.0, PAIRS[0]), "the rule of pair 0 returned nan"),
    ],
)
def test_values_that_do_not_fit_raise_a_sentence(make, sentence) -> None:
    with pytest.raises(ValueError, match=sentence):
        make()


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: ConstantRestitution("0.7"), "restitution is '0.7': a single number is needed"),
        (lambda: ConstantRestitution(None), "restitution is None"),
        (lambda: rules.checked(0.7, PAIRS), r"rule is 0.7: a callable .* write granular.ConstantRestitution\(0.7\)"),
        (lambda: rules.checked("elastic", PAIRS), "rule is 'elastic': a callable"),
    ],
)
def test_kinds_that_do_not_fit_raise_a_sentence(make, sentence) -> None:
    with pytest.raises(TypeError, match=sentence):
        make()


def test_a_users_own_error_passes_unchanged() -> None:
    def rule(speed: float, pair: Pair) -> float:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        rules.restitution_at(rule, 1.0, PAIRS[0])


def test_a_text_is_no_coefficient():
    scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [1.0], [1.0, 0.0])
    with pytest.raises(ValueError, match=r"the rule of pair 0 returned '0\.8' at impact speed 1 m/s"):
        gr.edmd.simulate(scene, lambda speed, pair: "0.8")
    with pytest.raises(TypeError, match=r"rule takes \(speed, \*, pair\): \(speed, pair\) is needed"):
        gr.edmd.simulate(scene, lambda speed, *, pair: 0.8)

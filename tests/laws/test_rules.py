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
        (lambda: ConstantRestitution(1.2), r"`restitution` must be a number in \[0, 1\], got 1\.2\. 1 is elastic, 0 "
                                           r"sticks\."),
        (lambda: ConstantRestitution(-0.1), r"`restitution` must be a number in \[0, 1\], got -0\.1"),
        (lambda: ConstantRestitution(math.nan), r"`restitution` must be a number in \[0, 1\], got nan"),
        (lambda: ConstantRestitution([0.5, 2.0]), r"`restitution\[1\]` must be a number in \[0, 1\], got 2.0"),
        (lambda: TabulatedRestitution([1.0], [0.5]), r"`speed` must be an array of at least 2 entries, got 1\."),
        (lambda: TabulatedRestitution([1.0, 1.0], [0.5, 0.5]),
            r"`speed\[1\]` must be larger than the entry before it, got 1\.0\."),
        (lambda: TabulatedRestitution([-1.0, 1.0], [0.5, 0.5]), r"`speed\[0\]` must be finite.*, got -1.0"),
        (lambda: TabulatedRestitution([0.0, 1.0], [0.5, 1.5]),
            r"`restitution\[1\]` must be a number in \[0, 1\], got 1\.5\."),
        (lambda: TabulatedRestitution([0.0, 1.0], [0.5]),
            r"`restitution` must be an array of shape \(2,\), got an array of shape \(1,\)\. Give one per speed\."),
        (lambda: rules.checked([ConstantRestitution(1.0)], PAIRS), "The length of `rule` must be 2.*, got 1"),
        (lambda: rules.checked(ConstantRestitution([1.0]), PAIRS), "The length of `restitution` must be 2.*, got 1"),
        (lambda: rules.restitution_at(lambda v, p: 1.5, 2.0, PAIRS[1]),
            r"The restitution rule of pair 1–2 must return a number in \[0, 1\], got 1\.5 at an approach speed of 2 "
            r"m/s\."),
        (lambda: rules.restitution_at(lambda v, p: math.nan, 2.0, PAIRS[0]),
            r"The restitution rule of pair wall–1 must return a number in \[0, 1\], got nan at an approach speed of 2 "
            r"m/s\."),
    ],
)
def test_values_that_do_not_fit_raise_a_sentence(make, sentence) -> None:
    with pytest.raises(ValueError, match=sentence):
        make()


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: ConstantRestitution("0.7"), "`restitution` must be a single number, got '0.7'"),
        (lambda: ConstantRestitution(None),
            r"`restitution` must be a single number, got None\. 1 is elastic, 0 sticks\."),
        (lambda: rules.checked(0.7, PAIRS),
            r"`rule` must be a function of \(speed, pair\), got 0\.7\. Use granular\.ConstantRestitution\(0\.7\)\."),
        (lambda: rules.checked("elastic", PAIRS),
            r"`rule` must be a function of \(speed, pair\), got 'elastic'\. Use "
            r"granular\.ConstantRestitution\(0\.7\)\."),
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
    with pytest.raises(ValueError, match=r"The restitution rule of pair 0–1 must return a number in \[0, 1\], got "
                                         r"'0\.8' at an approach speed of 1 m/s"):
        gr.edmd.simulate(scene, lambda speed, pair: "0.8")
    with pytest.raises(TypeError, match=r"`rule` must be a function with the arguments \(speed, pair\), got "
                                        r"\(speed, \*, pair\)"):
        gr.edmd.simulate(scene, lambda speed, *, pair: 0.8)


def test_intervals_of_a_ball_reproduce_its_rule() -> None:
    """A hard run with the table reproduces the recorded intervals."""
    recorded = np.array([0.46, 0.368, 0.2981, 0.244, 0.2])
    rule = TabulatedRestitution.from_intervals(recorded)
    assert rule.speed == pytest.approx(0.5 * 9.81 * recorded[-2::-1], rel=1e-15)
    assert rule.restitution == pytest.approx((recorded[1:] / recorded[:-1])[::-1], rel=1e-15)
    ball = Scene([math.inf, 0.05], [0.0, 0.02], [0.0], [0.0, 0.5 * 9.81 * recorded[0]], gravity=9.81)
    onsets = gr.edmd.simulate(ball, rule, until=gr.until.contact(pair=0, nth=6)).contacts["t_begin"]
    assert np.diff(onsets, prepend=0.0) == pytest.approx(recorded, rel=1e-13)


def test_heights_of_a_ball_reproduce_its_rule() -> None:
    recorded = np.array([1.0, 0.64, 0.43, 0.3])
    rule = TabulatedRestitution.from_heights(recorded, gravity=1.62)
    assert rule.speed == pytest.approx(np.sqrt(2.0 * 1.62 * recorded[-2::-1]), rel=1e-15)
    ball = Scene([math.inf, 0.05], [0.0, 0.02], [1.0], [0.0, 0.0], gravity=1.62)
    speeds = gr.edmd.simulate(ball, rule, until=gr.until.contact(pair=0, nth=4)).contacts["v_out"][:, 1]
    assert speeds**2 / (2.0 * 1.62) == pytest.approx(recorded[1:], rel=1e-13)


@pytest.mark.parametrize("kind", ["intervals", "heights"])
def test_errors_of_a_table_are_the_scatter_of_many_noisy_recordings(kind: str) -> None:
    rng, sigma, n = np.random.default_rng(3), 1e-4, 4000
    exact = np.array([0.46, 0.368, 0.298, 0.244, 0.2])
    if kind == "intervals":
        rule = TabulatedRestitution.from_intervals(exact, sigma_t=sigma)
        noisy = exact + sigma * np.diff(rng.normal(size=(n, 6)), axis=1)
        found = (noisy[:, 1:] / noisy[:, :-1])[:, ::-1]
    else:
        rule = TabulatedRestitution.from_heights(exact, sigma_h=sigma)
        noisy = exact + sigma * rng.normal(size=(n, 5))
        found = np.sqrt(noisy[:, 1:] / noisy[:, :-1])[:, ::-1]
    error = rule.standard_error
    assert error == pytest.approx(np.sqrt(np.diag(rule.covariance)), rel=1e-15)
    assert np.cov(found.T) / np.outer(error, error) == pytest.approx(
        rule.covariance / np.outer(error, error), abs=4.0 * math.sqrt(2.0 / n))
    neighbour = rule.covariance[0, 1] / (error[0] * error[1])
    assert neighbour < -0.4, "a value that two ratios share makes one larger and the other smaller"


def test_a_table_that_is_not_measured_has_no_errors() -> None:
    assert not TabulatedRestitution([1.0, 2.0], [0.9, 0.8]).covariance.any()
    assert not TabulatedRestitution.from_heights([1.0, 0.6, 0.3]).standard_error.any()


@pytest.mark.parametrize(("make", "sentence"), [
    (lambda: TabulatedRestitution.from_intervals([0.4, 0.3]),
        r"^`times` must be an array of at least 3 entries, before, between and after two bounces, got 2\.$"),
    (lambda: TabulatedRestitution.from_heights([1.0, 0.8]),
        r"^`heights` must be an array of at least 3 entries, before, between and after two bounces, got 2\.$"),
    (lambda: TabulatedRestitution.from_intervals([0.4, 0.3, 0.31, 0.2]),
        r"^`times\[2\]` must be smaller than the entry before it \(ε < 1\), got 0\.31\. If these are times of "
        r"bounces, use numpy\.diff\(times\)\.$"),
    (lambda: TabulatedRestitution.from_intervals([0.4, 0.7, 0.9, 1.0]), r"^`times\[1\]` must be smaller .*diff"),
    (lambda: TabulatedRestitution.from_heights([1.0, 0.5, 0.6]),
        r"^`heights\[2\]` must be smaller than the entry before it \(ε < 1\), got 0\.6\. The drop height is the "
        r"first\.$"),
    (lambda: TabulatedRestitution.from_heights([1.0, math.nan, 0.6]),
        r"^`heights\[1\]` must be positive and finite, got nan\.$"),
    (lambda: TabulatedRestitution.from_intervals([0.4, 0.3, 0.2], gravity=0.0),
        r"^`gravity` must be a finite number above 0, got 0\.0\.$"),
    (lambda: TabulatedRestitution.from_intervals([0.4, 0.3, 0.2], sigma_t=-1.0),
        r"^`sigma_t` must be a finite number of at least 0, got -1\.0\.$"),
])
def test_a_series_that_gives_no_table_is_one_sentence(make, sentence) -> None:
    with pytest.raises(ValueError, match=sentence):
        make()

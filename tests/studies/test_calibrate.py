"""`gr.calibrate`: error bars, χ² and its probability, parameters that data do not determine, and wrong laws."""

import math

import numpy as np
import pytest

import granular as gr
from tests.helpers.recordings import KINDS, covariance_of_intervals, recorded

scipy = pytest.importorskip("scipy")
X = np.linspace(0.0, 1.0, 6)
LINE = {"offset": (-1.0, 0.5, 5.0), "slope": (-9.0, 0.0, 9.0)}


def line(offset, slope):
    return offset + slope * X


def test_a_line_is_fitted_as_by_the_normal_equations():
    rng, design = np.random.default_rng(1), np.column_stack([np.ones(6), X])
    noise = np.diag(rng.uniform(0.5, 2.0, 6)) + 0.1
    data = line(1.0, 2.0) + rng.normal(size=6)
    found, weight = gr.calibrate(line, data, LINE, sigma=noise), np.linalg.inv(noise)
    covariance = np.linalg.inv(design.T @ weight @ design)
    best = covariance @ design.T @ weight @ data
    assert list(found.value.values()) == pytest.approx(best, rel=1e-6)
    assert found.covariance == pytest.approx(covariance, rel=1e-5)
    assert list(found.error.values()) == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-5)
    assert found.residuals == pytest.approx(data - design @ best, abs=1e-6)
    assert found.chi2 == pytest.approx(found.residuals @ weight @ found.residuals, rel=1e-9)
    assert found.dof == 4
    assert found.probability == pytest.approx(scipy.stats.chi2.sf(found.chi2, 4), rel=1e-9)
    assert found.at_bound == found.undetermined == ()


def test_sigma_can_be_one_number_one_per_datum_or_a_matrix():
    data = line(1.0, 2.0) + np.array([0.1, -0.1, 0.2, 0.0, -0.2, 0.1])
    one, each, matrix = (gr.calibrate(line, data, LINE, sigma=s) for s in (0.1, np.full(6, 0.1), 0.01 * np.eye(6)))
    assert one.chi2 == each.chi2 == pytest.approx(matrix.chi2, rel=1e-12)
    assert one.error["slope"] == pytest.approx(0.1 / math.sqrt(((X - 0.5) ** 2).sum()), rel=1e-5)


def test_intervals_with_their_covariance_agree_with_times_on_an_unknown_clock():
    rng, d = np.random.default_rng(2), np.diff(np.eye(9), axis=0)
    assert d @ d.T == pytest.approx(covariance_of_intervals(8, 1.0))
    times = np.cumsum(0.5 * 0.8 ** np.arange(9)) + rng.normal(0.0, 1e-3, 9)

    def model(e, first, clock):
        return clock + np.append(0.0, np.cumsum(first * e ** np.arange(8)))

    ranges = {"e": (0.5, 0.7, 1.0), "first": (0.1, 0.5, 1.0)}
    by_clock = gr.calibrate(model, times, ranges | {"clock": (-9.0, 0.0, 9.0)}, sigma=1e-3)
    by_intervals = gr.calibrate(lambda e, first: np.diff(model(e, first, 0.0)), np.diff(times), ranges,
                                sigma=covariance_of_intervals(8, 1e-3))
    assert by_intervals.chi2 == pytest.approx(by_clock.chi2, rel=1e-6)
    assert by_intervals.dof == by_clock.dof == 6
    assert by_intervals.error["e"] == pytest.approx(by_clock.error["e"], rel=1e-5)


def test_a_parameter_without_influence_is_named_and_costs_no_degree_of_freedom():
    data = line(1.0, 2.0) + 0.1 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    plain = gr.calibrate(line, data, LINE, sigma=0.1)
    idle = gr.calibrate(lambda offset, slope, k: line(offset, slope), data, LINE | {"k": (4.0, 5.0, 9.0)}, sigma=0.1)
    assert (idle.undetermined, idle.at_bound, idle.dof) == (("k",), (), plain.dof)
    assert idle.probability == pytest.approx(plain.probability, rel=1e-6)
    assert idle.error["k"] == math.inf
    assert idle.covariance[2, 2] == pytest.approx(25.0)  # the width of its range
    assert "k            5 not determined by the data" in str(idle)


def test_only_the_combination_of_two_degenerate_parameters_is_counted():
    data = line(1.0, 2.0) + 0.01 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    found = gr.calibrate(lambda offset, slope, more: line(offset, slope + more), data,
                         LINE | {"more": (-9.0, 0.0, 9.0)}, sigma=0.01)
    assert found.undetermined == ("slope", "more")
    assert found.dof == 4
    assert found.error["offset"] < 0.02


def test_a_parameter_at_its_bound_costs_no_degree_of_freedom():
    data = line(1.0, 2.0) + 0.1 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    bound = gr.calibrate(line, data, LINE | {"slope": (-9.0, 0.0, 1.5)}, sigma=0.1)
    fixed = gr.calibrate(lambda offset: line(offset, 1.5), data, {"offset": (-1.0, 0.5, 5.0)}, sigma=0.1)
    assert (bound.at_bound, bound.undetermined, bound.dof) == (("slope",), (), 5)
    assert bound.chi2 == pytest.approx(fixed.chi2, rel=1e-4)
    assert bound.error["offset"] == pytest.approx(fixed.error["offset"], rel=1e-4)
    assert "slope        1.5 at the bound of its range" in str(bound)
    near = gr.calibrate(line, line(1.0, 2.0), LINE | {"slope": (-9.0, 0.0, 2.001)}, sigma=0.1)
    assert (near.at_bound, near.dof) == ((), 4)  # its best value is near the bound, but inside


def test_fewer_data_than_parameters_cannot_test_a_model():
    found = gr.calibrate(lambda a, b, c: np.array([a + b, c]), [1.0, 0.5], dict.fromkeys("abc", (0.0, 0.2, 1.0)),
                         sigma=0.01)
    assert (found.dof, found.undetermined) == (0, ("a", "b"))
    assert math.isnan(found.probability)
    assert str(found).endswith("The data cannot test the model.")


def test_the_verdict_states_that_a_law_is_wrong():
    wrong = gr.calibrate(lambda e: np.full(6, e), line(1.0, 2.0), {"e": (0.0, 1.0, 9.0)}, sigma=0.1)
    assert wrong.probability < 1e-9
    assert str(wrong).endswith("The model is wrong (5 % level), or the data have larger errors than stated.")
    right = gr.calibrate(line, line(1.0, 2.0), LINE, sigma=0.1)
    assert str(right).endswith("The data do not contradict the model.")
    assert all(len(text) <= 80 for text in str(wrong).splitlines())


WRONG = [
    ({"data": "late"}, r"`data` must be an array of numbers, got 'late'\."),
    ({"data": [1.0, math.nan, 2.0]}, r"`data\[1\]` must be a finite number, got nan\."),
    ({"parameters": {"e": (0.0, 0.5)}}, r"`parameters` must be an array of shape \(1, 3\), got .* Give a lower bound, "
                                        r"a start value and an upper bound for each\."),
    ({"parameters": {"e": (0.0, 2.0, 1.0)}}, r"`parameters\[0\]` must be between its bounds, got 2\.0\."),
    ({"parameters": {"e": (1.0, 1.0, 1.0)}}, r"`parameters\[0\]` must be between its bounds, got 1\.0\."),
    ({"sigma": [0.1, 0.1]}, r"`sigma` must be an array of shape \(3,\), got an array of shape \(2,\)\."),
    ({"sigma": 0.0}, r"`sigma\[0\]` must be positive and finite, got 0\.0\."),
    ({"sigma": np.zeros((3, 3))}, r"`sigma` must be a symmetric matrix with positive eigenvalues only, got one with "
                                  r"the eigenvalue 0\. The covariance of a table is 0 without `sigma_t` or `sigma_h`"),
    ({"sigma": np.ones((3, 3))}, "with positive eigenvalues only, got one with the eigenvalue "),
    ({"sigma": np.tri(3)}, r"`sigma` must be a symmetric matrix .* got another matrix\."),
    ({"sigma": np.ones((3, 3, 3))}, r"`sigma` must be an array of shape \(3, 3\), got an array of shape \(3, 3, 3\)\."),
    ({"parameters": [(0.0, 0.5, 1.0)]}, r"`parameters` must be a mapping of names to bounds and a start value, got \["),
    ({"parameters": {}}, r"`parameters` must be a mapping with at least one parameter, got an empty mapping\."),
    ({"model": 0.8}, r"`model` must be a function of the parameters, got 0\.8\."),
    ({"model": lambda eps: [eps] * 3}, r"`model` must be a function with the arguments \(e\), got \(eps\)\. It is "
                                       r"called with the names of `parameters`\."),
    ({"model": lambda e: [e]}, r"The result of the model at {'e': 0\.5} must be an array of shape \(3,\), got"),
    ({"model": lambda e: np.full(3, np.nan)}, r"The result of the model at {'e': 0\.5}.* must be a finite number"),
]


@pytest.mark.parametrize(("given", "sentence"), WRONG)
def test_invalid_fits_are_refused_in_one_sentence(given, sentence):
    valid = {"model": lambda e: np.full(3, e), "data": [0.4, 0.5, 0.6], "parameters": {"e": (0.0, 0.5, 1.0)},
             "sigma": 0.1}
    with pytest.raises((TypeError, ValueError), match=sentence):
        gr.calibrate(**valid | given)


def right_laws(kind, count, seed):
    """Pulls of ε, χ², its probability and degrees of freedom, for recordings of a constant ε."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        e = rng.uniform(0.6, 0.9)
        _, data, given = recorded(kind, rng, gr.ConstantRestitution(e))
        found = gr.calibrate(data=data, **given)
        yield (found.value["e"] - e) / found.error["e"], found.chi2, found.dof, found.probability


def wrong_laws(kind, count, seed):
    """Whether a constant ε is rejected, for recordings of an ε(v) with a misfit that is large enough to be detected."""
    rng = np.random.default_rng(seed)
    while count:
        e, slope = rng.uniform(0.7, 0.9), 10.0 ** rng.uniform(-2.5, -1.2)
        exact, data, given = recorded(kind, rng, lambda v, pair, e=e, slope=slope: e - slope * v)
        misfit = gr.calibrate(data=exact, **given)
        limit = scipy.stats.chi2.isf(0.05, misfit.dof)
        power = scipy.stats.ncx2.sf(limit, misfit.dof, min(misfit.chi2, 300.0))
        if power >= 0.97:
            yield gr.calibrate(data=data, **given).probability < 0.05
            count -= 1


@pytest.mark.rotating
@pytest.mark.parametrize(("kind", "count"), [("intervals", 12), ("heights", 12), ("video", 4)])
def test_pulls_and_chi2_have_their_expected_sums(kind, count):
    """Within 4 standard errors, for a few of the recordings below."""
    pull, chi2, dof, _ = np.transpose(list(right_laws(kind, count, 11)))
    assert abs((pull**2).sum() - count) < 4.0 * math.sqrt(2.0 * count)
    assert abs((chi2 - dof).sum()) < 4.0 * math.sqrt(2.0 * dof.sum())


@pytest.mark.rotating
@pytest.mark.parametrize(("kind", "count"), [("intervals", 4), ("heights", 4), ("video", 1)])
def test_a_wrong_law_is_rejected(kind, count):
    assert sum(wrong_laws(kind, count, 12)) >= count - count // 4


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_of_200_recordings_the_truth_is_within_one_error_in_68_per_cent(kind):
    pull, _, _, probability = np.transpose(list(right_laws(kind, 200, 1)))
    assert 0.60 <= (np.abs(pull) < 1.0).mean() <= 0.76
    assert 0.02 <= (probability < 0.05).mean() <= 0.08


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_of_200_recordings_a_wrong_law_is_rejected_in_90_per_cent(kind):
    assert np.mean(list(wrong_laws(kind, 200, 2))) >= 0.9

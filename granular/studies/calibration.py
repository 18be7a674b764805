"""Fit of a model to measurements, with error bars and a test of the model."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine import check, signature

BOUND = 1e-3
"""Distance from a bound, in units of the range, below which it can be reached."""
FLAT = 1e-6
"""Smallest singular value that is not due to rounding errors."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Parameters of a model that was fitted to data, and the test of the model.

    Attributes
    ----------
    value, error : dict of str to float
        Best value and standard error of each parameter, in the unit of the parameter. The error is inf if the data do
        not determine the parameter, or if the parameter is at a bound.
    covariance : (p, p) array
        Covariance of the p parameters. A combination that the data do not determine, or a parameter at a bound, has the
        width of its range as its standard error.
    residuals : (N,) array
        Data minus model, in the unit of the data.
    chi2 : float
        χ² of the best fit.
    dof : int
        Degrees of freedom: the number of data minus the number of combinations of parameters that the data determine.
    probability : float
        Probability of at least this χ² if the model and `sigma` are right. nan if `dof` is not positive.
    at_bound, undetermined : tuple of str
        Parameters at a bound of their range, and other parameters whose standard error exceeds their range.
    """

    value: dict[str, float]
    error: dict[str, float]
    covariance: check.Array
    residuals: check.Array
    chi2: float
    dof: int
    probability: float
    at_bound: tuple[str, ...]
    undetermined: tuple[str, ...]

    def __str__(self) -> str:
        notes = dict.fromkeys(self.undetermined, "not determined by the data") | dict.fromkeys(
            self.at_bound, "at the bound of its range")
        verdict = ("The data cannot test the model." if self.dof <= 0 else
                   "The data do not contradict the model." if self.probability >= 0.05 else
                   "The model is wrong (5 % level), or the data have larger errors than stated.")
        return "\n".join(f"{name:12} {value:.6g} " + notes.get(name, f"± {self.error[name]:.2g}")
                         for name, value in self.value.items()) + (
            f"\nχ² = {self.chi2:.1f} for {self.dof} degrees of freedom, probability {self.probability:.2g}\n{verdict}")


@signature.face
def calibrate(
    model: Callable[..., Any], data: Any, parameters: Mapping[str, tuple[float, float, float]], *, sigma: Any
) -> Calibration:
    """Fit a model to measurements, and test the model.

    The parameters minimize χ² = rᵀ C⁻¹ r, where r are the data minus the model, and C is the covariance matrix of the
    data. If the model is right and r depends nearly linearly on the parameters, the minimum has a χ² distribution.

    Parameters
    ----------
    model : callable
        Function that is called with the parameters as keyword arguments and returns an array like `data`. It can run an
        engine.
    data : (N,) array
        Measurements, such as times of bounces, intervals, heights or positions.
    parameters : mapping of str to (float, float, float)
        Lower bound, start value and upper bound of each parameter. A combination of parameters whose standard error
        exceeds the range between the bounds counts as undetermined.
    sigma : float, (N,) array or (N, N) array
        Standard error of all data, one standard error per datum, or the covariance matrix of the data. Neighbouring
        intervals share a time, so their errors are correlated: with ``d = numpy.diff(numpy.eye(N + 1), axis=0)`` the
        covariance matrix of N intervals is ``sigma_t**2 * d @ d.T``.

    Returns
    -------
    Calibration
        Best values, standard errors and the test. It prints as a table.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, the covariance matrix is not symmetric and positive definite, the model does not
        return N finite numbers, or the fit does not converge.

    Examples
    --------
    >>> import numpy as np
    >>> import granular as gr
    >>> rule = gr.TabulatedRestitution.from_intervals([0.46, 0.37, 0.294, 0.236], sigma_t=5e-4)
    >>> law = lambda e: np.full(3, e)
    >>> print(gr.calibrate(law, rule.restitution, {"e": (0.0, 0.8, 1.0)}, sigma=rule.covariance))
    e            0.799881 ± 0.00065
    χ² = 4.0 for 2 degrees of freedom, probability 0.14
    The data do not contradict the model.
    """
    from scipy import linalg, optimize, special

    y = check.array("data", data, finite="a finite number")
    names = list(check.of_kind("parameters", parameters, Mapping, "a mapping of names to bounds and a start value"))
    _check_call(model, names)
    low, start, high = check.array("parameters", list(parameters.values()), (len(names), 3), finite="a finite number",
                                   fix="Give a lower bound, a start value and an upper bound for each.").T
    check.every("parameters", start, (low <= start) & (start <= high) & (low < high), "between its bounds")
    width, root = high - low, _factor(sigma, len(y))

    def residuals(fraction: check.Array) -> Any:
        """Return data minus model; parameters are fractions of their ranges."""
        given = dict(zip(names, (low + fraction * width).tolist(), strict=True))
        return y - check.array(f"the result of the model at {given}", model(**given), y.shape, finite="a finite number")

    best = optimize.least_squares(
        lambda u: linalg.solve_triangular(root, residuals(u), lower=True), (start - low) / width, bounds=(0.0, 1.0),
        x_scale="jac")
    check.raise_if_true({"The fit does not converge. Start closer to the solution.": not best.success})
    # a parameter is at a bound only if the minimum of χ² over this parameter alone is outside the range
    free = (np.abs(best.x - np.round(best.x)) > BOUND) | (
        np.abs(best.x - best.grad / np.maximum((best.jac**2).sum(axis=0), FLAT**2) - 0.5) < 0.5)
    # rows of zeros make the directions complete if there are fewer data than parameters
    singular, directions = np.linalg.svd(np.vstack([best.jac * free, np.diag(0.0 * width)]), full_matrices=False)[1:]
    error = np.sqrt(((directions.T / np.maximum(singular, FLAT)) ** 2).sum(axis=1))
    dof, unknown = len(y) - int((singular >= 1.0).sum()), error >= 1.0
    return Calibration(
        dict(zip(names, (low + best.x * width).tolist(), strict=True)),
        dict(zip(names, np.where(unknown, np.inf, error * width).tolist(), strict=True)),
        np.outer(width, width) * ((directions.T / np.maximum(singular, 1.0) ** 2) @ directions), residuals(best.x),
        2.0 * float(best.cost), dof,
        float(special.gammaincc(0.5 * dof, best.cost)) if dof > 0 else float("nan"),
        tuple(np.array(names)[~free].tolist()), tuple(np.array(names)[unknown & free].tolist()))


def _check_call(model: Any, names: list[str]) -> None:
    """Raise an error if `model` is not a function of the parameters `names`."""
    check.of_kind("model", model, Callable, "a function of the parameters")
    if not names:
        raise ValueError(check.must("parameters", "a mapping with at least one parameter", "an empty mapping"))
    try:
        model_signature = inspect.signature(model)
    except ValueError:  # some builtins have no signature
        return
    try:
        model_signature.bind(**dict.fromkeys(names))
    except TypeError:
        need = f"a function with the arguments ({', '.join(map(str, names))})"
        raise TypeError(check.must("model", need, str(model_signature), "It is called with the names of `parameters`.")
                        ) from None


def _factor(sigma: Any, count: int) -> check.Array:
    """Return the Cholesky factor (N, N) of the covariance matrix of N = `count` data."""
    errors = check.array("sigma", sigma, (count,) * min(np.ndim(sigma), 2), finite="a finite number")
    if errors.ndim < 2:
        return np.diag(check.positive("sigma", np.full(count, errors), "error"))
    rounding = 1e-14 * np.abs(errors).max()
    least = np.linalg.eigvalsh(errors)[0] if np.allclose(errors, errors.T, 1e-9, rounding) else math.nan
    if not least > rounding:
        got = "another matrix" if math.isnan(least) else f"one with the eigenvalue {least:.3g}"
        raise ValueError(check.must("sigma", "a symmetric matrix with positive eigenvalues only", got,
                                    "The covariance of a table is 0 without `sigma_t` or `sigma_h`."))
    return np.asarray(np.linalg.cholesky(errors), float)

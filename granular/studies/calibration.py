"""Fit of a model to measurements, with error bars and a test of the model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine import check

BOUND = 1e-3
"""Distance from a bound in units of the range, below which it can be reached."""
FLAT = 1e-6
"""Smallest singular value that differs from rounding."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Parameters of a model that was fitted to data, and the test of the model.

    Attributes
    ----------
    value, error : dict of str to float
        Best value and standard error of each parameter. The error is inf if the data do not determine the parameter,
        or if it is at a bound.
    covariance : (p, p) array
        Covariance of the parameters. A combination that the data do not determine, or a parameter at a bound, has the
        width of its range as its standard error.
    residuals : (N,) array
        Data minus model.
    chi2, dof, probability : float, int, float
        χ², the degrees of freedom, and the probability of at least this χ² if the model and `sigma` are right.
        `probability` is nan without degrees of freedom. They are the number of data minus the number of combinations of
        parameters that the data determine.
    at_bound, undetermined : tuple of str
        Parameters at a bound of their range, and parameters whose error exceeds their range.
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


@check.face
def calibrate(
    model: Callable[..., Any], data: Any, parameters: Mapping[str, tuple[float, float, float]], *, sigma: Any
) -> Calibration:
    """Fit a model to measurements, and test whether the model is wrong.

    The parameters minimize χ² = rᵀ C⁻¹ r, where r are the data minus the model and C is the covariance of the data. If
    the model is right and r depends nearly linearly on the parameters, χ² follows its distribution.

    Parameters
    ----------
    model : callable
        Function of the parameters, by name, that returns an array like `data`. It can run an engine.
    data : (N,) array
        Measurements, such as times of bounces, intervals, heights or positions.
    parameters : mapping of str to (float, float, float)
        Lower bound, start value and upper bound of each parameter. A combination of parameters whose standard error
        exceeds the range between the bounds counts as undetermined.
    sigma : float, (N,) array or (N, N) array
        Standard error of the data, one per datum, or their covariance matrix. Intervals between times share times, so
        neighbours are correlated: with ``d = numpy.diff(numpy.eye(N + 1), axis=0)`` their matrix is
        ``sigma_t**2 * d @ d.T``.

    Returns
    -------
    Calibration

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, the model does not return N finite numbers, or the fit does not converge.

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

    y, names = check.array("data", data, finite="a finite number"), list(parameters)
    low, start, high = check.array("parameters", list(parameters.values()), (len(names), 3), finite="a finite number",
                                   fix="Give a lower bound, a start value and an upper bound for each.").T
    check.every("parameters", start, (low <= start) & (start <= high) & (low < high), "between its bounds")
    errors = check.array("sigma", sigma, (len(y),) * np.ndim(sigma), finite="a finite number")
    width, root = high - low, np.linalg.cholesky(
        errors if errors.ndim == 2 else np.diag(check.positive("sigma", np.full(len(y), errors), "error") ** 2))

    def residuals(fraction: check.Array) -> Any:
        """Return data minus model, for parameters as fractions of their ranges."""
        given = dict(zip(names, (low + fraction * width).tolist(), strict=True))
        return y - check.array(f"the result of the model at {given}", model(**given), y.shape, finite="a finite number")

    best = optimize.least_squares(
        lambda u: linalg.solve_triangular(root, residuals(u), lower=True), (start - low) / width, bounds=(0.0, 1.0),
        x_scale="jac")
    check.raise_if_true({"The fit does not converge. Start closer to the solution.": not best.success})
    # at a bound, χ² would have its minimum over one parameter alone outside of the range
    free = (np.abs(best.x - np.round(best.x)) > BOUND) | (
        np.abs(best.x - best.grad / np.maximum((best.jac**2).sum(axis=0), FLAT**2) - 0.5) < 0.5)
    # the added rows complete the directions if there are fewer data than parameters
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

"""Reference solution in 34 digits, with an estimate of its own error.

Power laws F = k ξ^p + γ ξ^d ξ̇ are solved by Taylor series with mpmath. Any other law is solved in double precision by
`granular.studies.reference`. Pass the result to `granular.frontier(reference=...)`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from bench.reference import taylor
from bench.reference.series import fraction
from granular import until as stop
from granular._engine import check
from granular.laws.contact_law import Form, PairLaw
from granular.scene import Scene
from granular.studies import reference
from granular.studies.reference import Reference, ReferenceContact
from granular.studies.reference_events import distance

__all__ = ["Reference", "ReferenceContact", "distance", "power_series", "solve"]

DIGIT_REDUCTION = 10
"""Number of digits by which the second solution is shorter."""


def solve(
    scene: Scene, law: Any, *, until: stop.Until | None = None, t_end: float | None = None, digits: int = 34,
    t_start: float = 0.0,
) -> Reference:
    """Solve a scene in `digits` digits if every law has a power series.

    Any other scene is solved by `granular.studies.reference.solve`.

    Parameters
    ----------
    scene, law, until, t_end, t_start
        As in `granular.studies.reference.solve`.
    digits : int
        Working digits for power laws. The cost grows with about the cube of the digits.

    Returns
    -------
    Reference
        Contacts as mpmath numbers (floats for laws without a power series), with estimated errors.
    """
    whole = check.integer("digits", digits, at_least=20, at_most=200)
    problem = reference.checked_problem(scene, law, until, t_end, t_start)
    forms = [power_series(one) for one in problem.laws]
    if None in forms:
        return reference.solve(scene, law, until=until, t_end=t_end, t_start=t_start)
    from mpmath import MPContext  # so that tests can be collected without it

    many = MPContext()
    many.dps = whole + DIGIT_REDUCTION
    best, other = (taylor.solve(problem.scene, forms, until, problem.t_end, few, problem.t_start)
                   for few in (whole, whole - DIGIT_REDUCTION))
    v_error, t_error = distance(best, other, many.mpf)
    return replace(best, velocity_error=v_error, time_error=t_error)


def power_series(law: PairLaw) -> Form | None:
    """Coefficients (k, p, γ, d) of a law with a power series in a root of ξ, or None."""
    try:
        return law.form if law.form and [fraction(power) for power in law.form[1::2]] else None
    except ValueError:
        return None

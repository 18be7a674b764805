"""An independent solution of a scene, against which engines are judged, with an estimate of its own error.

Power laws F = k ξ^p + γ ξ^d ξ̇ are solved by Taylor series in 34 digits (needs mpmath), any other law by scipy's
DOP853 restarted at events. Neither shares code with `granular.md`'s methods. Each scene is solved twice, the second
time with fewer digits or a wider tolerance: the difference is the error that is reported.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from granular import _check
from granular import until as stop
from granular._optional import optional
from granular.laws.check import checked
from granular.laws.contact_law import Form, PairLaw
from granular.laws.kinds import SceneLaws
from granular.reference import events, restarted
from granular.reference.log import Reference, ReferenceContact, distance
from granular.reference.motion import fraction
from granular.scene import Scene

__all__ = ["Reference", "ReferenceContact", "solve"]

FEWER = 10
"""Digits by which the second solution has fewer."""
TOLERANCES = (3e-14, 1e-12)
"""Relative tolerances of the two solutions by DOP853."""
Solutions = tuple[Reference, Reference, Callable[[Any], Any]]
"""Two solutions, the better one first, and the numbers in which they are compared."""


def solve(
    scene: Scene, law: Any, *, until: stop.Until | None = None, t_end: float | None = None, digits: int = 34
) -> Reference:
    """Solve a scene of soft spheres independently of the engines, and estimate the error of that.

    Parameters
    ----------
    scene : Scene
        Where it starts.
    law : force law or sequence of them
        One for all pairs, or one per pair from the bottom up.
    until, t_end : stop condition, float, optional
        When to stop; a scene that never comes to an end needs one of them.
    digits : int
        Working digits for power laws. Cost grows about as their cube.

    Returns
    -------
    Reference
        Contacts as mpmath numbers (floats from DOP853), with estimated errors.

    Raises
    ------
    ImportError
        If mpmath is missing for a power law.
    ValueError
        If the scene does not come to an end.
    """
    laws = checked(law, scene)
    stop.checked(until, scene.n_pairs)
    end = None if t_end is None else _check.number("t_end", t_end, at_least=0.0)
    whole = _check.whole("digits", digits, at_least=20, at_most=200)
    forms = [power_series(one) for one in laws]
    powers = None not in forms
    both = _by_series(scene, forms, until, end, whole) if powers else _restarted(scene, laws, until, end)
    v_error, t_error = distance(*both)
    return replace(both[0], velocity_error=v_error, time_error=t_error)


def power_series(law: PairLaw) -> Form | None:
    """(k, p, γ, d) of a law whose force has a power series in a root of ξ, else None."""
    if law.form is None:
        return None
    try:
        fraction(law.form[1]), fraction(law.form[3])
    except ValueError:
        return None
    return law.form


def _by_series(scene: Scene, forms: Any, until: stop.Until | None, t_end: float | None, digits: int) -> Solutions:
    many = optional("mpmath", "the reference").MPContext()
    many.dps = digits + FEWER
    fine, coarse = (events.solve(scene, forms, until, t_end, d) for d in (digits, digits - FEWER))
    return fine, coarse, many.mpf


def _restarted(scene: Scene, laws: SceneLaws, until: stop.Until | None, t_end: float | None) -> Solutions:
    fine, coarse = (restarted.solve(scene, laws, until, t_end, "DOP853", rtol)[0] for rtol in TOLERANCES)
    return fine, coarse, float

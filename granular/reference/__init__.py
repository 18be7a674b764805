"""An independent solution of a scene, against which engines are judged, with an estimate of its own error.
May be skipped: it measures ourselves.

Power laws F = k ξ^p + γ ξ^d ξ̇ are solved by Taylor series in 34 digits (needs mpmath), any other law by scipy's
DOP853 restarted at events. Neither shares code with `granular.md`'s methods: a driven wall is read here as the sine or
the polynomials that it is given by. Each scene is solved twice, the second time with fewer digits or a wider tolerance:
the difference is the error that is reported.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from granular import _check, until as stop
from granular.laws.contact_law import Form, PairLaw
from granular.laws.kinds import checked
from granular.reference import restarted, taylor
from granular.reference.events import Reference, ReferenceContact, distance
from granular.reference.series import fraction
from granular.scene import Scene, checked as a_scene
from granular.scene.places import Closing, fitted

__all__ = ["Reference", "ReferenceContact", "solve"]

FEWER = 10
"""Digits by which the second solution has fewer."""
TOLERANCES = (3e-14, 1e-12)
"""Relative tolerances of the two solutions by DOP853."""


def solve(
    scene: Scene, law: Any, *, until: stop.Until | None = None, t_end: float | None = None, digits: int = 34,
    t_start: float = 0.0,
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
    t_start : float
        Time in s of the scene's instant.

    Returns
    -------
    Reference
        Contacts as mpmath numbers (floats from DOP853), with estimated errors.

    Raises
    ------
    ImportError
        If mpmath is missing for a power law.
    ValueError
        If the scene does not come to an end, the path of a wall ends before, or walls meet.

    Notes
    -----
    A driven wall that is a `Sine` is followed as that, in all digits; one that is a `Motion`, as its panels. DOP853
    looks for contacts twenty times a period, or piece of a path: it may overlook what is shorter.
    """
    start = _check.number("t_start", t_start)
    stop.without_levels(stop.checked(until, a_scene(scene)), "the reference")
    end = None if t_end is None else _check.number("t_end", t_end, at_least=start)
    scene = fitted(scene, start, math.inf if end is None else end)
    if end is not None:
        Closing(scene, start, flattened=True).refuse(end, end)
    laws = checked(law, scene)
    whole = _check.whole("digits", digits, at_least=20, at_most=200)
    forms, convert = [power_series(one) for one in laws], float
    if None in forms:
        runs = (restarted.solve(scene, laws, until, end, "DOP853", rtol, t_start=start) for rtol in TOLERANCES)
        best, other = (solved for solved, _ in runs)
    else:
        many = _check.optional("mpmath", "the reference").MPContext()
        many.dps, convert = whole + FEWER, many.mpf
        best, other = (taylor.solve(scene, forms, until, end, few, start) for few in (whole, whole - FEWER))
    v_error, t_error = distance(best, other, convert)
    return replace(best, velocity_error=v_error, time_error=t_error)


def power_series(law: PairLaw) -> Form | None:
    """(k, p, γ, d) of a law whose force has a power series in a root of ξ, else None."""
    try:
        return law.form if law.form and [fraction(power) for power in law.form[1::2]] else None
    except ValueError:
        return None

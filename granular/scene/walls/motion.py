"""Wall motions given by a smooth function, and functions for all wall motions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.callables import function_of
from granular._engine.check import Array
from granular.scene.walls.panels import Panels, _PanelMotion
from granular.scene.walls.path import MAX_TERMS
from granular.scene.walls.thermal import Thermal

__all__ = ["Motion"]
PANEL_NODES = 24
"""Number of function values and of Chebyshev coefficients per panel.

Fewer than `MAX_TERMS` coefficients are stored. The last ones must be negligible.
"""
FIRST_PANELS = 16
"""Number of panels before the first bisection.

Features shorter than a small part of such a panel can be missed.
"""
MIN_FIT_TIME = 1e-6
"""Minimum length in s of the fitted interval.

Even in a run of zero length, the velocity of the wall is therefore defined.
"""
# a panel of 2⁻³⁰ of the run that has not converged shows that the function is not smooth
MAX_HALVINGS = 30
MAX_WALL_PANELS = 1 << 18
"""Maximum number of panels of a motion. Their fit takes a minute."""


@signature.face
@dataclass(frozen=True, repr=False)
class Motion:
    """Motion of a wall given by any smooth function m(t).

    The function is fitted by Chebyshev panels, which are bisected until the truncation error is below `accuracy` times
    the largest excursion.

    Parameters
    ----------
    function : callable
        Smooth function that returns m(t) in m for a time in s (float). In a saved run it is replaced by `Panels`.
    accuracy : float
        Accuracy relative to the largest excursion |m - m(t_start)|; at least 2⁻⁵², about 2.2e-16. Defaults to 1e-15.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, and later if `function` returns an invalid value.

    Notes
    -----
    The derivatives m' and m'' are computed from the panels. Each differentiation costs about two digits.
    Features between two of the 24 values on a panel can be missed. The first panels are a sixteenth of the run long.
    Two motions are equal if they have the same function and accuracy.
    """

    function: Callable[[float], float]
    accuracy: float = 1e-15

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(check.misuse("function", self.function, "a function m(t) in m of a time in s",
                                         "For a harmonic motion use granular.walls.Sine."))
        function_of("function", self.function, "t")
        self.__dict__["accuracy"] = check.number("accuracy", self.accuracy, at_least=2.0**-52, at_most=1e-3)

    def __repr__(self) -> str:
        function: Any = self.function
        name = function if isinstance(function, Panels) else getattr(function, "__qualname__", function)
        return f"Motion({name})" if self.accuracy == 1e-15 else f"Motion({name}, accuracy={self.accuracy:g})"

    def displacement(self, t: float) -> float:
        """Return m(t) in m, the value of `function`."""
        return _value(self.function, check.number("t", t))

    def panels(self, t_start: float, t_end: float) -> Panels:
        """Return the panels that engines evaluate from `t_start` to `t_end` (s).

        Their attribute `error` is the accuracy in m.

        Raises
        ------
        ValueError
            If `t_end` is inf, or if the panels do not converge because of a jump, a kink or noise.
        """
        if isinstance(self.function, Panels):
            return self.function.panels(t_start, t_end)
        begin = check.number("t_start", t_start)
        end = check.number("t_end", t_end, at_least=begin, fix="A wall moved by a function requires t_end=.")
        return _fitted_panels(self.function, self.accuracy, begin,
                       end if end > begin else begin + max(MIN_FIT_TIME, 2.0**-26 * abs(begin)))


def _fitted_panels(function: Callable[[float], float], accuracy: float, begin: float, end: float) -> Panels:
    """Return panels of the function m(t), bisected until they reach the accuracy.

    They cover the time from `begin` to `end` (s). The accuracy is relative to the largest excursion |m - m(begin)|.
    `ValueError` is raised if it cannot be reached.
    """
    edges = np.linspace(begin, end, FIRST_PANELS + 1).tolist()
    # a stack: panels are finished from left to right
    stack = [(left, right, _node_values(function, left, right)) for left, right in pairwise(edges)][::-1]
    origin, right_edges, series, error = _value(function, begin), [], [], 0.0
    scale = max(float(np.abs(values - origin).max()) for _, _, values in stack)
    while stack:
        left, right, values = stack.pop()
        scale = max(scale, float(np.abs(values - origin).max()))
        tolerance, c = max(accuracy * scale, _rounding(left, right, values)), _coefficients(values)
        # several coefficients must have decayed, because a single one can be small by chance
        if float(np.abs(c[MAX_TERMS - 3 :]).max()) <= tolerance:
            stored = _without_tail(c[: MAX_TERMS - 1], 0.2 * tolerance)
            series.append(_power_matrix() @ stored)
            right_edges.append(right)
            error = max(error, tolerance, float(np.abs(c).sum() - np.abs(stored).sum()))
            continue
        middle = 0.5 * (left + right)
        if len(series) + len(stack) >= MAX_WALL_PANELS:
            raise ValueError(
                f"`function` must be representable by {MAX_WALL_PANELS} polynomials, got {len(series)} up to "
                f"t = {left:.9g} s. Use a shorter run, or granular.walls.Sine for a harmonic motion."
            )
        if right - left < (end - begin) * 2.0**-MAX_HALVINGS or not left < middle < right:
            raise ValueError(
                f"`function` must be smooth, but polynomials do not reach an accuracy of {accuracy:g} of its excursion "
                f"near t = {middle:.9g} s. Use granular.walls.Piecewise for a path with corners, or a larger "
                "`accuracy` for a path with noise."
            )
        stack += [(a, b, _node_values(function, a, b)) for a, b in ((middle, right), (left, middle))]
    return Panels(np.array([begin, *right_edges]), np.array(series), error)


def _rounding(left: float, right: float, values: Array) -> float:
    """Return the rounding error of function values in m.

    It is caused by the rounding of the values and of their times between `left` and `right` (s).
    """
    slope = (values.max() - values.min()) / (right - left)
    return 8.0 * float(slope * math.ulp(max(abs(left), abs(right)))) + math.ulp(float(np.abs(values).max()))


def _without_tail(c: Array, tolerance: float) -> Array:
    """Return Chebyshev coefficients with zeros after the last one above `tolerance`.

    Differentiation would amplify these negligible entries.
    """
    above = np.flatnonzero(np.abs(c) > tolerance)
    return np.where(np.arange(len(c)) <= (above[-1] if len(above) else 0), c, 0.0)


def _node_values(function: Callable[[float], float], left: float, right: float) -> Array:
    centre, half = 0.5 * (left + right), 0.5 * (right - left)
    return np.array([_value(function, float(centre + half * x)) for x in _nodes()])


def _coefficients(values: Array) -> Array:
    """Return the Chebyshev coefficients (PANEL_NODES,) of values at the nodes.

    The first value is subtracted and added again, so that a large constant part costs no digits.
    """
    c = _chebyshev_matrix() @ (values - values[0])
    c[0] += values[0]
    return np.asarray(c)


def _value(function: Callable[[float], Any], t: float) -> float:
    return check.number(f"function({t!r})", function(t), fix="The wall needs a position at every time of the run.")


@lru_cache(maxsize=1)
def _nodes() -> Array:
    return np.sin(0.5 * math.pi * np.arange(1 - PANEL_NODES, PANEL_NODES, 2) / PANEL_NODES)


@lru_cache(maxsize=1)
def _chebyshev_matrix() -> Array:
    """Return the square matrix from values at the nodes to Chebyshev coefficients."""
    # multiples of π/(2 PANEL_NODES), exactly
    parts = np.arange(PANEL_NODES)[:, None] * np.arange(2 * PANEL_NODES - 1, 0, -2) % (4 * PANEL_NODES)
    rows = 2.0 / PANEL_NODES * np.cos(math.pi / (2 * PANEL_NODES) * parts)
    rows[0] *= 0.5
    return np.asarray(rows)


@lru_cache(maxsize=1)
def _power_matrix() -> Array:
    """Return the matrix from Chebyshev coefficients to coefficients of powers of x."""
    n = MAX_TERMS - 1
    rows = np.zeros((n, n))
    for k in range(n):
        power = np.polynomial.chebyshev.cheb2poly([0.0] * k + [1.0])
        rows[: len(power), k] = power
    return rows


def checked_motion(name: str, motion: Any, is_wall: bool) -> Any:
    """Return the argument `floor` or `ceiling` of a scene if it is valid.

    It must be None, or a motion or a thermal wall of a body that is a wall. `name` is the name of the argument.
    """
    if motion is None:
        return None
    if not isinstance(motion, (Motion, _PanelMotion, Thermal)):
        raise TypeError(check.misuse(name, motion, "a wall of granular.walls, such as Sine(1e-3, 50.0)"))
    if not is_wall:
        end = "first" if name == "floor" else "last"
        raise ValueError(f"`{name}` must be None if the {end} body is a ball, got {motion!r}. Give the body the mass "
                         "math.inf.")
    return motion


def fitted_motion(motion: Any, t_start: float, t_end: float) -> Any:
    """Return the panels of a `Motion`, or any other motion unchanged, for a run.

    Raises
    ------
    ValueError
        If the motion does not cover the time from `t_start` to `t_end` (s), or cannot be fitted.
    """
    panels = None if motion is None else motion.panels(t_start, t_end)
    return panels if isinstance(motion, Motion) else motion


def ends(*motions: Any) -> float:
    """Return the earliest time in s at which the path of one of the motions ends.

    It is inf for a `Sine`, and for a `Motion` that is given by a function, because the end is unknown.
    """
    paths = [getattr(motion, "function", motion) for motion in motions]
    last = [*(path.breaks[-1] for path in paths if isinstance(path, _PanelMotion) and hasattr(path, "breaks")),
            *(path.edges[-1] for path in paths if isinstance(path, Panels) and not path.frequency)]
    return float(min(last, default=math.inf))


def max_wall_speed(motion: Any) -> float:
    """Return an upper bound of the speed |m'| of a wall motion in m/s.

    It is 0 without a motion, and for a `Motion` that has not been replaced by panels.
    """
    panels = getattr(motion, "_panels", getattr(motion, "function", motion))
    return float(panels.speed) if isinstance(panels, Panels) else 0.0


def displacement_since(motion: Any, start: float, elapsed: Any) -> tuple[Any, Any]:
    """Return m(t) - m(start) in m and m'(t) in m/s of a wall motion.

    The times are t = `start` + `elapsed` (s), where `elapsed` is a number or an array. Both values are 0 without a
    motion.
    """
    if motion is None:
        return 0.0, 0.0
    # other paths are checked at the start only: rounding can put the end of a run beyond the end of the path
    end = math.nextafter(start + float(np.max(elapsed)), math.inf) if isinstance(motion, Motion) else start
    panels: Panels = motion.panels(start, end)
    times = np.atleast_1d(np.asarray(elapsed, dtype=float))
    origin = panels.at(start, 0.0)[0]
    states = np.array([panels.at(start, dt)[:2] for dt in times.tolist()]).reshape(-1, 2)
    x, v = states[:, 0] - origin, states[:, 1]
    return (x, v) if np.ndim(elapsed) else (float(x[0]), float(v[0]))

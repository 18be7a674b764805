"""Wall motions given by a formula: a sine, or piecewise polynomials.

Piecewise polynomials include splines through measured positions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.check import Array, ByNumbers
from granular.scene.walls import path
from granular.scene.walls.panels import Panels, _PanelMotion
from granular.scene.walls.path import MAX_TERMS

MAX_MOTION = 1e150
"""Maximum amplitude (m) and acceleration (m/s²), so that products do not overflow."""
PANELS_PER_PERIOD = 8
"""Number of polynomials per period of a `Sine`."""
# as a fraction, so that phases of many turns are reduced without rounding
TWO_PI = 6283185307179586476925286766559005768394338798750211641949889184615632812572417997256, 10**84
STEP_TOLERANCE = 1e-9
"""Largest jump of a path at a break that is removed as a rounding error.

It is relative to the largest term of the polynomials.
"""


@signature.face
@dataclass(frozen=True)
class Sine(_PanelMotion):
    """Harmonic motion of a wall, m(t) = A sin(2π f t + φ).

    Its derivatives are m' = 2π f A cos(2π f t + φ) and m'' = -(2π f)² m.

    Parameters
    ----------
    amplitude : float
        A in m, not negative.
    frequency : float
        f in Hz, positive: periods per second, not radians per second.
    phase : float
        φ in rad at t = 0 (not at t_start). Defaults to 0. With a phase of 0 and t_start = 0 the wall starts abruptly at
        the velocity 2π f A. With a phase of π/2 it starts at rest.

    Raises
    ------
    TypeError, ValueError
        If an argument is not a number in its range.

    Notes
    -----
    Engines evaluate eight polynomials of degree 16 per period, with an error below 3e-20 A. They keep f·t as a
    fraction of a period in two floats, so a million periods cost no digits.
    """

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        self.__dict__.update(
            amplitude=check.number("amplitude", self.amplitude, at_least=0.0, at_most=MAX_MOTION,
                                    fix="A phase of π reverses the motion."),
            frequency=check.number("frequency", self.frequency, above=0.0,
                                    fix="For a wall at rest give None instead of a Sine."),
            phase=check.number("phase", self.phase),
        )
        largest = self.omega * self.omega * self.amplitude
        check.number("(2π frequency)² amplitude", largest, at_least=0.0, at_most=MAX_MOTION)

    @classmethod
    def from_acceleration(cls, gamma: float, frequency: float, gravity: float = 9.81, phase: float = 0.0) -> Sine:
        """Return the motion with the largest acceleration Γ g, where Γ = A (2π f)² / g.

        Parameters
        ----------
        gamma : float
            Γ, not negative. Above 1, balls at rest leave the wall.
        frequency : float
            f in Hz, positive.
        gravity : float
            g in m/s², positive. Defaults to 9.81.
        phase : float
            φ in rad at t = 0. Defaults to 0.

        Returns
        -------
        Sine
        """
        largest = check.number("gamma", gamma, at_least=0.0) * check.number("gravity", gravity, above=0.0)
        # the limit keeps ω² above underflow
        omega = 2.0 * math.pi * check.number("frequency", frequency, above=0.0, at_least=1e-150)
        return cls(largest / (omega * omega), frequency, phase)

    @property
    def omega(self) -> float:
        """Angular frequency 2π f in rad/s."""
        return 2.0 * math.pi * self.frequency

    def phases(self, times: Array) -> Array:
        """Return the phases (2π f t + φ)/2π at times in s, as fractions of a period.

        The values are from 0 to 1 and lose no digits at late times.
        """
        wall, _ = self._panels._plain_records
        return np.array([path.phase(wall, t, 0.0) for t in times.tolist()])

    def panels(self, t_start: float = 0.0, t_end: float = math.inf) -> Panels:
        """Return the polynomials that engines evaluate. They are valid at all times."""
        return self._panels

    @cached_property
    def _panels(self) -> Panels:
        """Return the panels of one period, with Taylor series of the sine."""
        from fractions import Fraction

        half = math.pi / PANELS_PER_PERIOD
        s, c = math.sin(half), math.cos(half)  # eighths by symmetry: the sine of 15π/8 as computed is less exact
        sine = np.array([s, c, c, s, -s, -c, -c, -s])
        cycle = sine, np.roll(sine, -2), -sine, -np.roll(sine, -2)
        # Taylor series about the middle of each panel: derivatives of a sine are shifted by quarter turns
        series = [cycle[j % 4] * (self.amplitude * half**j / math.factorial(j)) for j in range(17)]
        turn = Fraction(self.phase) / Fraction(*TWO_PI) % 1
        high = float(turn)
        edges = np.arange(PANELS_PER_PERIOD + 1) / PANELS_PER_PERIOD
        # the first omitted Taylor term
        error = self.amplitude * half**17 / math.factorial(17)
        return Panels(edges, np.array(series).T, error, self.frequency, (high, float(turn - Fraction(high))))


@signature.face
@dataclass(frozen=True, eq=False, repr=False)
class Piecewise(_PanelMotion, ByNumbers):
    """Motion of a wall given by polynomials between breaks.

    From break t_i to t_(i+1), m(t) = Σ_j c_ji (t - t_i)^(K-j), as in `scipy.interpolate.PPoly`.

    Parameters
    ----------
    breaks : (n+1,) array, or scipy.interpolate.PPoly
        Times t_i in s, increasing. A PPoly (such as a CubicSpline or a PchipInterpolator) includes its coefficients.
    coefficients : (K+1, n) array
        Coefficients in m/s^(K-j), the highest power first; K ≤ 19.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or if the position jumps at a break. The velocity can jump, which is an event for
        balls that touch the wall.

    Notes
    -----
    A run must lie between the first and the last break. Jumps of the position by rounding are removed.
    """

    breaks: Array
    coefficients: Array

    def __init__(self, breaks: Any, coefficients: Any = None) -> None:
        if coefficients is None:
            if not (hasattr(breaks, "x") and hasattr(breaks, "c")):
                raise TypeError(check.misuse("coefficients", None, "an array (K+1, n), the highest power first",
                                             "Or give a scipy.interpolate.PPoly alone."))
            breaks, coefficients = breaks.x, breaks.c
        t = check.increasing_array("breaks", breaks, "a finite time")
        rows = len(np.atleast_1d(check.array("coefficients", coefficients, ..., fix="Give one column per piece.")))
        if not 0 < rows <= MAX_TERMS:
            raise ValueError(f"`coefficients` must have 1 to {MAX_TERMS} rows, one per power, got {rows}.")
        c = check.array("coefficients", coefficients, (rows, len(t) - 1), fix="Give one column per piece.",
                         finite="a finite number")
        self.__dict__.update(breaks=t, coefficients=c)
        _check_jumps(t, *_continuous_series(t, c))

    def __repr__(self) -> str:
        n = self.coefficients.shape[1]
        return f"Piecewise({n} piece{'s' * (n != 1)}, {self.breaks[0]:g} … {self.breaks[-1]:g} s)"

    def panels(self, t_start: float, t_end: float) -> Panels:
        """Return the polynomials that engines evaluate.

        `ValueError` is raised if the path does not cover the time from `t_start` to `t_end` (s).
        """
        return self._panels.panels(t_start, t_end)

    @cached_property
    def _panels(self) -> Panels:
        return Panels(self.breaks, _continuous_series(self.breaks, self.coefficients)[0])


def _continuous_series(t: Array, c: Array) -> tuple[Array, Array, Array]:
    """Return the polynomials of a path in the form of `Panels`, without jumps.

    Parameters
    ----------
    t, c : (n+1,) and (K+1, n) arrays
        Breaks in s and coefficients, as in `Piecewise`.

    Returns
    -------
    series : (n, K+1) array
        Coefficients in m of 1, x, x², …, x from -1 to 1 between two breaks. Jumps of the position are removed.
    jumps : (n-1,) array
        Jumps of the position at the inner breaks in m, before they were removed.
    largest : (n,) array
        Largest term of each polynomial in m.
    """
    scaled = (c[::-1] * (0.5 * np.diff(t)) ** np.arange(len(c))[:, None]).T
    series = scaled.copy()
    # shift the expansion point from the left edge to the middle of the interval (Horner)
    for i in range(series.shape[1] - 1):
        for j in range(series.shape[1] - 2, i - 1, -1):
            series[:, j] += series[:, j + 1]
    # left end of each polynomial minus right end of the polynomial before
    jumps = (series @ (-1.0) ** np.arange(series.shape[1]))[1:] - series.sum(axis=1)[:-1]
    largest = np.abs(scaled * 2.0 ** np.arange(series.shape[1])).max(axis=1)
    series[1:, 0] -= np.cumsum(jumps)
    return series, jumps, largest


def _check_jumps(t: Array, series: Array, jumps: Array, largest: Array) -> None:
    """Raise `ValueError` if the position jumps at a break by more than rounding error.

    `t` are the breaks in s. The other arguments are the result of `_continuous_series`: `jumps` in m at the inner
    breaks are compared with the largest value of `largest` in m. `series` is not used.
    """
    too_large = np.abs(jumps) > STEP_TOLERANCE * max(float(largest.max()), math.ulp(0.0))
    if too_large.any():
        i = int(too_large.argmax())
        raise ValueError(f"`coefficients` must give a continuous path, got a jump of {jumps[i]:.3g} m at "
                         f"breaks[{i + 1}] = {t[i + 1]:g}. Change the constant of the later piece.")

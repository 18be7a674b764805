"""A wall shaken harmonically.
May be skipped: rarer, walls that shake.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from granular import _check
from granular._check import Array
from granular._records import plain
from granular.walls import path
from granular.walls.panels import Panels

LARGEST = 1e150
"""Of amplitudes (m) and accelerations (m/s²): their products are still numbers."""
PER_TURN = 8
"""Panels a turn."""
TWO_PI = 6283185307179586476925286766559005768394338798750211641949889184615632812572417997256, 10**84


@dataclass(frozen=True)
class Sine:
    """m(t) = A sin(2π f t + φ), m' = 2π f A cos(2π f t + φ), m'' = -(2π f)² m.

    Parameters
    ----------
    amplitude : float
        A in m, not negative.
    frequency : float
        f in Hz, positive: turns per second, not radians.
    phase : float
        φ in rad at t = 0 (not at t_start). A phase of 0 at t_start = 0 begins with a jolt, for the wall then moves at
        2π f A at once; π/2 does not.

    Raises
    ------
    TypeError, ValueError
        For what is no such number.

    Notes
    -----
    Engines read it as eight polynomials of degree 16 a turn, wrong by less than 3e-20 A, and keep f·t as a fraction of
    a turn in two floats: a million periods cost no digits.
    """

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        fix = "a phase of π turns the motion round"
        self.__dict__["amplitude"] = _check.number("amplitude", self.amplitude, at_least=0.0, at_most=LARGEST, fix=fix)
        fix = "for a wall that does not move give none"
        self.__dict__["frequency"] = _check.number("frequency", self.frequency, above=0.0, fix=fix)
        self.__dict__["phase"] = _check.number("phase", self.phase)
        largest = self.omega * self.omega * self.amplitude
        _check.number("(2π frequency)² amplitude", largest, at_least=0.0, at_most=LARGEST)

    @classmethod
    def from_acceleration(cls, gamma: float, frequency: float, gravity: float = 9.81, phase: float = 0.0) -> Sine:
        """Return the motion whose largest acceleration is Γ = A (2π f)² / g times gravity.

        Parameters
        ----------
        gamma : float
            Γ, not negative; balls that rest on the wall leave it above 1.
        frequency : float
            f in Hz, positive.
        gravity : float
            g in m/s², positive.
        phase : float
            φ in rad.
        """
        largest = _check.number("gamma", gamma, at_least=0.0) * _check.number("gravity", gravity, above=0.0)
        omega = 2.0 * math.pi * _check.number("frequency", frequency, above=0.0)
        return cls(largest / (omega * omega), frequency, phase)

    @property
    def omega(self) -> float:
        """2π f in rad/s."""
        return 2.0 * math.pi * self.frequency

    def displacement(self, t: float) -> float:
        """Return m(t) in m."""
        return self._panels.displacement(t)

    def velocity(self, t: float) -> float:
        """Return m'(t) in m/s."""
        return self._panels.velocity(t)

    def acceleration(self, t: float) -> float:
        """Return m''(t) in m/s²."""
        return self._panels.acceleration(t)

    def phases(self, times: Array) -> Array:
        """Return the phases (2π f t + φ)/2π as fractions of a turn, from 0 to 1, at times in s; late ones lose no
        digits."""
        wall = plain(self._panels.records()[0])[0]
        return np.array([path.phase(wall, t, 0.0) for t in times.tolist()])

    def panels(self, t_start: float = 0.0, t_end: float = math.inf) -> Panels:
        """Return what engines read; it holds for all times."""
        return self._panels

    @cached_property
    def _panels(self) -> Panels:
        from fractions import Fraction

        half = math.pi / PER_TURN
        s, c = math.sin(half), math.cos(half)  # eighths by symmetry: the sine of 15π/8 as computed is less exact
        sine = np.array([s, c, c, s, -s, -c, -c, -s])
        cycle = sine, np.roll(sine, -2), -sine, -np.roll(sine, -2)
        series = [cycle[j % 4] * (self.amplitude * half**j / math.factorial(j)) for j in range(17)]
        turn = Fraction(self.phase) / Fraction(*TWO_PI) % 1
        high = float(turn)
        edges = np.arange(PER_TURN + 1) / PER_TURN
        error = self.amplitude * half**17 / math.factorial(17)
        return Panels(edges, np.array(series).T, error, self.frequency, (high, float(turn - Fraction(high))))

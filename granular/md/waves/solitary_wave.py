"""The solitary wave of balls that just touch, exact for the discrete chain.

The wave of the continuum is only an approximation to it. A wave of constant shape, δ_j(t) = δ_max φ(j - ct), turns
Newton's equation of a chain with F = A δ^p into

    c² φ''(x) = φ^p(x - 1) - 2 φ^p(x) + φ^p(x + 1),

with c in balls per √(m / (A δ_max^(p-1))). Two integrations give φ = Λ * φ^p / c² with the triangle Λ(x) = 1 - |x| on
[-1, 1] (English & Pego 2005). Repeated convolution and division by the peak converges to φ, and the peak to c². The
wave decays doubly exponentially, so a Fourier series on a few diameters is accurate to all digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.check import Array
from granular.laws.contact_law import instance, resolve
from granular.scene import Scene, in_order

PERIOD_DIAMETERS, PERIOD_POINTS = 32.0, 1024
"""Length of the period in diameters, and number of points on it.

Sufficient for all allowed exponents."""
SMALLEST_EXPONENT, LARGEST_EXPONENT = 1.1, 8.0
"""Range of exponents.

For smaller ones the wave is longer than the period, for larger ones too steep for its points."""
MAX_CONVOLUTIONS = 1000
ROUNDING_OVERLAP_SHARE = 1e-16
"""Share of the largest overlap below which overlaps are rounding errors.

They are set to 0."""
MIN_WAVE_REACH = 5.0
"""Minimum extent of the wave in diameters on either side of its peak in a scene."""


@check.face
@dataclass(frozen=True, eq=False)
class SolitaryWave:
    """Shape and speed of the solitary wave of exponent p, in dimensionless units.

    The units are m = A = δ_max = 1 and a distance of 1 between balls.

    Parameters
    ----------
    exponent : float
        p of F = A δ^p, from 1.1 to 8, 3/2 is Hertz.

    Notes
    -----
    In general, overlaps are in units of δ_max and times in units of √(m / (A δ_max^(p-1))). The wave moves at c √(A
    δ_max^(p-1) / m) balls per second, and balls at up to `peak_velocity` √(A δ_max^(p+1) / m).
    """

    exponent: float

    def __post_init__(self) -> None:
        check.number("exponent", self.exponent, at_least=SMALLEST_EXPONENT, at_most=LARGEST_EXPONENT,
                      fix="With 1 there are no solitary waves. Close to 1 they are long, far above it steep.")

    @property
    def speed(self) -> float:
        """Speed c in balls per unit of time."""
        return math.sqrt(_series(self.exponent)[1])

    @property
    def peak_velocity(self) -> float:
        """Largest velocity of a ball."""
        return float(self.velocity(-0.5))

    def overlap(self, x: Any) -> Array:
        """Return φ at distances x in balls from the peak, |x| at most 16."""
        series, c2 = _series(self.exponent)
        return np.maximum(_cosines(series * _box() ** 2 / c2, _inside(x)), 0.0)

    def force(self, x: Any) -> Array:
        """Return φ^p at distances x in balls from the peak."""
        return np.maximum(_cosines(_series(self.exponent)[0], _inside(x)), 0.0)

    def velocity(self, x: Any) -> Array:
        """Return the velocity of the ball behind the contact at x.

        It is (1/c) ∫ φ^p from x to x + 1, largest at x = -1/2.
        """
        return _cosines(_series(self.exponent)[0] * _box() / self.speed, _inside(x) + 0.5)

    def width(self, share: float) -> float:
        """Return the length in diameters on which the force exceeds a share of its peak.

        `share` is between 1e-12 and 1.
        """
        part = check.number("share", share, at_least=1e-12, at_most=1.0, fix="Smaller forces are rounding errors.")
        low, high = 0.0, 0.5 * PERIOD_DIAMETERS
        # bisection down to neighbouring floats
        while (middle := 0.5 * (low + high)) not in (low, high):
            low, high = (middle, high) if self.force(middle) > part else (low, middle)
        return low + high


@check.face
def solitary(
    n: int = 40, speed: float = 0.1, *, law: Any, at: float = 6.0, radius: float = 0.009525, density: float = 8027.0
) -> Scene:
    """Return a row of equal touching balls with the exact solitary wave.

    The wave moves to the right.

    Parameters
    ----------
    n : int
        Number of balls.
    speed : float
        Largest velocity of a ball in m/s, far below the speed of the wave.
    law : force law
        F = A ξ^p without damping, p from 1.1 to 8, the same in all pairs.
    at : float
        Position of the force peak, between the balls `at` - 1/2 and `at` + 1/2, counted from 0. At least 5 from both
        ends.
    radius : float
        Radius of a ball in m.
    density : float
        Density in kg/m³ (steel).

    Returns
    -------
    Scene
        Free at both ends, without gravity.

    Raises
    ------
    TypeError, ValueError
        If the law is not such a power, or if the wave does not fit into the row.

    Notes
    -----
    In m/s the wave moves at 2R c √(A δ_max^(p-1) / m), c = `SolitaryWave.speed`. Its largest overlap is δ_max = (v
    √(m/A) / `SolitaryWave.peak_velocity`)^(2/(p+1)).
    """
    count = check.whole("n", n, at_least=math.ceil(2.0 * MIN_WAVE_REACH) + 1, fix="A wave is five balls long.")
    r, rho = check.number("radius", radius, above=0.0, at_most=1e100), check.number("density", density, above=0.0)
    v, m = check.number("speed", speed, above=0.0), 4.0 / 3.0 * math.pi * r**3 * rho
    place = check.number(
        "at", at, at_least=MIN_WAVE_REACH, at_most=count - 1.0 - MIN_WAVE_REACH, fix="The wave must lie within the row."
    )
    row = Scene(np.full(count, m), np.full(count, r), np.zeros(count - 1), np.zeros(count))
    form = resolve(instance("law", law), row.pairs[0]).form
    if form is None or form[2] != 0.0:
        raise ValueError(f"`law` must be F = A ξ^p without damping, such as Hertz, got {law!r}. Other laws have no "
                         "exact solitary wave.")
    wave = SolitaryWave(form[1])
    deepest = (v * math.sqrt(m / form[0]) / wave.peak_velocity) ** (2.0 / (wave.exponent + 1.0))
    x = np.arange(count) - 0.5 - place  # distance of the contact before each ball from the peak
    overlap, velocity = wave.overlap(x[1:]), wave.velocity(x)
    overlap[overlap < ROUNDING_OVERLAP_SHARE] = 0.0
    velocity[velocity < ROUNDING_OVERLAP_SHARE] = 0.0
    return in_order(row.replace(gap=0.0 - deepest * overlap, velocity=v / wave.peak_velocity * velocity))


@cache
def _series(p: float) -> tuple[Array, float]:
    """Return the cosine series of φ^p, and c²."""
    triangle = _box() ** 2
    phi, before = (
        np.maximum(0.0, 1.0 - 0.5 * np.abs(np.fft.fftfreq(PERIOD_POINTS, 1.0 / PERIOD_DIAMETERS))) ** 2,
        math.inf,
    )
    for _ in range(MAX_CONVOLUTIONS):
        raw = np.fft.irfft(np.fft.rfft(phi**p) * triangle, PERIOD_POINTS)
        new = np.maximum(raw / raw[0], 0.0)
        step = float(np.abs(new - phi).max())
        phi = new
        if step < 1e-15 and step >= before:  # converged: changes no longer decrease
            break
        before = step
    series = np.fft.rfft(phi**p).real / PERIOD_POINTS
    # the real transform stores each pair ±k once, except the first and the last term
    series[1:-1] *= 2.0
    return series, float((series * triangle).sum())


@cache
def _wave_numbers() -> Array:
    return np.asarray(2.0 * math.pi * np.fft.rfftfreq(PERIOD_POINTS, PERIOD_DIAMETERS / PERIOD_POINTS))


def _box() -> Array:
    """Return the transform of 1 on [-1/2, 1/2].

    Its square is the transform of the triangle.
    """
    return np.asarray(np.sinc(_wave_numbers() / (2.0 * math.pi)))


def _cosines(series: Array, x: Array) -> Array:
    return np.asarray(np.cos(np.multiply.outer(x, _wave_numbers())) @ series)


def _inside(x: Any) -> Array:
    """Return distances from the peak, limited to half a period, where the wave is 0."""
    return np.clip(
        check.array("x", x, ..., finite="a finite distance in balls"), -0.5 * PERIOD_DIAMETERS, 0.5 * PERIOD_DIAMETERS
    )

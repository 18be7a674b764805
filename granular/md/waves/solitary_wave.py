"""Solitary wave in a chain of balls that just touch, exact for the discrete chain.

A wave of constant shape, δ_j(t) = δ_max φ(j - ct), turns
Newton's equation of a chain with F = A δ^p into

    c² φ''(x) = φ^p(x - 1) - 2 φ^p(x) + φ^p(x + 1),

with c in balls per √(m / (A δ_max^(p-1))). Two integrations give φ = Λ * φ^p / c² with the triangle Λ(x) = 1 - |x| on
[-1, 1] (English & Pego 2005). This convolution is repeated, and each result is divided by its peak value. The results
converge to φ, and the peak values to c². The wave decays doubly exponentially, so a Fourier series on a few diameters
is accurate to all digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.check import Array
from granular.laws.contact_law import instance, resolve
from granular.scene import Scene, in_order

PERIOD_DIAMETERS, PERIOD_POINTS = 32.0, 1024
"""Period of the Fourier series in diameters, and its number of points.

They suffice for all allowed exponents."""
SMALLEST_EXPONENT, LARGEST_EXPONENT = 1.1, 8.0
"""Range of the exponent p of the force law.

For smaller exponents the wave is longer than the period, for larger exponents too steep for its points."""
MAX_CONVOLUTIONS = 1000
ROUNDING_OVERLAP_RATIO = 1e-16
"""Largest rounding error, relative to the largest overlap or velocity.

Smaller overlaps and velocities are set to 0."""
MIN_WAVE_REACH = 5.0
"""Minimum distance in diameters from the peak of the wave to each end of the row."""


@signature.face
@dataclass(frozen=True, eq=False)
class SolitaryWave:
    """Shape and speed of the solitary wave of exponent p, in dimensionless units.

    The units are m = A = δ_max = 1 and a distance of 1 between balls.

    Parameters
    ----------
    exponent : float
        p of F = A δ^p, from 1.1 to 8. For Hertz's law p is 3/2.

    Notes
    -----
    For other values, multiply overlaps by δ_max and times by √(m / (A δ_max^(p-1))). The wave moves at c √(A
    δ_max^(p-1) / m) balls per second. The largest velocity of a ball is `peak_velocity` √(A δ_max^(p+1) / m).
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
        """Largest velocity of a ball, in units of √(A δ_max^(p+1) / m)."""
        return float(self.velocity(-0.5))

    def overlap(self, x: Any) -> Array:
        """Return the overlap φ at distances x from the peak, in balls.

        Beyond a distance of 16 balls the value at 16 is returned.
        """
        series, c2 = _series(self.exponent)
        return np.maximum(_evaluate_series(series * _box_transform() ** 2 / c2, _clipped_distance(x)), 0.0)

    def force(self, x: Any) -> Array:
        """Return the force φ^p at distances x from the peak, in balls."""
        return np.maximum(_evaluate_series(_series(self.exponent)[0], _clipped_distance(x)), 0.0)

    def velocity(self, x: Any) -> Array:
        """Return the velocity of the ball after the contact at distance x from the peak.

        It is (1/c) ∫ φ^p from x to x + 1, and is largest at x = -1/2.
        """
        return _evaluate_series(_series(self.exponent)[0] * _box_transform() / self.speed, _clipped_distance(x) + 0.5)

    def width(self, share: float) -> float:
        """Return the width of the wave at the fraction `share` of its peak force.

        This is the length in diameters on which the force exceeds that fraction of its peak. `share` is between 1e-12
        and 1.
        """
        fraction = check.number("share", share, at_least=1e-12, at_most=1.0, fix="Smaller forces are rounding errors.")
        low, high = 0.0, 0.5 * PERIOD_DIAMETERS
        # bisection down to neighbouring floats
        while (middle := 0.5 * (low + high)) not in (low, high):
            low, high = (middle, high) if self.force(middle) > fraction else (low, middle)
        return low + high


@signature.face
def solitary(
    n: int = 40, speed: float = 0.1, *, law: Any, at: float = 6.0, radius: float = 0.009525, density: float = 8027.0
) -> Scene:
    """Return a row of equal touching balls in which an exact solitary wave moves.

    The wave moves to the right.

    Parameters
    ----------
    n : int
        Number of balls. Defaults to 40.
    speed : float
        Largest velocity of a ball in m/s, far below the speed of the wave. Defaults to 0.1.
    law : force law
        F = A ξ^p without damping, p from 1.1 to 8, the same in all pairs.
    at : float
        Position of the force peak, between the balls `at` - 1/2 and `at` + 1/2, counted from 0. Its distance from both
        ends of the row is at least 5. Defaults to 6.
    radius : float
        Radius of a ball in m. Defaults to 0.009525.
    density : float
        Density in kg/m³. Defaults to 8027 (steel).

    Returns
    -------
    Scene
        A row with free ends, without gravity.

    Raises
    ------
    TypeError, ValueError
        If the law is not such a power, or if the wave does not fit into the row.

    Notes
    -----
    In m/s the wave moves at 2R c √(A δ_max^(p-1) / m), c = `SolitaryWave.speed`. Its largest overlap is δ_max = (v
    √(m/A) / `SolitaryWave.peak_velocity`)^(2/(p+1)).
    """
    count = check.integer("n", n, at_least=math.ceil(2.0 * MIN_WAVE_REACH) + 1, fix="A wave is five balls long.")
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
    overlap[overlap < ROUNDING_OVERLAP_RATIO] = 0.0
    velocity[velocity < ROUNDING_OVERLAP_RATIO] = 0.0
    return in_order(row.replace(gap=0.0 - deepest * overlap, velocity=v / wave.peak_velocity * velocity))


@cache
def _series(p: float) -> tuple[Array, float]:
    """Return the coefficients of the cosine series of φ^p, and c².

    φ is the overlap of the solitary wave of exponent `p`, and c its speed.
    """
    triangle = _box_transform() ** 2
    phi, previous_change = (
        np.maximum(0.0, 1.0 - 0.5 * np.abs(np.fft.fftfreq(PERIOD_POINTS, 1.0 / PERIOD_DIAMETERS))) ** 2,
        math.inf,
    )
    for _ in range(MAX_CONVOLUTIONS):
        raw = np.fft.irfft(np.fft.rfft(phi**p) * triangle, PERIOD_POINTS)
        new_phi = np.maximum(raw / raw[0], 0.0)
        change = float(np.abs(new_phi - phi).max())
        phi = new_phi
        if change < 1e-15 and change >= previous_change:  # converged: changes no longer decrease
            break
        previous_change = change
    series = np.fft.rfft(phi**p).real / PERIOD_POINTS
    # the real transform stores each pair ±k once, except the first and the last term
    series[1:-1] *= 2.0
    return series, float((series * triangle).sum())


@cache
def _wave_numbers() -> Array:
    """Return the wave numbers of the Fourier series, in rad per diameter."""
    return np.asarray(2.0 * math.pi * np.fft.rfftfreq(PERIOD_POINTS, PERIOD_DIAMETERS / PERIOD_POINTS))


def _box_transform() -> Array:
    """Return the Fourier transform of the box function, 1 on [-1/2, 1/2].

    Its square is the transform of the triangle Λ.
    """
    return np.asarray(np.sinc(_wave_numbers() / (2.0 * math.pi)))


def _evaluate_series(series: Array, x: Array) -> Array:
    """Return the cosine series with coefficients `series` at distances `x`."""
    return np.asarray(np.cos(np.multiply.outer(x, _wave_numbers())) @ series)


def _clipped_distance(x: Any) -> Array:
    """Return distances from the peak, limited to half a period.

    There the wave is 0 to rounding.
    """
    return np.clip(
        check.array("x", x, ..., finite="a finite distance in balls"), -0.5 * PERIOD_DIAMETERS, 0.5 * PERIOD_DIAMETERS
    )

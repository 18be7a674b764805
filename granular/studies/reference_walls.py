"""Wall motions and thermal walls for the reference solvers, with any precision.

A motion is evaluated from its definition, a sine or polynomials, without the code of the engines. Its velocity and
derivatives form a chain y_0' = y_1, y_1' = y_2, … The rate of the last derivative is `last` times y_0: 0 for a
polynomial, -ω² for a sine. Numbers belong to `mp`, an mpmath context, or `math` (floats).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import reduce
from itertools import pairwise
from typing import Any

from granular.scene import Scene
from granular.scene.walls import Panels, Piecewise, Sine, Thermal

Number = Any
"""A float, or an mpmath number of the context in use."""


def value(p: Sequence[Number], x: Number) -> Number:
    """Return the value at x of the polynomial Σ p_j x^j."""
    return reduce(lambda total, a: total * x + a, reversed(p), 0 * x)


class Harmonic:
    """Sinusoidal motion in addition to a wall's constant velocity, exact at any time.

    Attributes
    ----------
    last : number
        Rate of the last element of `rates`, divided by the first element, in 1/s².
    fastest : number
        Upper bound of the speed in m/s.
    """

    def __init__(self, mp: Any, motion: Sine) -> None:
        self.mp, number = mp, getattr(mp, "mpf", float)
        self.frequency, self.phase, self.amplitude = map(number, (motion.frequency, motion.phase, motion.amplitude))
        self.omega = 2 * mp.pi * self.frequency
        self.last, self.fastest = -self.omega * self.omega, self.amplitude * self.omega

    def moved(self, t: Number) -> Number:
        """Return the displacement m(t) in m, up to a constant."""
        return self.amplitude * self.mp.sin(self.omega * t + self.phase)

    def rates(self, t: Number) -> list[Number]:
        """Return velocity in m/s, acceleration in m/s², and so on, at least two values.

        At a break of a path, the values after the break are returned.
        """
        mp, angle = self.mp, self.omega * t + self.phase
        return [self.amplitude * self.omega * mp.cos(angle), self.amplitude * self.last * mp.sin(angle)]

    def above(self, t: Number, side: int) -> Number:
        """Return the distance in m from the position at time `t` to an extreme position.

        The extreme is the upper one for `side` 1, and the lower one for -1.
        """
        return self.amplitude - side * self.moved(t)

    def until(self, t: Number) -> Number:
        """Return the time in s of the next break of the path, for a sine one period later."""
        return t + 1 / self.frequency


class Pieces:
    """Piecewise polynomial motion of a wall, with the methods of `Harmonic`.

    Parameters
    ----------
    mp : context
        mpmath context, or `math`.
    edges : sequence of numbers
        Times in s at which polynomials begin or end, increasing.
    centres : sequence of numbers
        Time t_k in s of each polynomial, a polynomial in t - t_k.
    series : list of lists
        Coefficients of each polynomial, in m/s^j. Jumps between polynomials are removed, because they are rounding
        errors.
    """

    last: Number = 0

    def __init__(self, mp: Any, edges: Sequence[Number], centres: Sequence[Number], series: list[list[Number]]) -> None:
        self.mp, self.edges, self.centres = mp, list(edges), centres
        for k in range(1, len(series)):  # small steps are rounding
            before, after = (value(series[i], edges[k] - centres[i]) for i in (k - 1, k))
            series[k][0] += before - after
        self.derived = [_derivatives(c) for c in series]
        reaches = [max(b - c, c - a) for a, b, c in zip(edges, edges[1:], centres, strict=False)]
        self.fastest = max(value(list(map(abs, p[1])), x) for p, x in zip(self.derived, reaches, strict=True))

    def _at(self, t: Number) -> tuple[int, Number]:
        k = min(max(bisect_right(self.edges, t) - 1, 0), len(self.derived) - 1)
        return k, t - self.centres[k]

    def moved(self, t: Number) -> Number:
        k, x = self._at(t)
        return value(self.derived[k][0], x)

    def rates(self, t: Number) -> list[Number]:
        k, x = self._at(t)
        return [value(p, x) for p in self.derived[k][1:]]

    def above(self, t: Number, side: int) -> Number:
        return self.mp.inf

    def until(self, t: Number) -> Number:
        later = [edge for edge in self.edges if edge > t]
        return later[0] if later else self.mp.inf


def _derivatives(c: list[Number]) -> list[list[Number]]:
    """Return a polynomial and its derivatives, at least two of them.

    The last derivative is constant.
    """
    out = [c]
    while len(out) < 3 or len(out[-1]) > 1:
        out.append([j * a for j, a in enumerate(out[-1])][1:] or [0 * c[0]])
    return out


Path = Harmonic | Pieces
"""Motion of a wall in addition to its constant velocity."""


def path(mp: Any, motion: Any) -> Path:
    """Return the path of a wall with a sine, a piecewise polynomial or panels.

    Raises
    ------
    ValueError
        For panels of a periodic motion, and for other motions.
    """
    number = getattr(mp, "mpf", float)
    if isinstance(motion, Sine):
        return Harmonic(mp, motion)
    if isinstance(motion, Piecewise):
        columns = motion.coefficients[::-1].T.tolist()
        breaks = list(map(number, motion.breaks.tolist()))
        return Pieces(mp, breaks, breaks[:-1], [list(map(number, column)) for column in columns])
    if not isinstance(motion, Panels) or motion.frequency:
        raise ValueError(f"The wall motion must be a Sine, a Piecewise or non-periodic Panels, got {motion!r}.")
    edges = list(map(number, motion.edges.tolist()))
    centres = [(a + b) / 2 for a, b in pairwise(edges)]
    halves = [(b - a) / 2 for a, b in pairwise(edges)]
    series = [[number(a) / h**j for j, a in enumerate(c)] for c, h in zip(motion.series.tolist(), halves, strict=True)]
    return Pieces(mp, edges, centres, series)


def paths(mp: Any, scene: Scene) -> dict[int, Path]:
    """Return the paths of the driven walls of a scene, by the number of their body.

    The constant velocities of the walls are not included.
    """
    ends = zip((0, scene.n - 1), scene.motions, strict=True)
    return {body: path(mp, motion) for body, motion in ends if motion is not None}


class Heat:
    """One thermal wall.

    Attributes
    ----------
    wall, ball : int
        Numbers of the wall and of its neighbouring ball.
    side : int
        0 for a floor, 1 for a ceiling.
    """

    def __init__(self, scene: Scene, side: int, how: Thermal) -> None:
        self.wall, self.ball, self.side = (scene.n - 1) * side, 1 if side == 0 else scene.n - 2, side
        self.how, self.mass, self.hits = how, float(scene.mass[self.ball]), 0

    def next_speed(self) -> float:
        """Return the speed in m/s with which the ball leaves the wall after its next hit."""
        self.hits += 1
        return self.how.drawn(self.side, self.hits - 1, self.mass)


def heats(scene: Scene) -> dict[int, Heat]:
    """Return the thermal walls of a scene, by the number of their pair."""
    ends = zip((0, 1), (0, scene.n_pairs - 1), scene.thermal_walls, strict=True)
    return {pair: Heat(scene, side, how) for side, pair, how in ends if how is not None}

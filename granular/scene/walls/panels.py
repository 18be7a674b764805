"""Motion of a wall as one polynomial per panel of time, with bounds on each panel.

On panel k the motion is Σ_j c_kj x^j in m, where x goes from -1 to 1 between the edges of the panel. Edges are times in
s, or for a periodic motion turns (fractions of the period). All bounds are computed from Bernstein coefficients on
[-1, 1]. They are therefore rigorous, and tight on short panels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.check import Array, ByNumbers
from granular._engine.records import plain
from granular.scene.walls import path
from granular.scene.walls.path import MAX_TERMS, PANEL_DTYPE, WALL_DTYPE


class _PanelMotion:
    """Base class of motions whose polynomials do not depend on the run."""

    @property
    def _panels(self) -> Panels:
        raise NotImplementedError

    def displacement(self, t: float) -> float:
        """Return m(t) in m."""
        return self._panels._at(t)[0]

    def velocity(self, t: float) -> float:
        """Return m'(t) in m/s. At an edge of a panel it is the value after the edge."""
        return self._panels._at(t)[1]

    def acceleration(self, t: float) -> float:
        """Return m''(t) in m/s². At an edge of a panel it is the value after the edge."""
        return self._panels._at(t)[2]


@signature.face
@dataclass(frozen=True, eq=False, repr=False)
class Panels(_PanelMotion, ByNumbers):
    """Motion m(t) of a wall as polynomials on panels of time.

    A `Motion` is converted to panels for a run, and is saved in this form.

    Parameters
    ----------
    edges : (n+1,) array
        Ends of the panels in s, increasing.
    series : (n, k) array
        Coefficients in m of 1, x, x², …, where x goes from -1 to 1 on each panel; k ≤ 20.
    error : float
        Maximum deviation in m from the motion that the polynomials approximate. Defaults to 0.
    frequency, turn : float, (float, float)
        Frequency f in Hz and phase at t = 0 of a periodic motion. Then edges are turns from 0 to 1. The time t
        corresponds to the fractional part of f·t + turn, where `turn` is the sum of two floats. By default the motion
        is not periodic.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.
    """

    edges: Array
    series: Array
    error: float = 0.0
    frequency: float = 0.0
    turn: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        edges = check.increasing_array("edges", self.edges, "a finite time")
        columns = (*check.array("series", self.series, ..., fix="Give one row per panel.").shape, MAX_TERMS, MAX_TERMS)[
            1
        ]
        if columns > MAX_TERMS:
            raise ValueError(
                f"`series` must have at most {MAX_TERMS} coefficients per panel, got {columns}. Use shorter "
                "panels of a lower degree."
            )
        series = check.array("series", self.series, (len(edges) - 1, columns), fix="Give one row per panel.",
                              finite="a finite coefficient")
        if self.frequency and (edges[0] != 0.0 or edges[-1] != 1.0):
            raise ValueError(f"`edges` must go from 0 to 1 turns if a frequency is given, got {edges[0]:g} to "
                             f"{edges[-1]:g}.")
        turn = self.turn if isinstance(self.turn, (list, tuple)) else ()
        if len(turn) != 2:
            raise ValueError(f"`turn` must be two numbers, a float and its rounding error, got {self.turn!r}.")
        self.__dict__.update(
            edges=edges, series=series, error=check.number("error", self.error, at_least=0.0),
            frequency=check.number("frequency", self.frequency, at_least=0.0),
            turn=tuple(check.number(f"turn[{i}]", part) for i, part in enumerate(turn)),
        )

        self._check_joints()

    def _check_joints(self) -> None:
        """Raise `ValueError` if the position, or the velocity of a periodic motion, jumps."""
        jumps, largest = self._edge_jumps(0), float(np.abs(self.series).max())
        i = int(np.argmax(np.abs(jumps)))
        if abs(jumps[i]) > 1e-9 * largest + 2.0 * self.error:
            raise ValueError(f"`series` must be continuous, got a jump of {jumps[i]:g} m where panel {i} begins. Begin "
                             "each panel where the previous panel ends.")
        kinks, max_rate = self._edge_jumps(1), float(np.abs(_derivative(self.series, 1)).max())
        i = int(np.argmax(np.abs(kinks)))
        if self.frequency and abs(kinks[i]) > 1e-9 * max_rate / float(np.diff(self.edges).min()):
            raise ValueError("`series` must have a continuous velocity if a frequency is given, got a jump of "
                             f"{kinks[i] * self.frequency:g} m/s where panel {i} begins. Round the corners, or give "
                             "all turns without a frequency.")

    def _edge_jumps(self, order: int) -> Array:
        """Return the jumps (n,) of a derivative of the motion at the start of each panel.

        `order` is the order of the derivative with respect to the time in the unit of the edges (s or turns). The first
        jump is 0 if the motion is not periodic.
        """
        c = (_derivative(self.series, order).T * (2.0 / np.diff(self.edges)) ** order).T
        # Chebyshev series on [-1, 1]: value at the start of each panel, minus value at the end of the previous panel
        jumps: Array = c @ (-1.0) ** np.arange(c.shape[1]) - np.roll(c.sum(axis=1), 1)
        jumps[0] = jumps[0] if self.frequency else 0.0
        return jumps

    def __repr__(self) -> str:
        end = f"{self.frequency:g} Hz" if self.frequency else f"{self.edges[0]:g} … {self.edges[-1]:g} s"
        return f"Panels({len(self.series)} polynomials, {end})"

    @property
    def _panels(self) -> Panels:
        return self

    __call__ = _PanelMotion.displacement

    def panels(self, t_start: float, t_end: float) -> Panels:
        """Return this object if it covers the time from `t_start` to `t_end` (s).

        `ValueError` is raised otherwise.
        """
        if self.frequency:
            return self
        first, last = float(self.edges[0]), float(self.edges[-1])
        fix = "The path of the wall covers only this interval."
        check.number("t_start", t_start, at_least=first, at_most=last, fix=fix)
        check.number("t_end", t_end, at_least=first, at_most=last, finite=False, fix=fix)
        return self

    def records(
        self,
        side: float = 1.0,
        *,
        start: float = 0.0,
        velocity: float = 0.0,
        t_start: float | None = None,
        first: int = 0,
    ) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        """Return the records of a wall and of its panels, which kernels read.

        Parameters
        ----------
        side : float
            1 for a floor, -1 for a ceiling.
        start, velocity, t_start : float
            Position (m) of the wall at `t_start` (s), and its constant velocity (m/s). `t_start` defaults to the first
            edge.
        first : int
            Index of the first panel of this wall, if the panels of several walls are stored in one array. Defaults
            to 0.

        Returns
        -------
        wall, panels : arrays
            One record `WALL_DTYPE`, and one record `PANEL_DTYPE` per panel.
        """
        rate = self.frequency or 1.0
        wall, rows = np.zeros(1, WALL_DTYPE), np.zeros(len(self.series), PANEL_DTYPE)
        left, right, c = self.edges[:-1], self.edges[1:], side * self.series
        half = 0.5 * (right - left)
        per = rate / half
        derivatives = [(_derivative(c, order).T * per**order).T for order in range(5)]
        (low, high), (min_velocity, max_velocity), (least, most), (fall, rise), (min_snap, max_snap) = map(
            _polynomial_bounds, derivatives)
        rows["series"][:, : c.shape[1]] = c
        _set_fields(rows, left=left, right=right, centre=0.5 * (left + right), half=half, per=per, most=most,
              least=least, rise=rise.clip(min=0.0), fall=fall.clip(max=0.0), bend=max_snap.clip(min=0.0),
              bow=-min_snap.clip(max=0.0),
              degree=(np.arange(c.shape[1]) * (c != 0.0)).max(axis=1),
              jump=self._velocity_jumps(side, max_velocity.max() - min_velocity.min()))
        begin = float(left[0]) if t_start is None else t_start
        _set_fields(wall, side=side, panels=len(rows), density=len(rows) / (right[-1] - left[0]),
              periodic=self.frequency > 0.0, frequency=rate, turn=self.turn[0], turn_low=self.turn[1], start=start,
              velocity=velocity, begin=begin, error=self.error, reach=high.max(), extent=max(high.max(), -low.min()),
              # nan in `about` means that no expansion is cached
              speed=max(max_velocity.max(), -min_velocity.min()), stiff=max(most.max(), -least.min()), about=np.nan)
        _set_fields(wall, origin=path.moved(plain(wall)[0], plain(rows), begin, 0.0)[0], first=first)
        return wall, rows

    def _velocity_jumps(self, side: float, scale: float) -> Array:
        """Return the jumps (n,) of the velocity of side·m (m/s) at the left edges.

        Jumps below 1e-11 of `scale` (m/s) are rounding errors and are set to 0. The first jump is 0. A periodic motion
        has no jumps.
        """
        if self.frequency or len(self.series) == 1:
            return np.zeros(len(self.series))
        jump = side * self._edge_jumps(1)
        # smaller jumps are rounding errors of the derivatives
        return np.where(np.abs(jump) > 1e-11 * scale, jump, 0.0)

    @cached_property
    def speed(self) -> float:
        """Upper bound of |m'| in m/s."""
        return float(self._plain_records[0].speed)

    @cached_property
    def _plain_records(self) -> tuple[Any, list[Any]]:
        """Records of the wall and of its panels as plain objects, for side 1."""
        wall, rows = self.records()
        return plain(wall)[0], plain(rows)

    def at(self, t: float, tail: float = 0.0) -> tuple[float, float, float]:
        """Return m (m), its velocity (m/s) and its acceleration (m/s²) at t + tail (s)."""
        wall, rows = self._plain_records
        x, v, a = path.moved(wall, rows, t, tail)
        return x, v, a

    def _at(self, t: float) -> tuple[float, float, float]:
        time = check.number("t", t)
        if not self.frequency:
            self.panels(time, time)
        return self.at(time)


def _set_fields(records: np.ndarray[Any, Any], **columns: Any) -> None:
    """Set the fields of all records of an array, given as name=values."""
    for name, column in columns.items():
        records[name] = column


def _derivative(series: Array, order: int) -> Array:
    """Return the coefficients of a derivative of n polynomials with respect to x.

    `series` has the shape (n, k), lowest power first. The derivative of order `order` has `order` columns fewer, but at
    least one.
    """
    for _ in range(order):
        series = series[:, 1:] * np.arange(1, series.shape[1]) if series.shape[1] > 1 else 0.0 * series
    return series


def _polynomial_bounds(series: Array) -> tuple[Array, Array]:
    """Return guaranteed lower and upper bounds (n,) of n polynomials on [-1, 1].

    They are the smallest and the largest Bernstein coefficients, with a margin for rounding errors. `series` has the
    shape (n, k), lowest power first.
    """
    bernstein, slack = series @ _bernstein_matrix(series.shape[1] - 1), 2.0**-48 * np.abs(series).sum(axis=1)
    return bernstein.min(axis=1) - slack, bernstein.max(axis=1) + slack


@cache
def _bernstein_matrix(n: int) -> Array:
    """Return the Bernstein coefficients (n+1, n+1) of 1, x, … x^n on [-1, 1].

    Row j belongs to x^j. No coefficient is above 1 in magnitude, so no digits are lost.
    """
    factors = np.array([math.comb(n, j) for j in range(n + 1)])
    columns = [np.polynomial.polynomial.polyfromroots([1.0] * (n - i) + [-1.0] * i) * (-1.0) ** (n - i) / factors
               for i in range(n + 1)]
    return np.ascontiguousarray(np.transpose(columns))

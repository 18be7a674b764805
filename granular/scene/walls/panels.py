"""Motion of a wall as polynomials on panels of time, with bounds on each panel.

Panel k is Σ_j c_kj x^j in m, x from -1 to 1 between its edges. Time is in s, or in turns f·t of a period. All bounds
are computed from Bernstein coefficients on [-1, 1]. They are therefore rigorous, and tight on short panels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.check import Array, ByNumbers
from granular._engine.records import plain
from granular.scene.walls import path
from granular.scene.walls.path import MAX_TERMS, PANEL_DTYPE, WALL_DTYPE


class _OnPanels:
    """Common methods of motions whose panels are computed once."""

    @property
    def _panels(self) -> Panels:
        raise NotImplementedError

    def displacement(self, t: float) -> float:
        """Return m(t) in m."""
        return self._panels._at(t)[0]

    def velocity(self, t: float) -> float:
        """Return m'(t) in m/s; at a break, the value after the break."""
        return self._panels._at(t)[1]

    def acceleration(self, t: float) -> float:
        """Return m''(t) in m/s²; at a break, the value after the break."""
        return self._panels._at(t)[2]


@check.face
@dataclass(frozen=True, eq=False, repr=False)
class Panels(_OnPanels, ByNumbers):
    """Motion m(t) of a wall as polynomials on panels of time.

    A `Motion` is converted to panels for a run, and is saved in this form.

    Parameters
    ----------
    edges : (n+1,) array
        Ends of the panels in s, increasing.
    series : (n, k) array
        Coefficients in m of 1, x, x², …, x from -1 to 1 on each panel; k ≤ 20.
    error : float
        Largest deviation in m from the motion that the panels approximate. Defaults to 0.
    frequency, turn : float, (float, float)
        Frequency in Hz and phase of a periodic motion. Then edges are turns from 0 to 1, and the time t corresponds to
        f·t + turn, with `turn` in two floats. By default the motion is not periodic.

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
        edges = check.rising("edges", self.edges, "a finite time")
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
        """Raise `ValueError` if the path jumps, or if a periodic path has a corner."""
        steps, largest = self._steps(0), float(np.abs(self.series).max())
        i = int(np.argmax(np.abs(steps)))
        if abs(steps[i]) > 1e-9 * largest + 2.0 * self.error:
            raise ValueError(f"`series` must be continuous, got a jump of {steps[i]:g} m where panel {i} begins. Begin "
                             "each panel where the previous panel ends.")
        kinks, fastest = self._steps(1), float(np.abs(_derived(self.series, 1)).max())
        i = int(np.argmax(np.abs(kinks)))
        if self.frequency and abs(kinks[i]) > 1e-9 * fastest / float(np.diff(self.edges).min()):
            raise ValueError("`series` must have a continuous velocity if a frequency is given, got a jump of "
                             f"{kinks[i] * self.frequency:g} m/s where panel {i} begins. Round the corners, or give "
                             "all turns without a frequency.")

    def _steps(self, order: int) -> Array:
        """Return the jumps of a derivative at the start of each panel.

        Time is in the unit of the edges. The first jump is 0 if the path is not periodic.
        """
        c = (_derived(self.series, order).T * (2.0 / np.diff(self.edges)) ** order).T
        steps: Array = c @ (-1.0) ** np.arange(c.shape[1]) - np.roll(c.sum(axis=1), 1)
        steps[0] = steps[0] if self.frequency else 0.0
        return steps

    def __repr__(self) -> str:
        end = f"{self.frequency:g} Hz" if self.frequency else f"{self.edges[0]:g} … {self.edges[-1]:g} s"
        return f"Panels({len(self.series)} polynomials, {end})"

    @property
    def _panels(self) -> Panels:
        return self

    __call__ = _OnPanels.displacement

    def panels(self, t_start: float, t_end: float) -> Panels:
        """Return this object if the path covers the time from `t_start` to `t_end`, in s.

        Else raise `ValueError`.
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
        """Return the records that kernels read.

        Parameters
        ----------
        side : float
            1 for a floor, -1 for a ceiling.
        start, velocity, t_start : float
            Position (m) of the wall at `t_start` (s), and its constant velocity (m/s). `t_start` defaults to the first
            edge.
        first : int
            Index of the first panel, if the panels of several walls are stored in one array.

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
        within = [(_derived(c, order).T * per**order).T for order in range(5)]
        (low, high), (slow, fast), (least, most), (fall, rise), (sink, soar) = map(_span, within)
        rows["series"][:, : c.shape[1]] = c
        _fill(rows, left=left, right=right, centre=0.5 * (left + right), half=half, per=per, most=most,
              least=least, rise=rise.clip(min=0.0), fall=fall.clip(max=0.0), bend=soar.clip(min=0.0),
              bow=-sink.clip(max=0.0),
              degree=(np.arange(c.shape[1]) * (c != 0.0)).max(axis=1), jump=self._jumps(side, fast.max() - slow.min()))
        begin = float(left[0]) if t_start is None else t_start
        _fill(wall, side=side, panels=len(rows), density=len(rows) / (right[-1] - left[0]),
              periodic=self.frequency > 0.0, frequency=rate, turn=self.turn[0], turn_low=self.turn[1], start=start,
              velocity=velocity, begin=begin, error=self.error, reach=high.max(), extent=max(high.max(), -low.min()),
              # nan in `about` means that no expansion is cached
              speed=max(fast.max(), -slow.min()), stiff=max(most.max(), -least.min()), about=np.nan)
        _fill(wall, origin=path.moved(plain(wall)[0], plain(rows), begin, 0.0)[0], first=first)
        return wall, rows

    def _jumps(self, side: float, scale: float) -> Array:
        """Return the jumps of the velocity in m/s at left edges, without rounding errors.

        The jump at the first edge is 0.
        """
        if self.frequency or len(self.series) == 1:
            return np.zeros(len(self.series))
        jump = side * self._steps(1)
        # smaller jumps are rounding errors of the derivatives
        return np.where(np.abs(jump) > 1e-11 * scale, jump, 0.0)

    @cached_property
    def speed(self) -> float:
        """Upper bound of |m'| in m/s."""
        return float(self._plain[0].speed)

    @cached_property
    def _plain(self) -> tuple[Any, list[Any]]:
        wall, rows = self.records()
        return plain(wall)[0], plain(rows)

    def at(self, t: float, tail: float = 0.0) -> tuple[float, float, float]:
        """Return m(t + tail) in m, its rate in m/s and its acceleration in m/s²."""
        wall, rows = self._plain
        x, v, a = path.moved(wall, rows, t, tail)
        return x, v, a

    def _at(self, t: float) -> tuple[float, float, float]:
        time = check.number("t", t)
        if not self.frequency:
            self.panels(time, time)
        return self.at(time)


def _fill(records: np.ndarray[Any, Any], **columns: Any) -> None:
    """Write columns of records by their names."""
    for name, column in columns.items():
        records[name] = column


def _derived(series: Array, order: int) -> Array:
    """Return the coefficients (n, ·) of the derivative by x of polynomials (n, k).

    `order` is the order of the derivative.
    """
    for _ in range(order):
        series = series[:, 1:] * np.arange(1, series.shape[1]) if series.shape[1] > 1 else 0.0 * series
    return series


def _span(series: Array) -> tuple[Array, Array]:
    """Return certain lower and upper bounds (n,) of polynomials (n, k) on [-1, 1].

    They are the extreme Bernstein coefficients with a margin for rounding.
    """
    bernstein, slack = series @ _basis(series.shape[1] - 1), 2.0**-48 * np.abs(series).sum(axis=1)
    return bernstein.min(axis=1) - slack, bernstein.max(axis=1) + slack


@cache
def _basis(n: int) -> Array:
    """Return the Bernstein coefficients (n+1, n+1) on [-1, 1] of 1, x, … x^n.

    No coefficient is above 1, so no digits are lost.
    """
    factors = np.array([math.comb(n, j) for j in range(n + 1)])
    columns = [np.polynomial.polynomial.polyfromroots([1.0] * (n - i) + [-1.0] * i) * (-1.0) ** (n - i) / factors
               for i in range(n + 1)]
    return np.ascontiguousarray(np.transpose(columns))

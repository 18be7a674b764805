"""`Threshold`: where the hard picture begins or ceases to hold, as a value.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any

from granular.tables import Report
from granular.thresholds import figure, words
from granular.thresholds.criteria import FAILS, HOLDS, UNDECIDED, Value

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Crossing:
    """A change of the verdict.

    Attributes
    ----------
    low, high : Value
        The neighbouring values between which it lies; each was tried.
    """

    low: Value
    high: Value

    @property
    def value(self) -> float:
        """The middle of the two."""
        return 0.5 * self.low.value + 0.5 * self.high.value


@dataclass(frozen=True)
class Threshold(Report):
    """Where a scene may be event-driven along one parameter; print it, `plot` it, save it with `to_json`.

    Nothing is claimed beyond the values between which was scanned, nor of windows that lie between two neighbours of
    the scan with the same verdict.

    Attributes
    ----------
    title : str
        The scene.
    over, units : str
        The parameter, and its unit.
    between : (2,) floats
        What was scanned.
    criterion, limit : str, float
        "isolated", or "error" with the largest error that is allowed.
    within : float
        Relative width to which crossings are known.
    points, spacing : int, str
        The grid: number of values; "log" or "linear".
    fixed : mapping
        Other parameters that were given.
    values : tuple of Value
        All values that were tried, ascending, with verdict and reason.
    """

    title: str
    over: str
    units: str
    between: Interval
    criterion: str
    limit: float
    within: float
    points: int
    spacing: str
    fixed: Mapping[str, Any]
    values: tuple[Value, ...]

    __str__ = words.table
    sentence = property(words.sentence)
    plot = figure.plot

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Every change of the verdict that was found, ascending."""
        return tuple(Crossing(a, b) for a, b in pairwise(self.values) if a.verdict != b.verdict)

    @cached_property
    def holds(self) -> tuple[Interval, ...]:
        """Intervals in which hard spheres hold, from the first value to the last that was tried and held."""
        return self._intervals(HOLDS)

    @cached_property
    def fails(self) -> tuple[Interval, ...]:
        """Intervals in which they fail."""
        return self._intervals(FAILS)

    @cached_property
    def undecided(self) -> tuple[Interval, ...]:
        """Intervals in which a run did not come to its end, or was refused."""
        return self._intervals(UNDECIDED)

    def _intervals(self, verdict: str) -> tuple[Interval, ...]:
        groups = [(name, list(group)) for name, group in groupby(self.values, lambda one: one.verdict)]
        return tuple((group[0].value, group[-1].value) for name, group in groups if name == verdict)

    def _numbers(self) -> dict[str, Any]:
        told = ("title", "over", "units", "between", "criterion", "limit", "within", "points", "spacing")
        return {
            **{name: getattr(self, name) for name in told},
            "fixed": {name: repr(value) for name, value in self.fixed.items()},
            "sentence": self.sentence,
            "crossings": [asdict(crossing) for crossing in self.crossings],
            "holds": self.holds, "fails": self.fails, "undecided": self.undecided,
            "values": [asdict(one) for one in self.values],
        }  # fmt: skip

"""The error of a run against the reference; rows of error and run time, and what follows from them.
May be skipped: it measures ourselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from granular import until as stop
from granular.reference import Reference, ReferenceContact
from granular.scene import Scene
from granular.trajectory import Trajectory

FEWEST = 3
"""Points from which an order is measured."""
NEAR = 8.0
"""Errors up to this many times the rounding level are called rounding."""


def contacts_of(run: Trajectory) -> tuple[ReferenceContact, ...]:
    """The contact log of a trajectory in the form of the reference's."""
    rows = []
    for row in run.contacts:
        ended = not math.isnan(float(row["v_out"][0]))
        v_in, v_out = ((float(v[0]), float(v[1])) for v in (row["v_in"], row["v_out"]))
        out = (float(row["t_end"]), v_out) if ended else (None, None)
        rows.append(ReferenceContact(int(row["pair"]), float(row["t_begin"]), v_in, *out))
    return tuple(rows)


def errors(truth: Reference, contacts: Sequence[ReferenceContact], pairs: int) -> tuple[float, float, bool]:
    """Error of velocities, error of times, and whether a number of contacts is wrong; see `Row`."""
    each = [(truth.of(c), [row for row in contacts if row.pair == c]) for c in range(pairs)]
    velocity = float(np.max([_velocity_error(true, got) for true, got in each])) / truth.impact_speed  # nan if one is
    if any(len(true) != len(got) for true, got in each):
        return velocity, math.nan, True
    time = max((_time_error(a, b) for true, got in each for a, b in zip(true, got, strict=True)), default=0.0)
    return velocity, time / max(truth.durations, default=math.nan), False


def _velocity_error(true: Sequence[ReferenceContact], got: Sequence[ReferenceContact]) -> float:
    """Largest difference in m/s at the end of the last contact that ended; nan if only one of them has such."""
    last = [next((row.v_out for row in reversed(rows) if row.v_out is not None), None) for rows in (true, got)]
    if None in last:
        return 0.0 if last[0] is last[1] else math.nan
    return max(float(abs(a - b)) for a, b in zip(*last, strict=True))


def _time_error(true: ReferenceContact, got: ReferenceContact) -> float:
    times = ((true.t_begin, got.t_begin), (true.t_end, got.t_end))
    return max(float(abs(a - b)) for a, b in times if a is not None and b is not None)


@dataclass(frozen=True, slots=True)
class Row:
    """One method at one setting.

    Attributes
    ----------
    method : str
        Its name.
    setting : float
        Value of what its accuracy depends on; nan if on nothing.
    velocity_error : float
        Largest error of the velocities of both bodies at the end of each pair's last contact, in units of the impact
        speed; nan if a pair has no contact that ended.
    time_error : float
        Largest error of onset or end of a contact, in units of the longest contact; nan if contacts differ in number.
    wrong_count : bool
        Some pair has more or fewer contacts than it should.
    rounding : bool
        The error of velocities is what one unit in the last digit of the scene's numbers would make.
    seconds : float
        Shortest processor time of the repeated runs, after a first run that does not count.
    work, unit : int, str
        How much work that was, in "steps", "evaluations" or "events".
    status : str
        How it ended.
    """

    method: str
    setting: float
    velocity_error: float
    time_error: float
    wrong_count: bool
    rounding: bool
    seconds: float
    work: int
    unit: str
    status: str

    @property
    def good(self) -> bool:
        """Whether the right contacts took place."""
        return not self.wrong_count and math.isfinite(self.velocity_error)


@dataclass(frozen=True)
class Measured:
    """Error against run time of many methods on one scene, and what follows from it; see `Frontier`."""

    scene: Scene
    law: tuple[Any, ...]
    until: stop.Until | None
    t_end: float | None
    reference: Reference
    rows: tuple[Row, ...]
    dials: Mapping[str, str]
    orders: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rounding_level: float = 0.0
    machine: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def clock_digit(self) -> float:
        """One unit in the last digit of the end time, in units of the longest contact: no log of times is better."""
        return math.ulp(self.reference.t_stop) / max(self.reference.durations)

    @cached_property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods, in order."""
        return tuple(dict.fromkeys(row.method for row in self.rows))

    def of(self, method: str) -> tuple[Row, ...]:
        """The rows of one method."""
        return tuple(row for row in self.rows if row.method == method)

    def order(self, method: str) -> float:
        """Measured order: the slope of log(error of velocities) over log(setting), by regression; nan if unknown.

        Points at rounding level and points with wrong contacts are left out, and so is the coarsest quarter.
        """
        rows = [row for row in self.of(method) if row.good and not row.rounding and row.velocity_error > 0.0]
        rows = rows[len(rows) // 4 :] if len(rows) > FEWEST else rows
        if len(rows) < FEWEST or math.isnan(rows[0].setting):
            return math.nan
        setting, error = (np.log([getattr(row, name) for row in rows]) for name in ("setting", "velocity_error"))
        return float(np.polyfit(setting, error, 1)[0])

    def fastest(self, error: float, *, without: tuple[str, ...] = ()) -> Row | None:
        """The row with the shortest run time of those with right contacts and an error of at most `error`."""
        rows = [row for row in self.rows if row.good and row.velocity_error <= error and row.method not in without]
        return min(rows, key=lambda row: row.seconds, default=None)

"""What is drawn of a comparison: which span of time, and both runs again with enough rows.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from granular import edmd, md
from granular._check import Array
from granular._tables import unit_of
from granular.comparison.answer import Judged
from granular.trajectory import Status, Trajectory
from granular.until import Separated

FAR = 3.0  # a span that begins so many times its own length after t = 0 has a clock that starts with its first contact
PAD = 0.015  # share of the time axis that is left free at its ends, lest a mark there be cut
LONE = 0.01  # late contacts with up to this share of the impulse may be left out, and are told of at the axis' edge


@dataclass(frozen=True)
class View:
    """A comparison from `begin` to `end` in s, on a clock that is 0 at `zero` and goes in a unit of its own."""

    report: Judged
    begin: float
    end: float
    zero: float = 0.0

    @cached_property
    def unit(self) -> tuple[float, str]:
        """The clock's unit in s, and its name."""
        return unit_of(self.end - self.begin, "s")

    @property
    def shown(self) -> tuple[float, float]:
        """What the clock shows at the begin and at the end."""
        return float(self.clock(self.begin)), float(self.clock(self.end))

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of the time axis, some room left at its ends."""
        left, right = self.shown
        return left - PAD * (right - left), right + PAD * (right - left)

    def clock(self, time: Any) -> Any:
        """What the clock shows at times in s."""
        return (time - self.zero) / self.unit[0]

    @property
    def named(self) -> str:
        """The clock in words, for the axis."""
        since = f"time since the first contact at t = {self.zero:.6g} s" if self.zero else "time"
        return f"{since}, {self.unit[1]}"

    @cached_property
    def moments(self) -> Array:
        """Times in s to draw at: evenly spread, and within each soft contact (of very many, evenly chosen ones)."""
        log = self.report.counted[1].contacts
        log = log[:: max(1, len(log) // 500)]
        return self.times(np.column_stack([log["t_begin"], np.nan_to_num(log["t_end"], nan=self.end)]), 1500)

    def times(self, touches: Array, evenly: int) -> Array:
        """So many times in s evenly spread, and some within each contact, of given onset and end."""
        within = np.linspace(touches[:, 0], touches[:, 1], 17).ravel()
        within = within[(within >= self.begin) & (within <= self.end)]
        times: Array = np.union1d(np.linspace(self.begin, self.end, evenly), within)
        return times


def window(report: Judged) -> View:
    """The span of time worth drawing: from the first contact that counts to the end of the last, with a margin.

    A few late contacts of next to no impulse are left out if the others would fill less than a third of the span.
    """
    start = float(report.soft.time[0])
    runs = report.levelled
    if not any(len(run.contacts) for run in report.counted):
        return View(report, start, max(float(report.soft.time[-1]), start + 1.0))
    share = np.concatenate([run.contacts["impulse"] / (float(run.contacts["impulse"].sum()) or 1.0) for run in runs])
    ends = np.concatenate([np.where(np.isnan(log["t_end"]), np.maximum(log["t_begin"], time), log["t_end"])
                           for log, time in ((run.contacts, float(run.time[-1])) for run in runs)])
    first = float(min(run.contacts["t_begin"].min(initial=math.inf) for run in report.counted))
    last = float(ends.max())
    while len(bulk := ends[3.0 * (ends - first) < last - first]) and share[ends > bulk.max()].sum() <= LONE:
        last = float(bulk.max())
    margin = 0.06 * (last - first) or 1e-3 * abs(first) or 1.0
    begin, end = max(first - margin, start), last + margin
    if report.hard.status is report.soft.status is Status.time:
        end = min(end, max(last, float(report.soft.time[-1])))
    return View(report, begin, end, first if first > FAR * (end - begin) else 0.0)


def with_rows(report: Judged, engine: str, times: Array, further: bool = False) -> Trajectory:
    """One of the two runs again with rows at `times` in s, sorted; beyond its end too if free flight follows, or if it
    is to go `further`."""
    hard = engine == "hard"
    run = report.hard if hard else report.soft
    free = run.status in (Status.quiet, Status.resting, Status.time)
    free = free or (run.status is Status.until and (hard or isinstance(report.until, Separated)))
    free = free and not report.scene.driven  # a path may end with the run
    stop = float(times[-1]) if free or further else min(float(times[-1]), float(run.time[-1]))
    rows: dict[str, Any] = {"t_end": stop, "samples": np.unique(np.minimum(times, stop)), "log": False}
    if hard:
        return edmd.simulate(report.scene, report.rule, **(dict(report.hard_options) | rows | {"until": None}))
    return md.simulate(report.scene, report.law, **report.soft_options, **rows)

"""How far a run of another program is from both engines, ball by ball."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular._engine.check import Array, of_kind
from granular.comparison.further import with_rows
from granular.comparison.outcome import SAME
from granular.run.trajectory import Trajectory
from granular.scene.places import speed_scale

if TYPE_CHECKING:
    from granular.comparison.answer import Judged

MANY = 12
"""Balls that are shown one by one: of more, those farthest from soft spheres."""


@dataclass(frozen=True, eq=False)
class Against:
    """Velocities of a third run less those of both engines at the same times.

    Attributes
    ----------
    time : (T,) array
        In s, of the third run.
    unit : (n,) array
        In m/s: the largest closing speed of each ball's component, as in the report; of balls that touch none, the
        largest of all.
    hard, soft : (T, n) arrays
        Differences in these units, theirs less ours; nan for walls, and behind the end of a run that stopped early.
    """

    time: Array
    unit: Array
    hard: Array
    soft: Array

    def __str__(self) -> str:
        rows = [part for one in (self.hard, self.soft) for part in (_last(one), np.fmax.reduce(np.abs(one)))]
        balls = np.flatnonzero(np.isfinite(rows[3]) | np.isfinite(rows[1]))
        shown = np.sort(balls[np.argsort(-np.nan_to_num(rows[3][balls]), kind="stable")][:MANY])
        head = f"{'last known':>12}{'largest':>10}  {f'beyond {SAME} from':<22}"
        lines = [f"{'velocities less those of':26}{'hard spheres':<46}soft spheres", f"{'':24}{head}{head}".rstrip()]
        for i in shown.tolist():
            words = [f"{last[i]:>12.3g}{most[i]:>10.3g}  {self._since(one[:, i]):<22}"
                     for one, last, most in zip((self.hard, self.soft), rows[::2], rows[1::2], strict=True)]
            lines.append(f"ball {i:<4}of {self.unit[i]:8.3g} m/s{words[0]}{words[1]}".rstrip())
        return "\n".join([*lines, *[f"({len(balls) - len(shown)} balls that are nearer not shown)"]
                          * (len(shown) < len(balls))])

    def _since(self, apart: Array) -> str:
        """From when on a ball is beyond `SAME`; up to where it is known that it is not, if a run stopped early."""
        off, known = np.flatnonzero(np.abs(apart) > SAME), np.flatnonzero(np.isfinite(apart))
        if len(off):
            return f"t = {self.time[off[0]]:.9g} s"
        return "never" if len(known) == len(apart) else (
            f"not up to {self.time[known[-1]]:.6g} s" if len(known) else "not known")


def _last(apart: Array) -> Array:
    """Sizes of the last differences that are known, ball by ball: of a run that stopped early of an earlier row."""
    row = len(apart) - 1 - np.isfinite(apart)[::-1].argmax(axis=0)
    return np.asarray(np.abs(np.take_along_axis(apart, row[None], axis=0)[0]))


def against(report: Judged, run: Trajectory) -> Against:
    """See `Comparison.against`."""
    of_kind("run", run, Trajectory, "a granular.Trajectory", "from_arrays makes one")
    for name in ("mass", "radius"):
        ours, theirs = getattr(report.scene, name), getattr(run.scene, name)
        if ours.shape != theirs.shape or not np.allclose(ours, theirs, rtol=1e-9, atol=0.0):
            raise ValueError(f"run is of another scene: its {name} is {np.array2string(theirs, threshold=6)}; "
                             f"{np.array2string(ours, threshold=6)} is needed.")
    start, first = float(report.soft.time[0]), float(run.time[0])
    if first < start:
        raise ValueError(f"time[0] of run is {first!r}: times from the start of the scene, {start:g} s, on are "
                         "needed; shift its clock.")
    others = report.units.max(initial=0.0) or speed_scale(report.scene) or 1.0  # of balls that touch nothing
    unit = np.append(report.units, others)[report.components.of_ball]
    apart = [_apart(run, with_rows(report, engine, run.time, further=True), unit) for engine in ("hard", "soft")]
    return Against(run.time, unit, *apart)


def _apart(theirs: Trajectory, ours: Trajectory, unit: Array) -> Array:
    """Differences of velocities at the times of a third run."""
    row = np.searchsorted(ours.time, theirs.time).clip(max=len(ours.time) - 1)
    known = (ours.time[row] == theirs.time)[:, None] & ~ours.scene.is_wall
    return np.where(known, (theirs.velocity - ours.velocity[row]) / unit, np.nan)

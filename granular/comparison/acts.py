"""What time it is in each picture of a film: fall as fast as life, a stop, contacts slowed down, flight.
May be skipped: pictures, no physics.

The same story as that of the teaching page, granular/page/live/film.mjs. Without a fall, and where contacts and flights
take turns, there is one act only: the span with the contacts, as long as the film.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granular._check import Array
from granular.comparison.answer import Judged
from granular.comparison.view import View, with_rows
from granular.trajectory import EARLY, Trajectory

FREEZE, HOLD = 0.9, 1.2
"""How long in s the film stops at the floor, and at its end."""
LONGEST = 6.0
"""Fall and flight are shown for so many s at most."""
HIGHEST = 12.0
"""The ruler is so many heights of the drop long at most; what flies higher leaves the picture."""
SHORTEST = 0.2
"""The flight is shown for so many s at least."""
SLOW = 10.0
"""Contacts that are slowed down less than this are no act of their own."""
ACTS = ("fall", "stop", "slow", "flight", "end")


@dataclass(frozen=True)
class Pictures:
    """One row per picture.

    Attributes
    ----------
    act : list of str
        Which of `ACTS` it belongs to.
    time : (count,) array
        The time in s that it shows, never less than that of the picture before.
    slower : float
        By how much the contacts are slower than life.
    """

    act: list[str]
    time: Array
    slower: float

    def of(self, *acts: str) -> Array:
        """Times of the pictures of some acts."""
        times: Array = self.time[np.isin(self.act, acts)]
        return times


def pictures(view: View, seconds: float, fps: int, whole: bool) -> Pictures:
    """Return what a film shows of a comparison, its contacts for so many s; their span only, or the `whole` story."""
    slow, slower = max(2, round(seconds * fps)), seconds / (view.end - view.begin)
    contacts = np.linspace(view.begin, view.end, slow)
    if not (whole and slower >= SLOW and has_fall(view.report)):
        return Pictures(["slow"] * slow, contacts, slower)
    begin, end = max(float(view.report.soft.time[0]), view.begin - LONGEST), apex(view)
    parts = {
        "fall": _as_life(begin, view.begin, fps), "stop": np.full(round(FREEZE * fps), view.begin), "slow": contacts,
        "flight": _as_life(view.end, end, fps) + 1.0 / fps, "end": np.full(round(HOLD * fps), end),
    }  # fmt: skip
    parts["flight"] = np.minimum(parts["flight"], end)
    acts = [name for name, times in parts.items() for _ in times]
    return Pictures(acts, np.concatenate(list(parts.values())), slower)


def has_fall(report: Judged) -> bool:
    """Whether balls fall on a floor that stands still, and both runs got to their end."""
    scene = report.scene
    ended = report.hard.status not in EARLY and report.soft.status not in EARLY
    return bool(scene.gravity > 0.0 and scene.is_wall[0]) and not scene.fed and ended


def apex(view: View) -> float:
    """When the last of the top balls is highest, in s, if it stays in the picture, that is not too long, and both runs
    get there."""

    def runs(end: float) -> list[Trajectory]:
        return [with_rows(view.report, engine, np.array([end]), further=True) for engine in ("hard", "soft")]

    leaving = max(float(run.velocity[-1][-1]) for run in runs(view.end))
    leaving = min(leaving, HIGHEST**0.5 * view.report.impact_speed)
    flight = min(LONGEST, max(SHORTEST, 1.04 * leaving / view.report.scene.gravity))
    reached = min(float(run.time[-1]) for run in runs(view.end + flight))  # hard spheres may collapse meanwhile
    return max(view.end, reached)


def _as_life(begin: float, end: float, fps: int) -> Array:
    """Times at which so many pictures a second are as fast as life, from `begin` on, before `end`."""
    return begin + np.arange(max(1, int(np.ceil((end - begin) * fps)))) / fps

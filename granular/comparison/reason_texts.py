"""Reasons of an answer as text: endless collisions, contacts and departures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from granular._engine.reports import percent
from granular.comparison.outcome import ERROR_LIMIT
from granular.run.trajectory import Status

if TYPE_CHECKING:
    from granular.comparison.numbers import ComparedRuns


def endless_collisions_text(report: ComparedRuns, pairs: Sequence[int]) -> str:
    """Reason for hard spheres that collide forever where soft ones separate, if any.

    Otherwise the result is an empty string.
    """
    hard = report.hard
    if "verdict" not in hard.stats:
        return ""
    first, last = hard.stats["pairs"]
    group = [c for c in pairs if (first <= c <= last if first <= last else c >= first or c <= last)]
    soft = report.continued[1]
    if not any(soft.count(c) and not math.isnan(float(soft.of(c)["t_end"][-1])) for c in group):
        return ""
    n = sum(map(report.soft.count, group))
    return (f": hard spheres {'possibly ' * (hard.status is Status.bounded)}collide forever ({hard.stats['verdict']}), "
            f"soft spheres separate after {n} contact{'s' * (n != 1)}")


def miscount_text(report: ComparedRuns, miscounted: tuple[int, ...], pair_count: int) -> str:
    """Reason for pairs with different numbers of contacts in the two runs.

    Parameters
    ----------
    miscounted : tuple of int
        Pairs with different numbers of contacts.
    pair_count : int
        Number of pairs in the component.
    """
    worst = max(
        (report.pairs[c] for c in reversed(miscounted)), key=lambda p: abs(p.soft_contacts - p.hard_contacts))
    counted = f"{worst.soft_contacts} contact{'s' * (worst.soft_contacts != 1)}, not {worst.hard_contacts}"
    text = f"pair {report.scene.pairs.name(worst.pair)} has {counted}"
    prefix = f"{len(miscounted)} of {pair_count} pairs differ in contacts; " if len(miscounted) > 1 else ""
    j = int(report.components.of_pair[worst.pair])
    error = f"outcomes differ by {percent(float(report.errors[j]))} of the fastest impact"
    return f"{prefix}{text}, and {departure_text(report, j) or error}"


def departure_text(report: ComparedRuns, j: int) -> str:
    """Sentence part "ball … leaves at … instead of … m/s" for component `j`.

    It names the ball whose departure velocity differs most between soft and hard spheres. It is empty if the difference
    is at most `ERROR_LIMIT` (in units of U), or if the error of the component comes from a pair at rest.
    """
    departure = report.departure(j)
    if departure is None or not departure.difference > ERROR_LIMIT:
        return ""
    digits = 3 + 3 * (f"{departure.soft_velocity:.3g}" == f"{departure.hard_velocity:.3g}")
    return (f"ball {departure.ball} leaves at {departure.soft_velocity:.{digits}g} instead of "
            f"{departure.hard_velocity:.{digits}g} m/s")

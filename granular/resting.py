"""Pairs that come to rest: which do, and how far two runs differ there.
May be skipped: contacts without end, and hard spheres that stick.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from granular._check import Array, typed
from granular.outcome import approach, counts, partings
from granular.trajectory import Trajectory


def at_rest(hard: Trajectory, soft: Trajectory) -> tuple[Any, Any]:
    """Whether the last contact of each pair has no end in the soft run; and in the hard one, where spheres stick.
    Both have the shape of the gaps."""
    sticks = np.abs(partings(hard)) <= hard.stats.get("merge_below", 0.0)
    return np.isnan(partings(soft)) & (counts(soft) > 0), sticks & (counts(hard) < counts(soft))


def resting_in_both(hard: Trajectory, soft: Trajectory) -> Any:
    """Whether each pair that is `at_rest` in one run rests at the end of the other one too, shape of the gaps."""
    never, sticks = at_rest(hard, soft)
    parting = np.where(never, partings(hard), partings(soft))
    still = np.where(np.isnan(parting), hard.gap[-1] == 0.0, np.abs(parting) <= hard.stats.get("merge_below", 0.0))
    return (never | sticks) & still


def rests_apart(hard: Trajectory, soft: Trajectory, weight: Array) -> Iterator[tuple[int, float]]:
    """Yield pairs that come to rest in a contact without end, and how far in m/s the two runs differ there.

    A contact before it that the other run lacks counts in full; it begins alike in both; what one run still has from
    there on, as a ball that bounces ever lower, begins no faster, and leaves the pair at rest too. The largest counts.
    Where both rest, contacts that close at no more than `weight` (n-1,), which weight gives, are those of balls that
    settle. How the contacts before it end is compared by episodes, see `granular.episodes`.
    """
    (never, sticks), still = at_rest(hard, soft), resting_in_both(hard, soft)
    for c in np.flatnonzero(never | sticks).tolist():
        runs = [(approach(run)[run.rows(c)], np.diff(run.of(c)["v_out"]).ravel()) for run in (hard, soft)]
        (closing, parting), (others, out) = runs if sticks[c] and not never[c] else runs[::-1]
        k = len(closing) - 1  # the number of the contact without end
        both = min(k, len(others))
        apart = [*np.maximum(np.abs(parting), closing)[both:k]]
        apart += [abs(closing[k] - others[k]), *(others[k + 1 :] - closing[k])] if len(others) > k else [closing[k]]
        fastest = np.zeros(max(k + 1, len(others)))
        fastest[: k + 1] = closing
        fastest[: len(others)] = np.maximum(fastest[: len(others)], others)
        left = float(np.abs(np.nan_to_num(out[-1:])).max(initial=0.0))
        yield c, max(left, float(np.max(apart, where=fastest[both:] > weight[c] * still[c], initial=0.0)))


typed(globals(), Trajectory)

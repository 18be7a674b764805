"""What a run of soft spheres certifies: how many of its contacts were isolated, and where the first was disturbed.
May be skipped: a sentence about three numbers of a run.

A contact is isolated if no neighbouring pair overlaps from where its balls touch to where they part (docs/concepts.md).
Hard spheres differ from it by its delay and its displacement only.
"""

from __future__ import annotations

import math
from typing import Any

from granular.trajectory import Trajectory


def isolated_share(run: Trajectory) -> float:
    """Share of the contacts that were isolated; nan without contacts, and for runs that do not count them.

    Those are runs of hard spheres and of fixed steps.
    """
    if run.law is None or "isolated" not in run.stats or not run.stats["contacts"]:
        return math.nan
    return float(run.stats["isolated"] / run.stats["contacts"])


def numbers(run: Trajectory) -> dict[str, Any]:
    """Return the numbers for JSON; None where a run does not count them."""
    known = run.law is not None and "isolated" in run.stats
    return {"isolated": run.stats["isolated"] if known else None, "contacts": run.stats["contacts"] if known else None,
            "first_disturbed": run.first_disturbed if known else None}  # fmt: skip


def sentence(run: Trajectory) -> str:
    """Return what is certified, in words; empty if nothing is."""
    share = isolated_share(run)
    if math.isnan(share):
        return ""
    isolated, contacts = _grouped(run.stats["isolated"]), _grouped(run.stats["contacts"])
    if share == 1.0:
        return "certified: " + ("the only contact" if contacts == "1" else f"all {contacts} contacts") + " isolated"
    return f"certified: {isolated} of {contacts} contacts isolated; the first disturbed: {first_disturbed(run)}"


def first_disturbed(run: Trajectory) -> str:
    """Return which neighbouring pairs of a run were the first that overlapped at once, and since when, in words."""
    time, pair = run.first_disturbed
    return f"pairs {pair} and {(pair + 1) % run.scene.n_pairs} at t = {time:.9g} s"


def _grouped(count: int) -> str:
    """A whole number in groups of three digits."""
    return f"{count:_}".replace("_", " ")

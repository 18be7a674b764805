"""Whether a saved state can be that of a run of some physics: asked before kernels, which check nothing, go on with it.
May be skipped: how a run is saved and resumed, no physics.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from granular._check import LARGEST, held
from granular.edmd.physics import Physics
from granular.edmd.ties import ORDER

NUMBERS = {"start": "f", "epoch": "f", "epoch_low": "f", "now": "f", "length": "f", "window": "f", "speed": "f",
           "fall": "f", "short": "f", "events": "i", "rebases": "i", "zooms": "i", "zoomed": "i", "allowance": "i",
           "tc": "f", "elastic_below": "f", "merge_below": "f", "seed": "i"}  # fmt: skip
"""Numbers that are saved, and their kinds; of those from `length` on none is negative."""
ANY = ("start", "epoch", "epoch_low", "now")
ENTRIES = {"gap": (0.0, math.inf), "hits": (0, LARGEST), "streak": (0, LARGEST), "last": (-math.inf, math.inf),
           "wall": (-1, 2), "shut": (0, 2), "falls": (0.0, 1.0), "noise": (0.0, math.inf)}  # fmt: skip
"""Least and largest entry of an array of pairs or bodies; others are any finite numbers."""
WHOLE = ("hits", "streak", "wall", "shut")
LATER = ("noise",)
"""What releases before it did not save."""


def check_numbers(saved: Mapping[str, Any], physics: Physics) -> None:
    """Raise `ValueError` unless `saved` has all numbers of a state and its options, each of its kind and its limits."""
    for name, kind in NUMBERS.items():
        infinite = name == "merge_below" and physics.eps.max() == 0.0
        held(saved, name, kind, (), least=-math.inf if name in ANY else 0, finite=not infinite)
    held(saved, "tally", "i", (3,), least=0)
    if not isinstance(saved.get("ties"), str) or saved["ties"] not in ORDER:
        raise ValueError(f"state of trajectory has no rule for ties: one of {', '.join(ORDER)} is needed.")
    if math.frexp(saved["window"])[0] != 0.5:
        raise ValueError(f"window in the state of trajectory is {saved['window']!r}: a power of two is needed.")


def check_entries(
    saved: Mapping[str, Any], physics: Physics, of_pairs: tuple[str, ...], of_bodies: tuple[str, ...]
) -> None:
    """The same of the arrays of pairs and bodies, by these names, and of what is looked at closely or watched."""
    n = physics.scene.n_pairs
    for length, names in ((n, of_pairs), (n + 1, of_bodies)):
        for name in names:
            if name in saved or name not in LATER:
                least, most = ENTRIES.get(name, (-math.inf, math.inf))
                held(saved, name, "i" if name in WHOLE else "f", (length,), least, most, finite=name != "last")
    _check_look(saved, n, physics.scene.ring)
    _check_watch(saved, n)


def _check_look(saved: Mapping[str, Any], n: int, ring: bool) -> None:
    """The same of a closer look, if there is one."""
    if not any(name.startswith("zoom_") for name in saved):
        return
    size = np.shape(saved.get("zoom_gap", 0))
    most = n if ring else n - int(held(saved, "zoom_first", "i", (), 0, n - 1))
    if len(size) != 1 or not 0 < size[0] <= most:
        raise ValueError(f"zoom_gap in the state of trajectory has shape {size}: 1 to {most} pairs are needed.")
    held(saved, "zoom_first", "i", (), 0, n - 1)
    held(saved, "zoom_base", "f", ())
    held(saved, "zoom_gap", "f", size, 0.0)
    held(saved, "zoom_rate", "f", size)
    held(saved, "zoom_dial", "f", (min(np.size(saved.get("zoom_dial", 0)), 5),), 0.0)


def _check_watch(saved: Mapping[str, Any], n: int) -> None:
    """The same of what has been watched, if anything has."""
    if any(name.startswith("watch_") for name in saved):
        for name in ("began", "lasting"):
            held(saved, f"watch_{name}", "f", (n,), finite=False)
        held(saved, "watch_disturbed", "i", (n,), 0, 1)
        held(saved, "watch_counts", "i", (3,), -1)
        held(saved, "watch_time", "f", (), finite=False, nan=True)

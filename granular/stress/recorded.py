"""Lines of balls whose outcome an independent solver found in long doubles (18 digits), stored in ``recorded.json``.

The solver of tests/fuzz shares no code with the engines; ``python bench/stability_recorded.py`` makes the file anew.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from granular import laws
from granular.scene import Scene
from granular.stress import own
from granular.stress.cell import Again, Cell, judged_by
from granular.trajectory import Trajectory

FIELDS = ("t_begin", "duration", "v_out", "xi_max", "force_max", "impulse")
"""What is compared of each contact, besides its pair."""


@cache
def stored() -> tuple[dict[str, Any], ...]:
    """Return the scenes of the file."""
    return tuple(json.loads(Path(__file__).with_name("recorded.json").read_text("utf-8")))


def scenes() -> Iterator[Cell]:
    """Second contacts inside an overlap, own laws in chains, reloading, laws that touch at once, steep laws.

    The plain laws are laws as users write them.
    """
    known = vars(laws) | vars(own)
    for i, one in enumerate(stored()):
        mass = [math.inf if m is None else m for m in one["mass"]]
        scene = Scene(mass, [0.0 if m == math.inf else 0.5 for m in mass], one["gap"], one["velocity"])
        names = ", ".join(dict.fromkeys(name for name, *_ in one["laws"]))
        yield Cell("recorded", f"{one['kind']}, scene {i}: {names}", scene, outcome(one),
                   [known[name](*numbers) for name, *numbers in one["laws"]],
                   options={"t_end": one["t_end"], "max_steps": 50_000})  # fmt: skip


@judged_by("an independent solver in 18 digits")
def outcome(run: Trajectory, again: Again, one: Mapping[str, Any]) -> float:
    """The same contacts, each number of them, and final velocities, in units of scale and condition number."""
    rows = np.sort(run.contacts, order=("pair", "t_begin"))
    if rows["pair"].tolist() != one["pair"]:
        return math.inf
    found = {"final": run.velocity[-1]} | {name: rows[name].ravel() for name in FIELDS}
    return float(max(np.abs(found[name] - one[name]).max() / one["unit"][name] for name in found))

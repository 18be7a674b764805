"""What a recorded run was made of, in words: its laws or rules, masses, radii, gaps and velocities at the start.
May be skipped: the teaching page, beside the engines.
"""

from __future__ import annotations

import math
import re

import numpy as np

from granular._check import Array
from granular.binary import at_speed
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import resolved
from granular.measures import impact_speed
from granular.scene import Scene
from granular.trajectory import Trajectory

MANY = 6
"""Up to this many values or laws are told one by one."""
WALLS = {"floor and ceiling": "walls at both ends", "floor": "left wall", "ceiling": "right wall"}
LONG = re.compile(r"\d+\.\d*(?:e[-+]?\d+)?")


def about(run: Trajectory) -> list[list[str]]:
    """Return names and words of what a run was made of.

    Parameters
    ----------
    run : Trajectory
        Of any scene and engine.
    """
    scene, balls = run.scene, ~run.scene.is_wall
    told = [
        ["law or rule", _laws(run)], ["masses, kg", _values(scene.mass[balls])],
        ["radii, m", _values(scene.radius[balls])], ["gaps at the start, m", _values(scene.gap)],
        ["velocities at the start, m/s", _values(scene.velocity)],
    ]
    return told


def scene(of: Scene) -> str:
    """Return the words of a scene: its balls, what is at its ends (walls, where nothing falls), what acts."""
    said = LONG.sub(lambda found: f"{float(found[0]):.4g}", repr(of)[len("Scene(") : -1])
    if of.gravity == 0.0:
        for named, words in WALLS.items():
            said = said.replace(named, words)
    return said


def _values(values: Array) -> str:
    """Each of a few values, one for all that are equal, or from which to which they go."""
    low, high = float(values.min()), float(values.max())
    if high - low <= 1e-9 * abs(high):
        return f"{low:.5g}"
    if len(values) <= MANY:
        return ", ".join(f"{value:.5g}" for value in values)
    return f"{low:.5g} … {high:.5g}"


def _laws(run: Trajectory) -> str:
    """Every different law or rule with its pairs, and the ε of soft contacts at the speed of the first impact."""
    given = run.law if run.rule is None else run.rule
    of_law: dict[str, list[int]] = {}
    for c, one in enumerate(given or ()):
        of_law.setdefault(repr(one), []).append(c)
    eps = _restitutions(run) if run.rule is None else np.full(run.scene.n_pairs, math.nan)
    shown = [_which(pairs, run.scene.n_pairs) + LONG.sub(lambda found: f"{float(found[0]):.4g}", law) + _eps(eps[pairs])
             for law, pairs in list(of_law.items())[:MANY]]
    more = len(of_law) - len(shown)
    return "; ".join(shown) + f"; {more} more" * (more > 0)


def _which(pairs: list[int], n: int) -> str:
    if len(pairs) == n:
        return ""
    return f"pair {pairs[0]}: " if len(pairs) == 1 else f"{len(pairs)} pairs: "


def _eps(values: Array) -> str:
    return "" if np.isnan(values).any() else f", ε = {_values(values)}"


def _restitutions(run: Trajectory) -> Array:
    """ε of each pair's isolated contact; nan where it does not end, or where pairs are of too many kinds."""
    laws, speed = resolved(run.law or (), run.scene), impact_speed(run)
    if len(laws.in_pairs[1]) > MANY or not speed > 0.0:
        return np.full(run.scene.n_pairs, math.nan)
    eps: Array = laws.column(lambda law: _restitution(law, speed))
    return eps


def _restitution(law: PairLaw, speed: float) -> float:
    try:
        return at_speed(law, speed)
    except (ValueError, ArithmeticError):
        return math.nan

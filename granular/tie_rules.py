"""What hard spheres do that touch, or collide at once: the answers of the other tie rules.
May be skipped: rarer, balls that touch.

Newton's equation decides such a collision by its force law. Hard spheres have no law, so a rule has to decide, and
where two rules differ no answer is the right one.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from granular import edmd
from granular.scene import Scene
from granular.trajectory import EARLY, Trajectory

RULES = ("left", "right", "poisson")
"""One collision after the other in two orders, and a touching group as a whole, in the way that takes any ε."""
FEW = 1000
"""Scenes of more bodies are not tried with the last: the cost of a group grows with its square."""
PATIENCE = 10
"""Another rule is given up after so many times the collisions of the first."""


def touching(scene: Scene) -> Any:
    """Whether each pair is of two balls that touch at the start, shape of the gaps."""
    return (scene.gap == 0.0) & ~np.logical_or(*scene.sides(scene.is_wall))


def ties(run: Trajectory) -> bool:
    """Whether balls touch at the start, or a ball takes part in two collisions at once."""
    pair, time = run.contacts["pair"], run.contacts["t_begin"]
    order = np.lexsort([pair, time])
    at_once = (np.diff(time[order]) == 0.0) & (np.abs(np.diff(pair[order])) == 1)
    return bool((run.scene.gap == 0.0).any() or at_once.any())


def other_answers(hard: Trajectory, rule: Any, options: Mapping[str, Any]) -> dict[str, Trajectory]:
    """Runs under the other tie rules, by rule, if there are `ties`; without those that refuse the scene or end early.

    `options` are those of `granular.edmd.simulate` with which the run `hard` was made.
    """
    found: dict[str, Trajectory] = {}
    if hard.scene.n < 3 or not ties(hard):
        return found
    limit = min(options["max_events"], PATIENCE * (len(hard.contacts) + hard.scene.n))
    for name in RULES[: len(RULES) if hard.scene.n <= FEW else 2]:
        if name != options["ties"]:
            with suppress(ValueError, ArithmeticError):  # no answer, as for balls wedged between two walls
                found[name] = edmd.simulate(hard.scene, rule, **{**options, "ties": name, "max_events": limit})
    return {name: run for name, run in found.items() if run.status not in EARLY}

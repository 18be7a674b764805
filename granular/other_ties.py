"""What hard spheres do that touch, or collide at once: the answers of the other tie rules.
May be skipped: rarer, balls that touch.

Newton's equation decides such a collision by its force law. Hard spheres have no law, so a rule has to decide, and
where two rules differ no answer is the right one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from granular.scene import Scene
from granular.trajectory import Trajectory

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


def others(hard: Trajectory, options: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield options of `granular.edmd.simulate` for each other tie rule, if a run made with `options` has `ties`.

    Such a rule may refuse the scene.
    """
    if hard.scene.n < 3 or not ties(hard):
        return
    limit = min(options["max_events"], PATIENCE * (len(hard.contacts) + hard.scene.n))
    for name in RULES[: len(RULES) if hard.scene.n <= FEW else 2]:
        if name != options["ties"]:
            yield {**options, "ties": name, "max_events": limit}

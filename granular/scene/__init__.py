"""Initial state of a simulation: balls, gaps, velocities, walls and gravity.

Both engines read the same `Scene`.

Start with: `state`.
Support modules: `given`, `pair`, `places`, `walls/`.
"""

from granular.scene.pair import Pair, Pairs, checked_pair
from granular.scene.places import checked, in_order, positions, speed_scale, velocities
from granular.scene.state import Scene

__all__ = ["Pair", "Pairs", "Scene", "checked", "checked_pair", "in_order", "positions", "speed_scale", "velocities"]

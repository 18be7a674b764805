"""What is simulated: balls on a line, perhaps walls, perhaps gravity. Both engines read the same `Scene`.
May be skipped: the names of the parts.
"""

from granular.scene.pair import Pair, Pairs, checked_pair
from granular.scene.places import checked, in_order, positions, speed_scale, velocities
from granular.scene.state import Scene

__all__ = ["Pair", "Pairs", "Scene", "checked", "checked_pair", "in_order", "positions", "speed_scale", "velocities"]

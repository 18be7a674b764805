"""Ready-made scenes: functions of physical parameters that return a `Scene`.

The lowest (leftmost) body comes first. Masses and radii of spheres are related by m = (4/3) π R³ ρ. A single number
for `gap` is the gap of every pair of balls.

Support modules: `falling`, `gases`, `rows`.
"""

from typing import TYPE_CHECKING

from granular._engine.package import attributes
from granular.cases.scenes.falling import ball_stack, bouncing_ball, column, real_balls, three_balls, vibrated_column

if TYPE_CHECKING:
    from granular.cases.scenes.gases import gas, heated_gas, ring_gas
    from granular.cases.scenes.rows import chain, compressed_chain, newtons_cradle, pendulum_cradle

__all__ = [
    "ball_stack", "bouncing_ball", "chain", "column", "compressed_chain", "gas", "heated_gas", "newtons_cradle",
    "pendulum_cradle", "real_balls", "ring_gas", "three_balls", "vibrated_column",
]
__dir__ = __all__.copy
__getattr__ = attributes(__name__, {
    "granular.cases.scenes.gases": "gas heated_gas ring_gas",
    "granular.cases.scenes.rows": "chain compressed_chain newtons_cradle pendulum_cradle",
})

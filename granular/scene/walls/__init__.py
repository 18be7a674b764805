"""Walls that move along a given path (driven walls), and thermal walls.

A driven wall is at x_w(t) = start + velocity·(t - t_start) + m(t) - m(t_start), where m(t) in m is its motion. At
t_start it is at the position given by origin and gaps of the scene. Its velocity is then velocity + m'(t_start).

Support modules: `formulas`, `gap`, `hits`, `motion`, `panels`, `path`, `thermal`.
"""

from granular.scene.walls.formulas import Piecewise, Sine
from granular.scene.walls.motion import Motion
from granular.scene.walls.panels import Panels
from granular.scene.walls.thermal import Thermal

__all__ = ["Motion", "Panels", "Piecewise", "Sine", "Thermal"]

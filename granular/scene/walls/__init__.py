"""Floors and ceilings that move, by what m(t) in m says beside their constant velocity, or that heat.

A wall stands at x_w(t) = start + velocity·(t - t_start) + m(t) - m(t_start): at t_start it is where origin and gaps of
the scene put it, and moves at its own velocity + m'(t_start).

A first reader may skip: `formulas`, `gap`, `hits`, `motion`, `panels`, `path`, `thermal`.
"""

from granular.scene.walls.formulas import Piecewise, Sine
from granular.scene.walls.motion import Motion
from granular.scene.walls.panels import Panels
from granular.scene.walls.thermal import Thermal

__all__ = ["Motion", "Panels", "Piecewise", "Sine", "Thermal"]

"""Moving floors and ceilings: what a wall does beside its constant velocity, given by m(t) in m.
May be skipped: names of the package only.

A wall stands at x_w(t) = start + velocity·(t - t_start) + m(t) - m(t_start): at t_start it is where origin and gaps of
the scene put it, and moves at its own velocity + m'(t_start). No engine asks for it yet.
"""

from granular.walls.motion import Motion
from granular.walls.panels import Panels
from granular.walls.piecewise import Piecewise
from granular.walls.sine import Sine

__all__ = ["Motion", "Panels", "Piecewise", "Sine"]


def __dir__() -> list[str]:
    return __all__

"""Two balls of everyday life, dropped on a hard floor.
May be skipped: ready-made scenes, to be looked up.
"""

from __future__ import annotations

import numpy as np

from granular import _check
from granular.balls import Ball, named
from granular.scene import Scene
from granular.scenes.sizes import above_floor


def real_balls(
    lower: str | Ball = "basketball", upper: str | Ball | None = "tennis ball", gap: float = 0.0, height: float = 1.0,
    gravity: float = 9.81,
) -> Scene:
    """Two real balls, one on top of the other, dropped on a hard floor; or one alone.

    What they do to each other is in `granular.balls`.

    Parameters
    ----------
    lower, upper : str or Ball
        Names of `granular.balls.BALLS`, or balls of one's own; without an upper one the lower falls alone.
    gap : float
        Distance between the surfaces of the two balls in m.
    height : float
        Drop height in m, from the floor to the lowest point of the lower ball.
    gravity : float
        g in m/s².
    """
    balls = [named(lower, "lower"), *([] if upper is None else [named(upper, "upper")])]
    m, r = (np.array([getattr(ball, name) for ball in balls]) for name in ("mass", "radius"))
    drop = _check.number("height", height, at_least=0.0)
    return above_floor(m, r, drop, [_check.number("gap", gap)] * (len(balls) - 1), 0.0, gravity)

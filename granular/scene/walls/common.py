"""What runs and scenes need to know of a moving or thermal wall of any kind."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine import check

if TYPE_CHECKING:
    from granular.scene.walls.panels import Panels

KINDS = "Motion", "Panels", "Piecewise", "Sine", "Thermal"


def of_kind(motion: Any, *kinds: str) -> bool:
    """Return whether a wall is of one of these kinds, by their names: none has to be loaded for that."""
    mro = type(motion).__mro__
    return any(kind.__module__.startswith(f"{__package__}.") and kind.__name__ in kinds for kind in mro)


def checked(name: str, motion: Any, is_wall: bool) -> Any:
    """Return how a wall behaves, or None, if it is one of these and its body is a wall."""
    if motion is None:
        return None
    if not of_kind(motion, *KINDS):
        raise TypeError(check._sentence(name, motion, "one of granular.walls is needed, such as "
                                         "granular.walls.Sine(1e-3, 50.0)"))
    if not is_wall:
        end = "first" if name == "floor" else "last"
        raise ValueError(f"{name} is {motion!r}, but the {end} body is a ball: give it the mass math.inf.")
    return motion


def fitted(motion: Any, t_start: float, t_end: float) -> Any:
    """Return a motion as runs keep it: a `Motion` as its panels, others as they are.

    Raises
    ------
    ValueError
        If it does not last from `t_start` to `t_end` (s), or cannot be fitted.
    """
    panels = None if motion is None else motion.panels(t_start, t_end)
    return panels if of_kind(motion, "Motion") else motion


def ends(*motions: Any) -> float:
    """Return the time in s at which the first of these paths ends: inf of a `Sine`, and of a `Motion`, whose function
    says how far it goes."""
    paths = [getattr(motion, "function", motion) for motion in motions]
    last = [*(path.breaks[-1] for path in paths if of_kind(path, "Piecewise")),
            *(path.edges[-1] for path in paths if of_kind(path, "Panels") and not path.frequency)]
    return float(min(last, default=math.inf))


def fastest(motion: Any) -> float:
    """Return a bound of |m'| in m/s; 0 of a wall at constant velocity, and of a `Motion`, of which runs have panels."""
    panels = getattr(motion, "_panels", getattr(motion, "function", motion))
    return float(panels.speed) if of_kind(panels, "Panels") else 0.0


def moved(motion: Any, start: float, elapsed: Any) -> tuple[Any, Any]:
    """Return m(t) - m(start) in m and m'(t) in m/s of a motion, or of none, at times (s) so long after `start`."""
    if motion is None:
        return 0.0, 0.0
    # paths that last are asked no farther than the start: the end of a run may be a rounding beyond theirs
    end = math.nextafter(start + float(np.max(elapsed)), math.inf) if of_kind(motion, "Motion") else start
    panels: Panels = motion.panels(start, end)
    times = np.atleast_1d(np.asarray(elapsed, dtype=float))
    origin = panels.at(start, 0.0)[0]
    both = np.array([panels.at(start, dt)[:2] for dt in times.tolist()]).reshape(-1, 2)
    x, v = both[:, 0] - origin, both[:, 1]
    return (x, v) if np.ndim(elapsed) else (float(x[0]), float(v[0]))

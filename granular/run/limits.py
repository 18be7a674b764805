"""When a run needs a stop condition, and which option raises the limit that ended it."""

from __future__ import annotations

import math
from collections.abc import Callable

from granular.run import until as stop
from granular.scene import Scene
from granular.scene.places import unending


def check_end(
    scene: Scene, t_end: float | None, until: stop.Until | None, max_events: int | None, *,
    dented: Callable[[], bool] = bool, elastic: Callable[[], bool] = bool,
) -> None:
    """Raise if no stop condition is given for a scene whose contacts never end.

    Parameters
    ----------
    scene : Scene
        The initial state.
    t_end, until, max_events : optional
        The stop conditions of the run; None if not given.
    dented : callable
        Returns whether balls fall on a floor and dissipate energy only where an overlap exceeds all overlaps before it.
        False by default. It is called only if no stop condition is given.
    elastic : callable
        Likewise, whether all pairs are elastic by declaration, and no option treats an inelastic collapse.
    """
    if t_end is not None or until is not None or max_events is not None:
        return
    why = "beside a driven wall" if scene.driven else "beside a thermal wall" if scene.heated else (
        "on a ring" if scene.ring else "of pendula" if scene.pendulum > 0.0 else
        "under gravity, and laws that lose nothing within a dent once made," if dented() else
        unending(scene) if elastic() else "")
    if why:
        raise ValueError(f"t_end is None: {why} a run never comes to an end by itself; give t_end, until, or a "
                         "max_events of your own.")


def raised(option: str, end: float) -> str:
    """Return what to change after a run until `end` in s that its limit `option` ended."""
    return f"raise {option}=" + ", or give t_end= or until=" * (end == math.inf)

"""Kernels that fit a scene: those of walls and forces, of pendula and of rings take the place of others, by name.
May be skipped: rarer, scenes that are not plain.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from granular._kernels import fitted, replaced
from granular.edmd import clusters, collision, driven, driven_event, groups, hanging, motion, ring, zoom

Kernel = Callable[..., Any]


def named(home: Any, *names: str) -> dict[str, Kernel]:
    """Return kernels of a module by their names."""
    return {name: getattr(home, name) for name in names}


@cache
def general(function: Kernel) -> Kernel:
    """Return the twin of a kernel for scenes with forces, driven or thermal walls; most kernels are their own."""
    mine = named(driven, "velocities", "predicted", "touches", "carry", "rate_at", "rebase")
    mine |= named(clusters, "rest", "absorb", "wake", "release", "repull", "is_closed") | named(driven_event, "event")
    return fitted(replaced(function, (motion, collision, groups), mine), RESTING=-math.inf)


@cache
def hangs(function: Kernel) -> Kernel:
    """Return the twin of a kernel for pendula; most kernels are their own."""
    mine = named(hanging, "velocities", "predicted", "touches", "carry", "rate_at", "event", "rebase")
    return replaced(function, (motion, collision), mine)


@cache
def closes(function: Kernel, refresh: Kernel) -> Kernel:
    """Return the twin of a kernel for rings, of a queue that predicts pairs anew by `refresh`."""
    mine = named(ring, "event", "collide", "remedied", "absorb", "rebase", "bounce", "number", "guards", "crowded")
    return fitted(replaced(function, (motion, collision, zoom), mine), refresh=refresh, group=ring.group)

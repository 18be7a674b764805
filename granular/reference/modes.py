"""The modes of a pair, and which of the pairs that touch at rest are about to be moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

OPEN, ACTIVE, RESIDUAL, DORMANT = "open", "active", "residual", "dormant"
"""No overlap · a force acts · overlap, but the force is clipped to zero · touching at rest."""


def roused(modes: Sequence[str], pull: Sequence[Any]) -> list[bool]:
    """Whether each pair is reached by a force through neighbours that touch, or pressed together by gravity."""
    reached = [mode == ACTIVE or (mode == DORMANT and g > 0) for mode, g in zip(modes, pull, strict=True)]
    for order in (range(1, len(modes)), range(len(modes) - 2, -1, -1)):
        for c in order:
            beside = c - 1 if order.step > 0 else c + 1
            reached[c] = reached[c] or (modes[c] != OPEN and reached[beside])
    return reached

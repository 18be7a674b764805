"""What all figures share: how one begins, and the colours of the two kinds of spheres."""

from __future__ import annotations

from typing import Any

from granular._optional import optional

HARD, SOFT = "#c1440e", "#1f4e79"
"""Colours of hard and soft spheres, told apart also in grey print."""


def canvas(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Any, Any]:
    """Return a figure of this size in inches, and its axes as an array (rows, columns)."""
    figure = optional("matplotlib.figure", "plot").Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)

"""What all figures share: how one begins, its colours and its sizes; 8 pt and columns as in Physical Review.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from granular._optional import optional

HARD, SOFT = "#c1440e", "#1f4e79"
"""Colours of hard and soft spheres, told apart also in grey print."""
GREY = "#8a8a8a"
COLUMN, PAGE = 3.4, 7.0
"""Widths in inches."""


def style() -> AbstractContextManager[None]:
    """Settings of matplotlib within which a figure for print is drawn and saved."""
    context: AbstractContextManager[None] = optional("matplotlib", "plot").rc_context({
        "font.size": 8.0, "axes.labelsize": 8.5, "axes.titlesize": 8.5, "legend.fontsize": 7.0,
        "xtick.labelsize": 7.5, "ytick.labelsize": 7.5, "mathtext.fontset": "stix", "font.family": "STIXGeneral",
        "axes.linewidth": 0.6, "lines.linewidth": 0.9, "xtick.direction": "in", "ytick.direction": "in",
        "xtick.top": True, "ytick.right": True, "legend.frameon": False, "savefig.dpi": 300,
        "xtick.major.width": 0.6, "ytick.major.width": 0.6, "xtick.minor.width": 0.4, "ytick.minor.width": 0.4,
    })
    return context


def canvas(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Any, Any]:
    """Return a figure of this size in inches, and its axes as an array (rows, columns)."""
    figure = optional("matplotlib.figure", "plot").Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)

"""How the figures look: one column or two of Physical Review, 8 pt, colours told apart in grey print."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from granular._optional import optional
from granular.drawing import HARD, SOFT, canvas

COLUMN, PAGE = 3.4, 7.0
"""Widths in inches."""
GREY = "#8a8a8a"
FLOOR = "#c8963e"
__all__ = ["COLUMN", "FLOOR", "GREY", "HARD", "PAGE", "SOFT", "canvas", "colours", "letter", "style"]


def style() -> AbstractContextManager[None]:
    """Settings of matplotlib within which a figure is drawn and saved."""
    context: AbstractContextManager[None] = optional("matplotlib", "plot").rc_context({
        "font.size": 8.0, "axes.labelsize": 8.5, "axes.titlesize": 8.5, "legend.fontsize": 7.0,
        "xtick.labelsize": 7.5, "ytick.labelsize": 7.5, "mathtext.fontset": "stix", "font.family": "STIXGeneral",
        "axes.linewidth": 0.6, "lines.linewidth": 0.9, "xtick.direction": "in", "ytick.direction": "in",
        "xtick.top": True, "ytick.right": True, "legend.frameon": False, "savefig.dpi": 300,
        "xtick.major.width": 0.6, "ytick.major.width": 0.6, "xtick.minor.width": 0.4, "ytick.minor.width": 0.4,
    })  # fmt: skip
    return context


def letter(axis: Any, text: str, x: float = 0.02, y: float = 0.97, **how: Any) -> None:
    """Put a letter such as (a) into the upper left corner."""
    axis.text(x, y, text, transform=axis.transAxes, va="top", ha="left", **how)


def colours(most: int) -> tuple[Any, Any]:
    """Colours for whole numbers 1 … most, light to dark, and their norm."""
    import matplotlib
    from matplotlib.colors import BoundaryNorm, ListedColormap

    shades = matplotlib.colormaps["viridis"](np.linspace(1.0, 0.0, most))
    return ListedColormap(shades), BoundaryNorm(np.arange(0.5, most + 1.0), most)

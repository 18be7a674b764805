"""The contacts of a film, slowed down: the balls of both engines, contacts, forces, paths, and a lens.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular.comparison.acts import Pictures
from granular.comparison.caption import pair_name
from granular.comparison.closeup import Closeup, closeup, draw_closeup
from granular.comparison.figure import FEW, NAMED, both, force_curve, head, timeline, world_lines
from granular.comparison.reel import INK, PAPER, Page, clock_line, page
from granular.comparison.stage import COLOURS, glass, stage
from granular.comparison.view import View
from granular.tables import duration
from granular.trajectory import points

PANELS = {"contacts": 1.0, "forces": 1.0, "paths": 1.5, "distance": 1.5}
"""Panels beside the balls, and their heights."""


def near(view: View, shown: Pictures) -> Page:
    """Return the page of the contacts: the balls, and beside (below) them contacts, forces, paths and the lens."""
    report, time, look = view.report, shown.of("slow"), closeup(view)
    if look is not None and (look.view is not view or len(look.touches) < 2):
        look = None  # a short moment of a long film, or nothing hops
    upright = report.scene.gravity > 0.0
    fine = np.union1d(time, view.moments)
    runs = both(report, fine if look is None else np.union1d(fine, look.moments))
    rows = {name: np.searchsorted(run.time, time, side="right") - 1 for name, run in runs.items()}
    paths = {name: np.asarray(points(run))[rows[name]] for name, run in runs.items()}
    names = [name for name in PANELS if name != "distance" or look is not None]
    made = page()
    head(made.figure, report, 10.0)
    axes = _mosaic(made.figure, names, upright)
    for name in COLOURS:
        made.moving += stage(axes[name], report.scene, paths, name, 1.0 if upright else 3.6)
        if look is not None:
            apart = np.asarray(runs[name].gap)[rows[name], look.pair]
            _glass(made, axes[name], look, look.height(runs["soft"]), apart, name)
    timeline(axes["contacts"], view, NAMED if upright else FEW)
    for force in np.transpose(np.asarray(runs["soft"].force)):
        force_curve(axes["forces"], view.clock(runs["soft"].time), force / (force.max() or 1.0))
    axes["forces"].set(ylim=(0.0, 1.05), ylabel="force /\nits peak")
    world_lines(axes["paths"], view, runs)
    if look is not None:
        draw_closeup(axes["distance"], look, runs)
    for name in names:
        panel = axes[name]
        panel.set(xlim=view.limits, facecolor=PAPER)
        panel.tick_params(labelsize=8, labelbottom=name == names[-1])
        panel.yaxis.label.set_size(8)
        panel.spines[["top", "right"]].set_visible(False)
        made.moving.append(clock_line(panel, view.clock(time)))
    axes[names[-1]].set_xlabel(view.named, fontsize=9)
    told = axes["contacts"].set_title("", loc="left", fontsize=10, color=INK)
    words = [f"{slowed(shown.slower)},  t = {'t₁ + ' if view.zero else ''}{duration(t - view.zero)}" for t in time]
    told.set_text(max(words, key=len))
    made.saying.append((told, words))
    made.figure.align_ylabels([axes[name] for name in names])
    return made


def _mosaic(figure: Any, names: list[str], upright: bool) -> Any:
    """Stages on the left, panels on the right; or stages above, panels below, where balls stand in a row."""
    if upright:
        return figure.subplot_mosaic([["hard", "soft", name] for name in names], width_ratios=[1.0, 1.0, 3.2],
                                     height_ratios=[PANELS[name] for name in names])  # fmt: skip
    return figure.subplot_mosaic([["hard"], ["soft"], *([name] for name in names)],
                                 height_ratios=[1.25, 1.25, *(PANELS[name] for name in names)])  # fmt: skip


def _glass(made: Page, axis: Any, look: Closeup, height: float, apart: Any, name: str) -> None:
    """Put the lens into the free corner of a stage."""
    place = (0.52, 0.7, 0.5, 0.24) if look.view.report.scene.gravity > 0.0 else (0.9, 0.0, 0.1, 0.95)
    made.moving += glass(axis.inset_axes(place), apart / height, pair_name(look.view.report.scene, look.pair), name)


def slowed(slower: float) -> str:
    """By how much a film is slower than life, in words."""
    if slower >= 1000.0:
        return f"{round(slower, -2):,.0f} × slower".replace(",", " ")
    if slower > 1.05:
        return f"{float(f'{slower:.2g}'):g} × slower"
    return "as fast as life" if slower > 0.95 else f"{float(f'{1.0 / slower:.2g}'):g} × faster"

"""Fall and flight of a film: both engines against a ruler, as fast as life, and the heights of all balls over time.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._check import Array
from granular.comparison.acts import HIGHEST, Pictures
from granular.comparison.answer import Judged
from granular.comparison.figure import both, head
from granular.comparison.reel import INK, PAPER, Page, clock_line, page
from granular.comparison.stage import COLOURS, relative_radii
from granular.drawing import GREY
from granular.trajectory import points

SAID = {
    "fall": "falling, as fast as life", "stop": "stop: the floor is reached",
    "flight": "flying, as fast as life", "end": "the highest point",
}  # fmt: skip
POINTS = 9.0
"""Radius of the largest ball in points."""


def far(report: Judged, shown: Pictures) -> Page:
    """Return the page of the acts in which balls fall and fly."""
    scene, time = report.scene, shown.of(*SAID)
    fine = np.union1d(np.linspace(time[0], time[-1], 1200), time)
    runs = {engine: (run.time, np.asarray(points(run))) for engine, run in both(report, fine, further=True).items()}
    drop = report.impact_speed**2 / (2.0 * scene.gravity)
    most = 1.06 * min(HIGHEST * drop, max(float(y.max()) for _, y in runs.values()))
    made = page()
    head(made.figure, report, 10.0)
    axes = made.figure.subplot_mosaic([["hard", "soft", "heights"]], width_ratios=[1.0, 1.0, 2.2])
    for name, axis in axes.items():
        axis.set(ylim=(0.0, most), facecolor=PAPER)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(labelsize=8)
        axis.axhline(drop, color=GREY, lw=0.8, ls=":")
        if name != "heights":
            _lane(made, axis, scene, _at(runs[name], time), name)
    axes["hard"].set_ylabel("height, radii taken out, m", fontsize=9)
    axes["soft"].tick_params(labelleft=False)
    _graph(made, axes["heights"], runs, time, drop)
    words = [SAID[act] for act in shown.act if act in SAID]
    title = axes["heights"].set_title("", loc="left", fontsize=11, color=INK)
    title.set_text(max(words, key=len))
    made.saying.append((title, words))
    return made


def _at(run: tuple[Array, Array], time: Array) -> Array:
    """Heights of all balls at these times, those of the last row afterwards."""
    return np.column_stack([np.interp(time, run[0], ball) for ball in run[1].T])


def _lane(made: Page, axis: Any, scene: Any, heights: Array, name: str) -> None:
    """The balls of one engine side by side, so that the lowest point of each can be read off the ruler."""
    from matplotlib.transforms import ScaledTranslation

    axis.set_title(f"{name} spheres", color=COLOURS[name], fontsize=11)
    balls = np.flatnonzero(~scene.is_wall)
    axis.set(xlim=(-0.5, len(balls) - 0.5), xticks=[])
    axis.grid(axis="y", color=GREY, alpha=0.25, lw=0.6)
    radius = POINTS * min(1.0, 6.0 / len(balls)) * relative_radii(scene)
    for place, body in enumerate(balls.tolist()):
        (ball,) = axis.plot([place], [0.0], "o", ms=2.0 * radius[body], mfc=COLOURS[name] + "30", mec=COLOURS[name],
                            mew=1.4)  # fmt: skip
        up = ScaledTranslation(0.0, radius[body] / 72.0, made.figure.dpi_scale_trans)
        ball.set_transform(axis.transData + up)
        made.moving.append((ball, np.column_stack([0.0 * heights[:, body], heights[:, body]])))


def _graph(made: Page, axis: Any, runs: dict[str, tuple[Array, Array]], time: Array, drop: float) -> None:
    """Heights over time, and the line that shows how late it is."""
    for name, (t, y) in runs.items():
        lines = axis.plot(t, y, color=COLOURS[name], ls="--" if name == "hard" else "-", lw=1.1)
        lines[0].set_label(f"{name} spheres")
    axis.annotate("dropped from here", (1.0, drop), (-2, 3), xycoords=("axes fraction", "data"),
                  textcoords="offset points", ha="right", fontsize=8, color=GREY, annotation_clip=True)  # fmt: skip
    axis.set(xlim=(time[0], time[-1] + 0.01 * (time[-1] - time[0])))
    axis.set_xlabel("time, s", fontsize=9)
    axis.legend(fontsize=8, frameon=False, loc="upper left")
    made.moving.append(clock_line(axis, time))

"""Films of a comparison for slides: both engines side by side in slow motion, contacts and forces as time goes by.
May be skipped: pictures, no physics.

Balls are drawn by the square root of their radii, paths and overlaps by a common factor so large that they can be seen.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from subprocess import CalledProcessError
from textwrap import fill
from typing import Any

import numpy as np

from granular import _check, _files
from granular._check import Array
from granular._optional import optional
from granular.comparison.figure import force_curve, timeline, world_lines
from granular.comparison.numbers import Compared
from granular.comparison.verdict import verdict
from granular.comparison.view import window, with_rows
from granular.drawing import HARD, SOFT
from granular.scene import Scene
from granular.trajectory import points

ENDINGS = (".gif", ".mp4")
PAPER, INK = "#fbfaf6", "#1d1c1a"
PANELS = {"contacts": 1.0, "forces": 1.4, "paths": 1.8}
"""Panels beside the balls, and their heights."""
COLOURS = {"hard": HARD, "soft": SOFT}
MOST_BALLS = 60
"""Beyond that many balls nothing could be told apart."""
FINE = 1500
"""Rows of a run at least, so that forces are drawn smoothly."""


def animate(report: Compared, path: str | PathLike[str], seconds: float = 9.0, fps: int = 25) -> None:
    """Write a film of both engines in slow motion; of at most 60 balls.

    Parameters
    ----------
    path : str or path
        A ``.gif`` file, or an ``.mp4`` file where ffmpeg is installed.
    seconds : float
        How long the film lasts in s.
    fps : int
        Pictures per second.
    """
    ending = _check.choice(f"ending of {Path(path).name}", Path(path).suffix.lower(), ENDINGS)
    frames = max(2, round(_check.number("seconds", seconds, above=0.0) * _check.whole("fps", fps, at_least=1)))
    if report.scene.n > MOST_BALLS:
        raise ValueError(f"scene has {report.scene.n} bodies: at most {MOST_BALLS} can be told apart in a film; "
                         "`granular view` plays larger runs.")
    writer = _writer(ending, fps)
    film = Film(report, frames)
    _files.write(path, lambda draft: film.save(draft, writer))


def _writer(ending: str, fps: int) -> Any:
    """What writes a film with that ending; said to be missing before the work begins."""
    animation = optional("matplotlib.animation", "animate")
    if ending == ".mp4":
        if not animation.writers.is_available("ffmpeg"):
            raise ValueError("ending is '.mp4': ffmpeg is needed and not installed; .gif works without it.")
        return animation.FFMpegWriter(fps)

    class OnePalette(animation.PillowWriter):  # type: ignore[misc, name-defined]
        """The same 64 colours in all pictures: a quarter of the size, in half the time."""

        _frames: Any

        def finish(self) -> None:
            middle = self._frames[len(self._frames) // 2].quantize(64)
            self._frames = [picture.quantize(palette=middle, dither=0) for picture in self._frames]
            super().finish()

    return OnePalette(fps)


class Film:
    """The figure of a film, and what of it changes from picture to picture."""

    def __init__(self, report: Compared, frames: int) -> None:
        view = window(report)
        time = np.linspace(view.begin, view.end, frames)
        fine = np.union1d(time, np.linspace(view.begin, view.end, FINE))
        runs = {engine: with_rows(report, engine, fine) for engine in ("soft", "hard")}
        rows = {name: np.searchsorted(run.time, time, side="right") - 1 for name, run in runs.items()}
        paths = {name: np.asarray(points(run)[rows[name]]) for name, run in runs.items()}
        self.figure: Any = optional("matplotlib.figure", "animate").Figure((9.6, 5.4), 100, facecolor=PAPER,
                                                                           layout="constrained")
        self.figure.suptitle(fill(verdict(report), 110), fontsize=11, x=0.02, ha="left", color=INK)
        axes = self.figure.subplot_mosaic([["hard", "soft", name, name] for name in PANELS],
                                          height_ratios=list(PANELS.values()))  # fmt: skip
        self.moving = [one for name in COLOURS for one in _stage(axes[name], report.scene, paths, name)]
        timeline(axes["contacts"], view)
        for force in np.transpose(np.asarray(runs["soft"].force)):
            force_curve(axes["forces"], view.clock(runs["soft"].time), force / (force.max() or 1.0))
        axes["forces"].set(ylim=(0.0, 1.05), ylabel="force / its peak")
        world_lines(axes["paths"], view, runs)
        axes["paths"].set_xlabel(f"time, {view.unit[1]}")
        for panel in (axes[name] for name in PANELS):
            panel.set(xlim=axes["contacts"].get_xlim(), facecolor=PAPER)
            panel.tick_params(labelsize=8)
            panel.yaxis.label.set_size(8)
            panel.spines[["top", "right"]].set_visible(False)
            self.moving.append((panel.axvline(0.0, color=INK, lw=1.0), np.column_stack([view.clock(time), 0.0 * time])))

    def save(self, draft: str, writer: Any) -> None:
        """Write every picture; only what moves is drawn anew."""
        from matplotlib.artist import Artist
        from matplotlib.transforms import Affine2D

        canvas = optional("matplotlib.backends.backend_agg", "animate").FigureCanvasAgg(self.figure)
        for artist, _ in self.moving:
            artist.set_animated(True)
        canvas.draw()
        background = canvas.copy_from_bbox(self.figure.bbox)
        places = [Artist.get_transform(artist) for artist, _ in self.moving]

        def picture(file: Any, **_: Any) -> None:
            canvas.restore_region(background)
            for artist, _path in self.moving:
                artist.axes.draw_artist(artist)
            file.write(canvas.buffer_rgba())

        self.figure.savefig = picture  # what a writer asks for each picture
        try:
            with writer.saving(self.figure, draft, self.figure.dpi):
                for k in range(len(self.moving[0][1])):
                    for (artist, path), place in zip(self.moving, places, strict=True):
                        artist.set_transform(Affine2D().translate(*path[k]) + place)
                    writer.grab_frame()
        except CalledProcessError as error:
            raise OSError(f"ffmpeg could not write the film: {error.stderr or error}") from None


def _stage(axis: Any, scene: Scene, paths: dict[str, Array], name: str) -> list[tuple[Any, Array]]:
    """The balls of one engine, bottom to top (left to right), each with its path in the drawing."""
    from matplotlib.patches import Circle

    both, colour = np.concatenate(list(paths.values())), COLOURS[name]
    drawn = np.sqrt(np.where(scene.is_wall, 0.0, scene.radius) / scene.radius.max())
    radius = np.where(scene.is_wall, 0.0, np.maximum(0.16, drawn)) * min(0.09, 0.28 / max(drawn.sum(), 1e-9))
    room = 0.96 - 2.0 * float(radius.sum())
    deepest = np.maximum(0.0, -scene.across(both).min(axis=0))
    sinks = deepest / (0.6 * np.minimum(*scene.sides(np.where(radius > 0.0, radius, np.inf))))
    scale = min(room / max(float(np.ptp(both)), 1e-300), 1.0 / max(float(sinks.max()), 1e-300))
    height = np.cumsum(2.0 * radius) - radius + (paths[name] - both.min()) * scale
    axis.set(xlim=(-0.16, 0.16), ylim=(-0.03, 1.0), aspect="equal")
    axis.set_axis_off()
    axis.set_title(f"{name} spheres", color=colour, fontsize=11)
    balls = [
        axis.plot([-0.14, 0.14], [0.0, 0.0], color=INK, lw=2)[0] if wall
        else axis.add_patch(Circle((0.0, 0.0), r, facecolor=colour + "30", edgecolor=colour, lw=1.4))
        for wall, r in zip(scene.is_wall, radius, strict=True)
    ]  # fmt: skip
    return [(ball, np.column_stack([0.0 * y, y])) for ball, y in zip(balls, height.T, strict=True)]

"""Films of a comparison for slides: both engines side by side in slow motion, contacts and forces as time goes by.

Balls are drawn by the square root of their radii, paths and overlaps by a common factor so large that they can be seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from granular import _check, _files
from granular._check import Array
from granular._optional import optional
from granular.comparison.figure import HARD, SOFT, resolved, unit_of, window
from granular.comparison.numbers import Compared
from granular.comparison.verdict import verdict
from granular.scene import Scene
from granular.trajectory import Trajectory, points

ENDINGS = (".gif", ".mp4")
PAPER, INK = "#fbfaf6", "#1d1c1a"
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
    save = {".gif": _save_gif, ".mp4": _save_mp4}[ending]
    _require(ending)
    film = Film(report, frames)
    _files.write(path, lambda draft: save(draft, film, fps))


class Film:
    """The figure of a film, and what of it changes from picture to picture."""

    def __init__(self, report: Compared, frames: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.report, scene = report, report.scene
        begin, end = window(report)
        self.time = np.linspace(begin, end, frames)
        self.unit, unit_name = unit_of(end - begin, "s")
        self.clock = (self.time - begin) / self.unit
        self.runs = {"hard": self._again("hard"), "soft": self._again("soft")}
        self.paths = {name: _points(run, self.time) for name, run in self.runs.items()}
        self.figure = Figure(figsize=(9.6, 5.4), facecolor=PAPER, layout="constrained")
        self.figure.suptitle(fill(verdict(report), 110), fontsize=11, x=0.02, ha="left", color=INK)
        grid = self.figure.add_gridspec(3, 4, height_ratios=[1, 1.6, 1.6])
        self.stages = [
            Stage(self.figure.add_subplot(grid[:, i]), scene, self.paths, name, colour)
            for i, (name, colour) in enumerate((("hard", HARD), ("soft", SOFT)))
        ]
        self.heads = [self._timeline(grid[0, 2:]), self._forces(grid[1, 2:]), self._lines(grid[2, 2:], unit_name)]

        self.moving = [*self.heads, *(ball for stage in self.stages for ball in stage.balls)]
        for artist in self.moving:
            artist.set_animated(True)
        canvas: Any = FigureCanvasAgg
        self.canvas = canvas(self.figure)
        self.canvas.draw()
        self.background = self.canvas.copy_from_bbox(self.figure.bbox)

    def pictures(self) -> Iterator[Any]:
        """Yield every picture as an array of RGBA bytes; only what moves is drawn anew."""
        for k in range(len(self.time)):
            for stage in self.stages:
                stage.show(k)
            for head in self.heads:
                head.set_xdata([self.clock[k]] * 2)
            self.canvas.restore_region(self.background)
            for artist in self.moving:
                artist.axes.draw_artist(artist)
            yield np.asarray(self.canvas.buffer_rgba())

    def _again(self, engine: str) -> Trajectory:
        """One of the runs again, with a row for every picture and more; a run that ended before stays as it was."""
        times = np.maximum(self.time, float(getattr(self.report, engine).time[0]))
        return resolved(self.report, engine, np.unique(np.append(times, np.linspace(times[0], times[-1], FINE))))

    def _axis(self, place: Any, name: str) -> Any:
        axis = self.figure.add_subplot(place, facecolor=PAPER)
        axis.set_ylabel(name, fontsize=9)
        axis.set_xlim(0.0, float(self.clock[-1]))
        axis.tick_params(labelsize=8)
        axis.spines[["top", "right"]].set_visible(False)
        return axis

    def _timeline(self, place: Any) -> Any:
        axis, report, start = self._axis(place, "pair"), self.report, float(self.time[0])
        soft, hard = report.soft.contacts, report.hard.contacts
        end = np.where(np.isnan(soft["t_end"]), self.time[-1], soft["t_end"])
        left = (soft["t_begin"] - start) / self.unit
        axis.barh(soft["pair"] - 0.16, (end - soft["t_begin"]) / self.unit, left=left, height=0.3, color=SOFT)
        axis.scatter((hard["t_begin"] - start) / self.unit, hard["pair"] + 0.22, marker="|", s=60, color=HARD)
        n = report.scene.n_pairs
        axis.set(ylim=(-0.6, n - 0.3), yticks=range(n) if n < 7 else [0, n - 1])
        return _head(axis)

    def _forces(self, place: Any) -> Any:
        axis, run = self._axis(place, "force / its peak"), self.runs["soft"]
        assert run.force is not None
        peak = np.maximum(run.force.max(axis=0), 1e-300)
        clock = (run.time - self.time[0]) / self.unit
        for c in range(run.force.shape[1]):
            axis.fill_between(clock, run.force[:, c] / peak[c], color=SOFT, alpha=0.18, lw=0)
            axis.plot(clock, run.force[:, c] / peak[c], color=SOFT, lw=1.0)
        axis.set_ylim(0.0, 1.05)
        return _head(axis)

    def _lines(self, place: Any, unit_name: str) -> Any:
        axis = self._axis(place, "path, radii taken out")
        axis.set_xlabel(f"time, {unit_name}", fontsize=9)
        axis.set_yticks([])
        for name, colour, dash in (("hard", HARD, "--"), ("soft", SOFT, "-")):
            axis.plot(self.clock, self.paths[name], color=colour, ls=dash, lw=1.0)
        return _head(axis)


class Stage:
    """The balls of one engine, bottom to top (left to right)."""

    def __init__(self, axis: Any, scene: Scene, paths: dict[str, Array], name: str, colour: str) -> None:
        from matplotlib.patches import Circle

        both = np.concatenate(list(paths.values()))
        self.path, self.low = paths[name], float(both.min())
        drawn = np.sqrt(np.where(scene.is_wall, 0.0, scene.radius) / scene.radius.max())
        self.radius = np.where(scene.is_wall, 0.0, np.maximum(0.16, drawn)) * min(0.09, 0.28 / max(drawn.sum(), 1e-9))
        room = 0.96 - 2.0 * float(self.radius.sum())
        deepest = np.maximum(0.0, -scene.across(both).min(axis=0))
        side = np.where(self.radius > 0.0, self.radius, np.inf)
        sinks = float((deepest / (0.6 * np.minimum(*scene.sides(side)))).max())
        self.scale = min(room / max(float(both.max()) - self.low, 1e-300), 1.0 / max(sinks, 1e-300))
        self.stacked = np.cumsum(2.0 * self.radius) - self.radius
        axis.set(xlim=(-0.16, 0.16), ylim=(-0.03, 1.0))
        axis.set_aspect("equal", adjustable="box")
        axis.set_axis_off()
        axis.set_title(f"{name} spheres", color=colour, fontsize=11)
        self.balls = [
            axis.plot([-0.14, 0.14], [0.0, 0.0], color=INK, lw=2)[0] if wall
            else axis.add_patch(Circle((0.0, 0.0), radius, facecolor=colour + "30", edgecolor=colour, lw=1.4))
            for wall, radius in zip(scene.is_wall, self.radius, strict=True)
        ]  # fmt: skip

    def show(self, k: int) -> None:
        """Put the balls where they are in picture `k`."""
        at = self.stacked + (self.path[k] - self.low) * self.scale
        for ball, y, r in zip(self.balls, at, self.radius, strict=True):
            if r == 0.0:
                ball.set_ydata([y, y])
            else:
                ball.set_center((0.0, y))


def _points(run: Trajectory, time: Array) -> Array:
    """Positions (m) with the radii taken out at the times of the pictures; the last ones after the end of the run."""
    rows = np.clip(np.searchsorted(run.time, time, side="right") - 1, 0, len(run.time) - 1)
    return np.asarray(points(run)[rows])


def _head(axis: Any) -> Any:
    return axis.axvline(0.0, color=INK, lw=1.0)


def _require(ending: str) -> None:
    """Say what is missing before the work begins."""
    from shutil import which

    optional("matplotlib", "animate")
    if ending == ".mp4" and which("ffmpeg") is None:
        raise ValueError("ending is '.mp4': ffmpeg is needed and not installed; .gif works without it.")


def _save_gif(draft: str, film: Film, fps: int) -> None:
    from PIL import Image

    coloured = [Image.fromarray(picture).convert("RGB") for picture in film.pictures()]
    palette = coloured[len(coloured) // 2].quantize(64)
    first, *others = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in coloured)
    first.save(draft, save_all=True, append_images=others, duration=round(1000 / fps), loop=0)


def _save_mp4(draft: str, film: Film, fps: int) -> None:
    import subprocess

    width, height = film.canvas.get_width_height()
    source = f"-f rawvideo -pix_fmt rgba -s {width}x{height} -r {fps} -i -"
    command = f"ffmpeg -y -loglevel error {source} -pix_fmt yuv420p -vf pad=ceil(iw/2)*2:ceil(ih/2)*2".split()
    frames = b"".join(picture.tobytes() for picture in film.pictures())
    run = subprocess.run([*command, draft], input=frames, capture_output=True, check=False)
    if run.returncode != 0:
        raise OSError(f"ffmpeg could not write the film: {run.stderr.decode(errors='replace').strip()}")

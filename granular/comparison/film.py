"""Films of a comparison for slides: both engines side by side; fall, contacts slowed down, flight.
May be skipped: pictures, no physics.

The same story as that of the teaching page, granular/page/live/film.mjs. A film has two pages, figures on which a few
artists move: `flying`, as fast as life against a ruler, and `touching`, where balls are drawn by the square root of
their radii, paths and overlaps by a common factor so large that they can be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import count
from os import PathLike
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any

import numpy as np

from granular import _check, _files
from granular._check import Array, optional
from granular._figures import NAMED, head
from granular._reports import GREY, HARD, SOFT, duration
from granular.comparison.answer import Judged
from granular.comparison.captions import parameters
from granular.comparison.figure import FEW, both, draw_runs, force_curve, timeline
from granular.comparison.view import View, closeup, draw_closeup, window, with_rows
from granular.scene import Scene
from granular.trajectory import EARLY, points

ENDINGS = (".gif", ".mp4")
MOST_BALLS = 60  # beyond that many nothing could be told apart
FREEZE, HOLD = 0.9, 1.2  # how long in s the film stops at the floor, and at its end
SHORTEST, LONGEST = 0.2, 6.0  # the flight is shown for so many s at least, fall and flight at most
HIGHEST = 12.0  # drops: the ruler is no longer, and what flies higher leaves the picture
SLOW = 10.0  # contacts that are slowed down less are no act of their own
SAID = {
    "fall": "falling, as fast as life", "stop": "stop: the floor is reached",
    "flight": "flying, as fast as life", "end": "the highest point",
}
PANELS = {"contacts": 1.0, "forces": 1.0, "paths": 1.5, "distance": 1.5}  # beside the balls, with their heights
INK, COLOURS = "#1d1c1a", {"hard": HARD, "soft": SOFT}
STYLE = {
    "figure.facecolor": "#fbfaf6", "axes.facecolor": "#fbfaf6", "axes.spines.top": False, "axes.spines.right": False,
    "xtick.labelsize": 8, "ytick.labelsize": 8, "axes.labelsize": 8.5, "axes.titlesize": 10.5,
}
THICK, LEAST = 0.14, 0.16  # radius of the largest ball in lengths of the stage, and of the smallest beside it


def animate(
    report: Judged, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25, *, whole: bool = True
) -> None:
    """See `Comparison.animate`."""
    ending = check_film(path)
    _check.number("seconds", seconds, above=0.0)
    _check.whole("fps", fps, at_least=1)
    if report.scene.n > MOST_BALLS:
        raise ValueError(f"scene has {report.scene.n} bodies: at most {MOST_BALLS} can be told apart in a film; "
                         "`granular view` plays larger runs.")
    animation, view = optional("matplotlib.animation", "animate"), window(report)
    if ending == ".mp4" and not animation.writers.is_available("ffmpeg"):
        raise ValueError("ending is '.mp4': ffmpeg is needed and not installed; .gif works without it.")
    pictures = film(view, acts(view, seconds, fps, whole), fps)
    save = _save_gif if ending == ".gif" else _save_mp4
    _files.write(path, lambda draft: save(pictures, draft, fps))


def check_film(path: str | PathLike[str]) -> str:
    """Return the ending of a film; raise `ValueError` unless it is one that can be written."""
    return _check.choice(f"ending of {Path(path).name}", Path(path).suffix.lower(), ENDINGS)


def acts(view: View, seconds: float, fps: int, whole: bool) -> dict[str, Array]:
    """Return the time in s of every picture, act by act: the contacts for so many s, or the `whole` story.

    Without a fall, and where contacts and flights take turns, there is one act only.
    """
    contacts = np.linspace(view.begin, view.end, max(2, round(seconds * fps)))
    scene, runs = view.report.scene, (view.report.hard, view.report.soft)
    falls = scene.gravity > 0.0 and scene.is_wall[0] and not scene.fed and all(run.status not in EARLY for run in runs)
    if not (whole and falls and seconds >= SLOW * (view.end - view.begin)):
        return {"slow": contacts}
    begin, end = max(float(runs[1].time[0]), view.begin - LONGEST), _apex(view)
    return {
        "fall": np.arange(begin, view.begin, 1.0 / fps), "stop": np.full(round(FREEZE * fps), view.begin),
        "slow": contacts, "flight": np.append(np.arange(view.end + 1.0 / fps, end, 1.0 / fps), end),
        "end": np.full(round(HOLD * fps), end),
    }


def _apex(view: View) -> float:
    """When the last of the top balls is highest, in s, if it stays in the picture, that is not too long, and both runs
    get there: hard spheres may collapse meanwhile."""
    leaving = max(float(with_rows(view.report, name, np.array([view.end]), True).velocity[-1][-1]) for name in COLOURS)
    leaving = min(leaving, HIGHEST**0.5 * view.report.impact_speed)
    end = np.array([view.end + min(LONGEST, max(SHORTEST, 1.04 * leaving / view.report.scene.gravity))])
    return max(view.end, min(float(with_rows(view.report, name, end, True).time[-1]) for name in COLOURS))


@dataclass(eq=False)
class Page:
    """A figure, what moves on it, each with its path in the coordinates it is drawn in, and its title's words."""

    figure: Any
    axes: dict[str, Any]
    moving: list[tuple[Any, Array]] = field(default_factory=list)

    def tell(self, axes: list[Any], clock: Array, words: list[str]) -> None:
        """Draw lines where the time is, and a title that changes above the first: there is room for the longest."""
        self.words, path = words, np.stack([clock, 0.0 * clock], 1)
        self.moving += [(axis.axvline(0.0, color=INK, lw=1.0, gid="clock"), path) for axis in axes]
        self.moving.append((axes[0].set_title(max(words, key=len), loc="left", color=INK), 0.0 * path))

    def show(self, k: int) -> Any:
        """Draw the picture of number `k`, what does not move with the first of them; return its pixels."""
        from matplotlib import artist as artists, transforms

        if k == 0:
            self.canvas = optional("matplotlib.backends.backend_agg", "animate").FigureCanvasAgg(self.figure)
            for artist, _ in self.moving:
                artist.set_animated(True)
            self.canvas.draw()
            self.figure.set_layout_engine("none")
            self.background = self.canvas.copy_from_bbox(self.figure.bbox)
            self.places = [artists.Artist.get_transform(one) for one, _ in self.moving]  # of a circle, size left out
        self.canvas.restore_region(self.background)
        self.moving[-1][0].set_text(self.words[k])
        for (artist, path), place in zip(self.moving, self.places, strict=True):
            artist.set_transform(transforms.Affine2D().translate(*path[k]) + place)
            artist.axes.draw_artist(artist)
        return self.canvas.buffer_rgba()


def film(view: View, shown: dict[str, Array], fps: int) -> list[tuple[Page, int]]:
    """Return which picture of which page is shown, from the first to the last."""
    contacts, others = touching(view, shown["slow"], fps), {name: shown[name] for name in shown if name != "slow"}
    flights, flown = flying(view.report, others) if others else contacts, count()
    return [(contacts, k) if name == "slow" else (flights, next(flown))
            for name, times in shown.items() for k in range(len(times))]


def _page(report: Judged, mosaic: list[list[str]], **ratios: Any) -> Page:
    """Return a page with nothing but its words and empty axes."""
    with optional("matplotlib", "animate").rc_context(STYLE):
        figure = optional("matplotlib.figure", "animate").Figure((9.6, 5.4), 100, layout="constrained")
        head(figure, report.verdict, parameters(report), 10.0)
        page = Page(figure, figure.subplot_mosaic(mosaic, **ratios))
    for name, colour in COLOURS.items():
        page.axes[name].set_title(f"{name} spheres", color=colour)
    return page


def flying(report: Judged, shown: dict[str, Array]) -> Page:
    """Return the page on which balls fall and fly: against a ruler, side by side, and their heights over time."""
    from matplotlib import markers, transforms

    scene, time = report.scene, np.concatenate(list(shown.values()))
    runs = both(report, np.union1d(np.linspace(time[0], time[-1], 1200), time), further=True)
    page = _page(report, [["hard", "soft", "heights"]], width_ratios=[1.0, 1.0, 2.2])
    graph, balls = page.axes["heights"], np.flatnonzero(~scene.is_wall)
    size = 18.0 * min(1.0, 6.0 / len(balls)) * _radii(scene)  # in points
    standing = markers.MarkerStyle("o", transform=transforms.Affine2D().translate(0.0, 0.5))
    for name, run in runs.items():
        axis, colour, heights = page.axes[name], COLOURS[name], np.asarray(points(run))
        axis.set(xlim=(-0.5, len(balls) - 0.5), xticks=[])
        for place, body in enumerate(balls.tolist()):
            how = {"marker": standing, "ms": size[body], "mfc": f"{colour}30", "mec": colour, "mew": 1.4}
            height = np.interp(time, run.time, heights[:, body])
            page.moving.append((axis.plot([place], [0.0], **how)[0], np.stack([0.0 * height, height], 1)))
        graph.plot(run.time, heights, color=colour, ls="--" if name == "hard" else "-", lw=1.1,
                   label=[f"{name} spheres"] + ["_"] * (scene.n - 1))
    drop = report.impact_speed**2 / (2.0 * scene.gravity)
    top = 1.06 * min(HIGHEST * drop, float(graph.dataLim.ymax))
    for axis in page.axes.values():
        axis.set_ylim(0.0, top)
        axis.axhline(drop, color=GREY, lw=0.8, ls=":", label="dropped from here")
    graph.set(xlim=(time[0], time[-1] + 0.01 * (time[-1] - time[0])), xlabel="time, s")
    graph.legend(fontsize=8, frameon=False, loc="upper left")
    page.axes["hard"].set_ylabel("height, radii taken out, m")
    page.tell([graph], time, [SAID[act] for act, times in shown.items() for _ in times])
    return page


def touching(view: View, time: Array, fps: int) -> Page:
    """Return the page of the contacts: the balls, and beside (below) them contacts, forces, paths and the lens."""
    report, look = view.report, closeup(view)
    if look is not None and (look.view is not view or len(look.touches) < 2):
        look = None  # a short moment of a long film, or nothing hops
    runs = both(report, np.unique(np.concatenate([time, view.moments, look.moments if look else []])))
    upright, names = report.scene.gravity > 0.0, list(PANELS)[: 4 if look else 3]
    high = [PANELS[name] for name in names]
    page = (_page(report, [["hard", "soft", name] for name in names], width_ratios=[1, 1, 3.2], height_ratios=high)
            if upright else
            _page(report, [[name] for name in (*COLOURS, *names)], height_ratios=[1.25, 1.25, *high]))
    _stage(page, report.scene, {
        name: np.asarray(points(run))[np.searchsorted(run.time, time, side="right") - 1] for name, run in runs.items()})
    panels = [page.axes[name] for name in names]
    timeline(panels[0], view, NAMED if upright else FEW)
    for force in np.transpose(np.asarray(runs["soft"].force)):
        force_curve(panels[1], view.clock(runs["soft"].time), force / (force.max() or 1.0))
    panels[1].set(ylim=(0.0, 1.05), ylabel="force /\nits peak")
    draw_runs(panels[2], view, runs)
    if look is not None:
        draw_closeup(panels[3], look, runs)
    for axis in panels:
        axis.set(xlim=view.limits, xlabel=view.named if axis is panels[-1] else "")
        axis.tick_params(labelbottom=axis is panels[-1])
    slower, since = len(time) / fps / (view.end - view.begin), "t₁ + " if view.zero else ""
    factor, way = max((slower, "slower"), (1.0 / slower, "faster"))
    pace = f"{float(f'{factor:.2g}'):,g} × {way}".replace(",", " ") if factor > 1.05 else "as fast as life"
    page.tell(panels, view.clock(time), [f"{pace},  t = {since}{duration(t - view.zero)}" for t in time])
    page.figure.align_ylabels(panels)
    return page


def _stage(page: Page, scene: Scene, paths: dict[str, Array]) -> None:
    """Draw the balls of both engines, whose places (count, n) in m are given with the radii taken out.

    What soft spheres do fits on the stage; hard spheres may leave it.
    """
    from matplotlib.patches import Circle

    upright, soft, radius = scene.gravity > 0.0, paths["soft"], _radii(scene)
    length, turn = (1.0, 1) if upright else (3.6, -1)
    radius *= min(THICK, 0.28 * length / max(float(radius.sum()), 1e-9))
    low, high = float(soft.min()), float(soft.max())
    top = min(max(float(places.max()) for places in paths.values()), high + 0.35 * (high - low))
    room = length - 0.06 - 2.0 * float(radius.sum())
    sinks = np.maximum(0.0, -scene.across(soft).min(axis=0))
    sinks /= 0.6 * np.minimum(*scene.sides(np.where(radius > 0.0, radius, np.inf)))
    scale = min(room / max(top - low, 1e-300), 1.0 / max(float(sinks.max()), 1e-300))
    free = 0.0 if upright else 0.5 * (room - (high - low) * scale)
    for name, places in paths.items():
        axis, colour = page.axes[name], COLOURS[name]
        axis.set(**dict(zip(("xlim", "ylim")[::turn], ((-0.16, 0.16), (-0.03, length)), strict=True)), aspect="equal")
        axis.set_axis_off()
        along = free + np.cumsum(2.0 * radius) - radius + (places - low) * scale
        for body, (wall, r, place) in enumerate(zip(scene.is_wall, radius, along.T, strict=True)):
            drawn = axis.plot(*([-THICK, THICK], [0.0, 0.0])[::turn], color=INK, lw=2) if wall else [
                axis.add_patch(Circle((0.0, 0.0), r, facecolor=f"{colour}30", edgecolor=colour, lw=1.4)),
                axis.text(0.0, 0.0, str(body) * (scene.n <= 12), color=colour, fontsize=8, ha="center", va="center",
                          clip_on=True),
            ]
            page.moving += [(artist, np.stack([0.0 * place, place][::turn], 1)) for artist in drawn]


def _radii(scene: Scene) -> Array:
    """Radii by which balls are drawn, of the largest one: square roots, none very small; those of points are alike."""
    drawn = np.maximum(LEAST, np.sqrt(scene.radius / (float(scene.radius.max()) or 1.0)))
    return np.where(scene.is_wall, 0.0, drawn)


def _save_gif(pictures: list[tuple[Page, int]], draft: str, fps: int) -> None:
    """Write these pictures of pages with the same 64 colours in all: a quarter of the size, in half the time."""
    image = optional("PIL.Image", "animate")
    drawn = [image.fromarray(np.asarray(page.show(k))).convert("RGB") for page, k in pictures]
    colours = drawn[len(drawn) // 2].quantize(64)
    first, *others = (picture.quantize(palette=colours, dither=0) for picture in drawn)
    first.save(draft, save_all=True, append_images=others, duration=int(1000 / fps), loop=0)


def _save_mp4(pictures: list[tuple[Page, int]], draft: str, fps: int) -> None:
    """Write these pictures of pages, one after the other."""
    figure, drawn = pictures[0][0].figure, (page.show(k) for page, k in pictures)
    figure.savefig = lambda file, **_: file.write(next(drawn))  # what a writer asks for each picture
    writer = optional("matplotlib.animation", "animate").FFMpegWriter(fps)
    try:
        with writer.saving(figure, draft, figure.dpi):
            for _ in pictures:
                writer.grab_frame()
    except CalledProcessError as error:
        raise OSError(f"ffmpeg could not write the film: {error.stderr or error}") from None

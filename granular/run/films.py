"""Film of one run, and parts shared by all films: pages, stages for balls, files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any

import numpy as np

from granular._engine import files
from granular._engine.check import Array, choice, number, optional, whole
from granular._engine.reports import duration
from granular.run.figures import INK_COLOUR, LINE_COLOURS, Span, draw_paths, engine, head, paths, spans_of, words
from granular.scene import Scene

FILM_ENDINGS = (".gif", ".mp4")
MOST_BALLS = 60  # more balls cannot be distinguished
FILM_STYLE = {
    "figure.facecolor": "#fbfaf6", "axes.facecolor": "#fbfaf6", "axes.spines.top": False, "axes.spines.right": False,
    "xtick.labelsize": 8, "ytick.labelsize": 8, "axes.labelsize": 8.5, "axes.titlesize": 10.5,
}
PAGE_SIZE, BARE_PAGE_SIZE = (9.6, 5.4), (6.4, 4.8)  # inches, with and without charts
BALL_RADIUS, MIN_RADIUS_RATIO = 0.14, 0.16  # largest radius per length of the stage; smallest radius relative to it


def animate(run: Any, path: str | PathLike[str], seconds: float, fps: int) -> None:
    """Write a film of a run, see `Trajectory.animate`."""
    check(path, run.scene, seconds, fps)
    span, name = spans_of(run)[-1], engine(run)
    time = np.linspace(span.begin, span.end, max(2, round(seconds * fps)))
    page = blank(*words(run), run.scene, [name], {"paths": 3.0}, beside=5.0, tall=1.0)
    draw_paths(page.axes["paths"], run, span)
    slowed(page, run.scene, {name: paths(run, time)}, span, time, fps)
    save(path, [(page, k) for k in range(len(time))], fps)


def check(path: str | PathLike[str], scene: Scene, seconds: float, fps: int) -> None:
    """Raise `ValueError` for a film that cannot be drawn or written."""
    ending = check_film(path)
    number("seconds", seconds, above=0.0)
    whole("fps", fps, at_least=1)
    if scene.n > MOST_BALLS:
        raise ValueError(f"`scene` must have at most {MOST_BALLS} bodies for a film, got {scene.n}. Play larger runs "
                         "with granular view.")
    if ending == ".mp4" and not optional("matplotlib.animation", "animate").writers.is_available("ffmpeg"):
        raise ValueError("An .mp4 film requires ffmpeg, which is not installed. Use a name that ends in .gif.")


def check_film(path: str | PathLike[str]) -> str:
    """Return the ending of a film, or raise `ValueError` if it is not supported."""
    return choice(f"the ending of {Path(path).name}", Path(path).suffix.lower(), FILM_ENDINGS)


@dataclass(eq=False)
class Page:
    """A figure with axes over time and moving artists.

    Each artist is stored with its path in the coordinates in which it is drawn. The title changes from picture to
    picture.
    """

    figure: Any
    axes: dict[str, Any]
    panels: list[Any]
    moving: list[tuple[Any, Array]] = field(default_factory=list)

    def tell(self, axes: list[Any], clock: Array, words: list[str]) -> None:
        """Add a line at the current time to the axes, and a title to the first axis.

        The title changes from picture to picture. Space is reserved for the longest title.
        """
        self.words, path = words, np.stack([clock, 0.0 * clock], 1)
        self.moving += [(axis.axvline(0.0, color=INK_COLOUR, lw=1.0, gid="clock"), path) for axis in axes]
        self.moving.append((axes[0].set_title(max(words, key=len), loc="left", color=INK_COLOUR), 0.0 * path))

    def show(self, k: int) -> Any:
        """Draw picture number `k` and return its pixels.

        Artists that do not move are drawn once, with the first picture.
        """
        from matplotlib import artist as artists, transforms

        if k == 0:
            self.canvas = optional("matplotlib.backends.backend_agg", "animate").FigureCanvasAgg(self.figure)
            for artist, _ in self.moving:
                artist.set_animated(True)
            self.canvas.draw()
            self.figure.set_layout_engine("none")
            self.background = self.canvas.copy_from_bbox(self.figure.bbox)
            self.places = [artists.Artist.get_transform(one) for one, _ in self.moving]  # circle: no size
        self.canvas.restore_region(self.background)
        self.moving[-1][0].set_text(self.words[k])
        for (artist, path), place in zip(self.moving, self.places, strict=True):
            artist.set_transform(transforms.Affine2D().translate(*path[k]) + place)
            artist.axes.draw_artist(artist)
        return self.canvas.buffer_rgba()


def blank(
    said: str, more: str, scene: Scene, engines: Iterable[str], panels: Mapping[str, float], beside: float, tall: float,
) -> Page:
    """Return a page with titles and empty axes: one stage per engine, and panels.

    `panels` gives the height of each panel. If balls fall, the panels are next to the stages and `beside` is their
    width. Otherwise the stages are above the panels and `tall` is their height. Without panels, a time line is drawn
    above the stages, and there are no titles.
    """
    names, upright = [*engines], scene.gravity > 0.0
    stages = [names] if upright else [[name] for name in names]
    if not panels:
        rows, ratios = [["time"] * len(stages[0]), *stages], {"height_ratios": [0.04, *[1.0] * len(stages)]}
    elif upright:
        rows = [[*names, panel] for panel in panels]
        ratios = {"width_ratios": [*[1.0] * len(names), beside], "height_ratios": [*panels.values()]}
    else:
        rows = [*stages, *([panel] for panel in panels)]
        ratios = {"height_ratios": [*[tall] * len(stages), *panels.values()]}
    with optional("matplotlib", "animate").rc_context(FILM_STYLE):
        figure = optional("matplotlib.figure", "animate").Figure(
            PAGE_SIZE if panels else BARE_PAGE_SIZE, 100, layout="constrained")
        head(figure, said, more, 10.0)
        axes = figure.subplot_mosaic(rows, **ratios)
    for name in names:
        axes[name].set_title(f"{name} spheres", color=LINE_COLOURS[name])
    if not panels:
        axes["time"].set(xticks=[], yticks=[])
    return Page(figure, axes, [axis for name, axis in axes.items() if name not in names])


def slowed(page: Page, scene: Scene, of: dict[str, Array], span: Span, time: Array, fps: int) -> None:
    """Prepare a page to show balls and the clock at given times (s) of a span.

    `of` contains positions (len(time), n) in m for each engine.
    """
    stage(page, scene, of)
    last = page.panels[-1]
    for axis in page.panels:
        axis.set(xlim=span.limits, xlabel=span.named if axis is last and "time" not in page.axes else "")
        axis.tick_params(labelbottom=axis is last)
    page.tell(page.panels, span.clock(time), paces(span, time, fps))
    page.figure.align_ylabels(page.panels)


def paces(span: Span, time: Array, fps: int) -> list[str]:
    """Return the title of each picture: speed of the film, time of the picture."""
    said, since = pace(len(time) / fps / (span.end - span.begin)), "t₁ + " if span.zero else ""
    return [f"{said},  t = {since}{duration(t - span.zero)}" for t in time]


def pace(slower: float) -> str:
    """Return the speed of a film in words.

    `slower` is the ratio of the duration of the film to the time that it shows.
    """
    factor, way = max((slower, "slower"), (1.0 / slower, "faster"))
    return f"{float(f'{factor:.2g}'):,g} × {way}".replace(",", " ") if factor > 1.05 else "as fast as life"


def stage(page: Page, scene: Scene, of: dict[str, Array]) -> None:
    """Draw the balls of each engine at positions (count, n) in m without radii.

    The motion of the first engine fits on the stage. Balls of other engines can leave it.
    """
    from matplotlib.patches import Circle

    upright, first, radius = scene.gravity > 0.0, next(iter(of.values())), radii(scene)
    # horizontal stages are longer; `turn` swaps x and y
    length, turn = (1.0, 1) if upright else (3.6, -1)
    radius *= min(BALL_RADIUS, 0.28 * length / max(float(radius.sum()), 1e-9))
    low, high = float(first.min()), float(first.max())
    top = min(max(float(places.max()) for places in of.values()), high + 0.35 * (high - low))
    room = length - 0.06 - 2.0 * float(radius.sum())
    sinks = np.maximum(0.0, -scene.across(first).min(axis=0))
    # the largest overlap is drawn with at most 0.6 of the smaller radius
    sinks /= 0.6 * np.minimum(*scene.sides(np.where(radius > 0.0, radius, np.inf)))
    # fill the stage, but do not draw overlaps deeper than the radii allow
    scale = min(room / max(top - low, 1e-300), 1.0 / max(float(sinks.max()), 1e-300))
    free = 0.0 if upright else 0.5 * (room - (high - low) * scale)
    for name, places in of.items():
        axis, colour = page.axes[name], LINE_COLOURS[name]
        axis.set(**dict(zip(("xlim", "ylim")[::turn], ((-0.16, 0.16), (-0.03, length)), strict=True)), aspect="equal")
        axis.set_axis_off()
        along = free + np.cumsum(2.0 * radius) - radius + (places - low) * scale
        for body, (wall, r, place) in enumerate(zip(scene.is_wall, radius, along.T, strict=True)):
            drawn = axis.plot(*([-BALL_RADIUS, BALL_RADIUS], [0.0, 0.0])[::turn], color=INK_COLOUR, lw=2) if wall else [
                axis.add_patch(Circle((0.0, 0.0), r, facecolor=f"{colour}30", edgecolor=colour, lw=1.4)),
                axis.text(0.0, 0.0, str(body) * (scene.n <= 12), color=colour, fontsize=8, ha="center", va="center",
                          clip_on=True),
            ]
            page.moving += [(artist, np.stack([0.0 * place, place][::turn], 1)) for artist in drawn]


def radii(scene: Scene) -> Array:
    """Return the radii in the drawing, relative to the largest radius.

    They are square roots with a lower limit. All point particles have the same radius.
    """
    drawn = np.maximum(MIN_RADIUS_RATIO, np.sqrt(scene.radius / (float(scene.radius.max()) or 1.0)))
    return np.where(scene.is_wall, 0.0, drawn)


def save(path: str | PathLike[str], pictures: list[tuple[Page, int]], fps: int) -> None:
    """Write a film atomically."""
    write = _save_gif if check_film(path) == ".gif" else _save_mp4
    files.write(path, lambda draft: write(pictures, draft, fps))


def _save_gif(pictures: list[tuple[Page, int]], draft: str, fps: int) -> None:
    """Write pictures of pages with a common palette of 64 colours.

    This takes half the time and a quarter of the size.
    """
    image = optional("PIL.Image", "animate")
    drawn = [image.fromarray(np.asarray(page.show(k))).convert("RGB") for page, k in pictures]
    colours = drawn[len(drawn) // 2].quantize(64)
    first, *others = (picture.quantize(palette=colours, dither=0) for picture in drawn)
    first.save(draft, save_all=True, append_images=others, duration=int(1000 / fps), loop=0)


def _save_mp4(pictures: list[tuple[Page, int]], draft: str, fps: int) -> None:
    """Write pictures of pages one after the other."""
    figure, drawn = pictures[0][0].figure, (page.show(k) for page, k in pictures)
    figure.savefig = lambda file, **_: file.write(next(drawn))  # called by the writer for each picture
    writer = optional("matplotlib.animation", "animate").FFMpegWriter(fps)
    try:
        with writer.saving(figure, draft, figure.dpi):
            for _ in pictures:
                writer.grab_frame()
    except CalledProcessError as error:
        raise OSError(f"ffmpeg could not write the film: {error.stderr or error}") from None

"""Film of one run, and parts that all films share.

A page of a film has one stage per engine, on which the balls move, and panels with a time axis.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any, Protocol

import numpy as np

from granular._engine import files
from granular._engine.check import Array, choice, integer, number
from granular._engine.package import import_optional
from granular._engine.reports import duration
from granular.run.figures import (
    INK_COLOUR,
    LINE_COLOURS,
    Span,
    draw_paths,
    kind_of_spheres,
    paths,
    run_titles,
    spans_of,
    write_titles,
)
from granular.scene import Scene

FILM_SUFFIXES = (".gif", ".mp4")
MAX_BODIES = 60  # more balls cannot be distinguished
FONT_FAMILY = ["STIXGeneral", "DejaVu Sans"]
FILM_STYLE = {
    "font.family": FONT_FAMILY, "mathtext.fontset": "stix", "font.size": 11,
    "figure.facecolor": "#fbfaf6", "axes.facecolor": "#fbfaf6", "axes.spines.top": False, "axes.spines.right": False,
    "xtick.labelsize": 9, "ytick.labelsize": 9, "axes.labelsize": 10, "axes.titlesize": 12,
}
PAGE_SIZE, BARE_PAGE_SIZE = (9.6, 5.4), (6.4, 4.8)  # inches, with and without charts
BALL_RADIUS, MIN_RADIUS_RATIO = 0.14, 0.16  # largest radius per length of the stage; smallest radius relative to it
MAX_BULGE = 1.1  # a flattened ball is at most this much wider: it stays on its stage


def animate(run: Any, path: str | PathLike[str], seconds: float, fps: int) -> None:
    """Write a film of one run, see `granular.Trajectory.animate`."""
    check(path, run.scene, seconds, fps)
    span, kind = spans_of(run)[-1], kind_of_spheres(run)
    time = np.linspace(span.begin, span.end, max(2, round(seconds * fps)))
    page = blank_page(*run_titles(run), run.scene, [kind], {"paths": 3.0}, beside=5.0, tall=1.0)
    draw_paths(page.axes["paths"], run, span)
    prepare_page(page, run.scene, {kind: paths(run, time)}, span, time, fps)
    write_film(path, [(page, k) for k in range(len(time))], fps)


def check(path: str | PathLike[str], scene: Scene, seconds: float, fps: int) -> None:
    """Raise an exception for a film that cannot be drawn or written.

    `seconds` is its duration in s, and `fps` its number of frames per second.
    """
    suffix = check_film(path)
    number("seconds", seconds, above=0.0)
    integer("fps", fps, at_least=1)
    if scene.n > MAX_BODIES:
        raise ValueError(f"`scene` must have at most {MAX_BODIES} bodies for a film, got {scene.n}. Play larger runs "
                         "with granular view.")
    if suffix == ".mp4" and not import_optional("matplotlib.animation", "animate").writers.is_available("ffmpeg"):
        raise ValueError("An .mp4 film requires ffmpeg, which is not installed. Use a name that ends in .gif.")


def check_film(path: str | PathLike[str]) -> str:
    """Return the suffix of the path of a film, or raise `ValueError`."""
    return choice(f"the suffix of {Path(path).name}", Path(path).suffix.lower(), FILM_SUFFIXES)


class Frames(Protocol):
    """Part of a film: a figure, and a method that draws its frames."""

    figure: Any

    def show(self, k: int) -> Any:
        """Draw frame number `k` and return its pixels."""


@dataclass(eq=False)
class Page:
    """Page of a film: a figure with stages, panels and moving artists.

    Attributes
    ----------
    figure : matplotlib figure
        The figure.
    axes : dict
        Stages and panels by name.
    panels : list
        The axes with a time axis.
    moving : list of (artist, (count, 2 or 4) array)
        Artists that move, each with its displacement in every frame, in the coordinates in which it is drawn. Columns
        three and four are factors of width and height.
    canvas : matplotlib canvas or None
        The canvas of the frames, None before the first one.
    """

    figure: Any
    axes: dict[str, Any]
    panels: list[Any]
    moving: list[tuple[Any, Array]] = field(default_factory=list)
    canvas: Any = None

    def tell(self, axes: list[Any], clock_values: Array, titles: list[str]) -> None:
        """Add a line at the current time to the axes, and a title to the first axis.

        Parameters
        ----------
        axes : list
            Axes with a time axis.
        clock_values : (count,) array
            Value of the clock in each frame, in the unit of the time axis.
        titles : list of str
            Title of each frame. Space is reserved for the longest title.
        """
        self.titles, path = titles, np.stack([clock_values, 0.0 * clock_values], 1)
        self.moving += [(axis.axvline(0.0, color=INK_COLOUR, lw=1.0, gid="clock"), path) for axis in axes]
        self.moving.append((axes[0].set_title(max(titles, key=len), loc="left", color=INK_COLOUR), 0.0 * path))

    def show(self, k: int, without: Collection[str] = ()) -> Any:
        """Draw frame number `k` and return its pixels.

        Artists that do not move are drawn once, before the first frame. Artists with a name (gid) in `without` are
        left out.
        """
        from matplotlib import artist as artists, transforms

        if self.canvas is None:
            self.canvas = import_optional("matplotlib.backends.backend_agg", "animate").FigureCanvasAgg(self.figure)
            for artist, _ in self.moving:
                artist.set_animated(True)
            self.canvas.draw()
            self.figure.set_layout_engine("none")
            self.background = self.canvas.copy_from_bbox(self.figure.bbox)
            # the transform of a circle itself would include its size
            self.places = [artists.Artist.get_transform(artist) for artist, _ in self.moving]
        self.canvas.restore_region(self.background)
        self.moving[-1][0].set_text(self.titles[k])
        for (artist, path), place in zip(self.moving, self.places, strict=True):
            artist.set_transform(transforms.Affine2D().scale(*path[k, 2:]).translate(*path[k, :2]) + place
                                 if path.shape[1] == 4 else transforms.Affine2D().translate(*path[k]) + place)
            if artist.get_gid() not in without:
                artist.axes.draw_artist(artist)
        return self.canvas.buffer_rgba()


def blank_page(
    title: str, subtitle: str, scene: Scene, engines: Iterable[str], panels: Mapping[str, float], beside: float,
    tall: float,
) -> Page:
    """Return a page with titles, one empty stage per engine, and empty panels.

    Parameters
    ----------
    title, subtitle : str
        Titles of the page.
    engines : iterable of str
        Name of each stage, "hard" or "soft".
    panels : mapping
        Relative height of each panel, by name. Without panels, a thin time axis is drawn above the stages.
    beside : float
        Width of the panels relative to a stage in a scene with gravity, where panels are next to the stages.
    tall : float
        Height of a stage relative to the panels in other scenes, where stages are above the panels.
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
    with import_optional("matplotlib", "animate").rc_context(FILM_STYLE):
        figure = import_optional("matplotlib.figure", "animate").Figure(
            PAGE_SIZE if panels else BARE_PAGE_SIZE, 100, layout="constrained")
        write_titles(figure, title, subtitle, 10.0)
        axes = figure.subplot_mosaic(rows, **ratios)
    for name in names:
        axes[name].set_title(f"{name} spheres", color=LINE_COLOURS[name])
    if not panels:
        axes["time"].set(xticks=[], yticks=[])
    return Page(figure, axes, [axis for name, axis in axes.items() if name not in names])


def prepare_page(page: Page, scene: Scene, of: dict[str, Array], span: Span, time: Array, fps: int) -> None:
    """Prepare a page to show the balls and the clock, one frame for each time in s.

    `of` contains the positions in m for each engine, with radii subtracted, shape (len(time), n). The times are in
    `span`.
    """
    draw_balls(page, scene, of)
    lowest_panel = page.panels[-1]
    for axis in page.panels:
        axis.set(xlim=span.limits, xlabel=span.named if axis is lowest_panel and "time" not in page.axes else "")
        axis.tick_params(labelbottom=axis is lowest_panel)
    page.tell(page.panels, span.clock(time), frame_titles(span, time, fps))
    page.figure.align_ylabels(page.panels)


def frame_titles(span: Span, time: Array, fps: int) -> list[str]:
    """Return the title of each frame: the speed of the film and the time of the frame."""
    speed, clock_origin = film_speed(len(time) / fps / (span.end - span.begin)), "t₁ + " if span.zero else ""
    return [f"{speed},  t = {clock_origin}{duration(t - span.zero)}" if t >= span.zero else
            f"{speed},  t = {clock_origin.replace('+', '−')}{duration(span.zero - t)}" for t in time]


def film_speed(slower: float) -> str:
    """Return the speed of a film as a phrase, such as "slowed 20 ×".

    `slower` is the ratio of the duration of the film to the time that it shows.
    """
    factor = f"{float(f'{max(slower, 1.0 / slower):.2g}'):,g} ×".replace(",", " ")
    if max(slower, 1.0 / slower) <= 1.05:
        return "in real time"
    return f"slowed {factor}" if slower > 1.0 else f"{factor} faster than real time"


def draw_balls(page: Page, scene: Scene, of: dict[str, Array]) -> None:
    """Draw the balls on the stage of each engine, and store their paths on the page.

    `of` contains positions in m with radii subtracted for each engine, shape (count, n). The scale is chosen so that
    the motion of the first engine fits on its stage. Balls of other engines can leave their stage. Overlapping balls
    are drawn flattened.
    """
    from matplotlib.patches import Circle

    upright, first, radius = scene.gravity > 0.0, next(iter(of.values())), drawn_radii(scene)
    # horizontal stages are longer; step -1 swaps x and y
    length, step = (1.0, 1) if upright else (3.6, -1)
    radius *= min(BALL_RADIUS, 0.28 * length / max(float(radius.sum()), 1e-9))
    low, high = float(first.min()), float(first.max())
    top = min(max(float(places.max()) for places in of.values()), high + 0.35 * (high - low))
    available = length - 0.06 - 2.0 * float(radius.sum())
    max_overlaps = np.maximum(0.0, -scene.across(first).min(axis=0))
    # the largest overlap is drawn with at most 0.6 of the smaller radius
    max_overlaps /= 0.6 * np.minimum(*scene.sides(np.where(radius > 0.0, radius, np.inf)))
    # fill the stage, but do not draw overlaps deeper than the radii allow
    scale = min(available / max(top - low, 1e-300), 1.0 / max(float(max_overlaps.max()), 1e-300))
    offset = 0.0 if upright else 0.5 * (available - (high - low) * scale)
    for name, places in of.items():
        axis, colour = page.axes[name], LINE_COLOURS[name]
        axis.set(**dict(zip(("xlim", "ylim")[::step], ((-0.16, 0.16), (-0.03, length)), strict=True)), aspect="equal",
                 anchor="S" if upright else "C")
        axis.set_axis_off()
        shift, squeeze = flattened(places * scale, radius, scene.is_wall)
        along = offset + np.cumsum(2.0 * radius) - radius + (places - low) * scale + shift
        for body, (wall, r, place) in enumerate(zip(scene.is_wall, radius, along.T, strict=True)):
            drawn = axis.plot(*([-BALL_RADIUS, BALL_RADIUS], [0.0, 0.0])[::step], color=INK_COLOUR, lw=2,
                               gid="floor") if wall else [
                axis.add_patch(Circle((0.0, 0.0), r, facecolor=f"{colour}30", edgecolor=colour, lw=1.4, gid="ball")),
                axis.text(0.0, 0.0, str(body) * (scene.n <= 12), color=colour, fontsize=8, family=FONT_FAMILY,
                          ha="center", va="center", clip_on=True, gid="number"),
            ]
            path = np.stack([0.0 * place, place][::step], 1)
            factors = np.stack([np.minimum(MAX_BULGE, 1.0 / squeeze[:, body]), squeeze[:, body]][::step], 1)
            page.moving += [(artist, np.hstack([path, factors]) if isinstance(artist, Circle) else path)
                            for artist in drawn]


def flattened(places: Array, radius: Array, is_wall: Any) -> tuple[Array, Array]:
    """Return shifts of centres and factors of lengths due to overlaps.

    Both have the shape (count, n). An overlap is divided between two balls in inverse proportion to their radii, as on
    the teaching page. A ball takes the whole overlap with a wall. The factor is at least 0.4.

    Parameters
    ----------
    places : (count, n) array
        Positions with radii subtracted, in the unit of the radii.
    radius : (n,) array
        Radii as drawn, 0 for walls.
    is_wall : (n,) array of bool
        Which bodies are walls.
    """
    overlap, both = np.maximum(0.0, -np.diff(places, axis=1)), radius[1:] + radius[:-1]
    share = np.where(is_wall[:-1], 1.0, np.where(is_wall[1:], 0.0, radius[:-1] / np.where(both > 0.0, both, 1.0)))
    below, above = np.zeros_like(places), np.zeros_like(places)
    below[:, 1:], above[:, :-1] = overlap * share, overlap * (1.0 - share)
    balls = np.where(is_wall, 0.0, 1.0)
    lost = balls * (below + above) / np.where(radius > 0.0, 2.0 * radius, 1.0)
    return balls * 0.5 * (below - above), np.maximum(0.4, 1.0 - lost)


def drawn_radii(scene: Scene) -> Array:
    """Return the radii with which bodies are drawn, relative to the largest radius.

    They are the square roots of the relative radii, and at least `MIN_RADIUS_RATIO`. The value of a wall is 0.
    """
    drawn = np.maximum(MIN_RADIUS_RATIO, np.sqrt(scene.radius / (float(scene.radius.max()) or 1.0)))
    return np.where(scene.is_wall, 0.0, drawn)


def write_film(path: str | PathLike[str], pictures: Sequence[tuple[Frames, int]], fps: int) -> None:
    """Write a film atomically.

    `pictures` contains a page and a frame number for each frame.
    """
    write = _save_gif if check_film(path) == ".gif" else _save_mp4
    files.write(path, lambda draft: write(pictures, draft, fps))


def _save_gif(pictures: Sequence[tuple[Frames, int]], draft: str, fps: int) -> None:
    """Write a GIF film with a common palette of 64 colours.

    Compared with one palette per frame, this takes half the time and a quarter of the size.
    """
    image = import_optional("PIL.Image", "animate")
    frames = [image.fromarray(np.asarray(page.show(k))).convert("RGB") for page, k in pictures]
    colours = frames[len(frames) // 2].quantize(64)
    first, *others = (picture.quantize(palette=colours, dither=0) for picture in frames)
    first.save(draft, save_all=True, append_images=others, duration=int(1000 / fps), loop=0)


def _save_mp4(pictures: Sequence[tuple[Frames, int]], draft: str, fps: int) -> None:
    """Write an MP4 film with ffmpeg, one frame after the other."""
    figure, frames = pictures[0][0].figure, (page.show(k) for page, k in pictures)
    figure.savefig = lambda file, **_: file.write(next(frames))  # the writer calls it for each frame
    writer = import_optional("matplotlib.animation", "animate").FFMpegWriter(fps)
    try:
        with writer.saving(figure, draft, figure.dpi):
            for _ in pictures:
                writer.grab_frame()
    except CalledProcessError as error:
        raise OSError(f"ffmpeg could not write the film: {error.stderr or error}") from None

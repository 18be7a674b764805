"""Pages of a film: a figure of which only what moves is drawn anew from picture to picture.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from subprocess import CalledProcessError
from typing import Any

import numpy as np

from granular._check import Array
from granular._optional import optional

PAPER, INK = "#fbfaf6", "#1d1c1a"
SIZE, DPI = (9.6, 5.4), 100
"""Of every page, in inches, and in pixels per inch."""


@dataclass(eq=False)
class Page:
    """A figure, what moves on it, each with its path, and what is said on it, each with its words.

    Attributes
    ----------
    figure : matplotlib figure
        As it is before the first picture.
    moving : list of (artist, (count, 2) array)
        An artist, and by how much it is moved in the coordinates it is drawn in.
    saying : list of (artist, list of str)
        A text, and its words.
    """

    figure: Any
    moving: list[tuple[Any, Array]] = field(default_factory=list)
    saying: list[tuple[Any, list[str]]] = field(default_factory=list)

    def open(self) -> None:
        """Draw what does not move."""
        from matplotlib.artist import Artist

        self.canvas: Any = optional("matplotlib.backends.backend_agg", "animate").FigureCanvasAgg(self.figure)
        for artist, _ in (*self.moving, *self.saying):
            artist.set_animated(True)
        self.canvas.draw()
        self.figure.set_layout_engine("none")
        self.background = self.canvas.copy_from_bbox(self.figure.bbox)
        self.places = [Artist.get_transform(artist) for artist, _ in self.moving]  # of a circle too, size left out

    def show(self, k: int) -> Any:
        """Draw the picture of number `k`; return its pixels."""
        from matplotlib.transforms import Affine2D

        self.canvas.restore_region(self.background)
        for (artist, path), place in zip(self.moving, self.places, strict=True):
            artist.set_transform(Affine2D().translate(*path[k]) + place)
        for artist, words in self.saying:
            artist.set_text(words[k])
        for artist, _ in (*self.moving, *self.saying):
            draw = artist.axes.draw_artist if artist.axes is not None else self.figure.draw_artist
            draw(artist)
        return self.canvas.buffer_rgba()


def page() -> Page:
    """Return an empty page."""
    return Page(optional("matplotlib.figure", "animate").Figure(SIZE, DPI, facecolor=PAPER, layout="constrained"))


def clock_line(axis: Any, places: Array) -> tuple[Any, Array]:
    """A line that stands where the time is, and its path."""
    return axis.axvline(0.0, color=INK, lw=1.0, gid="clock"), np.column_stack([places, 0.0 * places])


def save(pages: list[tuple[Page, int]], draft: str, writer: Any) -> None:
    """Write a film of these pictures of pages, one after the other."""
    for each in dict.fromkeys(one for one, _ in pages):
        each.open()
    figure, now = pages[0][0].figure, iter(pages)

    def picture(file: Any, **_: Any) -> None:
        one, k = next(now)
        file.write(one.show(k))

    figure.savefig = picture  # what a writer asks for each picture
    try:
        with writer.saving(figure, draft, figure.dpi):
            for _ in pages:
                writer.grab_frame()
    except CalledProcessError as error:
        raise OSError(f"ffmpeg could not write the film: {error.stderr or error}") from None

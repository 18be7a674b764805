"""Change between the far view and the near view of a film, as by one camera.

Fall and flight have a page with a ruler, and contacts have another page. Between them the balls grow or shrink where
they are, at the rate of a camera that zooms evenly, while time stands still. The charts change at the beginning of a
zoom inwards and at the end of a zoom outwards, because the ruler is only true in the far view.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.package import import_optional
from granular.run.figures import INK_COLOUR, LINE_COLOURS
from granular.run.films import FONT_FAMILY, Page

ZOOM_SECONDS = 0.64  # duration in s
FAR_FRACTION = 0.25  # part of a zoom, from its far end, that shows the ruler and the charts of the far view
DRAWN = {"ball", "floor", "number"}  # what moves with the camera; the rest is on the pages


class Zoom:
    """Frames between two frames of two pages.

    Parameters
    ----------
    far, near : tuple of (Page, int)
        The page and the number of the frame at the two ends.
    count : int
        Number of frames between them.
    inward : bool
        Whether the zoom begins in the far view.
    """

    def __init__(self, far: tuple[Page, int], near: tuple[Page, int], count: int, inward: bool) -> None:
        self.far, self.near, self.count, self.inward = far, near, count, inward
        self.figure = far[0].figure
        self.canvas: Any = None

    def show(self, k: int) -> Any:
        """Draw frame number `k` and return its pixels."""
        if self.canvas is None:
            self._prepare()
        done = (k + 1) / (self.count + 1)
        share = done if self.inward else 1.0 - done
        page, number = self.far if share < FAR_FRACTION else self.near
        below = np.array(page.show(number, DRAWN), float)
        self._place(self._width(share * share * (3.0 - 2.0 * share)))
        self.canvas.draw()
        above = np.asarray(self.canvas.buffer_rgba(), float)
        cover = above[:, :, 3:] / 255.0
        below[:, :, :3] += cover * (above[:, :, :3] - below[:, :, :3])
        return np.rint(below).astype(np.uint8)

    def _width(self, share: float) -> float:
        """Position between the two views, from 0 (far) to 1 (near).

        `share` is the fraction of the zoom that is over, counted from the far view. The magnification grows
        exponentially, which looks even.
        """
        far, near = (max(width for shapes in end for *_, width in shapes["ball"]) for end in self.ends)
        ratio = near / far
        return share if abs(ratio - 1.0) < 1e-3 else float((ratio**share - 1.0) / (ratio - 1.0))

    def _prepare(self) -> None:
        """Measure both views, and prepare a transparent figure for the balls."""
        figure = import_optional("matplotlib.figure", "animate").Figure(self.figure.get_size_inches(), 100)
        figure.patch.set_alpha(0.0)
        self.canvas = import_optional("matplotlib.backends.backend_agg", "animate").FigureCanvasAgg(figure)
        far, near = self.far[0].axes, self.near[0].axes
        self.ends = [[_shapes(*end, name) for name in LINE_COLOURS] for end in (self.far, self.near)]
        self.drawn = [_drawn(figure, far[name], near[name]) for name in LINE_COLOURS]

    def _place(self, share: float) -> None:
        """Place balls, numbers and floors between their places in the two views."""
        for drawn, *ends in zip(self.drawn, *self.ends, strict=True):
            places = {kind: (1.0 - share) * np.array(ends[0][kind]) + share * np.array(ends[1][kind]) for kind in drawn}
            for artist, (x, y, tall, wide) in zip(drawn["ball"], places["ball"], strict=True):
                artist.set(center=(x, y), width=wide, height=tall)
            for artist, (x, y, *_) in zip(drawn["number"], places["number"], strict=True):
                artist.set(position=(x, y), alpha=share)
            for artist, (left, right, y) in zip(drawn["floor"], places["floor"], strict=True):
                artist.set_data([left, right], [y, y])


def _shapes(page: Page, number: int, name: str) -> dict[str, list[Array]]:
    """Shapes in pixels of one engine in a frame of a page.

    A ball is (x, y, height, width), and so is the place of its number. The floor is (left, right, y).
    """
    from matplotlib.artist import Artist

    page.show(number)
    balls, floors = [], []
    for artist, _ in page.moving:
        if artist.axes is not page.axes[name]:
            continue
        transform = Artist.get_transform(artist)  # the transform of a circle itself would include its size
        if artist.get_gid() == "floor":
            (left, y), (right, _) = transform.transform(artist.get_xydata())
            floors.append(np.array([left, right, y]))
        elif artist.get_gid() == "ball" and hasattr(artist, "get_radius"):
            x, y = transform.transform((0.0, 0.0))
            wide, tall = 2.0 * (transform.transform(2 * (artist.get_radius(),)) - (x, y))
            balls.append(np.array([x, y, tall, wide]))
        elif artist.get_gid() == "ball":
            (x, y), size = transform.transform((0.0, 0.0)), artist.get_markersize() * page.figure.dpi / 72.0
            balls.append(np.array([x, y + 0.5 * size, size, size]))
    return {"ball": balls, "number": balls, "floor": floors}


def _drawn(figure: Any, far: Any, near: Any) -> dict[str, list[Any]]:
    """Add balls, numbers and the floor of one engine to a figure.

    Their coordinates are pixels. `far` and `near` are the stages of the engine. Nothing is drawn outside of `far`.
    """
    from matplotlib import lines, patches, text, transforms

    colour, words = near.title.get_color(), [artist for artist in near.texts if artist.get_gid() == "number"]
    kinds: dict[str, list[Any]] = {
        "floor": [lines.Line2D([], [], color=INK_COLOUR, lw=2)],
        "ball": [patches.Ellipse((0.0, 0.0), 1.0, 1.0, facecolor=f"{colour}30", edgecolor=colour, lw=1.3)
                 for _ in words],
        "number": [text.Text(0.0, 0.0, artist.get_text(), color=colour, fontsize=8, family=FONT_FAMILY, ha="center",
                             va="center") for artist in words],
    }
    for artists in kinds.values():
        for artist in artists:
            artist.set_transform(transforms.IdentityTransform())
            figure.add_artist(artist)
            artist.set_clip_box(far.bbox)
    return kinds

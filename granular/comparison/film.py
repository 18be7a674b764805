"""Films of a comparison for slides: both engines side by side; fall, contacts slowed down, flight.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from granular import _check, _files
from granular._optional import optional
from granular.comparison.acts import Pictures, pictures
from granular.comparison.answer import Judged
from granular.comparison.reel import Page, save
from granular.comparison.ruler import far
from granular.comparison.slowmotion import near
from granular.comparison.view import View, window

ENDINGS = (".gif", ".mp4")
MOST_BALLS = 60
"""Beyond that many balls nothing could be told apart."""


def animate(
    report: Judged, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25, *, whole: bool = True
) -> None:
    """Write a film of both engines; of at most 60 balls.

    A fall has three times, as on the teaching page: the fall as fast as life, a stop at the floor, the contacts slowed
    down (thousands of times, as the film says), and the flight as fast as life to the highest point of the top ball,
    against a ruler. Where nothing falls, or contacts and flights take turns, all of the film has one time, slowed down
    or not. Balls on which no gravity acts stand in a row. A lens shows the distance of the two balls that touch most
    often while a neighbouring contact lasts.

    Parameters
    ----------
    path : str or path
        A ``.gif`` file, or an ``.mp4`` file where ffmpeg is installed.
    seconds : float
        How long the contacts are shown, in s; fall, stop and flight come on top of it.
    fps : int
        Pictures per second.
    whole : bool
        False leaves out fall and flight: one slow motion of the contacts, as long as `seconds` says.
    """
    ending = check_film(path)
    _check.number("seconds", seconds, above=0.0)
    _check.whole("fps", fps, at_least=1)
    if report.scene.n > MOST_BALLS:
        raise ValueError(f"scene has {report.scene.n} bodies: at most {MOST_BALLS} can be told apart in a film; "
                         "`granular view` plays larger runs.")
    writer = _writer(ending, fps)
    view = window(report)
    reel = pages(view, pictures(view, seconds, fps, whole))
    _files.write(path, lambda draft: save(reel, draft, writer))


def check_film(path: str | PathLike[str]) -> str:
    """Return the ending of a film; raise `ValueError` unless it is one that can be written."""
    return _check.choice(f"ending of {Path(path).name}", Path(path).suffix.lower(), ENDINGS)


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


def pages(view: View, shown: Pictures) -> list[tuple[Page, int]]:
    """Return which picture of which page is shown, from the first to the last."""
    contacts = near(view, shown)
    flights = far(view.report, shown) if "fall" in shown.act else contacts
    count, reel = {contacts: 0, flights: 0}, []
    for act in shown.act:
        one = contacts if act == "slow" else flights
        reel.append((one, count[one]))
        count[one] += 1
    return reel

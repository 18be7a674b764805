"""Write the pages: `live_page` with its own physics, `player_page` with recorded runs.
May be skipped: the teaching page, beside the engines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from os import PathLike
from typing import Any

from granular import _files, balls
from granular.page import assemble, opening, recording
from granular.trajectory import Trajectory


def live_page(path: str | PathLike[str], scene: str = "story", values: Mapping[str, Any] | None = None) -> None:
    """Write the teaching page, opening with its story or one of its scenes.

    Parameters
    ----------
    path : str or path
        The HTML file.
    scene : str
        "story", "real-balls", "three-balls", "ball-stack", "newtons-cradle" or "bouncing-ball".
    values : mapping, optional
        What to start with, by the names and in the units of the library and the command: restitution, gap, stiffness,
        lower="football", …; language="de". `granular.page.opening` has all of them.

    Raises
    ------
    ValueError, TypeError
        For a scene or a name that is none, or a value that the page cannot show.
    """
    start = opening.link(scene, values or {})
    data = {
        "words": {language: _spoken(language) for language in assemble.LANGUAGES},
        "balls": {name: asdict(ball) for name, ball in balls.BALLS.items()}, "pairs": balls.PRESETS,
    }
    _files.write_text(path, assemble.page(assemble.LIVE, "granular: hard or soft?", start, data))


def _spoken(language: str) -> dict[str, str]:
    """Return the sentences that the script says."""
    return {key: sentence for key, sentence in assemble.words(language).items() if key != assemble.BLOCKED}


def player_page(
    path: str | PathLike[str], runs: Sequence[Trajectory], names: Sequence[str] | None = None, title: str = ""
) -> None:
    """Write a page that plays one recorded run, or two of one scene side by side.

    Parameters
    ----------
    path : str or path
        The HTML file.
    runs : one or two trajectories
        Of any scene, engine and length, two of the same balls; long ones are thinned out, and the page says by how
        much.
    names : sequence of str, optional
        What to call them.
    title : str
        Heading of the page; the names if empty.

    Raises
    ------
    ValueError
        If there are no runs or more than two, or two of different balls.
    """
    if not 1 <= len(runs) <= 2:
        raise ValueError(f"runs are {len(runs)}: one or two trajectories are needed.")
    if other := recording.different_balls(runs[0].scene, runs[-1].scene):
        raise ValueError(f"runs are of different scenes ({other}): one trajectory is needed, or two of the same balls.")
    called = [_files.plain_text(name) for name in names or [f"run {i + 1}" for i in range(len(runs))]]
    recorded = [recording.recorded(run, name) for run, name in zip(runs, called, strict=True)]
    data: dict[str, Any] = {"title": title or " and ".join(called), "runs": recorded}
    _files.write_text(path, assemble.page(assemble.PLAYER, title or "granular: " + ", ".join(called), data=data))

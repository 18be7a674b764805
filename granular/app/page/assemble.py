"""The pages: one HTML file each from the shipped parts, nothing to load, nothing to run but what is inside.

`live_page` writes the one with its own physics, `player_page` that with recorded runs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple
from functools import cache
from html import escape
from importlib.resources import files
from itertools import chain
from os import PathLike
from posixpath import dirname, normpath
from typing import Any

from granular._engine import files as _files
from granular._engine.package import VERSION
from granular.app.page import opening, recording
from granular.app.page.opening import LANGUAGES
from granular.cases import balls
from granular.run.trajectory import Trajectory

IMPORT = re.compile(r'^import \{[^}]*\} from "([^"]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:const|(?:async )?function\*?|class) ([\w$]+))", re.MULTILINE)
MARGIN = re.compile(r"^[ \t]*//.*\n|^[ \t]+|^\n|[ \t]+// [^\"'`\n]*$", re.MULTILINE)
"""Comments, indents and blank lines: a page goes without."""
KEPT = (r'"(?:[^"\\\n]|\\.)*"', r"'(?:[^'\\\n]|\\.)*'", r"`(?:[^`\\]|\\.)*`",
        r"/(?:\[(?:[^\]\\\n]|\\.)*\]|\\.|[^/\\\n *])(?:\[(?:[^\]\\\n]|\\.)*\]|\\.|[^/\\\n])*/[gimuy]*(?=[).,;])")
"""Texts and patterns of a script, in which spaces count; templates are not nested."""
SIGNS = r"(?:[=,;:?{}()\[\]<>*&|!%^]\s*)+"
SHORTER = {"const": "let", "Infinity": "1/0", "true": "!0", "false": "!1"}
"""Words of a script with a shorter equivalent, unless they are names of properties."""
AIR = re.compile(rf" ?({'|'.join(KEPT)}) ?|\s*({SIGNS})| ?([-+/])(?: (?![-+])|(?==))|(?<![\w.])0(?=\.\d)|"
                 rf"(?<![\w.])(?:{'|'.join(SHORTER)})(?![\w:])")
"""Spaces at the signs of a script, zeros before decimals, and words of `SHORTER`."""
LONE = re.compile(r"(?<![\w$])\((\w+)\)=>")
"""A single name for which a function needs no brackets."""
JOINED = re.compile(r"(?<![^;{}\n])(let (?:[^;{}]|\{[^;{}]*\})*);let ")
"""Declarations one after another, which can be one."""
SPACE = re.compile(r"^[ \t]+|^/\*.*\*/\n|\n|(?<=[{:;,>])[ \t]+|[ \t]+(?=[{}>])|;?[ \t]*(?=\})|(?<![\w.])0(?=\.\d)",
                   re.MULTILINE)
"""The same of a style, and spaces at its signs."""
LIVE = ("live/live.html", "live/main.mjs", "shell/page.css", "live/live.css")
PLAYER = ("player/player.html", "player/main.mjs", "shell/page.css", "player/player.css")
BLOCKED = "blocked"
"""The sentence that is there from the beginning, and is said where the script cannot say anything."""


def page(parts: tuple[str, ...], title: str, start: str = "", data: Mapping[str, Any] | None = None) -> str:
    """Return the HTML of a page.

    Parameters
    ----------
    parts : tuple of str
        Body, main module and styles: `LIVE` or `PLAYER`.
    title : str
        Of the window.
    start : str
        State the page opens with if its link has none: ``scene=three-balls&eps=0.7``.
    data : mapping, optional
        What the page finds as JSON in its element ``#data``.
    """
    slots = {
        "title": escape(title),
        "start": escape(start),
        "version": VERSION,
        "style": SPACE.sub("", "".join(shipped(name) for name in parts[2:])),
        "blocked": "\n".join(f'<p lang="{words(one)["tag"]}">{escape(words(one)[BLOCKED])}</p>' for one in LANGUAGES),
        "data": "" if data is None else f'<script type="application/json" id="data">{embedded(data)}</script>',
        "script": bundle(parts[1]),
    }
    html = shipped("shell/shell.html").replace("<body>", '<body data-start="{{start}}">')
    body = shipped(parts[0]).replace("{{transport}}", shipped("shell/transport.html"))
    return re.sub(r"\{\{(\w+)\}\}", lambda slot: slots[slot[1]], html.replace("{{body}}", re.sub(r"\n\s+", "\n", body)))


@cache
def shipped(name: str) -> str:
    """Return the text of a file of this package."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


@cache
def words(language: str) -> dict[str, str]:
    """Return all sentences of the pages by key, in one language."""
    return dict(json.loads(shipped(f"words/{language}.json")))


@cache
def bundle(*mains: str) -> str:
    """Return one script in one scope: the modules `mains` after all they import, each once.

    So no two of them may have a name in common; a browser refuses a script that declares one twice.
    """
    return "\n".join(_plain(shipped(name)) for name in dict.fromkeys(chain.from_iterable(map(_needed, mains))))


def _needed(name: str) -> Iterator[str]:
    """Names of all that a module imports, directly or not, before its own."""
    for path in IMPORT.findall(shipped(name)):
        yield from _needed(normpath(f"{dirname(name)}/{path}"))
    yield name


def _plain(source: str) -> str:
    bare = MARGIN.sub("", EXPORT.sub("", IMPORT.sub("", source)))
    tight, before = LONE.sub(r"\1=>", AIR.sub(_tight, bare)), ""
    while tight != before:
        tight, before = JOINED.sub(r"\1,", tight), tight
    return tight.replace("</script", "<\\/script")


def _tight(found: re.Match[str]) -> str:
    kept, signs, sign = found.groups()
    if signs:
        return re.sub(r";(?=\})", "", "".join(signs.split()))
    return kept or sign or SHORTER.get(found[0], "")


def embedded(data: Mapping[str, Any]) -> str:
    """Return JSON that may stand inside a script element."""
    return json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


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
        lower="football", …; language="de". `granular.app.page.opening` has all of them.

    Raises
    ------
    ValueError, TypeError
        For a scene or a name that is none, or a value that the page cannot show.
    """
    start = opening.link(scene, values or {})
    keys = [key for key in words(LANGUAGES[0]) if key != BLOCKED]
    data = {
        "keys": " ".join(keys), "sentences": {one: "\n".join(words(one)[key] for key in keys) for one in LANGUAGES},
        "balls": {name: astuple(ball) for name, ball in balls.BALLS.items()}, "pairs": balls.PRESETS,
    }
    _files.write_text(path, page(LIVE, "granular: hard or soft?", start, data))


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
    _files.write_text(path, page(PLAYER, title or "granular: " + ", ".join(called), data=data))

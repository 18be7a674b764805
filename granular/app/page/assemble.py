"""Assembly of the HTML pages from the shipped parts.

`live_page` writes the teaching page with its own physics, `player_page` a page that plays recorded runs.
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
from string import ascii_letters
from typing import Any

from granular._engine import files as _files
from granular._engine.package import VERSION
from granular.app.page import opening, recording, renaming, script
from granular.app.page.opening import LANGUAGES
from granular.cases import balls
from granular.run.trajectory import Trajectory

IMPORT_PATTERN = re.compile(r'^import \{[^}]*\} from "([^"]+)";\n', re.MULTILINE)
EXPORT_PATTERN = re.compile(r"^export (?=(?:const|(?:async )?function\*?|class) ([\w$]+))", re.MULTILINE)
STYLE_SPACE_PATTERN = re.compile(
    r"^[ \t]+|^/\*.*\*/\n|\n|(?<=[{:;,>])[ \t]+|[ \t]+(?=[{}>])|;?[ \t]*(?=\})|(?<![\w.])0(?=\.\d)", re.MULTILINE
)
"""Unnecessary spaces of a style sheet."""
PROPERTY_PATTERN = re.compile(r"(?<![\w-])--[a-z][\w-]*")
"""Custom property of a style sheet."""
COMPOSED_PROPERTIES = frozenset(("--hard", "--soft", "--hard-ball", "--soft-ball"))
"""Properties whose names the scripts compose."""
QUOTED_PATTERN = re.compile(r'="([\w-]+)"(?=[ >])')
"""Attribute whose value needs no quotation marks."""
COMMON_FUNCTIONS = ("Object.assign", "Object.entries", "Object.fromEntries", "Object.hasOwn", "Object.keys",
                    "Object.values", "Array.from", "JSON.stringify", "Math.abs", "Math.ceil", "Math.log",
                    "Math.max", "Math.min", "Math.round", "Number.isFinite", "Number.isNaN", "document.body")
"""Functions that get a short name in a bundle, and the body.

They do not depend on `this`.
"""
COMMON_KEYS = ("aria-label", "aria-pressed", "text-anchor")
"""Quoted keys of objects that get a short name in a bundle."""
LIVE_PARTS = ("live/live.html", "live/main.mjs", "shell/page.css", "live/live.css")
PLAYER_PARTS = ("player/player.html", "player/main.mjs", "shell/page.css", "player/player.css")
BLOCKED_KEY = "blocked"
"""Key of the sentence that is shown if the browser blocks scripts."""


def page(parts: tuple[str, ...], title: str, start: str = "", data: Mapping[str, Any] | None = None) -> str:
    """Return the HTML of a page.

    Parameters
    ----------
    parts : tuple of str
        Files of the body, of the main module and of the style sheets: `LIVE_PARTS` or `PLAYER_PARTS`.
    title : str
        Title of the window.
    start : str
        Initial state if the link has none, for example ``scene=three-balls&eps=0.7``.
    data : mapping, optional
        Data that the page finds as JSON in its element ``#data``.
    """
    code, style = _bundle_with_short_names(parts[1]), "".join(part_text(name) for name in parts[2:])
    slots = {
        "title": escape(title),
        "start": escape(start),
        "version": VERSION,
        "style": _with_short_properties(STYLE_SPACE_PATTERN.sub("", style), code),
        "blocked": "\n".join(
            f'<p lang="{words(language)["tag"]}">{escape(words(language)[BLOCKED_KEY])}</p>' for language in LANGUAGES
        ),
        "data": "" if data is None else f'<script type="application/json" id="data">{embedded(data)}</script>',
        "script": code,
    }
    html = part_text("shell/shell.html").replace("<body>", '<body data-start="{{start}}">')
    body = part_text(parts[0]).replace("{{transport}}", part_text("shell/transport.html"))
    html = QUOTED_PATTERN.sub(r"=\1", html.replace("{{body}}", re.sub(r"\n\s+", "\n", body)))
    return re.sub(r"\{\{(\w+)\}\}", lambda slot: slots[slot[1]], html)


def _with_short_properties(style: str, code: str) -> str:
    """Return a style sheet with short names of its custom properties.

    Properties that the script `code` uses keep their names.
    """
    names = [name for name in dict.fromkeys(PROPERTY_PATTERN.findall(style))
             if name not in COMPOSED_PROPERTIES and name not in code]
    short = dict(zip(names, (f"--{letter}" for letter in ascii_letters), strict=False))
    return PROPERTY_PATTERN.sub(lambda found: short.get(found[0], found[0]), style)


@cache
def part_text(name: str) -> str:
    """Return the text of a file of this package, by its path in the package."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


@cache
def words(language: str) -> dict[str, str]:
    """Return all sentences of the pages in one language, by key."""
    return dict(json.loads(part_text(f"words/{language}.json")))


@cache
def bundle(*mains: str) -> str:
    """Join modules into one script: `mains` after all modules that they import.

    All modules share one scope. Their names must therefore differ: browsers refuse a script that declares a name twice.
    """
    return script.joined(script.tokens(source(*mains)))


def source(*mains: str) -> str:
    """Return the text of modules and of their imports, each module once.

    Import and export statements are removed.
    """
    names = dict.fromkeys(chain.from_iterable(map(_needed_modules, mains)))
    return "\n".join(EXPORT_PATTERN.sub("", IMPORT_PATTERN.sub("", part_text(name))) for name in names)


def _needed_modules(name: str) -> Iterator[str]:
    """Yield the names of all modules that a module imports, then its own name.

    A module can occur several times.
    """
    for path in IMPORT_PATTERN.findall(part_text(name)):
        yield from _needed_modules(normpath(f"{dirname(name)}/{path}"))
    yield name


@cache
def _bundle_with_short_names(main: str) -> str:
    """Return the bundle of a module with short names."""
    text = source(main)
    used = [name for name in COMMON_FUNCTIONS if name in text]
    for name in used:
        text = re.sub(rf"\b{re.escape(name)}\b", name.replace(".", "_"), text)
    for key in COMMON_KEYS:
        text = text.replace(f'"{key}":', f"[{key.replace('-', '_')}]:")
    known = ", ".join([*(f"{name.replace('.', '_')} = {name}" for name in used),
                       *(f"{key.replace('-', '_')} = '{key}'" for key in COMMON_KEYS)])
    return script.joined(renaming.renamed(script.tokens(f"const {known};\n{text}")))


def embedded(data: Mapping[str, Any]) -> str:
    """Return data as JSON that is safe inside a script element."""
    return json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def live_page(path: str | PathLike[str], scene: str = "story", values: Mapping[str, Any] | None = None) -> None:
    """Write the teaching page with its story or one of its scenes.

    Parameters
    ----------
    path : str or path
        The HTML file.
    scene : str
        "story", "real-balls", "three-balls", "ball-stack", "newtons-cradle" or "bouncing-ball".
    values : mapping, optional
        Initial values, with the names and units of the library: restitution, gap, stiffness, lower="football", ...;
        language="de". `granular.app.page.opening` has all of them.

    Raises
    ------
    ValueError, TypeError
        If the scene or a name is unknown, or if the page cannot show a value.
    """
    start = opening.link(scene, values or {})
    keys = [key for key in words(LANGUAGES[0]) if key != BLOCKED_KEY]
    data = {
        "keys": " ".join(keys),
        "sentences": {language: "\n".join(words(language)[key] for key in keys) for language in LANGUAGES},
        "balls": {name: astuple(ball) for name, ball in balls.BALLS.items()}, "pairs": balls.PRESETS,
    }
    _files.write_text(path, page(LIVE_PARTS, "granular: hard or soft?", start, data))


def player_page(
    path: str | PathLike[str], runs: Sequence[Trajectory], names: Sequence[str] | None = None, title: str = ""
) -> None:
    """Write a page that plays one recorded run, or two runs side by side.

    Parameters
    ----------
    path : str or path
        The HTML file.
    runs : one or two trajectories
        Runs of any scene, engine and length. Two runs must have the same balls. Samples of long runs are thinned out,
        and the page states by how much.
    names : sequence of str, optional
        Names of the runs. Defaults to "run 1" and "run 2".
    title : str
        Heading of the page. Defaults to the names.

    Raises
    ------
    ValueError
        If there are no runs, more than two runs, or two runs of different balls.
    """
    if not 1 <= len(runs) <= 2:
        raise ValueError(f"`runs` must be one or two trajectories, got {len(runs)}.")
    if other := recording.different_balls(runs[0].scene, runs[-1].scene):
        raise ValueError(f"`runs` must be of the same balls, got different scenes ({other}).")
    labels = [_files.plain_text(name) for name in names or [f"run {i + 1}" for i in range(len(runs))]]
    recorded = [recording.recorded(run, name) for run, name in zip(runs, labels, strict=True)]
    data: dict[str, Any] = {"title": title or " and ".join(labels), "runs": recorded}
    _files.write_text(path, page(PLAYER_PARTS, title or "granular: " + ", ".join(labels), data=data))

"""Put a page together: one HTML file from the shipped parts, nothing to load, nothing to run but what is inside.
May be skipped: the teaching page, beside the engines.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from html import escape
from importlib.resources import files
from posixpath import dirname, normpath
from typing import Any

from granular import _files

IMPORT = re.compile(r'^import \{[^}]*\} from "([^"]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:const|function\*?|class) ([\w$]+))", re.MULTILINE)
LIVE = ("live/live.html", "live/main.mjs", "shell/page.css")
PLAYER = ("player/player.html", "player/main.mjs", "shell/page.css", "player/player.css")


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
        "version": _files.version_of("granular") or "",
        "style": "".join(shipped(name) for name in parts[2:]),
        "transport": shipped("shell/transport.html"),
        "data": "" if data is None else f'<script type="application/json" id="data">{embedded(data)}</script>',
        "script": bundle(parts[1]),
    }
    html = shipped("shell/shell.html").replace("<body>", '<body data-start="{{start}}">')
    return re.sub(r"\{\{(\w+)\}\}", lambda slot: slots[slot[1]], html.replace("{{body}}", shipped(parts[0])))


@cache
def shipped(name: str) -> str:
    """Return the text of a file of this package."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


@cache
def bundle(main: str) -> str:
    """Return one script: the module `main` after all it imports, each once and in a scope of its own.

    A module becomes ``const { its, exports } = (() => { … })();``, so only exported names must differ.
    """
    return "\n".join(_scoped(shipped(name)) for name in dict.fromkeys(_needed(main)))


def _needed(name: str) -> Iterator[str]:
    """Names of all that a module imports, directly or not, before its own."""
    for path in IMPORT.findall(shipped(name)):
        yield from _needed(normpath(f"{dirname(name)}/{path}"))
    yield name


def _scoped(source: str) -> str:
    names = ", ".join(EXPORT.findall(source))
    body = EXPORT.sub("", IMPORT.sub("", source)).replace("</script", "<\\/script")
    return f"const {{ {names} }} = (() => {{\n{body}return {{ {names} }};\n}})();" if names else body


def embedded(data: Mapping[str, Any]) -> str:
    """Return JSON that may stand inside a script element."""
    return json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("</", "<\\/")

"""Prices of the rooms of the package, for docs/development/prices.md.

``python bench/prices.py`` writes the table of rooms into the page: files and statements of each room, counted as by
`shape.py`, and the seconds of its tests. The seconds are the processor times in tests/README.md, measured by
``python -m pytest -p tests.helpers.processor_time``.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from shape import REPO_ROOT, statements

PAGE = REPO_ROOT / "docs" / "development" / "prices.md"
ROOMS = {
    "_engine": "kernels, compiler pipeline, files, checks", "scene": "scenes, walls",
    "laws": "force laws, collision rules, closed forms", "run": "driver, stop conditions, logs, saved runs, figures",
    "edmd": "hard spheres", "md": "soft spheres", "cases": "ready-made scenes, materials, scene files",
    "comparison": "the comparison of both models", "studies": "maps, thresholds, ensembles, sensitivities, frontiers",
    "app": "command line, teaching page",
}
"""Rooms in the order of their imports, with their subjects."""
TEST_FOLDERS = {"_engine": ("engine",), "md": ("located", "fixed", "md")}
"""Test folders of a room, if their names differ from its name."""


def room_sizes(tree: Path, rooms: Iterable[str] = ()) -> dict[str, tuple[int, int]]:
    """Numbers of files and of statements of each room, or of given folders."""
    sizes = {}
    for room in rooms or ROOMS:
        files = sorted((tree / "granular" / room).rglob("*.py"))
        sizes[room] = len(files), sum(statements(ast.parse(file.read_text(encoding="utf-8"))) for file in files)
    return sizes


def seconds_of_tests(tree: Path) -> dict[str, int]:
    """Processor time of the tests of each folder in s, from tests/README.md."""
    text = (tree / "tests" / "README.md").read_text(encoding="utf-8")
    seconds: dict[str, int] = {}
    for folders, times in re.findall(r"^\| (`[^|]*`) \| [^|]* \| ([\d, ]+) \|$", text, re.MULTILINE):
        seconds |= dict(zip(re.findall(r"`(\w+)`", folders), map(int, times.split(",")), strict=True))
    return seconds


def room_table(tree: Path) -> str:
    """Table of the rooms, with a last row for the whole package and all tests."""
    sizes, seconds = room_sizes(tree), seconds_of_tests(tree)
    lines = ["| room | subject | files | statements | tests, s |", "|---|---|---|---|---|"]
    for room, subject in ROOMS.items():
        spent = sum(seconds[folder] for folder in TEST_FOLDERS.get(room, (room,)))
        lines.append(f"| `{room}` | {subject} | {sizes[room][0]} | {grouped(sizes[room][1])} | {spent} |")
    files, count = (sum(size[k] for size in sizes.values()) for k in (0, 1))
    lines.append(f"| all | tests of documentation and of several rooms included | {files} | {grouped(count)} "
                 f"| {sum(seconds.values())} |")
    return "\n".join(lines)


def grouped(number: int) -> str:
    """Number with a space between groups of three digits, from five digits on."""
    return f"{number:,}".replace(",", " ") if number >= 10_000 else str(number)


def prices_page(text: str, table: str) -> str:
    """Text of docs/development/prices.md with the table of `room_table`."""
    made = f"<!-- rooms -->\n{table}\n<!-- end -->"
    return re.sub(r"<!-- rooms -->.*?<!-- end -->", lambda _: made, text, flags=re.DOTALL)


if __name__ == "__main__":
    PAGE.write_text(prices_page(PAGE.read_text(encoding="utf-8"), room_table(REPO_ROOT)), encoding="utf-8")

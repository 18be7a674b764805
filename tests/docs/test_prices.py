"""docs/development/prices.md has the sizes of the rooms as they are, within 5 %, and the seconds of tests/README.md."""

import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

from bench import prices
from granular._engine.package import EXTRAS

ROOT = Path(__file__).parents[2]
PAGE = prices.PAGE.read_text(encoding="utf-8")
TOLERANCE = 0.05
"""Relative change of a room after which `python bench/prices.py` writes the table again."""


@cache
def room_table():
    """The table of the package as it is, made only when a test needs it: collecting the tests stays fast."""
    return prices.room_table(ROOT)


def rows(text):
    """Files, statements and seconds by room."""
    found = re.findall(r"^\| `?(\w+)`? \| [^|]+ \| (\d+) \| ([\d ]+) \| (\d+) \|$", text, re.MULTILINE)
    return {room: [int(value.replace(" ", "")) for value in values] for room, *values in found}


def test_the_table_has_the_rooms_of_the_package():
    folders = {path.parent.name for path in (ROOT / "granular").glob("*/__init__.py")}
    assert folders == prices.ROOMS.keys() == rows(PAGE).keys() - {"all"}


def test_sizes_are_those_of_today():
    today = rows(room_table())
    for room, (files, count, _) in rows(PAGE).items():
        assert [files, count] == pytest.approx(today[room][:2], rel=TOLERANCE, abs=2), f"{room}: python bench/prices.py"


def test_seconds_are_those_of_the_readme_of_the_tests():
    today = rows(room_table())
    assert {room: row[2] for room, row in rows(PAGE).items()} == pytest.approx(
        {room: row[2] for room, row in today.items()}, rel=0.25, abs=5), "python bench/prices.py"


def test_writing_the_page_again_keeps_its_text():
    page = prices.prices_page(PAGE, room_table())
    assert rows(page).keys() == rows(PAGE).keys()
    assert page.partition("<!-- end -->")[2] == PAGE.partition("<!-- end -->")[2]


def test_every_extra_is_listed_with_its_packages():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = dict(re.findall(r"^\| `(\w+)` \| ([^|]+?) \| ", PAGE.partition("## Optional")[2].partition("## ")[0],
                             re.MULTILINE))
    assert listed.keys() == project["optional-dependencies"].keys() - {"all"}
    assert {extra: set(listed[extra].split(", ")) for extra in EXTRAS} == {
        extra: set(packages.split()) for extra, packages in EXTRAS.items()}


def test_two_thirds_of_md_are_the_located_integrator():
    parts = {name: count for name, (_, count) in prices.room_sizes(ROOT, ("md", "md/located")).items()}
    assert parts["md/located"] / parts["md"] == pytest.approx(2.0 / 3.0, abs=0.05)


def test_every_workflow_is_listed():
    listed = set(re.findall(r"^\| `(\w+\.yml)` \| ", PAGE, re.MULTILINE))
    assert listed == {path.name for path in (ROOT / ".github" / "workflows").iterdir()}

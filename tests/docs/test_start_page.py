"""The film and the screenshot of the start page show what the teaching page and the package compute."""

import re
import sys
from pathlib import Path

import pytest

import granular as gr
from tests.app.page.browser import found

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_heights_of_the_film_are_those_of_the_package(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    stated = [*re.findall(r"rises to\s+([\d.]+\d)", text),
              *re.search(r"to ([\d.]+) drop heights if hard, to ([\d.]+) if soft", text).groups()]
    case = gr.cases.make("real-balls", lower="basketball", upper="tennis ball", height=1.0, gap=1e-3, pair_rule="lens")
    rises = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end).rises
    assert stated == 2 * [f"{rise:.3g}" for rise in rises]


def test_description_of_the_screenshot_is_that_of_the_present_page(monkeypatch):
    if not found():
        pytest.skip("Chromium is not installed")
    monkeypatch.setattr(sys, "path", [str(ROOT / "docs" / "extensions"), *sys.path])
    import start_page

    with start_page.screen(*start_page.PICTURE_VIEWPORT) as tab:
        assert start_page.description(tab) == (ROOT / "docs" / "_static" / "page.txt").read_text(encoding="utf-8")

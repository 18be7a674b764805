"""The site builds without a warning, fetches nothing, has what its first minute promises, is printed without loss."""

import base64
import io
import json
import re
import shutil
import subprocess
import sys
import unicodedata
from pathlib import Path

import numpy as np
import pytest

import granular

ROOT = Path(__file__).parents[2]
MADE = shutil.ignore_patterns("_build", "_examples", "_made", "gallery", "jupyter_execute", "sg_execution_times.rst")
BLOCKS = """[...document.querySelectorAll('article :is(h1, h2, h3, p, li, td, th, pre, figcaption, summary)')]
    .filter((block) => !block.querySelector('p, li, pre, math'))
    .map((block) => {
      block.querySelectorAll('.headerlink, button').forEach((part) => part.remove());
      return block.textContent;
    })"""


@pytest.mark.soak  # a step of .ci/run
def test_the_site(tmp_path, subtests):
    """One build serves all: it is the dearest part."""
    site, html = built(tmp_path)
    for claim in (nothing_is_fetched, what_is_named_is_there, the_start_page_leads_on, the_recorded_run_hops,
                  every_picture_is_described, formulas_are_mathml, the_index_of_the_reference_is_whole,
                  long_tables_are_folded,
                  sheets_are_printed_without_loss):
        with subtests.test(msg=claim.__name__):
            claim(site, html)


def built(folder):
    """The site without running examples and without the sources of the package (tag quick), and its pages' text."""
    for needed in ("sphinx", "myst_nb", "pydata_sphinx_theme", "sphinx_gallery"):
        pytest.importorskip(needed, reason="the site needs the extra 'docs'")
    for name in ("docs", "examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=MADE)
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-t", "quick", "-b", "html", "docs", "site"]
    done = subprocess.run(build, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    site = folder / "site"
    return site, {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}


def nothing_is_fetched(site, html):
    for text in html.values():
        assert not re.findall(r"<(?:script|img|iframe|source)[^>]*src(?:set)?=\"https?:", text)
        assert not re.findall(r"<link[^>]*rel=\"(?:stylesheet|preload|icon)\"[^>]*href=\"https?:", text)
    assert not list(site.rglob("*mathjax*"))


def what_is_named_is_there(site, html):
    name = re.compile(r"<(?:img|iframe|source|a)[^>]* (?:src|srcset|href)=\"([^\"#?:]+)[\"#?]")
    missing = [(page.name, to) for page, text in html.items() for to in name.findall(text)
               if not (page.parent / to).exists()]
    assert not missing


def the_start_page_leads_on(site, html):
    index = html[site / "index.html"]
    parts = ("<figure", 'href="page/index.html"', "<h2>When to use it", "<h2>When not to use it",
             "<h2>Install", "<h2>First comparison", "<h2>Next steps", "<iframe")
    places = [index.index(part) for part in parts]
    assert places == sorted(places)
    path = ("Researcher.", "DEM user.", "Teacher.")
    steps = [index.index(f"<strong>{step}</strong>") for step in path]
    assert steps == sorted(steps)
    assert "<title>granular: hard or soft?" in html[site / "page" / "index.html"]
    assert '"name":"soft spheres"' in html[site / "page" / "player.html"]
    assert (site / "_static" / "two-balls.webp").stat().st_size < 420_000


def the_recorded_run_hops(site, html):
    """Between their four contacts the balls are 34, 16 and 9 µm apart at most; few rows would not show it."""
    data = re.search(r'<script[^>]*id="data">(.*?)</script>', html[site / "page" / "player.html"], re.DOTALL)[1]
    soft = json.loads(data)["runs"][1]
    time, begin, end = (np.frombuffer(base64.b64decode(text), "<f8")
                        for text in (soft["time"], soft["contacts"]["begin"], soft["contacts"]["end"]))
    pair = np.frombuffer(base64.b64decode(soft["contacts"]["pair"]), "<i4")
    points = np.frombuffer(base64.b64decode(soft["path"]), "<f4").reshape(len(time), 3)
    apart = points[:, 2] - points[:, 1]
    spans = zip(end[pair == 1], begin[pair == 1][1:], strict=False)
    hops = [apart[(time > leaves) & (time < meets)].max() for leaves, meets in spans]
    assert np.round(1e6 * np.array(hops)).tolist() == [34, 16, 9]


def every_picture_is_described(site, html):
    for page, text in html.items():
        pictures = re.findall(r"<img[^>]*>", text) if page.parent.name != "page" else []
        assert not [img for img in pictures if not re.search(r' alt="(?![^"]*\.png)[^"]{4,}"', img)], page.name


def formulas_are_mathml(site, html):
    set_apart = {"theory/index": 6, "theory/viscoelastic": 2, "theory/adiabatic": 2, "guide/driven": 3,
                 "guide/answer": 3, "guide/error-definition": 3, "guide/measures": 2}
    assert {name: html[site / f"{name}.html"].count('<math display="block"') for name in set_apart} == set_apart


def the_index_of_the_reference_is_whole(site, html):
    """Every public name is in it, with a link and a line."""
    table = html[site / "api" / "index.html"]
    linked = set(re.findall(r'<a [^>]*href="[^"]+#[^"]+"[^>]*><code[^>]*>(?:<span[^>]*>)?(gr\.[\w.]+)', table))
    functions = {f"gr.{name}" for name in granular.__all__}
    assert functions - linked - {"gr.edmd", "gr.md"} == set()
    assert "9223372036854775807" not in "".join(text for page, text in html.items() if page.parent.name == "api")


def long_tables_are_folded(site, html):
    for name in ("guide/frontier", "guide/stability"):
        shown = re.sub(r"<details>.*?</details>", "", html[site / f"{name}.html"], flags=re.DOTALL)
        assert all(table.count("<tr") <= 9 for table in re.findall(r"<table.*?</table>", shown, re.DOTALL)), name


def sheets_are_printed_without_loss(site, html):
    """Every block of the page is in the PDF, folded ones too; lines break where they like."""
    from tests.app.page import browser

    pypdf = pytest.importorskip("pypdf")
    if browser.found() is None:
        pytest.skip("no Chromium or Chrome is installed: nothing is printed here")
    with browser.Browser() as tab:
        for name, sheets in (("teaching/teacher-sheet", 2), ("teaching/student-sheet", 2)):
            tab.open((site / f"{name}.html").as_uri())
            printed = base64.b64decode(tab.call("Page.printToPDF", preferCSSPageSize=True)["data"])
            pages = pypdf.PdfReader(io.BytesIO(printed)).pages
            text = tight("".join(page.extract_text() for page in pages))
            blocks = [tight(block) for block in tab.run(BLOCKS)]
            assert len(pages) <= sheets
            assert len(blocks) > 20
            assert not [block for block in blocks if block not in text]


def tight(text):
    """A text without its spaces, letters joined to ligatures taken apart."""
    return re.sub(r"\s+", "", unicodedata.normalize("NFKC", text))

"""The site builds without a warning, fetches nothing, and has what its first minute promises."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
MADE = shutil.ignore_patterns("_build", "_examples", "_made", "gallery", "jupyter_execute", "sg_execution_times.rst")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built once without running examples and without the sources of the package (tag quick)."""
    for needed in ("sphinx", "myst_nb", "pydata_sphinx_theme", "sphinx_gallery"):
        pytest.importorskip(needed, reason="the site needs the extra 'docs'")
    folder = tmp_path_factory.mktemp("site")
    for name in ("docs", "examples"):
        shutil.copytree(DOCS.parent / name, folder / name, ignore=MADE)
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-t", "quick", "-b", "html", "docs", "site"]
    done = subprocess.run(build, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "site"


def html_of(site):
    return {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}


def test_nothing_is_fetched_from_elsewhere(site):
    fetched = []
    for html in html_of(site).values():
        fetched += re.findall(r"<(?:script|img|iframe|source)[^>]*src(?:set)?=\"(https?:[^\"]+)", html)
        fetched += re.findall(r"<link[^>]*rel=\"(?:stylesheet|preload|icon)\"[^>]*href=\"(https?:[^\"]+)", html)
    assert not fetched
    assert not list(site.rglob("*mathjax*"))


def test_what_raw_links_and_pictures_name_is_there(site):
    missing = []
    for page, html in html_of(site).items():
        for name in re.findall(r"<(?:img|iframe|source|a)[^>]* (?:src|srcset|href)=\"([^\"#?:]+)[\"#?]", html):
            if not (page.parent / name).exists():
                missing.append((page.name, name))
    assert not missing


def test_the_start_page_leads_to_the_page(site):
    index = (site / "index.html").read_text(encoding="utf-8")
    parts = ("<figure", 'href="page/index.html"', "<h2>Install", "<h2>First answer", "<h2>Your way", "<iframe")
    places = [index.index(part) for part in parts]
    assert places == sorted(places)
    assert "<title>granular: hard or soft?" in (site / "page" / "index.html").read_text(encoding="utf-8")
    assert '"name":"soft spheres"' in (site / "page" / "player.html").read_text(encoding="utf-8")


def test_every_picture_is_described(site):
    for page, html in html_of(site).items():
        pictures = re.findall(r"<img[^>]*>", html) if page.parent.name != "page" else []
        assert not [img for img in pictures if not re.search(r' alt="(?![^"]*\.png")[^"]{4,}"', img)], page.name


def test_formulas_are_mathml(site):
    counts = {name: (site / f"{name}.html").read_text(encoding="utf-8").count('display="block"')
              for name in ("theory", "viscoelastic", "adiabatic", "driven", "concepts")}  # fmt: skip
    assert counts == {"theory": 6, "viscoelastic": 2, "adiabatic": 2, "driven": 3, "concepts": 1}

"""CITATION.cff is valid (Citation File Format 1.2.0) and says the version and the licence of the package."""

import re
import tomllib
from pathlib import Path

import pytest

import granular
from granular._engine.package import VERSION

ROOT = Path(__file__).parents[2]
yaml = pytest.importorskip("yaml", reason="CITATION.cff is YAML")
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FIELDS = {"abstract", "authors", "cff-version", "contact", "commit", "date-released", "doi", "identifiers", "keywords",
          "license", "license-url", "message", "preferred-citation", "references", "repository", "repository-artifact",
          "repository-code", "title", "type", "url", "version"}


def test_required_fields_are_there_and_no_unknown_ones():
    assert {"cff-version", "message", "title", "authors"} <= CITATION.keys() <= FIELDS
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] in ("software", "dataset")
    assert all(isinstance(word, str) for word in CITATION["keywords"])


def test_authors_are_persons_or_entities():
    for author in CITATION["authors"] + [one for work in CITATION["references"] for one in work["authors"]]:
        assert {"name"} == author.keys() or {"family-names", "given-names"} == author.keys()


def test_version_and_licence_are_the_packages():
    assert str(CITATION["version"]) == granular.__version__ == VERSION
    assert CITATION["license"] == PROJECT["license"]
    assert f"version {granular.__version__}" in (ROOT / "docs" / "guide" / "citing.md").read_text(encoding="utf-8")


def test_the_version_has_one_place_from_which_the_build_reads_it():
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" not in PROJECT
    assert PROJECT["dynamic"] == ["version"]
    source = (ROOT / pyproject["tool"]["hatch"]["version"]["path"]).read_text(encoding="utf-8")
    assert re.findall(r"^VERSION = \"(.*)\"$", source, re.MULTILINE) == [VERSION]
    assert re.fullmatch(r"\d+\.\d+\.\d+", VERSION)


def test_the_newest_release_of_the_changelog_has_the_version_and_the_date():
    """Changes after a release stand below a title "[Unreleased]"."""
    titles = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    released = [title for title in titles if title != "[Unreleased]"]
    assert released[0] == f"{VERSION} — {CITATION['date-released']}"
    dates = [title.partition(" — ")[2] for title in released]
    assert all(re.fullmatch(r"\d{4}-\d\d-\d\d", date) for date in dates)
    assert dates == sorted(dates, reverse=True)


def test_the_paper_is_named_with_its_doi():
    (paper,) = CITATION["references"]
    assert {"type", "title", "authors", "journal", "year"} <= paper.keys()
    assert re.fullmatch(r"10\.\d{4,}/\S+", paper["doi"])
    assert paper["doi"] in (ROOT / "docs" / "guide" / "citing.md").read_text(encoding="utf-8")

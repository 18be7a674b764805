"""CITATION.cff is valid (Citation File Format 1.2.0) and says the version and the licence of the package."""

import re
import tomllib
from pathlib import Path

import pytest

import granular

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
    assert str(CITATION["version"]) == granular.__version__ == PROJECT["version"]
    assert CITATION["license"] == PROJECT["license"]
    assert f"version {granular.__version__}" in (ROOT / "docs" / "guide" / "citing.md").read_text(encoding="utf-8")


def test_the_paper_is_named_with_its_doi():
    (paper,) = CITATION["references"]
    assert {"type", "title", "authors", "journal", "year"} <= paper.keys()
    assert re.fullmatch(r"10\.\d{4,}/\S+", paper["doi"])
    assert paper["doi"] in (ROOT / "docs" / "guide" / "citing.md").read_text(encoding="utf-8")

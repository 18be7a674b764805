"""What is installed bears a name that is free, and the command says what is installed and what lies over it."""

import json
import re
import tomllib
from pathlib import Path

import pytest

import granular as gr
from bench import mutants
from granular._engine import kernels
from granular._engine.package import EXTRAS, NAME, VERSION, install
from granular.app.cli import installation
from granular.app.page.assemble import LIVE_PARTS, PLAYER_PARTS, _needed_modules

pytestmark = pytest.mark.core
ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OTHER = {"granular": ["granular", NAME]}


def test_the_name_is_not_that_of_the_other_granular():
    assert NAME == PROJECT["name"] != "granular"
    named = {re.match(r"[\w.-]+", line)[0] for lines in PROJECT["optional-dependencies"].values() for line in lines}
    assert NAME in named
    assert "granular" not in named


def test_extras_are_those_of_the_package():
    declared = PROJECT["optional-dependencies"]
    for extra, packages in EXTRAS.items():
        assert packages.split() == [line.partition(">=")[0] for line in declared[extra]]


def test_every_file_of_the_package_is_read_by_it():
    """None is there for tests only."""
    page = ROOT / "granular" / "app" / "page"
    files = {str(file.relative_to(page)) for file in page.rglob("*.*") if file.suffix in (".mjs", ".css", ".html")}
    read = {name for parts in (LIVE_PARTS, PLAYER_PARTS) for name in (*_needed_modules(parts[1]), parts[0], *parts[2:])}
    assert files == read | {"shell/shell.html", "shell/transport.html"}


def test_info_says_what_is_missing_and_who_else_is_there(granular, monkeypatch):
    monkeypatch.setattr(installation, "packages_distributions", lambda: OTHER)
    versions = {"granular": "0.24.2", "matplotlib": None}
    monkeypatch.setattr("granular._engine.files.version_of", lambda name: versions.get(name, "1.0"))
    code, out, _ = granular("info --json found.json")
    assert code == 0
    assert out.startswith(f"{NAME} {gr.__version__}, in {installation.PACKAGE_FOLDER}\n")
    assert f"extra plot   matplotlib missing: {install('plot')}\n" in out
    assert out.endswith(f"granular 0.24.2 installs a package granular too: {installation.REINSTALL_HINT}\n")
    found = json.loads(Path("found.json").read_text(encoding="utf-8"))
    assert (found["others"], found["extras"]["plot"]) == (["granular 0.24.2"], {"matplotlib": None})


def test_the_command_says_that_another_package_lies_over_it(granular, monkeypatch):
    monkeypatch.delattr(gr, "__version__")
    monkeypatch.setattr(installation, "packages_distributions", dict)
    code, _, err = granular("scenes")
    assert (code, err) == (2, f"granular: {installation.overwritten_message()}\n")
    assert "another package was installed over it, or uninstalled. " in err
    code, out, err = granular("info")
    assert (code, err) == (2, f"granular: {installation.overwritten_message()}\n")
    assert out.startswith(NAME)


def test_info_says_where_machine_code_is_kept_or_that_it_is_not(monkeypatch):
    assert (installation.numba().startswith("cached in ")) == kernels.have_numba()

    def nowhere():
        raise RuntimeError("no locator available")

    monkeypatch.setattr("granular._engine.kernels.missing_compiler_reason", str)
    monkeypatch.setattr("granular._engine.kernels.load_numba", nowhere)
    assert "set NUMBA_CACHE_DIR" in installation.numba()


def test_what_contributing_names_is_there():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(re.findall(r"[\w.-]+/[\w./-]*\w", text)) | set(re.findall(r"\]\(([^)#]+)", text))
    assert {"README.md", ".ci/run", "bench/paired.py", "docs/development/reading.md"} <= named
    assert [name for name in named if not name.startswith(".venv/") and not (ROOT / name).exists()] == []


def test_every_mutant_has_one_place_and_its_tests_exist():
    assert len(mutants.checked_files()) == len(mutants.MUTANTS) > 30


KINDS = ["Answers that changed", "Added", "Changed", "Fixed", "Removed", "Faster"]
"""Sections of a release, in this order."""


def test_the_changelog_has_the_sections_of_a_release_and_one_line_per_change():
    releases = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    assert any(text.startswith(f"{VERSION} — ") for text in releases)
    for text in releases:
        lines = [line for line in text.splitlines()[1:] if line]
        kinds = [line.removeprefix("### ") for line in lines if line.startswith("### ")]
        assert kinds == [kind for kind in KINDS if kind in kinds]
        assert len(lines) <= 40 + len(kinds)
        for line in lines:
            if not line.startswith("### "):
                assert line.startswith("- ")
                assert len(line) <= 120
                assert line.endswith(".")
                assert line.count("(") == line.count(")")
                assert line.count("`") % 2 == 0


def test_the_readme_of_the_tests_lists_their_folders():
    listed = re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (`[^|]*)\|", (ROOT / "tests" / "README.md").read_text(
        encoding="utf-8"), re.MULTILINE)))
    folders = {path.name for path in (ROOT / "tests").iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert set(listed) == folders
    assert len(listed) == len(folders)

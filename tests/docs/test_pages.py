"""The pages in docs/ keep their word: their Python runs, block after block, and prints what they show."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

import granular as gr

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BUILT = {"_build", "_examples", "_made", "gallery", "jupyter_execute"}


def written(pattern):
    """Files of the documentation in all folders, without those that a build leaves behind."""
    return [page for page in sorted(DOCS.rglob(pattern)) if not BUILT & set(page.relative_to(DOCS).parts)]


TEXTS = {page: page.read_text(encoding="utf-8") for page in [ROOT / "README.md", *written("*.md")]}
COMMAND = re.compile(r"^```sh\n([^`]*?)^```\n\n```text\n(.*?)^```", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```python\n(.*?)^```(?:\n\n```text\n(.*?)^```)?", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def agree(printed: str, shown: str) -> bool:
    """Whether two texts have the same words, and numbers that agree; below 1e-9 only rounding is compared."""
    if NUMBER.sub("#", printed).split() != NUMBER.sub("#", shown).split():
        return False
    pairs = zip(map(float, NUMBER.findall(printed)), map(float, NUMBER.findall(shown)), strict=True)
    return all(a == pytest.approx(b, rel=1e-3, abs=1e-9) for a, b in pairs)

PAGES = [page for page, text in TEXTS.items()
         if "```python" in text and page.stem != "other-codes"]  # which needs a dump: test_from_arrays


@pytest.mark.rotating
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_python_of_a_page_runs_and_prints_what_the_page_shows(page, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    # 35 s of compiling for one table
    monkeypatch.setattr("granular.studies.frontier_methods._engine", lambda *_: "plain")
    names: dict = {"__name__": "page"}
    for code, shown in BLOCK.findall(TEXTS[page]):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, page.name, "exec"), names)
        if shown:
            assert agree(printed.getvalue(), shown), f"{page.name} shows\n{shown}\nbut prints\n{printed.getvalue()}"


def test_no_block_of_python_is_left_out():
    """The pages of 0.2.0 had 122 blocks; a page in a folder that is not searched would lose its own."""
    assert sum(len(BLOCK.findall(TEXTS[page])) for page in PAGES) >= 122


def test_there_are_31_recipes_and_their_commands_run(monkeypatch, tmp_path, capsys):
    from granular.app.cli import main

    text = TEXTS[DOCS / "guide" / "how-do-i.md"]
    recipes, lines = len(re.findall(r"^\*\*", text, re.MULTILINE)), re.findall(r"^granular (.*)$", text, re.MULTILINE)
    assert recipes == 31
    assert len(re.findall(r"^```(?:python|sh)$", text, re.MULTILINE)) == recipes + 1, "an import, and a block for each"
    assert len(lines) == 4
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("granular.studies.frontier_methods._engine", lambda *_: "plain")
    scene = gr.scenes.bouncing_ball()
    gr.md.simulate(scene, gr.LinearDashpot(1e6, 10.0), t_end=0.5).save("soft.npz")
    gr.cases.save(gr.cases.make("three-balls", gap=1e-2), "mine.toml")
    for line in lines:
        assert main(shlex.split(line)) == 0, line
    assert "located" in capsys.readouterr().out
    assert {"page.html", "soft.html"} <= {path.name for path in tmp_path.iterdir()}


def commands():
    text = TEXTS[DOCS / "teaching" / "teacher-sheet.md"]
    return [(line.strip(), shown) for line, shown in COMMAND.findall(text)]


@pytest.mark.parametrize(("line", "shown"), commands(), ids=[line for line, _ in commands()])
def test_a_command_of_the_teachers_key_gives_its_verdict(line, shown, capsys, tmp_path, monkeypatch):
    from granular.app.cli import main

    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    program, *arguments = shlex.split(line)
    assert program == "granular"
    assert main(arguments) == 0
    verdict = re.findall(r"^(?:Yes|No|Not).*", capsys.readouterr().out, re.MULTILINE)[-1]
    assert agree(verdict, shown)


def test_numbers_are_compared_and_words_too():
    assert agree("v = 0.70001 m/s, 4 contacts", "v = 0.7 m/s, 4 contacts")
    assert not agree("v = 0.7 m/s, 4 contacts", "v = 0.7 m/s, 5 contacts")
    assert not agree("v = 0.7 m/s", "w = 0.7 m/s")


def test_every_page_is_utf8_without_machine_paths():
    for page in [*written("*.md"), *written("*.ipynb")]:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"(?<![\w.])/(?:home|root|work|tmp|Users)/", text), page.name

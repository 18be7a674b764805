"""Docstrings, constants and pages keep to standard technical English, room by room.

Each habit of speech has a limit per 1,000 words. A room or a folder of pages can have two places of each habit in any
case.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers.language import (
    BUILT,
    FOLDERS,
    FREE_PLACES,
    HABITS,
    LONGEST_FIRST_LINE,
    MAX_PAGE_WORDS,
    REPEATED_NAMES,
    ROOMS,
    ROOT,
    WORD,
    all_docstrings,
    constants,
    excess,
    long_first_lines,
    long_sentences,
    pages,
    repeated,
    single_words,
    sources,
)

PAGE_FOLDERS = (".", "api", "development", "guide", "notebooks", "teaching", "theory")


def test_the_folders_of_pages_are_all_of_them():
    assert sorted(pages()) == sorted(PAGE_FOLDERS)
    assert sum(len(texts) for texts in pages().values()) > 60


@pytest.mark.parametrize("habit", HABITS)
@pytest.mark.parametrize("folder", PAGE_FOLDERS)
def test_pages_of_a_folder_have_few_places_of_a_habit(folder, habit):
    assert excess(pages()[folder], HABITS[habit]) == []


@pytest.mark.parametrize("folder", PAGE_FOLDERS)
def test_few_sentences_of_a_folder_of_pages_are_long(folder):
    assert long_sentences(pages()[folder]) == []


def test_pages_are_short():
    """The files of the package and the core of the engines are generated listings."""
    long = {path.name: len(path.read_text(encoding="utf-8").split()) for path in (ROOT / "docs").rglob("*.md")
            if not BUILT & set(path.parts) and path.name not in ("reading.md", "plain-engines.md", "stability.md")}
    assert {name: words for name, words in long.items() if words > MAX_PAGE_WORDS} == {}


@pytest.mark.parametrize("habit", HABITS)
@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_of_a_room_have_few_places_of_a_habit(room, habit):
    assert excess(all_docstrings(sources(room)), HABITS[habit]) == []


@pytest.mark.parametrize("room", ROOMS)
def test_few_sentences_of_a_room_are_long(room):
    assert long_sentences(all_docstrings(sources(room))) == []


@pytest.mark.parametrize("room", ROOMS)
def test_first_lines_of_a_room_are_short(room):
    assert long_first_lines(sources(room)) == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_constants_have_names_of_several_words(folder):
    assert single_words(constants(sources(folder))) == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_few_names_of_constants_are_defined_in_several_files(folder):
    assert repeated(constants(sources(folder))) == {}


NAME = "shared"
OUTSIDE = f"/work/{NAME}"  # in parts, so that this file does not name it
FORBIDDEN = re.compile(rf"(?m){OUTSIDE}\b|\.\./{NAME}\b|^\s*(?:from|import) {NAME}\b")
GENERATED = {"_build", "_made", "_examples", "gallery", "jupyter_execute", "__pycache__"}


def text_files(folder: Path) -> Iterator[Path]:
    """Text files of the project, without generated and hidden folders."""
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            if path.name in (".ci", ".github") or not (path.name in GENERATED or path.name.startswith(".")):
                yield from text_files(path)
        elif b"\0" not in path.read_bytes()[:8192]:
            yield path


def test_no_file_names_a_folder_outside_the_project():
    files = {path: path.read_text(encoding="utf-8", errors="replace") for path in text_files(ROOT)}
    assert ROOT / "pyproject.toml" in files
    assert [str(path) for path, text in files.items() if FORBIDDEN.search(text)] == []


# Each check finds a made-up offence, and nothing in a text beside it.

SOURCE = '''
"""Module. {0}"""

LIMIT_COUNT = 3
"""Constant. {1}"""


class Ball:
    """Class. {2}"""

    mass = 1.0
    """Attribute. {3}"""

    def fall(self):
        """Function. {4}

        >>> what; is; told
        ... so many; who
        `what; is; told`
        """
        return "what; is; told"
'''


def made_up(*texts: str) -> dict[str, str]:
    """File whose docstrings contain the texts, and nothing else to find."""
    return {"made_up.py": SOURCE.format(*[*texts, *[""] * 5][:5])}


def shown(*texts):
    """The docstrings of made-up files, by place."""
    return all_docstrings(made_up(*texts))


@pytest.mark.parametrize("habit", HABITS.values(), ids=HABITS.keys())
def test_a_habit_is_found_in_each_kind_of_docstring(habit):
    assert len(re.findall(habit.pattern, habit.example)) == 1
    for place in range(3):
        texts = [""] * place + [habit.example] * 3
        assert len(excess(shown(*texts), habit)) == 3
    assert excess(shown(habit.example, habit.example), habit) == []
    assert excess(shown(*[habit.allowed] * 5), habit) == []


@pytest.mark.parametrize("habit", HABITS.values(), ids=HABITS.keys())
def test_the_limit_of_a_habit_grows_with_the_words(habit):
    most = int(habit.limit * 20)
    filler = "ball " * (20_000 - most * len(re.findall(WORD, habit.example)))
    assert excess(shown(filler + most * f" {habit.example}"), habit) == []
    assert excess(shown(filler + (most + FREE_PLACES + 1) * f" {habit.example}"), habit)


def test_a_long_sentence_is_found():
    long, short = "A " + "very " * 23 + "long text.", "This is a short text. "
    assert len(long.split()) == 26
    assert long_sentences(shown(long)) == [long]
    assert long_sentences(shown(long.replace("very ", "", 1))) == []
    assert long_sentences(shown(long.replace(" very", ": very", 1))) == []
    assert long_sentences(shown(long, 20 * short)) == []
    assert long_sentences(shown(f"Table.\n\nmass : {25 * 'float '}\n    This is the mass.")) == []


def test_a_long_first_line_is_found():
    text = "x" * (LONGEST_FIRST_LINE - len("Constant. "))
    assert long_first_lines(made_up("", text)) == []
    assert long_first_lines(made_up("", text + "x")) == ["made_up.py:5"]
    assert long_first_lines(made_up("", text + "\n" + text + text)) == []


def test_names_of_constants_are_found():
    files = {"a.py": "MOST = 1\nFEW: int = 2\nOPEN, SHUT = 0, 1\nLOW, HIGH = range(2)\nX = 3\nNEAR, FAR = 0.1, 1.0\n",
             "b.py": "MOST = 2\nMAX_STEPS = 3\ndef f():\n    INNER = 1\n"}
    found = constants(files)
    assert found == {"MOST": ["a.py", "b.py"], "FEW": ["a.py"], "NEAR": ["a.py"], "FAR": ["a.py"],
                     "MAX_STEPS": ["b.py"]}
    assert single_words(found) == ["MOST", "FEW", "NEAR", "FAR"]
    assert single_words(["A_B", "C_D", "E_F", "ONE", "TWO"]) == []
    many = {f"NAME_{i}": ["a.py", "b.py"] for i in range(REPEATED_NAMES + 1)}
    assert repeated(many) == many
    assert repeated(dict(list(many.items())[1:])) == {}


@pytest.mark.parametrize("text", [
    f"see {OUTSIDE}/a.md", f"see ../{NAME}/a.md", f"import re\n  import {NAME}.a", f"from {NAME}.a import b"])
def test_a_folder_outside_is_found(text):
    assert FORBIDDEN.search(text)
    assert not FORBIDDEN.search(f"from a import {NAME}\n{NAME}_impulse is {NAME}, see network/{NAME}")


def test_rooms_are_all_folders_of_the_package():
    assert {"granular/edmd", "granular/md", "granular/app", "bench", "examples", "granular/*.py"} <= set(ROOMS)
    assert all(all_docstrings(sources(room)) for room in ROOMS)
    whole = {name for room in ROOMS for name in sources(room)}
    assert whole == {name for folder in FOLDERS for name in sources(folder)}

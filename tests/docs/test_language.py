"""Docstrings, constants and pages keep to standard technical English, room by room.

Each habit of speech has a limit per 1,000 words. A room or a folder of pages can have two places of each habit in any
case.
"""

from __future__ import annotations

import ast
import json
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("granular", "bench", "examples")
ROOMS = [room for folder in FOLDERS for room in (
    [f"granular/{inner.name}" for inner in sorted((ROOT / "granular").iterdir()) if (inner / "__init__.py").exists()]
    + ["granular/*.py"] if folder == "granular" else [folder])]
FREE_PLACES, LONGEST_SENTENCE, LONG_SHARE, LONGEST_FIRST_LINE = 2, 25, 0.06, 80
SINGLE_WORD_SHARE, REPEATED_NAMES = 0.4, 20
MAX_PAGE_WORDS = 1500
BUILT = {"_build", "_examples", "_made", "gallery", "jupyter_execute"}
"""Folders that a build of the documentation leaves behind."""
WORD = r"[A-Za-zÀ-ÿ']+"


def any_of(phrases: str) -> str:
    """Pattern of any of these phrases as whole words, in any case. Commas separate the phrases."""
    return rf"(?i:\b(?:{'|'.join(map(re.escape, phrases.split(', ')))})\b)"


class Habit(NamedTuple):
    """A habit: its limit per 1,000 words, its pattern, a sentence with one such place, and a sentence without."""

    limit: float
    pattern: str
    example: str
    allowed: str


HABITS = {
    "free relative clause": Habit(
        1.0, r"(?i:\bwhat\b(?!\s+if\b)(?![^.?]*\?))", "Return what is watched.", "What if it falls? See what happens?"),
    "people": Habit(
        0.3, any_of("who, whoever, nobody, anybody, somebody, everybody"), "Nobody waits.", "The whole body falls."),
    "conversation": Habit(
        0.6, any_of("ask, asks, asked, asking, says, said, tells, told"), "The rule is asked once.", "A task is done."),
    "go on": Habit(
        0.1, r"(?i:\b(?:go|goes|gone|going|went)\s+on\b)", "The run goes\non without it.", "The ball goes upwards."),
    "so many": Habit(
        0.1, r"(?i:\bso\s+(?:many|much|long|often)\b)", "Take so many steps.", "It is so that many balls fall."),
    "old word": Habit(
        0.4, any_of("anew, for good, dear, hang on, hangs on, hung on, mend, mends, mended, but for, of one's own, "
                    "whereof, alike, at once"), "Both are treated alike.", "It is done once, for goods."),
    "noun negated": Habit(
        0.4, r"\b(?:is|are)\s+(?:none\b|no\b(?! (?:longer|more)\b))", "A wall is no ball.", "It is no longer active."),
    "headless pronoun": Habit(
        0.8, r"(?i:\b(?:that|those)\s+(?:of|which|that)\b)", "Use that of the floor.", "The fact that it moves."),
    "semicolon": Habit(3.0, ";", "It falls; it stops.", "It falls. It stops."),
}


def is_text(node: ast.stmt) -> bool:
    """Whether a statement is only a string."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


@cache
def docstrings(source: str) -> list[tuple[int, str]]:
    """Line and text of each docstring, and of each string below an assignment."""
    found = []
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        below = [after for before, after in pairwise(body) if isinstance(before, ast.Assign | ast.AnnAssign)]
        for one in [*(body[:1] if documented else []), *below]:
            if is_text(one):
                found.append((one.lineno, one.value.value.strip()))
    return found


@cache
def prose(text: str) -> str:
    """Text without doctests. Code in backticks counts as one word."""
    kept = [line for line in text.splitlines() if not line.lstrip().startswith((">>>", "... "))]
    return re.sub(r"`[^`]*`", "X", "\n".join(kept))


def sentences(text: str) -> Iterator[str]:
    """Sentences with more than three words. Lines "name : type", bullets and colons separate them too."""
    for paragraph in re.split(r"\n\s*\n", text):
        lines = ["\0" if re.match(r"\s*[\w*, .]+ : ", line) else re.sub(r"^\s*[-*] ", "\0", line)
                 for line in paragraph.splitlines()]
        for sentence in re.split(r"\0|:\s|(?<=[.!?])\s+", "\n".join(lines)):
            if len(sentence.split()) > 3:
                yield " ".join(sentence.split())


@cache
def sources(room: str) -> dict[str, str]:
    """Python sources of a room by their paths."""
    folder, _, files = room.partition("/*")
    paths = (ROOT / folder).glob("*.py") if files else (ROOT / folder).rglob("*.py")
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sorted(paths)}


def all_docstrings(files: dict[str, str]) -> list[tuple[str, str]]:
    """Place and text of all docstrings."""
    return [(f"{name}:{line}", text) for name, source in files.items() for line, text in docstrings(source)]


def excess(texts: list[tuple[str, str]], habit: Habit) -> list[str]:
    """Places of a habit in texts by place if they are more than its limit, otherwise nothing."""
    texts = [(place, prose(text)) for place, text in texts]
    words = sum(len(re.findall(WORD, text)) for _, text in texts)
    found = [f"{place} …{text[max(0, hit.start() - 30):hit.end() + 30]!r}"
             for place, text in texts for hit in re.finditer(habit.pattern, text)]
    return found if len(found) > max(FREE_PLACES, habit.limit * words / 1000.0) else []


def long_sentences(texts: list[tuple[str, str]]) -> list[str]:
    """Long sentences of texts by place if their share is above its limit, otherwise nothing."""
    every = [sentence for _, text in texts for sentence in sentences(prose(text))]
    long = [sentence for sentence in every if len(sentence.split()) > LONGEST_SENTENCE]
    return long if len(long) > LONG_SHARE * len(every) else []


def long_first_lines(files: dict[str, str]) -> list[str]:
    """Places of first lines that are too long."""
    return [place for place, text in all_docstrings(files) if len(text.split("\n")[0]) > LONGEST_FIRST_LINE]


def constants(files: dict[str, str]) -> dict[str, list[str]]:
    """Files that define each module constant. Enumerations, tuples of ints or of a range, are left out."""
    found = defaultdict(list)
    for name, source in files.items():
        for node in ast.parse(source).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
            for target in targets:
                counted = isinstance(target, ast.Tuple) and numbers_its_names(node.value)
                for one in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(one, ast.Name) and re.fullmatch("[A-Z][A-Z0-9_]+", one.id) and not counted:
                        found[one.id].append(name)
    return {constant: sorted(set(names)) for constant, names in found.items()}


def numbers_its_names(value: ast.expr) -> bool:
    """Whether a value of a tuple of names is a range or consists of ints."""
    if isinstance(value, ast.Call):
        return isinstance(value.func, ast.Name) and value.func.id == "range"
    return isinstance(value, ast.Tuple) and all(
        isinstance(one, ast.Constant) and isinstance(one.value, int) for one in value.elts)


def single_words(found: Iterable[str]) -> list[str]:
    """Names of one word if their share is above its limit, otherwise nothing."""
    names = list(found)
    single = [name for name in names if "_" not in name]
    return single if len(single) > SINGLE_WORD_SHARE * len(names) else []


def repeated(found: dict[str, list[str]]) -> dict[str, list[str]]:
    """Names that several files define, if they are more than the limit, otherwise nothing."""
    several = {name: files for name, files in found.items() if len(files) > 1}
    return several if len(several) > REPEATED_NAMES else {}


@cache
def pages() -> dict[str, list[tuple[str, str]]]:
    """Text of the pages by folder, and the Markdown of the notebooks, without code, tables, formulas and links."""
    found = defaultdict(list)
    for path in [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*"))]:
        place = path.relative_to(ROOT)
        if BUILT & set(place.parts) or path.suffix not in (".md", ".ipynb"):
            continue
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".ipynb":
            cells = json.loads(text)["cells"]
            text = "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
        text = re.sub(r"^(`{3,})[\s\S]*?^\1|\$\$[\s\S]*?\$\$", "", text, flags=re.MULTILINE)
        text = re.sub(r"^\|.*$|^<.*$|^\s*\(\S+\)=$", "", text, flags=re.MULTILINE)
        text = re.sub(r"\$[^$]+\$", "X", re.sub(r"\]\([^)]*\)", "]", text))
        found[place.parts[1] if len(place.parts) > 2 else "."].append((place.as_posix(), text))
    return found


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

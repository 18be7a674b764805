"""Habits of speech in docstrings, constants and pages, and the functions that count them."""

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

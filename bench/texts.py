"""List the contents that rewritten docstrings and messages have lost.

``python bench/texts.py REF [PATH ...]`` compares each docstring and message of the commit REF with the text at the same
place in this tree. It lists names in backticks, numbers, symbols of formulas and exceptions that occur in the old text
only. Check each listed item against the code. PATH restricts the list to files whose name contains it.
``--renames FILE`` names a file with one pair ``old new`` per line, which is applied to the old text first.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import subprocess
import tarfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

REPO_ROOT = Path(__file__).resolve().parent.parent
SOURCE_FOLDERS = ("granular", "bench", "examples")
ITEM_PATTERN = re.compile(r"`[^`\n]+`|\b\d[\d.e×⁻⁰¹²³⁴-⁹_+-]*\d\b|(?<![\w`])\d(?![\w`])|\b\w+Error\b"
                          r"|[^\s`]*[Ͱ-Ͽ∂-⋿√±·²³⁻½]+[^\s`]*")
"""Names in backticks, numbers, exceptions, and words with a mathematical symbol."""
Named = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
Defined = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def texts(source: str) -> Iterator[tuple[str, str]]:
    """Place and text of each docstring, constant description and message of a module."""
    tree = ast.parse(source)
    documented = set()

    def walk(node: ast.AST, place: str) -> Iterator[tuple[str, str]]:
        if isinstance(node, Defined) and (text := ast.get_docstring(node)):
            documented.add(id(node.body[0].value))  # type: ignore[attr-defined]
            yield place or "module", text
        body = getattr(node, "body", [])
        for before, after in pairwise(body) if isinstance(body, list) else ():
            if (isinstance(before, ast.Assign | ast.AnnAssign) and isinstance(after, ast.Expr)
                    and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str)):
                documented.add(id(after.value))
                yield f"{place}.{ast.unparse(getattr(before, 'target', None) or before.targets[0])}", after.value.value
        messages = []
        for child in ast.iter_child_nodes(node):
            inner = f"{place}.{child.name}".strip(".") if isinstance(child, Named) else place
            yield from walk(child, inner)
            if isinstance(child, ast.Constant) and isinstance(child.value, str) and id(child) not in documented:
                messages.append(child.value)
        if messages:
            yield f"{place} (strings)", " ".join(messages)

    yield from walk(tree, "")


def sources_of_commit(ref: str) -> dict[str, str]:
    """Sources of the Python files of a commit, by their paths."""
    packed = subprocess.run(["git", "archive", ref, *SOURCE_FOLDERS], cwd=REPO_ROOT, capture_output=True, check=True)
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        return {one.name: archive.extractfile(one).read().decode()  # type: ignore[union-attr]
                for one in archive if one.name.endswith(".py")}


def texts_by_place(sources: dict[str, str]) -> dict[str, dict[str, str]]:
    """Texts by file and place, with several strings of one place joined."""
    found: dict[str, dict[str, str]] = {}
    for name, source in sources.items():
        for place, text in texts(source):
            found.setdefault(name, {})[place] = found.get(name, {}).get(place, "") + " " + text
    return found


def lost_items(old: str, new: str) -> list[str]:
    """Items of the old text that do not occur in the new text."""
    return sorted({item for item in ITEM_PATTERN.findall(old) if item.strip("`,.;:()") not in new})


def main() -> None:
    """Print the lost items."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ref", help="commit to compare with")
    parser.add_argument("paths", nargs="*", help="parts of file names")
    parser.add_argument("--renames", type=Path, help="file with one pair `old new` per line")
    request = parser.parse_args()
    before = sources_of_commit(request.ref)
    for line in request.renames.read_text().splitlines() if request.renames else ():
        old, new = line.split()
        before = {name: re.sub(rf"\b{re.escape(old)}\b", new, text) for name, text in before.items()}
    after = texts_by_place({path.relative_to(REPO_ROOT).as_posix(): path.read_text()
                            for folder in SOURCE_FOLDERS for path in sorted((REPO_ROOT / folder).rglob("*.py"))})
    anywhere: dict[str, str] = {}
    for by_place in after.values():
        for place, text in by_place.items():
            anywhere[place] = anywhere.get(place, "") + " " + text
    lost = 0
    for name, by_place in texts_by_place(before).items():
        if request.paths and not any(part in name for part in request.paths):
            continue
        whole = " ".join(after.get(name, {}).values())
        for place, text in by_place.items():
            new = after.get(name, {}).get(place) or anywhere.get(place) or whole
            if items := lost_items(text, new):
                lost += len(items)
                print(f"{name}: {place}: {'  '.join(items)}")
    print(f"{lost} items to read")


if __name__ == "__main__":
    main()

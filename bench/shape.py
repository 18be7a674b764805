"""Size and structure of the code.

``python bench/shape.py [REF]`` prints the figures of this working tree, and of the commit REF if it is given. Rows:

* statements: statements in the syntax tree without docstrings. Code lines exclude docstrings, comments and blank lines.
  The row docstrings is their fraction of all lines. Functions are measured without their docstrings.
* longest chain of imports: number of modules. Imports inside functions and names that a package loads lazily count.
  Imports for type checking and names that `granular` itself loads lazily do not count.
* import cycles: groups of modules that import each other. All imports count.
* files executed by …: files that an interpreted run of a scene of `walks` executes, starting with the public call.
* statements loaded by compare: statements of all files that `compare` of three dashpot balls imports.
* reading path: main-line files in the docstrings of the rooms. ``--reading`` writes the rooms into
  docs/development/reading.md.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import tokenize
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from textwrap import shorten
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
from walks import SMALL_RUNS, executed_files, loaded_files

MAX_PARAMETERS, MAX_FUNCTION_LINES = 8, 45
"""Maximum numbers of parameters and of lines of a function."""
SHORT_FILE_LINES, LONG_FILE_LINES = 60, 360
"""Numbers of lines below which a file is short, and above which it is long."""
REPO_ROOT = Path(__file__).resolve().parent.parent
Function = ast.FunctionDef | ast.AsyncFunctionDef


def measure(tree: Path) -> dict[str, Any]:
    """All figures of the package below `tree`, which Python must import from there."""
    files = {path.relative_to(tree).as_posix(): path.read_text() for path in sorted((tree / "granular").rglob("*.py"))}
    parsed = {name: ast.parse(text) for name, text in files.items()}
    code = {name: code_lines(text, parsed[name]) for name, text in files.items()}
    functions = [(name, node) for name, module in parsed.items() for node in ast.walk(module)
                 if isinstance(node, Function)]
    docs = sum(len(lines) for module in parsed.values() for lines in docstrings(module))
    total = sum(text.count("\n") for text in files.values())
    faces = public_faces(tree)
    wide = {f"{name}:{node.name}": parameters(node) for name, node in functions if parameters(node) > MAX_PARAMETERS}
    statement_counts = {name: statements(module) for name, module in parsed.items()}
    length = {name: text.count("\n") for name, text in files.items()}
    long = {f"{name}:{node.name}": lines for name, node in functions
            if (lines := body_lines(node)) > MAX_FUNCTION_LINES}
    imported = sum(isinstance(node, ast.Import | ast.ImportFrom) for one in parsed.values() for node in ast.walk(one))
    entries = [path for path in (tree / "granular").iterdir() if path.suffix in ("", ".py")
               and path.name != "__pycache__"]
    path = reading_path(tree)
    return {
        "statements": sum(statement_counts.values()),
        "  imports among them": f"{imported / sum(statement_counts.values()):.1%}",
        "files": len(files),
        f"  below {SHORT_FILE_LINES} lines, __init__ apart": sum(
            lines < SHORT_FILE_LINES for name, lines in length.items() if not name.endswith("__init__.py")),
        f"  above {LONG_FILE_LINES} lines": sum(lines > LONG_FILE_LINES for lines in length.values()),
        "longest chain of imports": len(chain := longest_chain(imports(parsed, types=False))),
        "import cycles": len(cycles := list(import_cycles(imports(parsed)))),
        **{f"files executed by {run}": len(executed_files(prepare, tree)) for run, prepare in SMALL_RUNS.items()},
        "statements loaded by compare": sum(statement_counts[name] for name in loaded_files(tree)),
        "entries of granular/": len(entries),
        "  rooms among them": sum(one.is_dir() for one in entries),
        f"functions above {MAX_FUNCTION_LINES} lines": len(long),
        "reading path, lines": sum(length[name] for name in path),
        "reading path, files": len(path),
        "lines": total,
        "code lines": sum(map(len, code.values())),
        "docstrings": f"{docs / total:.0%}",
        "functions": len(functions),
        "median length of functions": median(len(span(node) & code[name]) for name, node in functions),
        f"functions with more than {MAX_PARAMETERS} parameters": len(wide),
        "  of them public": sum(name in faces for name in wide),
        "wide": {name + (" (public)" if name in faces else ""): n for name, n in wide.items()},
        "long": long,
        "chain": chain,
        "cycles": [" ".join(sorted(cycle)) for cycle in cycles],
    }


def body_lines(node: Function) -> int:
    """Number of lines of a function without its docstring."""
    first = node.body[0]
    docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    return len(span(node)) - (len(range(first.lineno, (first.end_lineno or 0) + 1)) if docstring else 0)


def reading_path(tree: Path) -> list[str]:
    """Main-line files that the docstrings of the rooms list, in reading order."""
    return [file.relative_to(tree).as_posix() for file in main_line(tree / "granular")]


def main_line(folder: Path) -> Iterator[Path]:
    """Main-line files of a room and of its main-line folders, in reading order."""
    for name in listed_files(folder)[0]:
        if name.endswith("/"):
            yield from main_line(folder / name)
        else:
            yield folder / f"{name}.py"


def listed_files(folder: Path) -> tuple[list[str], list[str]]:
    """Names of the main-line files and of the other files in the docstring of a room.

    Names of folders end in /.
    """
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or ""
    found = (re.search(rf"^{head}: (.*?)\.$", text, re.M | re.S)
             for head in ("(?:Main line|Start with)", "(?:A first reader may skip|Support modules)"))
    main, others = (re.findall(r"`([\w/]+)`", one[1]) if one else [] for one in found)
    return main, others


def first_sentence(file: Path) -> str:
    """First sentence of the docstring of a module."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    sentence = re.split(r"(?<=[.?!])\s", " ".join(text.partition("\n\n")[0].split()))[0]
    return shorten(sentence.rstrip(".:;"), 100, placeholder=" …")


def tree_lines(folder: Path, depth: int = 0) -> Iterator[str]:
    """Rooms as a tree, one line per file.

    Main-line files come first, with an arrow and their number of lines.
    """
    main, others = listed_files(folder)
    for name in [*main, *others]:
        inner = folder / name
        file = inner / "__init__.py" if name.endswith("/") else inner.with_suffix(".py")
        path = name in main and not name.endswith("/")
        lines = str(len(file.read_text(encoding="utf-8").splitlines())) if path else ""
        shown = "  " * depth + (name if name.endswith("/") else f"{name}.py")
        yield f"{'→' if name in main else ' '} {lines:>3}  {shown:34}  {first_sentence(file)}"
        if name.endswith("/"):
            yield from tree_lines(inner, depth + 1)


def reading_page(text: str, tree: Path) -> str:
    """Text of docs/development/reading.md with the current tree."""
    path = reading_path(tree)
    lines = sum(len((tree / name).read_text(encoding="utf-8").splitlines()) for name in path)
    body = "\n".join(tree_lines(tree / "granular"))
    made = (f"<!-- tree -->\nStart with {len(path)} files (→, with their lines), together {lines} lines.\n\n"
            f"```text\n{body}\n```\n<!-- end -->")
    return re.sub(r"<!-- tree -->.*?<!-- end -->", lambda _: made, text, flags=re.S)


def docstrings(module: ast.Module) -> Iterator[range]:
    """Lines of every docstring, including strings below assignments."""
    for node in ast.walk(module):
        for one in getattr(node, "body", []) if not isinstance(node, ast.Lambda | ast.IfExp) else []:
            if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) and isinstance(one.value.value, str):
                assert one.end_lineno is not None
                yield range(one.lineno, one.end_lineno + 1)


def statements(module: ast.Module) -> int:
    """Number of statements without docstrings."""
    return sum(isinstance(node, ast.stmt) for node in ast.walk(module)) - sum(1 for _ in docstrings(module))


def code_lines(text: str, module: ast.Module) -> set[int]:
    """Numbers of the lines that contain code."""
    nothing = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in nothing:
            lines.update(range(token.start[0], token.end[0] + 1))
    return lines.difference(*docstrings(module))


def span(node: Function) -> set[int]:
    """Line numbers of a function."""
    assert node.end_lineno is not None
    return set(range(node.lineno, node.end_lineno + 1))


def parameters(node: Function) -> int:
    """Number of parameters, including `self`."""
    given = node.args
    return len([*given.posonlyargs, *given.args, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))])


def public_faces(tree: Path) -> set[str]:
    """Public functions, each as "file:name".

    They are named in ``__all__`` of `granular` or of its public modules.
    """
    import granular as gr

    imported = Path(str(gr.__file__))
    assert imported.is_relative_to(tree), imported
    faces = set()
    for name in gr.__all__:
        given = getattr(gr, name)
        for one in [getattr(given, inner) for inner in getattr(given, "__all__", [])] + [given]:
            code = getattr(one, "__code__", None)
            if code is not None:
                faces.add(f"{Path(code.co_filename).relative_to(tree).as_posix()}:{code.co_name}")
    return faces


def imports(parsed: dict[str, ast.Module], types: bool = True) -> dict[str, set[str]]:
    """Modules that each module imports, anywhere in its code.

    Without `types`, imports below TYPE_CHECKING do not count. Modules in a call of `attributes`, by which a package
    loads names lazily, count for all packages except `granular` itself.
    """
    modules = {name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): tree
               for name, tree in parsed.items()}
    found: dict[str, set[str]] = {}
    for name, tree in modules.items():
        given: set[str] = set()
        for node in ast.walk(tree) if types else at_run_time(tree):
            if isinstance(node, ast.Call) and name != "granular" and getattr(node.func, "id", "") == "attributes":
                given |= {key.value for one in node.args if isinstance(one, ast.Dict) for key in one.keys
                          if isinstance(key, ast.Constant)}
            elif isinstance(node, ast.Import):
                given |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                given |= {one if one in modules else node.module for one in inner}
        found[name] = given & modules.keys() - {name}
    return found


def at_run_time(node: ast.AST) -> Iterator[ast.AST]:
    """Executed nodes of a syntax tree, without the blocks below TYPE_CHECKING."""
    yield node
    skipped = node.body if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING" else []
    for child in ast.iter_child_nodes(node):
        if child not in skipped:
            yield from at_run_time(child)


def longest_chain(graph: dict[str, set[str]]) -> list[str]:
    """Longest chain of modules in an import graph without cycles."""
    below: dict[str, list[str]] = {}

    def chain(name: str) -> list[str]:
        if name not in below:
            below[name] = [name, *max(map(chain, sorted(graph[name])), key=len, default=[])]
        return below[name]

    return max(map(chain, sorted(graph)), key=len)


def import_cycles(graph: dict[str, set[str]]) -> Iterator[set[str]]:
    """Strongly connected components of more than one module."""
    reach = {start: reachable(graph, start) for start in graph}
    left = set(graph)
    while left:
        one = left.pop()
        cycle = {other for other in reach[one] if one in reach[other]} | {one}
        left -= cycle
        if len(cycle) > 1:
            yield cycle


def reachable(graph: dict[str, set[str]], start: str) -> set[str]:
    """Modules that `start` imports directly or indirectly."""
    seen: set[str] = set()
    todo = [start]
    while todo:
        new = graph[todo.pop()] - seen
        seen |= new
        todo += new
    return seen


def measured(tree: Path) -> dict[str, Any]:
    """Result of `measure` in a process that imports the package of `tree`."""
    shown = subprocess.run([sys.executable, __file__, "--measure", str(tree)], check=True, capture_output=True,
                           text=True, env=os.environ | {"PYTHONPATH": str(tree)})
    figures: dict[str, Any] = json.loads(shown.stdout)
    return figures


def figures_of_commit(ref: str) -> dict[str, Any]:
    """Result of `measure` for the package of commit `ref`."""
    packed = subprocess.run(["git", "archive", ref, "granular"], check=True, capture_output=True,
                            cwd=REPO_ROOT).stdout
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
            archive.extractall(folder, filter="data")
        return measured(Path(folder).resolve())


def table(columns: dict[str, dict[str, Any]]) -> str:
    """Figures side by side, then wide and long functions, the chain and the cycles."""
    lines = [f"{'':46}" + "".join(f"{title:>14}" for title in columns)]
    rows = [name for name in next(iter(columns.values())) if name not in ("wide", "long", "cycles", "chain")]
    lines += [f"{name:46}" + "".join(f"{column[name]!s:>14}" for column in columns.values()) for name in rows]
    for title, column in columns.items():
        lines += ["", f"{title}: functions with more than {MAX_PARAMETERS} parameters"]
        lines += [f"  {n:3} {name}" for name, n in sorted(column["wide"].items(), key=lambda item: -item[1])]
        lines += ["", f"{title}: functions of more than {MAX_FUNCTION_LINES} lines"]
        lines += [f"  {n:3} {name}" for name, n in sorted(column["long"].items(), key=lambda item: -item[1])]
        lines += ["", f"{title}: longest chain of imports", *(f"  {name}" for name in column["chain"])]
        lines += ["", f"{title}: import cycles", *(f"  {cycle}" for cycle in column["cycles"])]
    return "\n".join(lines)


def main() -> None:
    """Print the table, or write docs/development/reading.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ref", nargs="?", metavar="REF", help="commit to compare with")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    parser.add_argument("--reading", action="store_true", help="write docs/development/reading.md")
    given = parser.parse_args()
    if given.reading:
        page = REPO_ROOT / "docs" / "development" / "reading.md"
        page.write_text(reading_page(page.read_text(encoding="utf-8"), REPO_ROOT), encoding="utf-8")
        return
    if given.measure:
        print(json.dumps(measure(Path(given.measure))))
        return
    columns = {"this tree": measured(REPO_ROOT)}
    if given.ref:
        columns[given.ref] = figures_of_commit(given.ref)
    print(table(columns))


if __name__ == "__main__":
    main()

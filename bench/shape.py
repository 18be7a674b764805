"""The shape of the code: how much of it there is, and how far one has to walk through it.

``python bench/shape.py [REF]`` prints this working tree, beside the commit REF if one is named. Rows:

* statements: nodes of the syntax tree that are statements, docstrings apart; code lines: without docstrings, comments
  and blank lines; docstrings: their share of all lines.
* rings: groups of modules that import each other, imports inside functions and for types alone counted.
* hops: distinct functions of the package that one interpreted run calls, and files they stand in: three hard balls on
  a floor from their gaps to the collisions; two soft balls from their overlap to the contact log, under a built-in law
  and under a law of one's own; the option ``--max-events`` of ``granular compare three-balls``.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
import tokenize
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

MANY = 8
"""Parameters that a function may have."""
ROOT = Path(__file__).resolve().parent.parent
Function = ast.FunctionDef | ast.AsyncFunctionDef


def measure(tree: Path) -> dict[str, Any]:
    """All figures of the package below `tree`, which must be the one that Python imports."""
    files = {path.relative_to(tree).as_posix(): path.read_text() for path in sorted((tree / "granular").rglob("*.py"))}
    parsed = {name: ast.parse(text) for name, text in files.items()}
    code = {name: code_lines(text, parsed[name]) for name, text in files.items()}
    functions = [(name, node) for name, module in parsed.items() for node in ast.walk(module)
                 if isinstance(node, Function)]
    docs = sum(len(lines) for module in parsed.values() for lines in docstrings(module))
    total = sum(text.count("\n") for text in files.values())
    faces = public_faces(tree)
    wide = {f"{name}:{node.name}": parameters(node) for name, node in functions if parameters(node) > MANY}
    hard, soft, own, option = (hops(run, tree) for run in (hard_run, soft_run, own_law_run, command_run))
    return {
        "files": len(files),
        "lines": total,
        "statements": sum(statements(module) for module in parsed.values()),
        "code lines": sum(map(len, code.values())),
        "docstrings": f"{docs / total:.0%}",
        "functions": len(functions),
        "median length of functions": median(len(span(node) & code[name]) for name, node in functions),
        f"functions with more than {MANY} parameters": len(wide),
        "  of them public": sum(name in faces for name in wide),
        "rings of imports": len(rings := list(cycles(imports(parsed)))),
        "functions from a gap to a hard collision": hard[0],
        "  in files": hard[1],
        "functions from an overlap to the log": soft[0],
        "  in their files": soft[1],
        "functions from an overlap to the log, own law": own[0],
        "  in the files": own[1],
        "functions from an option to the report": option[0],
        "  in files of theirs": option[1],
        "wide": {name + (" (public)" if name in faces else ""): n for name, n in wide.items()},
        "rings": [" ".join(sorted(ring)) for ring in rings],
    }


def docstrings(module: ast.Module) -> Iterator[range]:
    """Lines of every docstring, those below the assignment of a name too."""
    for node in ast.walk(module):
        for one in getattr(node, "body", []) if not isinstance(node, ast.Lambda | ast.IfExp) else []:
            if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) and isinstance(one.value.value, str):
                assert one.end_lineno is not None
                yield range(one.lineno, one.end_lineno + 1)


def statements(module: ast.Module) -> int:
    """Statements, docstrings apart."""
    return sum(isinstance(node, ast.stmt) for node in ast.walk(module)) - sum(1 for _ in docstrings(module))


def code_lines(text: str, module: ast.Module) -> set[int]:
    """Numbers of the lines that hold code."""
    nothing = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in nothing:
            lines.update(range(token.start[0], token.end[0] + 1))
    return lines.difference(*docstrings(module))


def span(node: Function) -> set[int]:
    """Lines of a function."""
    assert node.end_lineno is not None
    return set(range(node.lineno, node.end_lineno + 1))


def parameters(node: Function) -> int:
    """Number of parameters, `self` counted."""
    given = node.args
    return len([*given.posonlyargs, *given.args, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))])


def public_faces(tree: Path) -> set[str]:
    """"file:name" of the functions that `granular` and its public modules name in ``__all__``."""
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


def imports(parsed: dict[str, ast.Module]) -> dict[str, set[str]]:
    """Which modules every module imports, wherever the import stands."""
    modules = {name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): tree
               for name, tree in parsed.items()}
    found: dict[str, set[str]] = {}
    for name, tree in modules.items():
        given: set[str] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                given |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                given |= {one if one in modules else node.module for one in inner}
        found[name] = given & modules.keys() - {name}
    return found


def cycles(graph: dict[str, set[str]]) -> Iterator[set[str]]:
    """Strongly connected components of more than one module."""
    reach = {start: reachable(graph, start) for start in graph}
    left = set(graph)
    while left:
        one = left.pop()
        ring = {other for other in reach[one] if one in reach[other]} | {one}
        left -= ring
        if len(ring) > 1:
            yield ring


def reachable(graph: dict[str, set[str]], start: str) -> set[str]:
    """Everything that `start` imports, in one step or many."""
    seen: set[str] = set()
    todo = [start]
    while todo:
        new = graph[todo.pop()] - seen
        seen |= new
        todo += new
    return seen


def hard_run() -> Any:
    """Three balls that bounce on a floor."""
    import granular as gr

    scene = gr.Scene([float("inf"), 1.0, 0.5, 1.0], [0.0, 0.1, 0.1, 0.1], [0.1, 0.01, 0.02], [0.0] * 4, 9.81)
    return lambda: gr.edmd.simulate(scene, gr.ConstantRestitution(0.8), t_end=0.3, engine="sorted").contacts


def soft_run() -> Any:
    """Two balls that bounce on a floor, under Hertz's law with damping."""
    import granular as gr

    scene = gr.Scene([float("inf"), 1.0, 0.5], [0.0, 0.1, 0.1], [0.1, 0.01], [0.0] * 3, 9.81)
    law = gr.ViscoelasticHertz(1e6, 100.0)
    return lambda: gr.md.simulate(scene, law, t_end=0.3, engine="plain").contacts


def command_run() -> Any:
    """An option of the command that both engines have."""
    from granular.cli import main

    def run() -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            main(["compare", "three-balls", "--max-events", "100000"])

    return run


def own_law_run() -> Any:
    """Two balls that bounce on a floor, under the law of docs/your-own-law.md."""
    import granular as gr

    @dataclass(frozen=True)
    class Stiffening:
        k: float
        s: float
        gamma: float

        def force(self, xi: float, xi_dot: float, pair: Any) -> float:
            ratio = xi / self.s
            return self.k * xi * (1.0 + ratio * ratio) + self.gamma * xi_dot

    scene = gr.Scene([float("inf"), 1.0, 0.5], [0.0, 0.1, 0.1], [0.1, 0.01], [0.0] * 3, 9.81)
    law = Stiffening(5e7, 1e-3, 100.0)
    return lambda: gr.md.simulate(scene, law, t_end=0.3, engine="plain").contacts


def hops(prepare: Callable[[], Callable[[], Any]], tree: Path) -> tuple[int, int]:
    """Distinct functions of the package that a run calls, and files they stand in."""
    run, called, package = prepare(), set(), str(tree / "granular") + os.sep
    run()  # imports and tables are made

    def note(frame: Any, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(package) and not code.co_name.startswith("<"):
            called.add((code.co_filename, code.co_qualname))

    sys.setprofile(note)
    try:
        run()
    finally:
        sys.setprofile(None)
    return len(called), len({file for file, _ in called})


def measured(tree: Path) -> dict[str, Any]:
    """`measure` in a process that imports the package of `tree`."""
    shown = subprocess.run([sys.executable, __file__, "--measure", str(tree)], check=True, capture_output=True,
                           text=True, env=os.environ | {"PYTHONPATH": str(tree)})
    figures: dict[str, Any] = json.loads(shown.stdout)
    return figures


def of_commit(ref: str) -> dict[str, Any]:
    """`measure` of the package as it was at `ref`."""
    packed = subprocess.run(["git", "archive", ref, "granular"], check=True, capture_output=True, cwd=ROOT).stdout
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
            archive.extractall(folder, filter="data")
        return measured(Path(folder).resolve())


def table(columns: dict[str, dict[str, Any]]) -> str:
    """The figures side by side, then what is wide and what is a ring."""
    lines = [f"{'':46}" + "".join(f"{title:>14}" for title in columns)]
    rows = [name for name in next(iter(columns.values())) if name not in ("wide", "rings")]
    lines += [f"{name:46}" + "".join(f"{column[name]!s:>14}" for column in columns.values()) for name in rows]
    for title, column in columns.items():
        lines += ["", f"{title}: functions with more than {MANY} parameters"]
        lines += [f"  {n:3} {name}" for name, n in sorted(column["wide"].items(), key=lambda item: -item[1])]
        lines += ["", f"{title}: rings of imports", *(f"  {ring}" for ring in column["rings"])]
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ref", nargs="?", metavar="REF")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.measure:
        print(json.dumps(measure(Path(given.measure))))
        return
    columns = {"this tree": measured(ROOT)}
    if given.ref:
        columns[given.ref] = of_commit(given.ref)
    print(table(columns))


if __name__ == "__main__":
    main()

"""Page of the engines: their main functions for scenes without special features.

    python bench/plain_engines.py            write docs/development/plain-engines.md

A kernel contains branches for driven walls, thermal walls, forces, pendula and rings. Here the flags of these features
are folded to False. The source lines that remain are cut out by their positions in the syntax tree, so that comments
survive. `tests/docs/test_plain_engines.py` runs these functions in place of the original ones.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from textwrap import fill
from typing import Any

PAGE_PATH = Path(__file__).resolve().parent.parent / "docs" / "development" / "plain-engines.md"
FLAGS = frozenset({"DRIVEN", "HEATED", "WORKED", "FORCED", "HUNG", "RING"})
"""Flags of the kernels that are False in scenes without special features."""
MAX_WIDTH = 110
"""Width above which a folded condition is written on several lines."""
SECTIONS = (
    ("Hard spheres: the event loop", "granular.edmd.sorted_queue", ("loop",),
     "The queue holds one entry per pair: the time of its next collision. The loop takes the first entry, applies the "
     "collision, and predicts the pair and its two neighbours again."),
    ("Hard spheres: one collision", "granular.edmd.collision", ("collide_pair",),
     "`rate` and `w` are rates of change of a gap, negative while two balls approach. A pair stores its gap at the "
     "time `at` of its last event, so balls that take part in no event are never touched."),
    ("Hard spheres: prediction and velocities after a collision", "granular.edmd.motion",
     ("next_event_time", "apply_collision"), ""),
    ("Soft spheres: the event loop", "granular.md.located.blocks", ("advance", "apply_next_event", "end_piece"),
     "Balls in contact form an island, which is advanced by polynomial pieces. The queue holds the end of the current "
     "piece of every island, and the onset of contact of every other pair. A contact of two balls without neighbours "
     "in contact is solved as one event; all others go through `end_piece`."),
    ("Soft spheres: one piece", "granular.md.located.plan", ("advance_island",),
     "Each member of an island has series in τ for its overlap `x` and its rate `e`. `push` advances the velocities of "
     "the balls by the impulses of the contact forces."),
    ("Soft spheres: the first event of a pair, and its mode afterwards", "granular.md.located.pieces", ("next_event",),
     "The modes of a contact and their order are shown in [Life of a contact](contact-life.md)."),
    ("", "granular.md.located.modes", ("change_mode",), ""),
    ("Soft spheres in fixed steps: one Verlet step", "granular.md.fixed.integrators",
     ("verlet", "move_pair", "finish_verlet_step"),
     "The alternative to located events. A window of the chain is stored in arrays with one value per pair or body."),
)
"""Heading, module, functions and introduction of each section."""
INTRODUCTION = """# The engines without special scenes

The functions below are the core of both engines. They are cut from the source, without the branches for driven and
thermal walls, external forces, pendula and rings, by `python bench/plain_engines.py`. A test runs three scenes with
these functions in place of the originals and compares the results bit by bit. Symbols and signs are those of the
[notation](../guide/notation.md). `examples/from_scratch.py` does the same in a hundred lines without the package.
"""


def truth(node: ast.expr, false: frozenset[str]) -> bool | None:
    """Return the value of a condition in which the names in `false` are False.

    The result is None if the condition depends on other values.
    """
    if isinstance(node, ast.Name):
        return False if node.id in false else None
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        return node.value
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        inner = truth(node.operand, false)
        return None if inner is None else not inner
    if isinstance(node, ast.BoolOp):
        values = [truth(value, false) for value in node.values]
        decisive = isinstance(node.op, ast.Or)  # True decides an `or`, False an `and`
        if decisive in values:
            return decisive
        return (not decisive) if None not in values else None
    return None


class Folder(ast.NodeTransformer):
    """Fold conditions in expressions; statements are handled by `kept_lines`."""

    def __init__(self, false: frozenset[str]) -> None:
        self.false = false

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        """Drop the operands that are known."""
        kept = [self.visit(value) for value in node.values if truth(value, self.false) is None]
        return kept[0] if len(kept) == 1 else ast.BoolOp(node.op, kept)  # type: ignore[no-any-return]

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        """Replace a conditional expression with a known condition by its value."""
        known = truth(node.test, self.false)
        return self.generic_visit(node) if known is None else self.visit(node.body if known else node.orelse)


def folded(text: str, header: bool, false: frozenset[str]) -> str:
    """Return a statement, or the header of a compound one, with folded conditions.

    The text is returned unchanged, with its layout and comments, if there is nothing to fold.
    """
    tree = ast.parse(text.strip() + ("\n    pass" if header else ""))
    if not any(isinstance(node, ast.Name) and node.id in false for node in ast.walk(tree)):
        return text
    indent = text[: len(text) - len(text.lstrip())]
    comment = re.search(r"  # .*$", text)
    tree = ast.fix_missing_locations(Folder(false).visit(tree))
    line = indent + ast.unparse(tree).splitlines()[0] + (comment[0] if comment else "")
    if len(line) <= MAX_WIDTH or not line.lstrip().startswith("if "):
        return line
    condition = line.strip()[3:-1].replace(" and ", f"\n{indent}    and ")
    return f"{indent}if (\n{indent}    {condition}\n{indent}):"


def constants(function: ast.FunctionDef) -> frozenset[str]:
    """Return the flags and the local names that are always False because of them."""
    values: dict[str, list[ast.expr]] = {}
    for node in ast.walk(function):
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            values.setdefault(node.targets[0].id, []).append(node.value)
    return FLAGS | {name for name, assigned in values.items() if all(truth(v, FLAGS) is False for v in assigned)}


def kept_lines(body: list[ast.stmt], lines: list[str], begin: int, dedent: int, false: frozenset[str]) -> Iterator[str]:
    """Yield the source lines of a block that remain after folding.

    A comment before a statement is kept with the statement. `begin` is the index of the first line that can belong to
    the block, and `dedent` the number of spaces to remove.
    """
    for statement in body:
        before, first, end = lines[begin : statement.lineno - 1], statement.lineno - 1, statement.end_lineno or 0
        begin = end
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name) and (
                statement.targets[0].id in false):
            continue
        if not isinstance(statement, ast.If | ast.While | ast.For):
            yield from (line[dedent:] for line in before)
            yield folded("\n".join(line[dedent:] for line in lines[first:end]), False, false)
            continue
        inner = statement.body[0].lineno - 1
        while inner > first + 1 and lines[inner - 1].strip().startswith("#"):
            inner -= 1
        known = truth(statement.test, false) if isinstance(statement, ast.If) else None
        otherwise = statement.body[-1].end_lineno or 0
        chained = bool(statement.orelse) and lines[otherwise].strip().startswith("elif")
        if known is None:
            yield from (line[dedent:] for line in before)
            head = "\n".join(line[dedent:] for line in lines[first:inner])
            yield folded(re.sub(r"^(\s*)elif ", r"\1if ", head), True, false)
            yield from kept_lines(statement.body, lines, inner, dedent, false)
            rest = list(kept_lines(statement.orelse, lines, otherwise + (not chained), dedent, false))
            if chained and rest and rest[0].strip().startswith("if "):
                rest[0] = rest[0].replace("if ", "elif ", 1)
            elif rest:
                rest = ["    " * chained + line for line in rest]
                word = lines[otherwise].strip() if not chained else "else:"
                yield " " * (statement.col_offset - dedent) + word
            yield from rest
        elif known:  # the comment above it explains the condition, so it goes as well
            yield from kept_lines(statement.body, lines, inner, dedent + 4, false)
            if isinstance(statement.body[-1], ast.Return | ast.Continue):
                return
        elif statement.orelse:
            yield from kept_lines(statement.orelse, lines, otherwise + (not chained), dedent + 4 * (not chained), false)


def plain_source(function: Callable[..., Any]) -> str:
    """Return the source of a kernel with all flags folded to False.

    Decorators are left out.
    """
    text = inspect.getsource(function)
    tree = ast.parse(text).body[0]
    assert isinstance(tree, ast.FunctionDef)
    lines, start = text.splitlines(), tree.body[0].lineno - 1
    result = lines[tree.lineno - 1 : start] + list(kept_lines(tree.body, lines, start, 0, constants(tree)))
    return re.sub(r"  # type: ignore\S*", "", "\n".join(result))


def page() -> str:
    """Return the page as Markdown."""
    parts = [INTRODUCTION]
    for heading, module, names, introduction in SECTIONS:
        sources = [plain_source(getattr(import_module(module), name)) for name in names]
        parts += [f"## {heading}\n"] if heading else []
        parts += [fill(introduction, 118) + "\n"] if introduction else []
        where = f"# {module.replace('.', '/')}.py\n"
        parts.append(f"```{{code-block}} python\n{where}" + "\n\n\n".join(sources) + "\n```\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE_PATH.write_text(page(), encoding="utf-8")

"""Page of the engines: their main functions for scenes without special features.

    python bench/plain_engines.py            write docs/development/plain-engines.md

A kernel contains branches for driven walls, thermal walls, forces, pendula and rings. Here the flags of these features
are folded to False. The source lines that remain are cut out by their positions in the syntax tree, so that comments
survive. Assignments that nothing reads afterwards are cut as well. `tests/docs/test_plain_engines.py` runs these
functions in place of the original ones.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

PAGE_PATH = Path(__file__).resolve().parent.parent / "docs" / "development" / "plain-engines.md"
FLAGS = frozenset({"DRIVEN", "HEATED", "WORKED", "FORCED", "HUNG", "RING", "METERED"})
"""Flags of the kernels that are False in scenes without special features."""
MAX_WIDTH = 110
"""Width above which a folded condition is written on several lines."""
KNOWN = {"edge_result == BLOCKS_CHANGED": False, "block.event != EDGE": True}
"""Values of comparisons that depend on driven walls only."""
IDLE_CALLS = frozenset({"connect_ring_ends"})
"""Functions that do nothing without a ring."""
SECTIONS = (
    ("Hard spheres: the event loop", "granular.edmd.sorted_queue", ("loop", "head", "refresh"), """\
The queue holds one entry (time, rank) for each pair that will collide. The loop takes the first entry, applies the
collision, and predicts the pair and its two neighbours again. If bodies stick or are released, it predicts all pairs
of their cluster and the pairs next to it.

* *Ties.* Events with exactly equal times are ordered by rank: by default, the lower pair comes first (option `ties`).
  A pair that touches and approaches is due immediately. A collision can therefore cause further events at the same
  time. With a group rule (`GROUP`, such as `ties="newton"`) the loop returns `TOUCHING` if a neighbour touches, and
  its caller solves the whole touching group.
* *Clock.* Times are counted from an *epoch*. `run.edge` is at most the end of the time window that begins at the
  epoch. If the next event is later, the loop returns `LATER`. The caller then moves the epoch by whole windows: it
  carries all gaps to the new epoch, changes the fall velocities by −g times the shift, and predicts all pairs again.
  Late times therefore keep their digits.
* *End.* The queue ends with an entry at time inf, so it is never empty. `APART` stops the run when no pair
  approaches."""),
    ("Hard spheres: one collision", "granular.edmd.collision", ("collide_pair",), """\
A pair stores its `gap` at a time `at`. A body stores its `fall_velocity` u = v + g·now: its velocity at the epoch,
extrapolated in free flight, which therefore does not change u. A floor at rest has u = 0. The rate of a gap at time t
is u_upper − u_lower − a·t, negative while the gap closes. The closing acceleration a is g above a floor, −g below a
ceiling and 0 between two balls. `w` is the rate just before the collision.

A collision changes the rates of the two neighbouring pairs, so these are carried to `now` first. All other pairs and
balls stay as they are.

`clamps` counts gaps that rounding made negative. `noise` is here a bound of the *squared* rounding error of u, in
m²/s². `streak` grows with consecutive suspicious collisions, which are the sign of an inelastic collapse. `tc`,
`elastic_below` and `merge_below` are its remedies."""),
    ("Hard spheres: prediction and velocities after a collision", "granular.edmd.motion",
     ("next_event_time", "apply_collision"), """\
`time_to_contact(gap, rate, a)` returns the time until the gap closes: the root of gap + rate·t − a·t²/2 at which the
gap decreases, or inf. It is 0 for a pair that touches and approaches. `low` = m_eff/m_lower and `high` =
m_eff/m_upper are the shares of the two bodies in a change of the rate."""),
    ("Soft spheres: the event loop", "granular.md.located.blocks", ("advance", "apply_next_event", "end_piece"), """\
Balls in contact form an island, which is advanced by polynomial pieces. The queue holds one entry per *block*: the
end of the current piece of an island, or the next event of a pair in free flight. It is a binary tree with its root,
the next event, at index 1. If times are equal, the lower pair comes first. `s` contains all records of the run.
`slot` is the place of a pair in the *pool*, or negative in free flight ([words in the
code](contact-life.md#words-in-the-code)).

A contact that no neighbour can disturb is solved as one event (`solve_as_one_event`). Otherwise its pair joins the
pool with its own number as `fired`, its next event (usually BEGIN) as `event`, and a piece of length 0. `end_piece`
then applies this event immediately.

| code | returned by | meaning |
|---|---|---|
| DONE | `reason_to_return` | the next event can be applied |
| DONE | `apply_next_event` | the contact is solved; the queue is up to date |
| BY_PIECES | `solve_as_one_event` | not solved: slow (4 `noise`), without a map, or possibly disturbed |
| EXTEND | `end_piece` | an event was applied: form the blocks again |
| EXTEND | `form_event_blocks` | include the block of pair `run.wanted`, and form the blocks again |
| MORE | `form_event_blocks` | the blocks are formed: plan their pieces |
| GOES_ON | `end_piece` | no event: the island only needs its next piece |
| MORE | `advance` | `chunk` events are done, or the log buffer is full: log and call again |
| CRAMPED | `advance` | the pool is full: enlarge it and call again (`run.waits` = 1: the event is incomplete) |
| STOPPED | `advance` | the stop condition is met, or the first disturbed contact begins (`disturbed="stop"`) |
| REACHED | `advance` | no event is due up to `limit` |
| QUIET, REST | `advance` | no event follows in a run without an end time; with REST all balls rest permanently |
| WORK_LIMIT | `advance` | the largest number of contacts or pieces is reached |
| WANTS_TABLE, WANTS_CONTACT | `advance` | the map of this contact has to be computed outside the loop |
| WANTS_REST_TEST | `advance` | the caller tests whether the island rests or creeps |"""),
    ("Soft spheres: one piece", "granular.md.located.plan", ("advance_island",), """\
A piece ends at τ = `tau`, at the latest at the first event of its island. `fired` is the pair of this event, or −1.
Each member has series in τ: `x` for the overlap ξ (`xi`) and `e` for its rate (`eta`). `advance_velocities` adds the
impulses of the contact forces, and the free fall, to the velocities of the balls. `exact` = 1 means that an event has
located φ = 0 (see below), so that the next series starts with exactly 0. A clock is the sum t + `tail`."""),
    ("Soft spheres: the first event of a pair", "granular.md.located.pieces", ("next_event",), """\
[Life of a contact](contact-life.md) has a diagram of the modes and events. The series `f` is the acting force, and `g`
is the bracket φ = k ξ^s + γ dξ/dt of the force F = ξ^d φ, which decides its sign.
`shifted_crossing(p, c, span, scratch, ±1)` returns the first root of p + c up to `span`
at which p increases (1) or decreases (−1). `wake` is the overlap above which a dormant pair becomes active."""),
    ("Soft spheres: the event at the end of a piece", "granular.md.located.contacts",
     ("apply_contact_event", "begin_force"), """\
`speed` is the typical speed of the island. `activate` makes the pair ACTIVE, counts the contact and records its onset
for the log. The onset of a dormant pair was recorded at its touch. If a contact was ACTIVE before it became dormant
(`going_on` = 1), only its mode changes. `cancel_rate` sets a rate to 0 by an impulse between the balls. `noise` is
here a bound of the rounding error of the rate itself, in m/s. `is_rate_noise` is true up to 4 times this bound."""),
    ("", "granular.md.located.modes", ("change_mode",), ""),
    ("Soft spheres in fixed steps: one Verlet step", "granular.md.fixed.integrators",
     ("verlet", "move_pair", "finish_verlet_step"), """\
These functions are the alternative to located events. A window of the chain is stored in arrays with one value per
pair or body. `raw` is the force before it is clipped at 0."""),
)
"""Heading, module, functions and introduction of each section."""
INTRODUCTION = """# The engines without special scenes

The functions below are the core of both engines. They are cut from the source, without the branches for driven and
thermal walls, external forces, pendula and rings, by `python bench/plain_engines.py`. Docstrings and arguments are not
cut, so they also mention these features. A test runs three scenes with these functions in place of the originals and
requires bitwise identical results. Symbols and signs are defined in the [notation](../guide/notation.md). An approach
is a negative rate of the gap for hard spheres, and a positive rate of the overlap for soft spheres.

`examples/from_scratch.py` shows the ideas of the event loop and of fixed steps for three bodies. It uses the package
only for its final check.
"""


def truth(node: ast.expr, false: frozenset[str]) -> bool | None:
    """Return the value of a condition in which the names in `false` are False.

    The result is None if the condition depends on other values.
    """
    if isinstance(node, ast.Compare):
        return KNOWN.get(ast.unparse(node))
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
    """Return a statement, or the header of a compound statement, after folding.

    The text is returned unchanged, with its layout and comments, if there is nothing to fold.
    """
    tree = ast.parse(text.strip() + ("\n    pass" if header else ""))
    if all(truth(node, false) is None for node in ast.walk(tree) if isinstance(node, ast.Name | ast.Compare)):
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
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call) and (
                ast.unparse(statement.value.func) in IDLE_CALLS):
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


def without_unread_names(text: str) -> str:
    """Return the source of a function without assignments that are never read.

    Calls are kept because they can have an effect.
    """
    nodes = list(ast.walk(ast.parse(text)))
    read = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    lines = text.splitlines()
    for node in sorted((node for node in nodes if isinstance(node, ast.Assign)), key=lambda node: -node.lineno):
        target, value = node.targets[0], node.value
        is_tuple = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
        names, values = (target.elts, value.elts) if is_tuple else ([target], [value])  # type: ignore[attr-defined]
        kept = [(name, value) for name, value in zip(names, values, strict=True)
                if not isinstance(name, ast.Name) or name.id in read or isinstance(value, ast.Call)]
        if len(kept) < len(names):
            sides = (", ".join(map(ast.unparse, side)) for side in zip(*kept, strict=True))
            lines[node.lineno - 1 : node.end_lineno] = [" " * node.col_offset + " = ".join(sides)] if kept else []
    return "\n".join(lines)


def plain_source(function: Callable[..., Any]) -> str:
    """Return the source of a kernel with all flags folded to False.

    Decorators and names that are no longer read are left out.
    """
    text = inspect.getsource(function)
    tree = ast.parse(text).body[0]
    assert isinstance(tree, ast.FunctionDef)
    lines, start = text.splitlines(), tree.body[0].lineno - 1
    result = lines[tree.lineno - 1 : start] + list(kept_lines(tree.body, lines, start, 0, constants(tree)))
    return without_unread_names(re.sub(r"  # type: ignore\S*", "", "\n".join(result)))


def page() -> str:
    """Return the page as Markdown."""
    parts = [INTRODUCTION]
    for heading, module, names, introduction in SECTIONS:
        sources = [plain_source(getattr(import_module(module), name)) for name in names]
        parts += [f"## {heading}\n"] if heading else []
        parts += [introduction + "\n"] if introduction else []
        where = f"# {module.replace('.', '/')}.py\n"
        parts.append(f"```{{code-block}} python\n{where}" + "\n\n".join(sources) + "\n```\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE_PATH.write_text(page(), encoding="utf-8")

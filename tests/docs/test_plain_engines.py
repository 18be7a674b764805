"""The page of the engines without special scenes: it is up to date, and its functions run scenes bit by bit."""

import ast
import importlib
import re
import sys

import pytest

import granular as gr
from bench import plain_engines
from granular._engine.kernels import kernel
from granular.md.fixed import integrators, window
from granular.md.located import blocks, plan

MAX_LINES = 400
"""Longest listing. The text between the blocks does not count."""
LAW = gr.LinearDashpot(1e6, 30.0)
SCENES = {
    "three balls": (gr.scenes.three_balls(), 1.0, 0.35),
    "cradle": (gr.scenes.newtons_cradle(5), 2.0, 0.01),
    "gas": (gr.scenes.gas(12, seed=3), 5.0, 0.03),
}
"""Scene, end time of the event-driven and located runs, and end time of the fixed-step run, in s."""


def runs():
    """Contacts and final states of three scenes under both engines and in fixed steps."""
    rule, done = gr.ConstantRestitution(0.9), {}
    for name, (scene, end, fixed_end) in SCENES.items():
        done[name, "hard"] = gr.edmd.simulate(scene, rule, engine="sorted", t_end=end)
        done[name, "soft"] = gr.md.simulate(scene, LAW, engine="plain", t_end=end)
        done[name, "fixed"] = gr.md.simulate(scene, LAW, method="verlet", engine="plain", dt=9e-6, t_end=fixed_end)
    assert all(len(run.contacts) > 0 for run in done.values())
    return {key: (run.contacts.tobytes(), run.gap.tobytes(), run.velocity.tobytes()) for key, run in done.items()}


def replaced(monkeypatch, original, function):
    """Put `function` in the place of `original` in modules, in classes and in the table of integrators."""
    for module in [module for name, module in sys.modules.items() if name.startswith("granular.")]:
        for key, value in list(vars(module).items()):
            if value is original:
                monkeypatch.setattr(module, key, function)
            for field, inner in list(vars(value).items()) if isinstance(value, type) else ():
                if isinstance(inner, staticmethod) and inner.__func__ is original:
                    monkeypatch.setattr(value, field, staticmethod(function))
    for name, method in integrators.INTEGRATORS.items():
        if method.step is original:
            monkeypatch.setitem(integrators.INTEGRATORS, name, method._replace(step=function))


@pytest.fixture
def plain(monkeypatch):
    """Put the functions of the page in the place of the originals; return the code of each."""
    codes = {}
    for _, module, names, _ in plain_engines.SECTIONS:
        home = importlib.import_module(module)
        for name in names:
            original, space = getattr(home, name), {}
            text = compile(plain_engines.plain_source(original), f"<page: {name}>", "exec", dont_inherit=True)
            exec(text, home.__dict__, space)
            codes[name] = space[name].__code__
            replaced(monkeypatch, original, kernel(space[name]))
    return codes


def test_the_page_is_up_to_date_and_short():
    page = plain_engines.PAGE_PATH.read_text(encoding="utf-8")
    assert page == plain_engines.page()
    listings = re.findall(r"```\{code-block\} python\n(.*?)```", page, re.DOTALL)
    assert len(listings) == len(plain_engines.SECTIONS)
    assert sum(len(listing.splitlines()) for listing in listings) <= MAX_LINES


def test_no_flag_is_left_and_comments_are_kept():
    for _, module, names, _ in plain_engines.SECTIONS:
        for name in names:
            source = plain_engines.plain_source(getattr(importlib.import_module(module), name))
            used = {node.id for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Name)}
            assert not used & plain_engines.FLAGS
    assert "# Last, so that the queue is consistent" in plain_engines.page()


def test_comparisons_and_calls_that_are_cut_do_not_matter_without_walls_and_rings():
    assert "EDGE" not in plain_engines.plain_source(plan.plan_piece)  # no other function sets this event
    assert "edge_result" not in plain_engines.plain_source(blocks.end_piece)
    for name in plain_engines.IDLE_CALLS:
        idle = ast.parse(plain_engines.plain_source(getattr(window, name))).body[0]
        assert [ast.get_docstring(idle)] == [statement.value.value for statement in idle.body]


def test_every_name_of_the_page_is_read_or_has_a_call():
    for _, module, names, _ in plain_engines.SECTIONS:
        for name in names:
            source = plain_engines.plain_source(getattr(importlib.import_module(module), name))
            assert plain_engines.without_unread_names(source) == source


@pytest.mark.parametrize(("text", "kept"), [
    ("a = 1\nb = 2\nreturn b", "b = 2\nreturn b"),
    ("a, b = c.d, 2\nreturn a", "a = c.d\nreturn a"),
    ("a, b = c(), 2\nreturn 3", "a = c()\nreturn 3"),
    ("a, b = c()\nreturn a", "a, b = c()\nreturn a"),
    ("a.b = 1\na[0] = 2", "a.b = 1\na[0] = 2"),
])
def test_names_that_are_never_read_are_cut(text, kept):
    lines = plain_engines.without_unread_names("def f(c):\n    " + text.replace("\n", "\n    ")).splitlines()
    assert lines == ["def f(c):", *("    " + line for line in kept.splitlines())]


def test_the_functions_of_the_page_give_the_bits_of_the_engines(request):
    whole = runs()
    codes = request.getfixturevalue("plain")
    seen = set()
    sys.setprofile(lambda frame, event, arg: seen.add(frame.f_code) if event == "call" else None)
    try:
        again = runs()
    finally:
        sys.setprofile(None)
    assert [name for name, code in codes.items() if code not in seen] == []
    assert [key for key in whole if whole[key] != again[key]] == []


@pytest.mark.parametrize(("text", "kept"), [
    ("if FORCED:\n    a = 1\nelse:\n    a = 2", "a = 2"),
    ("if not FORCED:\n    a = 1\nelse:\n    a = 2", "a = 1"),
    ("# why\nif RING and b:\n    a = 1\nc = 3", "c = 3"),
    ("if b:\n    a = 1\nelif HUNG:\n    a = 2\nelse:\n    a = 3", "if b:\n    a = 1\nelse:\n    a = 3"),
    ("if b:\n    a = 1\nelif HUNG:\n    a = 2", "if b:\n    a = 1"),
    ("if HUNG:\n    a = 1\nelif b:\n    a = 2\nelse:\n    a = 3", "if b:\n    a = 2\nelse:\n    a = 3"),
    ("c = b or (FORCED and d)", "c = b"),
    ("c = d if FORCED or HUNG else b", "c = b"),
    ("if edge_result == BLOCKS_CHANGED:\n    a = 1\nb = 2", "b = 2"),
    ("if b and block.event != EDGE:\n    a = 1", "if b:\n    a = 1"),
    ("connect_ring_ends(a)\nb = 1", "b = 1"),
    ("x = FORCED and d\nif x or b:\n    c = 1", "if b:\n    c = 1"),
])
def test_conditions_are_folded(text, kept):
    body = ast.parse("def f():\n" + "\n".join("    " + line for line in text.splitlines())).body[0]
    lines = ["def f():", *("    " + line for line in text.splitlines())]
    false = plain_engines.constants(body)
    found = "\n".join(plain_engines.kept_lines(body.body, lines, 1, 4, false))
    assert found == kept


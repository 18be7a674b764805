"""The rooms list their files, the reading page shows the lists, and extensions are made where the page says."""

from __future__ import annotations

import ast
import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import pytest

import granular as gr
from granular.app.cli import main, parser
from granular.cases import ready
from granular.edmd import physics, ties
from granular.md.fixed import integrators

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "development" / "reading.md").read_text(encoding="utf-8")
FILES = {str(file.relative_to(ROOT / "granular")): file for file in sorted((ROOT / "granular").rglob("*.py"))}
ROOMS = [file.parent for name, file in FILES.items() if file.name == "__init__.py"]


def load_shape():
    spec = spec_from_file_location("shape", ROOT / "bench" / "shape.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


shape = load_shape()


def test_the_page_shows_the_rooms_as_they_are():
    assert shape.reading_page(PAGE, ROOT) == PAGE, "python bench/shape.py --reading"
    assert len(shape.reading_path(ROOT)) > 10


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_a_room_lists_each_of_its_files_once_in_at_most_fifteen_lines(room):
    text = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8")))
    assert len(text.splitlines()) <= 15
    there = [file.stem for file in room.glob("*.py") if not file.stem.startswith("__")]
    there += [f"{file.parent.name}/" for file in room.glob("*/__init__.py")]
    main, others = shape.listed_files(room)
    assert sorted([*main, *others]) == sorted(there)


@pytest.mark.parametrize("name", FILES)
def test_no_file_says_by_itself_that_it_may_be_skipped(name):
    assert "May be skipped" not in (ast.get_docstring(ast.parse(FILES[name].read_text(encoding="utf-8"))) or "")


def test_files_that_the_page_names_are_there():
    named = set(re.findall(r"`((?:\w+/)*\w+\.py)`", PAGE))
    assert named <= FILES.keys() | {"tests/docs/test_public_names.py"}


def test_every_name_of_the_table_of_extensions_stands_in_its_file():
    rows = re.findall(r"^\| (.+?) \| (.+) \|$", PAGE.partition("## Where to add an extension")[2], re.MULTILINE)[2:]
    assert len(rows) >= 10
    found = 0
    for extension, text in rows:
        for sentence in re.split(r"(?<=[.:;,]) ", text):
            *names, file = re.findall(r"`([\w/.]+)`", sentence) or [""]
            if names and (ROOT / "granular" / file).is_file():
                source = (ROOT / "granular" / file).read_text(encoding="utf-8")
                missing = [name for name in names if "/" not in name and not re.search(rf"\b{name}\b", source)]
                assert not missing or missing == ["Piecewise"], (extension, missing, file)
                found += len(names)
        for file in re.findall(r"`([\w/]+(?:\.py|\.mjs|/))`", text):
            assert (ROOT / file.removesuffix("/") if file.startswith("granular/")
                    else ROOT / "granular" / file).exists() or (ROOT / file).exists(), file
    assert found >= 15


def test_an_integrator_is_a_row_of_a_table(monkeypatch):
    twin = integrators.INTEGRATORS["verlet"]._replace(name="mine")
    monkeypatch.setitem(integrators.INTEGRATORS, "mine", twin)
    options = {"law": gr.Hertz(1e5), "t_end": 0.6, "dt": 1e-4}
    mine, verlet = (gr.md.simulate(gr.scenes.bouncing_ball(), method=name, **options) for name in ("mine", "verlet"))
    assert (mine.velocity == verlet.velocity).all()


def test_a_tie_rule_is_a_name_and_an_order_or_its_equations(monkeypatch):
    monkeypatch.setitem(physics.TIE_ORDERS, "mine", physics.GROUP)
    monkeypatch.setitem(ties.TIE_RULES, "mine", ties.poisson)
    scene, rule = gr.scenes.newtons_cradle(3, gap=0.0), gr.ConstantRestitution(1.0)
    mine, poisson = (gr.edmd.simulate(scene, rule, ties=name, t_end=1.0) for name in ("mine", "poisson"))
    assert (mine.velocity == poisson.velocity).all()


def test_a_command_is_a_class_and_its_name(monkeypatch, capsys):
    class Mine(parser.Command):
        """Say how many bodies there are."""

        @staticmethod
        def run(given):
            print(parser.case_of(given).scene.n)

    monkeypatch.setitem(sys.modules, "granular.app.cli.mine", SimpleNamespace(Mine=Mine))
    monkeypatch.setitem(parser.COMMAND_CLASSES, "mine", "mine:Mine")
    assert main(["mine", "newtons-cradle", "--n", "7"]) == 0
    assert capsys.readouterr().out == "7\n"
    assert main(["--help"]) == 0
    assert "say how many bodies there are" in capsys.readouterr().out


def test_a_scene_is_a_function_and_a_line(monkeypatch, capsys):
    def piston(speed: float = 0.1) -> gr.Scene:
        """Ball between a floor and a ceiling that comes down.

        Parameters
        ----------
        speed : float
            Of the ceiling in m/s.
        """
        return gr.Scene([float("inf"), 1.0, float("inf")], [0.0, 0.01, 0.0], [0.1, 0.1], [0.0, 1.0, -speed])

    template = ready.Template(piston, None, lambda scene: 0.15)
    monkeypatch.setitem(ready.TEMPLATES, "piston", template)
    for engine in ("edmd", "md"):
        assert main(["run", "piston", "--speed", "0.2", "--restitution", "1", "--engine", engine]) == 0
        assert "-1.4" in capsys.readouterr().out

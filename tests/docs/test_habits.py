"""What a session shows: reports in a line, HTML without scripts; public names; laws that an editor checks."""

import html
import inspect
import pkgutil

import pytest

import granular as gr
from granular._engine import reports

SCENE = gr.scenes.three_balls()
LAW = gr.LinearDashpot(5e7, 100.0)


@pytest.fixture(scope="module")
def report():
    return gr.compare(SCENE, LAW, until=gr.until.contact(pair=0, nth=2))


def test_a_report_is_its_verdict_and_a_case_its_name(report):
    assert repr(report) == f"Comparison: {report.verdict}"
    assert repr(gr.Case(SCENE, LAW)) == "Case(Scene(2 balls, floor, g = 9.81 m/s²))"
    assert repr(gr.Case(SCENE, LAW, about="a drop")) == "Case(a drop)"


def test_html_shows_verdict_and_table_and_a_picture_where_it_can_be_drawn(report, monkeypatch):
    pytest.importorskip("matplotlib")
    assert 'src="data:image/png;base64,iVBOR' in report._repr_html_()
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    plain = report._repr_html_()
    assert html.escape(report.verdict) in plain
    assert html.escape(report.details()) in plain
    assert "<img" not in plain
    assert "<script" not in plain


def test_a_notebook_shows_a_figure_that_pyplot_does_not_know(report):
    pytest.importorskip("matplotlib")
    assert report.plot()._repr_png_().startswith(b"\x89PNG")


def test_html_of_scene_and_run_has_a_row_for_every_body(report):
    for shown in (SCENE._repr_html_(), report.soft._repr_html_()):
        assert shown.count("<tr>") == 1 + SCENE.n
        assert "<img" not in shown


def test_html_is_escaped():
    shown = reports.html("<b>", [["a&b"]], "</pre><script>")
    assert "&lt;b&gt;" in shown
    assert "a&amp;b" in shown
    assert "<script" not in shown


def test_measures_show_what_they_measure_and_nothing_else():
    assert dir(gr.measures) == sorted(gr.measures.__all__)
    assert all(getattr(gr.measures, name).__module__ == "granular.comparison.measures" for name in gr.measures.__all__)


def test_protocols_ask_for_arguments_by_position_only():
    for protocol, count in ((gr.laws.ForceLaw, 4), (gr.laws.LawWithMemory, 5)):
        parameters = inspect.signature(protocol.force).parameters.values()
        assert [p.kind for p in parameters] == [inspect.Parameter.POSITIONAL_ONLY] * count
    assert gr.laws.LawWithMemory.__annotations__ == {"memory": "bool"}


def test_no_module_beside_a_public_function_bears_its_name():
    """`granular.md.simulate` is a function: a module of that name would be hidden by it, or hide it."""
    functions = {name for name in gr.__all__ if inspect.isfunction(getattr(gr, name))}
    rooms = [gr, *(module for name in gr.__all__ if inspect.ismodule(module := getattr(gr, name)))]
    for room in rooms:
        public = {name for name in dir(room) if inspect.isfunction(getattr(room, name))} | functions
        modules = {found.name for found in pkgutil.iter_modules(getattr(room, "__path__", []))}
        assert not modules & public, room.__name__

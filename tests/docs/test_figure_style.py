"""Every figure follows the rules of a journal: units, panel letters, one font, legends beside the data."""

import json
import re
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from tests.docs.test_figures import docs_data

pytest.importorskip("matplotlib")
style = import_module("matplotlib.style")
ROOT = Path(__file__).parents[2]
PAPER = ("forces", "sequence", "counts", "gap", "radii", "validity", "material")
ENOUGH_POINTS = {"counts": 6, "validity": 6, "forces": 400}
"""Points from which these figures look like the printed ones."""
BENCH = {"driven": 3, "isolation": 7, "bounded": 3, "waves": 3, "oblique": 19}
PURE_NUMBERS = re.compile(
    r"contacts?( of the two balls|\nof pair)?|pair|ball|number of balls.*|change of the scene|fraction of draws below|"
    r"largest error of means|normal restitution, .*|estimate, \$B.*|rotation over \$v t_c/l\$|"
    r"heat flow, soft/hard|force/peak force|amplitude ratio of neighbouring balls|correct digits of velocities|"
    r"energy left, \$E/E_0\$|time, \$t/\\tau\$|total loss, N \(1 − ε\)|acceleration amplitude over g, Γ|"
    r"\$.*(varepsilon|R_1/R_2|\|v_\{10\}\|).*|\$\\log_\{10\}\$.*")
"""Labels of pure numbers. All other labels end with a unit in parentheses."""
FORBIDDEN = re.compile(r"\w\(\w+=|Scene\(|object at|EPYC|Python \d|(?<![\w^{−.])-\d")
"""Python representations, processors and versions, and hyphens used as minus signs."""


def law(scene):
    return [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]


def small_frontier():
    scene = gr.scenes.three_balls()
    return gr.frontier(scene, law(scene), until=gr.until.contact(0, 2), methods=["located", "edmd", "rk4"], repeats=1)


def chain_run():
    return gr.md.simulate(gr.scenes.chain(6), gr.Hertz(2e10), t_end=1e-3, samples=60)


REPORTS = {
    "comparison": lambda: gr.compare(scene := gr.scenes.three_balls(), law(scene), until=gr.until.contact(0, 2)).plot(),
    "gas": lambda: gr.compare(gr.scenes.gas(20), gr.LinearDashpot(1e6), t_end=5.0).plot(),
    "run": lambda: gr.edmd.simulate(
        gr.Scene([1.0] * 3, [0.1] * 3, [1e-3, 2e-3], [1.0, 0.0, -1.0]), gr.ConstantRestitution(0.8), t_end=10.0).plot(),
    "stability": lambda: gr.stability("three-balls", axes="gap", methods=("located", "verlet")).plot(),
    "frontier": lambda: small_frontier().plot(),
    "threshold": lambda: gr.threshold("three-balls", "gap", (1e-4, 1e-2), points=5, within=0.2).plot(),
    "ensemble": lambda: gr.ensemble("three-balls", 4, {"gap": (1e-3, 1e-4)}, "v_rel").plot(),
    "picture": lambda: gr.waves.picture(chain_run(), beyond=True),
}


def drawn(name, monkeypatch):
    """The figure of this name, computed at few points."""
    if name in REPORTS:
        return REPORTS[name]()
    monkeypatch.syspath_prepend(ROOT / "bench")
    with style.context("granular.journal"):
        if name == "edmd-scaling":
            stored = json.loads((docs_data.DATA_FOLDER / f"{name}.json").read_text(encoding="utf-8"))
            return import_module("edmd_scaling").draw(stored)
        if name in BENCH:
            module = import_module(name)
            return module.draw(module.compute(BENCH[name]))
        monkeypatch.setattr(sys, "path", [*sys.path, str(ROOT / "examples" / "paper")])
        module = import_module(name)
        return module.draw(module.compute((docs_data.PAPER_POINTS | ENOUGH_POINTS)[name]))


@pytest.mark.rotating
@pytest.mark.parametrize("name", [*REPORTS, *BENCH, "edmd-scaling", *PAPER])
def test_a_figure_follows_the_rules(name, monkeypatch):
    text_class = import_module("matplotlib.text").Text
    figure = drawn(name, monkeypatch)
    with style.context("granular.journal"):
        import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure).draw()
        panels = [axis for axis in figure.axes if axis.get_label() != "<colorbar>"]
        for axis in figure.axes:
            check_labels(axis)
            if name != "bounded":  # its short runs end before the curves leave the place of the legend
                check_legend(axis)
    shown = [text for text in figure.findobj(text_class) if text.get_visible() and text.get_text().strip()]
    assert {text.get_fontfamily()[0] for text in shown} == {"STIXGeneral"}
    assert not [text.get_text() for text in shown if FORBIDDEN.search(text.get_text())]
    if len(panels) > 1:
        found = sorted(text.get_text()[:3] for text in shown if re.match(r"\([a-z]\)", text.get_text()))
        assert found == [f"({letter})" for letter in "abcdefghij"[: len(panels)]]


def check_labels(axis):
    """Each axis has a quantity and a unit, unless its numbers are at a neighbouring panel."""
    bar = axis.get_label() == "<colorbar>"
    for label, ticks in ((axis.get_xlabel(), axis.xaxis), (axis.get_ylabel(), axis.yaxis)):
        numbered = any(tick.label1.get_visible() and tick.label1.get_text() for tick in ticks.get_major_ticks())
        if label or (numbered and not bar):
            assert PURE_NUMBERS.fullmatch(label) or re.search(r"\([^()]+(\([^()]*\))?[^()]*\)$", label), label
    assert not bar or axis.get_ylabel()


def check_legend(axis):
    """A legend has at most seven entries and covers no point of a curve."""
    legend = axis.get_legend()
    if legend is None:
        return
    assert len(legend.get_texts()) <= 7
    box = legend.get_window_extent()
    for line in axis.lines:
        points = line.get_transform().transform(np.column_stack(line.get_data(orig=False)).astype(float))
        inside = axis.bbox.x0 <= box.x1 and axis.bbox.y0 <= box.y1
        assert not (inside and len(points) > 2 and line.get_visible() and np.any(
            (points > [box.x0, box.y0]).all(axis=1) & (points < [box.x1, box.y1]).all(axis=1))), line.get_label()


@pytest.mark.parametrize(("label", "place"), [("gap, m", "lower right"), ("gap (m)", "upper left")])
def test_a_label_without_unit_and_a_legend_over_a_curve_are_found(label, place):
    figure = import_module("matplotlib.figure").Figure()
    axis = figure.subplots()
    axis.plot([0.0, 0.02, 0.05, 1.0], [1.0, 0.98, 0.95, 0.9], label="curve")
    axis.set(xlabel=label, ylabel="speed (m/s)", ylim=(0.0, 1.0))
    axis.legend(loc=place)
    import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure).draw()
    with pytest.raises(AssertionError):
        (check_labels if "," in label else check_legend)(axis)


@pytest.mark.parametrize("path", sorted([*ROOT.glob("docs/figures/*.png"), *ROOT.glob("docs/_static/*.png")]),
                         ids=lambda path: path.stem)
def test_a_picture_is_small(path):
    assert path.stat().st_size <= 250_000

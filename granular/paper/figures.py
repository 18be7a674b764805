"""The list of figures, and how one is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from granular import _check, _files
from granular.paper import breakdown, forces, maps, material, predictors, ratios, sequence, sketch, viscoelastic
from granular.paper.drawing import style
from granular.sweeps import store


@dataclass(frozen=True)
class PaperFigure:
    """One figure.

    Attributes
    ----------
    number : str
        Its number in the paper; empty for those the paper does not have.
    about : str
        One line for people.
    compute : callable
        Number of points along its longest axis → its data, a dict of numbers and lists or an `xarray.Dataset`.
    draw : callable
        Its data → a matplotlib figure.
    points : int
        The number of points for print.
    """

    number: str
    about: str
    compute: Callable[[int], Any]
    draw: Callable[[Any], Any]
    points: int


FIGURES = {
    "sketch": PaperFigure("1", "the problem and its notation", sketch.compute, sketch.draw, 1),
    "forces": PaperFigure("2", "forces of both contacts over time, ε = 0.7", forces.compute, forces.draw, 2000),
    "sequence": PaperFigure("3", "contact sequence over ε, numerical and adiabatic", sequence.compute, sequence.draw,
                            400),
    "counts": PaperFigure("4", "contacts over (ε, Δh) and (ε, R1/R2)", maps.counts, maps.draw_counts, 300),
    "gap": PaperFigure("5", "ε_eff/ε_spec and contacts over Δh, ε = 0.9", ratios.over_gap, ratios.draw_gap, 1500),
    "radii": PaperFigure("6", "ε_eff/ε_spec and contacts over R1/R2, ε = 0.8", ratios.over_radii, ratios.draw_radii,
                         1500),
    "viscoelastic": PaperFigure("7", "viscoelastic contact sequence over ε", viscoelastic.over_restitution,
                                viscoelastic.draw_restitution, 300),
    "viscoelastic-material": PaperFigure("8", "viscoelastic contact sequence over A, one material",
                                         viscoelastic.over_constant, viscoelastic.draw_constant, 300),
    "validity": PaperFigure("", "ε_eff/ε_spec as maps, with the limit of event-driven simulation", maps.validity,
                            maps.draw_validity, 200),
    "breakdown": PaperFigure("", "where stacks, cradles, columns and gases leave event-driven simulation",
                             breakdown.compute, breakdown.draw, 24),
    "predictors": PaperFigure("", "which measure predicts the error of event-driven simulation", predictors.compute,
                              predictors.draw, 24),
    "material": PaperFigure("", "same ε, same γ, same material: three choices side by side", material.compute,
                            material.draw, 200),
}
NUMBERS = {figure.number: name for name, figure in FIGURES.items() if figure.number}


def named(name: str) -> str:
    """Return the name of a figure given by name or number."""
    return NUMBERS.get(name) or _check.choice("figure", name, [*FIGURES, *NUMBERS])


def make(name: str, folder: str | PathLike[str] = ".", *, points: int | None = None) -> list[Path]:
    """Compute a figure, and write its data and its drawing.

    Parameters
    ----------
    name : str
        One of `FIGURES`, or its number in the paper.
    folder : path
        Where to write ``paper-NAME.png`` and ``paper-NAME.json`` (``.nc`` for maps).
    points : int, optional
        Points along the longest axis, in place of those for print.

    Returns
    -------
    list of Path
        The files: drawing and data.
    """
    name = named(name)
    figure = FIGURES[name]
    data = figure.compute(_check.whole("points", figure.points if points is None else points, at_least=1))
    with style():
        drawn = figure.draw(data)
        picture = Path(folder, f"paper-{name}.png")
        _files.write_figure(picture, drawn, dpi=300)
    numbers = picture.with_suffix(".json" if isinstance(data, dict) else ".nc")
    if isinstance(data, dict):
        _files.write_json(numbers, {"figure": figure.about, **data, **_files.provenance()}, indent=None)
    else:
        store.write(data, numbers)
    return [picture, numbers]

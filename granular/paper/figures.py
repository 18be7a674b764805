"""The list of figures, and how one is written.
May be skipped: figures of the paper, beside the engines.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from granular import _check, _files
from granular.drawing import style
from granular.paper import longer, maps, material, problem, sequence
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
    "sketch": PaperFigure("1", "the problem and its notation", problem.sketch, problem.draw_sketch, 1),
    "forces": PaperFigure("2", "forces of both contacts over time, ε = 0.7", problem.forces, problem.draw_forces, 2000),
    "sequence": PaperFigure("3", "contact sequence over ε, numerical and adiabatic", sequence.over_restitution,
                            sequence.draw_restitution, 400),
    "counts": PaperFigure("4", "contacts over (ε, Δh) and (ε, R1/R2)", maps.counts, maps.draw_counts, 300),
    "gap": PaperFigure("5", "ε_eff/ε_spec and contacts over Δh, ε = 0.9", maps.over_gap, maps.draw_gap, 1500),
    "radii": PaperFigure("6", "ε_eff/ε_spec and contacts over R1/R2, ε = 0.8", maps.over_radii, maps.draw_radii, 1500),
    "viscoelastic": PaperFigure("7", "viscoelastic contact sequence over ε", sequence.over_viscoelastic_restitution,
                                sequence.draw_viscoelastic_restitution, 300),
    "viscoelastic-material": PaperFigure("8", "viscoelastic contact sequence over A, one material",
                                         sequence.over_constant, sequence.draw_constant, 300),
    "validity": PaperFigure("", "ε_eff/ε_spec as maps, with the limit of event-driven simulation", maps.validity,
                            maps.draw_validity, 200),
    "breakdown": PaperFigure("", "where stacks, cradles, columns and gases leave event-driven simulation",
                             longer.breakdown, longer.draw_breakdown, 24),
    "predictors": PaperFigure("", "which measure predicts the error of event-driven simulation", longer.predictors,
                              longer.draw_predictors, 24),
    "material": PaperFigure("", "same ε, same γ, same material: three choices side by side", material.compute,
                            material.draw, 200),
}
NUMBERS = {figure.number: name for name, figure in FIGURES.items() if figure.number}


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
    name = NUMBERS.get(name) or _check.choice("figure", name, [*FIGURES, *NUMBERS])
    figure = FIGURES[name]
    data = figure.compute(_check.whole("points", figure.points if points is None else points, at_least=1))
    plain = isinstance(data, dict)
    picture, numbers = (Path(folder, f"paper-{name}{ending}") for ending in (".png", ".json" if plain else ".nc"))
    with style():
        _files.write_figure(picture, figure.draw(data), dpi=300)
    if plain:
        _files.write_json(numbers, {"figure": figure.about, **data, **_files.provenance()}, indent=None)
    else:
        store.write(data, numbers)
    return [picture, numbers]

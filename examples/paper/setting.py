"""Setting of the paper, and code shared by its figures

The paper leaves some parameters open. The choice here is R1 = 0.1 m, R2 = 0.01 m, k = 5e7 N/m, Δh = 1e-4 m, z1 = 0.6
m, g = 9.81 m/s² and ρ = 900 kg/m³. These values reproduce all observations of the paper. z1 is the centre of the
lower ball and stays constant as R1 varies. These are the defaults of `gr.scenes.three_balls`. Times count from the
first contact of the lower ball and the floor.
"""

import argparse
import json
import sys
from itertools import groupby, pairwise
from pathlib import Path

import matplotlib.style
import numpy as np
from matplotlib.figure import Figure

import granular as gr

SECOND_BOUNCE = gr.until.contact(pair=0, nth=2)
"""Contacts of the two balls count until the lower ball hits the floor again."""
YOUNG_MODULUS, POISSON_RATIO = 5e7, 0.45
"""Young's modulus in Pa and Poisson's ratio of viscoelastic balls."""
SOFT_COLOUR, HARD_COLOUR, FLOOR_COLOUR, GREY_COLOUR = "#1f4e79", "#c1440e", "#c8963e", "#8a8a8a"
COLUMN_WIDTH, PAGE_WIDTH = 3.4, 7.0
"""Widths of a column and of a page in inches."""


def dashpot_laws(scene, restitution):
    """Linear dashpots with one ε in all contacts."""
    return [gr.LinearDashpot.from_restitution(restitution, k=5e7, pair=pair) for pair in scene.pairs]


def hertz_laws(scene):
    """Elastic contacts of one material in all pairs."""
    return [gr.Hertz.from_material(YOUNG_MODULUS, POISSON_RATIO, pair) for pair in scene.pairs]


def contacts(scene, law):
    """Contacts of the two balls, and the end of the first floor contact, in s.

    The contacts are an array (count, 2) of onsets and ends.
    """
    run = gr.md.simulate(scene, law, until=SECOND_BOUNCE)
    floor, balls = run.of(0)[0], run.of(1)
    start = floor["t_begin"]
    return np.column_stack([balls["t_begin"] - start, balls["t_end"] - start]), float(floor["t_end"] - start)


def sequence_kind(row):
    """Number of contacts, and whether the last begins after the floor contact."""
    touches, floor_end = row
    return len(touches), bool(len(touches) and touches[-1, 0] > floor_end)


def stretches_of_one_kind(row, grid, reach=24):
    """Stretches of one kind: parameter, contacts (count, 2, S) and floor end.

    The boundary between two grid points of different kinds is bisected, and the points of the bisection are kept.
    """
    known = {x: row(x) for x in grid.tolist()}

    def bisect(low, high, depth):
        if depth and sequence_kind(known[low]) != sequence_kind(known[high]):
            middle = 0.5 * (low + high)
            known[middle] = row(middle)
            bisect(low, middle, depth - 1)
            bisect(middle, high, depth - 1)

    for low, high in pairwise(grid.tolist()):
        bisect(low, high, reach)
    groups = [list(xs) for _, xs in groupby(sorted(known), lambda x: sequence_kind(known[x]))]
    return [{"parameter": np.array(xs), "contacts": np.stack([known[x][0] for x in xs], axis=-1),
             "floor_end": np.array([known[x][1] for x in xs])} for xs in groups]


def prefixed_arrays(name, data):
    """Arrays of a sweep, with the name of its map as a prefix."""
    return {f"{name}_{key}": array.values for key, array in data.variables.items() if key not in ("pair", "body")}


def new_figure(width, height, rows=1, across=1, **options):
    """New figure of this size in inches, and its axes as an array (rows, columns)."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, across, squeeze=False, **options)


def add_letter(axis, text, x=0.02, **how):
    """Put a letter such as (a) into the upper left corner."""
    axis.text(x, 0.97, text, transform=axis.transAxes, va="top", ha="left", **how)


def main(compute, draw, points):
    """Compute a figure, and write its drawing and its numbers.

    `points` is the default number of points along the longest axis.
    """
    name = Path(sys.argv[0]).stem
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", "--output", default=f"{name}.png", help="file of the drawing [%(default)s]")
    parser.add_argument("--json", help="file of the numbers")
    parser.add_argument("--points", type=int, default=points,
                        help="points along the longest axis; finer details are not resolved [%(default)s]")
    given = parser.parse_args()
    data = compute(given.points)
    with matplotlib.style.context("granular.journal"):
        draw(data).savefig(given.output, dpi=240)
    if given.json:
        text = json.dumps(data | {"granular": gr.__version__}, default=lambda array: array.tolist())
        Path(given.json).write_text(text.replace("NaN", "null") + "\n", encoding="utf-8")


# sphinx_gallery_thumbnail_path = "figures/paper-sketch.png"

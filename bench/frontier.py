"""Figures and tables of frontier.md: error against run time in six scenes.

    python bench/frontier.py            all scenes, a few minutes
    python bench/frontier.py chain      one scene
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import docs_data  # must precede `bench`, because it extends sys.path

from bench.reference import solve
from granular import Hertz, LinearDashpot, Scene, ViscoelasticHertz, cases, scenes, until
from granular._engine.reports import duration, rough_text
from granular.studies.frontier_result import METHOD_STYLES, laws
from granular.studies.frontiers import Frontier, frontier as with_any_reference

DOCS_FOLDER = Path(__file__).parents[1] / "docs"
PAGE_PATH = DOCS_FOLDER / "guide" / "frontier.md"
ERROR_GOALS = (1e-3, 1e-6, 1e-9, 1e-12)
SECOND_BOUNCE = until.contact(pair=0, nth=2)
ALL_SEPARATED = until.separated()


def frontier(scene: Scene, law: Any, **end: Any) -> Frontier:
    """Compare all methods with a reference solution of 34 digits."""
    return with_any_reference(scene, law, **end, reference=solve(scene, law, **end))


def three_balls(restitution: float) -> Frontier:
    """Base scene of the paper with clipped dashpots."""
    scene = scenes.three_balls()
    law = [LinearDashpot.from_restitution(restitution, k=5e7, pair=pair) for pair in scene.pairs]
    return frontier(scene, law, until=SECOND_BOUNCE)


def viscoelastic() -> Frontier:
    """Base scene of the paper with viscoelastic spheres, ε = 0.7 at impact."""
    scene = scenes.three_balls()
    law = [ViscoelasticHertz.from_restitution(0.7, speed=3.13, k=1e9, pair=pair) for pair in scene.pairs]
    return frontier(scene, law, until=SECOND_BOUNCE)


def column() -> Frontier:
    """Column of ten balls that falls on a floor, ε = 0.9."""
    case = cases.make("column", n=10)
    return frontier(case.scene, case.law, until=case.until)


SCENE_REPORTS: dict[str, tuple[str, Callable[[], Frontier]]] = {
    "three-balls": ("Three balls, ε = 0.7", lambda: three_balls(0.7)),
    "three-balls-elastic": ("Three balls, ε = 1", lambda: three_balls(1.0)),
    "three-balls-viscoelastic": ("Three balls, viscoelastic, ε(v) = 0.7", viscoelastic),
    "cradle": ("Cradle of 5 touching Hertz balls",
               lambda: frontier(scenes.newtons_cradle(5), Hertz(2e10), until=ALL_SEPARATED)),
    "column": ("Column of 10 balls, ε = 0.9", column),
    "chain": ("Chain of 20 touching Hertz balls", lambda: frontier(scenes.chain(20), Hertz(2e10), until=ALL_SEPARATED)),
}


ALT_TEXT = "Errors against run time"
SUPERSCRIPT_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def section(name: str, title: str, report: Frontier) -> str:
    """Section of the page about one scene: figure, caption, table and orders."""
    truth = report.reference
    caption = (f"{len(truth.contacts)} contacts, `{laws(report)}`. Error of the reference: "
               f"{scientific_notation(truth.velocity_error)}. Rounding level: "
               f"{scientific_notation(report.rounding_level)}.")
    lines = [
        f"## {title}", "",
        ":::{figure-md}", f"![{ALT_TEXT}: {title}](../figures/frontier-{name}.png)", "", caption, ":::", "",
        "| error | located | fastest other | ratio |", "|---|---|---|---|",
    ]
    alone = tuple(method for method in report.methods if method != "located")
    for goal in ERROR_GOALS:
        mine, other = report.fastest(goal, without=alone), report.fastest(goal, without=("located",))
        ratio = rough_text(other.seconds / mine.seconds) if mine and other else "–"
        shown = [duration(mine.seconds) if mine else "–"]
        shown += [f"{method_label(other.method)}, {duration(other.seconds)}" if other else "no other method", ratio]
        lines.append(f"| {scientific_notation(goal)} | {' | '.join(shown)} |")
    orders = ", ".join(_order(report, method) for method in report.orders if math.isfinite(report.order(method)))
    least = min(row.velocity_error for row in report.of("located") if row.good)
    lines += ["", f"Measured order (expected): {orders}. Smallest located error: {scientific_notation(least)}."]
    return "\n".join([*lines, ""])


def _order(report: Frontier, method: str) -> str:
    """Measured order of a method, and the expected order in parentheses."""
    return f"{method_label(method)} {report.order(method):.2f} ({report.orders[method][1]:.2f})"


def method_label(method: str) -> str:
    """Name of a method as in the figure, without a comma."""
    return str(METHOD_STYLES[method]["label"]).replace(", ", " with ")


def scientific_notation(x: float) -> str:
    """Number with one digit, such as 6·10⁻¹⁷, or – if it is not finite."""
    if not math.isfinite(x):
        return "–"
    digit, _, exponent = f"{x:.0e}".partition("e")
    ten = f"10{str(int(exponent)).translate(SUPERSCRIPT_DIGITS)}"
    return f"{x:.1g}" if x >= 0.1 else ten if digit == "1" else f"{digit}·{ten}"


def main(names: list[str]) -> None:
    """Measure the scenes, draw the figures and write the tables into the page."""
    for name in names or list(SCENE_REPORTS):
        title, measure = SCENE_REPORTS[name]
        report = measure()
        print(f"{title}\n\n{report}\n", flush=True)
        (DOCS_FOLDER / "figures").mkdir(exist_ok=True)
        report.plot(DOCS_FOLDER / "figures" / f"frontier-{name}.png")
        if f"frontier-{name}" in docs_data.DATA_ENTRIES:
            docs_data.store(f"frontier-{name}", docs_data.frontier_rows(report))
        text = PAGE_PATH.read_text(encoding="utf-8")
        place = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        filled = section(name, title, report)
        PAGE_PATH.write_text(place.sub(lambda m, s=filled: m[1] + s + m[2], text), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

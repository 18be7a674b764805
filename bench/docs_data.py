"""Stored data of all figures and tables of the documentation.

    python bench/docs_data.py             recompute and store all data in docs/figures/data (some minutes)
    python bench/docs_data.py paper-gap   recompute and store one entry

The data are computed at few points. tests/docs/test_figures.py recomputes and compares them, so that an outdated figure
is noticed. If they differ, redraw the figure with bench/regenerate.py, which also stores the data, and inspect it. A
new figure needs a line in `PAPER_POINTS` or `DATA_ENTRIES`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

REPO_ROOT = Path(__file__).parents[1]
DATA_FOLDER, PAPER_FOLDER = REPO_ROOT / "docs" / "figures" / "data", REPO_ROOT / "examples" / "paper"
sys.path.append(str(REPO_ROOT))  # makes `bench.stability` importable


@dataclass(frozen=True)
class Entry:
    """Data of one figure or table.

    Attributes
    ----------
    compute : callable
        Returns the data at few points: numbers, strings, and lists and dicts of them.
    quick : bool
        Whether `compute` takes less than 3 s and runs in CI.
    relative, absolute : float
        Tolerances of numbers. The larger of the two applies.
    """

    compute: Callable[[], Any]
    quick: bool = True
    relative: float = 1e-6
    absolute: float = 1e-9


def paper(name: str, points: int) -> Any:
    """Data of a figure of the paper, with `points` points along its longest axis."""
    if str(PAPER_FOLDER) not in sys.path:
        sys.path.append(str(PAPER_FOLDER))
    return json_values(import_module(name.replace("-", "_")).compute(points))


def frontier(name: str) -> Any:
    """Settings, errors and contact-count flags of a scene in docs/guide/frontier.md.

    A flag is True if the run misses a contact. Run times are left out.
    """
    from frontier import SCENE_REPORTS

    return frontier_rows(SCENE_REPORTS[name][1]())


def isolation() -> Any:
    """Data of the figure in docs/guide/threshold.md at few gaps."""
    from isolation import compute

    return compute(7)


def driven() -> Any:
    """Data of the figure in docs/guide/driven.md at few points."""
    from driven import compute

    return compute(3)


def bounded() -> Any:
    """Data of the figure in docs/guide/bounded.md at few points."""
    from bounded import compute

    return compute(3)


def waves() -> Any:
    """Data of the figure in docs/guide/waves.md at few points."""
    from waves import compute

    return compute(3)


def oblique() -> Any:
    """Data of the figure in docs/theory/oblique.md at a few points.

    The ensembles of its last panel are stored in bench/threed/results.json.
    """
    from oblique import compute

    return compute(4)


def frontier_rows(report: Any) -> Any:
    """Like `frontier`, for a `Frontier` that is already measured.

    The solvers of scipy are left out. They choose their steps, so rounding changes their errors: by up to a factor of
    60 on another processor.
    """
    return {
        method: [[json_values(row.setting), json_values(row.velocity_error), bool(row.wrong_count)]
                 for row in report.of(method)]
        for method in report.methods if method.partition("+")[0] not in SOLVERS_OF_SCIPY
    }


def stability() -> Any:
    """Verdicts of the default methods on some cells per axis of stability.md."""
    from bench.stability import stability

    return verdicts(stability(methods=("located", "edmd"), quick=True))


def extremes() -> Any:
    """Table of three balls in docs/guide/stability.md."""
    import granular as gr

    return gr.stability("three-balls").table()


def verdicts(report: Any) -> Any:
    """Verdicts of the default methods in a finished study."""
    return [[cell.axis, cell.case, cell.method, cell.truth, cell.verdict.name]
            for cell in report.cells if cell.method in ("located", "edmd")]


def json_values(value: Any) -> Any:
    """Convert arrays and tuples to lists, and non-finite numbers to None, for JSON."""
    if isinstance(value, dict):
        return {str(key): json_values(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [json_values(entry) for entry in value]
    return None if isinstance(value, float) and not abs(value) < float("inf") else value


PAPER_POINTS = {"sketch": 1, "forces": 20, "sequence": 3, "counts": 4, "gap": 12, "radii": 12, "validity": 5,
                "material": 4, "viscoelastic": 5, "viscoelastic-material": 5, "breakdown": 2, "predictors": 2}
SLOW_FIGURES = {"viscoelastic", "viscoelastic-material", "breakdown", "predictors"}
FRONTIER_SCENES = ("three-balls", "three-balls-elastic", "three-balls-viscoelastic", "cradle", "column", "chain")
DATA_ENTRIES = {f"paper-{name}": Entry(partial(paper, name, points), name not in SLOW_FIGURES)
                for name, points in PAPER_POINTS.items()}
DATA_ENTRIES |= {f"frontier-{name}": Entry(partial(frontier, name), False, 0.1, 1e-12) for name in FRONTIER_SCENES}
DATA_ENTRIES |= {"stability": Entry(stability, False), "stability-three-balls": Entry(extremes, False),
                 "isolation": Entry(isolation), "bounded": Entry(bounded), "driven": Entry(driven, absolute=1e-3),
                 "waves": Entry(waves, absolute=1e-6), "oblique": Entry(oblique)}
SOLVERS_OF_SCIPY = ("dop853", "lsoda", "radau")
TIMES_ONLY = {"edmd-scaling"}
"""Figures of run times. Their stored data depend on the machine."""


def store(name: str, data: Any = None) -> None:
    """Write the data of one figure or table, computed here if `data` is None."""
    text = json.dumps(DATA_ENTRIES[name].compute() if data is None else data, ensure_ascii=False, allow_nan=False)
    DATA_FOLDER.mkdir(exist_ok=True)
    (DATA_FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8")


def differences(stored: Any, fresh: Any, entry: Entry, where: str = "") -> list[str]:
    """Descriptions of all places where two sets of data differ."""
    if isinstance(stored, dict) and isinstance(fresh, dict) and stored.keys() == fresh.keys():
        return [d for key in stored for d in differences(stored[key], fresh[key], entry, f"{where}.{key}")]
    if isinstance(stored, list) and isinstance(fresh, list) and len(stored) == len(fresh):
        pairs = enumerate(zip(stored, fresh, strict=True))
        return [d for i, (a, b) in pairs for d in differences(a, b, entry, f"{where}[{i}]")]
    both_numbers = all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (stored, fresh))
    if both_numbers and abs(stored - fresh) <= max(entry.absolute, entry.relative * abs(stored)):
        return []
    return [] if not both_numbers and stored == fresh else [f"{where}: {str(stored)[:80]} is now {str(fresh)[:80]}"]


if __name__ == "__main__":
    for each in sys.argv[1:] or DATA_ENTRIES:
        print(each, flush=True)
        store(each)

"""`StabilityReport`: the results as text, as JSON and in Markdown."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

from bench.stability.cell import DEFAULT_METHODS, Result, Verdict
from bench.stability.long import Drift, StabilityLimit
from granular._engine.reports import Report, Rows, aligned, number

BAD_VERDICTS = (Verdict.wrong, Verdict.crashed, Verdict.limit)
PRINTED_CELLS = 20
"""Maximum number of bad cells in the printed report."""


def markdown(rows: Rows) -> str:
    """Table in Markdown."""
    head, *others = ("| " + " | ".join(row) + " |" for row in rows)
    return "\n".join([head, "|" + "---|" * len(rows[0]), *others])


@dataclass(frozen=True)
class StabilityReport(Report):
    """Results of `stability`.

    Attributes
    ----------
    cells : tuple of Result
        Every cell with its verdict, error and tolerance.
    limits : tuple of StabilityLimit
        Largest stable time steps, measured and by theory.
    drifts : tuple of Drift
        Energy and reversibility over the number of contacts.
    quick : bool
        Whether only a part of the cells was run.
    """

    cells: tuple[Result, ...]
    limits: tuple[StabilityLimit, ...]
    drifts: tuple[Drift, ...]
    quick: bool = False

    def count(self, method: str | None = None, axis: str | None = None) -> Counter[Verdict]:
        """Number of cells of each verdict, for one method and one axis if given."""
        return Counter(
            cell.verdict for cell in self.cells if method in (None, cell.method) and axis in (None, cell.axis)
        )

    def of(self, *verdicts: Verdict, method: str | None = None) -> list[Result]:
        """Cells with one of the `verdicts`, for one method if given."""
        return [cell for cell in self.cells if cell.verdict in verdicts and method in (None, cell.method)]

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods in the report."""
        return tuple(dict.fromkeys(cell.method for cell in self.cells))

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes in the report."""
        return tuple(dict.fromkeys(cell.axis for cell in self.cells))

    def tables(self) -> dict[str, list[list[str]]]:
        """All tables as rows of strings, with the heads in the first row."""
        each = {method: self.count(method) for method in self.methods}
        wrong = {axis: [self.count(method, axis) for method in self.methods] for axis in self.axes}
        found = {
            "cells": [["method", "cells", "right", "flagged", "silently wrong", "crashed", "limit"]] + [
                [method, str(counts.total()), *(str(counts[verdict]) for verdict in Verdict)]
                for method, counts in each.items()
            ],
            "silently wrong / all cells": [["axis", *self.methods]] + [
                [axis, *(" / ".join(str(n) for n in (counts[Verdict.wrong], counts.total()) if n) for counts in row)]
                for axis, row in wrong.items()
            ],
            "stability limit, dt √(k/m)": [["method", "balls", "measured", "theory", "reported from"]] + [
                [row.method, str(row.balls), *(number(x, ".3f") for x in (row.measured, row.theory, row.reported))]
                for row in self.limits
            ],
            "largest drift": [["method", "law", "contacts, up to", "energy", "reversal"]] + [
                [*of, f"{max(row.contacts for row in rows)}", f"{max(row.energy for row in rows):.1e}",
                 f"{max(row.reversal for row in rows):.1e}"]
                for of, rows in self._drifts_by_law().items()
            ],
        }
        return {title: rows for title, rows in found.items() if len(rows) > 1}

    def _drifts_by_law(self) -> dict[tuple[str, str], list[Drift]]:
        found: dict[tuple[str, str], list[Drift]] = {}
        for row in self.drifts:
            found.setdefault((row.method, row.law), []).append(row)
        return found

    def markdown(self) -> str:
        """Tables in Markdown."""
        return "\n\n".join(f"**{title}**\n\n{markdown(rows)}" for title, rows in self.tables().items()) + "\n"

    def _numbers(self) -> dict[str, Any]:
        cells = [asdict(cell) | {"verdict": cell.verdict.name} for cell in self.cells]
        return {"quick": self.quick, "cells": cells, "limits": [asdict(row) for row in self.limits],
                "drifts": [asdict(row) for row in self.drifts]}

    def __str__(self) -> str:
        parts = [f"{title}\n{aligned(rows, indent='  ')}" for title, rows in self.tables().items()]
        bad = self.of(*BAD_VERDICTS)
        own = [cell for cell in bad if cell.method in DEFAULT_METHODS] or bad
        if own:
            lines = [f"  {c.verdict.name:8} {c.method:17} {c.axis}: {c.case} [{c.truth}] error {c.error:.2g} > "
                     f"{c.tolerance:.2g}; {c.said}"[:240] for c in own[:PRINTED_CELLS]]
            hidden = len(own) - PRINTED_CELLS
            more = [f"  … and {hidden} more (see cells, or the JSON file)"] * (hidden > 0)
            parts.append("\n".join(["neither right nor flagged", *lines, *more]))
        return "\n\n".join(parts)

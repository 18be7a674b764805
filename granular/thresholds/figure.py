"""The figure of a threshold: what decides, over the values; where hard spheres hold is shaded.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
from os import PathLike
from textwrap import fill
from typing import TYPE_CHECKING, Any

from granular import _files
from granular.drawing import GREY, HARD, SOFT, canvas
from granular.thresholds.criteria import CRITERIA, FAILS, HOLDS, UNDECIDED

if TYPE_CHECKING:
    from granular.thresholds.result import Threshold

MARKERS: dict[str, dict[str, Any]] = {
    HOLDS: {"color": SOFT, "marker": "o", "mfc": SOFT}, FAILS: {"color": HARD, "marker": "x"},
    UNDECIDED: {"color": GREY, "marker": "s", "mfc": "none"},
}  # fmt: skip


def plot(report: Threshold, path: str | PathLike[str] | None = None) -> Any:
    """Draw error, or time of the first disturbance, over the values; return the figure, or save it to `path`."""
    figure, ((axis,),) = canvas(5.2, 3.2)
    for low, high in report.holds:
        axis.axvspan(low, high, color=SOFT, alpha=0.12, lw=0)
    for crossing in report.crossings:
        axis.axvline(crossing.value, color="black", lw=0.7, ls=":")
    for verdict, look in MARKERS.items():
        shown = [one for one in report.values if one.verdict == verdict]
        known = [one for one in shown if math.isfinite(one.measure)]
        axis.plot([one.value for one in known], [one.measure for one in known], ls="none", ms=4, mew=0.9, **look)
        others = [one.value for one in shown if not math.isfinite(one.measure)]
        axis.plot(others, [0.97] * len(others), ls="none", ms=4, transform=axis.get_xaxis_transform(), **look)
        if shown:
            good, bad = CRITERIA[report.criterion].words
            axis.plot([], [], ls="none", ms=4, label={HOLDS: good, FAILS: bad}.get(verdict, verdict), **look)
    _axes(axis, report)
    figure.suptitle(fill(report.sentence, 80), fontsize=8.5, x=0.02, ha="left")
    return _files.write_figure(path, figure, dpi=150)


def _axes(axis: Any, report: Threshold) -> None:
    if report.criterion == "error":
        axis.axhline(report.limit, color="black", lw=0.6, ls="--")
        axis.set(yscale="log", ylabel="error, of the fastest impact")
    else:
        axis.set_ylabel("first disturbed at t, s")
    axis.set(xscale=report.spacing, xlim=report.between,
             xlabel=report.over + (f", {report.units}" if report.units != "1" else ""))  # fmt: skip
    axis.margins(y=0.15)
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)

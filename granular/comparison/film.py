"""Films of a comparison for slides: both engines side by side; fall, contacts slowed down, flight.
May be skipped: pictures, no physics.

The same story as that of the teaching page, granular/page/live/film.mjs. A film has two pages:
`flying`, as fast as life against a ruler, and `touching`, where balls are drawn by the square root of their radii,
paths and overlaps by a common factor so large that they can be seen.
"""

from __future__ import annotations

from itertools import count
from os import PathLike

import numpy as np

from granular._check import Array
from granular._figures import COLOURS, NAMED
from granular._films import Page, blank, check, paces, radii, save, stage
from granular._reports import GREY
from granular.comparison.answer import Judged
from granular.comparison.captions import parameters
from granular.comparison.figure import FEW, both, draw_runs, force_curve, timeline
from granular.comparison.view import View, closeup, draw_closeup, window, with_rows
from granular.trajectory import EARLY, points

FREEZE, HOLD = 0.9, 1.2  # how long in s the film stops at the floor, and at its end
SHORTEST, LONGEST = 0.2, 6.0  # the flight is shown for so many s at least, fall and flight at most
HIGHEST = 12.0  # drops: the ruler is no longer, and what flies higher leaves the picture
SLOW = 10.0  # contacts that are slowed down less are no act of their own
SAID = {
    "fall": "falling, as fast as life", "stop": "stop: the floor is reached",
    "flight": "flying, as fast as life", "end": "the highest point",
}
PANELS = {"contacts": 1.0, "forces": 1.0, "paths": 1.5, "distance": 1.5}  # beside the balls, with their heights


def animate(
    report: Judged, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25, *, whole: bool = True
) -> None:
    """See `Comparison.animate`."""
    check(path, report.scene, seconds, fps)
    view = window(report)
    save(path, film(view, acts(view, seconds, fps, whole), fps), fps)


def acts(view: View, seconds: float, fps: int, whole: bool) -> dict[str, Array]:
    """Return the time in s of every picture, act by act: the contacts for so many s, or the `whole` story.

    Without a fall, and where contacts and flights take turns, there is one act only.
    """
    contacts = np.linspace(view.begin, view.end, max(2, round(seconds * fps)))
    scene, runs = view.report.scene, (view.report.hard, view.report.soft)
    falls = scene.gravity > 0.0 and scene.is_wall[0] and not scene.fed and all(run.status not in EARLY for run in runs)
    if not (whole and falls and seconds >= SLOW * (view.end - view.begin)):
        return {"slow": contacts}
    begin, end = max(float(runs[1].time[0]), view.begin - LONGEST), _apex(view)
    return {
        "fall": np.arange(begin, view.begin, 1.0 / fps), "stop": np.full(round(FREEZE * fps), view.begin),
        "slow": contacts, "flight": np.append(np.arange(view.end + 1.0 / fps, end, 1.0 / fps), end),
        "end": np.full(round(HOLD * fps), end),
    }


def _apex(view: View) -> float:
    """When the last of the top balls is highest, in s, if it stays in the picture, that is not too long, and both runs
    get there: hard spheres may collapse meanwhile."""
    leaving = max(float(with_rows(view.report, name, np.array([view.end]), True).velocity[-1][-1]) for name in COLOURS)
    leaving = min(leaving, HIGHEST**0.5 * view.report.impact_speed)
    end = np.array([view.end + min(LONGEST, max(SHORTEST, 1.04 * leaving / view.report.scene.gravity))])
    return max(view.end, min(float(with_rows(view.report, name, end, True).time[-1]) for name in COLOURS))


def film(view: View, shown: dict[str, Array], fps: int) -> list[tuple[Page, int]]:
    """Return which picture of which page is shown, from the first to the last."""
    contacts, others = touching(view, shown["slow"], fps), {name: shown[name] for name in shown if name != "slow"}
    flights, flown = flying(view.report, others) if others else contacts, count()
    return [(contacts, k) if name == "slow" else (flights, next(flown))
            for name, times in shown.items() for k in range(len(times))]


def flying(report: Judged, shown: dict[str, Array]) -> Page:
    """Return the page on which balls fall and fly: against a ruler, side by side, and their heights over time."""
    from matplotlib import markers, transforms

    scene, time = report.scene, np.concatenate(list(shown.values()))
    runs = both(report, np.union1d(np.linspace(time[0], time[-1], 1200), time), further=True)
    page = blank(report.verdict, parameters(report), [["hard", "soft", "heights"]], width_ratios=[1.0, 1.0, 2.2])
    graph, balls = page.axes["heights"], np.flatnonzero(~scene.is_wall)
    size = 18.0 * min(1.0, 6.0 / len(balls)) * radii(scene)  # in points
    standing = markers.MarkerStyle("o", transform=transforms.Affine2D().translate(0.0, 0.5))
    for name, run in runs.items():
        axis, colour, heights = page.axes[name], COLOURS[name], np.asarray(points(run))
        axis.set(xlim=(-0.5, len(balls) - 0.5), xticks=[])
        for place, body in enumerate(balls.tolist()):
            how = {"marker": standing, "ms": size[body], "mfc": f"{colour}30", "mec": colour, "mew": 1.4}
            height = np.interp(time, run.time, heights[:, body])
            page.moving.append((axis.plot([place], [0.0], **how)[0], np.stack([0.0 * height, height], 1)))
        graph.plot(run.time, heights, color=colour, ls="--" if name == "hard" else "-", lw=1.1,
                   label=[f"{name} spheres"] + ["_"] * (scene.n - 1))
    drop = report.impact_speed**2 / (2.0 * scene.gravity)
    top = 1.06 * min(HIGHEST * drop, float(graph.dataLim.ymax))
    for axis in page.axes.values():
        axis.set_ylim(0.0, top)
        axis.axhline(drop, color=GREY, lw=0.8, ls=":", label="dropped from here")
    graph.set(xlim=(time[0], time[-1] + 0.01 * (time[-1] - time[0])), xlabel="time, s")
    graph.legend(fontsize=8, frameon=False, loc="upper left")
    page.axes["hard"].set_ylabel("height, radii taken out, m")
    page.tell([graph], time, [SAID[act] for act, times in shown.items() for _ in times])
    return page


def touching(view: View, time: Array, fps: int) -> Page:
    """Return the page of the contacts: the balls, and beside (below) them contacts, forces, paths and the lens."""
    report, look = view.report, closeup(view)
    if look is not None and (look.view is not view or len(look.touches) < 2):
        look = None  # a short moment of a long film, or nothing hops
    runs = both(report, np.unique(np.concatenate([time, view.moments, look.moments if look else []])))
    upright, names = report.scene.gravity > 0.0, list(PANELS)[: 4 if look else 3]
    high = [PANELS[name] for name in names]
    words = report.verdict, parameters(report)
    page = (blank(*words, [["hard", "soft", name] for name in names], width_ratios=[1, 1, 3.2], height_ratios=high)
            if upright else blank(*words, [[name] for name in (*COLOURS, *names)], height_ratios=[1.25, 1.25, *high]))
    stage(page, report.scene, {
        name: np.asarray(points(run))[np.searchsorted(run.time, time, side="right") - 1] for name, run in runs.items()})
    panels = [page.axes[name] for name in names]
    timeline(panels[0], view, NAMED if upright else FEW)
    for force in np.transpose(np.asarray(runs["soft"].force)):
        force_curve(panels[1], view.clock(runs["soft"].time), force / (force.max() or 1.0))
    panels[1].set(ylim=(0.0, 1.05), ylabel="force /\nits peak")
    draw_runs(panels[2], view, runs)
    if look is not None:
        draw_closeup(panels[3], look, runs)
    for axis in panels:
        axis.set(xlim=view.limits, xlabel=view.named if axis is panels[-1] else "")
        axis.tick_params(labelbottom=axis is panels[-1])
    page.tell(panels, view.clock(time), paces(view, time, fps))
    page.figure.align_ylabels(panels)
    return page

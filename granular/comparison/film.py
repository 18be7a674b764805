"""Films of a comparison: both engines side by side.

A film has two pages. The page `flight_page` shows fall and flight in real time next to a ruler, the page `contact_page`
shows the contacts in slow motion. Stages have the same places on both, and balls stand on each other. Between the
pages the balls grow or shrink as by one camera, see `Zoom`, while time stands still. On the page
`contact_page` the sizes of balls are square roots of their radii, and balls are flattened in contact. Paths and
overlaps are enlarged by a common factor that makes them visible. Every flying ball stops at its own apex, which is
marked with its height. The height of the top ball is `Comparison.rises`. The teaching page shows the same sequence, see
granular/app/page/physics/film.mjs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import Array
from granular._engine.reports import GREY_COLOUR
from granular.comparison.figure import MAX_FORCE_CURVES, draw_contacts, draw_runs, force_curve, repeat_both_runs
from granular.comparison.further import Continuation, apexes
from granular.comparison.view import Closeup, View, closeup, draw_closeup, number, parameters, window
from granular.comparison.zoom import ZOOM_SECONDS, Zoom
from granular.run.figures import INK_COLOUR, LINE_COLOURS, MAX_LABELS
from granular.run.films import FONT_FAMILY, Page, blank_page, check, drawn_radii, film_speed, prepare_page, write_film
from granular.run.trajectory import EARLY_STATUSES, Trajectory, points
from granular.scene import Scene

if TYPE_CHECKING:
    from granular.comparison.answer import ComparisonWithAnswer

STOP_SECONDS, END_SECONDS = 0.6, 1.2  # duration in s of the stop at the floor before the zoom, and of the end
# shortest flight, and longest shown part of flight and fall, in s
MIN_FLIGHT_TIME, MAX_SHOWN_SECONDS = 0.2, 6.0
MIN_SLOWDOWN = 10.0  # contacts that are slowed down less have no separate act
ACT_CAPTIONS = {"fall": "falling, in real time", "stop": "time stands still: the floor is reached",
        "flight": "flying, {}", "end": "the highest point of each ball"}
PANEL_WIDTH, CHART_WIDTH = 3.2, 4.0  # width of the panels relative to a stage: stages keep their places on both pages
BALL_POINTS, STACK_POINTS, STAGE_POINTS = 18.0, 24.0, 290.0
"""Largest height of a ball, of the balls below the top one, of a stage, in points."""
PANEL_HEIGHTS = {"contacts": 1.0, "forces": 1.0, "paths": 1.5, "distance": 1.5}  # relative heights of the panels


def animate(
    report: ComparisonWithAnswer, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25, *, whole: bool = True,
    charts: bool = True,
) -> None:
    """Write the film of a comparison, see `Comparison.animate`."""
    check(path, report.scene, seconds, fps)
    write_film(path, Story(window(report), seconds, fps, whole, charts).pictures(), fps)


@dataclass(frozen=True)
class Story:
    """Content of a film: fall, contacts and flight.

    Parameters
    ----------
    view : View
        The comparison, and the interval of its contacts.
    seconds : float
        Duration in s of the part that shows the contacts.
    fps : int
        Frames per second.
    whole : bool
        Whether to show fall and flight as well.
    charts : bool
        Whether to draw charts next to the balls.
    """

    view: View
    seconds: float
    fps: int
    whole: bool = True
    charts: bool = True

    @cached_property
    def tops(self) -> dict[str, Array]:
        """Time in s and height in m of each body's apex, (n, 2), for each engine."""
        return {name: apexes(self.view.report, name, range(self.view.report.scene.n)) for name in LINE_COLOURS}

    @cached_property
    def acts(self) -> dict[str, Array]:
        """Times in s of the frames of the acts "fall", "stop", "slow", "flight" and "end".

        Only the act "slow" is shown if contacts cannot be separated from flights: without gravity or without a floor,
        if walls exchange energy with the balls, if a run ended early, or if contacts would hardly be slowed down.
        """
        view, fps = self.view, self.fps
        contacts = np.linspace(view.begin, view.end, max(2, round(self.seconds * fps)))
        scene, runs = view.report.scene, (view.report.hard, view.report.soft)
        falls = (
            scene.gravity > 0.0
            and scene.is_wall[0]
            and not scene.fed
            and all(r.status not in EARLY_STATUSES for r in runs)
        )
        if not (self.whole and falls and self.seconds >= MIN_SLOWDOWN * (view.end - view.begin)):
            return {"slow": contacts}
        end = max(view.end + MIN_FLIGHT_TIME, *(float(np.nan_to_num(top[:, 0]).max()) for top in self.tops.values()))
        return {
            "fall": np.arange(max(float(runs[1].time[0]), view.begin - MAX_SHOWN_SECONDS), view.begin, 1.0 / fps),
            "stop": np.full(round(STOP_SECONDS * fps), view.begin), "slow": contacts,
            "flight": np.linspace(view.end, end, 1 + round(fps * min(MAX_SHOWN_SECONDS, end - view.end)))[1:],
            "end": np.full(round(END_SECONDS * fps), end),
        }

    def heights(self, name: str, times: Array) -> Array:
        """Height in m of each body at `times`, radii subtracted, (len(times), n).

        It is constant after the apex. `name` is the engine, "hard" or "soft".
        """
        when, top = self.tops[name].T
        return np.where(times[:, None] >= when, top, Continuation(self.view.report, name).heights(times))

    def pictures(self) -> list[tuple[Page | Zoom, int]]:
        """Page or zoom of every frame, and number of the frame in it, in order."""
        contacts, slow = contact_page(self), [*range(len(self.acts["slow"]))]
        if len(self.acts) == 1:
            return [(contacts, k) for k in slow]
        flights, before = flight_page(self), len(self.acts["fall"]) + len(self.acts["stop"])
        after, zoomed = sum(map(len, self.acts.values())) - before - len(slow), range(round(ZOOM_SECONDS * self.fps))
        inward = Zoom((flights, before - 1), (contacts, 0), len(zoomed), True)
        outward = Zoom((flights, before), (contacts, slow[-1]), len(zoomed), False)
        return [*((flights, k) for k in range(before)), *((inward, k) for k in zoomed),
                *((contacts, k) for k in slow), *((outward, k) for k in zoomed),
                *((flights, before + k) for k in range(after))]

    def page(self, panels: dict[str, float], width: float) -> Page:
        """Return an empty page: one stage of balls per engine, and panels for charts.

        Parameters
        ----------
        panels : dict
            Name and relative height of each panel. Ignored without charts.
        width : float
            Width of the panels relative to one stage. It is only used in scenes with gravity, where the panels are next
            to the stages. In other scenes the panels are below the stages.
        """
        report = self.view.report
        titles = (report.verdict, parameters(report)) if self.charts else ("", "")
        return blank_page(*titles, report.scene, LINE_COLOURS, panels if self.charts else {}, width, tall=1.25)


def flight_page(story: Story) -> Page:
    """Return the page of fall and flight: balls with a ruler, heights over time."""
    report, shown = story.view.report, {name: times for name, times in story.acts.items() if name != "slow"}
    time = np.concatenate(list(shown.values()))
    drawn = np.union1d(np.linspace(time[0], time[-1], 1200), time)
    heights = {name: story.heights(name, drawn) for name in LINE_COLOURS}
    page = story.page({"heights": 1.0}, CHART_WIDTH)
    top = 1.15 * max(float(np.nanmax(path)) for path in heights.values())
    for name in page.axes.keys() - {"time"}:
        page.axes[name].set_ylim(-top * (float(stack_points(report.scene)[1][-1]) + 4.0) / STAGE_POINTS, top)
        page.axes[name].axhline(
            report.impact_speed**2 / (2.0 * report.scene.gravity), color=GREY_COLOUR, lw=0.8, ls=":"
        )
    for name, path in heights.items():
        draw_balls(page, story, name, time, np.nan_to_num(path[np.searchsorted(drawn, time)], nan=-top))
        if story.charts:
            in_flight = np.where(drawn[:, None] > story.tops[name][:, 0], np.nan, path)
            page.axes["heights"].plot(drawn, in_flight, color=LINE_COLOURS[name],
                                      ls={"hard": "--"}.get(name, "-"), lw=1.1)
    page.panels[0].set(xlim=(time[0], time[-1] + 0.01 * (time[-1] - time[0])), xlabel="time (s)" * story.charts)
    page.axes["soft"].tick_params(labelleft=False)
    page.axes["hard"].set_ylabel(f"height (m); 0: ball {np.flatnonzero(~report.scene.is_wall)[-1]} at rest")
    speed = film_speed(len(shown["flight"]) / story.fps / (time[-1] - story.view.end))
    page.tell(page.panels, time, [ACT_CAPTIONS[act].format(speed) for act, times in shown.items() for _ in times])
    return page


def draw_balls(page: Page, story: Story, name: str, time: Array, heights: Array) -> None:
    """Draw the balls of one engine on their page, and the marks of their apexes.

    A mark with the height appears when the ball reaches its apex.

    Parameters
    ----------
    name : str
        The engine, "hard" or "soft".
    time : array
        Times of the frames in s.
    heights : (len(time), n) array
        Heights of the bodies in m.
    """
    from matplotlib import markers, transforms

    scene, axis, colour = story.view.report.scene, page.axes[name], LINE_COLOURS[name]
    balls, (size, stacked) = np.flatnonzero(~scene.is_wall), stack_points(scene)
    standing = markers.MarkerStyle("o", transform=transforms.Affine2D().translate(0.0, 0.5))
    axis.set(xlim=(-1.0, 1.0), xticks=[])

    def raised(height: float) -> Any:
        return transforms.offset_copy(axis.transData, page.figure, 0.0, height, "points")

    floor = axis.plot([-0.9, 0.9], [0.0, 0.0], color=INK_COLOUR, lw=2, transform=raised(-stacked[-1]), gid="floor")
    page.moving.append((floor[0], np.zeros((len(time), 2))))
    for body, diameter, offset in zip(balls.tolist(), size, stacked - stacked[-1], strict=True):
        when, top = story.tops[name][body]
        mark_height = np.where(time >= when, top, -2.0 * axis.get_ylim()[1])
        drawn = [
            *axis.plot([0.0], [0.0], marker=standing, ms=diameter, mfc=f"{colour}30", mec=colour, gid="ball",
                       transform=raised(offset)),
            *axis.plot([-0.4, 0.4], [0.0, 0.0], color=colour, lw=1.4, transform=raised(offset)),
            axis.text(
                0.45,
                0.0,
                number(top, 3) * (len(balls) <= MAX_FORCE_CURVES or body == balls[-1]),
                color=colour,
                fontsize=9,
                family=FONT_FAMILY,
                transform=raised(offset),
                ha="left",
                va="bottom",
                clip_on=True,
                gid=f"apex {body}",
            ),
        ]
        page.moving += [(artist, np.stack([0.0 * path, path], 1))
                        for artist, path in zip(drawn, (heights[:, body], mark_height, mark_height), strict=True)]


def stack_points(scene: Scene) -> tuple[Array, Array]:
    """Diameter of each ball, and height of the balls below it, in points.

    Balls stand on each other, as on the teaching page, and the ruler shows the heights of the top ball.
    """
    size = BALL_POINTS * drawn_radii(scene)[~scene.is_wall]
    stacked = np.cumsum(size) - size
    scale = min(1.0, STACK_POINTS / max(float(stacked[-1]), 1e-9))
    return scale * size, scale * stacked


def contact_page(story: Story) -> Page:
    """Return the page of the contacts: balls, contacts, forces, paths, enlarged view."""
    view, time = story.view, story.acts["slow"]
    report, detail = view.report, closeup(view)
    if detail is not None and (detail.view is not view or len(detail.touches) < 2):
        detail = None  # a short part of a long film, or a single contact
    runs = repeat_both_runs(report, np.unique(np.concatenate([time, view.moments, detail.moments if detail else []])))
    page = story.page(dict(list(PANEL_HEIGHTS.items())[: 4 if detail else 3]), PANEL_WIDTH)
    if len(story.acts) > 1 and story.charts:
        left, low, wide, tall = page.figure.get_layout_engine().get()["rect"]
        page.figure.get_layout_engine().set(rect=(left + 0.04, low, wide - 0.04, tall))  # the ruler of `flight_page`
    if story.charts:
        draw_charts(page.panels, view, detail, runs)
    prepare_page(page, report.scene, {
        name: np.asarray(points(run))[np.searchsorted(run.time, time, side="right") - 1] for name, run in runs.items()
    }, view, time, story.fps)
    return page


def draw_charts(panels: list[Any], view: View, detail: Closeup | None, runs: dict[str, Trajectory]) -> None:
    """Draw contacts, forces, paths and the enlarged view into the panels of a page.

    Parameters
    ----------
    panels : list of matplotlib axes
        The panels from top to bottom.
    detail : Closeup or None
        The enlarged view, if there is one.
    runs : dict of str to Trajectory
        Both runs by engine.
    """
    draw_contacts(panels[0], view, runs, MAX_LABELS if view.report.scene.gravity > 0.0 else MAX_FORCE_CURVES)
    for force in np.transpose(np.asarray(runs["soft"].force)):
        force_curve(panels[1], view.clock(runs["soft"].time), force / (force.max() or 1.0))
    panels[1].set(ylim=(0.0, 1.05), ylabel="force /\nits peak")
    draw_runs(panels[2], view, runs)
    if detail is not None:
        draw_closeup(panels[3], detail, runs)

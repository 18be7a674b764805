"""One scene under both engines: `compare(scene, law) -> Comparison`. May this scene be event-driven?"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

from granular import edmd, md
from granular._engine import check
from granular._engine.progress import shown
from granular._engine.reports import Report
from granular.comparison import report
from granular.comparison.answer import Judged
from granular.laws.kinds import checked
from granular.md.binary import rule_of_comparison
from granular.run import until as stop
from granular.run.drive import EVENTS
from granular.run.trajectory import Trajectory
from granular.run.until import check_end
from granular.scene import Scene, checked as a_scene

if TYPE_CHECKING:
    from granular.comparison.further import Against
    from granular.comparison.remedies import Remedies


@check.face
@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Judged, Report):
    """The discrepancy between hard and soft spheres for one scene; print it, `plot` it, save it with `to_json`.

    Attributes
    ----------
    scene : Scene
        The common start.
    law, rule : tuple, Any
        Force law per pair, and collision rule (the law's own restitution unless one was given).
    hard, soft : Trajectory
        The event-driven and the soft-sphere run.
    pairs : tuple of PairOutcome
        Contacts and separation speeds, pair by pair.
    twin : Trajectory
        EDMD from gaps shifted by 1e-12 of themselves, run when it is asked for: how far the scene can be predicted at
        all. It ends at ten times the collisions.
    levelled : (2,) tuple of Trajectory
        Both runs without contacts that are rounding, those still running or to come at the end followed to theirs.
    deciding : Departure or None
        The ball and the episode of contacts that decide the error.
    answer : Answer
        May these collisions be treated as instantaneous?
    reasons : tuple of Reason
        Why, component by component, the worst first.
    verdict : str
        The first reason in one line.
    hard_options, soft_options : mapping
        Options of `granular.edmd.simulate` and `granular.md.simulate` with which the runs are made again, for details.
    """

    __str__ = report.text
    details = _whole = report.details
    __repr__, _headline = Report.__repr__, Judged.verdict
    _numbers = report.numbers

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw what both engines make of the scene; return the figure, or save it to `path`.

        From top to bottom: the verdict and the parameters; when the balls of each pair touch; the forces of the soft
        spheres; the paths of all balls; and, where contacts of neighbours overlap in time, a lens on the distance of
        the two balls that touch most often meanwhile, on its own scale.
        """
        from granular.comparison import figure

        return figure.plot(self, path)

    def remedies(
        self,
        observable: Callable[[Trajectory], float] | None = None,
        *,
        tc: float | None = None,
        merge_below: float | None = None,
        elastic_below: float | None = None,
    ) -> Remedies:
        """Hold every remedy for an inelastic collapse against Newton: none, merge, TC model, elastic cut-off, sticky.

        Parameters
        ----------
        observable : callable, optional
            Trajectory → float, what is to be right; default: the share E/E0 of its energy that a run has left.
        tc : float, optional
            Duration in s of the TC model; if not given that of the comparison, else the shortest isolated contact of
            its force laws at the speed of the first collision.
        merge_below, elastic_below : float, optional
            Speeds in m/s below which balls merge, or collide elastically; if not given those of the comparison, else
            1/100 of the speed of the first collision.

        Returns
        -------
        Remedies
            A row for each, and the tc with which the TC model has Newton's value, if any.

        Raises
        ------
        TypeError, ValueError
            If a duration or a speed is no positive number.
        """
        from granular.comparison.remedies import table

        return table(self, observable, {"tc": tc, "merge_below": merge_below, "elastic_below": elastic_below})

    def against(self, run: Trajectory) -> Against:
        """Hold the rows of a run of another program against both engines, solved anew at exactly its times.

        Parameters
        ----------
        run : Trajectory
            Of the same scene, such as `granular.Trajectory.from_arrays` makes.

        Returns
        -------
        Against
            Differences of velocities ball by ball, in the units of this report; its `str` is a small table.

        Raises
        ------
        TypeError, ValueError
            If it is no trajectory, of another scene, or begins before it.
        """
        from granular.comparison.further import against

        return against(self, run)

    def animate(
        self, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25, *, whole: bool = True,
        charts: bool = True,
    ) -> None:
        """Write a film of both engines; of at most 60 balls.

        A fall has three times, as on the teaching page: the fall as fast as life, a stop at the floor, the contacts
        slowed down (thousands of times, as the film says), and the flight against a ruler, as fast as life unless it
        takes longer than 6 s. Every ball stops at its own apex, where a tick and its height in m stay; that of the top
        ball is `rises`. Where nothing falls, or contacts and flights take turns, all of the film has one time, slowed
        down or not. Balls on which no gravity acts stand in a row. A lens shows the distance of the two balls that
        touch most often while a neighbouring contact lasts.

        Parameters
        ----------
        path : str or path
            A ``.gif`` file, or an ``.mp4`` file where ffmpeg is installed.
        seconds : float
            How long the contacts are shown, in s; fall, stop and flight come on top of it.
        fps : int
            Pictures per second.
        whole : bool
            False leaves out fall and flight: one slow motion of the contacts, as long as `seconds` says.
        charts : bool
            False leaves out all charts and parameters: balls, and a ruler for those that fall.
        """
        from granular.comparison import film

        film.animate(self, path, seconds, fps, whole=whole, charts=charts)


@check.face
def compare(
    scene: Scene,
    law: Any,
    rule: Any = None,
    *,
    until: stop.Until | None = None,
    t_end: float | None = None,
    max_events: int | None = None,
    ties: str = "left",
    seed: int = 0,
    collapse: str = "stop",
    merge_below: float | None = None,
    tc: float = 0.0,
    elastic_below: float = 0.0,
    method: str | None = None,
    dt: float | None = None,
    engine: str = "auto",
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
) -> Comparison:
    """Run one scene as hard and as soft spheres and report where and why they part ways.

    Parameters
    ----------
    scene : Scene
        The common start; no overlaps.
    law : force law or sequence of them
        For the soft spheres, one or one per pair.
    rule : collision rule or sequence of them, optional
        For the hard spheres; default the law's own ε as a function of impact speed and pair.
    until, t_end : stop condition, float, optional
        When both engines stop. By default they run until no further contact is possible. Scenes that never end, such
        as balls beside a driven wall or an elastic ball above a floor, need one of them or `max_events`.
    max_events : int, optional
        Maximum number of contacts of each run. Defaults to 1 000 000.
    ties : str
        What simultaneous hard-sphere collisions do; see `granular.edmd.simulate`.
    seed : int
        For ``ties="random"``.
    collapse : str
        What hard spheres do about an inelastic collapse: "stop", or "merge"; see `granular.edmd.simulate`.
    merge_below : float, optional
        Speed in m/s for ``collapse="merge"``.
    tc : float
        Contact duration in s of the TC model of the hard spheres; 0: not used. See `granular.edmd.simulate`, and
        `Comparison.remedies` for all remedies side by side.
    elastic_below : float
        Speed in m/s below which hard collisions are elastic; 0: not used.
    method : str, optional
        How Newton's equation is solved: "located" (every event to rounding, the default) or a fixed-step integrator.
    dt : float, optional
        Time step in s of a fixed-step integrator.
    engine : str
        "auto", "plain" or "compiled", of the soft spheres.
    on_progress : callable, optional
        ``on_progress(reached, count)`` of both engines, one after the other: time in s, and contacts so far.
    progress : bool
        Show how far it is, from 2 s on: on standard error, as a bar where tqdm is installed.

    Returns
    -------
    Comparison
    """
    known = checked(law, a_scene(scene))
    laws = known.given
    used = rule_of_comparison(laws, scene) if rule is None else rule
    remedied = collapse != "stop" or tc != 0.0 or elastic_below != 0.0
    check_end(scene, t_end, until, max_events, elastic=lambda: not remedied and known.elastic)
    end: dict[str, Any] = {"until": until, "t_end": t_end, "max_events": EVENTS if max_events is None else max_events}
    event_driven: dict[str, Any] = end | {"ties": ties, "seed": seed, "collapse": collapse, "merge_below": merge_below,
                                          "tc": tc, "elastic_below": elastic_below}
    options: dict[str, Any] = {"method": method, "dt": dt, "engine": engine}
    with shown(progress, on_progress, end=math.inf if t_end is None else t_end) as tell:
        hard = edmd.simulate(scene, used, **event_driven | {"max_events": max_events}, on_progress=tell)
        soft = md.simulate(scene, laws, **end, **options, on_progress=tell)
    return Comparison(scene, laws, used, until, t_end, hard, soft, event_driven, options)

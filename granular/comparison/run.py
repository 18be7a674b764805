"""Comparison of hard and soft spheres: `compare(scene, law)`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

from granular import edmd, md
from granular._engine import signature
from granular._engine.progress import progress_callback
from granular._engine.reports import Report
from granular.comparison import report
from granular.comparison.answer import ComparisonWithAnswer
from granular.laws.kinds import checked
from granular.md.binary import rule_of_comparison
from granular.run import until as stop
from granular.run.drive import DEFAULT_MAX_EVENTS
from granular.run.trajectory import Trajectory
from granular.run.until import check_end
from granular.scene import Scene, checked as a_scene

if TYPE_CHECKING:
    from granular.comparison.against import Against, Bounces
    from granular.comparison.remedies import Remedies


@signature.face
@dataclass(frozen=True, eq=False, repr=False)
class Comparison(ComparisonWithAnswer, Report):
    """Hard and soft run of one scene, with their differences and the answer.

    Print it for a report, draw it with `plot`, save it with `to_json`.

    Attributes
    ----------
    scene : Scene
        The common initial state.
    law, rule : tuple, Any
        Force law of each pair, and collision rule. The rule is the restitution of the law unless one was given.
    hard, soft : Trajectory
        The event-driven run and the soft-sphere run.
    pairs : tuple of PairOutcome
        Numbers of contacts and separation speeds of each pair.
    twin : Trajectory
        Second event-driven run, from gaps shifted by a relative 1e-12. It shows whether the scene can be predicted. It
        is computed when first used, and stops after ten times the number of collisions of the hard run.
    continued : (2,) tuple of Trajectory
        Both runs, continued until every pair has the same number of contacts if possible, and every contact has
        ended. Contacts at rounding level are left out.
    deciding : Departure or None
        Ball and episode of contacts with the largest error.
    answer : Answer
        Can these collisions be treated as instantaneous?
    reasons : tuple of Reason
        Reason for the answer of each component, the worst answer first.
    verdict : str
        The answer with its first reason, in one line.
    hard_options, soft_options : mapping
        Options of `granular.edmd.simulate` and `granular.md.simulate` with which the runs can be repeated.
    """

    __str__ = report.text
    details = _whole = report.details
    __repr__, _headline = Report.__repr__, ComparisonWithAnswer.verdict
    _numbers = report.numbers

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw both runs, and return the figure or save it to `path`.

        From top to bottom: the verdict and the parameters, the contacts of each pair over time, the forces of the soft
        spheres, and the paths of all balls. If contacts of neighbouring pairs overlap in time, an enlarged panel shows
        the distance of the two balls that touch most often during the overlap.
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
        """Compare the remedies for inelastic collapse with soft spheres.

        The remedies are merging balls, the TC model, an elastic cut-off and a sticky rule. Hard spheres without
        a remedy are included.

        Parameters
        ----------
        observable : callable, optional
            Function of a trajectory that returns the number to compare. Defaults to the fraction E/E0 of the energy
            that is left at the end.
        tc : float, optional
            Contact duration in s of the TC model. Defaults to the value in this comparison. If that is 0, it is the
            shortest duration that the contacts of the hard run would have under the force laws.
        merge_below, elastic_below : float, optional
            Speeds in m/s below which balls merge, or collide elastically. Each defaults to the value in this
            comparison. If none is set, it is 1/100 of the fastest approach speed of the hard run.

        Returns
        -------
        Remedies
            One row per remedy, and the value of tc for which the TC model gives the value of the soft spheres, if any.

        Raises
        ------
        TypeError, ValueError
            If a duration or a speed is not a positive number.
        """
        from granular.comparison.remedies import remedies_table

        return remedies_table(self, observable, {"tc": tc, "merge_below": merge_below, "elastic_below": elastic_below})

    def against(self, run: Trajectory) -> Against:
        """Compare a run of another program, or a recording, with both engines.

        Both engines run again, with samples at exactly the times of `run`. The clock of `run` can begin at any time.
        Its offset is the time of its first sample if this sample is the initial state of the scene. Otherwise the
        offset is fitted to the gaps, and accepted if it reduces the differences from one engine by a factor of four.

        Parameters
        ----------
        run : Trajectory
            Run of the same scene, for example from `granular.Trajectory.from_arrays`. Velocities can be nan.

        Returns
        -------
        Against
            Velocities and gaps of all three runs, and the differences of velocities in the units of this report.
            It prints the verdict, sentences on clock, positions, first sample and free flights that are not parabolas,
            the values of the three runs side by side, and their differences.

        Raises
        ------
        TypeError, ValueError
            If `run` is not a trajectory, or belongs to another scene.
        """
        from granular.comparison.against import against

        return against(self, run)

    def against_bounces(self, times: Any = None, heights: Any = None, *, ball: int = 1) -> Bounces:
        """Compare recorded times of bounces, or heights after them, with both engines.

        Bounces are contacts of the lowest pair, which is the floor and ball 1. The first entry belongs to the first
        bounce. Convert intervals to times with ``np.cumsum([0, *intervals])``. This clock begins at the first bounce.

        Parameters
        ----------
        times : (K,) array, optional
            Times of the bounces in s, on any clock. The offset of the clock is the median difference from one engine,
            if this reduces the differences by a factor of four. An engine with only one bounce is used only if the
            other engine has only one bounce as well.
        heights : (L,) array, optional
            Heights in m of the apexes of `ball` after each bounce, above the floor with radii subtracted, see `rises`.
        ball : int
            Ball whose heights are given. Defaults to 1.

        Returns
        -------
        Bounces
            Times and heights of the recording and of both engines, nan where an engine has no such bounce.

        Raises
        ------
        TypeError, ValueError
            If neither times nor heights are given, if times do not increase, if a height is negative, or if `ball` is
            not a ball of the scene.
        """
        from granular.comparison.against import against_bounces

        return against_bounces(self, times, heights, ball)

    def animate(
        self, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25, *, whole: bool = True,
        charts: bool = True,
    ) -> None:
        """Write a film of both engines side by side, for at most 60 balls.

        The film of a fall has three parts, as on the teaching page. The fall (at most its last 6 s) is shown in real
        time and stops at the floor. The contacts are shown in slow motion, and the slow-down factor is printed. The
        flight is shown next to a ruler, in real time, or faster so that it takes 6 s. Every ball stops at its apex,
        which is marked with its height in m. The height of the top ball is `rises`. Only the part with the contacts is
        shown without gravity or without a floor, if walls exchange energy with the balls, if a run ended early, or if
        the contacts would be slowed down by less than a factor of 10. Balls without gravity are drawn in a horizontal
        row. If contacts of neighbouring pairs overlap in time, an enlarged view shows the distance between two balls:
        the balls that touch most often in a group of such contacts.

        Parameters
        ----------
        path : str or path
            A ``.gif`` file, or an ``.mp4`` file if ffmpeg is installed.
        seconds : float
            Duration in s of the part that shows the contacts. The fall, the stop and the flight are added to it.
            Defaults to 7.
        fps : int
            Frames per second. Defaults to 25.
        whole : bool
            If False, the film shows only the contacts in slow motion and lasts `seconds`. Defaults to True.
        charts : bool
            If False, charts and parameters are omitted: the film shows the balls, and a ruler if they fall. Defaults
            to True.
        """
        from granular.comparison import film

        film.animate(self, path, seconds, fps, whole=whole, charts=charts)


@signature.face
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
    """Run one scene as hard and as soft spheres, and report where and why they differ.

    Parameters
    ----------
    scene : Scene
        The common initial state, without overlaps.
    law : force law or sequence of force laws
        Force law of the soft spheres, one for all pairs or one per pair.
    rule : collision rule or sequence of collision rules, optional
        Coefficient of restitution of the hard spheres. Defaults to the restitution of an isolated contact under `law`,
        as a function of the approach speed and the pair.
    until, t_end : stop condition, float, optional
        Condition or time in s at which both engines stop. By default they run until no further contact is possible.
        Scenes that never end, such as balls next to a driven wall or an elastic ball above a floor, need one of the two
        or `max_events`.
    max_events : int, optional
        Maximum number of contacts of each run. Defaults to 1 000 000.
    ties : str
        Tie rule for simultaneous hard-sphere collisions, see `granular.edmd.simulate`. Defaults to "left".
    seed : int
        Seed for ``ties="random"``. Defaults to 0.
    collapse : str
        Treatment of an inelastic collapse of the hard spheres: "stop" (default) or "merge", see
        `granular.edmd.simulate`.
    merge_below : float, optional
        Speed in m/s for ``collapse="merge"``.
    tc : float
        Contact duration in s of the TC model of the hard spheres. The default 0 disables it. See
        `granular.edmd.simulate`, and `Comparison.remedies` for all remedies side by side.
    elastic_below : float
        Speed in m/s below which hard collisions are elastic. The default 0 disables it.
    method : str, optional
        Integrator of the soft spheres: "located" (events located to rounding error, the default) or the name of a
        fixed-step integrator.
    dt : float, optional
        Time step in s of a fixed-step integrator.
    engine : str
        "auto" (default), "plain" or "compiled", for the soft spheres, see `granular.md.simulate`.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called by both engines, one after the other, with the time reached in s and
        the number of contacts so far.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.

    Returns
    -------
    Comparison
        Both runs with the answer, its reasons and all measures, which are computed when they are first used.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, if balls overlap, or if the scene never ends and no end is given.

    Examples
    --------
    >>> import granular as gr
    >>> scene = gr.scenes.three_balls(gap=1e-2)
    >>> law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    >>> report = gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))
    >>> report.answer.name, f"{report.error:.4f}"
    ('yes', '0.0017')
    """
    known = checked(law, a_scene(scene))
    laws = known.given
    used = rule_of_comparison(laws, scene) if rule is None else rule
    remedied = collapse != "stop" or tc != 0.0 or elastic_below != 0.0
    check_end(scene, t_end, until, max_events, elastic=lambda: not remedied and known.elastic)
    end: dict[str, Any] = {
        "until": until,
        "t_end": t_end,
        "max_events": DEFAULT_MAX_EVENTS if max_events is None else max_events,
    }
    event_driven: dict[str, Any] = end | {"ties": ties, "seed": seed, "collapse": collapse, "merge_below": merge_below,
                                          "tc": tc, "elastic_below": elastic_below}
    options: dict[str, Any] = {"method": method, "dt": dt, "engine": engine}
    with progress_callback(progress, on_progress, end=math.inf if t_end is None else t_end) as tell:
        hard = edmd.simulate(scene, used, **event_driven | {"max_events": max_events}, on_progress=tell)
        soft = md.simulate(scene, laws, **end, **options, on_progress=tell)
    return Comparison(scene, laws, used, until, t_end, hard=hard, soft=soft, hard_options=event_driven,
                      soft_options=options)

"""Soft spheres: integrate Newton's equation with contact forces.

`granular.md.simulate` runs a scene, `resume` continues a run, and `events` yields its contacts one at a time.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from typing import Any

from numpy.linalg import LinAlgError
from numpy.typing import ArrayLike

from granular._engine import check
from granular.laws.kinds import SceneLaws, check_deepest, checked as checked_laws
from granular.md.located import run as located
from granular.run import until as stop
from granular.run.contact_log import Event, one_by_one
from granular.run.drive import Request, continue_run, drive, in_time, requested
from granular.run.trajectory import Status, Trajectory
from granular.run.until import check_end
from granular.scene.places import Closing, checked, fitted
from granular.scene.state import Scene

SMALLEST_DT = 1e-60
"""Smallest `dt` in s: "gear5" needs its fifth power, which underflows below."""
DEFAULT_TOL = 1e-16
"""Default `tol`."""
SMALLEST_TOL = 1e-17
"""Smallest `tol`.

Smaller values only cost steps, because sums of floats are accurate to 1e-16."""
DEFAULT_MAX_STEPS = 20_000_000
"""Default of `max_steps`."""
STEPS_PER_CONTACT = 500
"""Default number of steps per shortest contact.

Halving the error of a method of order 1 doubles it."""


@check.face
def simulate(
    scene: Scene,
    law: Any,
    *,
    t_end: float | None = None,
    until: stop.Until | None = None,
    t_start: float = 0.0,
    samples: int | str | ArrayLike | None = None,
    log: bool | str | PathLike[str] = True,
    max_events: int | None = None,
    max_steps: int = DEFAULT_MAX_STEPS,
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    engine: str = "auto",
    method: str | None = None,
    dt: float | None = None,
    tol: float = DEFAULT_TOL,
    disturbed: str = "resolve",
) -> Trajectory:
    """Run a scene as soft spheres.

    Integrates m_i a_i = F_(i-1) - F_i - m_i g + f_i, where F = max(0, law) for ξ > 0, else 0.

    Parameters
    ----------
    scene : Scene
        Initial state. Overlaps (negative gaps) are allowed.
    law : force law or sequence of force laws
        One law for all pairs, or one per pair from the bottom up. The law of a pair at a thermal wall is ignored.
    t_end, until : float, stop condition, optional
        End time in s, and a condition from `granular.until`. By default a run ends when no further contact is possible,
        or at one of the limits below. One of the two is required where another contact can always follow: with driven
        or thermal walls, on a ring, and for pendula. It is also required on a floor if all laws are like `WaltonBraun`,
        because balls then bounce in their dents forever. Elastic balls that fall back to a floor or fly between two
        walls need `t_end`, `until`, `max_events` or `max_steps`. Walls that approach each other need a `t_end` before
        they meet.
    t_start : float
        Time of the initial state in s.
    samples : None, int, "contacts" or array of float
        States to record. None records the first and the last state. An int records that number of evenly spaced times
        from `t_start` to `t_end`. An array contains the times in s. "contacts" records the onset, the end and a few
        times before, during and after every contact. The run is solved twice for "contacts", and for a number of
        samples without `t_end`. If a run ends before the last sample, its final state becomes the last sample.
    log : bool or path
        Keep one row per contact in ``contacts``. A path ``"run.npy"`` of a file that does not exist yet writes the rows
        to that file block by block instead. This needs no memory, and all written blocks remain readable if the process
        is killed. ``contacts`` then stays empty, and `Trajectory.contact_batches` reads the file.
    max_events, max_steps : int, optional
        Stop with status ``max_events`` after that number of contacts or steps, by default 1 000 000 and 20 000 000.
        Under laws other than powers, a run also stops with this status if contacts creep or chatter: some thousand
        trial steps then hardly advance the time.
    on_event : callable, optional
        Called with each row of the contact log, in batches, in the order in which contacts end. With fixed steps,
        contacts that end within one step can come in any order.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called from time to time with the time reached in s and the number of
        contacts.
    progress : bool
        Show the progress of runs longer than 2 s on standard error, as a bar if tqdm is installed.
    engine : {"auto", "plain", "compiled"}
        Interpreted or compiled by numba (extra ``fast``). Results are bitwise identical. "auto" starts interpreted and
        switches to compiled code once that saves time and if the law compiles. If it does not compile, `stats` contains
        the reason.
    method : {"located", "verlet", "symplectic-euler", "rk4", "gear5"}, optional
        "located", the default and the reference, locates every event to rounding: touch, end of the force, return of
        the force. The others are fixed-step integrators as in DEM codes. Their samples between two steps are computed
        by one shorter step on a copy. The default is "verlet" if only `dt` is given.
    dt : float, optional
        Time step in s of a fixed-step method. Defaults to 1/500 of the shortest expected contact.
    tol : float
        Truncation error per step of "located" under nonlinear laws, relative to the current speed and overlap. From
        1e-17, which is below rounding, to 1e-3.
    disturbed : {"resolve", "stop", "ignore"}
        What "located" does if an overlap begins beside another one. "resolve" integrates both together exactly. "stop"
        ends the run with status ``disturbed``: until then every contact was isolated. "ignore" treats every contact as
        isolated (soft event-driven simulation): a neighbour that touches early begins with gap 0 when the contact is
        over. Contacts without an end (at rest) and initial overlaps are always resolved. "ignore" is not allowed for
        pendula, because resetting a gap to 0 would change their energy.

    Returns
    -------
    Trajectory
        A fixed-step method returns status ``unstable`` if dt was above the stability limit 2/λ of the contacts that
        took place. Above 0.2/λ it issues a `RuntimeWarning`.

    Raises
    ------
    TypeError, ValueError
        For invalid arguments.

    Notes
    -----
    Fixed-step methods can miss a contact shorter than `dt` completely. Begin and end of a contact are interpolated
    between two steps, accurate to about (dt/t_c)² t_c. The error of the state has order min(p, 1+s) if the force starts
    like t^s: s = 0 for a dashpot, 1 for a spring, 1.5 for Hertz. The integrator's own order p is 4 for "rk4" and
    "gear5", 2 for "verlet" and 1 for "symplectic-euler", whose velocities lag by half a step. Exception: elastic
    contacts from flight to flight have the order of "verlet" without gravity and pendula. A "gear5" run that starts
    within a contact has order 2, because the higher derivatives of its velocities are unknown. Cost: O(contacts) for
    "located", O(pairs) per step for a fixed-step method.

    At a driven wall (`Scene.floor`, `ceiling`) "located" certifies the next touch on the path of the wall. It adds the
    series of the path to the series of the contact. With fixed steps such a wall moves by the difference of two
    positions on its path. Forces see its velocity there, so all orders above hold. A step in which the velocity of the
    path jumps has order 1. While all pairs are open, the balls fly to the next touch, which is found on the path
    itself.

    Thermal walls (`granular.walls.Thermal`) with "located": a ball that touches one is thrown back immediately,
    whatever the law of that pair, even during another contact. The hit is a row of the log with zero duration and force
    nan. Between pendula and on a ring, contacts are certified as isolated in the same way. On a ring an island can
    extend all around. Rest and binding are not proved in such scenes, so these runs continue to their end.

    With driven walls, `Trajectory.account` is summed by Simpson's rule in each fixed step. The energy balance then
    closes only to the order of the method, and to order 1 + s at onsets and ends. The dissipated energy is nan while a
    law with memory exerts a force.

    With fixed steps, rings and pendula keep the orders above, and open scenes fly in closed form. After a hit of a
    thermal wall within a step, the ball continues from the time of the hit on its new parabola. Hits are therefore
    exact to rounding if nothing else touches the ball ("symplectic-euler" knows no parabolas: order 1). They have order
    2 beside a contact, and order 1 where a damped force jumps with the velocity.

    Examples
    --------
    >>> import granular as gr
    >>> scene = gr.scenes.three_balls(gap=0.01)
    >>> run = gr.md.simulate(scene, gr.LinearDashpot(k=1e7, gamma=0.5), t_end=0.4)
    >>> run.status.name
    'time'
    >>> run.contacts["pair"].tolist(), run.contacts["t_begin"].round(6).tolist()
    ([0, 1], [0.319275, 0.321833])
    >>> run.velocity[-1].round(3).tolist()
    [0.0, 2.346, 8.604]
    """
    laws, start = checked_laws(law, checked(scene)), check.number("t_start", t_start)
    request = _requested(
        scene, laws, start, t_end, engine, disturbed, until=until, samples=samples, log=log, max_events=max_events,
        max_steps=max_steps, on_event=on_event, on_progress=on_progress, progress=progress,
    )
    scene = fitted(scene, start, request.end)
    _check_walls(scene, start, request.end)
    if method is None:
        method = "located" if dt is None else "verlet"
    if not isinstance(method, str) or method != "located" or dt is not None:
        return _stepped(scene, laws, request, method, dt, engine, tol=tol, disturbed=disturbed)
    finest = check.number("tol", tol, at_least=SMALLEST_TOL, at_most=1e-3)
    with _in_range(laws.given[0]):
        return in_time(lambda asked: drive(_stopping(
            located.Run(scene, laws, asked, engine, finest, disturbed))), request)


def _stopping(run: located.Run) -> Any:
    """Return the run, wrapped for monitoring if a level stops it.

    The monitoring code is imported only in this case.
    """
    if not isinstance(run.request.until, stop.LEVEL_TYPES):
        return run
    from granular.md.located import levels
    from granular.run.levels import Watched

    return Watched(run, levels)


def _requested(
    scene: Scene, laws: SceneLaws, start: float, t_end: float | None, engine: str, disturbed: str, **options: Any
) -> Request:
    """Check the options that `simulate` and `resume` share."""
    request = requested(scene, start, t_end, **options)
    endless = disturbed != "stop" and options["max_steps"] == DEFAULT_MAX_STEPS
    check_end(scene, t_end, options["until"], options["max_events"], dented=lambda: _dented(scene, laws),
              elastic=lambda: endless and laws.elastic)
    check.choice("engine", engine, ("auto", "plain", "compiled"))
    check.choice("disturbed", disturbed, located.DISTURBED_OPTIONS)
    return request


def _stepped(
    scene: Scene, laws: SceneLaws, request: Request, method: str, dt: float | None, engine: str, *, tol: float,
    disturbed: str,
) -> Trajectory:
    """Run a scene with a fixed step, which supports neither `tol` nor `disturbed`."""
    from granular.md import fixed

    if check.choice("method", method, ("located", *fixed.INTEGRATORS)) == "located":
        raise ValueError(f"`dt` must be None for method 'located', which has no fixed step, got {dt!r}. Other methods: "
                         f"{', '.join(fixed.INTEGRATORS)}.")
    check.refuse({
        f"`tol` must be left out for method {method!r}, which has a fixed step, got {tol!r}. Give `dt`, or use "
        "method='located'.": tol != DEFAULT_TOL,
        f"`disturbed` must be 'resolve' for method {method!r}, got {disturbed!r}. Use method='located'.":
            disturbed != "resolve",
    })
    step = _default_step(scene, laws) if dt is None else check.number("dt", dt, at_least=SMALLEST_DT)
    if request.start + step == request.start:
        raise ValueError(f"`dt` must be large enough to advance the clock at t_start = {request.start!r}, got "
                         f"{step!r}.")
    made: list[Any] = []

    def solve(asked: Request) -> Trajectory:
        made.append(fixed.Run(scene, laws, asked, method, step, engine))
        return drive(made[-1])

    run = in_time(solve, request)
    if made[-1].step_warning:
        warnings.warn(made[-1].step_warning, RuntimeWarning, stacklevel=4)  # at the caller of `simulate`, a `face`
    if run.status is not Status.unstable and len(run.contacts):
        check_deepest(laws, run.contacts)
    return run


@check.face
def events(scene: Scene, law: Any, *, max_events: int = check.MAX_INTEGER, **options: Any) -> Iterator[Event]:
    """Yield the contacts of a run as they end, each with the scene at that time.

    Accepts all options of `simulate` except `samples`, `on_event`, `log`, `method` and `dt`. Method "located" is used,
    and the contacts agree with those of `simulate` to rounding. Without a stop condition the iterator does not end.

    Parameters
    ----------
    scene, law
        As for `simulate`.
    max_events : int
        Maximum number of contacts.
    **options
        Options of `simulate`.

    Yields
    ------
    contact, time, scene : row of the contact log, float, Scene
        The contact, the time in s, and the state of the scene then (with ``disturbed="ignore"``, at the next event).

    Raises
    ------
    TypeError, ValueError
        For invalid arguments.

    Examples
    --------
    >>> import granular as gr
    >>> law = gr.LinearDashpot(k=1e7, gamma=0.5)
    >>> for contact, time, now in gr.md.events(gr.scenes.three_balls(gap=0.01), law, t_end=0.4):
    ...     print(contact["pair"], round(time, 6), now.velocity.round(3).tolist())
    0 0.321207 [0.0, 3.132, -3.151]
    1 0.321894 [0.0, 3.112, 9.37]
    """
    check.known(options, check.parameters(simulate) - {"scene", "law", "samples", "on_event", "log", "method", "dt"},
                 "option of md.events", TypeError)
    run: Any = simulate(scene, law, on_event=one_by_one, max_events=max_events, **options)
    return iter(run)


@check.face
def resume(
    trajectory: Trajectory,
    *,
    t_end: float | None = None,
    until: stop.Until | None = None,
    samples: int | str | ArrayLike | None = None,
    log: bool | str | PathLike[str] = True,
    max_events: int | None = None,
    max_steps: int = DEFAULT_MAX_STEPS,
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    engine: str = "auto",
    disturbed: str = "resolve",
) -> Trajectory:
    """Continue a run of `simulate` from its end, by method "located".

    The result is bitwise identical to an uninterrupted run, also from the middle of a contact. It is equal to rounding
    if `until` ended the first run. Laws and tolerance are taken from `trajectory`. See `simulate` for the other
    parameters.

    Parameters
    ----------
    trajectory : Trajectory
        Run of soft spheres by method "located".

    Returns
    -------
    Trajectory
        The continuation. Its contact log starts with complete rows of the contacts that were under way (if both runs
        keep logs). Contacts of a pair are counted from the beginning of the first run: ``until.contact(0, 7)`` is still
        the seventh. `max_events` and `max_steps` count from here, `stats` over both runs.

    Raises
    ------
    ValueError
        If `trajectory` is not a run of soft spheres by method "located", stopped before it began, or is broken. Also if
        its state is inconsistent with its scene, laws and last sample.

    Examples
    --------
    >>> import granular as gr
    >>> run = gr.md.simulate(gr.scenes.three_balls(gap=0.01), gr.LinearDashpot(k=1e7, gamma=0.5), t_end=0.3)
    >>> gr.md.resume(run, t_end=0.4).velocity[-1].round(3).tolist()
    [0.0, 2.346, 8.604]
    """
    state = check.of_kind("trajectory", trajectory, Trajectory, "a granular.Trajectory").state
    check.refuse({
        "`trajectory` must be a run of granular.md.simulate by method 'located' that has begun. For hard spheres use "
        "granular.edmd.resume.": trajectory.law is None or "origin" not in state,
        "`trajectory` is broken and cannot be continued. See its message.": trajectory.status is Status.broken,
    })
    laws = checked_laws(trajectory.law, trajectory.scene)
    request = _requested(
        trajectory.scene, laws, float(trajectory.stats.get("end", trajectory.time[-1])), t_end, engine, disturbed,
        until=until, samples=samples, log=log, max_events=max_events, max_steps=max_steps, on_event=on_event,
        on_progress=on_progress, progress=progress,
    )
    fitted(trajectory.scene, request.start, request.end)  # says so if a path ends before
    _check_walls(trajectory.scene, float(check.saved_array(state, "origin", "f", ())), request.end)
    with _in_range(laws.given[0]):
        return in_time(lambda asked: continue_run(_stopping(
            located.Run(trajectory.scene, laws, asked, engine, math.nan, disturbed, state)), trajectory), request)


@contextmanager
def _in_range(law: Any) -> Iterator[None]:
    """Convert range errors of the engine's own numbers to a `ValueError`.

    These are `ArithmeticError` and `LinAlgError` raised in modules of granular or numpy, including numpy functions
    that a user's law calls. Errors raised in other modules pass through.
    """
    try:
        yield
    except (ArithmeticError, LinAlgError) as error:
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        module = "" if trace is None else str(trace.tb_frame.f_globals.get("__name__"))
        if not module.startswith(("granular.", "numpy.")):
            raise
        raise ValueError(
            f"`law` must lead to contacts within the range of floating-point numbers, got {law!r}, …: their rates or "
            f"overlaps in this scene exceed it ({error}). Give coefficients, masses and speeds in SI units."
        ) from error


def _check_walls(scene: Scene, start: float, end: float) -> None:
    """Raise if walls at constant speed meet before the end.

    The run itself checks driven walls.
    """
    if scene.is_wall[0] and scene.is_wall[-1] and not scene.driven:
        Closing(scene, start, flattened=True).refuse(end, end)


def _dented(scene: Scene, laws: SceneLaws) -> bool:
    """Return whether balls fall on a floor and lose energy only in new dents.

    Under such laws energy is lost only where an overlap exceeds all earlier ones. Each ball ends in an elastic bounce
    within its own dent, and none comes to rest.
    """
    lossless = all(law.memory and not law.rate_dependent for law in laws.each)
    return bool(scene.gravity > 0.0 and scene.is_wall[0] and lossless)


def _default_step(scene: Scene, laws: SceneLaws) -> float:
    from granular.md.time_step import expected_rate

    try:
        rate = expected_rate(scene, laws)
    except ArithmeticError:  # of a law, at an overlap far beyond those it is made for
        rate = math.nan
    if not 0.0 < rate < math.inf:
        raise ValueError(f"`dt` must be given in s, got None. The duration of a contact does not follow from "
                         f"{laws.given[0]!r}.")
    return math.pi / rate / STEPS_PER_CONTACT

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

from granular._engine import check, signature
from granular.laws.kinds import SceneLaws, check_deepest, checked as checked_laws
from granular.md.located import run as located
from granular.run import until as stop
from granular.run.contact_log import Event, yield_contacts
from granular.run.drive import Request, checked_request, continue_run, drive, solve_soft_spheres
from granular.run.trajectory import Status, Trajectory
from granular.run.until import check_end
from granular.scene.places import WallMeeting, checked, with_fitted_walls
from granular.scene.state import Scene

SMALLEST_DT = 1e-60
"""Smallest allowed `dt` in s. Below it, powers of `dt` in "gear5" underflow."""
DEFAULT_TOL = 1e-16
"""Default of `tol`, the truncation error per step of method "located"."""
SMALLEST_TOL = 1e-17
"""Smallest allowed `tol`.

Smaller values would only add steps, because sums of floats are accurate to 1e-16."""
DEFAULT_MAX_STEPS = 20_000_000
"""Default of `max_steps`, the limit on the number of steps of a run."""
STEPS_PER_CONTACT = 500
"""Number of steps per duration of the shortest contact, for the default time step.

Half the error of a method of order 1 needs twice this number."""


@signature.face
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
        or at one of the limits below. `t_end`, `until` or `max_events` is required in scenes where another contact can
        always follow: with driven or thermal walls, on a ring, and for pendula. This also holds under gravity on a
        floor if all laws have memory and do not depend on the rate, such as `WaltonBraun`: balls then finally bounce
        elastically, without end. Elastic balls that fall back to a floor, that forces press together, or that fly
        between two walls need one of these options or `max_steps`. Walls that approach each other need a `t_end` before
        they meet.
    t_start : float
        Time of the initial state in s. Defaults to 0.
    samples : None, int, "contacts" or array of float
        States to record. None records the first and the last state. An int records that number of evenly spaced times
        from `t_start` to `t_end`. An array contains the times in s. "contacts" records the onset, the end and a few
        times before, during and after every contact. The run is solved twice for "contacts", and for a number of
        samples without `t_end`. If a run ends before the last requested time, its final state is the last sample.
    log : bool or path
        Whether to keep one row per contact in ``contacts``. If it is the path of a new file, such as ``"run.npy"``,
        rows are written to that file block by block instead. Memory then holds one block, and all written blocks remain
        readable if the process is killed. ``contacts`` then stays empty, and `Trajectory.contact_batches` reads the
        file. Defaults to True.
    max_events, max_steps : int, optional
        Stop with status ``max_events`` after that number of contacts or steps, by default 1 000 000 and 20 000 000.
        Under laws other than powers, contacts can creep or chatter. A run also stops with this status if several
        thousand trial steps hardly advance the time.
    on_event : callable, optional
        Called with each row of the contact log, in batches, in the order in which contacts end. With fixed steps,
        contacts that end within one step can come in any order.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called repeatedly during the run, with the simulated time reached in s and
        the number of contacts.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.
    engine : {"auto", "plain", "compiled"}
        Interpreted or compiled by numba (extra ``fast``). Results are bitwise identical. "auto", the default, starts
        interpreted and switches to compiled code once that saves time and if the law compiles. If it does not compile,
        `stats` contains the reason.
    method : {"located", "verlet", "symplectic-euler", "rk4", "gear5"}, optional
        "located", the default and the reference, locates every event to rounding: touch, end of the force, return of
        the force. The other methods are fixed-step integrators as in DEM codes. Their samples between two steps are
        computed by one shorter step on a copy. If only `dt` is given, the default is "verlet".
    dt : float, optional
        Time step in s of a fixed-step method. Defaults to 1/500 of the shortest expected contact duration.
    tol : float
        Truncation error per step of "located" under nonlinear laws, relative to the current speed and overlap. Values
        from 1e-17, which is below the rounding error, to 1e-3 are allowed. Defaults to 1e-16.
    disturbed : {"resolve", "stop", "ignore"}
        Treatment of contacts that are not isolated, for "located". "resolve", the default, integrates overlapping
        neighbouring pairs together. "stop" ends the run with status ``disturbed`` when the first such overlap begins:
        until then every contact was isolated. "ignore" treats every contact as isolated (soft event-driven simulation):
        if a neighbouring pair touches during a contact, its own contact begins with gap 0 after the end of the first
        one. Contacts without an end (at rest) and initial overlaps are always resolved. "ignore" is not allowed for
        pendula, because resetting a gap to 0 would change their energy.

    Returns
    -------
    Trajectory
        Samples, contact log and status. Let λ be the highest rate of the contacts that took place. A fixed-step method
        returns status ``unstable`` if dt was above its stability limit, 2/λ or for "gear5" 1.05/λ. Above 0.2/λ it
        issues a `RuntimeWarning`.

    Raises
    ------
    TypeError, ValueError
        For invalid arguments.

    Notes
    -----
    Fixed-step methods can miss a contact shorter than `dt` completely. Onset and end of a contact are interpolated
    between two steps, accurate to about (dt/t_c)² t_c. The error of the state has order min(p, 1+s) if the force starts
    like t^s at the onset: s = 0 for a dashpot, 1 for a spring, 1.5 for Hertz. The integrator's own order p is 4 for
    "rk4" and "gear5", 2 for "verlet" and 1 for "symplectic-euler", whose velocities lag by half a step. As an
    exception, elastic contacts between two free flights have the order of "verlet" without gravity and pendula. A
    "gear5" run that starts within a contact has order 2, because the higher derivatives of its velocities are unknown.
    Cost: O(contacts) for "located", O(pairs) per step for a fixed-step method.

    At a driven wall (`Scene.floor`, `ceiling`) "located" certifies the next touch on the path of the wall. It adds the
    series of the path to the series of the contact. With fixed steps such a wall moves by the difference of two
    positions on its path. Contact forces are evaluated with its velocity there, so all orders above hold. A step in
    which the velocity of the path jumps has order 1. While no pair overlaps, the balls move freely to the next touch,
    which is located on the path itself.

    Thermal walls (`granular.walls.Thermal`) with "located": a ball that touches one is thrown back immediately,
    whatever the law of that pair, even during another contact. The hit is a row of the log with zero duration and force
    nan. Between pendula and on a ring, contacts are certified as isolated in the same way. On a ring an island can
    include all pairs. In such scenes rest and permanent contact are not proved, so these runs continue to their end.

    With driven walls, `Trajectory.account` is summed by Simpson's rule in each fixed step. The energy balance then
    closes only to the order of the method, and to order 1 + s at onsets and ends. The dissipated energy is nan while a
    law with memory exerts a force.

    With fixed steps, the orders above also hold on rings and for pendula, and free flights are in closed form. After a
    hit of a thermal wall within a step, the ball continues from the time of the hit on its new parabola. Hits are
    therefore exact to rounding if nothing else touches the ball ("symplectic-euler" has order 1). They have order 2
    during another contact of the ball, and order 1 if a damped force jumps with the velocity.

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
    scene = with_fitted_walls(scene, start, request.end)
    _check_walls(scene, start, request.end)
    if method is None:
        method = "located" if dt is None else "verlet"
    if not isinstance(method, str) or method != "located" or dt is not None:
        return _simulate_fixed_step(scene, laws, request, method, dt, engine, tol=tol, disturbed=disturbed)
    tolerance = check.number("tol", tol, at_least=SMALLEST_TOL, at_most=1e-3)
    with _range_errors_as_value_error(laws.given[0]):
        return solve_soft_spheres(lambda timed: drive(_with_level_stop(
            located.Run(scene, laws, timed, engine, tolerance, disturbed))), request)


def _with_level_stop(run: located.Run) -> Any:
    """Return the run, wrapped if it stops at a level of speed, position or force.

    The wrapper ends the run when the level is passed. Its code is imported only in this case.
    """
    if not isinstance(run.request.until, stop.LEVEL_TYPES):
        return run
    from granular.md.located import levels
    from granular.run.levels import LevelStop

    return LevelStop(run, levels)


def _requested(
    scene: Scene, laws: SceneLaws, start: float, t_end: float | None, engine: str, disturbed: str, **options: Any
) -> Request:
    """Return the checked options that `simulate` and `resume` share.

    `start` is the start time of the run in s, and `options` are the options of `granular.run.drive.checked_request`.
    """
    request = checked_request(scene, start, t_end, **options)
    may_never_end = disturbed != "stop" and options["max_steps"] == DEFAULT_MAX_STEPS
    check_end(scene, t_end, options["until"], options["max_events"],
              dented=lambda: _loses_energy_only_in_dents(scene, laws), elastic=lambda: may_never_end and laws.elastic)
    check.choice("engine", engine, ("auto", "plain", "compiled"))
    check.choice("disturbed", disturbed, located.DISTURBED_OPTIONS)
    return request


def _simulate_fixed_step(
    scene: Scene, laws: SceneLaws, request: Request, method: str, dt: float | None, engine: str, *, tol: float,
    disturbed: str,
) -> Trajectory:
    """Run a scene with a fixed-step method, see `simulate`.

    These methods support neither `tol` nor `disturbed`: other values than the defaults raise `ValueError`.
    """
    from granular.md import fixed

    if check.choice("method", method, ("located", *fixed.INTEGRATORS)) == "located":
        raise ValueError(f"`dt` must be None for method 'located', which has no fixed step, got {dt!r}. Other methods: "
                         f"{', '.join(fixed.INTEGRATORS)}.")
    check.raise_if_true({
        f"`tol` must be left out for method {method!r}, which has a fixed step, got {tol!r}. Give `dt`, or use "
        "method='located'.": tol != DEFAULT_TOL,
        f"`disturbed` must be 'resolve' for method {method!r}, got {disturbed!r}. Use method='located'.":
            disturbed != "resolve",
    })
    time_step = _default_step(scene, laws) if dt is None else check.number("dt", dt, at_least=SMALLEST_DT)
    if request.start + time_step == request.start:
        raise ValueError(f"`dt` must be large enough to advance the clock at t_start = {request.start!r}, got "
                         f"{time_step!r}.")
    runs: list[Any] = []

    def solve(timed: Request) -> Trajectory:
        runs.append(fixed.Run(scene, laws, timed, method, time_step, engine))
        return drive(runs[-1])

    run = solve_soft_spheres(solve, request)
    warning, runs[:] = runs[-1].step_warning, []  # frees memory: `solve` is kept for the energies of contacts
    if warning:
        warnings.warn(warning, RuntimeWarning, stacklevel=4)  # at the caller of `simulate`, a `face`
    if run.status is not Status.unstable and len(run.contacts):
        check_deepest(laws, run.contacts)
    return run


@signature.face
def events(scene: Scene, law: Any, *, max_events: int = check.MAX_INTEGER, **options: Any) -> Iterator[Event]:
    """Yield the contacts of a run as they end, each with the scene at that time.

    Accepts all options of `simulate` except `samples`, `on_event`, `log`, `method` and `dt`. Method "located" is used,
    and the contacts agree with the contacts of `simulate` to rounding. Without a stop condition the iterator can be
    infinite.

    Parameters
    ----------
    scene, law
        As for `simulate`.
    max_events : int
        Maximum number of contacts. By default the number is practically unlimited.
    **options
        Options of `simulate`.

    Yields
    ------
    contact, time, scene : row of the contact log, float, Scene
        The contact, its end time in s, and the state of the scene at that time. With ``disturbed="ignore"`` time and
        state belong to the next event.

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
    others = {"scene", "law", "samples", "on_event", "log", "method", "dt"}
    check.known_names(options, signature.parameters(simulate) - others, "option of md.events", TypeError)
    run: Any = simulate(scene, law, on_event=yield_contacts, max_events=max_events, **options)
    return iter(run)


@signature.face
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

    The result is bitwise identical to an uninterrupted run, also if the first run ended during a contact. It is equal
    to rounding if `until` ended the first run. Laws and tolerance are taken from `trajectory`. See `simulate` for the
    other parameters.

    Parameters
    ----------
    trajectory : Trajectory
        Run of soft spheres by method "located".

    Returns
    -------
    Trajectory
        The continuation. If both runs keep logs, its log includes complete rows of the contacts that had not ended.
        Contacts of a pair are counted from the beginning of the first run: ``until.contact(0, 7)`` still is the seventh
        contact. `max_events` and `max_steps` count from the start of the continuation, `stats` over both runs.

    Raises
    ------
    ValueError
        If `trajectory` is not a run of soft spheres by method "located", has not begun, or is broken. Also if its state
        is inconsistent with its scene, laws and last sample.

    Examples
    --------
    >>> import granular as gr
    >>> run = gr.md.simulate(gr.scenes.three_balls(gap=0.01), gr.LinearDashpot(k=1e7, gamma=0.5), t_end=0.3)
    >>> gr.md.resume(run, t_end=0.4).velocity[-1].round(3).tolist()
    [0.0, 2.346, 8.604]
    """
    state = check.of_kind("trajectory", trajectory, Trajectory, "a granular.Trajectory").state
    check.raise_if_true({
        "`trajectory` must be a run of granular.md.simulate by method 'located' that has begun, got "
        f"{'a run of hard spheres' if trajectory.rule else 'a run without a checkpoint'}. For hard spheres use "
        "granular.edmd.resume.": trajectory.law is None or "origin" not in state,
        "`trajectory` must be a run that can be continued, got status broken. See its message.":
            trajectory.status is Status.broken,
    })
    laws, again = checked_laws(trajectory.law, trajectory.scene), vars(trajectory).get("again")
    request = _requested(
        trajectory.scene, laws, float(trajectory.stats.get("end", trajectory.time[-1])), t_end, engine, disturbed,
        until=until, samples=samples, log=log, max_events=max_events, max_steps=max_steps, on_event=on_event,
        on_progress=on_progress, progress=progress,
    )
    with_fitted_walls(trajectory.scene, request.start, request.end)  # raises if the path of a wall ends before the run
    _check_walls(trajectory.scene, float(check.saved_array(state, "origin", "f", ())), request.end)
    with _range_errors_as_value_error(laws.given[0]):
        return solve_soft_spheres(lambda timed: continue_run(_with_level_stop(located.Run(
            trajectory.scene, laws, timed, engine, math.nan, disturbed,
            again().state if timed.energies and again else state)), trajectory), request)


@contextmanager
def _range_errors_as_value_error(law: Any) -> Iterator[None]:
    """Convert arithmetic errors of the engine to a `ValueError` that names the law.

    These are `ArithmeticError` and `LinAlgError` raised in modules of granular or numpy, including numpy functions
    that a user's law calls. Errors raised in other modules are not converted.
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
    """Raise `ValueError` if two walls at constant speed meet before `end` in s.

    `start` is the start time of the run in s. Driven walls are not checked here, but during the run.
    """
    if scene.is_wall[0] and scene.is_wall[-1] and not scene.driven:
        WallMeeting(scene, start, flattened=True).refuse(end, end)


def _loses_energy_only_in_dents(scene: Scene, laws: SceneLaws) -> bool:
    """Return whether balls on a floor lose energy only in new dents.

    A dent is new where an overlap exceeds all earlier overlaps. This holds under gravity if all laws have memory and
    none depends on the overlap rate. The bounces of such a ball finally become elastic, so no ball comes to rest.
    """
    lossless = all(law.memory and not law.rate_dependent for law in laws.each)
    return bool(scene.gravity > 0.0 and scene.is_wall[0] and lossless)


def _default_step(scene: Scene, laws: SceneLaws) -> float:
    """Return the default time step in s, see `STEPS_PER_CONTACT`.

    Raises `ValueError` if no contact duration can be estimated.
    """
    from granular.md.time_step import expected_rate

    try:
        rate = expected_rate(scene, laws)
    except ArithmeticError:  # the law fails at an overlap far outside its range
        rate = math.nan
    if not 0.0 < rate < math.inf:
        raise ValueError(f"`dt` must be given in s, got None. The duration of a contact does not follow from "
                         f"{laws.given[0]!r}.")
    return math.pi / rate / STEPS_PER_CONTACT

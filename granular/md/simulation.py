"""`granular.md.simulate`: soft spheres, Newton's equation with a contact force."""

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
from granular.run.drive import Request, drive, go_on, in_time, requested
from granular.run.trajectory import Status, Trajectory
from granular.run.until import check_end
from granular.scene.places import Closing, checked, fitted
from granular.scene.state import Scene

SHORTEST = 1e-60
"""Least `dt` in s: its fifth power, which "gear5" needs, is a number."""
EXACT = 1e-16
"""Default `tol`."""
FINEST = 1e-17
"""Least `tol`: less only costs steps, since sums of floats are good to 1e-16."""
STEPS = 20_000_000
"""Default of `max_steps`."""
STEPS_PER_CONTACT = 500
"""Default resolution of the shortest contact; halving an order-1 error costs twice as many."""


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
    max_steps: int = STEPS,
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    engine: str = "auto",
    method: str | None = None,
    dt: float | None = None,
    tol: float = EXACT,
    disturbed: str = "resolve",
) -> Trajectory:
    """Run a scene as soft spheres: m_i a_i = F_(i-1) - F_i - m_i g + f_i, with F = max(0, law) where ξ > 0, else 0.

    Parameters
    ----------
    scene : Scene
        Where it starts; overlaps (negative gaps) are allowed.
    law : force law or sequence of them
        One for all pairs, or one per pair from the bottom up; that of a pair at a thermal wall is not asked.
    t_end, until : float, stop condition, optional
        End time in s, and a condition from `granular.until`. Without either the run goes on until nothing can
        follow, or to the limits below; beside driven or thermal walls, on a ring and of pendula one of them is needed,
        for another contact may always follow, and on a floor under laws like `WaltonBraun` alone, by which balls bounce
        in their dents forever.
        Elastic balls that fall back to a floor, or fly between two walls, need `t_end`, `until`, `max_events` or
        `max_steps` too. Walls that move towards each other need a `t_end` before they meet.
    t_start : float
        Time in s of the scene's instant.
    samples : None, int, "contacts" or array
        Rows to keep: first and last, that many spread from `t_start` to `t_end`, or at these times in s; "contacts" for
        some before, during and after every contact, its onset and end among them. For these, and a number of rows
        without `t_end`, the run is solved twice. A run that
        ends before the last of them keeps its end as the last row.
    log : bool or path
        Whether to keep one row per contact in ``contacts``. Or a file ``"run.npy"``, not there yet, into which rows
        are written block by block while the run goes on: it needs no memory for them, and whatever ends the process,
        blocks written are readable; ``contacts`` stays empty, `Trajectory.contact_batches` reads them.
    max_events, max_steps : int, optional
        Stop with status ``max_events`` after that many contacts or steps, by default 1 000 000 and 20 000 000; also
        where contacts under laws that are no powers creep or chatter, so that some thousand trial steps bring the run
        on by next to nothing.
    on_event : callable, optional
        Called with each row of the contact log, in batches, in the order in which contacts end; of fixed steps, those
        that end within one step in any order.
    on_progress : callable, optional
        ``on_progress(reached, count)`` now and then: the time reached in s, and the number of contacts so far.
    progress : bool
        Show how far it is, from 2 s on: on standard error, as a bar where tqdm is installed.
    engine : {"auto", "plain", "compiled"}
        Interpreted or compiled by numba (extra ``fast``); the same bits. "auto" starts interpreted and goes on
        compiled once that is worth it and the law compiles; the reason is in `stats` if it does not.
    method : {"located", "verlet", "symplectic-euler", "rk4", "gear5"}, optional
        "located" finds every event (touch, end of the force, new push) to rounding: the default and the judge. The
        others are fixed-step integrators, as in DEM codes; rows between two steps are one shorter step on a copy.
        Where only `dt` is given, "verlet".
    dt : float, optional
        Time step in s of a fixed-step method; default 1/500 of the shortest expected contact.
    tol : float
        Truncation error of a step of "located" under nonlinear laws, relative to speed and overlap of the moment;
        from 1e-17, which is below rounding, to 1e-3.
    disturbed : {"resolve", "stop", "ignore"}
        What "located" does where an overlap begins beside another: "resolve" follows both together, exactly; "stop"
        ends there with status ``disturbed``, the horizon up to which every contact was isolated; "ignore" takes every
        contact as if it were isolated, which is soft event-driven simulation: a neighbour that touches early begins
        when the contact is over, with gap 0. Contacts that have no end of their own (at rest), and overlaps at the
        start, are resolved in any case. Pendula are not to be ignored: set back to gap 0, they would have another
        energy.

    Returns
    -------
    Trajectory
        Of a fixed-step method with status ``unstable`` if dt was beyond the stability limit 2/λ of the contacts that
        took place; a `RuntimeWarning` from 0.2/λ on.

    Raises
    ------
    TypeError, ValueError
        For misuse, with a sentence.

    Notes
    -----
    Fixed-step methods can miss a contact shorter than `dt` altogether; begin and end of a contact are interpolated
    between two steps, good to about (dt/t_c)² t_c. The error of the state falls with order min(p, 1+s), where the force
    starts like t^s (s = 0 for a dashpot, 1 for a spring, 1.5 for Hertz) and p is the integrator's own order: 4 for
    "rk4" and "gear5", 2 for "verlet", 1 for "symplectic-euler", whose velocities are half a step late. Elastic contacts
    from flight to flight, without gravity or swing, do not show that: there it has the order of "verlet". "gear5"
    begins a run within a contact without the higher derivatives of its velocities, hence with order 2. Time: of
    "located", O(contacts); of a fixed-step method, O(pairs) per step.

    Beside a driven wall (`Scene.floor`, `ceiling`) "located" certifies the next touch on the path itself, and adds the
    path's series to that of the contact. In a fixed step such a wall drifts by the difference of two places on its
    path, and forces see its velocity there, so all orders above stay; where the velocity of the path jumps within a
    step, the step is of order 1. While all pairs are open the balls fly to the next touch, found on the path itself.

    "located" between thermal walls (`granular.walls.Thermal`): a ball that touches one is thrown back at once, whatever
    the law of that pair, in the midst of another contact too; its hit is a row of the log of no duration and no largest
    force (nan). Between pendula, and on a ring, contacts are certified to be isolated as elsewhere; on a ring an island
    of pushing pairs may go all around. No proof of rest or of binding is made in such scenes: they go on to the end.

    Where walls are driven, the ledger behind `Trajectory.account` is summed by Simpson's rule in each fixed step: the
    account closes to the order of the method only, and to 1 + s at onsets and ends; what is dissipated is nan while a
    law with memory pushes.

    Fixed steps on a ring and of pendula keep their orders, and open scenes fly in closed form. After a hit of a thermal
    wall within a step the ball goes on, from the hit's own time, on the parabola that it leaves on. So hits are right
    to rounding where nothing else touches the ball ("symplectic-euler" knows no parabolas: order 1), of order 2 beside
    a contact, and 1 where a damped force jumps with the speed.
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
    finest = check.number("tol", tol, at_least=FINEST, at_most=1e-3)
    with _in_range(laws.given[0]):
        return in_time(lambda asked: drive(_stopping(
            located.Run(scene, laws, asked, engine, finest, disturbed))), request)


def _stopping(run: located.Run) -> Any:
    """Return the run; if a level ends it, one that is watched: what watches is loaded then."""
    if not isinstance(run.request.until, stop.LEVELS):
        return run
    from granular.md.located import levels
    from granular.run.levels import Watched

    return Watched(run, levels)


def _requested(
    scene: Scene, laws: SceneLaws, start: float, t_end: float | None, engine: str, disturbed: str, **options: Any
) -> Request:
    """Check the options that `simulate` and `resume` share."""
    request = requested(scene, start, t_end, **options)
    endless = disturbed != "stop" and options["max_steps"] == STEPS
    check_end(scene, t_end, options["until"], options["max_events"], dented=lambda: _dented(scene, laws),
              elastic=lambda: endless and laws.elastic)
    check.choice("engine", engine, ("auto", "plain", "compiled"))
    check.choice("disturbed", disturbed, located.DISTURBED)
    return request


def _stepped(
    scene: Scene, laws: SceneLaws, request: Request, method: str, dt: float | None, engine: str, *, tol: float,
    disturbed: str,
) -> Trajectory:
    """Run a scene with a fixed step, which has neither tolerance nor another way to take contacts."""
    from granular.md import fixed

    if check.choice("method", method, ("located", *fixed.INTEGRATORS)) == "located":
        raise ValueError(f"dt is {dt!r}: method 'located' has no fixed step; choose {', '.join(fixed.INTEGRATORS)}.")
    check.refuse({
        f"tol is {tol!r}: method {method!r} has no tolerance; give dt, or choose 'located'.": tol != EXACT,
        f"disturbed is {disturbed!r}: method {method!r} resolves every contact; choose 'located'.":
            disturbed != "resolve",
    })
    step = _default_step(scene, laws) if dt is None else check.number("dt", dt, at_least=SHORTEST)
    if request.start + step == request.start:
        raise ValueError(f"dt is {step!r}: at t_start = {request.start!r} a larger step is needed to advance the clock "
                         "at all.")
    made: list[Any] = []

    def solve(asked: Request) -> Trajectory:
        made.append(fixed.Run(scene, laws, asked, method, step, engine))
        return drive(made[-1])

    run = in_time(solve, request)
    if made[-1].doubt:
        warnings.warn(made[-1].doubt, RuntimeWarning, stacklevel=4)  # at the caller of `simulate`, a `face`
    if run.status is not Status.unstable and len(run.contacts):
        check_deepest(laws, run.contacts)
    return run


@check.face
def events(scene: Scene, law: Any, *, max_events: int = check.LARGEST, **options: Any) -> Iterator[Event]:
    """Yield the contacts of a run one at a time as they end, each with the scene then: for demos and debuggers.

    ``for contact, time, scene in gr.md.events(scene, law, t_end=1.0)``: the row of the log, the time in s, and a
    `Scene` that stands so then (with ``disturbed="ignore"``, at the next event). By method "located", and to rounding
    the contacts of `simulate`, whose options are taken but for `samples` and `on_event`; where nothing ends the run, it
    goes on for as long as it is asked.
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
    max_steps: int = STEPS,
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    engine: str = "auto",
    disturbed: str = "resolve",
) -> Trajectory:
    """Go on from the end of a run of `simulate` by method "located", in the middle of contacts too, bit for bit, or, if
    `until` ended it, to rounding.

    Laws and tolerance are those of `trajectory`. The contact log begins anew, with the contacts that were under way
    whole (if both runs have logs); contacts of a pair are counted from the beginning (``until.contact(0, 7)`` is still
    the seventh), `max_events` and `max_steps` from here, `stats` over both. See `simulate` for the parameters.

    Raises
    ------
    ValueError
        If `trajectory` is no run of soft spheres by method "located", stopped before it began, or is broken; or if its
        state cannot be that of its scene, laws and last row.
    """
    state = check.of_kind("trajectory", trajectory, Trajectory, "a granular.Trajectory").state
    check.refuse({
        "trajectory cannot be gone on from: one from granular.md.simulate by method 'located' that has begun is "
        "needed; for hard spheres see granular.edmd.resume.": trajectory.law is None or "origin" not in state,
        "trajectory is broken: nothing follows it; see its message.": trajectory.status is Status.broken,
    })
    laws = checked_laws(trajectory.law, trajectory.scene)
    request = _requested(
        trajectory.scene, laws, float(trajectory.stats.get("end", trajectory.time[-1])), t_end, engine, disturbed,
        until=until, samples=samples, log=log, max_events=max_events, max_steps=max_steps, on_event=on_event,
        on_progress=on_progress, progress=progress,
    )
    fitted(trajectory.scene, request.start, request.end)  # says so if a path ends before
    _check_walls(trajectory.scene, float(check.held(state, "origin", "f", ())), request.end)
    with _in_range(laws.given[0]):
        return in_time(lambda asked: go_on(_stopping(
            located.Run(trajectory.scene, laws, asked, engine, math.nan, disturbed, state)), trajectory), request)


@contextmanager
def _in_range(law: Any) -> Iterator[None]:
    """Say in a sentence that the engine's own numbers ran out of range; what a user's law raises passes through."""
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
            f"law is {law!r}, …: rates or overlaps of its contacts in this scene are beyond the range of numbers "
            f"({error}); coefficients, masses and speeds in SI units and of usual size are needed."
        ) from error


def _check_walls(scene: Scene, start: float, end: float) -> None:
    """Raise if walls at constant speed meet before the end; of driven ones the run takes care."""
    if scene.is_wall[0] and scene.is_wall[-1] and not scene.driven:
        Closing(scene, start, flattened=True).refuse(end, end)


def _dented(scene: Scene, laws: SceneLaws) -> bool:
    """Return whether balls fall on a floor and lose energy only where an overlap exceeds all before it: each ends in an
    elastic bounce within its own dent, and none comes to rest."""
    lossless = all(law.memory and not law.rate_dependent for law in laws.each)
    return bool(scene.gravity > 0.0 and scene.is_wall[0] and lossless)


def _default_step(scene: Scene, laws: SceneLaws) -> float:
    from granular.md.time_step import expected_rate

    try:
        rate = expected_rate(scene, laws)
    except ArithmeticError:  # of a law, at an overlap far beyond those it is made for
        rate = math.nan
    if not 0.0 < rate < math.inf:
        raise ValueError(f"dt is None: the duration of a contact cannot be told from {laws.given[0]!r}; give dt in s.")
    return math.pi / rate / STEPS_PER_CONTACT

"""Public functions of the hard-sphere engine."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular._engine.kernels import missing_compiler_reason
from granular._engine.package import CROSS_ROOM_LOADERS
from granular.edmd.checkpoint import restored_state
from granular.edmd.physics import GROUP, RUN_OPTIONS, TIE_ORDERS, Physics, check_scene, checked
from granular.edmd.run import Run
from granular.edmd.state import State
from granular.laws import rules
from granular.laws.rules import Rule
from granular.run import until as stop
from granular.run.contact_log import Event, yield_contacts
from granular.run.drive import Request, checked_request, continue_run, drive, solve_with_sample_times
from granular.run.trajectory import Status, Trajectory
from granular.run.until import check_end
from granular.scene import Scene, checked as a_scene
from granular.scene.places import with_fitted_walls

if TYPE_CHECKING:
    from granular.edmd.watch import Watch

ENGINE_NAMES = ("auto", "sorted", "compiled")


@signature.face
def simulate(
    scene: Scene,
    rule: Rule | list[Rule] | tuple[Rule, ...],
    *,
    t_end: float | None = None,
    until: stop.Until | None = None,
    t_start: float = 0.0,
    samples: int | str | ArrayLike | None = None,
    log: bool | str | PathLike[str] = True,
    max_events: int | None = None,
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    engine: str = "auto",
    ties: str = "left",
    seed: int = 0,
    collapse: str = "stop",
    merge_below: float | None = None,
    tc: float = 0.0,
    elastic_below: float = 0.0,
    watch: Any = None,
) -> Trajectory:
    """Run a scene as hard spheres, with instantaneous collisions.

    Between collisions the balls move freely, and each collision has a coefficient of restitution.

    Parameters
    ----------
    scene : Scene
        Initial state. No gap may be negative.
    rule : callable or list of callables
        Coefficient of restitution ``rule(speed, pair)`` in [0, 1], such as `granular.ConstantRestitution`. One rule for
        all pairs, or one per pair from the bottom up. With 0 for all pairs, balls stick together after a collision and
        move as one body, or rest on the floor. 0 for only some of the pairs raises `ValueError`.
    t_end : float, optional
        End time in s. Collisions at that time are included. Without `t_end` and `until` the run ends when no collision
        can follow, at an inelastic collapse, or at `max_events`. Scenes whose collisions provably never end, such as an
        elastic ball above a floor, need one of the three parameters.
    until : condition, optional
        Stop condition from `granular.until`. The run ends at `until` or `t_end`, whichever comes first.
    t_start : float
        Time of the initial state in s. Defaults to 0.
    samples : None, int, "contacts" or array of float
        States to record. None records the first and the last state, an int that number of evenly spaced times from
        `t_start` to `t_end`, an array the given times (s, increasing). "contacts" records a few times around every
        contact, including its onset and end, which are here the states just before and at each collision. For
        "contacts", and for an int without `t_end`, the run is computed twice. Samples are right-continuous: a collision
        at the time of a sample has already acted. The sample at `t_start` is the initial state. A run that does not end
        at `t_end` has one more sample at its end.
    log : bool or path
        Whether to record one row per contact in ``contacts``. A path ``"run.npy"`` of a file that does not exist yet
        writes the rows to this file in blocks during the run. The rows then need no memory, and written blocks are
        readable even if the process is killed. ``contacts`` stays empty, and `Trajectory.contact_batches` reads the
        file. Defaults to True.
    max_events : int, optional
        Maximum number of collisions. A run that reaches it has the status `max_events`. Defaults to 1 000 000.
    on_event : callable, optional
        ``on_event(row)``, called after each collision with its row of the contact log.
    on_progress : callable, optional
        ``on_progress(t, events)``, called repeatedly with the time reached in s and the number of collisions.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.
    engine : str
        "sorted" (the reference), "compiled" (numba, bitwise identical results, only for constant restitution and
        sequential ties) or "auto" (default). "auto" starts with "sorted" and switches to "compiled" as soon as
        compilation pays off. This depends on the number of past collisions, and on the number expected until `t_end`
        or for the size of the scene. A sample counts as 1/16 collision per ball.
    ties : str
        Rule for simultaneous collisions. "left" (default, the lowest pair first), "right" and "random" (reproducible by
        `seed`) apply them one after the other. "newton" and "reflect" (one constant restitution for all pairs) and
        "poisson" (any restitution) solve a touching group as a whole. No rule is physically distinguished, because
        touching hard spheres have no unique solution.
    seed : int
        Seed for ``ties="random"``. Defaults to 0.
    collapse : str
        Treatment of an inelastic collapse. "stop" (default) ends the run. With "merge", two bodies that collide at less
        than `merge_below` continue as one body, so that no collapse can happen.
    merge_below : float, optional
        Speed in m/s for ``collapse="merge"``. Defaults to 1/100 of the speed scale of the scene. The result depends on
        this speed, which is reported in ``stats``.
    tc : float
        Contact duration in s of the TC model: a collision is elastic if one of its bodies has collided less than `tc`
        before (Luding & McNamara, Granular Matter 1, 113 (1998)). Defaults to 0, which disables the model.
    elastic_below : float
        Collisions at less than this speed (m/s) are elastic. Defaults to 0, which disables the rule.
    watch : law or list of laws, optional
        Force law, or one per pair. For every collision, the duration of an isolated contact under this law at the same
        approach speed is computed. Collisions whose contacts would overlap in time with a contact of a neighbouring
        pair are counted in ``stats["watched"]``. ``first_disturbed`` gives time and pair of the first overlap. This is
        a warning, not a proof: once two soft contacts overlap, later collisions happen elsewhere. On a floor the
        duration without gravity is used.

    Returns
    -------
    Trajectory
        Its status is `time`, `until`, `quiet`, `collapse`, `bounded` or `max_events`, or `broken` if the final state is
        invalid, which every run checks. Walls that close on the balls end the run as a `collapse` when no space is left
        between them, at the time given in the message.

    Raises
    ------
    TypeError, ValueError
        For invalid arguments. Examples are the path of a driven wall that ends before the run, and a run with a driven
        wall without any end condition. Physical outcomes are reported as a status.

    Notes
    -----
    For a driven wall (``floor=``, ``ceiling=`` of the scene) the next hit is certified. A ball whose rebound is below
    the rounding error comes to rest on the wall. It moves with the wall, without events, until no acceleration presses
    it on the wall or the wall velocity jumps. A run with a driven wall is therefore not ended by an inelastic collapse.
    It is never quiet, and needs `t_end`, `until` or `max_events`. Use ``collapse="merge"`` for piles on a driven wall.
    Even then, a single ball bounces on the wall until its rebounds are below the rounding error. Balls that merge while
    forces press them together in mid-air move as one body. For moving walls, `Trajectory.account` returns the work of
    the walls.

    A thermal wall reflects a ball with a random speed, and the rule of this pair is ignored. The hit acts on its own,
    even if other balls touch this ball, and is not part of a collapse. The ball of a thermal wall never rests.
    `Trajectory.account` contains the heat of each wall. ``stats["given"]`` contains the momentum (N s) that each
    thermal wall transferred to the balls, directed away from the wall.

    On a ring, velocities are stored relative to the centre of mass, so they keep their digits however slow the balls
    become. The sum of the gaps is conserved up to rounding. Forces on a ring raise `ValueError`.

    The state of pendula consists of gaps and their rates of change, which oscillate with the angular frequency Ω
    between collisions. An inelastic collapse of pendula is not detected. An infinite sequence of collisions is followed
    until its speeds are below 1e-154 m/s. From then onwards, the gaps of touching balls have the rate 0. With
    ``collapse="merge"``, and for balls that stick, touching balls with rate 0 are hit as one body. They stay together
    if the pendula touch in their rest positions. Otherwise they separate immediately.

    The cost of a collision is O(log n). The state consists of gaps, so balls never change their order. The zero of time
    is moved during the run, so late times keep their digits. A collapse is reported only after a test that classifies
    it, see `granular.edmd.collapse`.

    Examples
    --------
    A small ball on a large ball falls on a floor (ε = 0.7). The run stops before the second contact with the floor:

    >>> import granular as gr
    >>> scene = gr.scenes.three_balls()
    >>> run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), until=gr.until.contact(pair=0, nth=2))
    >>> run.contacts["pair"].tolist(), run.contacts["t_begin"].round(4).tolist()
    ([0, 1], [0.3193, 0.3193])
    >>> run.status.name, run.velocity[-1].round(3).tolist()
    ('until', [0.0, -2.183, 1.544])
    """
    start = check.number("t_start", t_start)
    physics_of = partial(checked, rule=rule, collapse=collapse, merge_below=merge_below, ties=ties, seed=seed, tc=tc,
                   elastic_below=elastic_below)
    check_end(a_scene(scene), t_end, until, max_events, soft=False, elastic=lambda: physics_of(scene).elastic)
    scene = with_fitted_walls(scene, start, math.inf if t_end is None else check.number("t_end", t_end))
    physics = physics_of(scene)
    request = checked_request(
        scene, start, t_end, until=until, samples=samples, log=log, max_events=max_events, on_event=on_event,
        on_progress=on_progress, progress=progress,
    )
    queue = checked_engine(engine, physics)

    def solve(timed_request: Request) -> Trajectory:
        watcher = None if watch is None else _watch(watch, scene)
        return drive(_run_until_level(Run(physics, State.of(physics, start), queue, timed_request, watcher)))

    return solve_with_sample_times(solve, request)


def _run_until_level(run: Run) -> Any:
    """Return the run, in a wrapper if it stops when an observable reaches a level.

    The modules of the wrapper `LevelStop` are imported only then.
    """
    if not isinstance(run.request.until, stop.LEVEL_TYPES):
        return run
    from granular.edmd import levels
    from granular.run.levels import LevelStop

    return LevelStop(run, levels)


@signature.face
def events(
    scene: Scene, rule: Rule | list[Rule] | tuple[Rule, ...], *, max_events: int = check.MAX_INTEGER, **options: Any
) -> Iterator[Event]:
    """Yield the collisions of a run one at a time, with the scene after each.

    Intended for demonstrations and debugging. The collisions are bitwise identical to the collisions of `simulate`.

    Parameters
    ----------
    scene : Scene
        Initial state.
    rule : callable or list of callables
        Coefficient of restitution, see `simulate`.
    max_events : int
        Maximum number of collisions. By default the number is practically unlimited, and without a stop condition the
        iterator does not end.
    **options
        All options of `simulate` except `samples`, `on_event` and `log`.

    Yields
    ------
    Event
        A tuple ``(contact, time, scene)``: the row of the contact log, the time in s, and a `Scene` with the state
        right after the collision.

    Raises
    ------
    TypeError, ValueError
        For unknown options and invalid arguments.

    Examples
    --------
    >>> import granular as gr
    >>> rule = gr.ConstantRestitution(0.7)
    >>> for contact, time, scene in gr.edmd.events(gr.scenes.three_balls(), rule, max_events=2):
    ...     print(contact["pair"], round(time, 4), scene.velocity.round(3).tolist())
    0 0.3193 [0.0, 2.192, -3.132]
    1 0.3193 [0.0, 2.183, 5.91]
    """
    check.known_names(options, signature.parameters(simulate) - {"scene", "rule", "samples", "on_event", "log"},
                 "option of edmd.events", TypeError)
    run: Any = simulate(scene, rule, on_event=yield_contacts, max_events=max_events, **options)
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
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    engine: str = "auto",
    watch: Any = None,
) -> Trajectory:
    """Continue a run of `simulate` from its end.

    Both parts together are bitwise identical to the uninterrupted run. Rules and options are taken from `trajectory`,
    except `watch`.

    Parameters
    ----------
    trajectory : Trajectory
        Result of `simulate` or `resume`.
    t_end, until, samples, log, on_event, on_progress, progress, engine
        See `simulate`. The contact log starts empty. Collisions of a pair are counted from the beginning of the first
        run, so ``until.contact(0, 7)`` is still its seventh contact.
    max_events : int, optional
        Maximum number of collisions from here on. Defaults to 1 000 000.
    watch : law or list of laws, optional
        See `simulate`. It has to be given again, and then continues the counts of `trajectory`, or starts from 0 if
        `trajectory` had none.

    Returns
    -------
    Trajectory
        The continued part only.

    Raises
    ------
    ValueError
        If `trajectory` is not a hard-sphere run, if it is broken, or if its state contradicts its last sample. Also if
        it ended in an inelastic collapse, or in a possible collapse (status `bounded`). Two such runs can be continued:
        a run whose balls all rest until `t_end`, and a run that `max_events` ended.

    Examples
    --------
    >>> import granular as gr
    >>> first = gr.edmd.simulate(gr.scenes.three_balls(), gr.ConstantRestitution(0.7), t_end=0.5)
    >>> second = gr.edmd.resume(first, t_end=0.8)
    >>> len(first.contacts), len(second.contacts)
    (2, 1)
    """
    check.of_kind("trajectory", trajectory, Trajectory, "a granular.Trajectory")
    _check_continuable(trajectory)
    saved, scene = trajectory.state, trajectory.scene
    start = float(check.saved_array(saved, "start", "f", ()))
    scene = with_fitted_walls(scene, start, math.inf if t_end is None else check.number("t_end", t_end))
    check_scene(scene)
    physics = Physics(scene, rules.checked(trajectory.rule, scene.gap), {name: saved.get(name) for name in RUN_OPTIONS})
    check_end(scene, t_end, until, max_events, soft=False, elastic=lambda: physics.elastic)
    state = restored_state(physics, saved)
    request = checked_request(
        scene, state.time(state.run.now), t_end, until=until, samples=samples, log=log,
        max_events=max_events, on_event=on_event, on_progress=on_progress, progress=progress,
    )
    queue, states = checked_engine(engine, physics), [state]

    # `solve` is called twice if the sample times depend on the run; the first call uses up the restored state
    def solve(timed_request: Request) -> Trajectory:
        watcher = None if watch is None else _watch(watch, scene, saved)
        initial_state = states.pop() if states else restored_state(physics, saved)
        run = Run(physics, initial_state, queue, timed_request, watcher)
        if "collapse_time" in saved:
            run.rest(check.saved_array(saved, "collapse_pair", "i", (), 0, scene.n_pairs - 1),
                     check.saved_array(saved, "collapse_time", "f", ()))
        return continue_run(_run_until_level(run), trajectory)

    return solve_with_sample_times(solve, request)


def _check_continuable(trajectory: Trajectory) -> None:
    """Raise `ValueError` if a trajectory cannot be continued."""
    status, saved = trajectory.status, trajectory.state
    check.raise_if_true({
        "`trajectory` must be a run of hard spheres from granular.edmd, got "
        f"{'a run of soft spheres' if trajectory.law else 'a run without a saved state'}.":
            trajectory.rule is None or not saved,
        "`trajectory` must be a run that can be continued, got an inelastic collapse. Run again with collapse='merge' "
        "or tc=.": status is Status.collapse and "collapse_time" not in saved,
        "`trajectory` must be a run that can be continued, got a possible inelastic collapse. Run again with "
        "collapse='merge' or tc=.": status is Status.bounded and "zoom_gap" not in saved,
        "`trajectory` must be a run that can be continued, got status broken. See its message.":
            status is Status.broken,
    })


def _watch(law: Any, scene: Scene, saved: Mapping[str, Any] | None = None) -> Watch:
    """Return the `Watch` of one or several force laws, importing its module.

    `saved` is the state of the run to continue.
    """
    from granular.edmd.watch import Watch

    return Watch(law, scene, CROSS_ROOM_LOADERS["contact_durations"](), saved)


def checked_engine(engine: str, physics: Physics) -> str:
    """Return the engine of a run, after checking that the run can use it.

    The result is "sorted", "compiled" or "auto". "auto" means that the run can switch to the compiled engine. Raises
    `ValueError` if "compiled" is not possible for the rules or ties, and `ImportError` if numba cannot be used.
    """
    if isinstance(engine, str) and engine == "sorted":
        return engine
    name, reason, missing = check.choice("engine", engine, ENGINE_NAMES), "", missing_compiler_reason()
    if physics.rule is not None:
        reason = "every rule must be a ConstantRestitution"
    elif TIE_ORDERS[physics.options["ties"]] == GROUP:
        reason = f"ties={physics.options['ties']!r} runs only interpreted"
    if name == "compiled" and reason:
        raise ValueError(f"`engine` must be 'sorted' or 'auto' here, got 'compiled': {reason}.")
    if name == "compiled" and missing:
        raise ImportError(f"`engine` cannot be 'compiled': {missing}.")
    return "sorted" if reason or missing else name

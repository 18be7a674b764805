"""The public face of the hard-sphere engine: check the arguments, run, and say how it ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from granular._engine import check
from granular._engine.kernels import no_compiler
from granular._engine.package import CROSS_ROOM_LOADERS
from granular.edmd.physics import GROUP, OPTIONS, ORDER, Physics, check_scene, checked
from granular.edmd.run import Run
from granular.edmd.state import State
from granular.laws import rules
from granular.laws.rules import Rule
from granular.run import until as stop
from granular.run.contact_log import Event, one_by_one
from granular.run.drive import Request, drive, go_on, in_time, requested
from granular.run.trajectory import Status, Trajectory
from granular.run.until import check_end
from granular.scene import Scene, checked as a_scene
from granular.scene.places import fitted

if TYPE_CHECKING:
    from granular.edmd.watch import Watch

ENGINES = ("auto", "sorted", "compiled")


@check.face
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
    """Run `scene` as hard spheres: free flight and instantaneous collisions with a coefficient of restitution.

    Parameters
    ----------
    scene : Scene
        Initial state; no gap may be negative.
    rule : callable or list of callables
        Coefficient of restitution ``rule(speed, pair)`` in [0, 1], such as `granular.ConstantRestitution`; one for
        all pairs, or one per pair from the bottom up. 0 for all pairs means balls that stick (0 for some of them is
        refused): they move on as one, are hit, and rest on the floor.
    t_end : float, optional
        End time in s; collisions at that time still act. Without `t_end` and `until` the run goes on until no
        collision can follow, until an inelastic collapse, or until `max_events`. Scenes whose collisions provably
        never end, such as an elastic ball above a floor, need one of the three.
    until : condition, optional
        From `granular.until`; whichever comes first, this or `t_end`.
    t_start : float
        Time of the initial state in s.
    samples : None, int, "contacts" or array
        Rows to keep: None for the first and the last, an int for that many spread evenly from `t_start` to `t_end`,
        an array for those times (s, increasing); "contacts" for a few about every contact, its onset and end among
        them, here just before and at each collision. For these, and a number of rows without `t_end`, the run is
        solved twice. Rows are right-continuous: a collision at that time has acted
        (the row at `t_start` is the initial state). A run that ends otherwise than at `t_end` has one more row, at
        its end.
    log : bool or path
        Whether to keep one row per contact in ``contacts``. Or a file ``"run.npy"``, not there yet, into which rows
        are written block by block while the run goes on: it needs no memory for them, and whatever ends the process,
        blocks written are readable; ``contacts`` stays empty, `Trajectory.contact_batches` reads them.
    max_events : int, optional
        Maximum number of collisions; a run that reaches it has the status `max_events`. Defaults to 1 000 000.
    on_event : callable, optional
        ``on_event(row)`` after each collision, with its row of the log.
    on_progress : callable, optional
        ``on_progress(t, events)`` now and then.
    progress : bool
        Show how far it is, from 2 s on: on standard error, as a bar where tqdm is installed.
    engine : str
        "sorted" (the reference), "compiled" (numba; the same results bit for bit; constant restitution and sequential
        ties only), or "auto": begins with the reference and goes over to compiled as soon as the collisions made,
        or those to expect until `t_end` or of a large scene, pay for it; a sample counts as a sixteenth of one a ball.
    ties : str
        What simultaneous collisions do. One after the other: "left" (the lowest pair first), "right", or "random"
        (reproducible by `seed`). A touching group as a whole: "newton" and "reflect" (one constant restitution for
        all pairs), "poisson" (any). No rule is right by nature: touching hard spheres have no unique answer.
    seed : int
        For ``ties="random"``.
    collapse : str
        What to do about an inelastic collapse: "stop", or "merge": pairs that collide at less than `merge_below` move
        on as one, so that no collapse can happen.
    merge_below : float, optional
        Speed in m/s for ``collapse="merge"``; 1/100 of the scene's own speed scale if not given. The result depends
        on it (it is in ``stats``).
    tc : float
        Contact duration in s of the TC model: a collision is elastic if one of its bodies has collided less than `tc`
        before (Luding & McNamara, Granular Matter 1, 113 (1998)). 0: not used.
    elastic_below : float
        Collisions at less than this speed (m/s) are elastic. 0: not used.
    watch : law or list of laws, optional
        Force law, one for all pairs or one per pair, for a warning: collisions that would overlap in time with one of a
        neighbouring pair, were each a contact as long as an isolated one of this law at that speed, are counted in
        ``stats["watched"]``, and ``first_disturbed`` says when and where the first two are. A warning, not a proof: it
        looks at where hard balls collide, and soft ones collide elsewhere once two of their contacts share a time. On
        a floor the duration is that without gravity.

    Returns
    -------
    Trajectory
        With status `time`, `until`, `quiet`, `collapse`, `bounded` or `max_events`; `broken` if the last state is none
        that there can be, for every run looks. Walls that close on the balls end the run as a `collapse` when no space
        is left between them; the message says when.

    Raises
    ------
    TypeError, ValueError
        For arguments that do not fit, with a sentence: also a driven wall's path that ends before the run, or nothing
        that says when a run beside it is over. What goes wrong in the physics is a status.

    Notes
    -----
    Beside a driven wall (``floor=``, ``ceiling=`` of the scene) the next hit is certified, and a ball whose rebound is
    no more than rounding rides: with the wall, without events, until nothing presses it on any more or the wall's
    velocity jumps. So one ball that comes to rest there is no end of the run, and neither is any other collapse: give
    ``collapse="merge"`` for piles, of which a single ball still bounces on the wall to its end. Such a run is never
    quiet: it needs `t_end`, `until` or `max_events`. Balls that forces press together in mid-air move as one once they
    have merged. Where walls move, `Trajectory.account` says what work they did.

    A thermal wall lets a ball that hits it leave with a speed drawn anew; the rule of that pair is not asked. It acts
    alone, also where balls touch, and is no part of a collapse; its ball never rests. `Trajectory.account` has the heat
    of each wall, and ``stats["given"]`` the momentum (N s) that both thermal walls gave the balls, away from them.

    On a ring velocities are kept relative to the centre of mass, so they have their digits however much slower the
    balls become; the sum of the gaps is kept to rounding. Forces are refused there.

    Pendula are followed in gaps and rates, which between collisions turn with Ω. No collapse of theirs is judged: a
    sequence that would be infinite goes on until its speeds are below 1e-154 m/s, then the balls that touch go on
    without a rate. With ``collapse="merge"`` and balls that stick, those that touch without a rate share the momentum
    of a hit; they stay together where pendula touch at rest, and part at once where they do not.

    One collision costs O(log n). The state is gaps, not positions, so balls never change order; the clock is re-based,
    so late times cost no digits. A collapse is a verdict, never an impression: see `granular.edmd.collapse`.
    """
    start = check.number("t_start", t_start)
    made = partial(checked, rule=rule, collapse=collapse, merge_below=merge_below, ties=ties, seed=seed, tc=tc,
                   elastic_below=elastic_below)
    check_end(a_scene(scene), t_end, until, max_events, elastic=lambda: made(scene).elastic)
    scene = fitted(scene, start, math.inf if t_end is None else check.number("t_end", t_end))
    physics = made(scene)
    request = requested(
        scene, start, t_end, until=until, samples=samples, log=log, max_events=max_events, on_event=on_event,
        on_progress=on_progress, progress=progress,
    )
    queue = checked_engine(engine, physics)

    def solve(asked: Request) -> Trajectory:
        watching = None if watch is None else _watch(watch, scene)
        return drive(_stopping(Run(physics, State.of(physics, start), queue, asked, watching)))

    return in_time(solve, request)


def _stopping(run: Run) -> Any:
    """Return the run; if a level ends it, one that is watched: what watches is loaded then."""
    if not isinstance(run.request.until, stop.LEVELS):
        return run
    from granular.edmd import levels
    from granular.run.levels import Watched

    return Watched(run, levels)


@check.face
def events(
    scene: Scene, rule: Rule | list[Rule] | tuple[Rule, ...], *, max_events: int = check.LARGEST, **options: Any
) -> Iterator[Event]:
    """Yield the collisions of a run one at a time, each with the scene right after it: for demos and debuggers.

    ``for contact, time, scene in gr.edmd.events(scene, rule, t_end=1.0)``: the row of the log, the time in s, and a
    `Scene` that stands so then. The bits are those of `simulate`, whose options are taken but for `samples` and
    `on_event`; where nothing ends the run, it goes on for as long as it is asked.
    """
    check.known(options, check.parameters(simulate) - {"scene", "rule", "samples", "on_event", "log"},
                 "option of edmd.events", TypeError)
    run: Any = simulate(scene, rule, on_event=one_by_one, max_events=max_events, **options)
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
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    engine: str = "auto",
    watch: Any = None,
) -> Trajectory:
    """Go on from the end of a run of `simulate`; both together equal the uninterrupted run bit for bit.

    Takes rules and options from `trajectory`, except for `watch`: give it again, and its counts go on (from 0 if
    `trajectory` was not watched). The contact log begins anew; collisions of a pair are counted from the
    beginning (``until.contact(0, 7)`` is still the seventh), `max_events` from here. See `simulate` for the parameters.

    Raises
    ------
    ValueError
        If `trajectory` is no hard-sphere run, ended in a collapse or at a bound (but where `max_events` ended it), or
        is broken; or if its state cannot be that of its last row.
    """
    check.of_kind("trajectory", trajectory, Trajectory, "a granular.Trajectory")
    status, saved, scene = trajectory.status, trajectory.state, trajectory.scene
    check.refuse({
        "trajectory is no hard-sphere run: one from granular.edmd is needed.": trajectory.rule is None or not saved,
        "trajectory ended in a collapse: nothing follows it; run again with collapse='merge' or tc=.":
            status is Status.collapse and "collapse_time" not in saved,
        "trajectory ended at a bound: nothing follows it; run again with collapse='merge' or tc=.":
            status is Status.bounded and "zoom_gap" not in saved,
        "trajectory is broken: nothing follows it; see its message.": status is Status.broken,
    })
    start = float(check.held(saved, "start", "f", ()))
    scene = fitted(scene, start, math.inf if t_end is None else check.number("t_end", t_end))
    check_scene(scene)
    physics = Physics(scene, rules.checked(trajectory.rule, scene.gap), {name: saved.get(name) for name in OPTIONS})
    check_end(scene, t_end, until, max_events, elastic=lambda: physics.elastic)
    state = State.restored(physics, saved)
    request = requested(
        scene, state.time(state.run.now), t_end, until=until, samples=samples, log=log,
        max_events=max_events, on_event=on_event, on_progress=on_progress, progress=progress,
    )
    queue, states = checked_engine(engine, physics), [state]

    def solve(asked: Request) -> Trajectory:
        watching = None if watch is None else _watch(watch, scene, saved)
        fresh = states.pop() if states else State.restored(physics, saved)
        run = Run(physics, fresh, queue, asked, watching)
        if "collapse_time" in saved:
            run.rest(check.held(saved, "collapse_pair", "i", (), 0, scene.n_pairs - 1),
                     check.held(saved, "collapse_time", "f", ()))
        return go_on(_stopping(run), trajectory)

    return in_time(solve, request)


def _watch(law: Any, scene: Scene, saved: Mapping[str, Any] | None = None) -> Watch:
    """Return the observer of a run that counts contacts of `law` which would disturb each other, loaded on demand."""
    from granular.edmd.watch import Watch

    return Watch(law, scene, CROSS_ROOM_LOADERS["contact_durations"](), saved)


def checked_engine(engine: str, physics: Physics) -> str:
    """Return how the queue is chosen, as asked for and as it can be: *auto* means that compiled is possible."""
    if isinstance(engine, str) and engine == "sorted":
        return engine
    name, why, missing = check.choice("engine", engine, ENGINES), "", no_compiler()
    if physics.rule is not None:
        why = "every rule must be a ConstantRestitution"
    elif ORDER[physics.options["ties"]] == GROUP:
        why = f"ties={physics.options['ties']!r} runs interpreted only"
    if name == "compiled" and why:
        raise ValueError(f"engine is 'compiled': {why}; use engine='sorted' or 'auto'.")
    if name == "compiled" and missing:
        raise ImportError(f"engine is 'compiled': {missing}.")
    return "sorted" if why or missing else name

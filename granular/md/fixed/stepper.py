"""A scene under a fixed time step, as rows for interpreted or compiled kernels.

Steps are taken while pairs are closed. While all pairs are open, the balls fly analytically.
"""

from __future__ import annotations

import math
from collections import namedtuple
from functools import cache, cached_property
from itertools import pairwise, repeat
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.kernels import compiled, fitted
from granular._engine.records import one, packed, plain_class
from granular.laws.kinds import SceneLaws
from granular.md.fixed import abreast, contact_force, march, window
from granular.md.fixed.integrators import Integrator
from granular.md.fixed.notes import STEP_ROW, log_contacts
from granular.md.fixed.walls import (
    HALT,
    HEATER_RECORD,
    MAX_HITS_PER_STEP,
    clock,
    flown,
    heaters,
    next_touch,
    packed_walls,
    walls_of,
)
from granular.md.fixed.window import ROW_NAMES, WINDOW_RECORD, XI, Physics, V, Work
from granular.scene import Scene

FREE_SWING_CHANGE = 1e-11
"""Relative velocity change up to which pendula count as swinging freely.

Gear's derivatives lag slightly behind a free swing."""
Code = namedtuple("Code", "march take_steps log_contacts glide time_to_touch swing time_to_touch_hung")
"""The kernels of a run, interpreted or compiled."""


@cache
def kernels(how: Integrator, force: Any, logged: bool, damped: bool, flags: tuple[tuple[str, bool], ...]) -> Code:
    """Return the kernels of an integrator and a force, specialised for scene flags."""
    fit: dict[str, Any] = {
        "step": how.step,
        "begin": how.begin,
        "EVALUATIONS_PER_STEP": how.evaluations,
        "force": force,
        "KEEPS_LOG": logged,
        "HAS_DAMPING": damped,
        **dict(flags),
    }
    return Code(fitted(march.march, **fit), fitted(march.take_steps, **fit), fitted(log_contacts, **dict(flags)),
                window.glide, window.time_to_touch, window.swing, window.time_to_touch_hung)


class Stepper:
    """Rows of one run, and its motion.

    Parameters
    ----------
    scene, laws : Scene, SceneLaws
        Scene that moves, and its force laws.
    integrator : Integrator
        Method of the steps.
    dt : float
        Time step in s.
    until : tuple of int
        Pair and number of the contact at whose onset to stop. Pair -1 for none.
    logged : bool
        Whether contacts are logged, not only counted.
    at_once : bool
        Whether the whole run is compiled.
    start : float
        Time in s of the initial state of the scene.
    """

    def __init__(
        self, scene: Scene, laws: SceneLaws, integrator: Integrator, dt: float, until: tuple[int, int], logged: bool,
        at_once: bool, start: float = 0.0,
    ) -> None:
        self.scene, self.laws, self.integrator, self.compiled = scene, laws, integrator, False
        self.crew: abreast.Crew | None = None
        self.flags = {name: holds for name, holds in scene._flags.items() if name != "FORCED"}  # no kernel reads it
        p, memory = scene.n_pairs, any(law.memory for law in laws.each)
        self.rest: Any = None if scene.rest_gap is None else scene.rest_gap.tolist()
        form = contact_force.coefficients(laws)
        self.force = contact_force.object_force if form is None else form[3]
        self.heaters = heaters(scene)
        self.walls = walls_of(scene, start) if "WORKED" in self.flags else None
        self.parts = abreast.parts(p) if self.walls is None else 1  # walls that move leave notes for all windows
        held: Any = np.array if at_once else np.ndarray.tolist
        state, given = self._state(start, logged, memory), self._given(form)
        self.here, self.there, self.pull = held(state), held(state), held(scene.pull)
        asked = laws if at_once or form is not None else list(laws)
        self.physics = Physics(asked, held(given), form is not None and form[2], dt, logged, memory, p, self.walls or 0,
                               p * scene.ring, self.heaters or 0)
        rows = [[0.0] * (2 if at_once else p + 2) for _ in ROW_NAMES]
        # a step adds at most one row per pair and `MAX_HITS_PER_STEP` per thermal wall: the log has room for it

        room, row = max(64, 4 * p) + 4 * MAX_HITS_PER_STEP * scene.heated if logged else 0, plain_class(STEP_ROW)
        log: Any = np.zeros(room, STEP_ROW) if at_once else list(map(object.__new__, repeat(row, room)))
        self.work = Work(
            plain_class(WINDOW_RECORD)(*rows),
            rows,
            rows[window.FIRST_WAS_ROW :],
            rows[window.FIRST_GIVEN_ROW :],
            [0],
            log,
            *until,
        )
        self.code = self._kernels(self.force)
        self._push()
        if at_once:
            self.compile()

    def _state(self, start: float, logged: bool, memory: bool) -> Array:
        """Return the rows of variables, up to the last one that the run needs."""
        scene, hung = self.scene, self.rest is not None
        needed = {window.SHARED: True, window.TOUCHED: logged, window.TOP: memory, window.OFF: hung,
                  window.SNAP: self.integrator.derivatives, window.HEAT_LOW: self.walls is not None}
        state = np.zeros((1 + max(row for row, is_needed in needed.items() if is_needed), scene.n_pairs + 2))
        state[XI], state[V, 1:] = [-1.0, *-scene.gap, -1.0], self._around(scene.velocity)
        if hung:
            state[window.OFF, 1:] = scene.displacement
        if self.walls is not None:
            for body, _, v in flown(self.walls, start, 0.0, state, scene.pull, 0.0):
                state[V, body + 1] = v
        return state

    def _given(self, form: tuple[Any, Any, bool, Any] | None) -> Array:
        """Return the rows of constants. A thermal wall has stiffness 0."""
        scene = self.scene
        given = np.zeros((1 + window.SQUARE, scene.n_pairs + 2))
        given[window.K, 1:-1], given[window.GAMMA, 1:-1], *_ = form or (1.0 * scene.heated, 0.0)
        square = np.where(scene.is_wall, 0.0, scene.pendulum**2)
        given[window.INVERSE_MASS :, 1:] = list(map(self._around, (scene.inverse_mass, scene.fall, square)))
        for wall in self.heaters:
            given[: window.GAMMA + 1, wall.pair + 1] = 0.0
        return given

    def _around(self, of_balls: Array) -> Array:
        """Return a row of one number per ball.

        On a ring the first number is repeated behind the last.
        """
        return np.append(of_balls, of_balls[:1]) if self.scene.ring else of_balls

    def _push(self) -> None:
        """Initialise the forces of pairs that overlap."""
        physics, x, a = self.physics, self.here, self.work.window
        xi, raw, v = x[XI], x[window.RAW], x[V]
        for c in np.flatnonzero(self.scene.gap < 0.0).tolist():
            a.k[1], a.gamma[1] = physics.given[window.K][c + 1], physics.given[window.GAMMA][c + 1]
            raw[c + 1] = self.force(physics, c, 0, float(xi[c + 1]), float(v[c + 1] - v[c + 2]), a)
            if physics.logged:
                log_contacts(c, c + 1, 0, 0, physics, self.there, x, self.work)
                # no time has passed since the onset at the start of the run
                x[window.IMPULSE][c + 1] = 0.0
        if self.integrator.derivatives:
            pushed = np.fmax(0.0, raw)
            if physics.ring:
                pushed[[0, -1]] = pushed[[-2, 1]]
            pushing = np.asarray(physics.given[window.INVERSE_MASS])[1:] * (pushed[:-1] - pushed[1:])
            x[window.ACC][1:] = (pushing + self._fall()).tolist()

    def _kernels(self, force: Any) -> Code:
        damped = force is not contact_force.power or bool(np.any(self.physics.given[window.GAMMA]))
        return kernels(self.integrator, force, self.physics.logged, damped, tuple(self.flags.items()))

    def _fall(self) -> Array:
        """Return the acceleration of every ball without contacts in m/s²."""
        fall, square = (np.asarray(self.physics.given[row])[1:] for row in (window.FALL, window.SQUARE))
        return fall if self.rest is None else fall - square * np.asarray(self.here[window.OFF])[1:]

    @cached_property
    def fit(self) -> Code:
        """Kernels to compile: those for the step and the force of the run."""
        return self._kernels(contact_force.called) if self.force is contact_force.object_force else self.code

    def compile(self) -> None:
        """Continue with compiled code from the current state.

        The source is the same, so the results are bitwise identical.

        Raises
        ------
        ImportError, NotCompilableError
            If numba is missing or a law does not compile.
        """
        laws = 0 if self.force is not contact_force.object_force else contact_force.records(self.laws, self.scene.pairs)
        self.code = Code(*map(compiled, self.fit))  # can fail, so it precedes all changes of the state
        walls = 0 if self.walls is None else packed_walls(self.walls)
        heat = packed(self.heaters, HEATER_RECORD) if self.heaters else 0
        self.physics = self.physics._replace(laws=laws, given=np.array(self.physics.given), block=self._block(),
                                             walls=walls, heat=heat)
        self.rest = None if self.rest is None else np.array(self.rest)
        self.here, self.there, self.pull = map(np.array, (self.here, self.there, self.pull))
        log, ended = np.zeros(len(self.work.log), STEP_ROW), self.work.ended[0]
        log[:ended] = packed(self.work.log[:ended], STEP_ROW)
        self.work = self._packed(self.work, log)
        self.compiled = True
        if self.parts > 1:
            self._spread(self.parts)

    def _packed(self, work: Work, log: Any, **more: int) -> Work:
        """Return the work space of compiled code, with its own window."""
        record = np.zeros(1, WINDOW_RECORD)
        rows = record.view(float).reshape(len(ROW_NAMES), window.WINDOW_LENGTH)
        return work._replace(
            window=one(record),
            rows=rows,
            was=rows[window.FIRST_WAS_ROW :],
            given=rows[window.FIRST_GIVEN_ROW :],
            ended=np.array(work.ended),
            log=log,
            **more,
        )

    def _spread(self, parts: int) -> None:
        """Split the chain into `parts` groups of windows, each stepped by its own thread."""
        pairs, block = self.scene.n_pairs, self.physics.block
        ends = [-(-pairs * i // (parts * block)) * block for i in range(parts + 1)]
        works = [self._packed(self.work, np.zeros(pairs // parts * self.physics.logged, STEP_ROW), low=low, high=high)
                 for low, high in pairwise(ends)]
        self.crew = abreast.parallel_workspace(self.work, works, self.code)
        self.code = self.code._replace(march=fitted(self.fit.march, **abreast.MARCH_REPLACEMENTS))

    def _block(self) -> int:
        """Return the number of pairs that a window represents, without its margins."""
        pairs, most = self.scene.n_pairs, window.WINDOW_LENGTH - 2
        # windows of nearly equal size whose two margins of REACH + 2 pairs fit beside them
        return pairs if pairs <= most else -(-pairs // -(-pairs // (most - 2 * (march.EVALUATIONS_PER_WINDOW + 2))))

    def pairs(self, row: int) -> Array:
        """Return one number of every pair."""
        return np.asarray(self.here[row])[1:-1]

    def balls(self, row: int = V) -> Array:
        """Return one number of every ball, by default its velocity."""
        return np.asarray(self.here[row])[1 : self.scene.n + 1]

    def march(self, k: int, steps: int, room: int) -> tuple[int, int]:
        """Take up to `steps` steps from step number `k`.

        See `granular.md.fixed.march.march`.
        """
        work = self.crew or self.work
        why, k, turned = self.code.march(self.physics, self.here, self.there, work, k, steps, room)
        if turned:
            self.here, self.there = self.there, self.here
        return why, int(k)

    def clock(self, k: int) -> tuple[float, float]:
        """Return the time in s at step `k` in two floats."""
        return (0.0, 0.0) if self.walls is None else clock(self.walls, float(k), self.physics.dt)

    def time_to_touch(self, k: int, within: float) -> float:
        """Return the time in s from step `k` until the next touch.

        At driven walls the search covers at least the time `within`.
        """
        if self.rest is not None:
            return float(self.code.time_to_touch_hung(self.here, self.scene.pendulum, self.rest))
        if self.walls is None:
            return float(self.code.time_to_touch(self.here, self.pull, 0, len(self.pull)))
        floor, ceiling = self.scene.motions
        low, high = int(floor is not None), len(self.pull) - int(ceiling is not None)
        free = float(self.code.time_to_touch(self.here, self.pull, low, high))
        return min(free, next_touch(self.walls, *self.clock(k), self.here, self.pull, within))

    def glide(self, x: Any, k: int, dt: float) -> Any:
        """Advance the open scene in rows `x`, of step `k`, by a time `dt` in s."""
        if self.rest is not None:
            self.code.swing(x, self.scene.pendulum, self.rest, dt)
            return x
        ends = [] if self.walls is None else flown(self.walls, *self.clock(k), x, self.pull, dt)
        self.code.glide(x, self.pull, self.physics.given[window.FALL], dt)
        for body, gap, v in ends:
            x[XI][body + (body == 0)], x[V][body + 1] = -gap if gap > 0.0 else 0.0, v
        return x

    def hit_within(self, k: int, dt: float) -> bool:
        """Log the hits of thermal walls within a time `dt` in s after step `k`.

        `dt` is shorter than a step, and `k` is the current step. Return whether the hit to stop at would occur. The run
        stays at step `k`.
        """
        work, part = self.work, dt / self.physics.dt
        work.ended[0] = 0
        halt = bool(self._part_of_step(k, dt, self.physics.logged) & HALT)
        for row in work.log[: work.ended[0]]:
            row["step_in"], row["step_out"] = k, k
            row["part_in"], row["part_out"] = part * row["part_in"], part * row["part_out"]
        self.there[window.PART][:] = np.multiply(part, self.there[window.PART])
        return halt

    def after(self, k: int, dt: float) -> Any:
        """Compute the rows a time `dt` in s after the current step `k`.

        The run stays at step `k`.
        """
        ended = self.work.ended[0]
        self._part_of_step(k, dt, False)
        self.work.ended[0] = ended  # hits of thermal walls in this partial step are not counted
        return self.there if dt > 0.0 else self.here

    def _part_of_step(self, k: int, dt: float, logged: bool) -> int:
        """Compute the rows a time `dt` in s after step `k` in `there`, and return flags."""
        if not dt > 0.0:
            return 0
        physics = self.physics._replace(dt=dt, logged=logged)
        if self.walls is not None:
            time, tail = self.clock(k)
            physics = physics._replace(walls=physics.walls._replace(time=time, tail=tail))
        return int(self.code.take_steps(physics, self.here, self.there, self.work, 0, 1, False, march.NO_PAIR)[1])

    def account(self, x: Any, xi: Array) -> Array:
        """Return the energy account in J of rows `x`, see `granular.run.drive.Row`.

        It exists with driven or thermal walls. The dissipation of laws with memory is known only while all pairs are
        open. It is nan if an overlap in `xi` is positive.
        """
        work, heat, lost = (np.asarray(x[row]) + np.asarray(x[row + 1])
                            for row in (window.WORK, window.HEAT, window.LOST))
        lost = math.nan if self.physics.memory and (xi > 0.0).any() else math.fsum(lost)
        return np.array([work[1], work[-1], heat[1], heat[-1], lost])

    def settled(self) -> bool:
        """Return whether Gear's stored derivatives no longer change any velocity."""
        if not self.integrator.derivatives:
            return True
        dt, n = self.physics.dt, self.scene.n
        # 1e-17 of the largest velocity is below its rounding error
        still = (1e-17 if self.rest is None else FREE_SWING_CHANGE) * np.abs(self.balls()).max()
        kept = dt * np.abs(self.balls(window.ACC) - self._fall()[:n]) <= still
        jerk = self.balls(window.JERK) + self.scene.pendulum**2 * self.balls()
        return bool(kept.all() and (dt * dt * np.abs(jerk) <= still).all())

    def receding(self) -> bool:
        """Return whether no pair approaches."""
        return bool(np.less_equal(*self.scene.sides(self.balls())).all())

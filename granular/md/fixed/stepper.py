"""State of a run with a fixed time step, advanced by kernels.

During contacts the state advances by time steps. While no pair overlaps, the balls move in closed form.
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
from granular._engine.records import one, plain_class, record_array
from granular.laws.kinds import SceneLaws
from granular.md.fixed import abreast, contact_force, march, window
from granular.md.fixed.integrators import Integrator
from granular.md.fixed.notes import STEP_ROW, log_contacts
from granular.md.fixed.walls import (
    HALT,
    HEATER_RECORD,
    MAX_HITS_PER_STEP,
    clock,
    driven_wall_data,
    next_touch,
    packed_walls,
    thermal_walls,
    walls_after,
)
from granular.md.fixed.window import ROW_NAMES, WINDOW_RECORD, XI, Physics, V, Work
from granular.scene import Scene

FREE_SWING_CHANGE = 1e-11
"""Relative velocity change per step up to which pendula count as swinging freely.

It is not 0, because Gear's derivatives lag slightly behind a free swing."""
Code = namedtuple("Code", "march take_steps log_contacts glide time_to_touch swing time_to_touch_hung")
"""Kernels of a run, interpreted or compiled, see `march`, `notes` and `window`."""


@cache
def kernels(
    integrator: Integrator, force: Any, logged: int, damped: bool, flags: tuple[tuple[str, bool], ...]
) -> Code:
    """Return the kernels for an integrator and a contact force.

    Parameters
    ----------
    integrator : Integrator
        Method of the steps.
    force : kernel
        Contact force of a pair, see `contact_force`.
    logged, damped : int, bool
        Whether contacts are logged (`window.KEEPS_LOG`), and whether forces depend on velocities.
    flags : tuple of (str, bool)
        Values of scene flags, such as `RING`.
    """
    replacements: dict[str, Any] = {
        "step": integrator.step,
        "begin": integrator.begin,
        "EVALUATIONS_PER_STEP": integrator.evaluations,
        "force": force,
        "KEEPS_LOG": logged,
        "HAS_DAMPING": damped,
        **dict(flags),
    }
    return Code(fitted(march.march, **replacements), fitted(march.take_steps, **replacements),
                fitted(log_contacts, **dict(flags)), window.glide, window.time_to_touch, window.swing,
                window.time_to_touch_hung)


class Stepper:
    """State table of a run with a fixed time step, and the kernels that advance it.

    Parameters
    ----------
    scene, laws : Scene, SceneLaws
        Initial state, and its force laws.
    integrator : Integrator
        Method of the steps.
    dt : float
        Time step in s.
    until : tuple of int
        Pair and number of the contact at whose onset to stop. Pair -1 denotes no contact.
    logged : int
        Whether contacts are logged, see `window.KEEPS_LOG`. Otherwise they are only counted.
    at_once : bool
        Whether the run is compiled from its start. Otherwise it starts interpreted.
    start : float
        Time in s of the initial state.

    Notes
    -----
    `here` is the state table at the current step (see `window`), and `there` a second table for the next state. Step
    numbers `k` are counted by the caller.
    """

    def __init__(
        self, scene: Scene, laws: SceneLaws, integrator: Integrator, dt: float, until: tuple[int, int], logged: int,
        at_once: bool, start: float = 0.0,
    ) -> None:
        self.scene, self.laws, self.integrator, self.compiled = scene, laws, integrator, False
        self.crew: abreast.Workspaces | None = None
        self.flags = {name: holds for name, holds in scene._flags.items() if name != "FORCED"}  # no kernel reads it
        p, memory = scene.n_pairs, any(law.memory for law in laws.each)
        self.rest: Any = None if scene.rest_gap is None else scene.rest_gap.tolist()
        law_form = contact_force.coefficients(laws)
        self.force = contact_force.object_force if law_form is None else law_form[3]
        self.heaters = thermal_walls(scene)
        self.walls = driven_wall_data(scene, start) if "WORKED" in self.flags else None
        self.parts = abreast.parts(p) if self.walls is None else 1  # wall motion is stored once for all windows
        convert: Any = np.array if at_once else np.ndarray.tolist
        state, constants = self._state(start, logged, memory), self._constants(law_form)
        self.here, self.there, self.pull = convert(state), convert(state), convert(scene.closing_acceleration)
        laws_of_kernels = laws if at_once or law_form is not None else list(laws)
        self.physics = Physics(
            laws=laws_of_kernels, given=convert(constants), root=law_form is not None and law_form[2], dt=dt,
            logged=logged, memory=memory, block=p, walls=self.walls or 0, ring=p * scene.ring, heat=self.heaters or 0)
        rows = [[0.0] * (2 if at_once else p + 2) for _ in ROW_NAMES]
        # a step adds at most one row per pair and `MAX_HITS_PER_STEP` rows per thermal wall
        length, record = max(64, 4 * p) + 4 * MAX_HITS_PER_STEP * scene.heated if logged else 0, plain_class(STEP_ROW)
        log: Any = np.zeros(length, STEP_ROW) if at_once else list(map(object.__new__, repeat(record, length)))
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
        self._set_initial_forces()
        if at_once:
            self.compile()

    def _state(self, start: float, logged: int, memory: bool) -> Array:
        """Return the initial state table, up to the last row that the run needs.

        Forces are not set. `start` is the time in s of the initial state.
        """
        scene, hung = self.scene, self.rest is not None
        needed = {window.SHARED: True, window.TOUCHED: logged, window.TOP: memory, window.OFF: hung,
                  window.SNAP: self.integrator.derivatives, window.HEAT_LOW: self.walls is not None}
        state = np.zeros((1 + max(row for row, is_needed in needed.items() if is_needed), scene.n_pairs + 2))
        state[XI], state[V, 1:] = [-1.0, *-scene.gap, -1.0], self._close_ring(scene.velocity)
        if hung:
            state[window.OFF, 1:] = scene.displacement
        if self.walls is not None:
            for body, _, v in walls_after(self.walls, start, 0.0, state, scene.closing_acceleration, 0.0):
                state[V, body + 1] = v
        return state

    def _constants(self, law_form: tuple[Any, Any, bool, Any] | None) -> Array:
        """Return the constant rows `K` to `SQUARE`.

        `law_form` is the result of `contact_force.coefficients`. Pairs at a thermal wall have stiffness 0.
        """
        scene = self.scene
        constants = np.zeros((1 + window.SQUARE, scene.n_pairs + 2))
        constants[window.K, 1:-1], constants[window.GAMMA, 1:-1], *_ = law_form or (1.0 * scene.heated, 0.0)
        square = np.where(scene.is_wall, 0.0, scene.pendulum**2)
        constants[window.INVERSE_MASS :, 1:] = list(map(self._close_ring, (scene.inverse_mass, scene.fall, square)))
        for wall in self.heaters:
            constants[: window.GAMMA + 1, wall.pair + 1] = 0.0
        return constants

    def _close_ring(self, values: Array) -> Array:
        """Return `values` of all bodies, on a ring with the first one repeated."""
        return np.append(values, values[:1]) if self.scene.ring else values

    def _set_initial_forces(self) -> None:
        """Compute the forces of pairs that overlap at the start, and log their onsets.

        For methods with stored derivatives, the initial accelerations are set too: contact forces plus free
        acceleration.
        """
        physics, x, a = self.physics, self.here, self.work.window
        xi, raw, v = x[XI], x[window.RAW], x[V]
        # pair c has index c + 1 in the rows, and its bodies c + 1 and c + 2; the kernel reads index 1 of k and gamma
        force, logged, ks, gammas = self.force, physics.logged, physics.given[window.K], physics.given[window.GAMMA]
        for c in np.flatnonzero(self.scene.gap < 0.0).tolist():
            a.k[1], a.gamma[1] = ks[c + 1], gammas[c + 1]
            raw[c + 1] = force(physics, c, 0, float(xi[c + 1]), float(v[c + 1] - v[c + 2]), a)
            if logged:
                log_contacts(c, c + 1, 0, 0, physics, self.there, x, self.work)
                # no time has passed since the onset at the start of the run
                x[window.IMPULSE][c + 1] = 0.0
        if self.integrator.derivatives:
            forces = np.fmax(0.0, raw)
            if physics.ring:
                # padding outside the line: the neighbours on the ring
                forces[[0, -1]] = forces[[-2, 1]]
            contact_acceleration = np.asarray(physics.given[window.INVERSE_MASS])[1:] * (forces[:-1] - forces[1:])
            x[window.ACC][1:] = (contact_acceleration + self._free_acceleration()).tolist()

    def _kernels(self, force: Any) -> Code:
        """Return the kernels of this run for the contact force `force`."""
        damped = force is not contact_force.power or bool(np.any(self.physics.given[window.GAMMA]))
        return kernels(self.integrator, force, self.physics.logged, damped, tuple(self.flags.items()))

    def _free_acceleration(self) -> Array:
        """Return the acceleration in m/s² that each body has without contacts."""
        fall, square = (np.asarray(self.physics.given[row])[1:] for row in (window.FALL, window.SQUARE))
        return fall if self.rest is None else fall - square * np.asarray(self.here[window.OFF])[1:]

    @cached_property
    def fit(self) -> Code:
        """Kernels of this run that can be compiled.

        Laws without coefficients are called as C functions instead of Python objects.
        """
        return self._kernels(contact_force.compiled_force) if self.force is contact_force.object_force else self.code

    def compile(self) -> None:
        """Convert the state to arrays, and continue with compiled kernels.

        Compiled kernels have the same source as interpreted kernels, so results are bitwise identical.

        Raises
        ------
        ImportError, NotCompilableError
            If numba is missing or a law does not compile.
        """
        laws = 0 if self.force is not contact_force.object_force else contact_force.records(self.laws, self.scene.pairs)
        self.code = Code(*map(compiled, self.fit))  # can fail, so it precedes all changes of the state
        walls = 0 if self.walls is None else packed_walls(self.walls)
        heat = record_array(self.heaters, HEATER_RECORD) if self.heaters else 0
        self.physics = self.physics._replace(laws=laws, given=np.array(self.physics.given), block=self._block(),
                                             walls=walls, heat=heat)
        self.rest = None if self.rest is None else np.array(self.rest)
        self.here, self.there, self.pull = map(np.array, (self.here, self.there, self.pull))
        log, ended = np.zeros(len(self.work.log), STEP_ROW), self.work.ended[0]
        log[:ended] = record_array(self.work.log[:ended], STEP_ROW)
        self.work = self._compiled_workspace(self.work, log)
        self.compiled = True
        if self.parts > 1:
            self._split_into_parts(self.parts)

    def _compiled_workspace(self, work: Work, log: Any, **more: int) -> Work:
        """Return a copy of `work` for compiled kernels, with its own window.

        `log` are its log rows, and `more` are replaced fields.
        """
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

    def _split_into_parts(self, parts: int) -> None:
        """Split the chain into `parts` groups of windows, each stepped by its own thread."""
        pairs, block = self.scene.n_pairs, self.physics.block
        ends = [-(-pairs * i // (parts * block)) * block for i in range(parts + 1)]
        works = [self._compiled_workspace(self.work, np.zeros(pairs // parts * self.physics.logged, STEP_ROW),
                                          low=low, high=high) for low, high in pairwise(ends)]
        self.crew = abreast.parallel_workspace(self.work, works, self.code)
        self.code = self.code._replace(march=fitted(self.fit.march, **abreast.MARCH_REPLACEMENTS))

    def _block(self) -> int:
        """Return the number of pairs that a window contains in addition to its margins."""
        pairs, max_pairs = self.scene.n_pairs, window.WINDOW_LENGTH - 2
        # windows of nearly equal size, with room for two margins of EVALUATIONS_PER_WINDOW + 2 pairs
        return pairs if pairs <= max_pairs else (
            -(-pairs // -(-pairs // (max_pairs - 2 * (march.EVALUATIONS_PER_WINDOW + 2)))))

    def pairs(self, row: int) -> Array:
        """Return the values of all pairs in row `row` of the current state."""
        return np.asarray(self.here[row])[1:-1]

    def balls(self, row: int = V) -> Array:
        """Return the values of all bodies in row `row` of the current state.

        Defaults to the velocities in m/s.
        """
        return np.asarray(self.here[row])[1 : self.scene.n + 1]

    def march(self, k: int, steps: int, room: int) -> tuple[int, int]:
        """Take up to `steps` steps from step number `k`.

        Return the reason for the end of the steps, and the step number reached. The steps end early once more than
        `room` contacts have ended. See `granular.md.fixed.march.march`.
        """
        work = self.crew or self.work
        why, k, is_swapped = self.code.march(self.physics, self.here, self.there, work, k, steps, room)
        if is_swapped:
            self.here, self.there = self.there, self.here
        return why, int(k)

    def clock(self, k: int) -> tuple[float, float]:
        """Return the time in s at step `k` as a sum of two floats.

        It is only needed for driven or thermal walls. Without them the result is (0.0, 0.0).
        """
        return (0.0, 0.0) if self.walls is None else clock(self.walls, float(k), self.physics.dt)

    def time_to_touch(self, k: int, within: float) -> float:
        """Return the time in s from step `k` until the next touch in free flight, or inf.

        Touches of driven walls are searched at least for the time `within` in s.
        """
        if self.rest is not None:
            return float(self.code.time_to_touch_hung(self.here, self.scene.pendulum, self.rest))
        if self.walls is None:
            return float(self.code.time_to_touch(self.here, self.pull, 0, len(self.pull)))
        floor, ceiling = self.scene.motions
        low, high = int(floor is not None), len(self.pull) - int(ceiling is not None)
        time_between_balls = float(self.code.time_to_touch(self.here, self.pull, low, high))
        return min(time_between_balls, next_touch(self.walls, *self.clock(k), self.here, self.pull, within))

    def glide(self, x: Any, k: int, dt: float) -> Any:
        """Advance the state table `x` at step `k` in free flight by a time `dt` in s.

        The table is changed and returned.
        """
        if self.rest is not None:
            self.code.swing(x, self.scene.pendulum, self.rest, dt)
            return x
        wall_states = [] if self.walls is None else walls_after(self.walls, *self.clock(k), x, self.pull, dt)
        self.code.glide(x, self.pull, self.physics.given[window.FALL], dt)
        for body, gap, v in wall_states:
            x[XI][body + (body == 0)], x[V][body + 1] = -gap if gap > 0.0 else 0.0, v
        return x

    def hit_within(self, k: int, dt: float) -> bool:
        """Log the hits of thermal walls within a time `dt` in s after step `k`.

        `k` is the current step, and `dt` is shorter than a step. The run stays at step `k`. Return whether the hit to
        stop at is among them.
        """
        work, part = self.work, dt / self.physics.dt
        work.ended[0] = 0
        halt = bool(self._compute_partial_step(k, dt, self.physics.logged) & HALT)
        for row in work.log[: work.ended[0]]:
            row["step_in"], row["step_out"] = k, k
            row["part_in"], row["part_out"] = part * row["part_in"], part * row["part_out"]
        self.there[window.PART][:] = np.multiply(part, self.there[window.PART])
        return halt

    def after(self, k: int, dt: float) -> Any:
        """Return the state table at a time `dt` in s after the current step `k`.

        It is computed by one shorter step. The run stays at step `k`.
        """
        ended = self.work.ended[0]
        self._compute_partial_step(k, dt, False)
        self.work.ended[0] = ended  # hits of thermal walls in this partial step are not counted
        return self.there if dt > 0.0 else self.here

    def _compute_partial_step(self, k: int, dt: float, logged: int) -> int:
        """Take a single step of length `dt` in s from step `k`, and return its flags.

        The result is written to `there`. For `dt` = 0 nothing is written.
        """
        if not dt > 0.0:
            return 0
        physics = self.physics._replace(dt=dt, logged=logged)
        if self.walls is not None:
            time, tail = self.clock(k)
            physics = physics._replace(walls=physics.walls._replace(time=time, tail=tail))
        return int(self.code.take_steps(physics, self.here, self.there, self.work, 0, 1, False, march.NO_PAIR)[1])

    def account(self, x: Any, xi: Array) -> Array:
        """Return the energy account in J from the state table `x`.

        See `granular.run.drive.Row` for its five entries. It exists only with driven or thermal walls. `xi` are the
        overlaps of the pairs in m. For laws with memory, the dissipated energy is known only between contacts, and nan
        if an overlap is positive.
        """
        work, heat, lost = (np.asarray(x[row]) + np.asarray(x[row + 1])
                            for row in (window.WORK, window.HEAT, window.LOST))
        lost = math.nan if self.physics.memory and (xi > 0.0).any() else math.fsum(lost)
        return np.array([work[1], work[-1], heat[1], heat[-1], lost])

    def settled(self) -> bool:
        """Return whether a free flight in closed form can start.

        The result is False for Gear's method while its stored derivatives still change a velocity.
        """
        if not self.integrator.derivatives:
            return True
        dt, n = self.physics.dt, self.scene.n
        # 1e-17 of the largest velocity is below its rounding error
        tolerance = (1e-17 if self.rest is None else FREE_SWING_CHANGE) * np.abs(self.balls()).max()
        is_constant = dt * np.abs(self.balls(window.ACC) - self._free_acceleration()[:n]) <= tolerance
        jerk = self.balls(window.JERK) + self.scene.pendulum**2 * self.balls()
        return bool(is_constant.all() and (dt * dt * np.abs(jerk) <= tolerance).all())

    def receding(self) -> bool:
        """Return whether no pair of neighbouring bodies approaches."""
        return bool(np.less_equal(*self.scene.sides(self.balls())).all())

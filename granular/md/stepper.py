"""A scene under a fixed time step, in rows for the kernels: interpreted at first, perhaps compiled later.
May be skipped: faster, same results.
"""

from __future__ import annotations

import math
from collections import namedtuple
from copy import deepcopy
from functools import cached_property
from typing import Any

import numpy as np

from granular._check import Array
from granular._kernels import compiled, specialised
from granular._records import one, packed, plain, twin
from granular.laws.kinds import SceneLaws
from granular.md import contact_force, window
from granular.md import march as loop
from granular.md.driven import clock, flown, next_touch, packed_walls, walls_of
from granular.md.glide import glide, swing, time_to_touch, time_to_touch_hung
from granular.md.heated import HALT, HEATER, MOST, heaters
from granular.md.integrators import Integrator, swung
from granular.md.notes import STEP_ROW, settle
from granular.md.window import ROWS, WINDOW, Physics, V, Work
from granular.scene import Scene

SWUNG = 1e-11
"""Part of the speed up to which pendula swing as they would freely: Gear's derivatives follow a little behind."""
Code = namedtuple("Code", "march leap glide time_to_touch swing time_to_touch_hung")
"""The kernels of a run, as they stand or compiled."""


class Stepper:
    """The rows of one run, and its motion.

    Parameters
    ----------
    scene, laws : Scene, SceneLaws
        What moves.
    integrator : Integrator
        How it steps.
    dt : float
        Time step in s.
    until : tuple of int
        At the onset of which contact of which pair to stop; pair -1 for none.
    logged : bool
        Whether contacts are noted, not only counted.
    at_once : bool
        Whether all of the run is compiled.
    start : float
        Time in s of the scene's instant.
    """

    def __init__(
        self, scene: Scene, laws: SceneLaws, integrator: Integrator, dt: float, until: tuple[int, int], logged: bool,
        at_once: bool, start: float = 0.0,
    ) -> None:
        self.scene, self.laws, self.integrator, self.compiled = scene, laws, integrator, False
        p, memory, kept = scene.n_pairs, any(law.memory for law in laws.each), scene.driven or scene.heated
        self.rest: Any = None if scene.rest_gap is None else scene.rest_gap.tolist()
        form = contact_force.coefficients(laws)
        self.force = contact_force.asked if form is None else contact_force.power
        extra = (logged * window.TOUCHED, memory * window.TOP, integrator.derivatives * window.SNAP,
                 kept * window.HEAT_LOW, (self.rest is not None) * window.OFF)
        state = np.zeros((1 + max(window.SHARED, *extra), p + 2))
        state[window.XI], state[V, 1:] = [-1.0, *-scene.gap, -1.0], self._around(scene.velocity)
        k, gamma, root = form or (1.0 * scene.heated, 0.0, False)
        given = np.zeros((4 + (self.rest is not None), p + 2))
        given[0, 1:-1], given[1, 1:-1], given[2, 1:] = k, gamma, self._around(scene.inverse_mass)
        given[3, 1:] = self._around(scene.fall)
        if self.rest is not None:
            state[window.OFF, 1:], given[4, 1:] = scene.displacement, np.where(scene.is_wall, 0.0, scene.pendulum**2)
        self.heaters = heaters(scene)
        for wall in self.heaters:
            given[:2, wall.pair + 1] = 0.0
        self.walls = walls_of(scene, start) if kept else None
        if self.walls is not None:
            for body, _, v in flown(self.walls, start, 0.0, state, scene.pull, 0.0):
                state[V, body + 1] = v
        held: Any = np.array if at_once else np.ndarray.tolist
        self.here, self.there, self.pull = held(state), held(state), held(scene.pull)
        asked = laws if at_once or form is not None else list(laws)
        self.physics = Physics(asked, held(given), root, dt, logged, memory, p, self.walls or 0, p * scene.ring,
                               self.heaters or 0)
        rows = [[0.0] * (2 if at_once else p + 2) for _ in ROWS]
        log: Any = np.zeros(max(64, 4 * p) + 4 * MOST * scene.heated if logged else 0, STEP_ROW)
        log = log if at_once else plain(log)
        self.work = Work(twin(WINDOW)(*rows), rows, rows[window.WAS :], rows[window.GIVEN :], [0], log, *until)
        self.code = self._kernels(self.force)
        self._start()
        if at_once:
            self.compile()

    def _around(self, of_balls: Array) -> Array:
        """What rows hold of one number of every ball: on a ring the first once more behind the last."""
        return np.append(of_balls, of_balls[:1]) if self.scene.ring else of_balls

    def _start(self) -> None:
        """Pairs that overlap push."""
        physics, x, a = self.physics, self.here, self.work.window
        xi, raw, v = x[window.XI], x[window.RAW], x[V]
        for c in np.flatnonzero(self.scene.gap < 0.0).tolist():
            a.k[1], a.gamma[1] = physics.given[0][c + 1], physics.given[1][c + 1]
            raw[c + 1] = self.force(physics, c, 0, float(xi[c + 1]), float(v[c + 1] - v[c + 2]), a)
            if physics.logged:
                settle(c, c + 1, 0, 0, physics, self.there, x, self.work)
                x[window.IMPULSE][c + 1] = 0.0
        if self.integrator.derivatives:
            w = np.asarray(physics.given)[2, 1:]
            pushed = np.fmax(0.0, raw)
            if physics.ring:
                pushed[[0, -1]] = pushed[[-2, 1]]
            x[window.ACC][1:] = (w * (pushed[:-1] - pushed[1:]) + self._fall()).tolist()

    def _kernels(self, force: Any) -> Code:
        how = self.integrator
        fit = {"step": how.step, "begin": how.begin, "EVALUATIONS": how.evaluations, "force": force}
        flags = {"DRIVEN": self.scene.driven, "HEATED": self.scene.heated, "RING": self.scene.ring}
        flags |= {"WORKED": self.walls is not None, "SWING": self.rest is not None}
        fit |= {name: True for name, flag in flags.items() if flag}
        if self.rest is not None:
            fit["pulled"] = swung
        return Code(specialised(loop.march, **fit), specialised(loop.leap, **fit), glide, time_to_touch, swing,
                    time_to_touch_hung)

    def _fall(self) -> Array:
        """Acceleration of every ball without contacts in m/s²."""
        given = np.asarray(self.physics.given)[:, 1:]
        swing = 0.0 if self.rest is None else given[4] * np.asarray(self.here[window.OFF])[1:]
        return np.asarray(given[3] - swing)

    @cached_property
    def fit(self) -> Code:
        """What is compiled: kernels for the step and the force of the run."""
        return self._kernels(contact_force.called if self.force is contact_force.asked else self.force)

    def compile(self) -> None:
        """Go on with compiled code from the present state: same source, same bits.

        Raises
        ------
        ImportError, NotCompilableError
            If numba is missing or a law does not compile.
        """
        laws = 0 if self.force is contact_force.power else contact_force.records(self.laws, self.scene.pairs)
        self.code = Code(*map(compiled, self.fit))  # what may fail: before anything changes
        walls = 0 if self.walls is None else packed_walls(self.walls)
        heat = packed(self.heaters, HEATER) if self.heaters else 0
        self.physics = self.physics._replace(laws=laws, given=np.array(self.physics.given), block=self._block(),
                                             walls=walls, heat=heat)
        self.rest = None if self.rest is None else np.array(self.rest)
        self.here, self.there, self.pull = map(np.array, (self.here, self.there, self.pull))
        record, work = np.zeros(1, WINDOW), self.work
        rows, log = record.view(float).reshape(len(ROWS), window.LENGTH), packed(work.log, STEP_ROW)
        parts = {"rows": rows, "was": rows[window.WAS :], "given": rows[window.GIVEN :]}
        self.work = work._replace(window=one(record), ended=np.array(work.ended), log=log, **parts)
        self.compiled = True

    def _block(self) -> int:
        """How many pairs a window stands for, beside its margins."""
        pairs, most = self.scene.n_pairs, window.LENGTH - 2
        return pairs if pairs <= most else -(-pairs // -(-pairs // (most - 2 * (loop.REACH + 2))))

    def pairs(self, row: int) -> Array:
        """One number of every pair."""
        return np.asarray(self.here[row])[1:-1]

    def balls(self, row: int = V) -> Array:
        """One number of every ball, its velocity if nothing else is asked for."""
        return np.asarray(self.here[row])[1 : self.scene.n + 1]

    def march(self, k: int, steps: int, room: int) -> tuple[int, int]:
        """Take up to `steps` steps from step number `k`; see `granular.md.march.march`."""
        why, k, turned = self.code.march(self.physics, self.here, self.there, self.work, k, steps, room)
        if turned:
            self.here, self.there = self.there, self.here
        return why, int(k)

    def clock(self, k: int) -> tuple[float, float]:
        """Time in s at step `k` in two floats."""
        return (0.0, 0.0) if self.walls is None else clock(self.walls, float(k), self.physics.dt)

    def time_to_touch(self, k: int, within: float) -> float:
        """Time in s from step `k` until something touches, beside driven walls at least up to `within`."""
        if self.rest is not None:
            return float(self.code.time_to_touch_hung(self.here, self.scene.pendulum, self.rest))
        if self.walls is None:
            return float(self.code.time_to_touch(self.here, self.pull, 0, len(self.pull)))
        floor, ceiling = self.scene.motions
        low, high = int(floor is not None), len(self.pull) - int(ceiling is not None)
        free = float(self.code.time_to_touch(self.here, self.pull, low, high))
        return min(free, next_touch(self.walls, *self.clock(k), self.here, self.pull, within))

    def glide(self, x: Any, k: int, dt: float) -> Any:
        """Let the open scene in rows `x`, of step `k`, fly for a time `dt` in s."""
        if self.rest is not None:
            self.code.swing(x, self.scene.pendulum, self.rest, dt)
            return x
        ends = [] if self.walls is None else flown(self.walls, *self.clock(k), x, self.pull, dt)
        self.code.glide(x, self.pull, self.physics.given[3], dt)
        for body, gap, v in ends:
            x[window.XI][body + (body == 0)], x[V][body + 1] = -gap if gap > 0.0 else 0.0, v
        return x

    def hit_within(self, k: int, dt: float) -> bool:
        """Log the hits of thermal walls within a time `dt` in s, shorter than a step, after step `k`, the present one;
        return whether the one at which to stop would come. The run stays there."""
        work, part = self.work, dt / self.physics.dt
        work.ended[0] = 0
        halt = bool(self._leap(k, dt, self.physics.logged) & HALT)
        for row in work.log[: work.ended[0]]:
            row["step_in"], row["step_out"] = k, k
            row["part_in"], row["part_out"] = part * row["part_in"], part * row["part_out"]
        self.there[window.PART][:] = np.multiply(part, self.there[window.PART])
        return halt

    def after(self, k: int, dt: float) -> Any:
        """The rows a time `dt` in s after step `k`, the present one; the run stays there."""
        ended = self.work.ended[0]
        self._leap(k, dt, False)
        self.work.ended[0] = ended  # hits of thermal walls are counted where they are to stay
        return self.there if dt > 0.0 else self.here

    def _leap(self, k: int, dt: float, logged: bool) -> int:
        """Write the rows a time `dt` in s after step `k` there; return flags."""
        if not dt > 0.0:
            return 0
        whole = self.physics.memory or self.integrator.derivatives or self.walls is not None or self.rest is not None
        rows, physics = slice(None if whole else V + 1), self.physics._replace(dt=dt, logged=logged)
        if self.walls is not None:
            time, tail = self.clock(k)
            physics = physics._replace(walls=physics.walls._replace(time=time, tail=tail))
        return int(self.code.leap(physics, self.here[rows], self.there[rows], self.work, 0, 1, -2)[1])

    def taking_off(self) -> Any:
        """A copy of the rows that a flight needs."""
        return deepcopy(self.here[slice(V + 1 if self.rest is None else None)])

    def account(self, x: Any, xi: Array) -> Array:
        """What is kept of the energy in rows `x` in J where walls are driven or heat, see `granular.drive.Row`.

        What laws with memory dissipate is known while all pairs are open: not, by the overlaps `xi`, if one is not.
        """
        sums = (np.asarray(x[row]) + np.asarray(x[row + 1]) for row in (window.WORK, window.HEAT, window.LOST))
        work, heat, lost = sums
        lost = math.nan if self.physics.memory and (xi > 0.0).any() else math.fsum(lost)
        return np.array([work[1], work[-1], heat[1], heat[-1], lost])

    def settled(self) -> bool:
        """Whether the higher derivatives that Gear's method remembers no longer change any velocity."""
        if not self.integrator.derivatives:
            return True
        dt, n = self.physics.dt, self.scene.n
        still = (1e-17 if self.rest is None else SWUNG) * np.abs(self.balls()).max()
        kept = dt * np.abs(self.balls(window.ACC) - self._fall()[:n]) <= still
        jerk = self.balls(window.JERK) + self.scene.pendulum**2 * self.balls()
        return bool(kept.all() and (dt * dt * np.abs(jerk) <= still).all())

    def receding(self) -> bool:
        """Whether no pair approaches."""
        return bool(np.less_equal(*self.scene.sides(self.balls())).all())

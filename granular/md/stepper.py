"""A scene under a fixed time step, in rows for the kernels: interpreted at first, perhaps compiled later."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from granular._check import Array
from granular._kernels import compiled, specialised
from granular._records import one, packed, plain, twin
from granular.laws.kinds import SceneLaws
from granular.md import contact_force
from granular.md import march as loop
from granular.md.glide import glide, time_to_touch
from granular.md.integrators import Integrator
from granular.md.notes import STEP_ROW, settle
from granular.md.window import ACC, GIVEN, IMPULSE, JERK, LENGTH, RAW, ROWS, SHARED, SNAP, TOP, TOUCHED, WAS, WINDOW, XI
from granular.md.window import Physics, V, Work
from granular.scene import Scene

Kernel = Callable[..., Any]


class Code(NamedTuple):
    """The kernels of a run, as they stand or compiled."""

    march: Kernel
    leap: Kernel
    glide: Kernel
    time_to_touch: Kernel


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
    """

    def __init__(
        self, scene: Scene, laws: SceneLaws, integrator: Integrator, dt: float, until: tuple[int, int], logged: bool,
        at_once: bool,
    ) -> None:  # fmt: skip
        self.scene, self.laws, self.integrator, self.compiled = scene, laws, integrator, False
        n, p, memory = scene.n, scene.n_pairs, any(law.memory for law in laws.each)
        form = contact_force.coefficients(laws)
        self.force = contact_force.asked if form is None else contact_force.power
        last = SNAP if integrator.derivatives else TOP if memory else TOUCHED if logged else SHARED
        state, given = np.zeros((last + 1, n + 1)), np.zeros((4, n + 1))
        state[XI], state[V, 1:] = [-1.0, *-scene.gap, -1.0], scene.velocity
        k, gamma, root = form or (0.0, 0.0, False)
        given[0, 1:-1], given[1, 1:-1], given[2, 1:] = k, gamma, scene.inverse_mass
        given[3, 1:] = np.where(scene.is_wall, 0.0, -scene.gravity)
        held = np.array if at_once else np.ndarray.tolist
        self.here, self.there, pull = held(state), held(state), held(scene.pull)
        self.pull: Any = pull
        asked = laws if at_once or form is not None else list(laws)
        self.physics = Physics(asked, held(given), root, dt, logged, memory, p)
        rows = [[0.0] * (2 if at_once else n + 1) for _ in ROWS]
        log = np.zeros(max(64, 4 * p) if logged else 0, STEP_ROW)
        self.work = Work(twin(WINDOW)(*rows), rows, rows[WAS:], rows[GIVEN:], [0], log if at_once else plain(log), *until)
        self.code = self._kernels(self.force)
        self._start()
        if at_once:
            self.compile()

    def _start(self) -> None:
        """Pairs that overlap push."""
        physics, x, a = self.physics, self.here, self.work.window
        xi, raw, v = x[XI], x[RAW], x[V]
        for c in np.flatnonzero(self.scene.gap < 0.0).tolist():
            a.k[1], a.gamma[1] = physics.given[0][c + 1], physics.given[1][c + 1]
            raw[c + 1] = self.force(physics, c, 0, float(xi[c + 1]), float(v[c + 1] - v[c + 2]), a)
            if physics.logged:
                settle(c, c + 1, 0, 0, physics, self.there, x, self.work)
                x[IMPULSE][c + 1] = 0.0
        if self.integrator.derivatives:
            w, fall = np.asarray(physics.given)[2:, 1:]
            pushed = np.fmax(0.0, raw)
            x[ACC][1:] = (w * (pushed[:-1] - pushed[1:]) + fall).tolist()

    def _kernels(self, force: Kernel) -> Code:
        how = self.integrator
        fit = {"step": how.step, "begin": how.begin, "EVALUATIONS": how.evaluations, "force": force}
        return Code(specialised(loop.march, **fit), specialised(loop.leap, **fit), glide, time_to_touch)

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
        given = np.array(self.physics.given)
        self.physics = self.physics._replace(laws=laws, given=given, block=self._block())
        self.here, self.there, self.pull = map(np.array, (self.here, self.there, self.pull))
        window, work = np.zeros(1, WINDOW), self.work
        rows, log = window.view(float).reshape(len(ROWS), LENGTH), packed(work.log, STEP_ROW)
        self.work = Work(one(window), rows, rows[WAS:], rows[GIVEN:], np.array(work.ended), log, work.pair, work.nth)
        self.compiled = True

    def _block(self) -> int:
        """How many pairs a window stands for, beside its margins."""
        pairs, most = self.scene.n_pairs, LENGTH - 2
        if pairs > most:
            most -= 2 * (loop.REACH + 2)
            pairs = -(-pairs // -(-pairs // most))
        return pairs

    def pairs(self, row: int) -> Array:
        """One number of every pair."""
        return np.asarray(self.here[row])[1:-1]

    def balls(self, row: int = V) -> Array:
        """One number of every ball, its velocity if nothing else is asked for."""
        return np.asarray(self.here[row])[1:]

    def march(self, k: int, steps: int, room: int) -> tuple[int, int, int]:
        """Take up to `steps` steps from step number `k`; see `granular.md.march.march`."""
        why, k, turned = self.code.march(self.physics, self.here, self.there, self.work, k, steps, room)
        if turned:
            self.here, self.there = self.there, self.here
        return why, int(k), int(self.work.ended[0])

    def time_to_touch(self) -> float:
        """Time in s until the first gap of the open scene closes."""
        return float(self.code.time_to_touch(self.here, self.pull))

    def glide(self, x: Any, dt: float) -> Any:
        """Let the open scene in rows `x` fly for a time `dt` in s."""
        self.code.glide(x, self.pull, self.physics.given[3], dt)
        return x

    def after(self, dt: float) -> Any:
        """The rows a time `dt` in s later; the run stays where it is."""
        if not dt > 0.0:
            return self.here
        rows = slice(None if self.physics.memory or self.integrator.derivatives else V + 1)
        physics = self.physics._replace(dt=dt, logged=False)
        self.code.leap(physics, self.here[rows], self.there[rows], self.work, 0, 1, -2)
        return self.there

    def settled(self) -> bool:
        """Whether the higher derivatives that Gear's method remembers no longer change any velocity."""
        if not self.integrator.derivatives:
            return True
        dt, fall, still = self.physics.dt, self.physics.given[3][1:], 1e-17 * np.abs(self.balls()).max()
        kept = dt * np.abs(self.balls(ACC) - fall) <= still
        return bool(kept.all() and (dt * dt * np.abs(self.balls(JERK)) <= still).all())

    def receding(self) -> bool:
        """Whether no pair approaches."""
        lower, upper = self.scene.sides(self.balls())
        return bool((upper >= lower).all())

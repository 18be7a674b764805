"""A scene under a fixed time step, in columns for the kernels: interpreted at first, perhaps compiled later."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from granular._kernels import compiled, specialised
from granular._records import one, packed, plain, twin
from granular.laws.kinds import SceneLaws
from granular.md import march as loop
from granular.md.contact_force import (
    Called,
    asked,
    called,
    coefficients,
    compiled_force,
    law_records,
    pair_records,
    power,
)  # fmt: skip
from granular.md.glide import glide, time_to_touch
from granular.md.integrators import Integrator
from granular.md.notes import STEP_ROW, Seen, spread
from granular.md.window import COUNTED, LENGTH, ROWS, WINDOW, Chain, Physics, Work
from granular.scene import Scene

Kernel = Callable[..., Any]
FLYING = ("raw", "top", "jerk", "snap")
"""Columns that are 0 while all pairs are open."""


class Code(NamedTuple):
    """The kernels of a run, as they stand or compiled."""

    march: Kernel
    leap: Kernel
    glide: Kernel
    time_to_touch: Kernel


class Stepper:
    """The columns of one run, and its motion.

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
    compiled_at_once : bool
        Whether all of the run is compiled.
    """

    def __init__(
        self, scene: Scene, laws: SceneLaws, integrator: Integrator, dt: float, until: tuple[int, int], logged: bool,
        compiled_at_once: bool,
    ) -> None:  # fmt: skip
        self.scene, self.laws, self.integrator = scene, laws, integrator
        n, p = scene.n, scene.n_pairs
        top, higher = p * any(law.memory for law in laws.each), n * integrator.derivatives
        form = coefficients(laws)
        self.has_form = form is not None
        k, gamma, root = form or (np.zeros(p), np.zeros(p), False)
        fall = np.where(scene.is_wall, 0.0, -scene.gravity).tolist()
        given = laws if compiled_at_once or self.has_form else list(laws)
        w = scene.inverse_mass.tolist()
        self.physics = Physics(given, k.tolist(), gamma.tolist(), root, w, fall, dt, logged, p)
        noted = dict.fromkeys(Chain._fields[Chain._fields.index("xi_max") : -1], p * logged)
        sizes = noted | {"v": n, "top": top, "acc": higher, "jerk": higher, "snap": higher}
        log: Any = np.zeros(max(64, 4 * p) if logged else 0, STEP_ROW)
        log = log if compiled_at_once else plain(log)
        zero = {name: 0 if name in COUNTED else 0.0 for name in Chain._fields[:-1]}
        self.here, self.there = (
            Chain._make([*([zero[name]] * sizes.get(name, p) for name in Chain._fields[:-1]), log]) for _ in range(2)
        )
        self.here = self.here._replace(xi=(-scene.gap).tolist(), v=scene.velocity.tolist())
        self.work = Work(twin(WINDOW)(*([0.0] * (n + 1) for _ in ROWS)), [0], *until)
        self.pull: Any = scene.pull.tolist()
        self.code, self.compiled = self._kernels(power if self.has_form else asked), False
        self._start()
        if compiled_at_once:
            self.compile()

    def _start(self) -> None:
        physics, x, a = self.physics, self.here, self.work.window
        force = power if self.has_form else asked
        for c in np.flatnonzero(self.scene.gap < 0.0).tolist():
            a.k[1], a.gamma[1] = physics.k[c], physics.gamma[c]
            x.raw[c] = force(physics, c, 0, x.xi[c], x.v[c] - x.v[c + 1], a)
        if x.acc:
            pushed = np.fmax(0.0, [0.0, *x.raw, 0.0])
            x.acc[:] = (np.array(physics.w) * (pushed[:-1] - pushed[1:]) + physics.fall).tolist()
        seen = Seen(x.xi, x.raw, x.v, x.xi, x.raw, x.v, x.xi_max, x.force_max, x.impulse)
        for c, push in enumerate(x.raw):
            if push > 0.0 and physics.logged:  # overlapping from the start
                x.lower[c], x.upper[c], x.count[c] = x.v[c], x.v[c + 1], 1
                x.xi_max[c], x.force_max[c] = x.xi[c], push
                spread(c, 1, 0, 0.0, seen, x)

    def _kernels(self, force: Kernel) -> Code:
        how = self.integrator
        fit = {"step": how.step, "begin": how.begin, "EVALUATIONS": how.evaluations, "force": force}
        return Code(specialised(loop.march, **fit), specialised(loop.leap, **fit), glide, time_to_touch)

    @cached_property
    def fit(self) -> Code:
        """What is compiled: kernels for the step and the force of the run."""
        return self._kernels(power if self.has_form else called)

    def compile(self) -> None:
        """Go on with compiled code from the present state: same source, same bits.

        Raises
        ------
        ImportError, NotCompilableError
            If numba is missing or a law does not compile.
        """
        laws: Any = 0
        if not self.has_form:
            records = law_records(self.laws)
            laws = Called(compiled_force(self.laws), records, pair_records(self.scene.pairs))
        code = Code(*map(compiled, self.fit))  # what may fail: before anything changes
        p = self.physics
        k, gamma, w, fall, self.pull = (np.array(x, np.float64) for x in (p.k, p.gamma, p.w, p.fall, self.pull))
        self.physics = Physics(laws, k, gamma, p.root, w, fall, p.dt, p.logged, self._block())
        log = packed(self.here.log, STEP_ROW)
        self.here, self.there = (Chain._make([*map(np.array, x[:-1]), log]) for x in (self.here, self.there))
        self.work = self.work._replace(window=one(np.zeros(1, WINDOW)), ended=np.array(self.work.ended))
        self.code, self.compiled = code, True

    def _block(self) -> int:
        """How many pairs a window stands for, beside its margins."""
        pairs, most = self.scene.n_pairs, LENGTH - 2
        if pairs > most:
            most -= 2 * (loop.REACH + 2)
            pairs = -(-pairs // -(-pairs // most))
        return pairs

    def march(self, k: int, steps: int, room: int) -> tuple[int, int, int]:
        """Take up to `steps` steps from step number `k`; see `granular.md.march.march`."""
        why, k, turned = self.code.march(self.physics, self.here, self.there, self.work, k, steps, room)
        if turned:
            self.here, self.there = self.there, self.here
        return why, int(k), int(self.work.ended[0])

    def time_to_touch(self) -> float:
        """Time in s until the first gap of the open scene closes."""
        return float(self.code.time_to_touch(self.here.xi, self.here.v, self.pull))

    def glide(self, dt: float) -> None:
        """Let the open scene fly for a time `dt` in s."""
        x = self.here
        self.code.glide(x.xi, x.v, self.pull, self.physics.fall, dt)
        for name in FLYING:
            column = getattr(x, name)
            column[:] = [0.0] * len(column)
        x.acc[:] = self.physics.fall[: len(x.acc)]

    def flown(self, state: Any, dt: float) -> Any:
        """Overlaps, forces and velocities of an open scene a time `dt` in s after the overlaps and velocities given."""
        xi, v = (column.copy() for column in state)
        self.code.glide(xi, v, self.pull, self.physics.fall, dt)
        return xi, [0.0] * len(xi), v

    def after(self, dt: float) -> Any:
        """Overlaps, forces and velocities a time `dt` in s later; the run stays where it is."""
        if not dt > 0.0:
            return self.here[:3]
        self.code.leap(self.physics._replace(dt=dt), self.here, self.there, self.work, 0, 1, -2)
        return self.there[:3]

    def closed(self) -> bool:
        """Whether any pair is."""
        return bool((np.asarray(self.here.xi) > 0.0).any())

    def finite(self) -> bool:
        """Whether all velocities are numbers."""
        return bool(np.isfinite(self.here.v).all())

    def settled(self) -> bool:
        """Whether the higher derivatives that Gear's method remembers no longer change any velocity."""
        if not len(self.here.acc):
            return True
        x, dt = self.here, self.physics.dt
        still = 1e-17 * np.abs(x.v).max()
        kept = dt * np.abs(np.subtract(x.acc, self.physics.fall)) <= still
        return bool(kept.all() and (dt * dt * np.abs(x.jerk) <= still).all())

    def receding(self) -> bool:
        """Whether no pair approaches."""
        lower, upper = self.scene.sides(np.asarray(self.here.v))
        return bool((upper >= lower).all())

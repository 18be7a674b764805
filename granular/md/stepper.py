"""A scene under a fixed time step, in columns for the kernels: interpreted at first, perhaps compiled later."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from granular import until as stop
from granular._kernels import compiled, specialised
from granular._records import packed, plain
from granular.laws.kinds import SceneLaws
from granular.md import march as loop
from granular.md.blocks import march_in_blocks, window
from granular.md.contact_force import (
    Called,
    Columns,
    called,
    columns,
    compiled_force,
    law_records,
    pair_records,
    power,
)  # fmt: skip
from granular.md.glide import glide, time_to_touch
from granular.md.integrators import Integrator, Physics, Scratch, State, accelerations, forces
from granular.scene import Scene

MANY = 32
"""Pairs from which compiled code gains from a march that fits the law, and from blocks."""
Kernel = Callable[..., Any]


class Code(NamedTuple):
    """The kernels of a run, as they stand or compiled."""

    march: Kernel
    step: Kernel
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
    until : stop condition or None
        Where to stop, if that is at a contact.
    log : bool
        Whether rows of contacts are wanted.
    compiled_at_once : bool
        Whether all of the run is compiled.
    """

    def __init__(
        self, scene: Scene, laws: SceneLaws, integrator: Integrator, dt: float, until: stop.Until | None, log: bool,
        compiled_at_once: bool,
    ) -> None:  # fmt: skip
        self.scene, self.laws, self.integrator = scene, laws, integrator
        n, p = scene.n, scene.n_pairs
        top = p if any(law.memory for law in laws.each) else 0
        higher = n if integrator.name == "gear5" else 0
        fall = np.where(scene.is_wall, 0.0, -scene.gravity).tolist()
        given = laws if compiled_at_once else list(laws)
        self.physics = Physics(given, scene.inverse_mass.tolist(), fall, dt)
        sizes = (n, p, top, higher, higher)
        rows: Any = np.zeros(max(64, 4 * p), loop.STEP_ROW)
        self.memory = loop.Memory(
            State((-scene.gap).tolist(), scene.velocity.tolist(), *map(_zeros, sizes)),
            State(*map(_zeros, (p, n, *sizes))),
            Scratch(*map(_zeros, (n, p, n))),
            loop.Notes(*([0] * p if name in loop.COUNTED else _zeros(p) for name in loop.Notes._fields)),
            rows if compiled_at_once else plain(rows),
        )
        self.pull: Any = scene.pull.tolist()
        self.counts = not log and not isinstance(until, stop.Contact)  # contacts are counted, and no more
        self.rest: tuple[Any, ...] = (until.pair, until.nth) if isinstance(until, stop.Contact) else (-1, 0)
        self.code = Code(specialised(loop.march, step=integrator.step), integrator.step, glide, time_to_touch)
        self.compiled = False
        self._start()
        if compiled_at_once:
            self.compile()

    def _start(self) -> None:
        physics, s, now = self.physics, self.memory.s, self.memory.now
        forces(physics.laws, s.xi, s.v, s.top, s.raw)
        accelerations(s.raw, physics.w, physics.fall, s.acc)
        for c, force in enumerate(s.raw):
            if force > 0.0:  # overlapping from the start
                lower, upper = self.scene.bodies(c)
                now.lower[c], now.upper[c], now.count[c] = s.v[lower], s.v[upper], 1
                now.xi_max[c], now.force_max[c] = s.xi[c], force
                loop.spread(c, 0, 0.0, s, s, now)

    @cached_property
    def columns(self) -> Columns | None:
        """The laws, if they become part of the compiled march."""
        return columns(self.laws) if len(self.laws) >= MANY else None

    @cached_property
    def blocks(self) -> bool:
        """Whether compiled steps are taken in blocks."""
        return bool(self.columns and self.counts and self.integrator.kicks)

    @cached_property
    def fit(self) -> Code:
        """What is compiled: kernels for the step and the force of the run."""
        force, step = power if self.columns else called, self.integrator.step
        march = specialised(march_in_blocks if self.blocks else loop.march, step=step, force=force)
        return Code(march, specialised(step, force=force), glide, time_to_touch)

    def compile(self) -> None:
        """Go on with compiled code from the present state: same source, same bits.

        Raises
        ------
        ImportError, NotCompilableError
            If numba is missing or a law does not compile.
        """
        records = law_records(self.laws)  # may fail: before anything changes
        laws = self.columns or Called(compiled_force(self.laws), records, pair_records(self.scene.pairs))
        p, m = self.physics, self.memory
        w, fall, self.pull = (np.array(x, np.float64) for x in (p.w, p.fall, self.pull))
        groups = (type(group)(*map(np.array, group)) for group in m[:-1])
        self.physics = Physics(laws, w, fall, p.dt)
        log = packed(m.log, loop.STEP_ROW) if isinstance(m.log, list) else m.log
        self.memory = loop.Memory._make([*groups, log])
        if self.blocks:
            self.rest = (window(self.memory, self.integrator, p.dt),)
        self.code, self.compiled = Code(*map(compiled, self.fit)), True

    def march(self, k: int, steps: int, room: int) -> tuple[int, int, int]:
        """Take up to `steps` steps from step number `k`; see `granular.md.march.march`."""
        why, reached, rows = self.code.march(self.physics, self.memory, k, steps, room, *self.rest)
        return why, int(reached), rows

    def time_to_touch(self) -> float:
        """Time in s until the first gap of the open scene closes."""
        return float(self.code.time_to_touch(self.memory.s.xi, self.memory.s.v, self.pull))

    def glide(self, dt: float) -> None:
        """Let the open scene fly for a time `dt` in s."""
        self.code.glide(self.memory.s, self.pull, self.physics.fall, dt)

    def after(self, state: Any, dt: float = 0.0, flying: bool = False) -> State:
        """Return a copy of a state a time `dt` in s later: one step on, or `flying`."""
        s = State(*(column.copy() for column in state))
        if flying:
            self.code.glide(s, self.pull, self.physics.fall, dt)
        elif dt > 0.0:
            self.code.step(self.physics._replace(dt=dt), state, s, self.memory.work)
        return s

    def closed(self) -> bool:
        """Whether any pair is."""
        return bool((np.asarray(self.memory.s.xi) > 0.0).any())

    def finite(self) -> bool:
        """Whether all velocities are numbers."""
        return bool(np.isfinite(self.memory.s.v).all())

    def settled(self) -> bool:
        """Whether the higher derivatives that Gear's method remembers no longer change any velocity."""
        s, dt = State(*map(np.asarray, self.memory.s)), self.physics.dt
        still = 1e-17 * np.abs(s.v).max()
        kept = dt * np.abs(s.acc - self.physics.fall) <= still
        return bool(kept.all() and (dt * dt * np.abs(s.jerk) <= still).all())

    def receding(self) -> bool:
        """Whether no pair approaches."""
        lower, upper = self.scene.sides(np.asarray(self.memory.s.v))
        return bool((upper >= lower).all())


def _zeros(length: int) -> list[float]:
    return [0.0] * length

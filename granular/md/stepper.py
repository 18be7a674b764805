"""A scene under a fixed time step, in arrays for the kernels: interpreted at first, perhaps compiled later."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from granular import until as stop
from granular._kernels import compiled
from granular._records import packed, plain
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws
from granular.md import march as loop
from granular.md.contact_force import compiled_force, force_type, interpreted, law_records, pair_records
from granular.md.glide import glide, time_to_touch
from granular.md.steps import EULER, METHODS, VERLET, Motion, Stages, accelerations, contact_forces, step
from granular.md.unlogged import MANY, bulk, hurry, power_rows
from granular.scene import Scene

Physics = namedtuple("Physics", "method force laws pairs w fall dt")
"""What does not change: the first arguments of the kernels. `w` are inverse masses, `fall` accelerations."""
Memory = namedtuple("Memory", "s work old now log")
"""What changes: state, scratch, state a step ago, contacts under way, rows of those that ended."""


class Code(NamedTuple):
    """The kernels, as they stand or compiled."""

    march: Callable[..., tuple[int, int, int]] = loop.march
    hurry: Callable[..., tuple[int, int, int]] = hurry
    glide: Callable[..., None] = glide
    time_to_touch: Callable[..., float] = time_to_touch


class Stepper:
    """The arrays of one run, and its motion.

    Parameters
    ----------
    scene, laws : Scene, SceneLaws
        What moves.
    method : str
        Name of the integrator.
    dt : float
        Time step in s.
    log : bool
        Whether rows of contacts are wanted.
    compiled_at_once : bool
        Whether all of the run is compiled.
    """

    def __init__(
        self, scene: Scene, laws: SceneLaws, method: str, dt: float, log: bool, compiled_at_once: bool
    ) -> None:
        self.scene, self.laws, self.log = scene, laws, log
        n, p = scene.n, scene.n_pairs
        top = p if any(law.memory for law in laws.each) else 0
        listed = laws if compiled_at_once else self.plain_laws
        fall = np.where(scene.is_wall, 0.0, -scene.gravity).tolist()
        self.physics = Physics(METHODS[method], interpreted, listed, listed, scene.inverse_mass.tolist(), fall, dt)
        self.memory = Memory(
            Motion((-scene.gap).tolist(), scene.velocity.tolist(), *(_zeros(m) for m in (n, p, p, top, n, n))),
            Stages(*(_zeros(m) for m in (p, n, p, n, p, p))),
            loop.Old(*(_zeros(m) for m in (p, n, p, p))),
            loop.Open(*([0] * p if name in loop.COUNTED else _zeros(p) for name in loop.Open._fields)),
            np.zeros(max(64, 4 * p), loop.STEP_ROW),
        )
        self.pull: Any = scene.pull.tolist()
        self.bulk: Any = None
        self.code, self.compiled = Code(), False
        if compiled_at_once:
            self.compile()
        else:
            self.memory = self.memory._replace(log=plain(self.memory.log))
        self._start()

    @cached_property
    def plain_laws(self) -> list[PairLaw]:
        """The laws, ready for interpreted steps."""
        return list(self.laws)

    def _start(self) -> None:
        s, now = self.memory.s, self.memory.now
        contact_forces(interpreted, self.laws, self.laws, s.xi, s.v, s.top, s.raw, s.force)
        accelerations(s.force, self.physics.w, self.physics.fall, s.acc)
        for c, force in enumerate(s.force):
            if force > 0.0:  # overlapping from the start
                lower, upper = self.scene.bodies(c)
                now.lower[c], now.upper[c], now.count[c] = s.v[lower], s.v[upper], 1
                now.xi_max[c], now.force_max[c] = s.xi[c], force
                loop.spread(c, 0, 0.0, s, s, now)

    def compile(self) -> None:
        """Go on with compiled code from the present state: same source, same bits.

        Raises
        ------
        ImportError, NotCompilableError
            If numba is missing or a law does not compile.
        """
        laws, force = law_records(self.laws), compiled_force(self.laws)  # may fail: before anything changes
        p, m = self.physics, self.memory
        w, fall, self.pull = (np.array(x, np.float64) for x in (p.w, p.fall, self.pull))
        self.physics = Physics(p.method, force, laws, pair_records(self.scene.pairs), w, fall, p.dt)
        groups = (type(group)(*map(np.array, group)) for group in m[:-1])
        self.memory = Memory._make([*groups, packed(m.log, loop.STEP_ROW) if isinstance(m.log, list) else m.log])
        arguments = (*self.physics, 0, 0, 0, *self.memory)
        code = {"march": compiled(loop.march, _types((*arguments, -1, 0)))}
        if not self.log and p.method in (VERLET, EULER) and len(self.laws) >= MANY:
            rows = power_rows(self.laws)
            self.bulk = rows and bulk(rows, self.physics, self.memory)
        if self.bulk:
            code["hurry"] = compiled(hurry, _types((*arguments, self.bulk)))
        self.code, self.compiled = Code(**code, glide=compiled(glide), time_to_touch=compiled(time_to_touch)), True

    def march(self, k: int, steps: int, room: int, until: stop.Until | None) -> tuple[int, int, int]:
        """Take up to `steps` steps from step number `k`; see `granular.md.march.march`."""
        arguments = (*self.physics, k, steps, room, *self.memory)
        if isinstance(until, stop.Contact):
            return self.code.march(*arguments, until.pair, until.nth)
        return self.code.hurry(*arguments, self.bulk) if self.bulk else self.code.march(*arguments, -1, 0)

    def time_to_touch(self) -> float:
        """Time in s until the first gap of the open scene closes."""
        return self.code.time_to_touch(self.memory.s.xi, self.memory.s.v, self.pull)

    def glide(self, dt: float) -> None:
        """Let the open scene fly for a time `dt` in s."""
        self.code.glide(self.memory.s, self.pull, self.physics.fall, dt)

    def after(self, state: Any, dt: float = 0.0, flying: bool = False) -> Motion:
        """Return a copy of a state a time `dt` in s later: one step on, or `flying`."""
        s = Motion(*(list(map(float, group)) for group in state))
        w, fall = list(map(float, self.physics.w)), list(map(float, self.physics.fall))
        if flying:
            glide(s, list(map(float, self.pull)), fall, dt)
        elif dt > 0.0:
            work = Stages(*(_zeros(len(group)) for group in self.memory.work))
            step(self.physics.method, interpreted, self.plain_laws, self.plain_laws, w, fall, dt, s, work)
        return s

    def settled(self) -> bool:
        """Whether the higher derivatives that Gear's method remembers no longer change any velocity."""
        s, dt = self.memory.s, self.physics.dt
        still = 1e-17 * max(map(abs, s.v))
        return all(
            dt * abs(a - f) <= still and dt * dt * abs(j) <= still
            for a, f, j in zip(s.acc, self.physics.fall, s.jerk, strict=True)
        )

    def receding(self) -> bool:
        """Whether no pair approaches."""
        lower, upper = self.scene.sides(np.asarray(self.memory.s.v))
        return bool((upper >= lower).all())


def _zeros(length: int) -> list[float]:
    return [0.0] * length


def _types(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """Numba types of a kernel's arguments; a force counts as its common function type."""
    import numba

    return tuple(force_type() if callable(a) else numba.typeof(a) for a in arguments)

"""A scene under a fixed time step, as DEM codes do it: step while pairs are closed, jump while all are open."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from granular import until as stop
from granular._kernels import compiled, have_numba, worth
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws
from granular.md import march as loop
from granular.md.contact_force import (
    NotCompilableError,
    compiled_force,
    force_type,
    interpreted,
    law_records,
    pair_records,
)
from granular.md.glide import glide, time_to_touch
from granular.md.steps import EULER, METHODS, VERLET, Motion, Stages, accelerations, contact_forces, step
from granular.md.unlogged import MANY, bulk, hurry, power_rows
from granular.scene import Scene
from granular.trajectory import Status

Row = tuple[float, list[float], list[float], list[float]]
"""Time, overlaps, velocities, forces."""

CHUNK = 1 << 15
"""Steps between two looks at the clock (progress, switch to compiled code)."""
WORTH_LOADING, WORTH_MAKING = 200_000, 2_000_000
"""Pair-steps after which ``engine="auto"`` goes on compiled if the machine code is there already, and if not: what is
left may be as much as was done, and loading or making the code takes as long as these."""


MOST_STEPS = 1 << 62
"""Number of the last step that compiled code can count to."""


class Stepper:
    """The state of one run and its motion; interpreted at first, perhaps compiled later with the same bits."""

    def __init__(
        self, scene: Scene, laws: SceneLaws, method: str, dt: float, t_start: float, engine: str, log: bool
    ) -> None:
        self.scene, self.laws, self.dt, self.t_start = scene, laws, dt, t_start
        self.name, self.method, self.engine, self.keep_log = method, METHODS[method], engine, log
        n, p = scene.n, scene.n_pairs
        self.k = self.steps = self.flights = self.contacts = 0
        self.note = ""
        self.halted_at: int | None = None
        self.take_off: tuple[int, Any] = (0, ())
        self.w: Any = scene.inverse_mass.tolist()
        self.fall: Any = np.where(scene.is_wall, 0.0, -scene.gravity).tolist()
        self.pull: Any = scene.pull.tolist()
        top = p if any(law.memory for law in laws.each) else 0
        self.s: Any = Motion((-scene.gap).tolist(), scene.velocity.tolist(), *(_zeros(m) for m in (n, p, p, top, n, n)))
        self.work: Any = Stages(*(_zeros(m) for m in (p, n, p, n, p, p)))
        self.old: Any = loop.Old(*(_zeros(m) for m in (p, n, p, p)))
        self.now: Any = loop.Open(*([0] * p if name in loop.COUNTED else _zeros(p) for name in loop.Open._fields))
        self.room = max(64, 4 * p)
        self.buffer: Any = [] if engine == "compiled" else [[0.0] * loop.ROW for _ in range(self.room)]
        self.rows: list[Any] = []
        self.force: Any = interpreted
        self.law_rows: Any = laws if engine == "compiled" else self.plain_laws
        self.pair_rows: Any = self.law_rows
        self.bulk: Any = None
        self.march: Callable[..., tuple[int, int, int]] = loop.march
        self.hurry: Callable[..., tuple[int, int, int]] = hurry
        self.glide: Callable[..., None] = glide
        self.time_to_touch: Callable[..., float] = time_to_touch
        self.compiled = False
        if engine == "compiled":
            self.compile()
        self._start()

    @cached_property
    def plain_laws(self) -> list[PairLaw]:
        """The laws, ready for interpreted steps."""
        return list(self.laws)

    # -- state ----------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        s = self.s
        contact_forces(interpreted, self.laws, self.laws, s.xi, s.v, s.top, s.raw, s.force)
        accelerations(s.force, self.w, self.fall, s.acc)
        for c, force in enumerate(s.force):
            if force > 0.0:  # overlapping from the start
                now = self.now
                lower, upper = self.scene.bodies(c)
                now.lower[c], now.upper[c], now.count[c] = s.v[lower], s.v[upper], 1
                now.xi_max[c], now.force_max[c] = s.xi[c], force
                loop.spread(c, 0, 0.0, s, s, now)

    def halts_at_start(self, until: stop.Until | None) -> bool:
        """Whether the very contact at which to stop is there from the start; then it does not act."""
        if not isinstance(until, stop.Contact) or self.now.count[until.pair] < until.nth:
            return False
        self.now.count[until.pair], self.s.force[until.pair] = 0, 0.0
        return True

    def compile(self) -> None:
        """Go on with compiled code from the present state: same source, same bits.

        Raises
        ------
        ImportError, NotCompilableError
            If numba is missing or a law does not compile.
        """
        laws, force = law_records(self.laws), compiled_force(self.laws)  # may fail: before anything changes
        self.glide, self.time_to_touch = compiled(glide), compiled(time_to_touch)
        self.force, self.law_rows = force, laws
        self.pair_rows = pair_records(self.scene.pairs)
        self.w, self.fall, self.pull = (np.array(x, np.float64) for x in (self.w, self.fall, self.pull))
        self.s, self.work, self.old, self.now = (
            type(group)(*map(np.array, group)) for group in (self.s, self.work, self.old, self.now)
        )
        self.buffer = np.zeros((self.room, loop.ROW))
        arguments = self._arguments(0, 0)
        self.march = compiled(loop.march, _types((*arguments, -1, 0)))
        if not self.keep_log and self.method in (VERLET, EULER) and len(self.laws) >= MANY:
            rows = power_rows(self.laws)
            self.bulk = rows and bulk(rows, self.method, self.dt, self.w, self.fall, self.s, self.now)
        if self.bulk:
            self.hurry = compiled(hurry, _types((*arguments, self.bulk)))
        self.compiled = True

    def _arguments(self, steps: int, room: int) -> tuple[Any, ...]:
        physics = (self.method, self.force, self.law_rows, self.pair_rows, self.w, self.fall)
        return (*physics, self.dt, self.k, steps, room, self.s, self.work, self.old, self.now, self.buffer)

    def time(self) -> float:
        """Time in s of the present step."""
        return self.t_start + self.k * self.dt

    def row(self, t: float) -> Row:
        """Time, overlaps, velocities and forces at `t`, at most one step ahead: one shorter step on a copy.

        A time that lies behind, in the free flight just made, is read off that flight.
        """
        flown = t < self.time()
        k, state = self.take_off if flown else (self.k, self.s)
        s = Motion(*(list(map(float, group)) for group in state))
        h = t - (self.t_start + k * self.dt)
        if flown:
            glide(s, list(map(float, self.pull)), list(map(float, self.fall)), h)
        elif h > 0.0:
            work = Stages(*(_zeros(len(group)) for group in self.work))
            w, fall = list(map(float, self.w)), list(map(float, self.fall))
            step(self.method, interpreted, self.plain_laws, self.plain_laws, w, fall, h, s, work)
        return t, s.xi, s.v, s.force

    def last_row(self, status: Status, t_end: float) -> Row:
        """Where the run ended: at `t_end`, at the begin of a contact that must not act, or at the present step."""
        if status is Status.time:
            return self.row(t_end)
        if status is not Status.until or self.halted_at is None:
            return self.row(self.time())
        part = loop.begin_part(self.halted_at, self.old, self.s)
        between = [
            [float(a + part * (b - a)) for a, b in zip(old, new, strict=True)]
            for old, new in ((self.old.xi, self.s.xi), (self.old.v, self.s.v), (self.old.force, self.s.force))
        ]
        return self.t_start + (self.k + part) * self.dt, between[0], between[1], between[2]

    def checkpoint(self) -> dict[str, Any]:
        """The raw state: step number, and every array by name."""
        groups = {"motion": self.s, "open": self.now}
        arrays = {f"{g}.{f}": np.array(x) for g, group in groups.items() for f, x in group._asdict().items()}
        return {"k": self.k, "dt": self.dt, "t_start": self.t_start} | arrays

    # -- motion ---------------------------------------------------------------------------------------------------

    def advance(self, limit: float, last: float, until: stop.Until | None, max_events: float) -> Status | None:
        """Take steps until step number `limit`, an event worth a look, or the end of a chunk.

        A free flight goes on to the next touch or to step number `last`: samples do not cut it, so they change no bit.
        """
        if not any(x > 0.0 for x in self.s.xi):
            if isinstance(until, stop.Separated) and self.contacts and self._receding():
                return Status.until
            if self._settled():
                if self._fly(last):
                    return Status.quiet
                if self.k >= limit:
                    return None
        if self.k > MOST_STEPS:
            raise ValueError(f"dt is {self.dt:g}: step {self.k:.3g} is more than can be counted; take a longer step, "
                             "or the method 'located'.")  # fmt: skip
        steps = int(min(CHUNK, limit - self.k))
        arguments = self._arguments(steps, int(min(max_events - self.contacts - 1, 1 << 60)))
        if self.bulk and not isinstance(until, stop.Contact):
            why, k, rows = self.hurry(*arguments, self.bulk)
        else:
            pair, nth = (until.pair, until.nth) if isinstance(until, stop.Contact) else (-1, 0)
            why, k, rows = self.march(*arguments, pair, nth)
        self.steps += k - self.k
        self.k = int(k)
        self.contacts += rows
        if self.keep_log:
            self.rows += [list(row) for row in self.buffer[:rows]]
        if why == loop.UNTIL and isinstance(until, stop.Contact):
            self.halted_at = until.pair
            return Status.until
        if self.contacts >= max_events:
            return Status.max_events
        done = self.steps * len(self.s.xi)
        if self.engine == "auto" and done > WORTH_LOADING and (
            not have_numba() or worth(loop.march, done, WORTH_LOADING, WORTH_MAKING)
        ):
            self._try_to_compile()
        return None

    def _fly(self, last: float) -> bool:
        """Jump whole steps while nothing touches; true if nothing ever will and no end is set."""
        touch = self.time_to_touch(self.s.xi, self.s.v, self.pull)
        if touch == last == math.inf:
            return True
        jump = min(touch // self.dt, last - self.k)
        if jump > 0.0:
            self.take_off = self.k, Motion(*(list(map(float, group)) for group in self.s))
            self.glide(self.s, self.pull, self.fall, jump * self.dt)
            self.k += int(jump)
            self.flights += 1
        return False

    def _settled(self) -> bool:
        """Whether the higher derivatives that Gear's method remembers no longer change any velocity."""
        s, still = self.s, 1e-17 * max(map(abs, self.s.v))
        return all(
            self.dt * abs(a - f) <= still and self.dt * self.dt * abs(j) <= still
            for a, f, j in zip(s.acc, self.fall, s.jerk, strict=True)
        )

    def _receding(self) -> bool:
        lower, upper = self.scene.sides(np.asarray(self.s.v))
        return bool((upper >= lower).all())

    def _try_to_compile(self) -> None:
        self.engine = "plain"
        try:
            self.compile()
        except ImportError:
            self.note = "numba is not installed"
        except NotCompilableError as reason:
            self.note = str(reason)


def _zeros(length: int) -> list[float]:
    return [0.0] * length


def _types(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """Numba types of a kernel's arguments; a force counts as its common function type."""
    import numba

    return tuple(force_type() if callable(a) else numba.typeof(a) for a in arguments)

"""`run`: one scene from start to end, with samples, log and status."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granular import until as stop
from granular._check import Array
from granular._kernels import compiled, have_numba, in_memory, worth
from granular._records import plain
from granular.laws.kinds import SceneLaws, resolved
from granular.md.located import loop
from granular.md.located.build import build, limit, power_form
from granular.md.located.collocation import Collocation
from granular.md.located.creep import LARGEST, SMOOTH, Creep, slowest_decay, swinging
from granular.md.located.readout import look
from granular.md.located.records import ACTIVE, GENERAL, LOG_ROW, to_compiled, to_plain, with_more_room
from granular.md.located.resting import pile
from granular.scene import Scene, positions, velocities
from granular.trajectory import CONTACT, Status, Trajectory

PLAIN_CHUNK, COMPILED_CHUNK = 100, 20_000
"""Pieces between two looks at progress and log."""
FIRST_LOOK = 256
"""Pieces after which the run first looks whether the scene creeps to rest."""
WORTH_LOADING, WORTH_COMPILING = 50_000, 300_000
"""Pieces times pairs after which ``engine="auto"`` goes on compiled if the machine code is on disk, and if it has to be
made; they take about as long to work off interpreted."""


def run(
    scene: Scene,
    laws: SceneLaws | Sequence[Any],
    *,
    t_start: float = 0.0,
    t_end: float = math.inf,
    until: stop.Until | None = None,
    samples: Array | None = None,
    log: bool = True,
    max_events: int = 1_000_000,
    max_steps: int = 20_000_000,
    on_event: Callable[[Any], object] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    engine: str = "auto",
    tol: float = 1e-16,
) -> Trajectory:
    """Run `scene` by located events; arguments as checked by `granular.md.simulate`; laws are tried there only.

    Parameters
    ----------
    tol : float
        Truncation error of a step of nonlinear laws, as a part of the speed and the overlap of the moment. Linear
        laws are always run to rounding.
    """
    one = Run(scene, resolved(laws, scene), t_start, engine, on_event, on_progress)
    limit(one.s, until, tol, max_events, max_steps, 2 * int(log or on_event is not None))
    one.s.run["pause"] = FIRST_LOOK
    one.prepare()
    span = t_end - t_start
    times = [span] if samples is None else [*(samples - t_start).tolist(), span]
    keep = [False] if samples is None else [True] * len(samples) + [False]
    status = one.launch()
    if samples is None:
        one.sample(0.0)
    for t, wanted in zip(times, keep, strict=True):
        status = status or one.advance(t)
        if status is not None:
            break
        if wanted:
            one.sample(t)
    return one.result(status or Status.time, span, samples, log)


class Run:
    """One run under way; its own clock starts at 0, so that a late `t_start` costs no digits."""

    def __init__(
        self, scene: Scene, laws: SceneLaws, t_start: float, engine: str,
        on_event: Callable[[Any], object] | None, on_progress: Callable[[float, int], object] | None,
    ) -> None:  # fmt: skip
        self.scene, self.laws, self.engine, self.t_start = scene, laws, engine, t_start
        self.on_event, self.on_progress = on_event, on_progress
        self.rows: list[list[float]] = []
        self.samples: list[tuple[Any, ...]] = []
        self.reported, self.bound = 0, False
        self.creep: Creep | None = None
        self.s: Any = build(scene, laws, 0.0)
        self.collocation = Collocation(laws) if self.s.kinds["kind"][0] == GENERAL else None
        self.kernels: Callable[[Any], Any] = lambda kernel: kernel

    @property
    def counters(self) -> Any:
        """The record of counters and limits."""
        return plain(self.s.run)[0] if self.engine == "compiled" else self.s.run[0]

    def prepare(self) -> None:
        """Choose between interpreted and compiled for the begin of the run."""
        known = self.collocation is None
        large = self.scene.n_pairs, WORTH_LOADING, WORTH_COMPILING  # to launch is a piece of every pair
        if self.engine == "compiled" or (
            self.engine == "auto" and known and (in_memory(loop.advance) or worth(loop.advance, *large))
        ):
            self.compile()
        else:
            self.s = to_plain(self.s)

    def compile(self) -> None:
        """Go on compiled from the present state: same source, same bits."""
        compiled(loop.advance)  # fails before anything is changed
        if self.collocation is not None:
            odd = next(one.law for one in self.laws.each if power_form(one) is None)
            raise TypeError(
                f"engine 'compiled' knows laws of the form k ξ^p + γ ξ^d ξ̇ only, and {odd!r} is none of them; "
                "engine 'auto' or 'plain' runs it."
            )
        if isinstance(self.s.pairs, list):
            self.s = to_compiled(self.s)
        self.kernels, self.engine = compiled, "compiled"

    def launch(self) -> Status | None:
        """Begin the contacts that are there at the start."""
        return None if self.kernels(loop.launch)(self.s, self.collocation) else Status.until

    def advance(self, limit: float) -> Status | None:
        """Go on to time `limit`; return why the run ends before, or None."""
        while self.creep is None:
            chunk = COMPILED_CHUNK if self.engine == "compiled" else PLAIN_CHUNK
            why = self.kernels(loop.advance)(self.s, limit, chunk, self.collocation)
            self.flush()
            if why == loop.CRAMPED:
                self.s = with_more_room(self.s)
                continue
            if why == loop.REACHED or (why == loop.QUIET and limit < math.inf):
                return None
            if why != loop.MORE:
                return self.end(why)
            if self.counters.steps >= self.counters.pause:
                if self.rests(limit):
                    return Status.resting
                self.kernels(loop.pause_later)(self.s)
            if self.engine == "auto":
                self._compile_if_worth_it()
        return Status.resting if limit == math.inf else None

    def rests(self, limit: float) -> bool:
        """Return whether the scene is proved to come to rest, which ends a run without limit; if it creeps, let it.

        Looked at after 256, 512, 1024 … pieces.
        """
        n = self.scene.n_pairs
        if not self.scene.is_wall[0] or n > LARGEST:
            return False
        state = self.s.pairs, self.s.pool, self.s.bodies
        records, pool, bodies = map(plain, state) if self.engine == "compiled" else state
        piled = pile(records, pool, bodies, n, n)
        pairs = [pool[record.slot] for record in records if record.slot >= 0]
        part = swinging(pairs, piled, bodies)
        if part < (math.inf if limit == math.inf else SMOOTH):
            above = pairs[piled].xi if piled < n else 0.0
            self.creep = Creep(pairs[:piled], bodies[: piled + 1], above, float(bodies[0].v - bodies[-1].v))
        return limit == math.inf and self.creep is not None

    def end(self, why: int) -> Status:
        """Note and return the status in which the loop ended."""
        self.bound = why == loop.BINDING
        if why == loop.QUIET and self.counters.rests:
            return Status.resting
        return {
            loop.STOPPED: Status.until, loop.QUIET: Status.quiet, loop.WORK: Status.max_events,
            loop.REST: Status.resting, loop.BINDING: Status.quiet,
        }[why]  # fmt: skip

    def _compile_if_worth_it(self) -> None:
        work = self.counters.steps * self.counters.pairs
        if work <= WORTH_LOADING:
            return
        if self.collocation is not None or not have_numba():
            self.engine = "plain"
        elif worth(loop.advance, work, WORTH_LOADING, WORTH_COMPILING):
            self.compile()

    def flush(self) -> None:
        """Take the log rows out of the buffer, and tell who wants to know."""
        r = self.counters
        new = [list(map(float, row)) for row in self.s.log[: r.rows]]
        self.kernels(loop.clear_log)(self.s)
        self.rows += new
        if self.on_event is not None:
            for row in contact_rows(new, self.t_start):
                self.on_event(row)
        if self.on_progress is not None and r.steps > self.reported:
            self.reported = int(r.steps)
            self.on_progress(self.t_start + float(r.t), int(r.begun))

    def sample(self, t: float) -> None:
        """Keep a row a time `t` after the start."""
        n = self.scene.n_pairs
        rows: Any = [[0.0] * n for _ in range(3)] if self.engine != "compiled" else np.zeros((3, n))
        self.kernels(look)(self.s, t, rows[0], rows[1], rows[2])
        if self.creep is not None:
            self.follow_creep(t, rows)
        self.samples.append((t, *rows))

    def follow_creep(self, t: float, rows: Any) -> None:
        """Put a pile that creeps into `rows` as it is a time `t` after the start; a gap above it grows as it sinks."""
        assert self.creep is not None
        xi, eta, force = self.creep.after(t)[:3]
        piled = len(xi)
        for row, values in zip(rows, (xi, eta, force), strict=True):
            row[:piled] = values
        if piled < self.scene.n_pairs:
            rows[0][piled], rows[1][piled] = self.creep.flank(t)

    def result(self, status: Status, span: float, samples: Array | None, log: bool) -> Trajectory:
        """Return the trajectory up to where the run has come."""
        r = self.counters
        begun = float(r.t) if self.creep is None else self.creep.start
        end = span if status is Status.time else max([begun, *(row[0] for row in self.samples[-1:])])
        if self.creep is None:
            self.kernels(loop.gather)(self.s, end, self.collocation)
        if samples is None or status is not Status.time:
            self.sample(end)
        rows = contact_rows(self.rows + self.still_open(end) if log else [], self.t_start)
        shared = math.fsum([*self.column("shared"), self.crept(end)[1]]) if log else math.nan
        message = self.message(status, r, self.t_start + end)
        rests, self.s = bool(r.rests) or self.creep is not None, None  # makes room for the rows
        elapsed, xi, eta, force = (np.array(column, np.float64) for column in zip(*self.samples, strict=True))
        if not (np.isfinite(xi).all() and np.isfinite(eta).all()):  # interpreted, it would have raised on the way
            raise OverflowError("an overlap or its rate")
        position, velocity = positions(self.scene, -xi, elapsed), velocities(self.scene, -eta, elapsed)
        time = self.t_start + elapsed
        if samples is not None:  # as asked for, to the last digit
            asked = len(elapsed) - (status is not Status.time)
            time[:asked] = samples[:asked]
        return Trajectory(
            self.scene, self.laws.given, None, time, position, velocity, -xi, force,
            rows[np.lexsort((rows["pair"], rows["t_begin"]))], status, message,
            {
                "engine": "compiled" if self.engine == "compiled" else "plain",
                "steps": int(r.steps), "events": int(r.events), "contacts": int(r.begun),
                "error_estimate": float(r.error), "resting": rests,
                "shared_impulse": shared,
            },
        )  # fmt: skip

    def message(self, status: Status, r: Any, t: float) -> str:
        """Return the sentence of a status with its numbers."""
        sentence = f"{status.value} (t = {t:.6g} s, {r.begun} contacts, {r.steps} steps)"
        if not (r.rests or self.bound or self.creep):
            return sentence
        if status is Status.time:
            sentence += "; the balls rest on each other"
        if self.collocation is not None:
            return f"{sentence}: every force balances to rounding"
        piled = {c: p for c, p in self.members().items() if p.mode == ACTIVE}
        decay = slowest_decay(list(piled.values()), bool(self.scene.is_wall[[0, max(piled) + 1]].all()))
        if self.creep is None:
            energies = f"{r.energy:.3g} J, is less than the {r.barrier:.3g} J that"
            why = f"the energy about the equilibrium, {energies} the first contact needs to open"
        else:
            why = "about the equilibrium, no sum of decaying modes takes a contact force to zero"
        return f"{sentence}: {why}; the slowest motion decays in {decay:.3g} s"

    def column(self, name: str) -> list[Any]:
        """Return one field of all pairs."""
        n = self.scene.n_pairs
        if self.engine == "compiled":
            return list(self.s.pairs[name][:n].tolist())
        return [getattr(p, name) for p in self.s.pairs[:n]]

    def members(self) -> dict[int, Any]:
        """Return the records of pairs in islands as plain objects, by the number of the pair."""
        place = {c: slot for c, slot in enumerate(self.column("slot")) if slot >= 0}
        slots = list(place.values())
        records = plain(self.s.pool[slots]) if self.engine == "compiled" else [self.s.pool[slot] for slot in slots]
        return dict(zip(place, records, strict=True))

    def still_open(self, end: float) -> list[list[float]]:
        """Log rows of contacts that go on at the end."""
        nan = math.nan
        going = {c: p for c, p in self.members().items() if p.begun}
        rows = [
            [c, p.begin, nan, p.lasted, p.lower_in, p.upper_in, nan, nan, p.xi_max, p.force_max, p.impulse]
            for c, p in going.items()
        ]
        if self.creep is not None:
            impulse, _ = self.crept(end)
            for row, xi, force, more in zip(rows, *self.creep.highest(end), impulse, strict=True):
                row[3] += end - self.creep.start
                row[8], row[9], row[10] = max(row[8], xi), max(row[9], force), row[10] + more
        return rows

    def crept(self, end: float) -> tuple[list[float], float]:
        """Impulse of each pair since it creeps, and how much of it neighbours share."""
        if self.creep is None:
            return [], 0.0
        impulse = self.creep.after(end)[3].tolist()
        return impulse, math.fsum(impulse) if len(impulse) > 1 else 0.0


def contact_rows(rows: list[list[float]], t_start: float) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Return rows of the log buffer as `granular.trajectory.CONTACT`."""
    out = np.zeros(len(rows), CONTACT)
    flat = np.array(rows, np.float64).reshape(len(rows), LOG_ROW)
    for i, name in enumerate(("pair", "t_begin", "t_end", "duration")):
        out[name] = flat[:, i]
    out["t_begin"] += t_start
    out["t_end"] += t_start
    out["v_in"], out["v_out"] = flat[:, 4:6], flat[:, 6:8]
    for i, name in enumerate(("xi_max", "force_max", "impulse")):
        out[name] = flat[:, 8 + i]
    return out

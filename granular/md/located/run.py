"""`Run`: one scene under way by located events."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from granular._kernels import compiled, have_numba, in_memory, worth
from granular._records import column, packed, plain
from granular.drive import End, Pause, Row, Rows
from granular.laws.kinds import SceneLaws
from granular.md.located import loop
from granular.md.located.build import build, limit, power_form
from granular.md.located.collocation import Collocation
from granular.md.located.creep import LARGEST, SMOOTH, Creep, slowest_decay, swinging
from granular.md.located.readout import look
from granular.md.located.records import ACTIVE, DORMANT, GENERAL, to_compiled, to_plain, with_more_room
from granular.md.located.resting import pile
from granular.md.rows import CONTACT_ROW
from granular.request import Request
from granular.scene import Scene
from granular.trajectory import Status

PLAIN_CHUNK, COMPILED_CHUNK = 100, 20_000
"""Pieces between two looks at progress and log."""
FIRST_LOOK = 256
"""Pieces after which the run first looks whether the scene creeps to rest."""
WORTH_LOADING, WORTH_COMPILING = 50_000, 300_000
"""Pieces times pairs after which ``engine="auto"`` goes on compiled if the machine code is on disk, and if it has to be
made; they take about as long to work off interpreted."""
WHY = {
    loop.STOPPED: Pause.until, loop.QUIET: Pause.quiet, loop.WORK: Pause.work, loop.REST: Pause.resting,
    loop.BINDING: Pause.quiet,
}  # fmt: skip


class Run:
    """One run under way; its own clock starts at 0, so that a late start costs no digits.

    Parameters
    ----------
    scene, laws : Scene, SceneLaws
        What moves.
    request : Request
        What is asked of it.
    engine : str
        "auto", "plain" or "compiled".
    tol : float
        Truncation error of a step of nonlinear laws, as a part of the speed and the overlap of the moment. Linear
        laws are always run to rounding.
    """

    in_order = False
    rule = None

    def __init__(self, scene: Scene, laws: SceneLaws, request: Request, engine: str, tol: float) -> None:
        self.scene, self.laws, self.law, self.request, self.engine = scene, laws, laws.given, request, engine
        self.seen = 0.0  # s, when a row was last read
        self.bound = False
        self.creep: Creep | None = None
        self.s: Any = build(scene, laws, 0.0)
        limit(self.s, request.until, tol, request.max_events, request.max_steps, 2 * int(request.rows))
        self.s.run["pause"] = FIRST_LOOK
        self.collocation = Collocation(laws) if self.s.kinds["kind"][0] == GENERAL else None
        self.kernels: Callable[[Any], Any] = lambda kernel: kernel
        self.prepare()
        self.launched = self.kernels(loop.launch)(self.s, self.collocation)

    @property
    def counters(self) -> Any:
        """The record of counters and limits."""
        return self.s.run.view(np.recarray)[0] if self.engine == "compiled" else self.s.run[0]

    def prepare(self) -> None:
        """Choose between interpreted and compiled for the start of the run."""
        known = self.collocation is None
        large = self.scene.n_pairs, WORTH_LOADING, WORTH_COMPILING  # to launch is a piece of every pair
        if self.engine == "compiled" or (
            self.engine == "auto" and known and (in_memory(loop.advance) or worth(loop.advance, *large))
        ):
            self.compile()
        else:
            self.s = to_plain(self.s)

    def compile(self) -> None:
        """Go on compiled from the current state: same source, same bits."""
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

    def to(self, time: float, last: bool) -> Pause:
        """Go on to `time`, or a chunk of pieces towards it."""
        limit = time - self.request.start
        if not self.launched:
            return Pause.until
        if self.creep is not None:
            return Pause.resting if limit == math.inf else Pause.reached
        chunk = COMPILED_CHUNK if self.engine == "compiled" else PLAIN_CHUNK
        why = self.kernels(loop.advance)(self.s, limit, chunk, self.collocation)
        if why == loop.CRAMPED:
            self.s = with_more_room(self.s)
            return Pause.full
        if why == loop.REACHED or (why == loop.QUIET and limit < math.inf):
            return Pause.reached
        if why != loop.MORE:
            self.bound = why == loop.BINDING
            return Pause.resting if why == loop.QUIET and self.counters.rests else WHY[why]
        if self.counters.steps >= self.counters.pause:
            if self.rests(limit):
                return Pause.resting
            self.kernels(loop.pause_later)(self.s)
        if self.engine == "auto":
            self._compile_if_worth_it()
        return Pause.full

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

    def _compile_if_worth_it(self) -> None:
        work = self.counters.steps * self.counters.pairs
        if work <= WORTH_LOADING:
            return
        if self.collocation is not None or not have_numba():
            self.engine = "plain"
        elif worth(loop.advance, work, WORTH_LOADING, WORTH_COMPILING):
            self.compile()

    def progress(self) -> tuple[float, int]:
        """Return time in s and number of contacts so far."""
        return self.request.start + float(self.counters.t), int(self.counters.begun)

    def rows(self) -> list[Rows]:
        """Take the contacts that ended out of the buffer."""
        ended = int(self.counters.rows)
        if ended == 0:
            return []
        log = self.s.log[:ended]
        rows = packed(log, CONTACT_ROW) if isinstance(log, list) else log.copy()
        self.kernels(loop.clear_log)(self.s)
        return [self.dated(rows)]

    def dated(self, rows: Rows) -> Rows:
        """Count times from where the caller's clock starts."""
        rows["t_begin"] += self.request.start
        rows["t_end"] += self.request.start
        return rows

    def row(self, time: float) -> Row:
        """Return the scene at `time`."""
        return self.row_after(time - self.request.start, time)

    def row_after(self, elapsed: float, time: float) -> Row:
        """Return the scene a time after the start, which is called `time`."""
        n = self.scene.n_pairs
        rows: Any = [[0.0] * n for _ in range(3)] if self.engine != "compiled" else np.zeros((3, n))
        self.kernels(look)(self.s, elapsed, rows[0], rows[1], rows[2])
        if self.creep is not None:
            self.follow_creep(elapsed, rows)
        gap, rate, force = made = np.asarray(rows)
        if not np.isfinite(made[:2]).all():  # interpreted, it would have raised on the way
            raise OverflowError("an overlap or its rate")
        np.negative(made[:2], out=made[:2])  # of overlaps
        self.seen = elapsed
        return Row(time, elapsed, gap, rate=rate, force=force)

    def follow_creep(self, t: float, rows: Any) -> None:
        """Put a pile that creeps into `rows` as it is a time `t` after the start; a gap above it grows as it sinks."""
        assert self.creep is not None
        xi, eta, force = self.creep.after(t)[:3]
        piled = len(xi)
        for row, values in zip(rows, (xi, eta, force), strict=True):
            row[:piled] = values
        if piled < self.scene.n_pairs:
            rows[0][piled], rows[1][piled] = self.creep.flank(t)

    def end(self, pause: Pause, seen: float) -> End:
        """Return how the run ended, and bring every pair to where it has come."""
        r, status = self.counters, pause.value
        begun = float(r.t) if self.creep is None else self.creep.start
        end = self.request.end - self.request.start if pause is Pause.reached else max(begun, self.seen)
        self.s = self.s._replace(queue=self.s.queue[:1].copy())  # nothing is due any more
        if self.creep is None:
            self.kernels(loop.gather)(self.s, end, self.collocation)
        shared = [*column(self.s.pairs, "shared"), self.crept(end)[1]] if self.request.log else [math.nan]
        stats = {
            "engine": "compiled" if self.engine == "compiled" else "plain",
            "steps": int(r.steps), "events": int(r.events), "contacts": int(r.begun),
            "error_estimate": float(r.error), "resting": bool(r.rests) or self.creep is not None,
            "shared_impulse": math.fsum(shared),
        }  # fmt: skip
        row = self.row_after(end, self.request.start + end) if pause is not Pause.reached or seen == -math.inf else None
        running = self.dated(self.still_open(end)) if self.request.log else None
        message, self.s = self.message(status, r, self.request.start + end), None  # makes room for the log
        return End(row, status, message, stats, running=running)

    def message(self, status: Status, r: Any, t: float) -> str:
        """Return the sentence of a status with its numbers."""
        sentence = f"{status.value} (t = {t:.6g} s, {r.begun} contacts, {r.steps} steps)"
        if not (r.rests or self.bound or self.creep):
            return sentence
        if status is Status.time:
            sentence += "; the balls rest on each other"
        if self.collocation is not None:
            return f"{sentence}: every force balances to rounding"
        piled = {c: p for c, p in self.members().items() if p.mode == ACTIVE or p.mode == DORMANT}
        decay = slowest_decay(list(piled.values()), bool(self.scene.is_wall[[0, max(piled) + 1]].all()))
        if self.creep is None:
            energies = f"{r.energy:.3g} J, is less than the {r.barrier:.3g} J that"
            why = f"the energy about the equilibrium, {energies} the first contact needs to open"
        else:
            why = "about the equilibrium, no sum of decaying modes takes a contact force to zero"
        return f"{sentence}: {why}; the slowest motion decays in {decay:.3g} s"

    def members(self) -> dict[int, Any]:
        """Return the records of pairs in islands as plain objects, by the number of the pair."""
        slot = column(self.s.pairs, "slot")
        place = np.flatnonzero(slot >= 0)
        slots = slot[place].tolist()
        records = plain(self.s.pool[slots]) if self.engine == "compiled" else [self.s.pool[i] for i in slots]
        return dict(zip(place.tolist(), records, strict=True))

    def still_open(self, end: float) -> Rows:
        """Return the contacts that go on at the end."""
        going = {c: p for c, p in self.members().items() if p.begun} if column(self.s.pool, "begun").any() else {}
        rows = np.zeros(len(going), CONTACT_ROW)
        rows["pair"], rows["t_end"], rows["lower_out"], rows["upper_out"] = list(going), math.nan, math.nan, math.nan
        found = {"t_begin": "begin", "duration": "lasted"}
        for name in (*found, "lower_in", "upper_in", "xi_max", "force_max", "impulse"):
            rows[name] = [getattr(p, found.get(name, name)) for p in going.values()]
        if self.creep is not None:
            highest, (impulse, _) = self.creep.highest(end), self.crept(end)
            rows["duration"] += end - self.creep.start
            rows["impulse"] += impulse
            for name, peak in zip(("xi_max", "force_max"), highest, strict=True):
                rows[name] = np.maximum(rows[name], peak)
        return rows

    def crept(self, end: float) -> tuple[list[float], float]:
        """Impulse of each pair since it creeps, and how much of it neighbours share."""
        if self.creep is None:
            return [], 0.0
        impulse = self.creep.after(end)[3].tolist()
        return impulse, math.fsum(impulse) if len(impulse) > 1 else 0.0


"""`Run`: one scene under way by located events."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from granular._kernels import compiled, in_memory, worth
from granular._records import column, one, packed, plain
from granular.drive import End, Pause, Row, Rows
from granular.laws.kinds import SceneLaws
from granular.md.located import blocks
from granular.md.located.collocation import Collocation
from granular.md.located.creep import LARGEST, SMOOTH, Creep, slowest_decay, swinging
from granular.md.located.pieces import look
from granular.md.located.resting import pile
from granular.md.located.system import (
    ACTIVE,
    DORMANT,
    GENERAL,
    power_form,
    system_of,
    to_compiled,
    to_plain,
    with_more_room,
)
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
    blocks.STOPPED: Pause.until, blocks.QUIET: Pause.quiet, blocks.WORK: Pause.work, blocks.REST: Pause.resting,
    blocks.BINDING: Pause.quiet,
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
        limits = {"max_events": request.max_events, "max_steps": request.max_steps, "log": 2 * int(request.rows)}
        self.s: Any = system_of(scene, laws, request.until, tol=tol, pause=FIRST_LOOK, **limits)
        self.collocation = Collocation(laws) if self.s.kinds["kind"][0] == GENERAL else None
        self.kernels: Callable[[Any], Any] = lambda kernel: kernel
        if engine == "compiled" or self.pays(scene.n_pairs):  # to launch is a piece of every pair
            self.compile()
        else:
            self.s = to_plain(self.s)
        self.launched = self.kernels(blocks.launch)(self.s, self.collocation)

    @property
    def counters(self) -> Any:
        """The record of counters and limits."""
        return self.s.run[0] if isinstance(self.s.run, list) else one(self.s.run)

    def pays(self, work: float) -> bool:
        """Return whether to go on compiled, given how many pieces times pairs there are to do, or have been done."""
        if self.engine != "auto" or self.collocation is not None:
            return False
        return in_memory(blocks.advance) or worth(blocks.advance, work, WORTH_LOADING, WORTH_COMPILING)

    def compile(self) -> None:
        """Go on compiled from the current state: same source, same bits."""
        compiled(blocks.advance)  # fails before anything is changed
        if self.collocation is not None:
            odd = next(law.law for law in self.laws.each if power_form(law) is None)
            raise TypeError(
                f"engine 'compiled' knows laws of the form k ξ^p + γ ξ^d ξ̇ only, and {odd!r} is none of them; "
                "engine 'auto' or 'plain' runs it."
            )
        self.s, self.kernels, self.engine = to_compiled(self.s), compiled, "compiled"

    def to(self, time: float, last: bool) -> Pause:
        """Go on to `time`, or a chunk of pieces towards it."""
        limit = time - self.request.start
        if not self.launched:
            return Pause.until
        if self.creep is not None:
            return Pause.resting if limit == math.inf else Pause.reached
        chunk = COMPILED_CHUNK if self.engine == "compiled" else PLAIN_CHUNK
        why, counters = self.kernels(blocks.advance)(self.s, limit, chunk, self.collocation), self.counters
        if why == blocks.CRAMPED:
            self.s = with_more_room(self.s)
            return Pause.full
        if why == blocks.REACHED or (why == blocks.QUIET and limit < math.inf):
            return Pause.reached
        if why != blocks.MORE:
            self.bound = why == blocks.BINDING
            return Pause.resting if why == blocks.QUIET and counters.rests else WHY[why]
        if counters.steps >= counters.pause:
            counters.pause *= 2
            if self.rests(limit):
                return Pause.resting
        if self.creep is None and self.pays(counters.steps * self.scene.n_pairs):
            self.compile()
        return Pause.full

    def rests(self, limit: float) -> bool:
        """Return whether the scene is proved to come to rest, which ends a run without limit; if it creeps, let it.

        Looked at after 256, 512, 1024 … pieces. What creeps needs no kernels any more.
        """
        n = self.scene.n_pairs
        if not self.scene.is_wall[0] or n > LARGEST:
            return False
        s = to_plain(self.s)
        piled = pile(s.pairs, s.pool, s.bodies, s.pairs[0].hi)
        members = [s.pool[pair.slot] for pair in s.pairs if pair.slot >= 0]
        load = column(s.bodies, "load")[1 : piled + 1]
        if swinging(members[:piled], load) < (math.inf if limit == math.inf else SMOOTH):
            self.s, self.kernels = s, lambda kernel: kernel
            above = members[piled] if piled < n else None
            self.creep = Creep(members[:piled], load, above, s.bodies[0].v - s.bodies[-1].v)
        return limit == math.inf and self.creep is not None

    def progress(self) -> tuple[float, int]:
        """Return time in s and number of contacts so far."""
        return self.request.start + float(self.counters.t), int(self.counters.begun)

    def rows(self) -> list[Rows]:
        """Take the contacts that ended out of the buffer."""
        ended, self.counters.rows = int(self.counters.rows), 0
        return [self.dated(packed(self.s.log[:ended], CONTACT_ROW).copy())] if ended else []

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
        made: Any = np.zeros((3, self.scene.n_pairs))
        rows = made.tolist() if isinstance(self.s.run, list) else made
        if self.creep is not None:
            self.creep.show(elapsed)
        self.kernels(look)(self.s, elapsed, rows[0], rows[1], rows[2])
        made = np.asarray(rows)
        if not np.isfinite(made[:2]).all():  # interpreted, it would have raised on the way
            raise OverflowError("an overlap or its rate")
        np.negative(made[:2], out=made[:2])  # of overlaps
        self.seen = elapsed
        return Row(time, elapsed, made[0], rate=made[1], force=made[2])

    def end(self, pause: Pause, seen: float) -> End:
        """Return how the run ended, and bring every pair to where it has come."""
        r, status, impulse = self.counters, pause.value, [0.0]
        begun = float(r.t) if self.creep is None else self.creep.start
        end = self.request.end - self.request.start if pause is Pause.reached else max(begun, self.seen)
        self.s = self.s._replace(queue=self.s.queue[:1].copy())  # nothing is due any more
        if self.creep is None:
            self.kernels(blocks.gather)(self.s, end, self.collocation)
        else:
            impulse = self.creep.finish(end)
        shared = [*column(self.s.pairs, "shared"), math.fsum(impulse) if len(impulse) > 1 else 0.0]
        stats = {
            "engine": "compiled" if self.engine == "compiled" else "plain",
            "steps": int(r.steps), "events": int(r.events), "contacts": int(r.begun),
            "error_estimate": float(r.error), "resting": bool(r.rests) or self.creep is not None,
            "shared_impulse": math.fsum(shared) if self.request.log else math.nan,
        }  # fmt: skip
        row = self.row_after(end, self.request.start + end) if pause is not Pause.reached or seen == -math.inf else None
        running = self.dated(self.still_open()) if self.request.log else None
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
        piled = [p for p in self.members() if p.mode == ACTIVE or p.mode == DORMANT]
        decay = slowest_decay(piled, bool(self.scene.is_wall[[0, piled[-1].number + 1]].all()))
        why = "about the equilibrium, no sum of decaying modes takes a contact force to zero"
        if self.creep is None:
            energies = f"{r.energy:.3g} J, is less than the {r.barrier:.3g} J that"
            why = f"the energy about the equilibrium, {energies} the first contact needs to open"
        return f"{sentence}: {why}; the slowest motion decays in {decay:.3g} s"

    def members(self) -> list[Any]:
        """Return the records of pairs in islands as plain objects, from the bottom up."""
        slot = column(self.s.pairs, "slot")
        slots = slot[slot >= 0].tolist()
        return [self.s.pool[i] for i in slots] if isinstance(self.s.pool, list) else plain(self.s.pool[slots])

    def still_open(self) -> Rows:
        """Return the contacts that go on at the end."""
        going = [p for p in self.members() if p.begun] if column(self.s.pool, "begun").any() else []
        rows = np.zeros(len(going), CONTACT_ROW)
        rows["t_end"] = rows["lower_out"] = rows["upper_out"] = math.nan
        rows["pair"] = [p.number for p in going]
        for name in ("t_begin", "duration", "lower_in", "upper_in", "xi_max", "force_max", "impulse"):
            rows[name] = [getattr(p, name) for p in going]
        return rows

"""A scene of power laws from start to end in many digits: events, contacts, stop conditions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from granular import until as stop
from granular.drive import Pause
from granular.reference.log import ACTIVE, DORMANT, OPEN, RESIDUAL, Logbook, Reference, roused, run_to_end
from granular.reference.motion import Clock, Motion, Piece
from granular.reference.series import Number, Power, first_rise, first_rise_of_parabola

GUARD = 8
"""Digits carried beyond those asked for."""
MOST_STEPS = 20_000


def solve(scene: Any, forms: Sequence[Any], until: stop.Until | None, t_end: float | None, digits: int) -> Reference:
    """Solve a scene of laws F = k ξ^p + γ ξ^d ξ̇, given as (k, p, γ, d) per pair, to about that many digits."""
    from mpmath import MPContext

    mp = MPContext()
    mp.dps = digits + GUARD
    run = Run(mp, scene, forms, until, t_end, digits)
    return run_to_end(run, f"Taylor series of order {run.motion.order}, {digits} digits")


class Run:
    """One run under way: `motion` moves, `Run` deals with events."""

    def __init__(
        self, mp: Any, scene: Any, forms: Sequence[Any], until: stop.Until | None, t_end: float | None, digits: int
    ) -> None:
        self.mp, self.log = mp, Logbook(until)
        self.t, self.t_end = mp.zero, mp.inf if t_end is None else mp.mpf(t_end)
        self.motion = Motion(mp, scene, forms, round(1.25 * digits), mp.mpf(10) ** (-digits - 2))
        least = [min(a.p, a.d + 1) if a.gamma else a.p for a in self.motion.touches]
        self.sleep = [mp.mpf(10) ** (-digits / float(power)) for power in least]
        self.steps = 0

    def launch(self) -> Pause:
        """Begin the contacts that are there at the start."""
        for c, a in enumerate(self.motion.touches):
            if a.xi > 0:
                a.mode = RESIDUAL
                if self.motion.bracket(c) > 0 and self.begin(c):
                    return Pause.until
            elif a.xi == 0 and self.motion.rate(c) == 0:
                a.mode = DORMANT
        self.motion.remember_speed()
        return Pause.full

    def to(self, time: Number) -> Pause:
        """Go on towards `time`: to the next event, or as far as the series hold."""
        if self.steps == MOST_STEPS:
            raise ValueError(f"t_end is missing: after {MOST_STEPS} steps the scene is at t = {float(self.t):.6g} s.")
        self.steps += 1
        motion = self.motion
        self.remember_rest()
        clock = motion.clock()
        piece = motion.expand(clock)
        reach, event = piece.reach, None
        for c in range(len(motion.touches)):
            for act, p in self.watched(piece, clock, c):
                x = first_rise_of_parabola(self.mp, p[:3]) if piece.reach is None else first_rise(self.mp, p, reach)
                if x is not None and (reach is None or x < reach):
                    reach, event = x, (act, c)
        if reach is None:
            return self.reached(time)
        self.t += motion.move(piece, reach)
        if self.t >= time:
            return self.reached(time)
        if event is None:
            return Pause.full
        act, c = event
        done = act(c)
        motion.remember_speed()
        rates = [motion.rate(b) for b in range(len(motion.touches))]
        closed = any(a.mode in (ACTIVE, RESIDUAL) for a in motion.touches)
        return Pause.until if done or self.log.separated(rates, closed) else Pause.full

    def reached(self, time: Number) -> Pause:
        """Nothing more happens before `time`, or ever."""
        if time == self.mp.inf:
            return Pause.quiet
        self.t = time
        return Pause.reached

    def watched(self, piece: Piece, clock: Clock, c: int) -> list[tuple[Any, list[Number]]]:
        """What happens to pair c when a function of x rises through zero."""
        a, x = self.motion.touches[c], piece.x[c]
        if a.mode == OPEN:
            return [(self.touch, x)]
        if a.mode == DORMANT:
            line = self.sleep[c] * self.motion.amplitude(c)
            return [(self.begin, [x[0] - line, *x[1:]]), (self.part, [-x[0] - line, *(-u for u in x[1:])])]
        if a.mode == ACTIVE and a.gamma:
            return [(self.release, [-u for u in piece.phi[c]])]
        if clock.pair == c:  # where ξ has a multiple zero, its root has a simple one
            root = Power(self.mp, x, self.mp.one / a.q, 0)
            x = [root.term(n) for n in range(len(x))]
        parting = (self.part, [-u for u in x])
        if a.bent_residual and self.motion.free:  # it parts ever faster: its bracket can only fall
            return [parting]
        return [parting] if a.mode == ACTIVE else [(self.begin, piece.phi[c]), parting]

    def remember_rest(self) -> None:
        """Remember when pairs that touch at rest were reached by a force: there their contacts begin."""
        touches = self.motion.touches
        moved = roused([a.mode for a in touches], self.motion.pull)
        for c, a in enumerate(touches):
            if a.mode == DORMANT and a.xi == 0 and self.motion.rate(c) == 0 and not (moved[c] and a.since):
                a.since = (self.t, self.speeds(c)) if moved[c] else None

    def touch(self, c: int) -> bool:
        """The overlap of an open pair crosses zero."""
        self.motion.touches[c].xi = self.mp.zero
        return self.begin(c)

    def begin(self, c: int) -> bool:
        """A force sets in; return whether that ends the run, before it acts."""
        a = self.motion.touches[c]
        since = a.since if a.mode == DORMANT else None
        if self.log.begin(c, *(since or (self.t, self.speeds(c)))):
            return True
        a.exact = a.mode == RESIDUAL and self.t > 0
        a.mode = ACTIVE
        return False

    def release(self, c: int) -> None:
        """A damped force falls to zero while there is still overlap."""
        a = self.motion.touches[c]
        a.mode, a.exact = RESIDUAL, True
        self.end(c)

    def part(self, c: int) -> None:
        """The overlap falls to zero; an elastic force ends with it."""
        a = self.motion.touches[c]
        if a.mode == ACTIVE:
            self.end(c)
        if a.mode != DORMANT:
            a.xi = self.mp.zero
        a.mode = OPEN

    def end(self, c: int) -> None:
        """Write the end of a contact into the log."""
        self.log.end(c, self.t, self.speeds(c))

    def speeds(self, c: int) -> tuple[Number, Number]:
        """Velocities of the bodies of pair c in m/s."""
        return self.motion.v[c], self.motion.v[c + 1]

"""A scene from event to event, whoever moves it: contacts begin and end, a stop condition holds, rest is rest.
May be skipped: it measures ourselves.

Between two contacts everything flies on parabolas and is moved there in closed form, but for pendula and beside driven
walls. A thermal wall acts at the touch: such a contact is an instant.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

from granular import until as stop
from granular.reference.heat import Heat
from granular.reference.log import ACTIVE, CLOSED, DORMANT, OPEN, RESIDUAL, Logbook, Reference, roused
from granular.reference.series import Number, first_rise_of_parabola


class Watch(NamedTuple):
    """`what` happens to a pair when sign · (quantity - level) comes from below zero to zero."""

    pair: int
    what: str
    quantity: str
    sign: int = 1
    level: Number = 0


class Motion(Protocol):
    """What moves a scene; numbers are those of `mp` (an mpmath context, or `math`: floats).

    Attributes
    ----------
    t : number
        In s.
    mode : list of str
        Of every pair; written by the events.
    pull : sequence of numbers
        Closing acceleration of every pair in m/s² without contacts: by gravity, constant forces, a driven wall, swing.
    curved : bool
        Whether a wall is driven, or all are pendula: then flights are no parabolas, nor does it end by itself.
    ring : bool
        Whether the last pair joins the last body and the first.
    heat : dict
        Thermal walls by their pairs.
    """

    t: Number
    mode: list[str]
    ring: bool
    heat: dict[int, Heat]

    @property
    def pull(self) -> Any: ...

    @property
    def curved(self) -> bool: ...

    @property
    def mp(self) -> Any:
        """Where its functions are."""

    def now(self, c: int, quantity: str) -> Number:
        """The overlap of pair c in m, its rate in m/s, or the bracket: what has the sign of the unclipped force."""

    def bodies(self, c: int) -> tuple[Number, Number]:
        """Velocities of the bodies of pair c in m/s."""

    def asleep(self, c: int) -> Number:
        """Overlap in m up to which a pair that touches at rest counts as open: nothing beside that of an impact."""

    def ends(self, c: int) -> list[Watch]:
        """What may happen to pair c while its force acts."""

    def fly(self, dt: Number) -> None:
        """Move on without forces."""

    def go(self, watches: list[Watch], end: Number) -> Watch | None:
        """Move on to the first event, to the time `end` in s, or as far as one step goes."""

    def settle(self, c: int, what: str) -> None:
        """Take note of an event of pair c, whose mode is still the old one."""

    def kick(self, c: int) -> None:
        """Let the ball of pair c, which touches a thermal wall, leave it with a speed drawn anew."""

    def account(self) -> tuple[Number, ...] | None:
        """Work of the floor and of the ceiling, heat of both, and what was dissipated, in J; None if nobody knows."""


class Run:
    """One run under way: `motion` moves, the run deals with events."""

    def __init__(self, motion: Motion, until: stop.Until | None, t_end: float | None) -> None:
        self.motion, self.log, self.t_end = motion, Logbook(until), math.inf if t_end is None else t_end
        self.pairs = range(len(motion.mode))
        self.since: dict[int, tuple[Number, tuple[Number, Number]]] = {}
        """When a force reached dormant pairs, and the velocities then: where their contacts begin."""

    def solve(self, solver: str) -> Reference:
        """Take the scene to its end; `solver` is how that is done, in words."""
        status = "until" if any(self.launch(c) for c in self.pairs) else ""
        while not status:
            status = self.step()
        motion = self.motion
        gap, v = tuple(-motion.now(c, "overlap") for c in self.pairs), [motion.bodies(c) for c in self.pairs]
        velocity, account = (*(lower for lower, _ in v), *([] if motion.ring else v[-1][1:])), motion.account()
        return Reference(
            self.log.contacts(), float(motion.t), status, solver, gap=gap, velocity=velocity, account=account
        )

    def launch(self, c: int) -> bool:
        """Begin the contact of pair c if it is there at the start; return whether that ends the run."""
        motion, xi = self.motion, self.motion.now(c, "overlap")
        if xi > 0 and c not in motion.heat:
            motion.mode[c] = RESIDUAL
            return bool(motion.now(c, "bracket") > 0) and self.act(c, "begin")
        motion.mode[c] = DORMANT if xi == 0 and motion.now(c, "rate") == 0 else OPEN
        pressed = c in motion.heat and motion.mode[c] == DORMANT and motion.pull[c] > 0
        return pressed and self.hit(c)

    def step(self) -> str:
        """Go on to the next event, or as far as one step goes; return why that is the end, or nothing."""
        motion = self.motion
        self.rouse()
        watches = [watch for c in self.pairs for watch in self.watches(c)]
        busy = motion.curved or any(mode in CLOSED for mode in motion.mode)
        event = motion.go(watches, self.t_end) if busy else self.fly(watches)
        if motion.t >= self.t_end:
            return "time"
        if not (busy or event):
            if self.t_end == math.inf:
                return "quiet"
            motion.fly(self.t_end - motion.t)
            motion.t = self.t_end
            return "time"
        if event is None:
            return ""
        done, rates = self.act(event.pair, event.what), [motion.now(c, "rate") for c in self.pairs]
        closed = any(mode in CLOSED for mode in motion.mode)
        return "until" if done or self.log.separated(rates, closed) else ""

    def rouse(self) -> None:
        """Remember when pairs that touch at rest were reached by a force."""
        moved = roused(self.motion.mode, self.motion.pull, self.motion.ring)
        for c, mode in enumerate(self.motion.mode):
            if mode == DORMANT and moved[c]:
                self.since.setdefault(c, (self.motion.t, self.motion.bodies(c)))
            else:
                self.since.pop(c, None)

    def watches(self, c: int) -> list[Watch]:
        """What may happen to pair c."""
        mode, line = self.motion.mode[c], self.motion.asleep(c)
        if mode == OPEN:
            return [Watch(c, "touch", "overlap")]
        if mode == DORMANT:
            return [Watch(c, "begin", "overlap", 1, line), Watch(c, "part", "overlap", -1, -line)]
        if mode == RESIDUAL:
            return [Watch(c, "begin", "bracket"), Watch(c, "part", "overlap", -1)]
        return self.motion.ends(c)

    def fly(self, watches: list[Watch]) -> Watch | None:
        """Move on parabolas to the first event, however late; nowhere if there is none before the end."""
        motion, first, event = self.motion, math.inf, None
        for watch in watches:
            c, sign = watch.pair, watch.sign
            p = motion.now(c, "overlap") - watch.level, motion.now(c, "rate"), motion.pull[c] / 2
            x = first_rise_of_parabola(motion.mp, [sign * a for a in p])
            if x is not None and x < first:
                first, event = x, watch
        if event is None or motion.t + first >= self.t_end:
            return None
        motion.fly(first)
        return event

    def act(self, c: int, what: str) -> bool:
        """Apply an event to pair c; return whether it ends the run, before it acts."""
        motion = self.motion
        if c in motion.heat and what != "part":
            return self.hit(c)
        motion.settle(c, what)
        if what in ("touch", "begin"):
            if self.log.begin(c, *(self.since.pop(c, None) or (motion.t, motion.bodies(c)))):
                return True
            motion.mode[c] = ACTIVE
        elif what != "turn":
            if motion.mode[c] == ACTIVE:
                self.log.end(c, motion.t, motion.bodies(c))
            motion.mode[c] = RESIDUAL if what == "release" else OPEN
        return False

    def hit(self, c: int) -> bool:
        """Let the ball of pair c hit its thermal wall; return whether that ends the run, before it acts."""
        motion = self.motion
        self.since.pop(c, None)
        motion.mode[c] = OPEN
        motion.settle(c, "touch")
        if self.log.begin(c, motion.t, motion.bodies(c)):
            return True
        motion.kick(c)
        self.log.end(c, motion.t, motion.bodies(c))
        return False

"""Events of a reference solution: contacts, stop condition and rest, with a log.

The log is a list of contacts. Its numbers have any precision, and their errors are estimated. Between contacts, balls
move on parabolas in closed form, except for pendula and with driven walls. A contact with a thermal wall is
instantaneous.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

from granular.run import until as stop
from granular.studies.reference_walls import Heat, Number

OPEN, ACTIVE, RESIDUAL, DORMANT = "open", "active", "residual", "dormant"
"""Modes of a pair: no overlap, force, force clipped to zero, touching at rest."""
CLOSED_MODES = (ACTIVE, RESIDUAL)


@dataclass(frozen=True, slots=True)
class ReferenceContact:
    """One contact, with mpmath numbers or floats.

    Attributes
    ----------
    pair : int
        Number of the pair.
    t_begin, t_end : number
        Onset and end in s. `t_end` is None while the contact lasts.
    v_in, v_out : pair of numbers
        Velocities of the lower and the upper body in m/s at onset and end. `v_out` is None while the contact lasts.
    """

    pair: int
    t_begin: Any
    v_in: tuple[Any, Any]
    t_end: Any = None
    v_out: Any = None


@dataclass(frozen=True)
class Reference:
    """A reference solution of a scene, independent of the engines.

    Attributes
    ----------
    contacts : tuple of ReferenceContact
        Contacts by onset.
    t_stop : float
        End of the run in s.
    status : str
        Reason of the end: "time", "until" or "quiet".
    solver : str
        Solver with its settings.
    velocity_error : float
        Estimated error of velocities in units of the impact speed, from a second run with other settings.
    time_error : float
        Estimated error of contact times in units of the longest contact.
    gap, velocity : tuple of numbers
        Gaps in m and velocities in m/s at the end.
    account : tuple of numbers or None
        Energy balance in J from the start to the end: work of the floor and of the ceiling, heat of both, and
        dissipated energy. Only solutions by power series contain it, for driven or thermal walls.
    """

    contacts: tuple[ReferenceContact, ...]
    t_stop: float
    status: str
    solver: str
    velocity_error: float = math.nan
    time_error: float = math.nan
    gap: tuple[Any, ...] = field(default=(), repr=False)
    velocity: tuple[Any, ...] = field(default=(), repr=False)
    account: tuple[Any, ...] | None = field(default=None, repr=False)

    @property
    def impact_speed(self) -> float:
        """Largest approach speed in m/s at an onset.

        If no contact begins with an approach speed, it is the largest separation speed, or nan if no contact ended.
        """
        closing = max((float(row.v_in[0] - row.v_in[1]) for row in self.contacts), default=0.0)
        parting = (float(row.v_out[1] - row.v_out[0]) for row in self.contacts if row.v_out is not None)
        return closing if closing > 0.0 else max(parting, default=math.nan)

    @property
    def durations(self) -> tuple[float, ...]:
        """Durations in s of the contacts that ended, without thermal walls.

        Contacts with thermal walls have no duration.
        """
        ended = (row for row in self.contacts if row.t_end is not None and row.t_end > row.t_begin)
        return tuple(float(row.t_end - row.t_begin) for row in ended)

    def of(self, pair: int) -> tuple[ReferenceContact, ...]:
        """Return the contacts of one pair."""
        return tuple(row for row in self.contacts if row.pair == pair)


class Logbook:
    """Log of the contacts so far, and state of the stop condition."""

    def __init__(self, until: stop.Until | None) -> None:
        self.until, self.rows, self.running = until, list[ReferenceContact](), dict[int, int]()

    def begin(self, pair: int, t: Any, v: tuple[Any, Any]) -> bool:
        """Record the onset of a contact. Return True if the stop condition ends the run.

        In this case the contact is not recorded. `t` is the time in s, `v` the velocities of the two bodies in m/s.
        """
        nth = 1 + sum(row.pair == pair for row in self.rows)
        if isinstance(self.until, stop.Contact) and (self.until.pair, self.until.nth) == (pair, nth):
            return True
        self.running[pair] = len(self.rows)
        self.rows.append(ReferenceContact(pair, t, v))
        return False

    def end(self, pair: int, t: Any, v: tuple[Any, Any]) -> None:
        """Record the end of the unfinished contact of a pair.

        `t` is the time in s, `v` the velocities of the two bodies in m/s.
        """
        row = self.running.pop(pair)
        self.rows[row] = replace(self.rows[row], t_end=t, v_out=v)

    def separated(self, rates: Sequence[Any], closed: bool) -> bool:
        """Return whether the stop condition `until.separated` is met.

        `rates` are the rates of all overlaps in m/s, and `closed` states whether a pair overlaps.
        """
        has_ended_contact = isinstance(self.until, stop.Separated) and any(row.t_end is not None for row in self.rows)
        return has_ended_contact and not closed and all(rate <= 0 for rate in rates)

    def contacts(self) -> tuple[ReferenceContact, ...]:
        """Return all contacts by onset."""
        return tuple(sorted(self.rows, key=lambda row: (row.t_begin, row.pair)))


def first_rise_of_parabola(mp: Any, p: Sequence[Number]) -> Number | None:
    """Return the first x ≥ 0 at which a parabola rises through zero, or None.

    The parabola is p_0 + p_1 x + p_2 x². `mp` is an mpmath context, or `math` for floats.
    """
    c, b, a = p
    if c == 0 and b < 0:  # the root at 0 is already processed
        return -b / a if a > 0 else None
    if c > 0 or (c == 0 and (b > 0 or a > 0)):
        return 0 * c
    square = b * b - 4 * a * c
    if c == 0 or square < 0 or (b <= 0 and a <= 0):
        return None
    root = mp.sqrt(square)
    return 2 * c / (-b - root) if b > 0 else (root - b) / (2 * a)


def reached_by_force(modes: Sequence[str], pull: Sequence[Any], ring: bool = False) -> list[bool]:
    """Return for each pair whether a force acts on it, directly or through neighbours.

    Forces are transmitted by touching pairs. They begin at active pairs, and at touching pairs whose acceleration
    `pull` presses them together. `ring` states whether the first pair is a neighbour of the last pair.
    """
    reached = [mode == ACTIVE or (mode == DORMANT and g > 0) for mode, g in zip(modes, pull, strict=True)]
    n = len(modes)
    for direction in (1, -1):
        for c in [*range(n)[::direction]] * (2 if ring else 1):
            neighbour = (c - direction) % n if ring or 0 <= c - direction < n else c
            reached[c] = reached[c] or (modes[c] != OPEN and reached[neighbour])
    return reached


def distance(first: Reference, second: Reference, convert: Any = float) -> tuple[float, float]:
    """Return the largest differences of velocities and contact times of two solutions.

    Velocities after contacts and at a common end time are compared. The differences have the units of `Reference`, and
    are inf if the contacts differ. `convert` converts numbers before the difference is computed.
    """
    if len({tuple((row.pair, row.t_end is None) for row in each.contacts) for each in (first, second)}) > 1:
        return math.inf, math.inf
    contact_pairs = [*zip(first.contacts, second.contacts, strict=True)]
    ended = [(a, b) for a, b in contact_pairs if a.t_end is not None]
    times = [(a.t_begin, b.t_begin) for a, b in contact_pairs] + [(a.t_end, b.t_end) for a, b in ended]
    speeds = [pair for a, b in ended for pair in zip(a.v_out, b.v_out, strict=True)]
    if first.status == second.status == "time":
        speeds += zip(first.velocity, second.velocity, strict=True)
    v_error, t_error = (
        max((float(abs(convert(x) - convert(y))) for x, y in numbers), default=0.0) for numbers in (speeds, times)
    )
    return v_error / first.impact_speed, t_error / max(first.durations, default=math.nan)


class Watch(NamedTuple):
    """Possible event `what` of a pair: sign · (quantity - level) rises through zero.

    `quantity` is "overlap" in m, "rate" in m/s or "bracket". `level` has the same unit.
    """

    pair: int
    what: str
    quantity: str
    sign: int = 1
    level: Number = 0


class Motion(Protocol):
    """Interface of a solver that advances a scene from event to event.

    Numbers belong to `mp`, an mpmath context, or `math` (floats).

    Attributes
    ----------
    t : number
        Time in s.
    mode : list of str
        Mode of every pair, changed by events.
    pull : sequence of numbers
        Closing acceleration of every pair in m/s² without contacts: by gravity, constant forces, a driven wall,
        pendula.
    curved : bool
        Whether a wall is driven, or all balls are pendula. Free flights are then not parabolas, and the run only ends
        at the end time or the stop condition.
    ring : bool
        Whether the last pair joins the last body and the first one.
    heat : dict
        Thermal walls by the number of their pair.
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
        """Module or context of the mathematical functions."""

    def now(self, c: int, quantity: str) -> Number:
        """Return a quantity of pair c: "overlap" in m, "rate" in m/s, or "bracket".

        "bracket" has the sign of the force before it is clipped.
        """

    def bodies(self, c: int) -> tuple[Number, Number]:
        """Return the velocities of the lower and the upper body of pair c in m/s."""

    def resting_overlap(self, c: int) -> Number:
        """Return the overlap in m up to which pair c, touching at rest, has no force.

        It is negligible compared with the overlap of an impact.
        """

    def ends(self, c: int) -> list[Watch]:
        """Return the possible events of pair c while its force acts."""

    def fly(self, dt: Number) -> None:
        """Advance by the time `dt` in s without contact forces."""

    def go(self, watches: list[Watch], end: Number) -> Watch | None:
        """Advance to the first event, to the time `end` in s, or by one step.

        Returns the event, or None.
        """

    def record_event(self, c: int, what: str) -> None:
        """Update the data of pair c for the event `what`, before its mode changes."""

    def kick(self, c: int) -> None:
        """Give the ball of pair c a new, random speed after it hit a thermal wall."""

    def account(self) -> tuple[Number, ...] | None:
        """Return work of floor and ceiling, heat of both, and dissipated energy in J.

        Returns None without an energy balance.
        """


class Run:
    """One run: `motion` advances the scene, and `Run` processes the events."""

    def __init__(self, motion: Motion, until: stop.Until | None, t_end: float | None) -> None:
        self.motion, self.log, self.t_end = motion, Logbook(until), math.inf if t_end is None else t_end
        self.pairs = range(len(motion.mode))
        self.since: dict[int, tuple[Number, tuple[Number, Number]]] = {}
        """Time at which a force reached dormant pairs, and velocities then.

        Their contacts begin there.
        """

    def solve(self, solver: str) -> Reference:
        """Solve the scene to its end. `solver` is a description of the method."""
        status = "until" if any(self.begin_initial_contact(c) for c in self.pairs) else ""
        while not status:
            status = self.step()
        motion = self.motion
        gap, v = tuple(-motion.now(c, "overlap") for c in self.pairs), [motion.bodies(c) for c in self.pairs]
        velocity, account = (*(lower for lower, _ in v), *([] if motion.ring else v[-1][1:])), motion.account()
        return Reference(
            self.log.contacts(), float(motion.t), status, solver, gap=gap, velocity=velocity, account=account
        )

    def begin_initial_contact(self, c: int) -> bool:
        """Set the mode of pair c at the start, and begin its contact if it exists.

        Returns whether this contact meets the stop condition.
        """
        motion, xi = self.motion, self.motion.now(c, "overlap")
        if xi > 0 and c not in motion.heat:
            motion.mode[c] = RESIDUAL
            return bool(motion.now(c, "bracket") > 0) and self.apply_event(c, "begin")
        motion.mode[c] = DORMANT if xi == 0 and motion.now(c, "rate") == 0 else OPEN
        pressed = c in motion.heat and motion.mode[c] == DORMANT and motion.pull[c] > 0
        return pressed and self.hit_thermal_wall(c)

    def step(self) -> str:
        """Advance to the next event, or by one step. Return the status at an end, else ""."""
        motion = self.motion
        self.record_loading_times()
        watches = [watch for c in self.pairs for watch in self.watches(c)]
        busy = motion.curved or any(mode in CLOSED_MODES for mode in motion.mode)
        event = motion.go(watches, self.t_end) if busy else self.fly_to_event(watches)
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
        is_stopped, rates = self.apply_event(event.pair, event.what), [motion.now(c, "rate") for c in self.pairs]
        closed = any(mode in CLOSED_MODES for mode in motion.mode)
        return "until" if is_stopped or self.log.separated(rates, closed) else ""

    def record_loading_times(self) -> None:
        """Record when a force first reaches each pair that touches at rest.

        The force comes from a neighbouring pair, or from an acceleration that presses the pair together. If the contact
        of the pair begins later, this time and these velocities are used as its onset. The record is deleted if the
        force vanishes before.
        """
        is_pushed = reached_by_force(self.motion.mode, self.motion.pull, self.motion.ring)
        for c, mode in enumerate(self.motion.mode):
            if mode == DORMANT and is_pushed[c]:
                self.since.setdefault(c, (self.motion.t, self.motion.bodies(c)))
            else:
                self.since.pop(c, None)

    def watches(self, c: int) -> list[Watch]:
        """Return the possible events of pair c."""
        mode, resting_overlap = self.motion.mode[c], self.motion.resting_overlap(c)
        if mode == OPEN:
            return [Watch(c, "touch", "overlap")]
        if mode == DORMANT:
            return [Watch(c, "begin", "overlap", 1, resting_overlap), Watch(c, "part", "overlap", -1, -resting_overlap)]
        if mode == RESIDUAL:
            return [Watch(c, "begin", "bracket"), Watch(c, "part", "overlap", -1)]
        return self.motion.ends(c)

    def fly_to_event(self, watches: list[Watch]) -> Watch | None:
        """Advance on parabolas to the first event before `t_end`, and return the event.

        Without such an event, the scene does not move, and None is returned.
        """
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

    def apply_event(self, c: int, what: str) -> bool:
        """Apply the event `what` to pair c. Return whether it meets the stop condition.

        A contact begins at "touch" (an open pair closes) and at "begin" (the force begins in a pair that already
        touches or overlaps). If it is the contact of the stop condition, True is returned and the contact is not
        recorded. The other events are "turn" (the law changes its branch), "release" (the force ends, the overlap
        remains) and "part" (the overlap ends).
        """
        motion = self.motion
        if c in motion.heat and what != "part":
            return self.hit_thermal_wall(c)
        motion.record_event(c, what)
        if what in ("touch", "begin"):
            # a pair touching at rest: its contact began when the force reached it
            if self.log.begin(c, *(self.since.pop(c, None) or (motion.t, motion.bodies(c)))):
                return True
            motion.mode[c] = ACTIVE
        elif what != "turn":
            if motion.mode[c] == ACTIVE:
                self.log.end(c, motion.t, motion.bodies(c))
            motion.mode[c] = RESIDUAL if what == "release" else OPEN
        return False

    def hit_thermal_wall(self, c: int) -> bool:
        """Let the ball of pair c collide with its thermal wall.

        Returns whether this contact meets the stop condition. In this case the ball is not thrown back.
        """
        motion = self.motion
        self.since.pop(c, None)
        motion.mode[c] = OPEN
        motion.record_event(c, "touch")
        if self.log.begin(c, motion.t, motion.bodies(c)):
            return True
        motion.kick(c)
        self.log.end(c, motion.t, motion.bodies(c))
        return False

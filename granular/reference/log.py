"""What a reference solution says: contacts to more digits than a double has, and how far they can be trusted.
May be skipped: it measures ourselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from granular import until as stop

OPEN, ACTIVE, RESIDUAL, DORMANT = "open", "active", "residual", "dormant"
"""No overlap · a force acts · overlap, but the force is clipped to zero · touching at rest."""
CLOSED = (ACTIVE, RESIDUAL)


@dataclass(frozen=True, slots=True)
class ReferenceContact:
    """One contact; numbers are mpmath numbers or floats.

    Attributes
    ----------
    pair : int
        Number of the pair.
    t_begin, t_end : number
        In s; `t_end` is None while the contact lasts.
    v_in, v_out : pair of numbers
        Velocities of the lower and the upper body in m/s at its onset and end; `v_out` is None while the contact lasts.
    """

    pair: int
    t_begin: Any
    v_in: tuple[Any, Any]
    t_end: Any = None
    v_out: Any = None


@dataclass(frozen=True)
class Reference:
    """A scene solved independently of the engines.

    Attributes
    ----------
    contacts : tuple of ReferenceContact
        In the order in which they begin.
    t_stop : float
        When the run ended, in s.
    status : str
        Why it ended: "time", "until" or "quiet".
    solver : str
        What solved it, with its settings.
    velocity_error : float
        Estimated error of velocities in units of the impact speed, from a second run with other settings.
    time_error : float
        Estimated error of contact times in units of the longest contact.
    gap, velocity : tuple of numbers
        Gaps in m and velocities in m/s when it ended.
    account : tuple of numbers or None
        By series where walls move or heat, in J until then, as in the ledger of a run: work of the floor and of the
        ceiling, heat of both, and what was dissipated.
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
        """Largest closing speed in m/s at which a contact began, or else largest speed of parting; nan without both."""
        closing = max((float(row.v_in[0] - row.v_in[1]) for row in self.contacts), default=0.0)
        parting = (float(row.v_out[1] - row.v_out[0]) for row in self.contacts if row.v_out is not None)
        return closing if closing > 0.0 else max(parting, default=math.nan)

    @property
    def durations(self) -> tuple[float, ...]:
        """Durations in s of the contacts that ended, but for the instants at thermal walls."""
        ended = (row for row in self.contacts if row.t_end is not None and row.t_end > row.t_begin)
        return tuple(float(row.t_end - row.t_begin) for row in ended)

    def of(self, pair: int) -> tuple[ReferenceContact, ...]:
        """The contacts of one pair."""
        return tuple(row for row in self.contacts if row.pair == pair)


class Logbook:
    """Contacts as they begin and end, and what the stop condition makes of them."""

    def __init__(self, until: stop.Until | None) -> None:
        self.until = until
        self.rows: list[ReferenceContact] = []
        self.running: dict[int, int] = {}

    def begin(self, pair: int, t: Any, v: tuple[Any, Any]) -> bool:
        """Write down a contact; return whether the stop condition forbids it instead."""
        nth = 1 + sum(row.pair == pair for row in self.rows)
        if isinstance(self.until, stop.Contact) and (self.until.pair, self.until.nth) == (pair, nth):
            return True
        self.running[pair] = len(self.rows)
        self.rows.append(ReferenceContact(pair, t, v))
        return False

    def end(self, pair: int, t: Any, v: tuple[Any, Any]) -> None:
        """Write down the end of the contact of a pair that is running."""
        row = self.running.pop(pair)
        self.rows[row] = replace(self.rows[row], t_end=t, v_out=v)

    def separated(self, rates: Sequence[Any], closed: bool) -> bool:
        """Whether the run is over because everything has parted, with these overlap rates."""
        over = isinstance(self.until, stop.Separated) and any(row.t_end is not None for row in self.rows)
        return over and not closed and all(rate <= 0 for rate in rates)

    def contacts(self) -> tuple[ReferenceContact, ...]:
        """All contacts in the order in which they began."""
        return tuple(sorted(self.rows, key=lambda row: (row.t_begin, row.pair)))


def roused(modes: Sequence[str], pull: Sequence[Any], ring: bool = False) -> list[bool]:
    """Whether each pair is reached by a force through neighbours that touch, or pressed together by gravity."""
    reached = [mode == ACTIVE or (mode == DORMANT and g > 0) for mode, g in zip(modes, pull, strict=True)]
    n = len(modes)
    for way in (1, -1):
        for c in [*range(n)[::way]] * (2 if ring else 1):
            beside = (c - way) % n if ring or 0 <= c - way < n else c
            reached[c] = reached[c] or (modes[c] != OPEN and reached[beside])
    return reached


def distance(one: Reference, other: Reference, convert: Any = float) -> tuple[float, float]:
    """Largest differences of velocities after contacts and at an end time, and of contact times, as in `Reference`.

    Infinite if the contacts are not the same.
    """
    if len({tuple((row.pair, row.t_end is None) for row in each.contacts) for each in (one, other)}) > 1:
        return math.inf, math.inf
    both = [*zip(one.contacts, other.contacts, strict=True)]
    ended = [(a, b) for a, b in both if a.t_end is not None]
    times = [(a.t_begin, b.t_begin) for a, b in both] + [(a.t_end, b.t_end) for a, b in ended]
    speeds = [pair for a, b in ended for pair in zip(a.v_out, b.v_out, strict=True)]
    if one.status == other.status == "time":
        speeds += zip(one.velocity, other.velocity, strict=True)
    v_error, t_error = (
        max((float(abs(convert(x) - convert(y))) for x, y in numbers), default=0.0) for numbers in (speeds, times)
    )
    return v_error / one.impact_speed, t_error / max(one.durations, default=math.nan)

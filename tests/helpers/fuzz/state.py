"""What the independent solver knows of a scene under way."""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from tests.helpers.fuzz.arithmetic import formula
from tests.helpers.fuzz.steps import ACTIVE, RESIDUAL, RESTING

System = namedtuple("System", "kind law w pull fall mode branch top armed count contact number work")
"""Laws, inverse masses, gravity; per pair its mode, branch, largest overlap, whether its bracket has left 0, contacts
so far, and the contact that goes on: time of touch (nan: none), duration, v_in (2), ξ_max, F_max."""

T, LOST, V, H, EPS, TOL, DELTA = range(7)
"""Places in `number`: time and what is lost of it, scales of speed and step, rounding, tolerance, difference step."""

TIME, UNTIL, QUIET, TOUCH, TIRED = range(5)
"""Why a march ends; TOUCH: the contact to stop at began at an earlier touch at rest."""


@formula
def advance_clock(s: Any, h: Any) -> None:
    """Add to the time, with what rounding loses, and to the durations."""
    t = s.number[T]
    new = t + (h + s.number[LOST])
    s.number[LOST] = (h + s.number[LOST]) - (new - t)
    s.number[T] = new
    for c in range(len(s.kind)):
        if s.mode[c] == ACTIVE or s.mode[c] == RESTING:
            s.contact[c][1] = s.contact[c][1] + h


@formula
def busy(s: Any, y: Any) -> bool:
    """Whether any pair is in contact or about to be."""
    n = len(s.kind)
    for c in range(n):
        if s.mode[c] == ACTIVE or s.mode[c] == RESIDUAL:
            return True
        if s.mode[c] == RESTING and (s.pull[c] > 0.0 or y[c] != 0.0 or y[n + c] != 0.0):
            return True
    return False


@formula
def parted(s: Any, y: Any) -> bool:
    """Whether, after a contact, all pairs are open and none approaches."""
    n, any_so_far = len(s.kind), False
    for c in range(n):
        if s.mode[c] == ACTIVE or s.mode[c] == RESIDUAL or y[n + c] > 0.0:
            return False
        any_so_far = any_so_far or s.count[c] > 0
    return any_so_far

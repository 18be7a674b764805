"""What moves as one: bodies on a wall, or pressed together by forces, and the closing accelerations that they have.
May be skipped: rarer, walls that shake.
"""

from __future__ import annotations

from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.collision import at_rest
from granular.edmd.driven import BOTH, CEILING, FLOOR, FREE
from granular.edmd.motion import Walls


@kernel
def is_closed(pair: Record, lower: Record, upper: Record) -> bool:
    """Return whether the bodies of a pair move as one."""
    return pair.shut > FREE or (pair.gap == 0.0 and pair.pull == 0.0 and upper.u == lower.u and pair.wall < 0)  # type: ignore[no-any-return]


@kernel
def held(body: Record) -> bool:
    """Return whether a ball rests on a wall, or is pressed against others by forces."""
    return at_rest(body) or body.push != body.own


@kernel
def pressed(body: Record) -> bool:
    """Return whether a ball in mid-air is pressed against others by forces."""
    return body.falls > 0.0 and body.push != body.own  # type: ignore[no-any-return]


@rare
@kernel
def common(bodies: Records, b: int, e: int) -> float:
    """Return the acceleration (m/s²) by the forces on bodies `b` … `e` together."""
    own, more, mass = bodies[e].own, 0.0, 0.0
    for i in range(b, e + 1):
        mass += bodies[i].mass
        more += bodies[i].mass * (bodies[i].own - own)
    return own + more / mass  # type: ignore[no-any-return]


@rare
@kernel
def again(run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls) -> tuple[int, int]:
    """Set pulls of pairs `first` … `last`, and of what forces press on the walls; return all those pairs."""
    if walls[0][0].forces:
        first = 0 if pairs[0].shut == FLOOR else first
        last = len(pairs) - 1 if pairs[len(pairs) - 1].shut == CEILING else last
    repull(run, pairs, bodies, first, last, walls)
    return first, last


@rare
@kernel
def repull(run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls) -> None:
    """Set the closing accelerations of pairs `first` … `last`; of a shut pair, that of all that rests beyond it."""
    for c in range(first, last + 1):
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        below = lower.falls == 0.0 and walls[0][0].panels > 0 and pair.shut != CEILING
        above = upper.falls == 0.0 and walls[0][1].panels > 0 and pair.shut != FLOOR
        pair.wall = BOTH if below and above else 0 if below else 1 if above else -1
        before = pair.pull
        if pair.shut == FLOOR:
            top = c + 1
            while top < len(pairs) and pairs[top].shut == FLOOR:
                top += 1
            pair.pull = run.gravity - common(bodies, c + 1, top)
        elif pair.shut == CEILING:
            low = c
            while low > 0 and pairs[low - 1].shut == CEILING:
                low -= 1
            pair.pull = common(bodies, low, c) - run.gravity
        else:
            pair.pull = run.gravity * (upper.falls - lower.falls) - (upper.push - lower.push)
        if pair.shut > FREE and pair.pull != before and pair.at < run.now:
            pair.at = run.now

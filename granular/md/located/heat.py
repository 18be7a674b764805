"""Thermal walls: a ball that touches one is thrown back at once, at a speed drawn anew.
May be skipped: rarer, walls that heat.

At the touch (gap 0, closing) the rate of the pair jumps, and so does that of the pair beside it: a contact that takes
no time, with the same flank test as others (`isolated`). Where that fails, the pair is STRUCK, its neighbour joins the
island, and the ball is thrown back before blocks are formed anew; all pieces begin again. With the ball's speeds v
towards the wall and v2 away from it, both as the wall sees them, the wall gives

    heat = ½ m (v2² - v²) ,   momentum m (v + v2) ,   and work, if it moves at speed w along that, w m (v + v2) .
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.ledger import CEILING, FLOOR, add
from granular.md.located.log import velocity_now
from granular.md.located.records import OPEN
from granular.walls.thermal import drawn

HEAT = 2
"""Place in the ledger of the heat of the floor; that of the ceiling follows."""


@kernel
def speed_away(ledger: Any, wall: int) -> float:
    """Return the speed in m/s with which the next ball leaves a thermal wall, -1 the floor, -2 the ceiling."""
    book, side = ledger[0], -1 - wall
    return drawn(book.temperature[side], book.seed[side], side, book.hits[side], book.mass[side])


@kernel
def count_hit(s: Any, c: int, v: float, v2: float) -> None:
    """Enter a hit of the thermal wall of pair `c` into the ledger; the next one draws another number."""
    book, side = s.ledger[0], -1 - s.pairs[c].wall
    book.hits[side] += 1
    mass, wall = book.mass[side], s.bodies[c + side]
    add(book, HEAT + side, 0.5 * mass * (v2 - v) * (v2 + v))
    if wall.v != 0.0:
        add(book, CEILING if side else FLOOR, mass * (v + v2) * (-wall.v if side else wall.v))


@kernel
def thrown(s: Any, c: int) -> float:
    """Throw back the ball of pair `c`, which is STRUCK; return by how much its rate of closing on its other neighbour
    grows."""
    run, member, side = s.run[0], s.pool[s.pairs[c].slot], -1 - s.pairs[c].wall
    ball, wall = s.bodies[c + 1 - side], s.bodies[c + side]
    v, v2 = member.eta, speed_away(s.ledger, s.pairs[c].wall)
    before = velocity_now(ball, run)
    ball.v, ball.t, ball.tail = (wall.v - v2 if side else wall.v + v2), run.t, run.tail
    member.xi, member.eta, member.mode, member.exact, s.pairs[c].alone = 0.0, -v2, OPEN, 0, 0
    if run.log > 0:
        row = s.log[run.rows]
        run.rows += 1
        row.pair, row.t_begin, row.t_end, row.duration = c, run.t, run.t, 0.0
        row.lower_in, row.upper_in = (before, wall.v) if side else (wall.v, before)
        row.lower_out, row.upper_out = (ball.v, wall.v) if side else (wall.v, ball.v)
        row.xi_max, row.force_max, row.impulse = 0.0, math.nan, s.ledger[0].mass[side] * (v + v2)
    count_hit(s, c, v, v2)
    kick: float = v + v2
    return kick

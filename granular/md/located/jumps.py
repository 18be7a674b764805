"""Where a velocity jumps: that of a driven wall, or of a ball that a thermal wall throws back, at a speed drawn anew.

At the touch (gap 0, closing) the rate of the pair jumps, and so does that of the pair beside it: a contact that takes
no time, with the same flank test as others (`meet`). Where that fails, the pair is STRUCK, its neighbour joins the
island, and the ball is thrown back before blocks are formed anew; all pieces begin again. With the ball's speeds v
towards the wall and v2 away from it, both as the wall sees them, the wall gives

    heat = ½ m (v2² - v²) ,   momentum m (v + v2) ,   and work, if it moves at speed w along that, w m (v + v2) .
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.contacts import AWAITED, NONE, SOME, activate, pushes
from granular.md.located.ledger import CEILING, FLOOR, add
from granular.md.located.log import end_contact, velocity_now
from granular.md.located.pieces import ULP, power
from granular.md.located.records import ACTIVE, DORMANT, NO_LOG, OPEN, RESIDUAL, STRUCK
from granular.md.located.walls import jump_at
from granular.scene.walls.thermal import drawn

HEAT = 2
"""Place in the ledger of the heat of the floor; that of the ceiling follows."""
SAME, CHANGED, ENDS = range(3)
"""What `pass_edge` comes to: the blocks stay, are to be formed anew, or the run is to stop."""


@kernel
def speed_away(ledger: Any, wall: int) -> float:
    """Return the speed in m/s with which the next ball leaves a thermal wall, -1 the floor, -2 the ceiling."""
    book, side = ledger[0], -1 - wall
    return drawn(book.temperature[side], book.seed[side], side, book.contacts[side], book.mass[side])


@kernel
def count_hit(s: Any, c: int, v: float, v2: float) -> None:
    """Enter a hit of the thermal wall of pair `c` into the ledger; the next one draws another number."""
    book, side = s.ledger[0], -1 - s.pairs[c].wall
    book.contacts[side] += 1
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
    member.xi, member.eta, member.mode, member.exact, s.pairs[c].isolated = 0.0, -v2, OPEN, 0, 0
    if run.log_level != NO_LOG:
        row = s.log[run.rows]
        run.rows += 1
        row.pair, row.t_begin, row.t_end, row.duration = c, run.t, run.t, 0.0
        row.lower_in, row.upper_in = (before, wall.v) if side else (wall.v, before)
        row.lower_out, row.upper_out = (ball.v, wall.v) if side else (wall.v, ball.v)
        row.xi_max, row.force_max, row.impulse = 0.0, math.nan, s.ledger[0].mass[side] * (v + v2)
    count_hit(s, c, v, v2)
    kick: float = v + v2
    return kick


@kernel
def pass_edge(walls: Any, s: Any, laws: Any) -> int:
    """Let the island under way pass the end of a panel of a wall's path, where the velocity of the wall may jump.

    Return SAME, CHANGED if its blocks are to be formed anew, or ENDS if that meets the stop condition.
    """
    run, pairs, pool, pushing = s.run[0], s.pairs, s.pool, False
    for c in range(run.lo, run.hi):
        member = pool[pairs[c].slot]
        jump, slip = jump_at(walls, member, run.t, run.tail) if member.wall > 0 else (0.0, 0.0)
        member.eta += slip
        member.e[0] = member.eta
        if jump != 0.0 and not jolt(s, c, jump, laws):
            return ENDS
        pushing = pushing or (jump == 0.0 and pushes(member))
    return SAME if pushing else CHANGED


@kernel
def jolt(s: Any, c: int, jump: float, laws: Any) -> bool:
    """Let the force of pair `c` begin or end where the velocity of its wall, or of a ball of it that a thermal wall has
    thrown back, has jumped; false if the run is to stop."""
    run, pairs, bodies, member = s.run[0], s.pairs, s.bodies, s.pool[s.pairs[c].slot]
    member.exact = 0
    if member.mode == ACTIVE and is_clipped(member, laws):
        run.events += 1
        if member.going_on == 1:
            end_contact(run, pairs, s.pool, bodies, s.log, c)
        member.mode = RESIDUAL
    elif member.mode == RESIDUAL and not is_clipped(member, laws):
        if not activate(run, pairs, s.pool, bodies, c):
            return False
        member.exact = 0
    elif member.mode == DORMANT and jump < 0.0:
        if member.going_on == 1:
            end_contact(run, pairs, s.pool, bodies, s.log, c)
        member.mode, pairs[c].isolated = OPEN, 0
    elif member.mode == DORMANT:
        member.mode = ACTIVE if member.going_on == 1 else OPEN
    return True


@kernel
def throw_back(s: Any, laws: Any) -> int:
    """Let thermal walls throw back the balls they have been struck by; the pair beside is in the island under way.

    Return SOME if there were any, for then that pair may push, NONE, or AWAITED if the run is to stop before it does.
    """
    run, pairs, pool, found = s.run[0], s.pairs, s.pool, NONE
    for side in range(2):
        c = 0 if side == 0 else len(pairs) - 1
        f = c + 1 - 2 * side
        if run.lo <= c < run.hi and pool[pairs[c].slot].mode == STRUCK:
            kick, found = thrown(s, c), SOME
            if 0 <= f < len(pairs):
                pool[pairs[f].slot].eta += kick
                pool[pairs[f].slot].noise += ULP * kick
                if not jolt(s, f, kick, laws):
                    return AWAITED
    return found


@kernel
def is_clipped(pair: Any, laws: Any) -> bool:
    """Return whether balls that overlap from the start part so fast that their force is clipped."""
    if pair.xi == 0.0:
        return False
    if laws is not None:
        return laws.is_clipped(pair)  # type: ignore[no-any-return]
    return bool(pair.k * power(pair.xi, pair.s) + pair.gamma * pair.eta <= 0.0)


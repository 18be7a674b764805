"""Jumps of a velocity: at an edge of a driven wall's path, and at a thermal wall.

A thermal wall throws a ball back at a random speed. At the touch (gap 0, closing) the rates of its pair and of the
neighbouring pair jump. Usually this is one event without duration, if the same test as for other contacts shows that no
neighbour disturbs it (`one_contact.meet`). If the test fails, the pair becomes STRUCK and its neighbour joins the
island. The ball is thrown back before the blocks are formed again, and all pieces are computed again.

With the ball's speeds v towards the wall and v2 away from it, both relative to the wall, the wall transfers to the ball

    heat = ½ m (v2² - v²) ,   momentum m (v + v2) ,   and work w m (v + v2) if it moves at speed w along the momentum.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.contacts import MODE_CHANGED, NO_CHANGE, STOP_AWAITED, activate, needs_series
from granular.md.located.ledger import CEILING, FLOOR, add_to_account
from granular.md.located.log import end_contact, velocity_now
from granular.md.located.modes import FORCE_BEGINS, FORCE_ENDS, clip
from granular.md.located.pieces import FLOAT_SPACING
from granular.md.located.records import ACTIVE, DORMANT, NO_LOG, OPEN, STRUCK
from granular.md.located.walls import rate_jump
from granular.scene.walls.thermal import drawn

FLOOR_HEAT_INDEX = 2
"""Index of the heat from the floor in the energy balance.

The heat from the ceiling has the next index."""
SAME_BLOCKS, BLOCKS_CHANGED, RUN_ENDS = range(3)
"""Results of `pass_edge`: keep the blocks, form them again, or stop the run."""


@kernel
def speed_away(ledger: Any, wall: int) -> float:
    """Return the speed in m/s with which the next ball leaves a thermal wall.

    It is a random number and relative to the wall. `wall` is -1 for the floor and -2 for the ceiling.
    """
    book, side = ledger[0], -1 - wall
    return drawn(book.temperature[side], book.seed[side], side, book.contacts[side], book.mass[side])


@kernel
def count_hit(s: Any, c: int, v: float, v2: float) -> None:
    """Add a reflection at the thermal wall of pair `c` to the energy balance.

    `v` and `v2` are the speeds in m/s towards the wall and away from it, relative to the wall. The counter of
    reflections increases, so that the next speed is a different random number.
    """
    book, side = s.ledger[0], -1 - s.pairs[c].wall
    book.contacts[side] += 1
    mass, wall = book.mass[side], s.bodies[c + side]
    # a product, because the difference of the squares would lose digits
    add_to_account(book, FLOOR_HEAT_INDEX + side, 0.5 * mass * (v2 - v) * (v2 + v))
    if wall.v != 0.0:
        add_to_account(book, CEILING if side else FLOOR, mass * (v + v2) * (-wall.v if side else wall.v))


@kernel
def throw_ball_back(s: Any, c: int) -> float:
    """Throw back the ball of the STRUCK pair `c`, and log this contact.

    Returns the velocity change v + v2 in m/s: the increase of the rate with which the ball closes on its other
    neighbour.
    """
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
    velocity_change: float = v + v2
    return velocity_change


@kernel
def pass_edge(walls: Any, s: Any, laws: Any) -> int:
    """Update the current island at the end of a panel of a wall path.

    The velocity of the wall can jump there. Returns SAME, CHANGED if the blocks have to be formed again, or ENDS if the
    run has to stop before a contact.
    """
    run, pairs, pool, needs_next_piece = s.run[0], s.pairs, s.pool, False
    for c in range(run.lo, run.hi):
        member = pool[pairs[c].slot]
        jump, stored_jump = rate_jump(walls, member, run.t, run.tail) if member.wall > 0 else (0.0, 0.0)
        member.eta += stored_jump
        member.e[0] = member.eta
        if jump != 0.0 and not apply_velocity_jump(s, c, jump, laws):
            return RUN_ENDS
        needs_next_piece = needs_next_piece or (jump == 0.0 and needs_series(member))
    return SAME_BLOCKS if needs_next_piece else BLOCKS_CHANGED


@kernel
def apply_velocity_jump(s: Any, c: int, jump: float, laws: Any) -> bool:
    """Start or end the force of pair `c` after a velocity jump.

    The velocity of its wall has jumped, or a thermal wall has thrown back one of its balls. `jump` is the change of the
    rate in m/s. The rate already includes it. Returns false if the run has to stop before a contact.
    """
    run, pairs, bodies, member = s.run[0], s.pairs, s.bodies, s.pool[s.pairs[c].slot]
    force = clip(member, laws)
    if force == FORCE_ENDS:
        run.events += 1
        if member.going_on == 1:
            end_contact(run, pairs, s.pool, bodies, s.log, c)
    elif force == FORCE_BEGINS:
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
def throw_struck_balls_back(s: Any, laws: Any) -> int:
    """Throw back the balls of STRUCK pairs at both ends of the current island.

    The neighbouring pairs are in the island too. Returns SOME if a ball was thrown back, because a force can then act
    in the neighbouring pair. Otherwise returns NONE, or AWAITED if the run has to stop before a contact of that pair.
    """
    run, pairs, pool, result = s.run[0], s.pairs, s.pool, NO_CHANGE
    for side in range(2):
        c = 0 if side == 0 else len(pairs) - 1
        f = c + 1 - 2 * side
        if run.lo <= c < run.hi and pool[pairs[c].slot].mode == STRUCK:
            velocity_change, result = throw_ball_back(s, c), MODE_CHANGED
            if 0 <= f < len(pairs):
                pool[pairs[f].slot].eta += velocity_change
                # the new rate has the rounding error of the jump
                pool[pairs[f].slot].noise += FLOAT_SPACING * velocity_change
                if not apply_velocity_jump(s, f, velocity_change, laws):
                    return STOP_AWAITED
    return result

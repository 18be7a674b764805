"""Where a velocity jumps: that of a driven wall, or of a ball that a thermal wall throws back.
May be skipped: rarer, walls that shake or heat.
"""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.contacts import activate
from granular.md.located.driven import jump_at
from granular.md.located.heat import thrown
from granular.md.located.isolated import ULP
from granular.md.located.log import end_contact
from granular.md.located.pieces import power
from granular.md.located.records import ACTIVE, DORMANT, OPEN, RESIDUAL, STRUCK
from granular.md.located.touching import AWAITED, NONE, SOME, pushes

SAME, CHANGED, ENDS = range(3)
"""What `pass_edge` comes to: the blocks stay, are to be formed anew, or the run is to stop."""


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
        if member.begun == 1:
            end_contact(run, pairs, s.pool, bodies, s.log, c)
        member.mode = RESIDUAL
    elif member.mode == RESIDUAL and not is_clipped(member, laws):
        if not activate(run, pairs, s.pool, bodies, c):
            return False
        member.exact = 0
    elif member.mode == DORMANT and jump < 0.0:
        if member.begun == 1:
            end_contact(run, pairs, s.pool, bodies, s.log, c)
        member.mode, pairs[c].alone = OPEN, 0
    elif member.mode == DORMANT:
        member.mode = ACTIVE if member.begun == 1 else OPEN
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

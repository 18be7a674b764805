"""Places in the pool: what an island needs of a pair, and a contact that is followed alone.
May be skipped: how a run is held, no physics.
"""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.around import count_of
from granular.md.located.records import OPEN, RING


@kernel
def join(run: Any, pairs: Any, pool: Any, kinds: Any, bodies: Any, c: int) -> None:
    """Give pair `c`, which has been in free flight, its place in the pool."""
    pair, law = pairs[c], kinds[pairs[c].kind_of]
    pair.slot = pool[run.members].spare
    run.members += 1
    if RING:
        pairs[c + count_of(pairs)].slot = pair.slot
    member = pool[pair.slot]
    if pair.mode == OPEN:
        pair.alone = 0
    member.lower, member.upper = bodies[c].inverse_mass, bodies[c + 1].inverse_mass
    member.inverse, member.pull, member.wall = member.lower + member.upper, pair.pull, pair.wall
    member.kind, member.q, member.memory = law.kind, law.q, law.memory
    member.k, member.gamma, member.p, member.d, member.s = law.k, law.gamma, law.p, law.d, law.s
    member.xi, member.eta, member.mode, member.noise = pair.xi, pair.eta, pair.mode, pair.noise
    member.exact, member.wake, member.top, member.loading = pair.exact, pair.wake, 0.0, 1
    member.t, member.tail, member.stride, member.fired, member.what = pair.t, pair.tail, pair.stride, c, pair.what
    member.clock, member.h, member.tau, member.speed, member.begun = 1, 0.0, 0.0, 0.0, 0
    member.number, member.doubt, member.largest, member.deepest, member.sway = c, 0.0, 0.0, 0.0, 0.0
    member.head, member.manner = -1, 0
    member.x[0], member.e[0], member.f[0] = pair.xi, pair.eta, 0.0


@kernel
def leave(run: Any, pairs: Any, pool: Any, c: int) -> None:
    """Give back the place of pair `c` in the pool."""
    run.members -= 1
    pool[run.members].spare, pairs[c].slot = pairs[c].slot, -1
    if RING:
        pairs[c + count_of(pairs)].slot = -1

"""Where the energy goes: the work of moving walls, and what is dissipated in contacts, piece by piece.

Of a piece with force F, overlap ξ and rate η, with F_el(ξ) = dU/dξ the elastic force and u the velocity of a wall
towards the balls,

    work = ∫ F u dt ,   dissipated = ∫ (F - F_el) η dt = ∫ γ ξ^d η² dt ,

and U(ξ) lost where the force is clipped, for U counts wherever ξ > 0. Both are integrals of products of polynomials,
by Gauss's rule, which is exact to rounding. A contact solved at once dissipates ½ m (v² - v2²); a wall of constant
velocity does the work J u. Sums are kept in two floats each. Where no wall moves, WORKED is false, and nothing of this
is compiled.
"""

from __future__ import annotations

from typing import Any

from numpy.polynomial import legendre

from granular._engine.kernels import DRIVEN, kernel
from granular.md.located.pieces import elapsed, integral, power, two_sum, value
from granular.md.located.records import ACTIVE, ELASTIC, RESIDUAL
from granular.md.located.walls import expand_path

POINTS = 8
"""Nodes of Gauss's rule in a piece: where terms of order 20 are rounding, those from order 16 on, which it misses by
1e-9 of themselves, are less."""
NODES, WEIGHTS = (
    tuple((0.5 * (row + shift)).tolist()) for row, shift in zip(legendre.leggauss(POINTS), (1.0, 0.0), strict=True))
FLOOR, CEILING, LOST = 0, 1, 4
"""Places in the ledger; heat is between them."""


@kernel
def tally(s: Any, laws: Any, c: int, block: Any, tau: float, sums: Any) -> None:
    """Add what pair `c` does in [0, τ] of the piece of its `block` to `sums`."""
    member, last = s.pool[s.pairs[c].slot], len(s.pairs)
    if member.mode == ACTIVE or member.mode == RESIDUAL:
        sums[LOST] += dissipated(member, block, tau, laws)
        if c == 0 and s.bodies[0].inverse_mass == 0.0:
            sums[FLOOR] += work(s.field, member, block, s.bodies[0].v, tau)
        if c + 1 == last and s.bodies[last].inverse_mass == 0.0:
            sums[CEILING] += work(s.field, member, block, -s.bodies[last].v, tau)


@kernel
def tally_island(s: Any, laws: Any, lo: int, tau: float, sums: Any) -> None:
    """Add the stretch [0, τ] of the piece of the island that starts with `lo` to `sums`."""
    for c in range(lo, s.pairs[lo].hi):
        tally(s, laws, c, s.pool[s.pairs[lo].slot], tau, sums)


@kernel
def book_piece(s: Any, laws: Any, lo: int, tau: float) -> None:
    """Enter the stretch [0, τ] of the piece of an island into the ledger."""
    begin(s.ledger[0].piece)
    tally_island(s, laws, lo, tau, s.ledger[0].piece)
    book(s.ledger[0], s.ledger[0].piece)


@kernel
def begin(sums: Any) -> None:
    """Begin to add up."""
    for i in range(len(sums)):
        sums[i] = 0.0


@kernel
def book(ledger: Any, sums: Any) -> None:
    """Enter sums into the ledger."""
    for i in range(len(sums)):
        add(ledger, i, sums[i])


@kernel
def book_at_once(ledger: Any, s: Any, c: int, sign: float) -> None:
    """Add the contact of pair `c` that was solved at once, or take it back (`sign` -1)."""
    for i in (FLOOR, CEILING, LOST):
        add(ledger[0], i, sign * at_once(ledger, s, c, i))


@kernel
def look_at_once(ledger: Any, s: Any, c: int, sums: Any) -> None:
    """Put into `sums` what the contact of pair `c` has come to so far, followed alone, in place of what it will."""
    for i in (FLOOR, CEILING, LOST):
        sums[i] += ledger[0].solo[i] - at_once(ledger, s, c, i)


@kernel
def at_once(ledger: Any, s: Any, c: int, i: int) -> float:
    """Return what the contact of pair `c` that was solved at once comes to, from speed and length of it and its
    asymptote; that of a driven wall is noted."""
    pair, lower, upper = s.pairs[c], s.bodies[c], s.bodies[c + 1]
    at_floor = lower.inverse_mass == 0.0
    if pair.wall > 0:
        kept = ledger[0].lost if i == LOST else ledger[0].work
        return float(kept[0 if at_floor else 1] if i == LOST or at_floor == (i == FLOOR) else 0.0)
    inverse, v, v2 = lower.inverse_mass + upper.inverse_mass, pair.speed, -pair.eta
    if i == LOST:
        return float(0.5 * (v - v2) * (v + v2) / inverse)
    if i == FLOOR and at_floor:
        return float((v + pair.pull * pair.lasts + v2) / inverse * lower.v)
    if i == CEILING and upper.inverse_mass == 0.0:
        return float((v + pair.pull * pair.lasts + v2) / inverse * -upper.v)
    return 0.0


@kernel
def keep_solo(ledger: Any, s: Any, c: int) -> None:
    """Note what the contact of pair `c`, at a driven wall, comes to, which has just been followed alone."""
    if s.pairs[c].wall > 0:
        side, book = (0 if s.bodies[c].inverse_mass == 0.0 else 1), ledger[0]
        book.work[side], book.lost[side] = book.solo[side], book.solo[LOST]


@kernel
def read(ledger: Any, sums: Any) -> None:
    """Write the sums of the ledger."""
    for i in range(len(ledger[0].total)):
        sums[i] = ledger[0].total[i] + ledger[0].low[i]


@kernel
def run_off(law: Any, laws: Any, pair: Any, first: float, last: float) -> float:
    """Return the elastic energy that a clipped pair loses on its way from one overlap to another; 0 of others."""
    if pair.mode != RESIDUAL:
        return 0.0
    if laws is not None:
        return laws.lost(pair, first, last)  # type: ignore[no-any-return]
    return stored(law, first) - stored(law, last)


@kernel
def add(ledger: Any, i: int, x: float) -> None:
    """Add to a sum in two floats."""
    ledger.total[i], rest = two_sum(ledger.total[i], x)
    ledger.low[i] += rest


@kernel
def stored(law: Any, xi: float) -> float:
    """Return the elastic energy of a power law."""
    return float(law.k * xi * power(xi, law.p) / (law.p + 1.0)) if xi > 0.0 else 0.0


@kernel
def dissipated(member: Any, block: Any, tau: float, laws: Any) -> float:
    """Return the energy that a contact loses in [0, τ] of its piece."""
    if laws is not None:
        return laws.dissipated(member, block, tau)  # type: ignore[no-any-return]
    if member.mode == RESIDUAL:
        return stored(member, member.x[0]) - stored(member, value(member.x, tau))
    if member.kind == ELASTIC or member.gamma == 0.0:
        return 0.0
    total, scale = 0.0, pace(block, tau)
    for i in range(POINTS):
        at = tau * NODES[i]
        eta = value(member.e, at)
        rate = member.gamma * eta * eta
        if member.d != 0.0:
            rate *= power(max(0.0, value(member.x, at)), member.d)
        total += WEIGHTS[i] * rate * elapsed(NODES[i], block.clock, 1.0) / NODES[i]
    return scale * total


@kernel
def pace(block: Any, tau: float) -> float:
    """Return dt/dx at x = 1 of the time t = (hτx)^q, x from 0 to 1."""
    return block.clock * elapsed(block.h * tau, block.clock, 1.0)  # type: ignore[no-any-return]


@kernel
def work(walls: Any, member: Any, block: Any, speed: float, tau: float) -> float:
    """Return the work of a wall in [0, τ] of the piece of the pair at it; `speed` is its constant velocity towards the
    balls, if it is not driven."""
    if member.mode != ACTIVE:
        return 0.0
    if DRIVEN and member.wall > 0:
        return work_of_driven(walls, member, block, tau)
    return float(elapsed(block.h, block.clock, 1.0) * integral(member.f, block.clock, tau) * speed)


@kernel
def work_of_driven(walls: Any, member: Any, block: Any, tau: float) -> float:
    """Return the work of a driven wall in [0, τ] of the piece of the pair at it."""
    expand_path(walls, member.wall - 1, block)
    wall, path = walls.wall[member.wall - 1], walls.path[member.wall - 1]
    total, scale = 0.0, pace(block, tau)
    for i in range(POINTS):
        at, v = elapsed(block.h * tau * NODES[i], block.clock, 1.0), 0.0
        for j in range(len(path) - 1, 0, -1):
            v = v * at + j * path[j]
        v += wall.side * wall.velocity
        total += WEIGHTS[i] * value(member.f, tau * NODES[i]) * v * elapsed(NODES[i], block.clock, 1.0) / NODES[i]
    return scale * total


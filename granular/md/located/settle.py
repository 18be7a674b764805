"""An island is advanced: overlaps, rates and velocities at the end of a piece, or on its way."""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.around import is_closed, nth
from granular.md.located.driven import beside_edge, speed_at
from granular.md.located.isolated import ULP
from granular.md.located.ledger import enter_piece
from granular.md.located.log import follow
from granular.md.located.pendula import swing
from granular.md.located.pieces import since, tick, value
from granular.md.located.records import DRIVEN, EDGE, GENERAL, HUNG, RING, WORKED


@kernel
def settle(
    run: Any, pairs: Any, pool: Any, bodies: Any, work: Any, lo: int, tau: float, dt: float, s: Any, laws: Any
) -> None:
    """Advance the island that starts with pair `lo` to τ, a time `dt` into its piece."""
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    if tau <= 0.0:
        return
    follow(run, pairs, pool, work, lo, tau)
    if WORKED:
        enter_piece(s.ledger, s.walls, laws, s, lo, tau)
    if HUNG:
        swing(run, pairs, pool, bodies, lo, tau, dt)
    else:
        push(pairs, pool, bodies, lo, dt)
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        member.xi, member.eta, member.exact = value(member.x, tau), value(member.e, tau), 0
        member.x[0], member.e[0] = member.xi, member.eta
    for c in range(lo, hi):
        pool[pairs[c].slot].noise += rounding(run.tol, pairs, pool, c, lo)
    tick(block, dt)
    if DRIVEN and block.what == EDGE and tau == block.tau:
        tick(block, beside_edge(s.walls, pairs[lo], block))
        tick(block, beside_edge(s.walls, pairs[hi - 1], block))
    if RING:
        if is_closed(pairs, lo, hi):
            hold_walls(pairs, pool, lo, hi, 0.0)
    elif bodies[lo].inverse_mass == 0.0 and bodies[hi].inverse_mass == 0.0 and block.what != EDGE:
        lower, upper = bodies[lo].v, bodies[hi].v
        if DRIVEN:
            lower = speed_at(s.walls, pairs[lo], bodies[lo], block)
            upper = speed_at(s.walls, pairs[hi - 1], bodies[hi], block)
        hold_walls(pairs, pool, lo, hi, lower - upper)
    block.tau = 0.0  # the piece is used up


@kernel
def rounding(tol: float, pairs: Any, pool: Any, c: int, lo: int) -> float:
    """Return what a step may leave in the rate of pair `c`: rounding of rates, or what a nonlinear step leaves out."""
    member = pool[pairs[c].slot]
    if pool[pairs[lo].slot].linear == 0:
        return float(max(tol, ULP if member.kind != GENERAL else 8.0 * ULP) * member.own_speed)
    largest = abs(member.eta)
    hi = pairs[lo].hi
    if is_closed(pairs, lo, hi) and (c == lo or c + 1 == hi):
        largest = max(largest, abs(pool[pairs[hi - 1 if c == lo else lo].slot].eta))
    for i in range(max(lo, c - 1), min(c + 2, hi)):
        largest = max(largest, abs(pool[pairs[i].slot].eta))
    return float(ULP * largest)


@kernel
def hold_walls(pairs: Any, pool: Any, lo: int, hi: int, closing: float) -> None:
    """Let the rates between two walls, or around a ring, sum up to that of the walls, or 0: roundings would wander, and
    squeeze or free them."""
    excess, fastest = -closing, pool[pairs[lo].slot]
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        excess += member.eta
        if abs(member.eta) > abs(fastest.eta):
            fastest = member
    fastest.eta, fastest.e[0] = fastest.eta - excess, fastest.eta - excess


@kernel
def push(pairs: Any, pool: Any, bodies: Any, lo: int, dt: float) -> None:
    """Advance the velocities of the bodies of an island by `dt`: free fall, and the impulses on the way.

    What no force acts on falls as before: in thousands of steps its roundings would add up.
    """
    block, hi, below, last = pool[pairs[lo].slot], pairs[lo].hi, 0.0, pairs[lo].hi + 1
    if is_closed(pairs, lo, hi):
        below, last = pool[pairs[hi - 1].slot].push, hi
    for c in range(lo, last):
        body, above = bodies[nth(pairs, c)], pool[pairs[c].slot].push if c < hi else 0.0
        if below != 0.0 or above != 0.0:
            body.v += body.inverse_mass * (below - above) - body.fall * (since(body, block.t, block.tail) + dt)
            body.t, body.tail = block.t, block.tail
            tick(body, dt)
        below = above

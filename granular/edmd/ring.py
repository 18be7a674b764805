"""Rings: the kernels that take the place of others where the last ball is the neighbour of the first.
May be skipped: rarer, a line that is closed.

A ring of n balls is held as a line of n pairs and n + 1 bodies, the last of which is the first once more. So nearly all
is done as on a line; across the seam, what happens to one of these two happens to the other, and the neighbours of a
pair are counted round. Velocities are relative to the centre of mass.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from granular._flight import gap_after
from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.collision import event as event_on_line
from granular.edmd.collision import is_closed
from granular.edmd.collision import remedied as remedied_on_line
from granular.edmd.groups import Fit
from granular.edmd.groups import collide_as_one as collide_in_line
from granular.edmd.motion import Walls, add, carry, reimpose, touches
from granular.edmd.motion import collide as collide_on_line
from granular.edmd.motion import rebase as rebase_on_line
from granular.edmd.physics import Restitution
from granular.edmd.state import State
from granular.edmd.zoom import bounce as bounce_on_line
from granular.edmd.zoom import crowded as crowded_on_line

COMPARABLE = 2.0**-20
"""Velocity of the centre of mass, in units of the largest, that is taken back."""


@kernel
def same(body: Record, other: Record) -> None:
    """Let a body be what the other is: both are the ball at the seam."""
    body.u = other.u
    body.noise = other.noise


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after."""
    end = len(pairs) - 1
    if c == 0:
        run.clamps += carry(pairs[end], bodies[end], bodies[end + 1], now, walls)
    elif c == end:
        run.clamps += carry(pairs[0], bodies[0], bodies[1], now, walls)
    first, last, rebound = event_on_line(run, pairs, bodies, c, now, rule, row, walls)
    if c == 0:
        same(bodies[end + 1], bodies[0])
    elif c == end:
        same(bodies[0], bodies[end + 1])
    return first, last, rebound


@kernel
def collide(pair: Record, lower: Record, upper: Record, now: float, w: float, e: float) -> None:
    """Let a pair collide at time `now` with rate `w` ≤ 0, and part with -ε·w.

    Equal balls that lose nothing exchange their velocities to the last bit: they fly as if they passed each other.
    """
    if e == 1.0 and pair.low == 0.5:
        lower.u, upper.u = upper.u, lower.u
        pair.gap, pair.at = 0.0, now
    else:
        collide_on_line(pair, lower, upper, now, w, e)


@kernel
def remedied(run: Record, pairs: Records, c: int, speed: float, e: float, now: float) -> float:
    """Return ε of an impact of pair `c` with `speed` at time `now` where its rule says `e`."""
    end = len(pairs) - 1
    if (c == 0 and now - pairs[end].last < run.tc) or (c == end and now - pairs[0].last < run.tc):
        return 1.0
    return remedied_on_line(run, pairs, c, speed, e, now)


@rare
@kernel
def absorb(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Let the bodies of pair `c`, which close at rate `w`, and all that is closed with them, move as one from now on.

    Returns the first and the last pair to predict anew, and the momentum exchanged by pair `c` in kg m/s.
    """
    n, b, e = len(pairs), c, c + 1
    while is_closed(pairs[(b - 1) % n], bodies[(b - 1) % n], bodies[(b - 1) % n + 1]):  # not all are: there is room
        b -= 1
    while is_closed(pairs[e % n], bodies[e % n], bodies[e % n + 1]):
        e += 1
    for k in (b - 1, c, e):
        carry(pairs[k % n], bodies[k % n], bodies[k % n + 1], now, walls)
    pairs[c].gap = 0.0
    lower, upper = 0.0, 0.0
    for i in range(b, e + 1):
        if i <= c:
            lower += bodies[i % n].mass
        else:
            upper += bodies[i % n].mass
    part = upper / (lower + upper)
    common = bodies[c].u + part * w
    for i in range(b, e + 1):
        bodies[i % n].u = common
    bodies[n].u = bodies[0].u
    run.merged += 1
    if b < 0 or e > n:
        return 0, n - 1, -(lower * part) * w
    return max(b - 1, 0), min(e, n - 1), -(lower * part) * w


@kernel
def rebase(run: Record, pairs: Records, bodies: Records, shift: float, walls: Walls) -> None:
    """Move all gaps to time `shift`, the new zero of time.

    Velocities are relative to the centre of mass, and so keep their digits however much slower the balls become: what
    rounding has given it is taken back before it is comparable to them.
    """
    rebase_on_line(run, pairs, bodies, shift, walls)
    reimpose(run, pairs)
    n, momentum, low, mass, fastest = len(pairs), 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        momentum, low = add(momentum, low, bodies[i].mass * bodies[i].u)
        mass += bodies[i].mass
        fastest = max(fastest, abs(bodies[i].u))
    mean = (momentum + low) / mass
    for i in range(n):
        if abs(mean) > COMPARABLE * fastest:
            bodies[i].u -= mean
    same(bodies[n], bodies[0])


@kernel
def number(run: Record, j: int) -> int:
    """Return the number of pair `j` of a closer look, counted round."""
    c: int = run.first + j
    return c if c < run.pairs else c - run.pairs


@kernel
def guards(run: Record, n: int, j: int) -> bool:
    """Return whether pair `j` of a closer look at `n` pairs has a neighbour outside."""
    return n < run.pairs and (j == 0 or j == n - 1)


@kernel
def bounce(near: Records, pairs: Records, bodies: Records, j: int, w: float, e: float) -> None:
    """Let pair `j` of a closer look collide at rate `w`; the first and the last do if it sees the whole ring."""
    bounce_on_line(near, pairs, bodies, j, w, e)
    end, jump = len(near) - 1, (1.0 + e) * w
    if j == 0:
        near[end].rate += pairs[j].low * jump
        same(bodies[end + 1], bodies[0])
    elif j == end:
        near[0].rate += pairs[j].high * jump
        same(bodies[0], bodies[end + 1])


@kernel
def crowded(near: Records, pairs: Records, j: int, dt: float) -> bool:
    """Return whether a neighbour of pair `j` of a closer look touches after `dt`."""
    end = len(near) - 1
    if j == 0 or j == end:
        other = near[end - j]
        if gap_after(other.gap, other.rate, 0.0, dt) <= 0.0:
            return True
    return crowded_on_line(near, pairs, j, dt)


@rare
@kernel
def group(pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Return two numbers, which are different if a neighbour of pair `c` touches at time `now`."""
    n = len(pairs)
    below, above = (c - 1) % n, (c + 1) % n
    if touches(pairs[below], bodies[below], bodies[below + 1], now, walls):
        return c, c + 1
    return c, c + touches(pairs[above], bodies[above], bodies[above + 1], now, walls)


def collide_as_one(s: State, physics: Any, fit: Fit, log: list[Any] | None) -> tuple[int, int, int]:
    """Let a touching group collide as a whole, on the line that begins behind the largest gap.

    Returns what `granular.edmd.groups.collide_as_one` does.
    """
    run, n, rows = s.run, len(s.pairs), None if log is None else list[Any]()
    widest = int(s.row(run.now)[1].argmax())
    k = (widest + 1) % n
    run.clamps += carry(s.pairs[widest], s.bodies[widest], s.bodies[widest + 1], run.now, None)
    asked = run.suspect, run.stop_pair
    run.suspect, run.stop_pair = ((c - k) % n if c >= 0 else c for c in asked)
    rule = physics.rule and (lambda c, speed: physics.rule((c + k) % n, speed))
    line = replace(s, pairs=s.pairs[k:] + s.pairs[:k], bodies=s.bodies[k:n] + s.bodies[: k + 1])
    counted: Any = SimpleNamespace(rule=rule, options=physics.options)
    why, first, last = collide_in_line(line, counted, fit, rows)
    run.suspect, run.stop_pair = asked
    same(s.bodies[n], s.bodies[0])
    for chunk in rows or ():
        for row in chunk:
            row.pair = (row.pair + k) % n
    if log is not None and rows:
        log += rows
    if first == 0 or last >= n - 2:  # the largest gap is beside them
        return why, 0, n - 1
    return why, (first + k) % n, (first + k) % n + last - first

"""Which pile is at a driven wall, and what the walls do to it during a stretch of their paths.
May be skipped: rarer, piles that ride on a driven wall.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from granular._check import Array
from granular._tournament import play
from granular.md.located.creep import LARGEST
from granular.md.located.driven import absolute
from granular.md.located.ledger import CEILING, FLOOR
from granular.md.located.records import ACTIVE, GENERAL, OPEN, ORDER
from granular.walls.path import jump_ahead

FALLS = np.array([(j + 1.0) * (j + 2.0) for j in range(ORDER - 1)])


class Pile(NamedTuple):
    """Pairs `first` … `end`-1 of the block that starts with `lo` all push, and one end is at a driven wall; `flank` is
    the open pair beyond the other end, -1 without."""

    lo: int
    first: int
    end: int
    flank: int


def pile_on_wall(s: Any) -> Pile | None:
    """Return the pile on a driven floor or under a driven ceiling, if all of its contacts are damped."""
    pairs, n = s.pairs, len(s.pairs)
    if n > LARGEST:
        return None
    for way, start in ((1, 0), (-1, n - 1)):
        if pairs[start]["wall"] == 0 or pairs[start]["slot"] < 0:
            continue
        lo = int(pairs[start]["first"])
        hi, c = int(pairs[lo]["hi"]), start
        while lo <= c < hi and pushes_damped(s, c):
            c += way
        flank = c if lo <= c < hi else -1
        last = flank == (hi - 1 if way > 0 else lo)
        if c != start and (flank < 0 or (last and s.pool[pairs[flank]["slot"]]["mode"] == OPEN)):
            return Pile(lo, min(start, c - way), max(start, c - way) + 1, flank)
    return None


def pushes_damped(s: Any, c: int) -> bool:
    """Return whether the contact of pair `c` pushes, and loses what it swings, by a law without memory."""
    member, law = s.pool[s.pairs[c]["slot"]], s.kinds[s.pairs[c]["kind_of"]]
    if member["mode"] != ACTIVE or law["elastic"] or law["memory"]:
        return False
    return bool(law["kind"] == GENERAL or (law["gamma"] > 0.0 and law["k"] > 0.0))


def others_due(s: Any, pile: Pile) -> float:
    """Return when another block is due, in s."""
    play(s.queue, pile.lo, math.inf)
    due = float(s.queue[1].due)
    play(s.queue, pile.lo, s.pairs[pile.lo].due)
    return due


def edge_jumps(s: Any, pile: Pile) -> bool:
    """Return whether the velocity of a wall of the block jumps at the end of its panel."""
    block, walls, pairs = s.pool[s.pairs[pile.lo].slot], s.walls, s.pairs[pile.lo : s.pairs[pile.lo].hi]
    t, tail = absolute(walls, block.t, block.tail)
    return any(jump_ahead(walls.wall[pair.wall - 1], walls.panels, t, tail) for pair in pairs if pair.wall > 0)


def sway(s: Any, c: int, h: float) -> Array:
    """Closing acceleration in m/s² of pair `c` by a driven wall: coefficients in τ, t = hτ."""
    out = np.zeros(ORDER + 1)
    if s.pairs[c].wall > 0:
        path = np.array(s.walls.path[s.pairs[c].wall - 1])
        count = len(path) - 2
        out[:count] = FALLS[:count] * path[2:] * h ** np.arange(count)
    return out


def presses(s: Any, pile: Pile, h: float) -> tuple[Array, Array]:
    """Return the closing accelerations (ORDER+1, pairs) in m/s² of a pile without contact forces, and the sum of all
    overlaps of its block (ORDER+1,) in m: coefficients in τ, t = hτ."""
    lo, hi = pile.lo, s.pairs[pile.lo].hi
    by_walls = np.array([sway(s, c, h) for c in range(lo, hi)]).T
    pull, together = by_walls[:, pile.first - lo : pile.end - lo].copy(), by_walls.sum(axis=1)
    pull[0] += [s.pairs[c].pull for c in range(pile.first, pile.end)]
    together[0] += s.bodies[hi].fall - s.bodies[lo].fall  # and not the sum of roundings
    members = [s.pool[s.pairs[c].slot] for c in range(lo, hi)]
    start = math.fsum(p.xi for p in members), h * math.fsum(p.eta for p in members)
    return pull, np.concatenate([start, h * h * together[: ORDER - 1] / FALLS])


def wall_speeds(s: Any, pile: Pile, h: float) -> list[tuple[int, int, Array]]:
    """Return of each wall at a pile its place in the ledger, which pair of the pile is at it, and its speed in m/s
    towards the balls as coefficients in τ, t = hτ."""
    out, n = [], len(s.pairs)
    for at, place, body, c, side in ((pile.first == 0, FLOOR, 0, 0, 1.0), (pile.end == n, CEILING, n, n - 1, -1.0)):
        if not at or s.bodies[body].inverse_mass > 0.0:
            continue
        speed = np.zeros(ORDER + 1)
        speed[0] = side * s.bodies[body].v
        if s.pairs[c].wall > 0:
            path, wall = np.array(s.walls.path[s.pairs[c].wall - 1]), s.walls.wall[s.pairs[c].wall - 1]
            count = len(path) - 1
            speed[:count] = np.arange(1, count + 1) * path[1:] * h ** np.arange(count)
            speed[0] += wall.side * wall.velocity
        out.append((place, c - pile.first, speed))
    return out

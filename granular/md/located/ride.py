"""A pile that rides on a driven wall, stretch by stretch of the wall's path: as slowly as that moves.
May be skipped: rarer, piles that ride on a driven wall.

Once all contacts of a pile push and are damped, its overlaps are a slow motion, a polynomial over a whole panel of the
path (`slow`), and free swings about it (`swing`). Nothing happens as long as every slow force stays above the bound of
the swings beside it, and the gap to the next ball above theirs, nor before another block of the run is due. To there
the pile goes at once: the slow motion is an ordinary piece, and what the swings add to it is known in closed form. What
follows then, be it a lift-off, a hit or a jump of the wall's velocity, is met by the pieces that islands have.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import polynomial

from granular._check import Array
from granular._kernels import fitted
from granular._tournament import play
from granular.md.located import slow
from granular.md.located.blocks import settle
from granular.md.located.contacts import add_shared
from granular.md.located.creep import LARGEST, columns
from granular.md.located.driven import absolute, carry_walls, foresee_walls, jump_at
from granular.md.located.events import shifted
from granular.md.located.ledger import CEILING, FLOOR, LOST, add
from granular.md.located.pieces import piece_time
from granular.md.located.step_size import REACH, fastest_rate
from granular.md.located.swing import Swing, highest
from granular.md.located.system import ACTIVE, EDGE, LINEAR, NOTHING, OPEN, ORDER
from granular.walls.path import jump_ahead

WORTH = 20.0
"""Steps of an island that a stretch has to save."""
FIT = {"DRIVEN": True, "WORKED": True}
FALLS = np.array([(j + 1.0) * (j + 2.0) for j in range(ORDER - 1)])


class Pile(NamedTuple):
    """Pairs `first` … `end`-1 of the block that starts with `lo` all push, and one end is at a driven wall; `flank` is
    the open pair beyond the other end, -1 without."""

    lo: int
    first: int
    end: int
    flank: int


def pile_on_wall(s: Any) -> Pile | None:
    """Return the pile on a driven floor or under a driven ceiling, if all of its contacts are linear and damped."""
    n = len(s.pairs)
    if n > LARGEST:
        return None
    for way, start in ((1, 0), (-1, n - 1)):
        if s.pairs[start].wall == 0 or s.pairs[start].slot < 0:
            continue
        lo = int(s.pairs[start].first)
        hi, c = int(s.pairs[lo].hi), start
        while lo <= c < hi and pushes_slowly(s.pool[s.pairs[c].slot]):
            c += way
        flank = c if lo <= c < hi else -1
        lone = flank in (lo, hi - 1) and flank >= 0 and s.pool[s.pairs[flank].slot].mode == OPEN
        if c != start and (flank < 0 or (lone and flank == (hi - 1 if way > 0 else lo))):
            return Pile(lo, min(start, c - way), max(start, c - way) + 1, flank)
    return None


def pushes_slowly(member: Any) -> bool:
    """Return whether a contact pushes, and loses what it swings."""
    return bool(member.mode == ACTIVE and member.kind == LINEAR and member.k > 0.0 and member.gamma > 0.0)


class Ride:
    """A stretch of the ride of a pile, from the clock of its block on, with plain records.

    Attributes
    ----------
    pile : Pile
        Who rides.
    until : float
        s, up to where nothing happens.
    """

    def __init__(self, s: Any, pile: Pile, before: Ride | None = None) -> None:
        self.s, self.pile, self.until = s, pile, -math.inf
        self.members = [s.pool[s.pairs[c].slot] for c in range(pile.first, pile.end)]
        self.block = s.pool[s.pairs[pile.lo].slot]
        self.mass = [1.0 / w if w > 0.0 else math.inf for w in self.inverse_masses()]
        known = before is not None and before.pile == pile
        self.swing = before.swing if known and before is not None else Swing(self.members, self.mass)

    def inverse_masses(self) -> list[float]:
        """Return those of the bodies of the pile, in 1/kg."""
        return [float(self.s.bodies[b].inverse_mass) for b in range(self.pile.first, self.pile.end + 1)]

    def begins(self) -> bool:
        """Return whether a next stretch is proved, and write its slow motion as the piece of the block; else nothing is
        changed but for that piece."""
        s, pile, block = self.s, self.pile, self.block
        fastest = fastest_rate(s.pairs, s.pool, pile.lo, s.pairs[pile.lo].hi)
        h = fitted(foresee_walls, **FIT)(s.walls, s.pairs, s.pool, pile.lo)
        edge = h == block.holds and not self.jumps()
        h = h if edge else h - 0.5 * REACH / fastest
        if not (self.swing.known and h * fastest > WORTH * REACH and h < math.inf):
            return False
        by, beyond = self.pressed(h)
        xi = slow.linear(self.swing.k, self.swing.gamma, by)
        if xi is None:
            return False
        self.h, self.step, self.slow, self.path = h, REACH / fastest, xi, self.paths(h)
        eta = polynomial.polyder(xi) / h
        xi_now, eta_now = columns(self.members)[2:]
        self.r = self.swing.of(xi_now - xi[0], eta_now - eta[0])
        self.eta, self.force = eta, self.swing.k * xi + self.swing.gamma * np.vstack([eta, 0.0 * xi[:1]])
        block.clock, block.linear, block.h, block.fired, block.what = 1, 1, h, -1, EDGE if edge else NOTHING
        for i, member in enumerate(self.members):
            member.x, member.e = xi[:, i].tolist(), [*eta[:, i].tolist(), 0.0]
            member.f = self.force[:, i].tolist()
            member.g = member.f.copy()
        if pile.flank >= 0:
            apart = s.pool[s.pairs[pile.flank].slot]
            apart.x = (beyond - xi.sum(axis=1)).tolist()
            apart.e = [*(polynomial.polyder(beyond) / h - eta.sum(axis=1)).tolist(), 0.0]
            apart.f, apart.g = [0.0] * (ORDER + 1), [0.0] * (ORDER + 1)
        block.tau = self.proved()
        if block.tau < 1.0:
            block.what = NOTHING
        self.until = min(block.t + (self.lasts() + block.tail), self.others_due())
        return (self.until - block.t) * fastest > WORTH * REACH

    def others_due(self) -> float:
        """Return when another block is due, in s."""
        lo, queue = self.pile.lo, self.s.queue
        play(queue, lo, math.inf)
        due = float(queue[1].due)
        play(queue, lo, self.s.pairs[lo].due)
        return due

    def lasts(self) -> float:
        """Return how long the piece is, in s."""
        return float(fitted(piece_time, **FIT)(self.block))

    def jumps(self) -> bool:
        """Return whether the velocity of a wall jumps at the end of its panel."""
        walls, hi = self.s.walls, self.s.pairs[self.pile.lo].hi
        t, tail = absolute(walls, self.block.t, self.block.tail)
        at = [self.s.pairs[c].wall - 1 for c in range(self.pile.lo, hi) if self.s.pairs[c].wall > 0]
        return any(jump_ahead(walls.wall[i], walls.panels, t, tail) for i in at)

    def pull(self, c: int, h: float) -> Array:
        """Closing acceleration in m/s² of pair `c` without contact forces: coefficients in τ, t = hτ."""
        pair, out = self.s.pairs[c], np.zeros(ORDER + 1)
        out[0] = pair.pull
        if pair.wall > 0:
            path = np.array(self.s.walls.path[pair.wall - 1])
            out[: len(path) - 2] += FALLS[: len(path) - 2] * path[2:] * h ** np.arange(len(path) - 2)
        return out

    def pressed(self, h: float) -> tuple[slow.Pressed, Array]:
        """Return what presses on the pile, and, with a flank, the sum of all overlaps with its own."""
        pile, pulls = self.pile, [self.pull(c, h) for c in range(self.pile.first, self.pile.end)]
        flank = [] if pile.flank < 0 else [self.s.pool[self.s.pairs[pile.flank].slot]]
        pull = np.array(pulls).T
        together = pull.sum(axis=1) + (self.pull(pile.flank, h) if flank else 0.0)
        total = np.zeros(ORDER + 1)
        total[0] = math.fsum(p.xi for p in [*self.members, *flank])
        total[1] = h * math.fsum(p.eta for p in [*self.members, *flank])
        total[2:] = h * h * together[: ORDER - 1] / FALLS
        closed = math.inf in self.mass[:1] and math.inf in self.mass[-1:]
        return slow.Pressed(h, pull, total if closed else None, slow.inverse_masses(self.members)), total

    def paths(self, h: float) -> list[tuple[int, int, Array]]:
        """Return of each wall at the pile its place in the ledger, the place of its pair, and its speed in m/s towards
        the balls as coefficients in τ, t = hτ."""
        out, s, n = [], self.s, len(self.s.pairs)
        ends = [(FLOOR, 0, 0, 1.0)] if self.pile.first == 0 else []
        ends += [(CEILING, n, n - 1, -1.0)] if self.pile.end == n else []
        for place, body, c, side in ends:
            if s.bodies[body].inverse_mass > 0.0:
                continue
            speed = np.zeros(ORDER + 1)
            speed[0] = side * s.bodies[body].v
            if s.pairs[c].wall > 0:
                path, wall = np.array(s.walls.path[s.pairs[c].wall - 1]), s.walls.wall[s.pairs[c].wall - 1]
                steps = np.arange(1, len(path))
                speed[: len(path) - 1] = steps * path[1:] * h ** (steps - 1)
                speed[0] += wall.side * wall.velocity
            out.append((place, c - self.pile.first, speed))
        return out

    def proved(self) -> float:
        """Return the τ, at most 1, up to which it is proved that nothing happens."""
        forces, apart = self.swing.bounds(self.r)
        tau, work = 1.0, self.s.work
        for member, bound in zip(self.members, forces.tolist(), strict=True):
            tau = min(tau, shifted(member.f, -bound, tau, work, -1.0))
        if self.pile.flank >= 0:
            tau = min(tau, shifted(self.s.pool[self.s.pairs[self.pile.flank].slot].x, apart, tau, work, 1.0))
        return float(tau)

    def goes_to(self, t: float) -> None:
        """Bring the pile to the time t in s, at most `until`; its piece is used up."""
        s, pile, block, run = self.s, self.pile, self.block, self.s.run[0]
        whole = not t < block.t + (self.lasts() + block.tail)
        dt = self.lasts() if whole else (t - block.t) - block.tail
        tau, log = block.tau if whole else min(block.tau, dt / block.h), run.log
        later, self.part = self.swing.after(self.r, dt), self.swing.parts(self.r)
        run.log = min(log, 1)  # peaks of the slow motion are not those of the sum
        fitted(settle, **FIT)(run, s.pairs, s.pool, s.bodies, s.work, pile.lo, tau, dt, s, None)
        run.log = log
        xi, eta, impulse = self.swing.overlap(later), self.swing.rate(later), self.swing.impulse(self.r, later)
        for i, member in enumerate(self.members):
            self.add_to(member, i, (float(xi[i]), float(eta[i]), float(impulse[i])), tau)
        if pile.flank >= 0:
            apart = s.pool[s.pairs[pile.flank].slot]
            apart.xi, apart.eta = apart.xi - float(xi.sum()), apart.eta - float(eta.sum())
            apart.x[0], apart.e[0] = apart.xi, apart.eta
        for b, change in zip(self.swing.balls.tolist(), (later - self.r)[self.swing.n :].tolist(), strict=True):
            s.bodies[pile.first + b].v += change
        for place, amount in enumerate(self.books(later, tau)):
            add(s.ledger[0], place, amount)
        run.t, run.tail = block.t, block.tail
        carry_walls(s.walls, s)
        if whole and block.what == EDGE:
            for member in (s.pool[s.pairs[c].slot] for c in range(pile.lo, s.pairs[pile.lo].hi)):
                member.eta += jump_at(s.walls, member, run.t, run.tail)[1] if member.wall > 0 else 0.0
                member.e[0] = member.eta
        block.h, block.what, run.steps = self.step, NOTHING, run.steps + 1  # for the series of the end of a run

    def add_to(self, member: Any, i: int, swung: tuple[float, float, float], tau: float) -> None:
        """Add to the i-th contact what overlap, rate and impulse have swung, and note its peaks."""
        run, lone, (xi, eta, impulse) = self.s.run[0], len(self.members) == 1, swung
        member.xi, member.eta = member.xi + xi, member.eta + eta
        member.x[0], member.e[0] = member.xi, member.eta
        if run.log == 0:
            return
        member.impulse += impulse
        if not lone:
            add_shared(run, impulse)
        if run.log == 2:
            swing, rates = self.swing, self.swing.rates * self.h
            xi, force = ((row @ swing.modes[: len(row)]) * self.part for row in (swing.shape[i], swing.force[i]))
            member.xi_max = highest(self.slow[:, i], (xi, rates), tau, member.xi_max)
            member.force_max = highest(self.force[:, i], (force, rates), tau, member.force_max)

    def books(self, later: Array, tau: float) -> list[float]:
        """Return what the swings add to the sums of the ledger up to τ, in J."""
        swing, out = self.swing, [0.0] * 5
        for place, c, speed in self.path:
            out[place] = swing.integral(np.multiply.outer(speed, swing.force[c]), self.r, later, self.h, tau)
        loss = 2.0 * (self.eta * swing.gamma) @ swing.shape
        g = np.hstack([np.zeros_like(loss), loss])
        out[LOST] = swing.integral(g, self.r, later, self.h, tau) + (swing.energy(self.r) - swing.energy(later))
        return out

    def show(self, elapsed: float, rows: Any, sums: Any) -> None:
        """Add to rows of overlaps (m), rates (m/s) and forces (N), and to the sums of a ledger (J), what the pile
        swings at a time into the run."""
        dt = (elapsed - self.block.t) - self.block.tail
        later, first = self.swing.after(self.r, dt), self.pile.first
        added = self.swing.overlap(later), self.swing.rate(later), self.swing.force @ later
        for row, values in zip(rows, added, strict=True):
            for i, value in enumerate(values.tolist()):
                row[first + i] += value
        if self.pile.flank >= 0:
            for row, values in zip(rows[:2], added[:2], strict=True):
                row[self.pile.flank] -= float(values.sum())
        if sums is not None:
            for place, amount in enumerate(self.books(later, min(self.block.tau, dt / self.h))):
                sums[place] += amount

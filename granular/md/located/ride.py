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
from typing import Any

import numpy as np
from numpy.polynomial import polynomial

from granular._check import Array
from granular._kernels import fitted
from granular.md.located import slow
from granular.md.located.creep import columns
from granular.md.located.driven import carry_walls, foresee_walls, jump_at
from granular.md.located.events import shifted
from granular.md.located.ledger import LOST, add
from granular.md.located.log import add_shared
from granular.md.located.on_wall import Pile, edge_jumps, others_due, presses, wall_speeds
from granular.md.located.pieces import piece_time
from granular.md.located.records import EDGE, LINEAR, NOTHING, ORDER
from granular.md.located.settle import hold_walls, settle
from granular.md.located.step_size import REACH
from granular.md.located.swing import Swing, highest

WORTH = 20.0
"""Steps of an island that a stretch has to save."""
LONGEST = 1e6
"""Steps of an island that a stretch saves at most; some paths have no end."""
STILL = 1e-13
"""Part of the overlaps, and of their natural rates, up to which what laws that are not linear swing is rounding."""
MARGIN = 1e-6
"""Part of the largest force of a contact above which it has to stay."""
LARGEST_CURVED = 40
"""Pairs beyond which piles that are not linear do not ride: a stretch costs their number cubed."""
FIT = {"DRIVEN": True, "WORKED": True}
"""Rides are in scenes with driven walls only."""


class Ride:
    """A stretch of the ride of a pile, from the clock of its block on, with plain records.

    Attributes
    ----------
    pile : Pile
        Who rides.
    until : float
        s, up to where nothing happens.
    """

    def __init__(self, s: Any, pile: Pile, laws: Any, before: Ride | None = None) -> None:
        self.s, self.pile, self.laws, self.until = s, pile, laws, -math.inf
        self.members = [s.pool[s.pairs[c].slot] for c in range(pile.first, pile.end)]
        self.block: Any = s.pool[s.pairs[pile.lo].slot]
        self.swing: Swing | None = None
        inverse = [float(s.bodies[b].inverse_mass) for b in range(pile.first, pile.end + 1)]
        self.closed = inverse[0] == inverse[-1] == 0.0
        if all(member.kind == LINEAR for member in self.members):
            known = before is not None and before.pile == pile
            self.swing = before.swing if known and before is not None else Swing(self.members, inverse)

    def begins(self) -> bool:
        """Return whether a next stretch is proved, and write its slow motion as the piece of the block; else nothing is
        changed but for that piece."""
        s, block, w = self.s, self.block, slow.inverse_masses(self.members)
        xi, eta = columns(self.members)[2:]
        if not xi.min() > 0.0:
            return False
        forces = slow.forces_of(self.members, self.laws)
        self.step = REACH / slow.fastest(forces, xi, eta, w)
        h = fitted(foresee_walls, **FIT)(s.walls, s.pairs, s.pool, self.pile.lo)
        h = min(h, LONGEST * self.step)
        edge = h == block.holds and not edge_jumps(s, self.pile)
        h, found = h if edge else h - 0.5 * self.step, False
        if self.swing is not None:
            found = self.swing.known and WORTH * self.step < h and self.solve_linear(h, xi, eta, w)
        while self.swing is None and not found and WORTH * self.step < h:
            found = len(xi) <= LARGEST_CURVED and self.solve_curved(h, xi, eta, w)
            edge, h = edge and found, 0.5 * h
        if not found:
            return False
        block.clock, block.linear, block.h, block.fired = 1, int(self.swing is not None), self.h, -1
        self.write()
        block.tau = self.proved()
        block.what = EDGE if edge and block.tau == 1.0 else NOTHING
        self.until = min(block.t + (self.lasts() + block.tail), others_due(s, self.pile))
        return bool(self.until - block.t > WORTH * self.step)

    def solve_linear(self, h: float, xi: Array, eta: Array, w: Array) -> bool:
        """Find the slow motion of linear contacts, and what they swing; return whether it is slow."""
        assert self.swing is not None
        by, k, gamma = self.pressed(h, w), self.swing.k, self.swing.gamma
        rows = slow.linear(k, gamma, by)
        if rows is None:
            return False
        self.keep(h, rows, k * rows + gamma * rate_of(rows, h))
        self.r = self.swing.of(xi - self.xi[0], eta - self.eta[0])
        return True

    def solve_curved(self, h: float, xi: Array, eta: Array, w: Array) -> bool:
        """Find the motion under other laws; return whether it is slow, but for rounding, and a polynomial shows it."""
        forces = slow.forces_of(self.members, self.laws)
        motion = slow.curved(forces, xi, eta, self.pressed(h, w))
        if motion is None:
            return False
        self.keep(h, motion.xi, motion.force)
        pace = np.sqrt(forces(xi[None], eta[None])[1][0] * [member.inverse for member in self.members])
        self.away = float((np.maximum(abs(motion.first - xi), abs(motion.rate - eta) / pace) / xi).max())
        return self.away <= STILL

    def keep(self, h: float, xi: Array, force: Array) -> None:
        """Keep the slow motion of a stretch."""
        self.h, self.xi, self.eta, self.force = h, xi, rate_of(xi, h), force
        self.speeds = wall_speeds(self.s, self.pile, h)

    def write(self) -> None:
        """Write the slow motion as the piece of the block."""
        for i, member in enumerate(self.members):
            member.x, member.e, member.f = (rows[:, i].tolist() for rows in (self.xi, self.eta, self.force))
            member.g = member.f.copy()
        if self.pile.flank >= 0:
            apart = self.s.pool[self.s.pairs[self.pile.flank].slot]
            apart.x = (self.total - self.xi.sum(axis=1)).tolist()
            apart.e = (rate_of(self.total, self.h) - self.eta.sum(axis=1)).tolist()
            apart.f, apart.g = [0.0] * (ORDER + 1), [0.0] * (ORDER + 1)

    def lasts(self) -> float:
        """Return how long the piece is, in s."""
        return float(fitted(piece_time, **FIT)(self.block))

    def pressed(self, h: float, w: Array) -> slow.Pressed:
        """Return what presses on the pile, and keep the sum of the overlaps of its block."""
        pull, self.total = presses(self.s, self.pile, h)
        return slow.Pressed(h, pull, self.total if self.closed else None, w)

    def proved(self) -> float:
        """Return the τ, at most 1, up to which it is proved that nothing happens."""
        forces, apart = (0.0, 0.0) if self.swing is None else self.swing.bounds(self.r)
        tau, work = 1.0, self.s.work
        for member, bound in zip(self.members, (forces + MARGIN * abs(self.force).sum(axis=0)).tolist(), strict=True):
            tau = min(tau, shifted(member.f, -bound, tau, work, -1.0))
        if self.pile.flank >= 0:
            tau = min(tau, shifted(self.s.pool[self.s.pairs[self.pile.flank].slot].x, apart, tau, work, 1.0))
        return float(tau)

    def goes_to(self, t: float) -> None:
        """Bring the pile to the time t in s, at most `until`; its piece is used up."""
        s, pile, block, run = self.s, self.pile, self.block, self.s.run[0]
        hi, edge = s.pairs[pile.lo].hi, not t < block.t + (self.lasts() + block.tail)
        dt = self.lasts() if edge else (t - block.t) - block.tail
        tau, log = block.tau if edge else min(block.tau, dt / block.h), run.log
        run.log = log if self.swing is None else min(log, 1)  # peaks of the slow motion are not those of the sum
        fitted(settle, **FIT)(run, s.pairs, s.pool, s.bodies, s.work, pile.lo, tau, dt, s, self.laws)
        run.log = log
        if self.swing is None:
            run.error += self.away
        else:
            self.swings(self.swing, dt, tau)
        run.t, run.tail = block.t, block.tail
        carry_walls(s.walls, s)
        for member in (s.pool[s.pairs[c].slot] for c in range(pile.lo, hi)):
            if edge and block.what == EDGE and member.wall > 0:
                member.eta += jump_at(s.walls, member, run.t, run.tail)[1]
                member.e[0] = member.eta
        if s.bodies[pile.lo].inverse_mass == 0.0 and s.bodies[hi].inverse_mass == 0.0:
            hold_walls(s.pairs, s.pool, pile.lo, hi, s.bodies[pile.lo].v - s.bodies[hi].v)
        block.h, block.what, run.steps = self.step, NOTHING, run.steps + 1  # for the series of the end of a run

    def swings(self, swing: Swing, dt: float, tau: float) -> None:
        """Add to what the pile has come to in a time `dt`, up to τ, what it swings."""
        s, pile, later = self.s, self.pile, swing.after(self.r, dt)
        xi, eta, impulse = swing.overlap(later), swing.rate(later), swing.impulse(self.r, later)
        part = swing.parts(self.r)
        for i, member in enumerate(self.members):
            self.add_to(member, float(xi[i]), float(eta[i]), float(impulse[i]))
            if s.run[0].log == 2:
                shapes = (row @ swing.modes[: len(row)] * part for row in (swing.shape[i], swing.force[i]))
                tops = (member.xi_max, self.xi[:, i]), (member.force_max, self.force[:, i])
                member.xi_max, member.force_max = (
                    highest(row, (shape, swing.rates * self.h), tau, so_far)
                    for shape, (so_far, row) in zip(shapes, tops, strict=True)
                )
        if pile.flank >= 0:
            apart = s.pool[s.pairs[pile.flank].slot]
            apart.xi, apart.eta = apart.xi - float(xi.sum()), apart.eta - float(eta.sum())
            apart.x[0], apart.e[0] = apart.xi, apart.eta
        for b, change in zip(swing.balls.tolist(), (later - self.r)[swing.n :].tolist(), strict=True):
            s.bodies[pile.first + b].v += change
        for place, amount in enumerate(self.books(swing, later, tau)):
            add(s.ledger[0], place, amount)

    def add_to(self, member: Any, xi: float, eta: float, impulse: float) -> None:
        """Add to a contact what overlap, rate and impulse have swung."""
        member.xi, member.eta = member.xi + xi, member.eta + eta
        member.x[0], member.e[0] = member.xi, member.eta
        if self.s.run[0].log > 0:
            member.impulse += impulse
            if len(self.members) > 1:
                add_shared(self.s.run[0], impulse)

    def books(self, swing: Swing, later: Array, tau: float) -> list[float]:
        """Return what the swings add to the sums of the ledger up to τ, in J."""
        out = [0.0] * 5
        for place, c, speed in self.speeds:
            out[place] = swing.integral(np.multiply.outer(speed, swing.force[c]), self.r, later, self.h, tau)
        loss = 2.0 * (self.eta[:-1] * swing.gamma) @ swing.shape
        g = np.hstack([np.zeros_like(loss), loss])
        out[LOST] = swing.integral(g, self.r, later, self.h, tau) + (swing.energy(self.r) - swing.energy(later))
        return out

    def show(self, elapsed: float, rows: Any, sums: Any) -> None:
        """Add to rows of overlaps (m), rates (m/s) and forces (N), and to the sums of a ledger (J), what the pile
        swings at a time into the run."""
        if self.swing is None:
            return
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
            for place, amount in enumerate(self.books(self.swing, later, min(self.block.tau, dt / self.h))):
                sums[place] += amount


def rate_of(rows: Array, h: float) -> Array:
    """Return the derivative by t = hτ of coefficients in τ, of as many orders."""
    rate = np.zeros_like(rows)
    rate[:-1] = polynomial.polyder(rows) / h
    return rate

"""The step of laws that are no powers: the same polynomial pieces, found by collocation instead of recurrences.

The forces are evaluated at 16 Gauss points of the step and interpolated; the polynomials of rate and overlap follow by
exact integration, and the forces are evaluated anew there until nothing changes (Picard). The interpolant's last
Legendre coefficients say whether the step resolves the force, and so does the law itself at both ends and between the
nodes, for a kink between an end and the outermost node shows at no node; if not, it is halved. Interpreted only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.flight import time_to_contact
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws, no_number
from granular.md.located.collocation import (
    INTEGRATE,
    INTEGRATE_TO_LOOKS,
    NODES,
    POINTS,
    TO_LEGENDRE,
    TO_LOOKS,
    TO_POWERS,
    WEIGHT,
    _beside,
    _errors,
    _integrate,
    _own_speeds,
    _shaking,
    next_event_of_law,
    shown,
)
from granular.md.located.pieces import ULP, value, write_flight
from granular.md.located.records import ACTIVE, DORMANT, LONG, OPEN, ORDER, RESIDUAL
from granular.md.located.rest.proof import STILL
from granular.md.located.step_size import amplitude

SWEEPS = 40
SMALLEST = 2e-15
"""The tolerance cannot be smaller: interpolated forces carry their rounding."""
SHORTEST, HOPELESS = 1e-14, 1e-60
"""Parts of a step to which it is halved at most: of one that converges, where the force jumps, and of any."""
SHORT = 1e-9
"""Part of a contact's time below which a step may cross a jump, and of its force from which it does."""
TOUCH = 1e-150
"""Overlap in m of a touch: a law need not be defined at 0, and may have a force there."""
SETTLED = 1024.0 * ULP
"""Part of the largest force of a contact up to which a clipped force is rounding."""
FLAT = 1.0 - 1e-9
"""Part of an overlap at which a force that is 0, and 0 here, is 0 on the whole, as below a plastic overlap."""
PRECISE = 3e-14
"""Error of forces, as a part of the largest: a kink in a short step hardly moves rates, but peaks are read there."""
HYSTERESIS = 1e-13
"""Where an interpolated force is within this part of its largest value in the piece, its sign is in doubt."""
AtRest = Callable[[Any, float], float]
"""Force in N of a pair at an overlap in m."""
TANGENT = 1e-6
"""Part of an overlap over which its stiffness is taken."""
ROUNDING = 1e-11
"""Part of the accelerations of a pair, and of its block's speed, up to which their sum, and its rate, is rounding."""


class Collocation:
    """Forces of a scene as its laws give them, and the steps they make."""

    def __init__(self, laws: SceneLaws, ring: bool) -> None:
        self.laws, self.ring = list(laws), ring
        self.closed = False  # whether the island under way goes all around a ring
        self.shaken: list[tuple[int, Any]] = []  # of the island under way, pairs at driven walls, and their paths
        self.square = 0.0  # Ω² of pendula
        self.trials = 0  # steps tried, of all pieces

    def force(self, p: Any, xi: float, eta: float = 0.0) -> float:
        """Unclipped force in N of a pair on the branch that it is on."""
        try:
            return on_branch(self.laws[p.number], xi, eta, p.xi_peak, p.loading)
        except OverflowError:  # the trial step is too long
            return math.inf

    @np.errstate(over="ignore", invalid="ignore")  # trial steps may be far too long
    def fill(
        self, records: list[Any], pool: list[Any], lo: int, tol: float, field: Any = None, holds: float = math.inf
    ) -> float:
        """Compute the piece of an island on τ in [0, 1], set its h and clock; return its truncation error.

        It is no longer than `holds`, for which the paths of driven walls go on as they do.
        """
        self.square = getattr(field, "square", 0.0)
        island = enumerate(records[lo : records[lo].hi])
        self.shaken = [(i, field.path[p.wall - 1]) for i, p in island if p.wall > 0]
        pairs = [pool[p.slot] for p in records[lo : records[lo].hi]]
        self.closed = self.ring and len(pairs) == len(self.laws)
        block = pairs[0]
        block.clock = 2 if any(p.mode == ACTIVE and p.xi == 0.0 and p.q > 1 for p in pairs) else 1
        reach = 0.2 * block.length / block.speed if block.speed > 0.0 else 1.0
        if block.last_step > 0.0 and block.clock == 1:
            reach = block.last_step
        allowed, shortest = max(tol, SMALLEST), HOPELESS * reach
        self._check(pairs, [0.0])
        if not (self.shaken or self.square) and lie_still(pairs, self.force, self.closed):
            return 0.0
        reach = min(reach, shown(self.shaken, holds, block.clock))
        while True:
            block.h = reach if block.clock == 1 else math.sqrt(reach)
            self.trials += 1
            force, misses, rough = self._iterate(pairs)
            miss = float((misses / _own_speeds(pairs)).max())
            if (miss <= allowed and rough <= PRECISE) or not reach > shortest:
                break
            if miss < math.inf:  # so long a step converges; a far shorter one crosses a jump
                shortest = max(shortest, SHORTEST * reach)
            elif reach * block.speed < SHORT * block.length:
                self._check(pairs, ((block.h * NODES) ** block.clock).tolist())
            reach *= 0.5
        growth = (allowed / miss) ** (1.0 / POINTS) if miss > 0.0 else 2.0
        block.last_step = reach * min(2.0, 0.9 * growth)
        self._write(pairs, force, reach)
        return float(misses.max()) / block.speed if block.speed > 0.0 else 0.0

    def next_event(self, p: Any, span: float, scratch: Any) -> tuple[float, int]:
        """Return the τ of the first event of a pair that overlaps within [0, span], inf without, and which it is."""
        asked = partial(self._pushes, p, 1e-3 * (p.deepest or p.own_length))
        return next_event_of_law(p, asked, partial(self._idles, p), p.doubt, span, scratch)

    def dissipated(self, p: Any, block: Any, tau: float) -> float:
        """Return the energy in J that a contact loses in [0, τ] of its piece; nan with memory."""
        law = self.laws[p.number]
        if p.mode == RESIDUAL:
            return self.lost(p, value(p.x, 0.0), value(p.x, tau))
        if law.memory or not law.rate_dependent:
            return math.nan if law.memory else 0.0
        total, q = 0.0, block.clock
        for node, weight in zip(NODES.tolist(), (0.5 * WEIGHT).tolist(), strict=True):
            xi, eta = value(p.x, tau * node), value(p.e, tau * node)
            rate = (value(p.f, tau * node) - law.force(xi, 0.0, xi)) * eta if xi > 0.0 else 0.0
            total += weight * rate * q * math.pow(node, q - 1.0)
        return float(total * math.pow(block.h * tau, float(q)))

    def lost(self, p: Any, first: float, last: float) -> float:
        """Return the elastic energy in J that a pair loses without a force from one overlap to another."""
        law = self.laws[p.number if hasattr(p, "number") else p.first]
        return float(law.energy(first) - law.energy(last))

    def is_clipped(self, p: Any) -> bool:
        """Return whether the law gives no push to balls that overlap."""
        return not self.force(p, p.xi, p.eta) > 0.0

    def pushes_at_touch(self, p: Any) -> bool:
        """Return whether a pair that has just closed at a rate > 0 is pushed apart at once, and not only later."""
        depth = amplitude(p, p.eta * p.eta)
        force = self.force(p, 1e-9 * depth, p.eta)
        return force > 0.0 or (force == 0.0 and self.force(p, 1e-3 * depth, p.eta) > 0.0)

    def _pushes(self, p: Any, shallow: float, tau: float, surely: bool = False) -> bool:
        """Return whether the law of a pair pushes at τ (`surely`: beyond what rounding makes of a contact's end).

        Up to a `shallow` overlap the force of a contact may be 0 by underflow. Where it is 0 all about, any is sure.
        """
        xi = value(p.x, tau)
        force = self.force(p, xi, value(p.e, tau))
        surely = surely and self.force(p, FLAT * p.x[0], p.e[0]) != 0.0
        floor = SETTLED * p.largest if surely else 0.0
        return force > floor or (p.mode == ACTIVE and force == 0.0 and xi < shallow)

    def _idles(self, p: Any, tau: float) -> bool:
        """Return whether the law of a pair gives no force at τ, and none at slightly other overlaps."""
        xi, eta = value(p.x, tau), value(p.e, tau)
        return all(self.force(p, xi * part, eta) == 0.0 for part in (FLAT, 1.0, 2.0 - FLAT))

    def _check(self, pairs: list[Any], times: list[float]) -> None:
        """Raise if nothing stops an overlap, or if a force is no number, at times in the step, by free flight."""
        for p, t in product(pairs, times):
            xi, eta = p.xi + (p.eta + 0.5 * p.pull * t) * t, p.eta + p.pull * t
            if xi > 1e150:
                raise ValueError(
                    f"law of pair {p.number} is {self.laws[p.number].law!r}: it lets the bodies pass through each "
                    f"other, and their overlap grows forever; a law that stops them is needed, or a t_end."
                )
            if p.mode in (ACTIVE, RESIDUAL) and (t > 0.0 or xi > 0.0):
                force = self.force(p, xi, eta)
                if not math.isfinite(force):
                    raise no_number(self.laws[p.number], xi, eta, force)

    def _iterate(self, pairs: list[Any]) -> tuple[Array, Array, float]:
        """Return the forces (pairs, nodes) at the nodes, and errors, inf if they diverge: of each rate, and of forces.

        The latter as a part of the largest force of a contact at the pair's own speed.
        """
        lower, own, upper, pull, xi0, eta0 = np.array(
            [(p.lower, p.inverse, p.upper, p.pull, p.xi, p.eta) for p in pairs]
        ).T[:, :, None]
        h, q = pairs[0].h, pairs[0].clock
        pace = q * h**q * NODES ** (q - 1)
        eta = eta0 + pull * (h * NODES) ** q
        xi = xi0 + (0.5 * (eta0 + eta)) * (h * NODES) ** q
        pull = pull + _shaking(self.shaken, len(pairs), (h * NODES) ** q)
        force, worst = np.zeros_like(eta), math.inf
        acts = np.array([p.mode == ACTIVE for p in pairs])
        grain = self._grain(pairs, xi, eta)
        for _ in range(SWEEPS):
            new = self._forces(pairs, xi, eta)
            change, force = float(abs(new - force).max()), new
            if not change < 1e300 or change > 1e3 * worst:
                break
            acting = _beside(np.where(acts[:, None], force, 0.0), self.closed)
            push = pull + lower * acting[:-2] - own * acting[1:-1] + upper * acting[2:] - self.square * xi
            eta = eta0 + (push * pace) @ INTEGRATE.T
            xi = xi0 + (eta * pace) @ INTEGRATE.T
            largest = float(abs(force).max())
            settled = change <= max(4e-16 * largest, float(grain.max()))
            if settled or (change < 1e-13 * largest and change >= worst):
                looks = (xi0 + (eta * pace) @ INTEGRATE_TO_LOOKS.T, eta0 + (push * pace) @ INTEGRATE_TO_LOOKS.T)
                noise = np.maximum(4.0 * grain, np.where(acts, 0.0, HYSTERESIS * abs(force).max(axis=1)))
                miss, rough = _errors(pairs, force, abs(force @ TO_LOOKS.T - self._forces(pairs, *looks)), noise)
                return force, miss * own[:, 0] * h**q, rough
            worst = change
        return force, np.full(len(pairs), math.inf), math.inf

    def _grain(self, pairs: list[Any], xi: Array, eta: Array) -> Array:
        """How much of each force one rounding of its overlap moves, where that is far more than the force's own."""
        here = self._forces(pairs, xi, eta)
        moved = abs(self._forces(pairs, xi * (1.0 + ULP), eta) - here).max(axis=1)
        steep: Array = np.where(moved > 16.0 * ULP * abs(here).max(axis=1), moved, 0.0)
        return steep

    def _forces(self, pairs: list[Any], xi: Array, eta: Array) -> Array:
        """Forces at the nodes of all pairs that overlap; those of residual pairs do not act."""
        force = np.zeros_like(xi)
        for i, p in enumerate(pairs):
            if p.mode != OPEN and p.mode != DORMANT:
                force[i] = self._along(p, xi[i].tolist(), eta[i].tolist())
        return force

    def _along(self, p: Any, xi: list[float], eta: list[float]) -> list[float]:
        """Forces of a pair at some overlaps and rates, without detours where no image is among them."""
        law, at = self.laws[p.number], list(zip(xi, eta, strict=True))
        if not law.memory and min(xi) >= 0.0:
            ask, pair = law.law.force, law.pair
            with suppress(OverflowError):
                return [float(ask(x, e, pair)) for x, e in at]
        return [self.force(p, x, e) for x, e in at]

    def _write(self, pairs: list[Any], force: Array, reach: float) -> None:
        """Write the rows: forces from their interpolants (in g clipped ones too), rates and overlaps by integration.

        Forces that jump within a short step become straight lines, not to overshoot.
        """
        last_terms, peaks = abs(force @ TO_LEGENDRE[-2:].T).max(axis=1), abs(force).max(axis=1)
        doubts = np.maximum(HYSTERESIS * peaks, 8.0 * last_terms)
        rows = np.pad((force @ TO_LEGENDRE.T) @ TO_POWERS, ((0, 0), (0, ORDER + 1 - POINTS)))
        for p, row, doubt, peak in zip(pairs, rows.tolist(), doubts.tolist(), peaks.tolist(), strict=True):
            p.largest = 0.0 if p.mode == OPEN else max(p.largest, peak)
            p.deepest = 0.0 if p.mode == OPEN else max(p.deepest, p.xi)
            p.doubt = max(doubt, SETTLED * p.largest) if p.mode == RESIDUAL else doubt
            p.f, p.g = row if p.mode == ACTIVE else [0.0] * (ORDER + 1), row.copy()
        _integrate(pairs, self.shaken, self.square, self.closed)
        jumps = [self._jumps(p) for p in pairs if p.mode == ACTIVE and reach * p.own_speed < SHORT * p.own_length]
        if any(jumps):
            _integrate(pairs, self.shaken, self.square, self.closed)

    def _jumps(self, p: Any) -> bool:
        """Write the force of a short step as a straight line if it jumps there; return whether it does."""
        first, last = self.force(p, p.xi, p.eta), self.force(p, value(p.x, 1.0), value(p.e, 1.0))
        jumps = bool(max(abs(p.f[0] - first), abs(value(p.f, 1.0) - last)) > SHORT * p.largest)
        if jumps:
            p.f = [first, last - first] + [0.0] * (ORDER - 1)
            p.g = p.f.copy()
        return jumps


def on_branch(law: PairLaw, xi: float, eta: float, top: float, loading: int) -> float:
    """Force in N of a law; beyond ξ = 0 or the largest overlap so far, on its branch, a mirror image.

    Images serve interpolation only; they keep value and slope, so that the law's own branches end at events.
    """
    unloading = law.memory and not loading

    def branch(xi: float, eta: float) -> float:
        return law.force(xi, eta, top if unloading else max(top, xi))

    if law.memory and loading and top > 0.0 and xi < top:  # loading goes on as it is above the old maximum
        mirror, image = top, 2.0 * top - xi
    elif xi < 0.0:
        mirror, image = TOUCH, min(-xi, top) if unloading else -xi
    elif unloading and xi > top:
        mirror, image = top, max(0.0, 2.0 * top - xi)
    else:
        return branch(xi, eta)
    return branch(mirror, eta) + branch(mirror, -eta) - branch(image, -eta)


def lie_still(pairs: list[Any], at_rest: AtRest, closed: bool) -> bool:
    """Write the piece of a block that lies still, and return whether it does; `closed` if it is a ring."""
    block = pairs[0]
    if any(p.mode not in (OPEN, ACTIVE) or (p.mode == ACTIVE and not abs(p.eta) <= STILL * block.speed) for p in pairs):
        return False
    force = [at_rest(p, p.xi) if p.mode == ACTIVE else 0.0 for p in pairs]
    push = accelerations(pairs, force, closed)
    deeper = {i: at_rest(p, p.xi * (1.0 + TANGENT)) for i, p in enumerate(pairs) if p.mode == ACTIVE}
    if not deeper or not all(balances(pairs[i], push[i], force[i], more) for i, more in deeper.items()):
        return False
    arrivals = [time_to_contact(max(0.0, -p.xi), -p.eta, a) for p, a in zip(pairs, push, strict=True) if p.mode == OPEN]
    if 0.0 in arrivals:  # the run has stopped where a ball arrives
        return False
    block.clock, block.h, block.last_step = 1, min([LONG, *(2.0 * t for t in arrivals)]), 0.0
    for p, f, a in zip(pairs, force, push, strict=True):
        if p.mode == ACTIVE or abs(p.eta) <= ROUNDING * block.speed:
            p.eta = 0.0
        write_flight(p, block.h, a if p.mode == OPEN else 0.0, f)
    return True


def accelerations(pairs: list[Any], force: list[float], closed: bool) -> list[float]:
    """Closing accelerations in m/s² of all pairs, 0 where those of open ones are rounding."""
    first, last = (force[-1], force[0]) if closed else (0.0, 0.0)
    out = []
    for p, below, own, above in zip(pairs, [first, *force[:-1]], force, [*force[1:], last], strict=True):
        parts = (p.pull, p.lower * below, -p.inverse * own, p.upper * above)
        total = math.fsum(parts)
        rounding = p.mode == OPEN and abs(total) <= ROUNDING * max(map(abs, parts))
        out.append(0.0 if rounding else total)
    return out


def balances(pair: Any, push: float, force: float, more: float) -> bool:
    """Return whether a pair is at rest where its force balances, given the force a little deeper."""
    stiffness = (more - force) / (TANGENT * pair.xi)
    square = stiffness * pair.inverse
    if not (force > 0.0 and stiffness > 0.0):
        return False
    return bool(abs(push) <= STILL * pair.xi * square and abs(pair.eta) <= STILL * pair.xi * math.sqrt(square))


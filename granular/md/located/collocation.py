"""The step of laws that are no powers: the same polynomial pieces, found by collocation instead of recurrences.

The forces are evaluated at 16 Gauss points of the step and interpolated; the polynomials of rate and overlap follow by
exact integration, and the forces are evaluated anew there until nothing changes (Picard). The interpolant's last
Legendre coefficients say whether the step resolves the force, and so does the law itself at both ends and between the
nodes, for a kink between an end and the outermost node shows at no node; if not, it is halved. Interpreted only.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from numpy.polynomial import legendre, polynomial

from granular._check import Array
from granular.laws.check import no_number
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws
from granular.md.located.events import NOTHING
from granular.md.located.piece import value
from granular.md.located.records import ACTIVE, DORMANT, OPEN, ORDER, RESIDUAL
from granular.md.located.signs import next_event
from granular.md.located.steps import amplitude
from granular.md.located.still import lie_still

POINTS = 16
SWEEPS = 40
SMALLEST = 2e-15
"""The tolerance cannot be smaller: interpolated forces carry their rounding."""
SHORTEST, HOPELESS = 1e-14, 1e-60
"""Parts of a step to which it is halved at most: of one that converges, where the force jumps, and of any."""
SHORT = 1e-9
"""Part of a contact's time below which a step may cross a jump, and of its force from which it does."""
ULP = 2.0**-52
EDGE = 1e-150
"""Overlap in m of a touch: a law need not be defined at 0, and may have a force there."""
SETTLED = 1024.0 * ULP
"""Part of the largest force of a contact up to which a clipped force is rounding."""
FLAT = 1.0 - 1e-9
"""Part of an overlap at which a force that is 0, and 0 here, is 0 on the whole, as below a plastic overlap."""
PRECISE = 3e-14
"""Error of forces, as a part of the largest: a kink in a short step hardly moves rates, but peaks are read there."""
HYSTERESIS = 1e-13
"""Where an interpolated force is within this part of its largest value in the piece, its sign is in doubt."""


def _shifted_legendre() -> Array:
    """Coefficients in τ of the Legendre polynomials in 2τ - 1, one per row."""
    rows = np.zeros((POINTS, POINTS))
    for k in range(POINTS):
        power = legendre.leg2poly([0.0] * k + [1.0])
        out = np.zeros(1)
        for c in power[::-1]:
            out = polynomial.polyadd(polynomial.polymul(out, [-1.0, 2.0]), [c])
        rows[k, : k + 1] = np.round(out[: k + 1])
    return rows


_X, _WEIGHT = legendre.leggauss(POINTS)
NODES = 0.5 * (_X + 1.0)
TO_LEGENDRE = legendre.legvander(_X, POINTS - 1).T * _WEIGHT * (np.arange(POINTS)[:, None] + 0.5)
TO_POWERS = _shifted_legendre()
LOOKS = np.concatenate([[0.0], 0.5 * (NODES[1:] + NODES[:-1]), [1.0]])
"""Where the law is asked whether the interpolant holds: both ends, and between the nodes."""
TO_LOOKS = legendre.legvander(2.0 * LOOKS - 1.0, POINTS - 1) @ TO_LEGENDRE
"""Values there of what is given at the nodes."""
NEAR = np.array([1.0 - NODES[-1], *[1.0 / POINTS] * (POINTS - 1), 1.0 - NODES[-1]])
"""Share of the step for which each of them stands."""


def _integrals(places: Array) -> Array:
    """Integrals from 0 to some places in [-1, 1] of what is given at the nodes."""
    powers = [(legendre.legint([0.0] * k + [0.5], lbnd=-1), k + 1) for k in range(POINTS)]
    primitive = [row @ legendre.legvander(places, degree).T for row, degree in powers]
    out: Array = np.array(primitive).T @ TO_LEGENDRE
    return out


INTEGRATE, INTEGRATE_TO_LOOKS = _integrals(_X), _integrals(2.0 * LOOKS - 1.0)
"""Integrals from 0 to each node, and to each look, of what is given at the nodes."""


def _own_speeds(pairs: list[Any]) -> Array:
    return np.array([p.own_speed if p.own_speed > 0.0 else 1.0 for p in pairs])


class Collocation:
    """Forces of a scene as its laws give them, and the steps they make."""

    def __init__(self, laws: SceneLaws) -> None:
        self.laws = list(laws)
        self.doubt = [0.0] * len(laws)  # N, of the interpolated forces of the current pieces
        self.largest = [0.0] * len(laws)  # N, force since the balls of the pair last parted
        self.deepest = [0.0] * len(laws)  # m, overlap since then

    def force(self, c: int, xi: float, eta: float, top: float, loading: int) -> float:
        """Unclipped force in N of pair `c`; beyond ξ = 0 or the largest overlap so far, on its branch, a mirror image.

        Images serve interpolation only; they keep value and slope, so that the law's own branches end at events.
        """
        try:
            return self._evaluate(self.laws[c], xi, eta, top, loading)
        except OverflowError:  # the trial step is too long
            return math.inf

    @staticmethod
    def _evaluate(law: PairLaw, xi: float, eta: float, top: float, loading: int) -> float:
        unloading = law.memory and not loading

        def branch(xi: float, eta: float) -> float:
            return law.force(xi, eta, top if unloading else max(top, xi))

        if law.memory and loading and top > 0.0 and xi < top:  # loading goes on as it is above the old maximum
            return branch(top, eta) + branch(top, -eta) - branch(2.0 * top - xi, -eta)
        if xi < 0.0:
            image = branch(min(-xi, top) if unloading else -xi, -eta)
            return branch(EDGE, eta) + branch(EDGE, -eta) - image
        if unloading and xi > top:
            return branch(top, eta) + branch(top, -eta) - branch(max(0.0, 2.0 * top - xi), -eta)
        return branch(xi, eta)

    @np.errstate(over="ignore", invalid="ignore")  # trial steps may be far too long
    def fill(self, records: list[Any], pool: list[Any], lo: int, tol: float) -> float:
        """Compute the piece of an island on τ in [0, 1], set its h and clock; return its truncation error."""
        pairs = [pool[p.slot] for p in records[lo : records[lo].hi]]
        block = pairs[0]
        block.clock = 2 if any(p.mode == ACTIVE and p.xi == 0.0 and p.q > 1 for p in pairs) else 1
        reach = 0.2 * block.length / block.speed if block.speed > 0.0 else 1.0
        if block.stride > 0.0 and block.clock == 1:
            reach = block.stride
        allowed, speeds = max(tol, SMALLEST), _own_speeds(pairs)
        self._check_start(pairs, lo)
        if lie_still(pairs, partial(self._at_rest, pairs, lo)):
            return 0.0
        shortest = HOPELESS * reach
        while True:
            block.h = reach if block.clock == 1 else math.sqrt(reach)
            force, misses, rough = self._iterate(pairs, lo, block.h, block.clock)
            miss = float((misses / speeds).max())
            if (miss <= allowed and rough <= PRECISE) or not reach > shortest:
                break
            if miss < math.inf:  # so long a step converges; a far shorter one crosses a jump
                shortest = max(shortest, SHORTEST * reach)
            elif reach * block.speed < SHORT * block.length:
                self._check_nodes(pairs, lo, block.h, block.clock)
            reach *= 0.5
        growth = (allowed / miss) ** (1.0 / POINTS) if miss > 0.0 else 2.0
        block.stride = reach * min(2.0, 0.9 * growth)
        self._write(pairs, lo, force, block.h, block.clock)
        if self._write_jumps(pairs, lo, reach):
            _integrate(pairs, block.h, block.clock)
        return float(misses.max()) / block.speed if block.speed > 0.0 else 0.0

    def _at_rest(self, pairs: list[Any], lo: int, i: int, xi: float) -> float:
        """Force in N of a pair at an overlap, at rest."""
        return self.force(lo + i, xi, 0.0, pairs[i].top, pairs[i].loading)

    def _write_jumps(self, pairs: list[Any], lo: int, reach: float) -> bool:
        """Write forces that jump within a short step as straight lines, not to overshoot; return if there are any."""
        found = False
        for c, p in enumerate(pairs, lo):
            if p.mode == ACTIVE and reach * p.own_speed < SHORT * p.own_length:
                first = self.force(c, p.xi, p.eta, p.top, p.loading)
                last = self.force(c, value(p.x, 1.0), value(p.e, 1.0), p.top, p.loading)
                off = max(abs(p.f[0] - first), abs(value(p.f, 1.0) - last))
                if off > SHORT * self.largest[c]:
                    p.f = [first, last - first] + [0.0] * (ORDER - 1)
                    p.g, found = list(p.f), True
        return found

    def locate(self, records: list[Any], pool: list[Any], lo: int, work: Any) -> None:
        """Find the event that ends the piece of an island; it ends at τ = 1 if there is none."""
        block = pool[records[lo].slot]
        block.tau, block.fired, block.what = 1.0, -1, NOTHING
        for c in range(lo, records[lo].hi):
            p = pool[records[c].slot]
            deep = self.deepest[c] or p.own_length
            ask = partial(self._pushes, c, p, 1e-3 * deep)
            tau, what = next_event(p, ask, partial(self._idles, c, p), self.doubt[c], block.tau, work)
            if tau <= block.tau and what != NOTHING:
                block.tau, block.fired, block.what = tau, c, what

    def pushes_at_touch(self, c: int, p: Any) -> bool:
        """Return whether pair `c`, which has just closed at a rate > 0, is pushed apart at once, and not only later."""
        depth = amplitude(p, p.eta * p.eta)
        force = self.force(c, 1e-9 * depth, p.eta, 0.0, 1)
        return force > 0.0 or (force == 0.0 and self.force(c, 1e-3 * depth, p.eta, 0.0, 1) > 0.0)

    def _pushes(self, c: int, p: Any, shallow: float, tau: float, surely: bool = False) -> bool:
        """Return whether the law of pair `c` pushes at τ (`surely`: beyond what rounding makes of a contact's end).

        Up to a `shallow` overlap the force of a contact may be 0 by underflow. Where it is 0 all about, any is sure.
        """
        xi = value(p.x, tau)
        force = self.force(c, xi, value(p.e, tau), p.top, p.loading)
        surely = surely and self.force(c, FLAT * p.x[0], p.e[0], p.top, p.loading) != 0.0
        floor = SETTLED * self.largest[c] if surely else 0.0
        return force > floor or (p.mode == ACTIVE and force == 0.0 and xi < shallow)

    def _idles(self, c: int, p: Any, tau: float) -> bool:
        """Return whether the law of pair `c` gives no force at τ, and none at slightly other overlaps."""
        xi, eta = value(p.x, tau), value(p.e, tau)
        return all(self.force(c, xi * part, eta, p.top, p.loading) == 0.0 for part in (FLAT, 1.0, 2.0 - FLAT))

    def _check_start(self, pairs: list[Any], lo: int) -> None:
        """Raise if a force at the start of the step is no number, or if nothing stops an overlap."""
        for c, p in enumerate(pairs, lo):
            if p.xi > 1e150:
                raise ValueError(
                    f"law of pair {c} is {self.laws[c].law!r}: it lets the bodies pass through each other, and their "
                    f"overlap grows for ever; a law that stops them is needed, or a t_end."
                )
            if p.xi > 0.0 and p.mode != OPEN and p.mode != DORMANT:
                self._check(c, p, p.xi, p.eta)

    def _check_nodes(self, pairs: list[Any], lo: int, h: float, q: int) -> None:
        """Raise if a force in the shortest of steps from here, by free flight, is no number."""
        for c, p in enumerate(pairs, lo):
            if p.mode != OPEN and p.mode != DORMANT:
                for t in ((h * NODES) ** q).tolist():
                    self._check(c, p, p.xi + (p.eta + 0.5 * p.pull * t) * t, p.eta + p.pull * t)

    def _check(self, c: int, p: Any, xi: float, eta: float) -> None:
        force = self.force(c, xi, eta, p.top, p.loading)
        if not math.isfinite(force):
            raise no_number(self.laws[c], xi, eta, force)

    def _iterate(self, pairs: list[Any], lo: int, h: float, q: int) -> tuple[Array, Array, float]:
        """Return the forces (pairs, nodes) at the nodes, and errors, inf if they diverge: of each rate, and of forces.

        The latter as a part of the largest force of a contact at the pair's own speed.
        """
        lower, own, upper, pull, xi0, eta0 = np.array(
            [(p.lower, p.inverse, p.upper, p.pull, p.xi, p.eta) for p in pairs]
        ).T[:, :, None]
        pace = q * h**q * NODES ** (q - 1)
        eta = eta0 + pull * (h * NODES) ** q
        xi = xi0 + (0.5 * (eta0 + eta)) * (h * NODES) ** q
        force, worst = np.zeros_like(eta), math.inf
        acts = np.array([p.mode == ACTIVE for p in pairs])
        speeds, diverged = _own_speeds(pairs), np.full(len(pairs), math.inf)
        strength = np.array([v * v / (p.inverse * amplitude(p, v * v)) for p, v in zip(pairs, speeds, strict=True)])
        grain = self._grain(pairs, lo, xi, eta)
        for _ in range(SWEEPS):
            new = self._forces(pairs, lo, xi, eta)
            change, force = float(abs(new - force).max()), new
            if not change < 1e300 or change > 1e3 * worst:
                return force, diverged, math.inf
            acting = np.where(acts[:, None], force, 0.0)
            below, above = np.zeros_like(acting), np.zeros_like(acting)
            below[1:], above[:-1] = acting[:-1], acting[1:]
            push = pull + lower * below - own * acting + upper * above
            eta = eta0 + (push * pace) @ INTEGRATE.T
            xi = xi0 + (eta * pace) @ INTEGRATE.T
            largest = float(abs(force).max())
            settled = change <= max(4e-16 * largest, float(grain.max()))
            if settled or (change < 1e-13 * largest and change >= worst):
                tail = abs(force @ TO_LEGENDRE[-2:].T).max(axis=1)
                noise = np.maximum(4.0 * grain, np.where(acts, 0.0, HYSTERESIS * abs(force).max(axis=1)))
                tail = np.where(tail > noise, tail, 0.0)
                between = xi0 + (eta * pace) @ INTEGRATE_TO_LOOKS.T, eta0 + (push * pace) @ INTEGRATE_TO_LOOKS.T
                off = abs(force @ TO_LOOKS.T - self._forces(pairs, lo, *between))
                off = np.where(off > noise[:, None], off, 0.0)
                miss = np.maximum(tail / POINTS, (off * NEAR).max(axis=1)) * own[:, 0]
                strength = np.maximum(strength, abs(force).max(axis=1))
                rough = np.maximum(tail, off.max(axis=1)) * acts / strength
                return force, miss * h**q, float(rough.max())
            worst = change
        return force, diverged, math.inf

    def _grain(self, pairs: list[Any], lo: int, xi: Array, eta: Array) -> Array:
        """How much of each force one rounding of its overlap moves, where that is far more than the force's own."""
        here = self._forces(pairs, lo, xi, eta)
        moved = abs(self._forces(pairs, lo, xi * (1.0 + ULP), eta) - here).max(axis=1)
        steep: Array = np.where(moved > 16.0 * ULP * abs(here).max(axis=1), moved, 0.0)
        return steep

    def _forces(self, pairs: list[Any], lo: int, xi: Array, eta: Array) -> Array:
        """Forces at the nodes of all pairs that overlap; those of residual pairs do not act."""
        force = np.zeros_like(xi)
        for i, p in enumerate(pairs):
            if p.mode != OPEN and p.mode != DORMANT:
                force[i] = self._along(lo + i, p, xi[i].tolist(), eta[i].tolist())
        return force

    def _along(self, c: int, p: Any, xi: list[float], eta: list[float]) -> list[float]:
        """Forces of pair `c` at some overlaps and rates, without detours where no image is among them."""
        law, at = self.laws[c], zip(xi, eta, strict=True)
        if not law.memory and min(xi) >= 0.0:
            ask, pair = law.law.force, law.pair
            try:
                return [float(ask(x, e, pair)) for x, e in at]
            except OverflowError:
                at = zip(xi, eta, strict=True)
        return [self.force(c, x, e, p.top, p.loading) for x, e in at]

    def _write(self, pairs: list[Any], lo: int, force: Array, h: float, q: int) -> None:
        """Write the rows: forces from their interpolants (in g clipped ones too), rates and overlaps by integration."""
        rows = (force @ TO_LEGENDRE.T) @ TO_POWERS
        doubt = np.maximum(HYSTERESIS * abs(force).max(axis=1), 8.0 * abs(force @ TO_LEGENDRE[-2:].T).max(axis=1))
        peaks = abs(force).max(axis=1).tolist()
        for c, (p, noise, peak) in enumerate(zip(pairs, doubt.tolist(), peaks, strict=True), lo):
            self.largest[c] = 0.0 if p.mode == OPEN else max(self.largest[c], peak)
            self.deepest[c] = 0.0 if p.mode == OPEN else max(self.deepest[c], p.xi)
            self.doubt[c] = max(noise, SETTLED * self.largest[c]) if p.mode == RESIDUAL else noise
        for p, row in zip(pairs, rows.tolist(), strict=True):
            series = row + [0.0] * (ORDER + 1 - POINTS)
            p.f = series if p.mode == ACTIVE else [0.0] * (ORDER + 1)
            p.g = list(series)
        _integrate(pairs, h, q)


def _integrate(pairs: list[Any], h: float, q: int) -> None:
    """Write the rows of rates and overlaps from those of the forces."""
    sigma, none = q * h**q, [0.0] * POINTS
    for i, p in enumerate(pairs):
        below = pairs[i - 1].f if i > 0 else none
        above = pairs[i + 1].f if i + 1 < len(pairs) else none
        p.x, p.e = [p.xi] + [0.0] * ORDER, [p.eta] + [0.0] * ORDER
        for n in range(POINTS):
            push = p.lower * below[n] - p.inverse * p.f[n] + p.upper * above[n] + (p.pull if n == 0 else 0.0)
            p.e[n + q] = sigma * push / (n + q)
        for n in range(POINTS + q):
            p.x[n + q] = sigma * p.e[n] / (n + q)

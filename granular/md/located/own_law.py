"""Polynomial steps under general laws, computed by collocation.

General laws are force laws that power series cannot represent. The forces are evaluated at 16 Gauss points of the step
and interpolated. The polynomials of rate and overlap follow by exact integration, and the forces are evaluated again
until they no longer change (Picard iteration). The last Legendre coefficients of the interpolant show whether the step
resolves the force. The law itself is evaluated at both ends and between the nodes as well: a kink between an end and
the outermost node affects no node. A step that does not resolve the force is halved. This module is always interpreted.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws, no_number
from granular.md.located.collocation import (
    GAUSS_NODES,
    GAUSS_POINTS,
    GAUSS_WEIGHTS,
    INTEGRATE_TO_CHECK_POINTS,
    INTEGRATE_TO_NODES,
    TO_CHECK_POINTS,
    TO_LEGENDRE,
    TO_POWERS,
    force_errors,
    forces_with_neighbours,
    integrate_forces,
    next_event_of_law,
    own_speeds,
    valid_series_time,
    wall_accelerations,
)
from granular.md.located.pieces import FLOAT_SPACING, value
from granular.md.located.records import ACTIVE, DORMANT, OPEN, RESIDUAL, SERIES_ORDER
from granular.md.located.rest.general_laws import write_resting_piece
from granular.md.located.step_size import stopping_overlap

MAX_PICARD_ITERATIONS = 40
SMALLEST_COLLOCATION_TOL = 2e-15
"""Smallest tolerance: interpolated forces contain rounding errors of this size."""
SHORTEST_CONVERGED_STEP, SHORTEST_TRIAL_STEP = 1e-14, 1e-60
"""Smallest factors by which a trial step is reduced by halving.

The first applies once a step converges, because a step that is still not accurate then crosses a jump of the force. The
second applies to any step."""
JUMP_SHARE = 1e-9
"""Fraction of a contact's time below which a step is tested for a force jump.

It is also the fraction of the largest force above which a change is a jump."""
TOUCH_OVERLAP = 1e-150
"""Overlap in m at which the law is evaluated for a touch.

A law need not be defined at 0, and can have a force there."""
ROUNDING_CLIPPED_FORCE = 1024.0 * FLOAT_SPACING
"""Fraction of a contact's largest force up to which a clipped force is rounding."""
NEARBY_OVERLAP = 1.0 - 1e-9
"""Fraction of an overlap at which a force is evaluated a second time.

If both forces are 0, the force is 0 on an interval, for example below a plastic overlap."""
MAX_FORCE_ERROR = 3e-14
"""Largest error of forces, relative to the largest force.

The error of the rates does not bound it: a kink in a short step hardly affects rates, but it affects peak forces."""
UNCERTAIN_FORCE_SHARE = 1e-13
"""Fraction of its maximum up to which an interpolated force has no certain sign.

The maximum is taken over the piece."""


class Collocation:
    """Force laws of a scene, and the pieces of islands computed from them.

    Kernels receive it as `laws` if a law of the scene is a general law.

    Parameters
    ----------
    laws : SceneLaws
        Force laws of all pairs.
    ring : bool
        Whether the scene is a ring.
    """

    def __init__(self, laws: SceneLaws, ring: bool) -> None:
        self.laws, self.ring = list(laws), ring
        self.closed = False  # whether the current island is a whole ring
        self.shaken: list[tuple[int, Any]] = []  # pairs at driven walls and their paths, of the current island
        self.square = 0.0  # Ω² of pendula
        self.trials = 0  # trial steps of all pieces

    def force(self, p: Any, xi: float, eta: float = 0.0) -> float:
        """Return the force in N of a pair on its current branch. It can be negative.

        `xi` is the overlap in m, `eta` its rate in m/s. The result is inf if the law overflows.
        """
        try:
            return branch_force(self.laws[p.number], xi, eta, p.xi_peak, p.loading)
        except OverflowError:  # the trial step is too long
            return math.inf

    @np.errstate(over="ignore", invalid="ignore")  # trial steps can be far too long
    def fill(
        self, records: list[Any], pool: list[Any], lo: int, tol: float, field: Any = None, holds: float = math.inf
    ) -> float:
        """Compute the next piece of the island that starts with pair `lo`.

        Its series covers τ in [0, 1], where t = (hτ)^q is the time in s from its start. The scale h, in s^(1/q), and
        the exponent q (1 or 2) are stored in the record of the first pair, as `h` and `clock`. The step is halved until
        its error is at most `tol`, or the step is the shortest allowed. Returns the truncation error, relative to the
        speed of the island. `records` are the pair records. The piece lasts at most `holds` in s, the time for which
        the series of the wall paths in `field` are valid. Raises `ValueError` if a force is not finite, or if nothing
        stops an overlap.
        """
        self.square = getattr(field, "square", 0.0)
        island = enumerate(records[lo : records[lo].hi])
        self.shaken = [(i, field.path[p.wall - 1]) for i, p in island if p.wall > 0]
        pairs = [pool[p.slot] for p in records[lo : records[lo].hi]]
        self.closed = self.ring and len(pairs) == len(self.laws)
        block = pairs[0]
        block.clock = 2 if any(p.mode == ACTIVE and p.xi == 0.0 and p.q > 1 for p in pairs) else 1
        # first trial: a fifth of the time of a contact
        reach = 0.2 * block.length / block.speed if block.speed > 0.0 else 1.0
        if block.last_step > 0.0 and block.clock == 1:
            reach = block.last_step
        allowed_error, shortest = max(tol, SMALLEST_COLLOCATION_TOL), SHORTEST_TRIAL_STEP * reach
        self._check_forces(pairs, [0.0])
        if not (self.shaken or self.square) and write_resting_piece(pairs, self.force, self.closed):
            return 0.0
        reach = min(reach, valid_series_time(self.shaken, holds, block.clock))
        while True:
            block.h = reach if block.clock == 1 else math.sqrt(reach)
            self.trials += 1
            force, rate_errors, force_error = self._iterate_forces(pairs)
            largest_error = float((rate_errors / own_speeds(pairs)).max())
            if (largest_error <= allowed_error and force_error <= MAX_FORCE_ERROR) or not reach > shortest:
                break
            if largest_error < math.inf:  # a step of this length converges, so only a jump requires a far shorter one
                shortest = max(shortest, SHORTEST_CONVERGED_STEP * reach)
            elif reach * block.speed < JUMP_SHARE * block.length:
                self._check_forces(pairs, ((block.h * GAUSS_NODES) ** block.clock).tolist())
            reach *= 0.5
        growth = (allowed_error / largest_error) ** (1.0 / GAUSS_POINTS) if largest_error > 0.0 else 2.0
        # 0.9: safety factor against an immediate rejection
        block.last_step = reach * min(2.0, 0.9 * growth)
        self._write_series(pairs, force, reach)
        return float(rate_errors.max()) / block.speed if block.speed > 0.0 else 0.0

    def next_event(self, p: Any, span: float, scratch: Any) -> tuple[float, int]:
        """Return the τ of the first event of an overlapping pair, and the event.

        The search covers [0, span], and τ is inf without an event.
        """
        is_repulsive = partial(self._is_repulsive, p, 1e-3 * (p.deepest or p.own_length))
        return next_event_of_law(p, is_repulsive, partial(self._is_force_zero, p), p.doubt, span, scratch)

    def dissipated(self, p: Any, block: Any, tau: float) -> float:
        """Return the energy in J that a pair dissipates from the start of its piece to τ.

        `block` is the record of its island. The result is nan for laws with memory.
        """
        law = self.laws[p.number]
        if p.mode == RESIDUAL:
            return self.lost(p, value(p.x, 0.0), value(p.x, tau))
        if law.memory or not law.rate_dependent:
            return math.nan if law.memory else 0.0
        total, q = 0.0, block.clock
        for node, weight in zip(GAUSS_NODES.tolist(), (0.5 * GAUSS_WEIGHTS).tolist(), strict=True):
            xi, eta = value(p.x, tau * node), value(p.e, tau * node)
            rate = (value(p.f, tau * node) - law.force(xi, 0.0, xi)) * eta if xi > 0.0 else 0.0
            total += weight * rate * q * math.pow(node, q - 1.0)
        return float(total * math.pow(block.h * tau, float(q)))

    def lost(self, p: Any, first: float, last: float) -> float:
        """Return the elastic energy in J that a residual pair loses between two overlaps.

        `first` and `last` are the overlaps in m. No force acts between the balls.
        """
        law = self.laws[p.number if hasattr(p, "number") else p.first]
        return float(law.energy(first) - law.energy(last))

    def is_clipped(self, p: Any) -> bool:
        """Return whether the law gives no repulsive force to an overlapping pair."""
        return not self.force(p, p.xi, p.eta) > 0.0

    def pushes_at_touch(self, p: Any) -> bool:
        """Return whether a pair that touches at a closing rate is repelled immediately."""
        depth = stopping_overlap(p, p.eta * p.eta)
        force = self.force(p, 1e-9 * depth, p.eta)
        # close to the touch a force can underflow to 0
        return force > 0.0 or (force == 0.0 and self.force(p, 1e-3 * depth, p.eta) > 0.0)

    def _is_repulsive(self, p: Any, shallow: float, tau: float, beyond_rounding: bool = False) -> bool:
        """Return whether the law gives a pair a repulsive force at τ of its piece.

        With `beyond_rounding`, the force must exceed the rounding errors at the end of a contact, unless the force is 0
        on an interval. For an active pair, a force of 0 also counts as repulsive at overlaps below `shallow` in m,
        where forces can underflow.
        """
        xi = value(p.x, tau)
        force = self.force(p, xi, value(p.e, tau))
        beyond_rounding = beyond_rounding and self.force(p, NEARBY_OVERLAP * p.x[0], p.e[0]) != 0.0
        floor = ROUNDING_CLIPPED_FORCE * p.largest if beyond_rounding else 0.0
        return force > floor or (p.mode == ACTIVE and force == 0.0 and xi < shallow)

    def _is_force_zero(self, p: Any, tau: float) -> bool:
        """Return whether the force of a pair is 0 at τ and at slightly different overlaps."""
        xi, eta = value(p.x, tau), value(p.e, tau)
        return all(self.force(p, xi * part, eta) == 0.0 for part in (NEARBY_OVERLAP, 1.0, 2.0 - NEARBY_OVERLAP))

    def _check_forces(self, pairs: list[Any], times: list[float]) -> None:
        """Raise `ValueError` if nothing stops an overlap, or if a force is not finite.

        Overlaps and rates are extrapolated by free flight to the `times` in s after the start of the piece.
        """
        for p, t in product(pairs, times):
            xi, eta = p.xi + (p.eta + 0.5 * p.pull * t) * t, p.eta + p.pull * t
            # products of larger overlaps overflow
            if xi > 1e150:
                raise ValueError(
                    f"The law of pair {self.laws[p.number].pair.name}, {self.laws[p.number].law!r}, must stop the "
                    "bodies, but they pass through each other and their overlap grows forever. Use another law, or "
                    "give `t_end`."
                )
            if p.mode in (ACTIVE, RESIDUAL) and (t > 0.0 or xi > 0.0):
                force = self.force(p, xi, eta)
                if not math.isfinite(force):
                    raise no_number(self.laws[p.number], xi, eta, force)

    def _iterate_forces(self, pairs: list[Any]) -> tuple[Array, Array, float]:
        """Iterate the forces at the Gauss points of a trial step.

        Returns the forces in N, shape (pairs, nodes), and two errors. The first is the error of the rate of each pair
        in m/s. The second is the largest error of the force of an active pair. It is relative to the larger of two
        forces: the scale of a contact at the pair's own speed, and the largest force at the nodes. All errors are inf
        if the iteration does not converge.
        """
        lower, own, upper, pull, xi0, eta0 = np.array(
            [(p.lower, p.inverse, p.upper, p.pull, p.xi, p.eta) for p in pairs]
        ).T[:, :, None]
        h, q = pairs[0].h, pairs[0].clock
        pace = q * h**q * GAUSS_NODES ** (q - 1)
        eta = eta0 + pull * (h * GAUSS_NODES) ** q
        xi = xi0 + (0.5 * (eta0 + eta)) * (h * GAUSS_NODES) ** q
        pull = pull + wall_accelerations(self.shaken, len(pairs), (h * GAUSS_NODES) ** q)
        force, last_change = np.zeros_like(eta), math.inf
        is_active = np.array([p.mode == ACTIVE for p in pairs])
        roundings = self._force_roundings(pairs, xi, eta)
        for _ in range(MAX_PICARD_ITERATIONS):
            new_force = self._forces(pairs, xi, eta)
            change, force = float(abs(new_force - force).max()), new_force
            # the Picard iteration diverges: the step is too long
            if not change < 1e300 or change > 1e3 * last_change:
                break
            outer = forces_with_neighbours(np.where(is_active[:, None], force, 0.0), self.closed)
            push = pull + lower * outer[:-2] - own * outer[1:-1] + upper * outer[2:] - self.square * xi
            eta = eta0 + (push * pace) @ INTEGRATE_TO_NODES.T
            xi = xi0 + (eta * pace) @ INTEGRATE_TO_NODES.T
            largest = float(abs(force).max())
            is_converged = change <= max(4e-16 * largest, float(roundings.max()))
            # converged, or changes no longer decrease because of rounding
            if is_converged or (change < 1e-13 * largest and change >= last_change):
                check_states = (
                    xi0 + (eta * pace) @ INTEGRATE_TO_CHECK_POINTS.T,
                    eta0 + (push * pace) @ INTEGRATE_TO_CHECK_POINTS.T,
                )
                noise = np.maximum(
                    4.0 * roundings, np.where(is_active, 0.0, UNCERTAIN_FORCE_SHARE * abs(force).max(axis=1))
                )
                mean_errors, relative_error = force_errors(
                    pairs, force, abs(force @ TO_CHECK_POINTS.T - self._forces(pairs, *check_states)), noise
                )
                return force, mean_errors * own[:, 0] * h**q, relative_error
            last_change = change
        return force, np.full(len(pairs), math.inf), math.inf

    def _force_roundings(self, pairs: list[Any], xi: Array, eta: Array) -> Array:
        """Return the change in N of each pair's force under one rounding of its overlap.

        It is the largest change at the nodes. Changes comparable to the rounding error of the force itself are returned
        as 0.
        """
        force = self._forces(pairs, xi, eta)
        changes = abs(self._forces(pairs, xi * (1.0 + FLOAT_SPACING), eta) - force).max(axis=1)
        # 16 roundings: only a law that amplifies rounding errors of ξ needs this allowance
        amplified: Array = np.where(changes > 16.0 * FLOAT_SPACING * abs(force).max(axis=1), changes, 0.0)
        return amplified

    def _forces(self, pairs: list[Any], xi: Array, eta: Array) -> Array:
        """Return the forces in N of all pairs that overlap, shape (pairs, nodes).

        `xi` and `eta` are overlaps and rates at the nodes. Forces of residual pairs are included, although they do not
        act.
        """
        force = np.zeros_like(xi)
        for i, p in enumerate(pairs):
            if p.mode != OPEN and p.mode != DORMANT:
                force[i] = self._pair_forces(p, xi[i].tolist(), eta[i].tolist())
        return force

    def _pair_forces(self, p: Any, xi: list[float], eta: list[float]) -> list[float]:
        """Return the forces in N of a pair at a list of overlaps and their rates.

        The law is called directly if it has no memory and no overlap is negative.
        """
        law, at = self.laws[p.number], list(zip(xi, eta, strict=True))
        if not law.memory and min(xi) >= 0.0:
            force, pair = law.law.force, law.pair
            with suppress(OverflowError):
                return [float(force(x, e, pair)) for x, e in at]
        return [self.force(p, x, e) for x, e in at]

    def _write_series(self, pairs: list[Any], force: Array, reach: float) -> None:
        """Write the coefficients of forces, rates and overlaps of a step.

        The forces at the nodes are interpolated. The interpolant of a clipped force is written to `g` only. Rates and
        overlaps follow by integration. `reach` is the length of the step in s. In a very short step, a force that jumps
        is replaced by a straight line, which cannot overshoot.
        """
        last_terms, peaks = abs(force @ TO_LEGENDRE[-2:].T).max(axis=1), abs(force).max(axis=1)
        doubts = np.maximum(UNCERTAIN_FORCE_SHARE * peaks, 8.0 * last_terms)
        rows = np.pad((force @ TO_LEGENDRE.T) @ TO_POWERS, ((0, 0), (0, SERIES_ORDER + 1 - GAUSS_POINTS)))
        for p, row, doubt, peak in zip(pairs, rows.tolist(), doubts.tolist(), peaks.tolist(), strict=True):
            p.largest = 0.0 if p.mode == OPEN else max(p.largest, peak)
            p.deepest = 0.0 if p.mode == OPEN else max(p.deepest, p.xi)
            p.doubt = max(doubt, ROUNDING_CLIPPED_FORCE * p.largest) if p.mode == RESIDUAL else doubt
            p.f, p.g = row if p.mode == ACTIVE else [0.0] * (SERIES_ORDER + 1), row.copy()
        integrate_forces(pairs, self.shaken, self.square, self.closed)
        has_jump = [
            self._replace_jump(p)
            for p in pairs
            if p.mode == ACTIVE and reach * p.own_speed < JUMP_SHARE * p.own_length
        ]
        if any(has_jump):
            integrate_forces(pairs, self.shaken, self.square, self.closed)

    def _replace_jump(self, p: Any) -> bool:
        """Return whether the force of a pair jumps within a very short step.

        In this case, its coefficients are replaced by a straight line.
        """
        first, last = self.force(p, p.xi, p.eta), self.force(p, value(p.x, 1.0), value(p.e, 1.0))
        has_jump = bool(max(abs(p.f[0] - first), abs(value(p.f, 1.0) - last)) > JUMP_SHARE * p.largest)
        if has_jump:
            p.f = [first, last - first] + [0.0] * (SERIES_ORDER - 1)
            p.g = p.f.copy()
        return has_jump


def branch_force(law: PairLaw, xi: float, eta: float, largest: float, loading: int) -> float:
    """Return the force in N of a law on its current branch. It can be negative.

    `xi` is the overlap in m, `eta` its rate in m/s, and `largest` the largest overlap so far. `loading` is 1 on the
    loading branch. Outside the overlaps to which the branch applies (below 0, or on the other side of `largest`), it is
    continued as a mirror image. These values are used for interpolation only. They preserve value and slope, so that
    the law's own branches end at events.
    """
    unloading = law.memory and not loading

    def branch(xi: float, eta: float) -> float:
        """Return the force of the law on its branch at an overlap within the branch."""
        return law.force(xi, eta, largest if unloading else max(largest, xi))

    # continue the loading branch above the old maximum downwards
    if law.memory and loading and largest > 0.0 and xi < largest:
        mirror, image = largest, 2.0 * largest - xi
    elif xi < 0.0:
        mirror, image = TOUCH_OVERLAP, min(-xi, largest) if unloading else -xi
    elif unloading and xi > largest:
        mirror, image = largest, max(0.0, 2.0 * largest - xi)
    else:
        return branch(xi, eta)
    return branch(mirror, eta) + branch(mirror, -eta) - branch(image, -eta)

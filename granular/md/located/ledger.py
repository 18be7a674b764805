"""Energy balance of a run: work of the walls and dissipation in contacts.

For a piece with force F, overlap ξ and rate η, elastic force F_el(ξ) = dU/dξ and velocity u of a wall towards the
balls,

    work = ∫ F u dt ,   dissipated = ∫ (F - F_el) η dt = ∫ γ ξ^d η² dt .

Where the force is clipped, the elastic energy U(ξ) is dissipated, because it is included in the balance wherever ξ > 0.
Both integrands are products of polynomials, integrated by Gauss's rule to rounding error. A contact solved as one event
dissipates ½ m (v² - v2²), where v and v2 are the speeds before and after it. A wall of constant velocity u then does
the work J u, where J is the impulse. Each sum is stored as two floats. If no wall moves or is thermal, `WORKED` is
false and nothing of this module is compiled, except `work_of_force` for the energies of single contacts (`METERED`).
"""

from __future__ import annotations

from typing import Any

from numpy.polynomial import legendre

from granular._engine.kernels import DRIVEN, kernel
from granular.md.located.pieces import elapsed_time, integral, power, two_sum, value
from granular.md.located.records import ACTIVE, ELASTIC, RESIDUAL
from granular.md.located.walls import expand_path

ENERGY_NODE_COUNT = 8
"""Number of nodes of Gauss's rule in a piece.

For terms from order 16 onwards, the rule has a relative error of 1e-9. The step size makes terms of order 20 as small
as rounding errors, so that this error is smaller still."""
ENERGY_NODES, ENERGY_WEIGHTS = (
    tuple((0.5 * (row + shift)).tolist())
    for row, shift in zip(legendre.leggauss(ENERGY_NODE_COUNT), (1.0, 0.0), strict=True)
)
"""Nodes and weights of Gauss's rule on [0, 1]."""
FLOOR, CEILING, DISSIPATED = 0, 1, 4
"""Indices of the work of floor and ceiling and of the dissipation in the balance.

Indices 2 and 3 are the heat from thermal walls (`jumps`)."""


@kernel
def add_pair_energy(s: Any, laws: Any, c: int, block: Any, tau: float, sums: Any) -> None:
    """Add work and dissipation of pair `c` in J to `sums`, from the piece start to τ.

    `block` is the record of its island.
    """
    member, last = s.pool[s.pairs[c].slot], len(s.pairs)
    if member.mode == ACTIVE or member.mode == RESIDUAL:
        sums[DISSIPATED] += dissipated_energy(member, block, tau, laws)
        if c == 0 and s.bodies[0].inverse_mass == 0.0:
            sums[FLOOR] += wall_work(s.field, member, block, s.bodies[0].v, tau)
        if c + 1 == last and s.bodies[last].inverse_mass == 0.0:
            sums[CEILING] += wall_work(s.field, member, block, -s.bodies[last].v, tau)


@kernel
def add_island_energy(s: Any, laws: Any, lo: int, tau: float, sums: Any) -> None:
    """Add work and dissipation of an island in J to `sums`, from the piece start to τ.

    `lo` is the first pair of the island.
    """
    for c in range(lo, s.pairs[lo].hi):
        add_pair_energy(s, laws, c, s.pool[s.pairs[lo].slot], tau, sums)


@kernel
def account_for_piece(s: Any, laws: Any, lo: int, tau: float) -> None:
    """Add work and dissipation of an island to the balance, from the piece start to τ.

    `lo` is the first pair of the island.
    """
    clear_sums(s.ledger[0].piece)
    add_island_energy(s, laws, lo, tau, s.ledger[0].piece)
    add_sums_to_account(s.ledger[0], s.ledger[0].piece)


@kernel
def clear_sums(sums: Any) -> None:
    """Set all entries of `sums` to zero."""
    for i in range(len(sums)):
        sums[i] = 0.0


@kernel
def add_sums_to_account(ledger: Any, sums: Any) -> None:
    """Add `sums` in J to the energy balance."""
    for i in range(len(sums)):
        add_to_account(ledger, i, sums[i])


@kernel
def account_for_isolated_contact(ledger: Any, s: Any, c: int, sign: float) -> None:
    """Add work and dissipation of a contact solved as one event to the balance.

    `c` is its pair. `sign` is 1, or -1 to subtract the contact again.
    """
    for i in (FLOOR, CEILING, DISSIPATED):
        add_to_account(ledger[0], i, sign * isolated_contact_energy(ledger, s, c, i))


@kernel
def replace_whole_contact(ledger: Any, s: Any, c: int, sums: Any) -> None:
    """Replace in `sums` the whole contact of pair `c` by its part up to now.

    The contact was solved as one event, so that the balance contains it as a whole. Its part up to now was then
    integrated by pieces and is in `solo`.
    """
    for i in (FLOOR, CEILING, DISSIPATED):
        sums[i] += ledger[0].solo[i] - isolated_contact_energy(ledger, s, c, i)


@kernel
def isolated_contact_energy(ledger: Any, s: Any, c: int, i: int) -> float:
    """Return entry `i` of the balance in J for a contact solved as one event.

    The entry is computed from the speed, the duration and the asymptote of pair `c`. At a driven wall it is read from
    the record that `store_contact_energy` wrote.
    """
    pair, lower, upper = s.pairs[c], s.bodies[c], s.bodies[c + 1]
    at_floor = lower.inverse_mass == 0.0
    if pair.wall > 0:
        kept_sums = ledger[0].lost if i == DISSIPATED else ledger[0].work
        return float(kept_sums[0 if at_floor else 1] if i == DISSIPATED or at_floor == (i == FLOOR) else 0.0)
    inverse, v, v2 = lower.inverse_mass + upper.inverse_mass, pair.speed, -pair.eta
    if i == DISSIPATED:
        # a product, because the difference of the squares would lose digits
        return float(0.5 * (v - v2) * (v + v2) / inverse)
    if i == FLOOR and at_floor:
        return float((v + pair.pull * pair.lasts + v2) / inverse * lower.v)
    if i == CEILING and upper.inverse_mass == 0.0:
        return float((v + pair.pull * pair.lasts + v2) / inverse * -upper.v)
    return 0.0


@kernel
def store_contact_energy(ledger: Any, s: Any, c: int) -> None:
    """Store work and dissipation of the contact of pair `c` at a driven wall.

    The contact has just been integrated alone. At other walls nothing is stored.
    """
    if s.pairs[c].wall > 0:
        side, account = (0 if s.bodies[c].inverse_mass == 0.0 else 1), ledger[0]
        account.work[side], account.lost[side] = account.solo[side], account.solo[DISSIPATED]


@kernel
def read_energy_account(ledger: Any, sums: Any) -> None:
    """Copy the energy balance in J to `sums`."""
    for i in range(len(ledger[0].total)):
        sums[i] = ledger[0].total[i] + ledger[0].low[i]


@kernel
def residual_loss(law: Any, laws: Any, pair: Any, first: float, last: float) -> float:
    """Return the elastic energy in J that a residual pair loses between two overlaps.

    It is dissipated. `first` and `last` are the overlaps in m. The result is 0 for pairs in other modes.
    """
    if pair.mode != RESIDUAL:
        return 0.0
    if laws is not None:
        return laws.lost(pair, first, last)  # type: ignore[no-any-return]
    return elastic_energy(law, first) - elastic_energy(law, last)


@kernel
def add_to_account(ledger: Any, i: int, x: float) -> None:
    """Add `x` in J to entry `i` of the energy balance, with the rounding error kept."""
    ledger.total[i], rest = two_sum(ledger.total[i], x)
    ledger.low[i] += rest


@kernel
def elastic_energy(law: Any, xi: float) -> float:
    """Return the elastic energy k ξ^(p+1)/(p+1) of a power law in J, 0 for ξ ≤ 0."""
    return float(law.k * xi * power(xi, law.p) / (law.p + 1.0)) if xi > 0.0 else 0.0


@kernel
def dissipated_energy(member: Any, block: Any, tau: float, laws: Any) -> float:
    """Return the energy in J that a pair dissipates from the start of its piece to τ.

    `block` is the record of its island.
    """
    if laws is not None:
        return laws.dissipated(member, block, tau)  # type: ignore[no-any-return]
    if member.mode == RESIDUAL:
        return elastic_energy(member, member.x[0]) - elastic_energy(member, value(member.x, tau))
    if member.kind == ELASTIC or member.gamma == 0.0:
        return 0.0
    total, scale = 0.0, clock_rate(block, tau)
    for i in range(ENERGY_NODE_COUNT):
        at = tau * ENERGY_NODES[i]
        eta = value(member.e, at)
        rate = member.gamma * eta * eta
        if member.d != 0.0:
            # the polynomial of ξ can be negative by rounding near a touch
            rate *= power(max(0.0, value(member.x, at)), member.d)
        # elapsed(x, q, 1)/x is x^(q-1): the factor from dt/dx at the node
        total += ENERGY_WEIGHTS[i] * rate * elapsed_time(ENERGY_NODES[i], block.clock, 1.0) / ENERGY_NODES[i]
    return scale * total


@kernel
def work_of_force(member: Any, block: Any, tau: float) -> float:
    """Return ∫ F ξ̇ dt in J of an active pair from the start of its piece to τ.

    It is the energy that the contact takes from the motion, for any law. `block` is the record of its island.
    """
    total = 0.0
    for i in range(ENERGY_NODE_COUNT):
        total += (
            ENERGY_WEIGHTS[i]
            * value(member.f, tau * ENERGY_NODES[i])
            * value(member.e, tau * ENERGY_NODES[i])
            * elapsed_time(ENERGY_NODES[i], block.clock, 1.0)
            / ENERGY_NODES[i]
        )
    return clock_rate(block, tau) * total


@kernel
def clock_rate(block: Any, tau: float) -> float:
    """Return dt/dx in s at x = 1 of the time t = (hτx)^q, with x from 0 to 1.

    At other x, dt/dx is larger by the factor x^(q-1).
    """
    return block.clock * elapsed_time(block.h * tau, block.clock, 1.0)  # type: ignore[no-any-return]


@kernel
def wall_work(walls: Any, member: Any, block: Any, speed: float, tau: float) -> float:
    """Return the work in J of a wall on its pair from the start of the piece to τ.

    `speed` is the velocity in m/s, towards the balls, of a wall that is not driven.
    """
    if member.mode != ACTIVE:
        return 0.0
    if DRIVEN and member.wall > 0:
        return driven_wall_work(walls, member, block, tau)
    return float(elapsed_time(block.h, block.clock, 1.0) * integral(member.f, block.clock, tau) * speed)


@kernel
def driven_wall_work(walls: Any, member: Any, block: Any, tau: float) -> float:
    """Return the work in J of a driven wall on its pair from the piece start to τ."""
    expand_path(walls, member.wall - 1, block)
    wall, path = walls.wall[member.wall - 1], walls.path[member.wall - 1]
    total, scale = 0.0, clock_rate(block, tau)
    for i in range(ENERGY_NODE_COUNT):
        at, v = elapsed_time(block.h * tau * ENERGY_NODES[i], block.clock, 1.0), 0.0
        # the derivative of the path by Horner's scheme; the constant part of the velocity is added after it
        for j in range(len(path) - 1, 0, -1):
            v = v * at + j * path[j]
        v += wall.side * wall.velocity
        total += (
            ENERGY_WEIGHTS[i]
            * value(member.f, tau * ENERGY_NODES[i])
            * v
            * elapsed_time(ENERGY_NODES[i], block.clock, 1.0)
            / ENERGY_NODES[i]
        )
    return scale * total


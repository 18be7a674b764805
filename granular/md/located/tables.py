"""Isolated contacts of any law, from a table: made for one octave of impact speeds when it has been met often enough.
May be skipped: faster, same results to rounding.

For one law, effective mass and pull the whole contact hangs on the speed v alone. Contacts at Chebyshev points of the
octave are solved by pieces; their times, and their speeds and peaks divided by v, are smooth where the law is. Two more
contacts between the points say whether the polynomials hold, and two at the ends, beyond the last points, where a law
may bend unseen; if not, such contacts go on being solved by pieces.
"""

from __future__ import annotations

import math
from typing import Any

from granular._flight import rate_at_contact
from granular._kernels import inlined, kernel
from granular.md.located.alone import enter, live
from granular.md.located.plan import leave
from granular.md.located.system import CHECKS, OCTAVES, OPEN, POINTS, QUANTITIES, SLOWEST

WARM = 32
"""Contacts of an octave after which its table is made: it costs about as many."""
HOLDS = 1e-14
"""Error up to which a table holds, as a part of each number, beyond the tolerance of the pieces."""
REFUSED, WANTED = -1, -2


@kernel
def table_of(s: Any, c: int, v: float) -> int:
    """Return the place of the table for a contact of pair `c` at speed `v`; or REFUSED, WANTED."""
    known, octave = s.maps[s.pairs[c].map], math.frexp(v)[1]
    i = octave - SLOWEST
    if not 0 <= i < OCTAVES:
        return REFUSED
    if known.table[i] != 0:
        return int(known.table[i]) - 1 if known.table[i] > 0 else REFUSED
    if known.met[i] + 1 < WARM:
        known.met[i] += 1
        return REFUSED
    return WANTED


@kernel
def make_table(s: Any, laws: Any) -> None:
    """Make the table that is wanted, for which there is room; the run goes on as if nothing had been."""
    run, c = s.run[0], s.run[0].wanted
    pair = s.pairs[c]
    octave = math.frexp(-rate_at_contact(max(0.0, -pair.xi), -pair.eta, pair.pull))[1]
    place = run.tables
    run.tables += 1
    s.maps[pair.map].table[octave - SLOWEST] = place + 1 if fill(s, s.tables[place], c, octave, laws) else -1


@kernel
def answer(s: Any, laws: Any) -> None:
    """Follow the contact that is asked for, alone."""
    run, pair = s.run[0], s.pairs[s.run[0].wanted]
    v = -rate_at_contact(max(0.0, -pair.xi), -pair.eta, pair.pull)
    t1, t2, v1, v2, xi, force = solved_alone(s, run.wanted, v, laws)
    run.answered = 1
    for i, number in enumerate((t1, t2, v1, v2, xi, force)):
        s.answer[i] = number


@inlined
@kernel
def fill(s: Any, table: Any, c: int, octave: int, laws: Any) -> bool:
    """Make the table of an octave from contacts of pair `c` alone; false if it does not hold."""
    run, worst = s.run[0], 0.0
    steps, error, holds = run.steps, run.error, True
    for j in range(POINTS + CHECKS):
        run.error = 0.0
        holds = holds and watch(s, table, c, math.ldexp(0.75 + 0.25 * place_of(j), octave), j, laws)
        worst = max(worst, run.error)
    run.steps, run.error = steps, error
    table.error = worst
    if not holds:
        return False
    for q in range(QUANTITIES):
        expand(table, q)
        for j in range(POINTS, POINTS + CHECKS):
            seen = table.seen[q * (POINTS + CHECKS) + j]
            if not abs(polynomial(table, q, place_of(j)) - seen) <= max(HOLDS, 4.0 * worst) * abs(seen):
                return False
    return True


@kernel
def place_of(j: int) -> float:
    """Return the j-th point of an octave, from -1 to 1: the zeros of a Chebyshev polynomial, then those to check at."""
    if j < POINTS:
        return math.cos(math.pi * (j + 0.5) / POINTS)
    i = j - POINTS
    return 2.0 * i - 1.0 if i < 2 else 0.47 - 1.1 * (i - 2)


@inlined
@kernel
def watch(s: Any, table: Any, c: int, v: float, j: int, laws: Any) -> bool:
    """Note the contact of pair `c` alone at speed `v`; false if it does not come to an end."""
    t1, t2, v1, v2, xi, force = solved_alone(s, c, v, laws)
    seen, at = table.seen, POINTS + CHECKS
    seen[j], seen[at + j], seen[2 * at + j], seen[3 * at + j] = t1, t2, v1 / v, v2 / v
    seen[4 * at + j], seen[5 * at + j] = xi / v, force / v
    return bool(t1 > 0.0)


@inlined
@kernel
def solved_alone(s: Any, c: int, v: float, laws: Any) -> tuple[float, float, float, float, float, float]:
    """Return (t1, t2, v1, v2) of the contact of pair `c` alone at speed `v`, and its peaks; nan if it has no end."""
    member, log, due = enter(s, c, v), s.run[0].log, s.pairs[c].due
    t1 = t2 = v1 = math.nan
    if laws is None or laws.pushes_at_touch(member):
        s.run[0].log = 2
        t1, _, t2, v1 = live(s, c, math.inf, laws)
        s.run[0].log = log
    if not (member.mode == OPEN and member.eta < 0.0):
        t1 = math.nan
    v2, xi, force = -member.eta, member.xi_max, member.force_max
    leave(s.run[0], s.pairs, s.pool, c)
    s.pairs[c].due = due
    return t1, t2, v1, v2, xi, force


@kernel
def expand(table: Any, q: int) -> None:
    """Write the Chebyshev coefficients of one quantity."""
    for k in range(POINTS):
        total = 0.0
        for j in range(POINTS):
            total += table.seen[q * (POINTS + CHECKS) + j] * math.cos(math.pi * k * (j + 0.5) / POINTS)
        table.c[q * POINTS + k] = (2.0 if k > 0 else 1.0) * total / POINTS


@kernel
def polynomial(table: Any, q: int, z: float) -> float:
    """Return one quantity at z, from -1 to 1, by Clenshaw's sums."""
    last, twice, base = 0.0, 0.0, q * POINTS
    for k in range(POINTS - 1, 0, -1):
        last, twice = table.c[base + k] + 2.0 * z * last - twice, last
    value: float = table.c[base] + z * last - twice
    return value


@kernel
def tabled(table: Any, elastic: int, v: float) -> tuple[float, float, float, float]:
    """Return (t1, t2, v1, v2) of a contact at speed `v`, as `maps.encounter` does."""
    z = 4.0 * math.frexp(v)[0] - 3.0
    t1, t2 = polynomial(table, 0, z), polynomial(table, 1, z)
    if elastic:
        return t1, t1, v, v
    return t1, max(t1, t2), polynomial(table, 2, z) * v, polynomial(table, 3, z) * v


@kernel
def tabled_peaks(table: Any, v: float) -> tuple[float, float]:
    """Return the largest overlap and the largest force of a contact at speed `v`."""
    z = 4.0 * math.frexp(v)[0] - 3.0
    return polynomial(table, 4, z) * v, polynomial(table, 5, z) * v

"""Isolated contacts of any law, from a table: made for one octave of impact speeds when it has been met often enough.

For one law, effective mass and pull the whole contact hangs on the speed v alone. Contacts at Chebyshev points of the
octave are solved by pieces; their times, and their speeds and peaks divided by v, are smooth where the law is. Two more
contacts between the points say whether the polynomials hold, and two at the ends, beyond the last points, where a law
may bend unseen; if not, such contacts go on being solved by pieces.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.one_contact.inside import ask_to_follow, take_up
from granular.md.located.pieces import tick
from granular.md.located.records import CHECKS, OCTAVES, OPEN, PEAKS, POINTS, QUANTITIES, SLOWEST
from granular.md.located.system import leave
from granular.md.located.walls import touching_rate

WARM = 32
"""Contacts of an octave after which its table is made: it costs about as many."""
HOLDS = 1e-14
"""Error up to which a table holds, as a part of each number, beyond the tolerance of the pieces."""
TIMES = 2
"""So many of the numbers kept are times; the others are kept in units of the speed."""
REFUSED, WANTED = -1, -2
ITSELF = -1
"""In place of the number of a point: at its own speed."""


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
def ask(s: Any, j: int, laws: Any) -> None:
    """Ask that the contact that is wanted be followed alone, at point j of the octave of its speed, or at ITSELF."""
    run, c = s.run[0], s.run[0].wanted
    pair = s.pairs[c]
    v = touching_rate(s.field, pair, pair.wait)
    if j != ITSELF:
        v = math.ldexp(0.75 + 0.25 * place_of(j), math.frexp(v)[1])
    run.before_due, run.before_steps, run.before_error, run.before_log = pair.due, run.steps, run.error, run.log_level
    run.speed, run.log_level, run.error = v, PEAKS, 0.0
    member = take_up(s, c, v)
    tick(member, pair.wait)
    ask_to_follow(s, c, math.inf if laws is None or laws.pushes_at_touch(member) else 0.0)


@kernel
def note(s: Any, j: int) -> bool:
    """Note the contact that has been followed alone; false if it did not come to an end. ITSELF is the answer."""
    run, v = s.run[0], s.run[0].speed
    member = s.pool[s.pairs[run.wanted].slot]
    ends = member.mode == OPEN and member.eta < 0.0
    numbers = run.over if ends else math.nan, run.passed, run.parting, -member.eta, member.xi_max, member.force_max
    error: float = run.error
    put_back(s)
    if j == ITSELF:
        for q in range(QUANTITIES):
            s.answer[q] = numbers[q]
        run.answered = 1
        return True
    table, at = s.tables[run.tables], POINTS + CHECKS
    table.error = max(error, table.error) if j > 0 else error
    for q in range(QUANTITIES):
        table.seen[q * at + j] = numbers[q] / (1.0 if q < TIMES else v)
    table.noted = j + 1 if ends else 0
    return bool(run.over > 0.0 and ends)


@kernel
def put_back(s: Any) -> None:
    """Let the run be as it was before a contact was followed alone."""
    run, pair = s.run[0], s.pairs[s.run[0].wanted]
    leave(run, s.pairs, s.pool, run.wanted)
    pair.due, run.steps, run.error, run.log_level = run.before_due, run.before_steps, run.before_error, run.before_log


@kernel
def fit(s: Any) -> None:
    """Make the table of an octave from the contacts noted for it; refuse the octave if it does not hold."""
    run, known = s.run[0], s.maps[s.pairs[s.run[0].wanted].map]
    i = math.frexp(run.speed)[1] - SLOWEST
    if holds(s.tables[run.tables]):
        run.tables += 1
        known.table[i] = run.tables
    else:
        known.table[i] = -1


@kernel
def holds(table: Any) -> bool:
    """Write the coefficients of a table; return whether it says what was seen between its points, and at the ends."""
    if table.noted < POINTS + CHECKS:
        return False
    for q in range(QUANTITIES):
        expand(table, q)
        for j in range(POINTS, POINTS + CHECKS):
            seen = table.seen[q * (POINTS + CHECKS) + j]
            if not abs(polynomial(table, q, place_of(j)) - seen) <= max(HOLDS, 4.0 * table.error) * abs(seen):
                return False
    return True


@kernel
def place_of(j: int) -> float:
    """Return the j-th point of an octave, from -1 to 1: the zeros of a Chebyshev polynomial, then those to check at."""
    if j < POINTS:
        return math.cos(math.pi * (j + 0.5) / POINTS)
    i = j - POINTS
    return 2.0 * i - 1.0 if i < 2 else 0.47 - 1.1 * (i - 2)


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


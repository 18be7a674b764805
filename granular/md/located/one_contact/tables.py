"""Contact maps of any law, from one table per octave of approach speeds.

For a given law, effective mass and acceleration by gravity, the whole contact depends on the approach speed v alone.
The table of an octave is computed after `CONTACTS_BEFORE_TABLE` contacts in it. Contacts at the Chebyshev points of the
octave are integrated by pieces. Their times, and their speeds, largest overlaps and forces divided by v, are smooth
functions of v if the law is smooth. They are interpolated by polynomials.

Four more contacts test the polynomials: two between the points, and two at the ends of the octave, where a kink of the
law could remain hidden. If a test fails, contacts in this octave are always integrated by pieces.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.one_contact.inside import occupy_record, request_integration
from granular.md.located.pieces import advance_clock
from granular.md.located.records import (
    CHECKS_PER_OCTAVE,
    CONTACT_QUANTITIES,
    MIN_SPEED_EXPONENT,
    OPEN,
    PEAKS,
    POINTS_PER_OCTAVE,
    SPEED_OCTAVES,
)
from granular.md.located.system import leave_pool
from granular.md.located.walls import touching_rate

CONTACTS_BEFORE_TABLE = 32
"""Number of contacts in an octave before its table is computed.

The computation of a table costs about as much as this number of contacts.
"""
TABLE_TOL = 1e-14
"""Largest relative error of a table if its contacts are integrated exactly."""
TIME_QUANTITIES = 2
"""Number of stored quantities that are times.

The other quantities are stored in units of the speed."""
TABLE_REFUSED, TABLE_WANTED = -1, -2
"""Results of `table_of` without a table: integrate the contact, or request one."""
OWN_SPEED = -1
"""Value of `j` that stands for the actual speed of the contact, not for a point."""


@kernel
def table_of(s: Any, c: int, v: float) -> int:
    """Return the index of the table for a contact of pair `c` at approach speed `v`.

    Without a table the result is `TABLE_REFUSED` or `TABLE_WANTED`. A contact without a table is counted.
    """
    known, octave = s.maps[s.pairs[c].map], math.frexp(v)[1]
    i = octave - MIN_SPEED_EXPONENT
    if not 0 <= i < SPEED_OCTAVES:
        return TABLE_REFUSED
    if known.table[i] != 0:
        return int(known.table[i]) - 1 if known.table[i] > 0 else TABLE_REFUSED
    if known.met[i] + 1 < CONTACTS_BEFORE_TABLE:
        known.met[i] += 1
        return TABLE_REFUSED
    return TABLE_WANTED


@kernel
def request_contact(s: Any, j: int, laws: Any) -> None:
    """Start to integrate a contact of the pair `wanted` of the run alone, for its map.

    The approach speed is point `j` of the octave, or the actual speed of the contact for `OWN_SPEED`. The state of the
    run is saved, see `restore_run_state`.
    """
    run, c = s.run[0], s.run[0].wanted
    pair = s.pairs[c]
    v = touching_rate(s.field, pair, pair.wait)
    if j != OWN_SPEED:
        # the mantissa of an octave is in [0.5, 1)
        v = math.ldexp(0.75 + 0.25 * octave_point(j), math.frexp(v)[1])
    run.before_due, run.before_steps, run.before_error, run.before_log = pair.due, run.steps, run.error, run.log_level
    # a table contains peaks, also in a run that logs energies
    run.speed, run.log_level, run.error = v, PEAKS if j != OWN_SPEED else max(PEAKS, run.log_level), 0.0
    member = occupy_record(s, c, v)
    advance_clock(member, pair.wait)
    request_integration(s, c, math.inf if laws is None or laws.pushes_at_touch(member) else 0.0)


@kernel
def store_contact(s: Any, j: int) -> bool:
    """Store the map of the contact that was integrated alone, and restore the run.

    The map of point `j` of an octave is stored in the table. For `OWN_SPEED` it is stored in `answer`. Returns False if
    force or overlap of the contact at a point did not end.
    """
    run, v = s.run[0], s.run[0].speed
    member = s.pool[s.pairs[run.wanted].slot]
    ends = member.mode == OPEN and member.eta < 0.0
    numbers = run.over if ends else math.nan, run.passed, run.parting, -member.eta, member.xi_max, member.force_max
    error: float = run.error
    restore_run_state(s)
    if j == OWN_SPEED:
        for q in range(CONTACT_QUANTITIES):
            s.answer[q] = numbers[q]
        run.answered = 1
        return True
    table, at = s.tables[run.tables], POINTS_PER_OCTAVE + CHECKS_PER_OCTAVE
    table.error = max(error, table.error) if j > 0 else error
    for q in range(CONTACT_QUANTITIES):
        table.seen[q * at + j] = numbers[q] / (1.0 if q < TIME_QUANTITIES else v)
    table.noted = j + 1 if ends else 0
    return bool(run.over > 0.0 and ends)


@kernel
def restore_run_state(s: Any) -> None:
    """Restore the run to its state before a contact was integrated alone."""
    run, pair = s.run[0], s.pairs[s.run[0].wanted]
    leave_pool(run, s.pairs, s.pool, run.wanted)
    pair.due, run.steps, run.error, run.log_level = run.before_due, run.before_steps, run.before_error, run.before_log


@kernel
def fit_table(s: Any) -> None:
    """Fit the table of an octave of approach speeds to the contacts integrated for it.

    An octave is a factor of 2. If the table fails its tests, the octave is marked as refused.
    """
    run, known = s.run[0], s.maps[s.pairs[s.run[0].wanted].map]
    i = math.frexp(run.speed)[1] - MIN_SPEED_EXPONENT
    if passes_tests(s.tables[run.tables]):
        run.tables += 1
        # index + 1, because 0 stands for an octave without a table
        known.table[i] = run.tables
    else:
        known.table[i] = -1


@kernel
def passes_tests(table: Any) -> bool:
    """Compute the coefficients of a table, and return whether it passes its tests.

    The polynomials are compared with the contacts at the test points, see `octave_point`.
    """
    if table.noted < POINTS_PER_OCTAVE + CHECKS_PER_OCTAVE:
        return False
    for q in range(CONTACT_QUANTITIES):
        set_chebyshev_coefficients(table, q)
        for j in range(POINTS_PER_OCTAVE, POINTS_PER_OCTAVE + CHECKS_PER_OCTAVE):
            seen = table.seen[q * (POINTS_PER_OCTAVE + CHECKS_PER_OCTAVE) + j]
            # the difference of a table and a contact contains the errors of both
            if not abs(table_value(table, q, octave_point(j)) - seen) <= max(TABLE_TOL, 4.0 * table.error) * abs(seen):
                return False
    return True


@kernel
def octave_point(j: int) -> float:
    """Return point `j` of an octave, as a coordinate from -1 to 1.

    The first `POINTS_PER_OCTAVE` points are zeros of a Chebyshev polynomial. The test points follow.
    """
    if j < POINTS_PER_OCTAVE:
        return math.cos(math.pi * (j + 0.5) / POINTS_PER_OCTAVE)
    i = j - POINTS_PER_OCTAVE
    # both ends, then 0.47 and -0.63, which lie between Chebyshev points
    return 2.0 * i - 1.0 if i < 2 else 0.47 - 1.1 * (i - 2)


@kernel
def set_chebyshev_coefficients(table: Any, q: int) -> None:
    """Compute the Chebyshev coefficients of quantity `q` of a table from its contacts."""
    for k in range(POINTS_PER_OCTAVE):
        total = 0.0
        for j in range(POINTS_PER_OCTAVE):
            total += table.seen[q * (POINTS_PER_OCTAVE + CHECKS_PER_OCTAVE) + j] * math.cos(
                math.pi * k * (j + 0.5) / POINTS_PER_OCTAVE
            )
        table.c[q * POINTS_PER_OCTAVE + k] = (2.0 if k > 0 else 1.0) * total / POINTS_PER_OCTAVE


@kernel
def table_value(table: Any, q: int, z: float) -> float:
    """Return quantity `q` of a table at the coordinate `z` in [-1, 1].

    The Chebyshev series is summed by Clenshaw's algorithm.
    """
    last, twice, base = 0.0, 0.0, q * POINTS_PER_OCTAVE
    for k in range(POINTS_PER_OCTAVE - 1, 0, -1):
        last, twice = table.c[base + k] + 2.0 * z * last - twice, last
    value: float = table.c[base] + z * last - twice
    return value


@kernel
def tabled_map(table: Any, elastic: int, v: float) -> tuple[float, float, float, float]:
    """Return the map (t1, t2, v1, v2) of a contact at approach speed `v`.

    `maps` defines these quantities.
    """
    # the mantissa of an octave is in [0.5, 1)
    z = 4.0 * math.frexp(v)[0] - 3.0
    t1, t2 = table_value(table, 0, z), table_value(table, 1, z)
    if elastic:
        return t1, t1, v, v
    return t1, max(t1, t2), table_value(table, 2, z) * v, table_value(table, 3, z) * v


@kernel
def tabled_peaks(table: Any, v: float) -> tuple[float, float]:
    """Return the largest overlap in m and the largest force in N from a table.

    `v` is the approach speed.
    """
    z = 4.0 * math.frexp(v)[0] - 3.0
    return table_value(table, 4, z) * v, table_value(table, 5, z) * v


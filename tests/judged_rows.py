"""Contacts of a run as the judge reads them: rows of plain numbers, and what is counted of them."""

from collections import namedtuple
from itertools import zip_longest

Contact = namedtuple("Contact", "pair begin end before after impulse deepest")


def rows_of(run):
    names = "pair", "t_begin", "t_end", "v_in", "v_out", "impulse", "xi_max"
    return [Contact(*(r[name].tolist() for name in names)) for r in run.contacts]


def closing(row):
    return row.before[0] - row.before[1]


def parting(row):
    return row.after[1] - row.after[0]


def count(rows, pair):
    return sum(r.pair == pair for r in rows)


def due(rows, latest, most):
    """The first n contacts of every pair that begin in time."""
    kept, seen = [], {}
    for r in rows:
        if r.begin <= latest[r.pair]:
            seen[r.pair] = seen.get(r.pair, 0) + 1
            if seen[r.pair] <= most[r.pair]:
                kept.append(r)
    return kept


def stuck_apart(one, other, pair, weight, together):
    """Difference of a pair that is stuck at the end of two hard runs: as contacts close and part, or are missing."""
    mine, far = [[r for r in rows if r.pair == pair] for rows in (one, other)], [0.0]
    if not all(rows and parting(rows[-1]) == 0.0 < together for rows in mine):
        return 0.0
    for r, o in zip_longest(*mine):
        if max(closing(row) for row in (r, o) if row) > weight:
            far += [abs(sum(s * of(row) for s, row in ((1, r), (-1, o)) if row)) for of in (closing, parting)]
    return max(far)

"""Contact logs of a run as rows of plain numbers, for the reference judge."""

from collections import namedtuple
from itertools import zip_longest

Contact = namedtuple("Contact", "pair begin end before after impulse deepest")


def rows_of(run):
    names = "pair", "t_begin", "t_end", "v_in", "v_out", "impulse", "xi_max"
    return [Contact(*row) for row in zip(*(run.contacts[name].tolist() for name in names), strict=True)]


def closing(row):
    """Approach speed of a contact."""
    return row.before[0] - row.before[1]


def parting(row):
    """Separation speed of a contact; nan without an end."""
    return row.after[1] - row.after[0]


def of_pair(rows, pair):
    return [r for r in rows if r.pair == pair]


def count(rows, pair):
    return len(of_pair(rows, pair))


def due(rows, latest, most):
    """The first n contacts of every pair that begin in time."""
    kept, seen = [], {}
    for r in rows:
        if r.begin <= latest[r.pair]:
            seen[r.pair] = seen.get(r.pair, 0) + 1
            if seen[r.pair] <= most[r.pair]:
                kept.append(r)
    return kept


def stuck_apart(one, other, pair, settling):
    """Largest difference between the contacts of a pair that sticks at the end of both hard runs."""
    mine, far = [of_pair(rows, pair) for rows in (one, other)], [0.0]
    if not all(rows and parting(rows[-1]) == 0.0 for rows in mine):
        return 0.0
    for r, o in zip_longest(*mine):
        if max(closing(row) for row in (r, o) if row) > settling:
            far += [abs(sum(s * of(row) for s, row in ((1, r), (-1, o)) if row)) for of in (closing, parting)]
    return max(far)

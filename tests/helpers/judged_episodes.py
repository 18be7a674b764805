"""Episodes of linked soft contacts, and the velocities with which balls leave them, in plain loops."""

import math
from bisect import bisect_left, bisect_right
from collections import namedtuple
from itertools import accumulate

Leaving = namedtuple("Leaving", "ball episode hard soft hard_time soft_time difference")
"""One comparison: a ball, its episode as a list of (pair, number), both velocities in m/s and both times in s."""


def numbered(rows):
    """Contacts by (pair, number of the contact of this pair, from 0)."""
    seen, found = {}, {}
    for row in rows:
        found[row.pair, seen.get(row.pair, 0)] = row
        seen[row.pair] = seen.get(row.pair, 0) + 1
    return found


def share_a_ball(one, other, bodies, walls):
    return any(body in bodies(other) and not walls[body] for body in bodies(one))


def episodes_of(soft, bodies, walls):
    """Groups of soft contacts linked by a common ball and an overlap in time; contacts without end are in none.

    `soft` has the contacts by (pair, number). Two contacts overlap if each begins before the other ends.
    """
    ended = sorted((key for key in soft if not math.isnan(soft[key].end)), key=lambda key: soft[key].begin)
    begins, left, found = [soft[key].begin for key in ended], set(ended), []
    longest = max((soft[key].end - soft[key].begin for key in ended), default=0.0) * (1.0 + 1e-9)
    for first in ended:
        if first not in left:
            continue
        left.discard(first)
        group, todo = [], [first]
        while todo:
            key = todo.pop()
            group.append(key)
            mine = soft[key]
            near = ended[bisect_left(begins, mine.begin - longest):bisect_left(begins, mine.end)]
            for other in [o for o in near if o in left and mine.begin < soft[o].end]:
                if share_a_ball(key[0], other[0], bodies, walls):
                    left.discard(other)
                    todo.append(other)
        found.append(sorted(group))
    return found


def last_contact(contacts, keys, ball, bodies):
    """The contact of a ball that ends last among these; None if there is none."""
    mine = [contacts[key] for key in keys if key in contacts and ball in bodies(key[0])]
    return max(mine, key=lambda row: row.end, default=None)


def velocity_after(row, ball, bodies):
    return row.after[bodies(row.pair).index(ball)]


def free_flights(contacts, ball, bodies):
    """How long a ball flies freely after each of its contacts, and the contact that ends the flight (None: none does).

    The time is 0 if another contact is running. Hard contacts have no duration; those of the same instant end together.
    """
    mine = sorted((r.begin, key) for key, r in contacts.items() if ball in bodies(key[0]))
    begins = [begin for begin, _ in mine]
    ends = [contacts[key].end for _, key in mine]
    latest = list(accumulate((math.inf if math.isnan(end) else end for end in ends), max))
    found = {}
    for (_, key), end in zip(mine, ends, strict=True):
        later = bisect_right(begins, end * (1.0 + 1e-12))
        if math.isnan(end) or latest[later - 1] > end * (1.0 + 1e-12):
            found[key] = 0.0, None
        else:
            found[key] = (begins[later] - end, mine[later][1]) if later < len(mine) else (math.inf, None)
    return found

"""Episodes of linked soft contacts, and the velocities with which balls leave them, in plain loops."""

import math
from collections import namedtuple

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
    left, found = set(ended), []
    for first in ended:
        if first not in left:
            continue
        left.discard(first)
        group, todo = [], [first]
        while todo:
            key = todo.pop()
            group.append(key)
            mine = soft[key]
            for other in [o for o in left if soft[o].begin < mine.end and mine.begin < soft[o].end]:
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


def free_time(contacts, others, key, ball, bodies):
    """How long a ball flies freely after a contact; 0 if another is running, or if the next is not among the `others`.

    Hard contacts have no duration; those of the same instant end together.
    """
    end, following = contacts[key].end, []
    for other, r in contacts.items():
        if other == key or ball not in bodies(r.pair):
            continue
        if r.begin > end * (1.0 + 1e-12):
            following.append((r.begin, other))
        elif not r.end <= end * (1.0 + 1e-12):
            return 0.0
    onset, following = min(following, default=(math.inf, None))
    return onset - end if following is None or following in others else 0.0

"""Who is due next: a tournament tree with the times in its nodes.
May be skipped: faster, same results.

Node i holds what wins between nodes 2i and 2i + 1, its time and its key; node 1 holds what is due first. The leaves are
the second half of the tree, in the order of their owners. The earlier time wins; of equal times, the lower key.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular._records import Record, Records

NODE = np.dtype([("due", float), ("key", int)], align=True)
LAST = 1 << 62
"""Key of the empty leaves, behind all others."""


def tournament(n: int) -> np.ndarray[Any, Any]:
    """Return the tree of `n` owners with their numbers as keys, none of which is ever due."""
    leaves = 1 << max(0, n - 1).bit_length()
    tree = np.empty(2 * leaves, NODE)
    tree["due"], tree["key"] = math.inf, LAST
    tree["key"][leaves : leaves + n] = np.arange(n)
    return tree


@kernel
def leaf(tree: Records, owner: int) -> Record:
    """Return the leaf of an owner; a change of it counts once `replay` is called."""
    return tree[len(tree) // 2 + owner]


@kernel
def play(tree: Records, owner: int, due: float) -> None:
    """Let an owner be due at another time, O(log n)."""
    leaf(tree, owner).due = due
    replay(tree, owner, owner)


@kernel
def replay(tree: Records, first: int, last: int) -> None:
    """Play the matches above the leaves of owners `first` … `last` again, O(log n) if they are few."""
    low, high = (len(tree) // 2 + first) >> 1, (len(tree) // 2 + last) >> 1
    while low < high:
        for node in range(low, high + 1):
            winner, rival = tree[2 * node], tree[2 * node + 1]
            if rival.due < winner.due or (rival.due == winner.due and rival.key < winner.key):
                winner = rival
            tree[node].due, tree[node].key = winner.due, winner.key
        low, high = low >> 1, high >> 1
    node = 2 * low
    due, key = tree[node].due, tree[node].key
    while node > 1:
        rival = tree[node ^ 1]
        if rival.due < due or (rival.due == due and rival.key < key):
            due, key = rival.due, rival.key
        node >>= 1
        tree[node].due, tree[node].key = due, key

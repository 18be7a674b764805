"""Which block is due next: a tournament of times, ties to the lower pair."""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel


@kernel
def play(queue: Any, pairs: Any, c: int) -> None:
    """Replay the matches of pair `c` after its `due` has changed; ``queue[1]`` is the pair due first. O(log n)."""
    leaves = len(queue) // 2
    if leaves == 1:
        queue[1] = c
        return
    node = leaves + c
    queue[node] = c
    while node > 1:
        node //= 2
        left, right = queue[2 * node], queue[2 * node + 1]
        queue[node] = left if pairs[left].due <= pairs[right].due else right

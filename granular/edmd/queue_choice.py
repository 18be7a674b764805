"""Choice of the event queue: interpreted, or compiled as soon as this saves time.

The work of a run is counted in collisions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._engine.kernels import fitted, is_worthwhile
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State
from granular.run.drive import Request
from granular.scene import Scene

LOADING_WORK, COMPILING_WORK = 100_000, 500_000
"""Work (in collisions) above which compiled code saves time.

`LOADING_WORK` applies if the machine code is in the cache, `COMPILING_WORK` if it has to be compiled.
"""
EXPECTED_PER_PAIR = 25
"""Number of collisions per pair that is assumed before the run."""
EXTRAPOLATION_WORK = 2048
"""Work done (in collisions) above which the remaining work is extrapolated."""
RELATIVE_WORK = 7
"""Additional work of a collision in relative coordinates.

Such a collision takes the time of eight other collisions.
"""


def work_before_start(request: Request, n: int) -> float:
    """Return the expected work of a run with `n` pairs before its first collision."""
    # setting up a ball costs as much as a collision, a sample of it 1/16
    sample_work = 0 if request.samples is None else n * np.size(request.samples) // 16
    return n + min(EXPECTED_PER_PAIR * n, request.max_events) + sample_work


def expected_work(run: Any) -> float:
    """Return the expected remaining work in collisions, at least the work done so far.

    It is extrapolated from the pace of `run`, a `granular.edmd.run.Run`, and limited by `max_events`.
    """
    begin, events, zoomed = run.counts_at_start
    done = int(run.state.run.events - events + RELATIVE_WORK * (run.state.run.zoomed - zoomed))
    took, left = run.time() - begin, run.request.end - run.time()
    ahead = done / took * left if done >= EXTRAPOLATION_WORK and took > 0.0 and left < math.inf else 0.0
    return max(done, min(ahead, float(run.state.clock.last_event - run.events)))


def compilation_pays(work: float, has: tuple[str, ...]) -> bool:
    """Return whether compiled code saves time for an amount of work, in collisions.

    `has` are the kernel flags of the scene. The compiler is imported only if `work` is at least `LOADING_WORK`.
    """
    if work < LOADING_WORK:
        return False
    from granular.edmd.compiled_queue import loop

    return is_worthwhile(fitted(loop, **dict.fromkeys(has, True)), work, LOADING_WORK, COMPILING_WORK, inline=True)


def compiled_queue_class(state: State, scene: Scene) -> type[SortedQueue]:
    """Return the class of the compiled queue for a scene."""
    from granular.edmd import compiled_queue

    in_blocks = scene.n > compiled_queue.BLOCKS_ABOVE and state.walls is None and not scene.endless
    return compiled_queue.BlockQueue if in_blocks else compiled_queue.TreeQueue

"""The map of contact counts over restitution and gap: its time, and the same cells at order 24.

Run as a script: ``python bench/map_orders.py [SIZE] [WORKERS] [CELLS]``: a SIZE × SIZE map on WORKERS processes, of
which about CELLS, evenly spread, are solved again by a copy of the package whose series are longer.
"""

from __future__ import annotations

import math
import sys
import time
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import Any

import numpy as np
from located_orders import at_order_24

import granular as gr


def axes(size: int, stride: int) -> dict[str, Any]:
    """Every stride-th value of restitution and gap."""
    return {"restitution": np.linspace(0.3, 1.0, size)[::stride], "gap": np.geomspace(1e-7, 1e-2, size)[::stride]}


def counts(size: int, stride: int, executor: Executor | None = None) -> dict[str, Any]:
    """Contacts of the two balls, and how the runs ended."""
    data = gr.sweep("three-balls", axes(size, stride), "contacts", executor=executor)
    return {"contacts": data["contacts"].values, "status": data["status"].values}


def main(size: int = 300, workers: int = 2, cells: int = 90_000) -> None:
    with ProcessPoolExecutor(workers) as pool:
        for _ in pool.map(counts, [8] * workers, [1] * workers):  # loads numba and its cache in every process
            pass
        counts(8, 1)
        begin = time.perf_counter()
        here = counts(size, 1, pool)
        print(f"{size} × {size} on {workers} processes: {time.perf_counter() - begin:.2f} s")
    stride = max(1, math.ceil(size / math.sqrt(cells)))
    there = at_order_24(f"map_orders.counts({size}, {stride})")
    part = here["contacts"][::stride, ::stride]
    wrong = (part != there["contacts"]).any(axis=-1)
    print(f"{wrong.size} cells at order 24: {wrong.sum()} other counts; largest count {part.max()}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

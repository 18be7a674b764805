"""Run time and memory of `gr.contacts.analyse`, for 10 contacts per particle.

The argument is the number of contacts:

    python -m bench.threed.cost 1e7
"""

from __future__ import annotations

import resource
import sys
import time

import numpy as np

from granular.studies import contacts

PARTICLES_PER_CONTACT, OCCUPATION = 0.1, 0.09


def random_list(n: int, seed: int = 1) -> tuple[dict[str, np.ndarray], int, float]:
    """Random contacts of duration 0.9 to 1.1, sorted by their ends."""
    random, particles = np.random.default_rng(seed), int(n * PARTICLES_PER_CONTACT)
    span = 2.0 * n / (particles * OCCUPATION)
    i, j = random.integers(0, particles, n), random.integers(1, particles, n)
    begin = random.uniform(0.0, span, n)
    end = begin + random.uniform(0.9, 1.1, n)
    order = np.argsort(end)
    listed = {"i": i, "j": (i + j) % particles, "begin": begin, "end": end, "overlap": np.full(n, 1e-3)}
    return {name: values[order] for name, values in listed.items()}, particles, span + 2.0


def main() -> None:
    """Print time and memory."""
    listed, particles, span = random_list(int(float(sys.argv[1])))
    start, before = time.perf_counter(), time.process_time()
    found = contacts.analyse(**listed, distance=1.0, particles=particles, span=span)
    print(f"{time.perf_counter() - start:.1f} s, {time.process_time() - before:.1f} s of processor time, "
          f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")
    print(found)


if __name__ == "__main__":
    main()

"""One map of contact counts on this process, on a process pool, and on dask: the same bits."""

from concurrent.futures import ProcessPoolExecutor

import granular as gr

OVER = ["restitution=0.3:1:30", "gap=1e-6:1e-2:30:log"]


def main():
    here = gr.sweep("three-balls", OVER, "contacts")
    with ProcessPoolExecutor(2) as pool:
        there = gr.sweep("three-balls", OVER, "contacts", executor=pool)
    print("process pool, same bits:", here.identical(there))
    print("most contacts of the two balls:", int(here["contacts"].max()))


if __name__ == "__main__":
    main()

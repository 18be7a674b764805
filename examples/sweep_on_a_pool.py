"""A map on a process pool

A map of contact counts is computed in one process and on a process pool. Both results are bitwise identical.
"""

from concurrent.futures import ProcessPoolExecutor

import matplotlib.pyplot as plt

import granular as gr

SWEEP_AXES = ["restitution=0.3:1:16", "gap=1e-6:1e-2:16:log"]


def main():
    here = gr.sweep("three-balls", SWEEP_AXES, "contacts")
    with ProcessPoolExecutor(2) as pool:
        there = gr.sweep("three-balls", SWEEP_AXES, "contacts", executor=pool)
    print("process pool, bitwise identical:", here.identical(there))
    print("largest number of contacts of the two balls:", int(here["contacts"].max()))
    plt.style.use("granular.journal")
    drawn, axis = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
    here["contacts"].sel(pair=1).plot(ax=axis, x="restitution", yscale="log", cbar_kwargs={"label": "contacts"})
    axis.set(xlabel="ε", ylabel="gap (m)", title="R = 10 and 1 cm, k = 5·10⁷ N/m")
    return drawn


if __name__ == "__main__":
    figure = main()
    figure.savefig("sweep_on_a_pool.png")

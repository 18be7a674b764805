"""A map on dask

The same sweep on a dask cluster, here a small local cluster.
"""

import sys

import granular as gr

SWEEP_AXES = ["restitution=0.3:1:30", "gap=1e-6:1e-2:30:log"]


def main():
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        sys.exit("dask is not installed: pip install distributed")
    here = gr.sweep("three-balls", SWEEP_AXES, "contacts")
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        there = gr.sweep("three-balls", SWEEP_AXES, "contacts", executor=client.get_executor())
    print("dask, bitwise identical:", here.identical(there))


# sphinx_gallery_thumbnail_path = "figures/paper-counts.png"
if __name__ == "__main__":
    main()

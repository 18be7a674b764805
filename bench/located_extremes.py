"""The located engine at the ends of every axis of the three-ball scene, against the independent reference solver.

Run as a script: ``python bench/located_extremes.py``. The scene starts at the first touch. The condition is how much
velocities move, as parts of the speed, when gap and upper speed change by one part in 2⁵²; an error of a few times
that cannot be avoided by any engine that computes in double precision.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

import granular as gr
from granular import reference

EPS = 2.0**-52
SPEED = 3.132091952673165
BASE = {"k": 5e7, "gap": 1e-4, "ratio": 10.0, "eps": 0.7, "zeta": None, "gravity": 9.81, "speed": SPEED}
AXES: dict[str, tuple[Any, ...]] = {
    "k": (1e4, 1e6, 1e10, 1e14),
    "gap": (0.0, 1e-12, 1e-7, 1e-2),
    "ratio": (0.2, 1.0, 100.0, 1000.0),
    "eps": (1e-3, 0.1, 0.3, 1.0),
    "zeta": (1.0, 16.0),
    "gravity": (0.0,),
    "speed": (1e-9, 1e6),
}


def setting(k: float, gap: float, ratio: float, eps: float, zeta: float | None, gravity: float, speed: float) -> Any:
    """Scene and laws of one cell."""
    radii = (0.1, 0.1 / ratio)
    masses = [4.0 / 3.0 * math.pi * r**3 * 900.0 for r in radii]
    scene = gr.Scene([math.inf, *masses], [0.0, *radii], [0.0, gap], [0.0, -speed, -speed], gravity)
    laws = [
        gr.LinearDashpot.from_restitution(eps, k, pair)
        if zeta is None
        else gr.LinearDashpot(k, 2.0 * zeta * math.sqrt(k * pair.m_eff))
        for pair in scene.pairs
    ]
    return scene, laws


def ends(log: Any) -> tuple[list[int], np.ndarray[Any, Any]]:
    """Pairs of a structured contact log in order, and the velocities at the ends of its contacts."""
    return log["pair"].tolist(), log["v_out"][~np.isnan(log["t_end"])].ravel()


def cell(name: str, value: Any) -> str:
    """One line of the table."""
    given = BASE | {name: value} | ({"gravity": 0.0} if name == "speed" else {})  # else a slow ball just settles
    scene, laws = setting(**given)
    stop: dict[str, Any] = {"until": gr.until.contact(pair=0, nth=2)}
    if name == "zeta" or given["eps"] < 0.1:  # these come to rest
        stop = {"t_end": 30.0 * math.pi * math.sqrt(float(scene.mass[1]) / given["k"])}
    begin = time.perf_counter()
    soft = gr.md.simulate(scene, laws, **stop)
    took = time.perf_counter() - begin
    other = setting(**(given | {"gap": given["gap"] * (1.0 + EPS)}))[0]
    v = np.array(other.velocity)
    v[2] *= 1.0 + EPS
    other = gr.Scene(other.mass, other.radius, other.gap, v, other.gravity)
    moved = ends(gr.md.simulate(other, laws, **stop).contacts)
    exact = reference.solve(scene, laws, **stop)
    pairs, found = ends(soft.contacts)
    expected = np.array([[float(x) for x in row.v_out] for row in exact.contacts if row.v_out is not None]).ravel()
    same = pairs == [row.pair for row in exact.contacts]
    if not same or len(found) != len(expected):
        return f"{name:8s} {value:8g}  contacts {pairs} != {[row.pair for row in exact.contacts]}"
    error = np.abs(found - expected).max(initial=0.0) / given["speed"]
    near = len(moved[1]) == len(found)
    condition = np.abs(moved[1] - found).max(initial=0.0) / given["speed"] / EPS if near else math.inf
    return (
        f"{name:8s} {value:8g}  {len(pairs):3d} contacts  {soft.stats['steps']:6d} steps {took:7.3f} s  "
        f"|Δv|/v {error:.1e}  reference {exact.velocity_error:.0e}  condition {condition:.1e}  {soft.status.name}"
    )


def main() -> None:
    for name, values in AXES.items():
        for value in values:
            print(cell(name, value), flush=True)


if __name__ == "__main__":
    main()

"""100 000 random three-ball scenes at order 20 and at order 24, and with the gap changed by 4 ulp.

Run as a script: ``python bench/located_orders.py [SCENES]``. The engine of order 24 is a copy of the package with that
one constant changed, run in a process of its own.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve()
LINE = "ORDER = 20\n"


def scenes(count: int) -> dict[str, Any]:
    """Floor and two balls: radii, gap, speed, stiffness, restitution and gravity over wide ranges."""
    pick = np.random.default_rng(2011)
    r1, r2 = 0.1, 0.1 / 10 ** pick.uniform(-0.5, 1.5, count)
    m1, m2 = 900.0 * 4.0 / 3.0 * math.pi * r1**3, 900.0 * 4.0 / 3.0 * math.pi * r2**3
    speed, k = 10 ** pick.uniform(-1.0, 1.0, count), 10 ** pick.uniform(4.0, 14.0, count)
    gap = speed * math.pi * np.sqrt(m1 / k) * 10 ** pick.uniform(-3.0, 0.5, count)
    gap[pick.random(count) < 0.05] = 0.0
    log = np.log(np.where(pick.random(count) < 0.2, 1.0, pick.uniform(0.3, 1.0, count)))
    zeta = -log / np.sqrt(math.pi**2 + log**2)  # of the unclipped dashpot; a scene is none the worse for it
    stiffness = np.column_stack([k, k * pick.choice([1.0, 0.3, 4.0], count)])
    m_eff = np.column_stack([np.full(count, m1), m1 * m2 / (m1 + m2)])
    law = np.zeros((count, 2, 4))
    law[..., 0], law[..., 1], law[..., 2] = stiffness, 1.0, 2.0 * zeta[:, None] * np.sqrt(stiffness * m_eff)
    mass = np.column_stack([np.full(count, math.inf), np.full(count, m1), m2])
    velocity = np.column_stack([np.zeros(count), -speed, -speed])
    return {"mass": mass, "gap": np.column_stack([np.zeros(count), gap]), "velocity": velocity, "law": law,
            "gravity": pick.choice([0.0, 9.81], count)}


def solve(count: int, gap_factor: float = 1.0) -> dict[str, Any]:
    """Counts, velocities of the last contact as parts of the speed, and how the runs ended."""
    from granular import until
    from granular.md.located import Scenes, solve_many

    given = scenes(count)
    given["gap"] *= gap_factor
    many = solve_many(Scenes(**given), until=until.contact(0, 2), leave_piles=False)
    speed = np.abs(given["velocity"][:, 1])
    v = np.column_stack([many.v_lower[:, -1], many.v_upper[:, -1]]) / speed[:, None]
    return {"counts": many.counts, "v": v, "status": many.status}


def at_order_24(call: str) -> dict[str, Any]:
    """What a function of a bench script, such as ``located_orders.solve(10)``, gives in a copy at order 24."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "granular"
        shutil.copytree(HERE.parent.parent / "granular", copy, ignore=shutil.ignore_patterns("__pycache__"))
        records = copy / "md" / "located" / "records.py"
        text = records.read_text(encoding="utf-8")
        assert LINE in text
        records.write_text(text.replace(LINE, "ORDER = 24\n"), encoding="utf-8")
        out = Path(folder) / "out.npz"
        code = (
            f"import sys; sys.path[:0] = [{folder!r}, {str(HERE.parent)!r}]\n"
            f"import numpy, {call.partition('.')[0]}, granular.md.located.records as records\n"
            f"assert records.ORDER == 24\nnumpy.savez({str(out)!r}, **{call})\n"
        )
        subprocess.run([sys.executable, "-c", code], check=True)
        with np.load(out) as data:
            return dict(data)


def main(count: int) -> None:
    here, there = solve(count), at_order_24(f"located_orders.solve({count})")
    near = [solve(count, 1.0 + sign * 4 * 2.0**-52) for sign in (1, -1)]
    sensitive = np.maximum(*(np.abs(one["v"] - here["v"]).max(axis=1) for one in near))
    moved = np.abs(there["v"] - here["v"]).max(axis=1)
    same = (there["counts"] == here["counts"]).all(axis=1)
    shaky = ~np.logical_and(*((one["counts"] == here["counts"]).all(axis=1) for one in near))
    excess = moved[same & ~shaky] / np.maximum(1e-13, sensitive[same & ~shaky])
    print(f"{count} scenes; ended: {dict(zip(*np.unique(here['status'], return_counts=True), strict=True))}")
    print(f"counts differ between order 20 and 24: {np.sum(~same)}; between gaps 4 ulp apart: {np.sum(shaky)}")
    print(f"differ between orders where 4 ulp do not matter: {np.sum(~same & ~shaky)}")
    print(f"|Δv|/v between orders, same counts: median {np.nanmedian(moved[same]):.1e}, "
          f"largest {np.nanmax(moved[same]):.1e}")
    print(f"largest |Δv| over that of 4 ulp of the gap (at least 1e-13): {np.nanmax(excess):.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)

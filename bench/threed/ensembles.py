"""Calibration of B = s + Z/2: means of soft and of hard spheres.

Both runs start from the same state of hard spheres in equilibrium.

    python -m bench.threed.ensembles            all ensembles, about 20 minutes on one core
    python -m bench.threed.ensembles sheared    one group

Results are stored in bench/threed/results.json, with seeds and versions.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

import granular as gr
from bench.threed import gas
from granular._engine.files import provenance
from granular.studies import contacts

RESULTS_PATH = Path(__file__).parent / "results.json"
N_SPHERES, RESTITUTION, COLLISIONS_PER_SPHERE = 500, 0.9, 10.0
STEADY_TIME, SHEAR_TIME = 6.0, 10.0
"""Time until shear flow is steady, and averaging time, at the shear rate 1."""
GROUPS: dict[str, list[dict[str, Any]]] = {
    "φ = 0.05": [{"packing": 0.05, "occupation": z, "seeds": 24} for z in (0.01, 0.03)],
    "φ = 0.2": [{"packing": 0.2, "occupation": z, "seeds": 24} for z in (0.02, 0.06)],
    "φ = 0.4": [{"packing": 0.4, "occupation": z, "seeds": 24} for z in (0.03, 0.1)],
    "φ = 0.55": [{"packing": 0.55, "occupation": z, "seeds": 16} for z in (0.04, 0.12)],
    "two sizes": [{"packing": 0.25, "small": 0.8, "occupation": z, "seeds": 24} for z in (0.03, 0.1)],
    "sheared": [{"packing": 0.3, "shear": 1.0, "occupation": z, "seeds": 6} for z in (0.03, 0.1)],
}
"""Packing fraction, Z of equal spheres at T = 1, and number of seeds.

Some groups also have a fraction of small spheres or a shear rate.
"""


def collision_rate(packing: float) -> float:
    """Enskog's collision rate of a hard sphere with d = m = T = 1."""
    return 24.0 * packing * (1.0 - 0.5 * packing) / (1.0 - packing) ** 3 / math.sqrt(math.pi)


def hard_means(state: tuple[Any, ...], time: float, shear: float) -> dict[str, float]:
    """Means of hard spheres."""
    (x, v), (radius, mass, box), start = (one.copy() for one in state[:2]), state[2:], 0.0
    if shear:
        start = STEADY_TIME
        gas.hard(x, v, radius, mass, RESTITUTION, box, shear, 0.0, start, 10**9)
    before = gas.energy(x, v, mass, shear)
    count, virial, stress, heat, _ = gas.hard(x, v, radius, mass, RESTITUTION, box, shear, start, start + time, 10**9)
    return means(count, virial, stress, heat, before, gas.energy(x, v, mass, shear), 0.0, shear)


def soft_means(state: tuple[Any, ...], time: float, shear: float, duration: float) -> tuple[dict[str, float], Any]:
    """Means of soft spheres, and their contacts.

    `duration` is the contact duration of two spheres of mass 1.
    """
    (x, v), (radius, mass, box), start = (one.copy() for one in state[:2]), state[2:], 0.0
    pair = gr.Pair(m_eff=0.5, r_eff=0.25, index=0)
    law = gr.LinearDashpot.from_restitution(RESTITUTION, k=1.0, pair=pair)  # of the clipped force
    stiffness = (gr.binary.collision(law, pair, 1.0).duration / duration) ** 2
    loss, dt = 0.5 * law.gamma / math.sqrt(law.k * pair.m_eff), duration * math.sqrt(mass.min()) / gas.STEPS_PER_CONTACT
    if shear:
        start = dt * math.ceil(STEADY_TIME / dt)
        gas.soft(x, v, radius, mass, stiffness, loss, box, shear, 0.0, dt, round(start / dt))
    before, steps = gas.energy(x, v, mass, shear), math.ceil(time / dt)
    virial, stress, heat, elastic, log = gas.soft(x, v, radius, mass, stiffness, loss, box, shear, start, dt, steps)
    i, j, begin, end, overlap = log.T
    found = contacts.analyse(i, j, begin, np.where(end < 0.0, np.nan, end), overlap=overlap, distance=1.0,
                             particles=len(mass), span=float(steps))
    return means(len(log), virial, stress, heat, before, gas.energy(x, v, mass, shear), elastic, shear), found


def means(count: int, virial: float, stress: float, heat: float, before: float, after: float, elastic: float,
          shear: float) -> dict[str, float]:
    """Compared means, of steady shear flow or of a cooling gas."""
    shared = {"collisions": count, "collisional pressure": virial}
    return shared | ({"temperature": heat, "shear stress": stress} if shear else {
        "energy lost": before - after - elastic, "cooling rate": math.log(before / after)})


def ensemble(packing: float, occupation: float, seeds: int, small: float = 0.0, shear: float = 0.0) -> dict[str, Any]:
    """Relative errors of means with standard errors, and B with its parts."""
    rate = collision_rate(packing)
    time, rows, parts = SHEAR_TIME if shear else COLLISIONS_PER_SPHERE / rate, [], []
    for seed in range(seeds):
        state = gas.start(N_SPHERES, packing, seed, small, shear)
        soft, found = soft_means(state, time, shear, occupation / rate)
        rows.append([soft, hard_means(state, time, shear)])
        parts.append([found.occupation, math.pi * found.relative_overlap, found.disturbed_share])
    errors = {name: jackknife([[one[name] for one in row] for row in rows]) for name in rows[0][0]}
    z, s, disturbed = np.mean(parts, axis=0).tolist()
    return {"packing": packing, "small": small, "shear": shear, "seeds": seeds, "time": time,
            "contact_duration": occupation / rate, "Z": z, "s": s, "B": s + 0.5 * z, "disturbed": disturbed,
            "errors": errors}


def jackknife(pairs: list[list[float]]) -> list[float]:
    """Ratio of the sums of soft and hard values minus 1, and its standard error."""
    values = np.array(pairs)
    sums, n = values.sum(axis=0), len(values)
    left = (sums[0] - values[:, 0]) / (sums[1] - values[:, 1])
    return [float(sums[0] / sums[1] - 1.0), float(math.sqrt((n - 1) / n * ((left - left.mean()) ** 2).sum()))]


def main() -> None:
    """Compute the groups named on the command line, or all groups."""
    for name in sys.argv[1:] or GROUPS:
        rows = []
        for options in GROUPS[name]:
            row = ensemble(**options)
            worst = max(abs(error) for error, _ in row["errors"].values())
            listed = ", ".join(f"{key} {error:+.4f}({sigma:.4f})" for key, (error, sigma) in row["errors"].items())
            print(f"{name}: Z {row['Z']:.4f}, s {row['s']:.4f}, B {row['B']:.4f}, worst/B {worst / row['B']:.2f}; "
                  f"{listed}", flush=True)
            rows.append(row)
        stored = json.loads(RESULTS_PATH.read_text(encoding="utf-8")) if RESULTS_PATH.exists() else {"groups": {}}
        stored = {"spheres": N_SPHERES, "restitution": RESTITUTION, "provenance": provenance(),
                  "groups": stored["groups"] | {name: rows}}
        RESULTS_PATH.write_text(json.dumps(stored, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

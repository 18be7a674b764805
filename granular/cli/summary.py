"""One trajectory in words and a few numbers."""

from __future__ import annotations

import math

from granular.cases import Case
from granular.scene import Scene
from granular.trajectory import Trajectory


def summary(case: Case, trajectory: Trajectory) -> str:
    """Return how a run ended, its contacts by pair, and the state of each body at the end."""
    engine = "hard spheres (edmd)" if trajectory.law is None else "soft spheres (md)"
    lines = [case.about] if case.about else []
    lines += [f"{trajectory.scene!r}, {engine}", f"{trajectory.status.name}: {trajectory.message}",
              f"t = {trajectory.time[-1]:.12g} s, {len(trajectory.contacts)} contacts", ""]
    lines += [*_contacts(trajectory), "", *_bodies(trajectory)]
    energy = trajectory.energy()
    if energy[0] > 0.0 and not math.isnan(energy[-1]):
        lines += ["", f"energy left: {100.0 * energy[-1] / energy[0]:.6g} % of {energy[0]:.6g} J"]
    return "\n".join(lines)


def _contacts(trajectory: Trajectory) -> list[str]:
    rows = [f"{'pair':>12} {'contacts':>9} {'first begins / s':>18} {'last begins / s':>18} {'max overlap / m':>16}"]
    for pair in range(trajectory.scene.n - 1):
        log = trajectory.of(pair)
        label = f"{_label(trajectory.scene, pair)}–{_label(trajectory.scene, pair + 1)}"
        if len(log):
            deepest = 0.0 if trajectory.law is None else float(log["xi_max"].max())
            rows.append(f"{label:>12} {len(log):9d} {log['t_begin'][0]:18.12g} {log['t_begin'][-1]:18.12g} "
                        f"{deepest:16.4g}")
        else:
            rows.append(f"{label:>12} {0:9d}")
    return _shortened(rows)


def _bodies(trajectory: Trajectory) -> list[str]:
    rows = [f"{'body':>12} {'mass / kg':>12} {'position / m':>18} {'velocity / (m/s)':>20}"]
    for i, mass in enumerate(trajectory.scene.mass):
        x, v = trajectory.position[-1, i], trajectory.velocity[-1, i]
        rows.append(f"{_label(trajectory.scene, i):>12} {mass:12.6g} {x:18.12g} {v:20.12g}")
    return _shortened(rows)


def _label(scene: Scene, body: int) -> str:
    if not scene.is_wall[body]:
        return str(body)
    return "floor" if body == 0 else "ceiling"


def _shortened(rows: list[str], most: int = 21) -> list[str]:
    return rows if len(rows) <= most else [*rows[: most - 2], f"{'…':>12} ({len(rows) - most + 1} more)", rows[-1]]

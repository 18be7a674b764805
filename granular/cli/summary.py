"""One trajectory in words and a few numbers."""

from __future__ import annotations

import math
from collections.abc import Callable

from granular.cases import Case
from granular.scene import Scene
from granular.trajectory import Trajectory

MOST = 20
"""Rows of a table at most."""


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
    head = f"{'pair':>12} {'contacts':>9} {'first begins / s':>18} {'last begins / s':>18} {'max overlap / m':>16}"
    return [head, *_shortened(lambda pair: _pair(trajectory, pair), trajectory.scene.n_pairs)]


def _pair(trajectory: Trajectory, pair: int) -> str:
    log, scene = trajectory.of(pair), trajectory.scene
    row = f"{'–'.join(_label(scene, body) for body in scene.bodies(pair)):>12} {len(log):9d}"
    if not len(log):
        return row
    deepest = 0.0 if trajectory.law is None else float(log["xi_max"].max())
    return f"{row} {log['t_begin'][0]:18.12g} {log['t_begin'][-1]:18.12g} {deepest:16.4g}"


def _bodies(trajectory: Trajectory) -> list[str]:
    head = f"{'body':>12} {'mass / kg':>12} {'position / m':>18} {'velocity / (m/s)':>20}"
    return [head, *_shortened(lambda body: _body(trajectory, body), trajectory.scene.n)]


def _body(trajectory: Trajectory, i: int) -> str:
    mass, x, v = trajectory.scene.mass[i], trajectory.position[-1, i], trajectory.velocity[-1, i]
    return f"{_label(trajectory.scene, i):>12} {mass:12.6g} {x:18.12g} {v:20.12g}"


def _label(scene: Scene, body: int) -> str:
    if not scene.is_wall[body]:
        return str(body)
    return "floor" if body == 0 else "ceiling"


def _shortened(row: Callable[[int], str], n: int) -> list[str]:
    """The rows of `n` pairs or bodies, of many only the first and the last."""
    if n <= MOST:
        return [row(i) for i in range(n)]
    return [*(row(i) for i in range(MOST - 2)), f"{'…':>12} ({n - MOST + 1} more)", row(n - 1)]

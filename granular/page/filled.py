"""Rows that a hard run did not record: at its contacts, and between these where paths are curved.
May be skipped: the teaching page, beside the engines.

They follow from the rows and the log: from a row on every body flies freely, and each contact says with which
velocities its two bodies leave. Where that does not lead to the next row (no log, or not all of it), nothing is added.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from granular._check import Array
from granular.scene import Scene
from granular.trajectory import Trajectory

EVEN, EACH = 200, 8
"""Parts of the whole run, and of the time from contact to contact, that curved paths are drawn with."""
CLOSE = 1e-6
"""By how much of the way of all bodies a row may be missed."""


def filled(run: Trajectory, most: int) -> Trajectory:
    """Return a hard run with more rows, `most` at most; any other run, and one with driven walls, as it is."""
    if run.rule is None or run.scene.driven:
        return run
    instants = next((found for found in _instants(run) if len(found) + len(run.contacts) <= most), run.time)
    rows = list(_rows(run, instants)) if len(instants) > len(run.time) else []
    if not rows or rows[-1][0] < instants[-1] or not np.array_equal(rows[-1][1], run.position[-1]):
        return run
    time, position, velocity, gap = (np.array(column) for column in zip(*rows, strict=True))
    return replace(run, time=time, position=position, velocity=velocity, gap=gap, ledger=None)


def _instants(run: Trajectory) -> Iterator[Array]:
    """Times of rows and contacts, with some between them if paths are curved; and without those between."""
    corners = np.union1d(run.time, run.contacts["t_begin"])
    scene = run.scene
    if scene.gravity or scene.pendulum or scene.external_force is not None:
        between = corners[:-1, None] + np.diff(corners)[:, None] * np.arange(EACH) / EACH
        even = np.linspace(corners[0], corners[-1], EVEN + 1)
        yield np.union1d(np.union1d(corners, between), even)
        yield np.union1d(corners, even)
    yield corners


def _rows(run: Trajectory, instants: Array) -> Iterator[tuple[float, Array, Array, Array]]:
    """Time, position, velocity and gap at each instant, before and after contacts; none once a row is missed."""
    log, scene, met = run.contacts, run.scene, 0
    near = CLOSE * float(np.ptp(run.position, axis=0).max(initial=0.0))
    at = dict(zip(run.time.tolist(), range(len(run.time)), strict=True))
    now, x, v, gap = instants[0], run.position[0], run.velocity[0], run.gap[0]
    for t in instants.tolist():
        there, v = _flown(scene, x, v, t - now)
        now, x, gap = t, there, gap + scene.across(there - x)
        if met < len(log) and instants[0] < log["t_begin"][met] <= t:
            yield t, x, v, gap
        v, touching = v.copy(), []
        while met < len(log) and log["t_begin"][met] <= t:
            pair = int(log["pair"][met])
            v[list(scene.bodies(pair))] = log["v_out"][met]
            touching.append(pair)
            met += 1
        if touching:
            gap[touching] = 0.0
        if t in at:
            row = at[t]
            if np.abs(x - run.position[row]).max() > near:
                return
            x, v, gap = run.position[row], run.velocity[row], run.gap[row]
        yield t, x, v, gap


def _flown(scene: Scene, x: Array, v: Array, dt: float) -> tuple[Array, Array]:
    """Positions and velocities after a free flight."""
    if scene.pendulum == 0.0:
        return x + (v + 0.5 * scene.fall * dt) * dt, v + scene.fall * dt
    rest, turn = scene.at_rest, scene.pendulum * dt
    y: Any = x - rest
    moved = y * math.cos(turn) + v / scene.pendulum * math.sin(turn)
    return rest + moved, v * math.cos(turn) - scene.pendulum * y * math.sin(turn)

"""A recorded run made small enough to embed in a page: thinned out evenly, and told by how much.
May be skipped: the teaching page, beside the engines.

Rows and contacts beyond the limits are left out one in so many, never merged or smoothed; where contacts are left out a
map counts all of them over pairs and time. Hard runs get the rows that they lack (`filled`). Numbers are kept as 32-bit
floats, positions with the radii taken out, where equal means touching.
"""

from __future__ import annotations

import base64
import math
from dataclasses import replace
from typing import Any

import numpy as np

from granular.measures import ACCOUNT, balance
from granular.page import described
from granular.page.filled import filled
from granular.scene import Scene
from granular.trajectory import Trajectory, points

NUMBERS = 200_000
"""Most positions of bodies kept: rows times bodies."""
ROWS, BODIES, CONTACTS = 2000, 1024, 20_000
"""Most rows, bodies and single contacts kept."""
MAP = (600, 250)
"""Most columns (time) and rows (pairs or balls) of the map of contacts and of that of velocities."""


def recorded(run: Trajectory, name: str) -> dict[str, Any]:
    """Return what the player shows of a run, as JSON-ready values.

    Parameters
    ----------
    run : Trajectory
        Of any scene, engine and length.
    name : str
        What to call it.
    """
    bodies = evenly(run.scene.n, BODIES)
    most = min(ROWS, max(2, NUMBERS // len(bodies)))
    kept = evenly(len(run.contacts), CONTACTS)
    played = filled(run, most)
    thin = part(played, evenly(len(played.time), most))
    return {
        "name": name,
        "engine": "soft" if run.rule is None else "hard",
        "scene": described.scene(run.scene),
        "about": described.about(run),
        "upright": run.scene.gravity > 0.0,
        "status": run.status.name,
        "message": run.message,
        "bodies": packed(bodies),
        "n": run.scene.n,
        "pairs": run.scene.n_pairs,
        "radius": packed(run.scene.radius[bodies]),
        "walls": np.flatnonzero(run.scene.is_wall).tolist(),
        "time": packed(thin.time, np.float64),
        "span": [float(run.time[0]), float(run.time[-1])],
        "offset": packed((run.position[0] - points(part(run, evenly(1, 1)))[0])[bodies]),
        "path": packed(points(thin)[:, bodies]),
        "energy": packed(np.nan_to_num(thin.energy(), nan=0.0), np.float64),
        "account": _account(run),
        "contacts": contacts(run, kept),
        "map": contact_map(run) if len(kept) < len(run.contacts) else None,
        "field": velocity_map(played),
        "whole": {"rows": len(run.time), "contacts": len(run.contacts), "bodies": run.scene.n},
    }


def different_balls(one: Scene, other: Scene) -> str:
    """Return in what two scenes differ other than gaps, velocities and place; nothing if they have the same balls."""
    if one.n != other.n:
        return f"{one.n} and {other.n} bodies"
    heavy = f"gravity {one.gravity:g} and {other.gravity:g} m/s²"
    forces = (np.zeros(scene.n) if scene.external_force is None else scene.external_force for scene in (one, other))
    differ = {"masses": (one.mass != other.mass).any(), "radii": (one.radius != other.radius).any(),
              heavy: one.gravity != other.gravity, "forces": np.not_equal(*forces).any()}
    return next((name for name, is_so in differ.items() if is_so), "")


def evenly(n: int, most: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return at most `most` of the numbers 0 … n-1, evenly spread, with the first and the last."""
    return np.unique(np.round(np.linspace(0, n - 1, min(n, most))).astype(np.int64))


def part(run: Trajectory, rows: np.ndarray[Any, np.dtype[np.int64]]) -> Trajectory:
    """Return the run with only some of its rows."""
    arrays: dict[str, Any] = {name: getattr(run, name)[rows] for name in ("time", "position", "velocity", "gap")}
    arrays |= {name: getattr(run, name)[rows] for name in ("force", "ledger") if getattr(run, name) is not None}
    return replace(run, **arrays)


def _account(run: Trajectory) -> list[list[str | float]]:
    """What walls do and contacts dissipate in a whole run, in words and J; nothing where no wall moves or heats."""
    parts = balance(run)
    return [[ACCOUNT[name], parts[name]] for name in ("floor", "ceiling", "heat", "dissipated", "remainder")
            if run.scene.fed and parts[name] and math.isfinite(parts[name])]


def contacts(run: Trajectory, kept: np.ndarray[Any, np.dtype[np.int64]]) -> dict[str, Any]:
    """Return the log of the contacts kept, column by column; a contact still open ends with the run, and the ends of
    hard ones are their begins."""
    log = run.contacts[kept]
    before, after = (log[name][:, 1] - log[name][:, 0] for name in ("v_in", "v_out"))
    return {
        "pair": packed(log["pair"]),
        "begin": packed(log["t_begin"], np.float64),
        "end": packed(np.nan_to_num(log["t_end"], nan=run.time[-1]), np.float64) if run.rule is None else None,
        "before": packed(before),
        "after": packed(np.nan_to_num(after, nan=0.0)),
        "impulse": packed(log["impulse"]),
    }


def contact_map(run: Trajectory) -> dict[str, Any]:
    """Return how many contacts were under way in each cell of a grid of time and pairs; all are counted."""
    start, span = float(run.time[0]), float(run.time[-1] - run.time[0]) or 1.0
    columns, lanes = MAP[0], min(MAP[1], run.scene.n_pairs)
    log, end = run.contacts, np.nan_to_num(run.contacts["t_end"], nan=run.time[-1])
    lane = log["pair"].astype(np.int64) * lanes // run.scene.n_pairs
    first, last = (np.clip(((t - start) / span * columns).astype(np.int64), 0, columns - 1)
                   for t in (log["t_begin"], end))
    change = np.zeros((columns + 1, lanes), np.int64)
    np.add.at(change, (first, lane), 1)
    np.add.at(change, (last + 1, lane), -1)
    counts = np.cumsum(change, axis=0)[:columns]
    return {"columns": columns, "lanes": lanes, "counts": packed(np.minimum(counts, 65535), np.uint16)}


def velocity_map(run: Trajectory) -> dict[str, Any]:
    """Return velocities of balls as shares of the largest in 127 steps; of balls that share a lane that of the fastest.

    So a wave narrower than a lane is not lost. Rows are left out one in so many.
    """
    rows, balls = evenly(len(run.time), MAP[0]), np.flatnonzero(~run.scene.is_wall)
    lanes = np.arange(min(len(balls), MAP[1]))
    velocity = run.velocity[rows][:, balls]
    first = lanes * len(balls) // len(lanes)
    up, down = (extreme.reduceat(velocity, first, axis=1) for extreme in (np.maximum, np.minimum))
    fastest = np.where(up >= -down, up, down)
    peak = float(np.abs(fastest).max(initial=0.0)) or 1.0
    return {"time": packed(run.time[rows], np.float64), "rows": len(lanes), "peak": peak, "first": int(balls[0]),
            "last": int(balls[-1]), "values": packed(np.rint(fastest * (127.0 / peak)), np.int8)}


def packed(values: Any, kind: Any = None) -> str:
    """Return an array as base64: whole numbers as int32, others as float32 unless `kind` says otherwise."""
    array = np.asarray(values)
    kind = kind or (np.int32 if array.dtype.kind in "iu" else np.float32)
    little = np.dtype(kind).newbyteorder("<")
    return base64.b64encode(np.ascontiguousarray(array, dtype=little).tobytes()).decode("ascii")

"""Recorded runs reduced to a size that a page can embed.

Samples and contacts beyond the limits are thinned out evenly, and never merged or smoothed. The page states by how
much. If contacts are thinned out, a map counts all contacts over pairs and time. Times and energies are stored as
64-bit floats, other numbers with 32 bits or less. Radii are subtracted from positions, so that equal positions mean
contact.

Hard runs get additional samples (`add_samples`) at their contacts, and between contacts where paths are curved. They
are computed from the samples and the contact log. Every body flies freely after a sample, and the log contains the
velocities after each contact. Nothing is added if this computation does not reproduce the next sample, because the log
is missing or incomplete.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.reports import named_pairs, pairs_by_law, short_text
from granular.cases.balls import BALLS
from granular.comparison.measures import BALANCE_LABELS, balance, impact_speed
from granular.laws.kinds import resolved
from granular.md.binary import restitution_or_nan
from granular.run.trajectory import Trajectory, points
from granular.scene import Scene

MAX_POSITIONS = 200_000
"""Maximum number of positions: samples times bodies."""
MAX_SAMPLES, MAX_BODIES, MAX_CONTACTS = 2000, 1024, 20_000
"""Maximum numbers of samples, bodies and single contacts."""
MAP_SIZE = (600, 250)
"""Maximum numbers of columns (time) and rows (pairs or balls) of the maps."""
RUN_POINTS, FLIGHT_POINTS = 200, 8
"""Number of points on curved paths, for the whole run and between contacts."""
SAMPLE_TOLERANCE = 1e-6
"""Tolerance for the reproduction of a sample, relative to the range of the paths."""
MAX_NAMED_BODIES = 10
"""Maximum number of bodies that have the names of real balls in the pictures."""
MAX_LISTED_VALUES = 6
"""Maximum number of values or laws that are listed one by one."""
WALL_NAMES = {"floor and ceiling": "walls at both ends", "floor": "left wall", "ceiling": "right wall"}


def recorded(run: Trajectory, name: str) -> dict[str, Any]:
    """Return the data of the player for a run, ready for JSON.

    Parameters
    ----------
    run : Trajectory
        Run of any scene, engine and length.
    name : str
        Name of the run.
    """
    bodies = evenly_spaced(run.scene.n, MAX_BODIES)
    limit = min(MAX_SAMPLES, max(2, MAX_POSITIONS // len(bodies)))
    contact_rows = evenly_spaced(len(run.contacts), MAX_CONTACTS)
    played = add_samples(run, limit)
    shown = with_samples(played, evenly_spaced(len(played.time), limit))
    return {
        "name": name,
        "engine": "soft" if run.rule is None else "hard",
        "scene": scene_in_words(run.scene),
        "about": about(run),
        "upright": is_upright(run.scene),
        "status": run.status.name,
        "message": run.message,
        "bodies": as_base64(bodies),
        "n": run.scene.n,
        "pairs": run.scene.n_pairs,
        "radius": as_base64(run.scene.radius[bodies]),
        "walls": np.flatnonzero(run.scene.is_wall).tolist(),
        "kinds": kinds(run.scene, bodies),
        "time": as_base64(shown.time, np.float64),
        "span": [float(run.time[0]), float(run.time[-1])],
        "offset": as_base64((run.position[0] - points(with_samples(run, evenly_spaced(1, 1)))[0])[bodies]),
        "path": as_base64(points(shown)[:, bodies]),
        "energy": as_base64(np.nan_to_num(shown.energy(), nan=0.0), np.float64),
        "account": _energy_terms(run),
        "contacts": contacts(run, contact_rows),
        "map": contact_map(run) if len(contact_rows) < len(run.contacts) else None,
        "field": velocity_map(played),
        "whole": {"rows": len(run.time), "contacts": len(run.contacts), "bodies": run.scene.n},
    }


def different_balls(one: Scene, other: Scene) -> str:
    """Return how the balls or forces of two scenes differ, or an empty string.

    Gaps, velocities and positions are ignored.
    """
    if one.n != other.n:
        return f"{one.n} and {other.n} bodies"
    gravity = f"gravity {one.gravity:g} and {other.gravity:g} m/s²"
    forces = (np.zeros(scene.n) if scene.external_force is None else scene.external_force for scene in (one, other))
    differ = {"masses": (one.mass != other.mass).any(), "radii": (one.radius != other.radius).any(),
              gravity: one.gravity != other.gravity, "forces": np.not_equal(*forces).any()}
    return next((name for name, is_so in differ.items() if is_so), "")


def evenly_spaced(n: int, most: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return `most` evenly spaced integers from 0 to n - 1, with first and last.

    If n is smaller than `most`, all n integers are returned.
    """
    return np.unique(np.round(np.linspace(0, n - 1, min(n, most))).astype(np.int64))


def with_samples(run: Trajectory, rows: np.ndarray[Any, np.dtype[np.int64]]) -> Trajectory:
    """Return the run with the samples in `rows` only."""
    names = ("time", "position", "velocity", "gap", "force", "ledger")
    return replace(run, **{name: getattr(run, name)[rows] for name in names if getattr(run, name) is not None})


def _energy_terms(run: Trajectory) -> list[list[str | float]]:
    """Return the finite, nonzero terms of the energy balance in J, with labels.

    The list is empty if no wall exchanges energy with the balls.
    """
    parts = balance(run)
    return [[BALANCE_LABELS[name], parts[name]] for name in ("floor", "ceiling", "heat", "dissipated", "remainder")
            if run.scene.fed and parts[name] and math.isfinite(parts[name])]


def contacts(run: Trajectory, kept: np.ndarray[Any, np.dtype[np.int64]]) -> dict[str, Any]:
    """Return the columns of the contact log for the rows `kept`, each as base64.

    A soft contact without an end ends with the run. Hard contacts have no column "end".
    """
    log = run.contacts[kept]
    before, after = (log[name][:, 1] - log[name][:, 0] for name in ("v_in", "v_out"))
    return {
        "pair": as_base64(log["pair"]),
        "begin": as_base64(log["t_begin"], np.float64),
        "end": as_base64(np.nan_to_num(log["t_end"], nan=run.time[-1]), np.float64) if run.rule is None else None,
        "before": as_base64(before),
        "after": as_base64(np.nan_to_num(after, nan=0.0)),
        "impulse": as_base64(log["impulse"]),
    }


def contact_map(run: Trajectory) -> dict[str, Any]:
    """Return the number of active contacts in each cell of a grid of time and pairs.

    All contacts are counted, also if the log of the page is thinned out.
    """
    start, span = float(run.time[0]), float(run.time[-1] - run.time[0]) or 1.0
    columns, lanes = MAP_SIZE[0], min(MAP_SIZE[1], run.scene.n_pairs)
    log, end = run.contacts, np.nan_to_num(run.contacts["t_end"], nan=run.time[-1])
    lane = log["pair"].astype(np.int64) * lanes // run.scene.n_pairs
    first, last = (np.clip(((t - start) / span * columns).astype(np.int64), 0, columns - 1)
                   for t in (log["t_begin"], end))
    change = np.zeros((columns + 1, lanes), np.int64)
    np.add.at(change, (first, lane), 1)
    np.add.at(change, (last + 1, lane), -1)
    counts = np.cumsum(change, axis=0)[:columns]
    return {"columns": columns, "lanes": lanes, "counts": as_base64(np.minimum(counts, 65535), np.uint16)}


def velocity_map(run: Trajectory) -> dict[str, Any]:
    """Return a map of velocities over balls and time, in 1/127 of the largest one.

    If several balls share a row of the map, the row has the velocity of the fastest one, so that narrow waves are not
    lost. Samples are thinned out evenly.
    """
    rows, balls = evenly_spaced(len(run.time), MAP_SIZE[0]), np.flatnonzero(~run.scene.is_wall)
    lanes = np.arange(min(len(balls), MAP_SIZE[1]))
    velocity = run.velocity[rows][:, balls]
    first = lanes * len(balls) // len(lanes)
    up, down = (extreme.reduceat(velocity, first, axis=1) for extreme in (np.maximum, np.minimum))
    fastest = np.where(up >= -down, up, down)
    peak = float(np.abs(fastest).max(initial=0.0)) or 1.0
    return {"time": as_base64(run.time[rows], np.float64), "rows": len(lanes), "peak": peak, "first": int(balls[0]),
            "last": int(balls[-1]), "values": as_base64(np.rint(fastest * (127.0 / peak)), np.int8)}


def as_base64(values: Any, kind: Any = None) -> str:
    """Return an array as base64 of little-endian numbers.

    Integers are stored as int32 and other numbers as float32, unless the type `kind` is given.
    """
    array = np.asarray(values)
    kind = kind or (np.int32 if array.dtype.kind in "iu" else np.float32)
    little = np.dtype(kind).newbyteorder("<")
    return base64.b64encode(np.ascontiguousarray(array, dtype=little).tobytes()).decode("ascii")


def add_samples(run: Trajectory, most: int) -> Trajectory:
    """Return a hard run with additional samples, in total at most `most`.

    The run is returned unchanged if it is a soft run, has driven walls, or if the samples cannot be reproduced.
    """
    if run.rule is None or run.scene.driven:
        return run
    instants = next((times for times in _sample_times(run) if len(times) + len(run.contacts) <= most), run.time)
    rows = list(_computed_samples(run, instants)) if len(instants) > len(run.time) else []
    if not rows or rows[-1][0] < instants[-1] or not np.array_equal(rows[-1][1], run.position[-1]):
        return run
    time, position, velocity, gap = (np.array(column) for column in zip(*rows, strict=True))
    return replace(run, time=time, position=position, velocity=velocity, gap=gap, ledger=None)


def _sample_times(run: Trajectory) -> Iterator[Array]:
    """Yield alternative sets of times in s for the samples, the densest set first."""
    corners = np.union1d(run.time, np.append(run.contacts["t_begin"], run.stats.get("collapse_time", run.time[-1])))
    scene = run.scene
    if scene.gravity or scene.pendulum or scene.external_force is not None:
        between = corners[:-1, None] + np.diff(corners)[:, None] * np.arange(FLIGHT_POINTS) / FLIGHT_POINTS
        even = np.linspace(corners[0], corners[-1], RUN_POINTS + 1)
        yield np.union1d(np.union1d(corners, between), even)
        yield np.union1d(corners, even)
    yield corners


def _computed_samples(run: Trajectory, instants: Array) -> Iterator[tuple[float, Array, Array, Array]]:
    """Yield time, position, velocity and gap at and just before each instant.

    The values just before an instant are yielded only if a contact begins then. The generator ends early if it does
    not reproduce a sample of the run.
    """
    log, scene, contact_count = run.contacts, run.scene, 0
    tolerance = SAMPLE_TOLERANCE * float(np.ptp(run.position, axis=0).max(initial=0.0))
    row_at = dict(zip(run.time.tolist(), range(len(run.time)), strict=True))
    now, x, v, gap = instants[0], run.position[0], run.velocity[0], run.gap[0]
    rest_time = run.stats.get("collapse_time", math.inf)
    for t in instants.tolist():
        if rest_time <= t and rest_time < run.time[-1]:  # all balls are at rest on a wall
            yield t, run.position[-1] - run.velocity[-1] * (run.time[-1] - t), run.velocity[-1], run.gap[-1]
            continue
        x_next, v = _after_free_flight(scene, x, v, t - now)
        now, x, gap = t, x_next, gap + scene.across(x_next - x)
        if contact_count < len(log) and instants[0] < log["t_begin"][contact_count] <= t:
            yield t, x, v, gap
        v, touching = v.copy(), []
        while contact_count < len(log) and log["t_begin"][contact_count] <= t:
            pair = int(log["pair"][contact_count])
            v[list(scene.bodies(pair))] = log["v_out"][contact_count]
            touching.append(pair)
            contact_count += 1
        if touching:
            gap[touching] = 0.0
        if t in row_at:
            row = row_at[t]
            if np.abs(x - run.position[row]).max() > tolerance:
                return
            x, v, gap = run.position[row], run.velocity[row], run.gap[row]
        yield t, x, v, gap


def _after_free_flight(scene: Scene, x: Array, v: Array, dt: float) -> tuple[Array, Array]:
    """Return positions in m and velocities in m/s after a free flight of `dt` s."""
    if scene.pendulum == 0.0:
        return x + (v + 0.5 * scene.fall * dt) * dt, v + scene.fall * dt
    rest_position, angle = scene.at_rest, scene.pendulum * dt
    y: Any = x - rest_position
    displacement = y * math.cos(angle) + v / scene.pendulum * math.sin(angle)
    return rest_position + displacement, v * math.cos(angle) - scene.pendulum * y * math.sin(angle)


def about(run: Trajectory) -> list[list[str]]:
    """Return names and values that describe a run, as pairs of strings.

    Parameters
    ----------
    run : Trajectory
        Run of any scene and engine.
    """
    scene, balls = run.scene, ~run.scene.is_wall
    return [
        ["law or rule", _laws_text(run)], ["masses, kg", _values_text(scene.mass[balls])],
        ["radii, m", _values_text(scene.radius[balls])], ["gaps at the start, m", _values_text(scene.gap)],
        ["velocities at the start, m/s", _values_text(scene.velocity)],
    ]


def kinds(scene: Scene, bodies: np.ndarray[Any, np.dtype[np.int64]]) -> dict[int, str]:
    """Return the names of the real balls among a few bodies, by body."""
    known = {(ball.mass, ball.radius): name for name, ball in BALLS.items()}
    named = {int(i): known.get((float(scene.mass[i]), float(scene.radius[i])), "") for i in bodies}
    return {i: name for i, name in named.items() if name and len(bodies) <= MAX_NAMED_BODIES}


def is_upright(scene: Scene) -> bool:
    """Whether a scene is drawn upright: with gravity, or with a floor alone."""
    return scene.gravity > 0.0 or bool(scene.is_wall[0] and not scene.is_wall[-1])


def scene_in_words(of: Scene) -> str:
    """Return a description of a scene: balls, ends and forces.

    Without gravity a floor and a ceiling are called walls. A floor alone is called floor.
    """
    text = short_text(str(of)[len("Scene(") : -1])
    if not is_upright(of):
        for named, words in WALL_NAMES.items():
            text = text.replace(named, words)
    return text


def _values_text(values: Array) -> str:
    """Format a few values, one value if all are equal, or their range."""
    low, high = float(values.min()), float(values.max())
    if high - low <= 1e-9 * abs(high):
        return f"{low:.5g}"
    if len(values) <= MAX_LISTED_VALUES:
        return ", ".join(f"{value:.5g}" for value in values)
    return f"{low:.5g} … {high:.5g}"


def _laws_text(run: Trajectory) -> str:
    """Return every different law or rule with its pairs and, for soft contacts, ε.

    ε belongs to an isolated contact at the speed of the first impact.
    """
    laws = run.law if run.rule is None else run.rule
    of_law = pairs_by_law(laws or ())
    eps = _restitutions(run) if run.rule is None else np.full(run.scene.n_pairs, math.nan)
    n = run.scene.n_pairs
    shown = [f"{named_pairs(pairs, n, _names_of_pairs(run.scene))}: " * (len(pairs) < n)
             + short_text(law) + _eps_text(eps[pairs])
             for law, pairs in list(of_law.items())[:MAX_LISTED_VALUES]]
    left_out = len(of_law) - len(shown)
    return "; ".join(shown) + f"; {left_out} more" * (left_out > 0)


def _names_of_pairs(scene: Scene) -> Callable[[int], str]:
    """Return the names of pairs as the pictures have them: balls are counted from 1."""
    return scene.pairs.name if scene.is_wall[0] else lambda pair: f"{pair + 1}–{(pair + 1) % scene.n + 1}"


def _eps_text(values: Array) -> str:
    return "" if np.isnan(values).any() else f", ε = {_values_text(values)}"


def _restitutions(run: Trajectory) -> Array:
    """Return ε of an isolated contact of each pair, (n-1,).

    The approach speed is the speed of the first impact. nan if the contact does not end, or if there are more than
    `MAX_LISTED_VALUES` kinds of pairs.
    """
    laws, speed = resolved(run.law or (), run.scene), impact_speed(run)
    if len(laws.in_pairs[1]) > MAX_LISTED_VALUES or not speed > 0.0:
        return np.full(run.scene.n_pairs, math.nan)
    return np.asarray(laws.column(lambda law: restitution_or_nan(law, speed)))

"""Saved states of hard-sphere runs: saving, restoring and checking a state.

For epoch, tau, window, slice and noise see `granular.edmd.motion`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from granular._engine.check import EDITED_STATE, saved_array
from granular._engine.records import column, record_array
from granular.edmd import wall_state
from granular.edmd.physics import Physics
from granular.edmd.records import PRESENT_NAMES, RELATIVE_FIELDS, RUN_FIELDS, check_entries, check_numbers
from granular.edmd.state import State

PAIR_STATE_FIELDS = ("gap", "at", "closing_acceleration", "contacts", "last", "streak")
BODY_STATE_FIELDS = ("fall_velocity", "is_free", "noise")
"""Names of the fields of pairs and of bodies that change in a run and are saved."""
SAVED_SCALARS = ("start", "epoch", "epoch_low", "length", "window", "speed", "fall", "now",
         "events", "rebases", "zooms", "zoomed", "allowance", "short")
RUN_COUNTS, SLICE_DATA = ("clamps", "merged", "lost", "settled"), ("elapsed", "looked", "ordinary", "clamped", "faint")
"""Names of numbers that are saved as arrays. Earlier releases saved fewer."""
MIN_WINDOW_BITS = -40
"""Binary exponent of the smallest valid window of a saved state.

The unit is the window at the start of the run. Saved windows are shorter than this unit if walls have closed, or if
another release has chosen a shorter window.
"""


def restored_state(physics: Physics, saved: Mapping[str, Any]) -> State:
    """Return the state that `checkpoint` has saved, in this or an earlier release.

    Entries that earlier releases did not save are completed. Without `noise` (bound of the rounding error of a
    velocity, see `granular.edmd.motion`) the bound is 0, and in scenes without walls the velocities at the epoch
    are converted from the frame of the scene to the frame that falls from the start of the run. With fewer
    counters, and not on a ring, the velocity of the frame at the start is subtracted. Raises `ValueError` if the
    state is inconsistent.
    """
    saved = {PRESENT_NAMES.get(name, name): value for name, value in saved.items()}
    check_numbers(saved, physics)
    state = State.of(physics, float(saved["start"]))
    of_pairs, of_bodies = _changing_fields(state)
    check_entries(saved, physics, of_pairs, of_bodies)
    min_window = math.ldexp(float(state.clock.window), MIN_WINDOW_BITS)
    if float(saved["window"]) < min_window:
        raise ValueError(f"'window' in the state of `trajectory` must be at least {min_window!r}, got "
                         f"{saved['window']!r}. {EDITED_STATE}")
    for name in of_pairs:
        state.pairs[name] = saved[name]
    for name in of_bodies:
        state.bodies[name] = saved.get(name, 0.0)
    state.set(**{name: np.asarray(saved[name]).item() for name in SAVED_SCALARS})
    # Not strict: earlier releases saved fewer counters.
    state.set(**dict(zip(RUN_COUNTS, saved["tally"].tolist(), strict=False)))
    state.scale(state.clock.speed)
    if len(saved["tally"]) < len(RUN_COUNTS) and not state.ring:  # saved in the frame of the scene
        state.bodies["fall_velocity"] -= state.clock.frame
    # Saved by a release without the bound of the rounding error of velocities.
    if "noise" not in saved:
        state.bodies["fall_velocity"] += (physics.scene.gravity - state.run.gravity) * state.elapsed(0.0)
    if state.walls is not None:
        for name in wall_state.BALANCE_FIELDS:
            state.walls.sides[name] = saved_array(saved, name, "f", (2,)) if name in saved else 0.0
        wall_state.set_epoch(state)
    if "zoom_gap" in saved:
        slice_numbers = {
            name: RUN_FIELDS[name].type(x).item() for name, x in zip(SLICE_DATA, saved["zoom_dial"], strict=False)
        }
        state.set(first=int(saved["zoom_first"]), began=float(saved["zoom_base"]), **slice_numbers)
        state.near = np.zeros(len(saved["zoom_gap"]), RELATIVE_FIELDS)
        state.near["gap"], state.near["rate"] = saved["zoom_gap"], saved["zoom_rate"]
    if not is_consistent(state):
        raise ValueError(f"The state of `trajectory` is inconsistent with itself or with the scene. {EDITED_STATE}")
    return state


def checkpoint(state: State, run: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """Return all data that are saved in `Trajectory.state`, without copying arrays.

    `run` are the numbers of the state, see `State.numbers`. `options` are further entries, which are added unchanged.
    """
    of_pairs, of_bodies = _changing_fields(state)
    pairs, bodies = record_array(state.pairs), record_array(state.bodies)
    raw: dict[str, Any] = dict(zip(of_bodies, map(bodies.__getitem__, of_bodies), strict=True))
    raw |= zip(of_pairs, map(pairs.__getitem__, of_pairs), strict=True)
    raw |= zip(SAVED_SCALARS, map(run.__getitem__, SAVED_SCALARS), strict=True)
    if state.walls is not None:
        raw |= {name: np.array(column(state.walls.sides, name)) for name in wall_state.BALANCE_FIELDS}
    raw["tally"] = np.array(list(map(run.__getitem__, RUN_COUNTS)))
    if state.near is not None:
        raw |= {"zoom_first": np.array(run["first"]), "zoom_base": np.array(run["began"])}
        raw["zoom_dial"] = np.array([run[name] for name in SLICE_DATA], dtype=np.float64)
        raw |= {f"zoom_{name}": column(state.near, name) for name in ("gap", "rate")}
    return raw | options


def _changing_fields(state: State) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the saved fields of pairs, and of the fields of bodies."""
    if state.hung:
        return (*PAIR_STATE_FIELDS, "rate"), (*BODY_STATE_FIELDS, "sway")
    if state.walls is not None:
        return (*PAIR_STATE_FIELDS, "wall", "stuck"), (*BODY_STATE_FIELDS, "force_acceleration")
    return PAIR_STATE_FIELDS, BODY_STATE_FIELDS


def is_consistent(state: State) -> bool:
    """Return whether the records are consistent with each other and possible in a run."""
    run, clock, pairs, bodies = state.run, state.clock, record_array(state.pairs), record_array(state.bodies)
    wall, has_collided, last = np.isinf(bodies["mass"]), pairs["contacts"] > 0, pairs["last"]
    return bool(all([
        len(bodies) == len(pairs) + 1 == run.pairs + 1,
        (pairs["gap"] >= 0.0).all(),
        (pairs["at"] <= max(run.now, 0.0)).all(),
        state.walls is not None or (pairs["closing_acceleration"] == run.gravity * np.diff(bodies["is_free"])).all(),
        state.walls is None or wall_state.rests_soundly(state, pairs, bodies),
        has_collided[np.isfinite(last)].all() and (last <= run.now).all() and pairs["contacts"].sum() == run.events,
        not bodies["is_free"][wall].any() and (bodies["noise"] >= 0.0).all(),
        state.walls is not None or not bodies["noise"][wall].any(),
        not state.ring or state.near is not None  # the gaps of a slice are in `near`
        or abs(float(state.row(max(run.now, 0.0))[1].sum()) - run.gap_sum) <= 1e-12 * run.gap_sum,
        not state.ring or bodies["fall_velocity"][0] == bodies["fall_velocity"][-1],
        # The window is a power of two.
        math.frexp(clock.window)[0] == 0.5 and 0.0 <= clock.fall <= clock.speed,
    ]))

"""Many scenes in one compiled call: what the located engine would give one by one, bit for bit."""

from __future__ import annotations

import inspect
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from granular import md
from granular import until as stop
from granular._check import Array
from granular._kernels import compiled, have_numba, in_memory, kernel
from granular.laws.contact_law import resolve
from granular.md.located.batch import reset, scene_rows, workspace
from granular.md.located.build import power_form
from granular.md.located.loop import (
    BINDING,
    MORE,
    QUIET,
    REACHED,
    REST,
    STOPPED,
    WORK,
    advance,
    clear_log,
    gather,
    is_begun,
    launch,
    pause_later,
)
from granular.md.located.readout import look
from granular.md.located.records import ACTIVE, LINEAR
from granular.md.located.run import FIRST_LOOK
from granular.scene import Scene, velocities
from granular.sweeps.results import CODE, effective

FAST = {"contacts", "v_rel", "t_f", "duration", "v_final", "time", "eps_eff", "eps_ratio"}
"""Results that the compiled way gives."""
CHUNK = 20_000
DEFAULTS = {name: one.default for name, one in inspect.signature(md.simulate).parameters.items()}

WHY, TIME, LAUNCHED, HEAD = 0, 1, 2, 3
COUNT, ONGOING, T_F, LOWER, UPPER, LONGEST, RATE, PER_PAIR = range(8)
"""A row of output: three numbers of the run, then these of each pair."""


def open_to(asked: Sequence[Any], run: Any) -> bool:
    """Whether the compiled way gives all that is asked."""
    return have_numba() and not run and all(isinstance(ask, str) and ask in FAST for ask in asked)


def at_hand() -> bool:
    """Whether the machine code is in memory."""
    return in_memory(solve_cells)


def coefficients(scene: Scene, laws: Sequence[Any]) -> list[list[float]] | None:
    """(k, p, γ, d) of every pair, or None if a law is no power law."""
    forms = [power_form(resolve(law, pair)) for law, pair in zip(laws, scene.pairs, strict=True)]
    return None if None in forms else [list(form) for form in forms if form is not None]


def solve(scenes: Sequence[Scene], which: Any, law: Array, until: stop.Until | None, t_end: Array) -> Array:
    """Run one scene per entry of `which`, an index into `scenes`; laws (S, n-1, 4), end times (S,).

    Returns
    -------
    (S, 3 + 7 (n-1)) array
        Rows as told at the top of this module.
    """
    mass, gap, velocity, gravity = (
        np.array([getattr(s, name) for s in scenes])[which] for name in ("mass", "gap", "velocity", "gravity")
    )
    table, p = scene_rows(mass, gap, velocity, law, gravity)
    s = workspace(p, until, *(DEFAULTS[name] for name in ("tol", "max_events", "max_steps")))
    out = np.zeros((len(table), HEAD + PER_PAIR * p))
    compiled(solve_cells)(s, table, t_end, out, np.zeros((3, p)))
    return out


def answers(out: Array, scenes: Sequence[Scene], which: Any, t_end: Array, impact: Array, eps: Array) -> dict[str, Any]:
    """Results by name from the rows of `solve`, with impact speed and ε_spec of each cell; `ongoing`, `creeps`."""
    pairs = out[:, HEAD:].reshape(len(out), -1, PER_PAIR)
    ongoing = pairs[..., ONGOING] != 0.0
    v_rel = np.where(ongoing, math.nan, pairs[..., UPPER] - pairs[..., LOWER])
    eps_eff = effective(v_rel[:, -1], impact)
    return {
        "status": _status(out, t_end),
        "contacts": pairs[..., COUNT].astype(np.int64),
        "v_rel": v_rel,
        "t_f": np.where(ongoing, math.nan, pairs[..., T_F]),
        "duration": pairs[..., LONGEST],
        "v_final": _final_velocities(scenes, which, pairs[..., RATE], out[:, TIME]),
        "time": out[:, TIME],
        "eps_eff": eps_eff,
        "eps_ratio": eps_eff / eps,
        "ongoing": ongoing.any(axis=1),
        "creeps": out[:, WHY] == MORE,
    }


def _status(out: Array, t_end: Array) -> Any:
    """Status codes: the words of `granular.md.located.run`."""
    why = out[:, WHY].astype(np.int64)
    words = {STOPPED: "until", QUIET: "quiet", WORK: "max_events", REST: "resting", BINDING: "quiet", REACHED: "time"}
    table = np.array([CODE[words.get(code, "until")] for code in range(max(words) + 1)])
    code = np.where(out[:, LAUNCHED] != 0.0, table[np.maximum(why, 0)], CODE["until"])
    return np.where((why == QUIET) & (t_end < math.inf), CODE["time"], code)


def _final_velocities(scenes: Sequence[Scene], which: Any, rate: Array, time: Array) -> Array:
    """Velocities of all bodies, as `granular.scene.velocities` finds them."""
    if all(scene.is_wall[0] for scene in scenes):
        floor = np.array([scene.velocity[0] for scene in scenes])[which]
        offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
        anchored: Array = (floor - offset[:, 0])[:, None] + offset
        return anchored
    rows = [velocities(scenes[i], r[None], t[None]) for i, r, t in zip(which, rate, time, strict=True)]
    return np.concatenate(rows)


@kernel
def solve_cells(s: Any, table: Any, t_end: Any, out: Any, scratch: Any) -> None:
    """Solve every scene of `table` in the workspace `s`, from start to end."""
    n = len(s.pairs)
    for i in range(len(table)):
        reset(s, table[i])
        row = out[i]
        for c in range(n):
            at = HEAD + PER_PAIR * c
            row[at + T_F], row[at + LOWER], row[at + UPPER] = math.nan, math.nan, math.nan
            row[at + LONGEST] = math.nan
        why, row[LAUNCHED] = MORE, 1.0
        if not launch(s, None):
            why, row[LAUNCHED] = STOPPED, 0.0
        harvest(s, row)
        s.run[0].pause = FIRST_LOOK
        while why == MORE and not may_creep(s):
            if s.run[0].steps >= s.run[0].pause:
                pause_later(s)
            why = advance(s, t_end[i], CHUNK, None)
            harvest(s, row)
        row[WHY] = why
        row[TIME] = t_end[i] if why == REACHED or (why == QUIET and t_end[i] < math.inf) else s.run[0].t
        finish(s, n, row, scratch)


@kernel
def may_creep(s: Any) -> bool:
    """Return whether a run by itself would now look whether a pile creeps, and go on by its modes; left to that."""
    if s.run[0].steps < s.run[0].pause or s.bodies[0].inverse_mass > 0.0 or s.pairs[0].slot < 0:
        return False
    first = s.pool[s.pairs[0].slot]
    return bool(first.mode == ACTIVE and first.kind == LINEAR and first.gamma > 0.0)


@kernel
def harvest(s: Any, row: Any) -> None:
    """Take what is asked out of the log."""
    for i in range(s.run[0].rows):
        contact = s.log[i]
        at = HEAD + PER_PAIR * contact.pair
        row[at + T_F], row[at + LOWER], row[at + UPPER] = contact.t_end, contact.lower_out, contact.upper_out
        if not row[at + LONGEST] >= contact.duration:
            row[at + LONGEST] = contact.duration
    clear_log(s)


@kernel
def finish(s: Any, n: int, row: Any, scratch: Any) -> None:
    """Note counts, contacts still running and final rates."""
    t = row[TIME]
    gather(s, t, None)
    look(s, t, scratch[0], scratch[1], scratch[2])
    for c in range(n):
        at = HEAD + PER_PAIR * c
        row[at + COUNT], row[at + ONGOING] = s.pairs[c].count, is_begun(s, c)
        row[at + RATE] = -scratch[1, c]

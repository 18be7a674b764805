"""Many cells in one compiled call: what the located engine would give one by one, bit for bit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from granular import until as stop
from granular._check import Array
from granular._kernels import have_numba, in_memory
from granular.laws.contact_law import Form, resolve
from granular.md.located import Scenes, solve_many, solve_rows
from granular.scene import Scene, velocities
from granular.sweeps.results import effective

FAST = {"contacts", "v_rel", "t_f", "duration", "v_final", "time", "eps_eff", "eps_ratio"}
"""Results that the compiled way gives."""
KERNEL = solve_rows
"""What has to be compiled for it."""


def open_to(asked: Sequence[Any], run: Any) -> bool:
    """Whether the compiled way gives all that is asked."""
    return have_numba() and not run and all(isinstance(ask, str) and ask in FAST for ask in asked)


def at_hand() -> bool:
    """Whether the machine code is in memory."""
    return in_memory(KERNEL)


def coefficients(scene: Scene, laws: Sequence[Any]) -> list[Form] | None:
    """(k, p, γ, d) of every pair, or None if a law is no power law."""
    forms = [resolve(law, pair).form for law, pair in zip(laws, scene.pairs, strict=True)]
    return None if None in forms else [form for form in forms if form is not None]


def answers(
    scenes: Sequence[Scene], which: Any, law: Array, until: stop.Until | None, t_end: Array, impact: Array, eps: Array
) -> dict[str, Any]:
    """Run one scene per entry of `which`, an index into `scenes`, and return results by name.

    Parameters
    ----------
    law : (S, n-1, 4) array
        Coefficients of the laws.
    until, t_end : stop condition, (S,) array
        When to stop; inf for no end time.
    impact, eps : (S,) arrays
        Impact speed in m/s and ε_spec.

    Returns
    -------
    dict
        Arrays by the names of results; `status` is -1 where a run is left to go by itself. Also `ongoing`.
    """
    mass, gap, velocity, gravity = (
        np.array([getattr(s, name) for s in scenes])[which] for name in ("mass", "gap", "velocity", "gravity")
    )
    many = solve_many(Scenes(mass, gap, velocity, law, gravity), until=until, t_end=t_end)
    v_rel = np.where(many.ongoing, math.nan, many.v_upper - many.v_lower)
    eps_eff = effective(v_rel[:, -1], impact)
    return {
        "status": many.status,
        "contacts": many.counts,
        "v_rel": v_rel,
        "t_f": np.where(many.ongoing, math.nan, many.t_end),
        "duration": many.longest,
        "v_final": _final_velocities(scenes, which, many.rate, many.time),
        "time": many.time,
        "eps_eff": eps_eff,
        "eps_ratio": eps_eff / eps,
        "ongoing": many.ongoing.any(axis=1),
    }


def _final_velocities(scenes: Sequence[Scene], which: Any, rate: Array, time: Array) -> Array:
    """Velocities of all bodies, as `granular.scene.velocities` finds them."""
    if all(scene.is_wall[0] for scene in scenes):
        floor = np.array([scene.velocity[0] for scene in scenes])[which]
        offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
        return np.asarray((floor - offset[:, 0])[:, None] + offset)
    rows = [velocities(scenes[i], r[None], t[None]) for i, r, t in zip(which, rate, time, strict=True)]
    return np.concatenate(rows)

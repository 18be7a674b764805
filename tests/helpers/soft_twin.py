"""The engine without isolated contacts: every contact by pieces, which is what the certified ones are held against."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import granular as gr
from granular._engine.kernels import kernel, specialised
from granular.md.located import blocks
from granular.md.located.records import BY_PIECES


@kernel
def never(s: Any, c: int) -> int:
    """No contact is isolated."""
    return BY_PIECES


WITHOUT = specialised(blocks.advance, solve_as_one_event=never)


@contextlib.contextmanager
def pieces() -> Iterator[None]:
    """Let all contacts be solved by pieces."""
    was, blocks.advance = blocks.advance, WITHOUT
    try:
        yield
    finally:
        blocks.advance = was


def twin(scene: gr.Scene, law: Any, **options: Any) -> gr.Trajectory:
    """Run by pieces."""
    with pieces():
        return gr.md.simulate(scene, law, **options)


def distance(a: gr.Trajectory, b: gr.Trajectory, unit: float = 1.0) -> float:
    """Largest difference of a velocity in the logs; inf if the contacts are not the same. `unit` is that of `a`."""
    one, other = (np.sort(run.contacts, order=["pair", "t_begin"]) for run in (a, b))
    if [*one["pair"]] != [*other["pair"]] or [*np.isnan(one["t_end"])] != [*np.isnan(other["t_end"])]:
        return math.inf
    off = np.abs(np.concatenate([(one[name] / unit - other[name]).ravel() for name in ("v_in", "v_out")]))
    return float(np.max(off[~np.isnan(off)], initial=0.0))


def nudged(rng: Any, scene: gr.Scene) -> gr.Scene:
    """Gaps and velocities moved by one ulp or none; what is exactly zero stays."""

    def moved(x: Any) -> Any:
        way = rng.choice([-math.inf, 0.0, math.inf], len(x))
        return np.where((x == 0.0) | (way == 0.0), x, np.nextafter(x, way))

    return gr.Scene(scene.mass, scene.radius, moved(scene.gap), moved(scene.velocity), scene.gravity)


def in_other_units(scene: gr.Scene, laws: Any, unit: float) -> tuple[gr.Scene, tuple[Any, ...]]:
    """The same motion with lengths in other units: other roundings all the way, not only of the start."""
    each = []
    for law in laws:
        linear = type(law).__name__ in ("LinearDashpot", "WaltonBraun")
        p = 1.0 if linear else getattr(law, "exponent", 1.5)
        new = {"k": law.k * unit ** (1.0 - p)} if p != 1.0 else {}
        if type(law).__name__ == "ViscoelasticHertz":
            new["gamma"] = law.gamma * unit**-0.5
        each.append(replace(law, **new))
    lengths = (unit * x for x in (scene.radius, scene.gap, scene.velocity))
    return gr.Scene(scene.mass, *lengths, unit * scene.gravity), tuple(each)

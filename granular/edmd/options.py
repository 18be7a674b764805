"""The options that change the physics: checked each and together, saved and restored."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from granular import _check
from granular.edmd.model import Model, scales
from granular.edmd.ties import ORDER
from granular.rules import Rule
from granular.scene import Scene

REMEDIES = ("stop", "merge")


def model(
    scene: Scene,
    rules: tuple[Rule, ...],
    *,
    ties: str,
    seed: int,
    collapse: str,
    merge_below: float | None,
    tc: float,
    elastic_below: float,
) -> Model:
    """Return the physics of a run, or raise what is wrong with an option."""
    merging = _check.choice("collapse", collapse, REMEDIES) == "merge"
    if merge_below is not None and not merging:
        raise ValueError(f"merge_below is {merge_below!r}: it needs collapse='merge'.")
    below = 0.0
    if merging:
        known = merge_below is not None
        below = _check.number("merge_below", merge_below, above=0.0) if known else 0.01 * scales(scene)[0]
    made = Model(
        scene,
        rules,
        _check.choice("ties", ties, tuple(ORDER)),
        _check.whole("seed", seed),
        below,
        _check.number("tc", tc, at_least=0.0),
        _check.number("elastic_below", elastic_below, at_least=0.0),
    )
    if made.sticks:
        made = Model(scene, rules, made.ties, made.seed, math.inf, made.tc, made.elastic_below)
    _check_ties(made)
    _check_remedies(made)
    return made


def saved(model: Model) -> dict[str, Any]:
    """Return the options as plain values for `Trajectory.state`."""
    return {name: getattr(model, name) for name in ("ties", "seed", "merge_below", "tc", "elastic_below")}


def restored(scene: Scene, rules: tuple[Rule, ...], state: Mapping[str, Any]) -> Model:
    """Return the physics of the run that `saved` its options in `state`."""
    kinds = {"ties": str, "seed": int, "merge_below": float, "tc": float, "elastic_below": float}
    return Model(scene, rules, **{name: kind(state[name]) for name, kind in kinds.items()})


def _check_ties(model: Model) -> None:
    if model.ties in ("newton", "reflect") and (model.rule is not None or model.eps.min() < model.eps.max()):
        why = "different ones can multiply the energy" if model.ties == "newton" else "others have no meaning"
        raise ValueError(f"ties is {model.ties!r}: one constant restitution for all pairs is needed ({why}); "
                         "use ties='poisson'.")  # fmt: skip
    if model.solver is not None and (model.merge_below > 0.0 or model.tc > 0.0 or model.elastic_below > 0.0):
        raise ValueError(f"ties is {model.ties!r}: groups solved as a whole do not go with sticking balls, "
                         "collapse='merge', tc= or elastic_below=; use ties='left'.")  # fmt: skip


def _check_remedies(model: Model) -> None:
    named = [name for name in ("merge_below", "tc", "elastic_below") if getattr(model, name) > 0.0]
    if len(named) > 1:
        names = " and ".join("sticking or collapse='merge'" if name == "merge_below" else name for name in named)
        raise ValueError(f"{names} are given together: one remedy at a time is needed.")
    some = np.flatnonzero(model.eps == 0.0)
    if len(some) and not model.sticks:
        raise ValueError(f"restitution of pair {some[0]} is 0.0 but not of all pairs: 0 means balls that stick, "
                         "for all pairs or none; use a small number, such as 0.01.")  # fmt: skip

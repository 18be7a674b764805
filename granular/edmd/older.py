"""Runs saved before velocities had noise: what their state is called now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from granular.edmd.model import felt_gravity
from granular.scene import Scene


def updated(saved: Mapping[str, Any], scene: Scene) -> Mapping[str, Any]:
    """Return the state of a run of `scene` as it is saved now.

    A state without `noise` is older: its velocities were taken to be exact, and free-fall velocities were those of the
    epoch in scenes without walls too, whose frame now falls from the start on.
    """
    if "noise" in saved:
        return saved
    u = np.asarray(saved["u"])
    fallen = (scene.gravity - felt_gravity(scene)) * ((saved["epoch"] - saved["start"]) + saved["epoch_low"])
    return dict(saved) | {"u": u + fallen, "noise": np.zeros_like(u)}

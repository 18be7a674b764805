"""The setting that all figures of the paper share; what the paper leaves open is chosen here.
May be skipped: figures of the paper, beside the engines.

R1 = 0.1 m, R2 = 0.01 m, k = 5e7 N/m, Δh = 1e-4 m, z1 = 0.6 m (the centre of the lower ball, held as R1 varies),
g = 9.81 m/s² and ρ = 900 kg/m³, which makes all of the paper's observations true. Times count from the first contact
of the lower ball and the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from granular import md, until
from granular._check import Array
from granular._flight import time_to_contact
from granular.laws import LinearDashpot
from granular.laws.hertz import hertz_stiffness
from granular.scene import Scene
from granular.trajectory import Trajectory

STIFFNESS = 5e7
SECOND_FLOOR_CONTACT = until.contact(pair=0, nth=2)
YOUNG, POISSON = 5e7, 0.45
"""Of viscoelastic balls, the first in Pa."""


def dashpots(scene: Scene, restitution: float) -> list[LinearDashpot]:
    """Linear dashpots of one ε in all contacts."""
    return [LinearDashpot.from_restitution(restitution, k=STIFFNESS, pair=pair) for pair in scene.pairs]


def hertz(scene: Scene) -> list[float]:
    """Stiffness of viscoelastic balls in N/m^(3/2) in all contacts."""
    return [hertz_stiffness(YOUNG, POISSON, pair) for pair in scene.pairs]


def first_touch(scene: Scene) -> float:
    """Time in s at which the lower ball meets the floor."""
    rate = float(scene.velocity[1] - scene.velocity[0])
    return time_to_contact(float(scene.gap[0]), rate, scene.gravity)


def until_second_floor_contact(scene: Scene, law: Sequence[Any]) -> Trajectory:
    """The soft-sphere run whose contacts the paper counts."""
    return md.simulate(scene, law, until=SECOND_FLOOR_CONTACT)


def intervals(run: Trajectory) -> Array:
    """Onset and end in s of the contacts of the two balls, from the first floor contact on; (count, 2)."""
    log, start = run.of(1), first_touch(run.scene)
    return np.column_stack([log["t_begin"] - start, log["t_end"] - start])

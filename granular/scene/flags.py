"""What a scene has that not every scene has: the flags by which kernels are made to fit it.
May be skipped: a plain scene has none.

Kernels read them as global names, `if DRIVEN: …`; `fitted(kernel, **flags(scene))` of `granular._kernels` makes the
twin in which those of the scene hold, and the compiler drops the branches of all others. They are declared here alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granular.scene.state import Scene

DRIVEN: bool = False
"""A wall moves."""
HEATED: bool = False
"""A wall is thermal: balls leave it with a speed drawn at its temperature."""
WORKED: bool = False
"""A wall moves or is thermal: it does work on the balls, or heats them, and an account of energy is kept."""
FORCED: bool = False
"""As `WORKED`, or constant forces act on balls: not all of them fall alike."""
HUNG: bool = False
"""Balls are pendula."""
RING: bool = False
"""Balls stand on a ring; the last one touches the first."""


def flags(scene: Scene) -> dict[str, bool]:
    """Return the flags that hold for a scene, each `True`."""
    worked = scene.driven or scene.heated
    given = {"DRIVEN": scene.driven, "HEATED": scene.heated, "WORKED": worked, "HUNG": scene.pendulum > 0.0,
             "FORCED": worked or scene.external_force is not None, "RING": scene.ring}
    return {name: True for name, holds in given.items() if holds}

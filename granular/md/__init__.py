"""Soft spheres: Newton's equation with a contact force, `simulate(scene, law, ...) -> Trajectory`.
May be skipped: names of the package only.
"""

from typing import TYPE_CHECKING

from granular._engine.lazy import attributes

if TYPE_CHECKING:
    from granular.md.simulation import events, resume, simulate

__all__ = ["events", "resume", "simulate"]
__dir__ = __all__.copy
__getattr__ = attributes(__name__, {
    "granular.md.simulation": "events resume simulate",
})

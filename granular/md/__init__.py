"""Soft spheres: contact forces, with a fixed time step or with located events.

`simulate` runs a scene, `resume` continues a run, and `events` yields the contacts of a run.

Start with: `fixed/`, `located/`.
Support modules: `binary`, `isolation`, `oblique_impact`, `simulation`, `time_step`, `waves/`.
"""

from typing import TYPE_CHECKING

from granular._engine.package import attributes

if TYPE_CHECKING:
    from granular.md.simulation import events, resume, simulate

__all__ = ["events", "resume", "simulate"]
__dir__ = __all__.copy
__getattr__ = attributes(__name__, {
    "granular.md.simulation": "events resume simulate",
})

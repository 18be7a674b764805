"""Soft spheres with a fixed time step, as in DEM codes.

Start with: `integrators`.
Support modules: `abreast`, `contact_force`, `ending`, `march`, `notes`, `run`, `stepper`, `walls`, `window`.
"""

from granular.md.fixed.integrators import INTEGRATORS
from granular.md.fixed.run import Run

__all__ = ["INTEGRATORS", "Run"]

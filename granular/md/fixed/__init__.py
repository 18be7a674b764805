"""Soft spheres with a fixed time step, as DEM codes do it.
May be skipped: names of the package only.
"""

from granular.md.fixed.integrators import INTEGRATORS
from granular.md.fixed.run import Run

__all__ = ["INTEGRATORS", "Run"]

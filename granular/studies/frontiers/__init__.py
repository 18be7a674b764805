"""Error against run time for one scene: `frontier(scene, law) -> Frontier`, the work-precision diagram.
May be skipped: it measures ourselves.
"""

from granular.studies.frontiers.result import Frontier, Row
from granular.studies.frontiers.run import frontier

__all__ = ["Frontier", "Row", "frontier"]

"""`frontier`: error against run time of every method on one scene.

A first reader may skip: `methods`, `result`, `run`.
"""

from granular.studies.frontiers.result import Frontier, Row
from granular.studies.frontiers.run import frontier

__all__ = ["Frontier", "Row", "frontier"]

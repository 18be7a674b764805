"""`threshold`: the parameter range in which a scene may be event-driven.

A first reader may skip: `result`, `run`.
"""

from granular.studies.thresholds.result import Crossing, Threshold, Value
from granular.studies.thresholds.run import threshold

__all__ = ["Crossing", "Threshold", "Value", "threshold"]

"""`threshold`: from which gap, stiffness, … on may a scene be event-driven?
May be skipped: many runs of the same engines.

============  ========================================================================================================
`criteria`    what is asked of one value: is every contact isolated, or the error small?
`run`         `threshold` itself: a grid of values, and bisection of every change
`result`      `Threshold`: crossings, and where hard spheres hold, in words and as a figure
============  ========================================================================================================
"""

from granular.thresholds.criteria import Value
from granular.thresholds.result import Crossing, Threshold
from granular.thresholds.run import threshold

__all__ = ["Crossing", "Threshold", "Value", "threshold"]

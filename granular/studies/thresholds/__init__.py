"""`threshold`: from which gap, stiffness, … on may a scene be event-driven?
May be skipped: many runs of the same engines.

=============  =======================================================================================================
`run`          `threshold` itself: a grid of values, and bisection of every change
`result`       what is asked of one value: is every contact isolated, or the error small? `Threshold`: crossings, and
               where hard spheres hold, in words and as a figure
=============  =======================================================================================================
"""

from granular.studies.thresholds.result import Crossing, Threshold, Value
from granular.studies.thresholds.run import threshold

__all__ = ["Crossing", "Threshold", "Value", "threshold"]

"""`sweep`: any parameter of a scene × any other × any result, as an `xarray.Dataset`.
May be skipped: many runs of the same engines.

=============  =====================================================================================================
`axes`         what is varied: values, and their text form ``0.3:1:300:log``
`subject`      what is swept: a ready-made case, a function, a file, a `Case`; its parameters by name
`plan`         what is asked of every cell, as a value that travels to other processes
`results`      what can be asked, with dimensions and units, of one cell or of many
`answers`      results as they come in
`many`         many cells in one compiled call
`schedule`     batches, on this process or on any ``concurrent.futures.Executor``
`store`        the data set, its file, and how an interrupted sweep goes on
`refine`       boundaries between contact counts, by bisection
`run`          `sweep` itself
=============  =====================================================================================================
"""

from granular.sweeps.axes import axis
from granular.sweeps.run import sweep

__all__ = ["axis", "sweep"]

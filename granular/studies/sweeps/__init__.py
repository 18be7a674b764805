"""`sweep`: any parameter of a scene × any other × any result, as an `xarray.Dataset`;
`sensitivity`: what outcomes answer to.
May be skipped: many runs of the same engines.

===============  =====================================================================================================
`subject`        what is swept: a ready-made case, a function, a file, a `Case`; its parameters by name; what is varied:
                 values, and their text form ``0.3:1:300:log``
`results`        what can be asked, with dimensions and units, of one cell or of many; answers as they come in
`plan`           what is asked of every cell, as a value that travels to other processes; the data set, and its file
`schedule`       batches, on this process or on any ``concurrent.futures.Executor``; many cells in one compiled call
`run`            `sweep` itself; boundaries between contact counts, by bisection
`gradients`      derivatives by one parameter or many, condition numbers, what is uncertain: as numbers and as a table
`sensitivities`  `sensitivity`, which finds them
`ensembles`      both engines over many draws: do their means agree?
===============  =====================================================================================================
"""

from granular.studies.sweeps.ensembles import Ensemble, Quantity, ensemble
from granular.studies.sweeps.gradients import Sensitivity
from granular.studies.sweeps.run import sweep
from granular.studies.sweeps.sensitivities import sensitivity
from granular.studies.sweeps.subject import axis

__all__ = ["Ensemble", "Quantity", "Sensitivity", "axis", "ensemble", "sensitivity", "sweep"]

"""`sweep`, `sensitivity` and `ensemble`: outcomes over parameters.

A cell of a sweep is one combination of parameter values. Each cell is a separate run.

Support modules: `derivatives`, `ensembles`, `executors`, `plan`, `results`, `run`, `schedule`, `sensitivities`,
`sensitivity_report`, `subject`.
"""

from granular.studies.sweeps.ensembles import Ensemble, Quantity, ensemble
from granular.studies.sweeps.run import sweep
from granular.studies.sweeps.sensitivities import sensitivity
from granular.studies.sweeps.sensitivity_report import Sensitivity
from granular.studies.sweeps.subject import axis

__all__ = ["Ensemble", "Quantity", "Sensitivity", "axis", "ensemble", "sensitivity", "sweep"]

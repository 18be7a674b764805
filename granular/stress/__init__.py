"""Stiff and extreme cases: does each method survive, and does it say so when it does not?
May be skipped: it measures ourselves.

>>> import granular as gr
>>> print(gr.stability(quick=True))                # doctest: +SKIP
"""

from granular.stress.report import StabilityReport
from granular.stress.study import AXES, stability

__all__ = ["AXES", "StabilityReport", "stability"]

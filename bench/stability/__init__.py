"""Stiff and extreme cases: does each method survive, and does it say so when it does not?

``python -m bench.stability [--quick] [--json FILE] [AXIS ...]``; docs/stability.md is the page it makes.
"""

from bench.stability.report import StabilityReport
from bench.stability.study import AXES, stability

__all__ = ["AXES", "StabilityReport", "stability"]

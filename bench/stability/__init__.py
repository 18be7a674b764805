"""Stiff and extreme cases: is a method right, and is a wrong result flagged?

``python -m bench.stability [--quick] [--json FILE] [AXIS ...]`` writes docs/guide/stability.md.
"""

from bench.stability.report import StabilityReport
from bench.stability.study import AXES, stability

__all__ = ["AXES", "StabilityReport", "stability"]

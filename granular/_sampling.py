"""The times at which a run keeps rows, checked once for both engines."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from granular import _check
from granular._check import Array


def sample_times(samples: int | ArrayLike | None, start: float, end: float) -> Array | None:
    """Return the times of the rows in s, or None for the first and the last.

    Raises
    ------
    TypeError, ValueError
        If there is no time, or one outside [start, end], or one before its predecessor; if a number of rows is asked
        for without an end.
    """
    if samples is None:
        return None
    if np.ndim(samples) == 0:
        count = _check.whole("samples", samples, at_least=2, fix="give None for the first and the last row")
        if end == math.inf:
            raise ValueError(f"samples is {count}: a number of rows needs t_end; give t_end, or the times themselves.")
        return np.linspace(start, end, count)
    times = _check.array("samples", samples)
    if len(times) == 0:
        raise ValueError("samples is empty: at least one time is needed; give None for the first and the last row.")
    inside = (times >= start) & (times <= end) & np.isfinite(times)
    _check.every("samples", times, inside, f"a time from {start:g} to {end:g} s is needed")
    _check.every("samples", times[1:], np.diff(times) >= 0.0, "times must not decrease", "sort them")
    return times

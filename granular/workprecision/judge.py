"""The error of a run against the reference: velocities, contact times, number of contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from granular.reference import Reference, ReferenceContact
from granular.trajectory import Trajectory


def contacts_of(run: Trajectory) -> tuple[ReferenceContact, ...]:
    """The contact log of a trajectory in the form of the reference's."""
    rows = []
    for row in run.contacts:
        ended = not math.isnan(float(row["v_out"][0]))
        v_in, v_out = ((float(v[0]), float(v[1])) for v in (row["v_in"], row["v_out"]))
        out = (float(row["t_end"]), v_out) if ended else (None, None)
        rows.append(ReferenceContact(int(row["pair"]), float(row["t_begin"]), v_in, *out))
    return tuple(rows)


def errors(truth: Reference, contacts: Sequence[ReferenceContact], pairs: int) -> tuple[float, float, bool]:
    """Error of velocities, error of times, and whether a number of contacts is wrong; see `Row`."""
    each = [(truth.of(c), [row for row in contacts if row.pair == c]) for c in range(pairs)]
    velocity = float(np.max([_velocity_error(true, got) for true, got in each])) / truth.impact_speed  # nan if one is
    if any(len(true) != len(got) for true, got in each):
        return velocity, math.nan, True
    time = max((_time_error(a, b) for true, got in each for a, b in zip(true, got, strict=True)), default=0.0)
    return velocity, time / max(truth.durations, default=math.nan), False


def _velocity_error(true: Sequence[ReferenceContact], got: Sequence[ReferenceContact]) -> float:
    """Largest difference in m/s at the end of the last contact that ended; nan if only one of them has such."""
    last = [next((row.v_out for row in reversed(rows) if row.v_out is not None), None) for rows in (true, got)]
    if None in last:
        return 0.0 if last[0] is last[1] else math.nan
    return max(float(abs(a - b)) for a, b in zip(*last, strict=True))


def _time_error(true: ReferenceContact, got: ReferenceContact) -> float:
    times = ((true.t_begin, got.t_begin), (true.t_end, got.t_end))
    return max(float(abs(a - b)) for a, b in times if a is not None and b is not None)

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
    velocity = float(np.max([_velocity_error(_last_ended(true), _last_ended(got)) for true, got in each]))  # nan if one
    if any(len(true) != len(got) for true, got in each):
        return velocity / truth.impact_speed, math.nan, True
    time = max((_time_error(a, b) for true, got in each for a, b in zip(true, got, strict=True)), default=0.0)
    return velocity / truth.impact_speed, time / max(truth.durations, default=math.nan), False


def _last_ended(rows: Sequence[ReferenceContact]) -> ReferenceContact | None:
    return next((row for row in reversed(rows) if row.t_end is not None), None)


def _velocity_error(true: ReferenceContact | None, got: ReferenceContact | None) -> float:
    if true is None or got is None:
        return 0.0 if true is got else math.nan
    return max(float(abs(a - b)) for a, b in zip(true.v_out, got.v_out, strict=True))


def _time_error(true: ReferenceContact, got: ReferenceContact) -> float:
    begin = float(abs(true.t_begin - got.t_begin))
    if true.t_end is None or got.t_end is None:
        return begin
    return max(begin, float(abs(true.t_end - got.t_end)))

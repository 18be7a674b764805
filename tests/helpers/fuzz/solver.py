"""The independent solver: a scene and its laws, in one of the arithmetics, to a log, samples and a status."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.helpers.fuzz import contacts, motion, state
from tests.helpers.fuzz.arithmetic import DOUBLE, Arithmetic, build, functions
from tests.helpers.fuzz.steps import ACTIVE

WHY = ("time", "until", "quiet", "touch", "tired")
ROWS = 2000


@dataclass
class Solution:
    """Log rows as in `contacts.end` (open contacts with nan), samples (ξ, η, -, v), state and time at the end."""

    status: str
    time: Any
    rows: Any
    samples: Any
    overlap: Any
    rate: Any
    velocity: Any
    force: Any
    steps: int


def solve(
    case: Any, arithmetic: Arithmetic = DOUBLE, shift: Any = None, compiled: bool = True, most: int = 100_000,
    rows: int = ROWS,
) -> Solution:
    """Solve a case (see `scenes.Case`), with its gaps, velocities and masses times 1 + `shift` (three arrays)."""
    A = arithmetic
    gap, v, mass = (A.array(x) for x in (case.gap, case.velocity, case.mass))
    if shift is not None:
        gap, v, mass = (x * (1 + A.array(d)) for x, d in zip((gap, v, mass), shift, strict=True))
    n = len(gap)
    w = A.array([0.0 if m == np.inf else 1 / m for m in mass])
    g = A.number(case.gravity)
    fall = A.array([0.0 * g if x == 0 else g for x in w])
    kinds, law = [], A.zeros(n, 6)
    root = functions(A.name)["root"]
    for c, one in enumerate(case.laws):
        kind, numbers = one.by_number(A.number, root, 1 / (w[c] + w[c + 1]))
        kinds.append(kind)
        for i, x in enumerate(numbers):
            law[c, i] = x
    number = A.zeros(9)
    number[state.EPS], number[state.TOL] = A.number(A.eps), A.number(A.tolerance)
    number[state.DELTA] = A.number(A.eps ** 0.25)
    contact = A.zeros(n, 6)
    contact[:, 0] = A.number(float("nan"))
    s = state.System(
        np.array(kinds), law, w, fall[1:] - fall[:-1], fall, np.zeros(n, np.int64), np.zeros(n, np.int64), A.zeros(n),
        np.zeros(n, np.int64), np.zeros(n, np.int64), contact, number, A.zeros(10, 4 * n + 1),
    )
    y = A.zeros(3 * n + n + 1)
    y[:n], y[n : 2 * n], y[3 * n :] = -gap, v[:-1] - v[1:], v
    until = np.array(case.until if isinstance(case.until, tuple) else (-1, -1))
    times = A.array([] if case.samples is None else case.samples)
    log, sampled = A.zeros(rows + 1, 11), A.zeros(len(times), len(y))
    t_end = A.number(-1.0 if case.t_end is None else case.t_end)
    why, k, done, steps = build(motion.march, A, compiled)(
        s, y, t_end, until, case.until == "separated", A.columns, log, times, sampled, most
    )
    if WHY[why] == "touch":
        stop = float(s.contact[until[0], 0])
        return _replaced(solve(case.replace(t_end=stop, until=None), A, shift, compiled, most, rows), "until")
    for i in range(done, len(times)):
        sampled[i] = y
    kept = list(log[:k])
    nan = A.number(float("nan"))
    for c in range(n):
        if s.mode[c] == ACTIVE:
            m = s.contact[c]
            kept.append(A.array([c, m[0], nan, m[1], m[2], m[3], nan, nan, m[4], m[5], y[2 * n + c]]))
    now = [build(contacts.force_now, A, compiled)(s, y, c) if s.mode[c] == ACTIVE else 0.0 for c in range(n)]
    status = WHY[why]
    return Solution(status, number[state.T], kept, sampled[:, :], y[:n], y[n : 2 * n], y[3 * n :], now, int(steps))


def _replaced(solution: Solution, status: str) -> Solution:
    solution.status = status
    return solution

"""What a user would write with scipy: the same equations, clipped forces, with and without events.
May be skipped: it measures ourselves.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._check import Array
from granular.reference import ReferenceContact, restarted
from granular.reference.log import Logbook
from granular.reference.restarted import Newton, TooMuchWork
from granular.workprecision.methods import Method, Outcome, Task

SOLVERS = {"dop853": "DOP853", "lsoda": "LSODA", "radau": "Radau"}
NAMES = (*(f"{name}+events" for name in SOLVERS), *SOLVERS)
TOLERANCES = {"DOP853": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 3e-14), "LSODA": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
              "Radau": (1e-4, 1e-6, 1e-8, 1e-10)}  # fmt: skip
MOST = 60_000
"""Evaluations after which a solver is stopped."""
LOOKS = 8
"""Looks for a contact in each step of a solver without events."""
BEYOND = 0.05
"""A solver without events goes on for this part of the longest contact, to see the last one end."""


def peer(task: Task, name: str) -> Method | None:
    """The method of scipy of that name; none, without events, for laws with memory, as xi_max is unknown inside a step,
    and beside thermal walls, where velocities jump."""
    short, _, events = name.partition("+")
    if not events and (task.scene.heated or any(law.memory for law in task.resolved.each)):
        return None
    way, solver = _with_events if events else _without_events, SOLVERS[short]

    def run(rtol: float) -> Outcome:
        try:
            return way(task, solver, rtol)
        except TooMuchWork:
            return Outcome(tuple, MOST, "evaluations", "stopped")

    return Method(name, "rtol", TOLERANCES[solver], run)


def _with_events(task: Task, solver: str, rtol: float) -> Outcome:
    done, work = restarted.solve(task.scene, task.resolved, task.until, task.t_end, solver, rtol, MOST)
    return Outcome(lambda: done.contacts, work, "evaluations", done.status)


def _without_events(task: Task, solver: str, rtol: float) -> Outcome:
    from scipy.integrate import solve_ivp

    truth, newton = task.truth, Newton(task.scene, task.resolved, MOST)
    end = truth.t_stop + (0.0 if truth.status == "time" else BEYOND * max(truth.durations))
    done = solve_ivp(newton, (0.0, end), newton.start(), dense_output=True, method=solver, rtol=rtol,
                     atol=rtol * newton.scales())  # fmt: skip
    work = newton.evaluations
    return Outcome(lambda: _read(task, newton, done), work, "evaluations", "time" if done.success else "failed")


def _read(task: Task, newton: Newton, done: Any) -> tuple[ReferenceContact, ...]:
    """Contacts from a continuous solution: changes of the clipped force between looks, then its zeros."""
    knots = np.unique(np.linspace(done.t[:-1], done.t[1:], LOOKS + 1))
    log, changes = Logbook(task.until), []

    def seen(t: float) -> Array:
        """Overlaps in m and rates in m/s at a time in s."""
        return np.asarray(newton.driven_by(newton.zero + t, done.sol(t)))

    states = [seen(t) for t in knots.tolist()] if newton.paths else done.sol(knots).T
    for c in range(newton.pairs):
        on = [False] + [newton.force(c, float(y[c]), float(y[newton.pairs + c])) > 0.0 for y in states]
        changes += [(_zero(task, newton, seen, c, knots[max(i - 1, 0)], knots[i]), c, on[i + 1])
                    for i in range(len(knots)) if on[i] != on[i + 1]]  # fmt: skip
    for t, c, begins in sorted(changes):
        v = newton.velocities(done.sol(t), t)
        lower, upper = task.scene.bodies(c)
        speeds = (float(v[lower]), float(v[upper]))
        if begins and log.begin(c, t, speeds):
            break
        if not begins:
            log.end(c, t, speeds)
    return log.contacts()


def _zero(task: Task, newton: Newton, state: Any, c: int, a: float, b: float) -> float:
    """When the force of pair c begins or ends between times `a` and `b`."""
    from scipy.optimize import brentq

    crosses = not task.resolved[c].rate_dependent or (state(a)[c] > 0.0) != (state(b)[c] > 0.0)

    def function(t: float) -> float:
        y: Array = state(t)
        return float(y[c]) if crosses else newton.bracket(c, float(y[c]), float(y[newton.pairs + c]))

    if (function(a) > 0.0) == (function(b) > 0.0):
        return a
    return float(brentq(function, a, b, xtol=1e-300, rtol=1e-15))

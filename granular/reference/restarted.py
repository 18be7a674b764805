"""A scene solved by scipy, restarted at every event: for laws without a power series, and as an alternative to judge.

Between two contacts everything flies on parabolas and is moved there in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from granular import until as stop
from granular._check import Array
from granular.drive import Pause
from granular.laws.kinds import SceneLaws
from granular.reference.log import ACTIVE, DORMANT, OPEN, RESIDUAL, Logbook, Reference, roused, run_to_end
from granular.reference.newton import Newton, TooMuchWork
from granular.reference.series import first_rise_of_parabola
from granular.scene import Scene

SLEEP = 1e-13
"""A pair that touches at rest counts as open up to this part of the overlap of an impact."""
Watch = tuple[Callable[[float, Array], float], int, str]
"""Function of (t, y), the direction in which its zero counts, and what then happens."""


def solve(
    scene: Scene, laws: SceneLaws, until: stop.Until | None, t_end: float | None, method: str, rtol: float,
    most: int = 2_000_000,
) -> tuple[Reference, int]:
    """Solve a scene with a method of `scipy.integrate.solve_ivp`; return it and the number of evaluations.

    Raises
    ------
    TooMuchWork
        After `most` evaluations.
    """  # fmt: skip
    run = Run(scene, laws, until, math.inf if t_end is None else t_end, method, rtol, most)
    return run_to_end(run, f"{method}, restarted at events, rtol {rtol:g}"), run.newton.evaluations


class Run:
    """One run under way."""

    def __init__(
        self, scene: Scene, laws: SceneLaws, until: Any, t_end: float, method: str, rtol: float, most: int
    ) -> None:
        self.newton, self.log, self.t, self.t_end = Newton(scene, laws, most), Logbook(until), 0.0, t_end
        self.y, self.scales, self.n = self.newton.start(), self.newton.scales(), scene.n_pairs
        self.options = {"method": method, "rtol": rtol, "atol": rtol * self.scales}
        self.mode = [OPEN] * self.n
        self.loading = [True] * self.n
        self.since: dict[int, tuple[float, tuple[float, float]]] = {}
        """When a force reached dormant pairs, and the velocities then: where their contacts begin."""

    def launch(self) -> Pause:
        """Begin the contacts that are there at the start."""
        for c in range(self.n):
            xi, eta = float(self.y[c]), float(self.y[self.n + c])
            if xi > 0.0:
                self.mode[c] = RESIDUAL
                if self.newton.bracket(c, xi, eta) > 0.0 and self.act(c, "begin"):
                    return Pause.until
            elif xi == 0.0 and eta == 0.0:
                self.mode[c] = DORMANT
        return Pause.full

    def to(self, time: float) -> Pause:
        """Go on towards `time`: to the next event."""
        moved = roused(self.mode, self.newton.pull)
        for c, mode in enumerate(self.mode):
            self.newton.smooth[c], self.newton.clipped[c] = mode == ACTIVE, mode in (OPEN, RESIDUAL)
            if mode == DORMANT and not moved[c]:
                self.since.pop(c, None)
            elif mode == DORMANT:
                self.since.setdefault(c, (self.t, self.bodies(c)))
        if all(mode == OPEN or (mode == DORMANT and not moved[c]) for c, mode in enumerate(self.mode)):
            return self.fly(time)
        from scipy.integrate import solve_ivp

        watches = [(c, watch) for c in range(self.n) for watch in self.watches(c)]
        events = [_event(function, direction) for _, (function, direction, _) in watches]
        done = solve_ivp(self.newton, (0.0, time - self.t), self.y, events=events, **self.options)
        if done.status < 0:
            raise TooMuchWork
        self.t, self.y = self.t + float(done.t[-1]), done.y[:, -1]
        if done.status == 0:
            return Pause.reached
        fired = next(k for k, times in enumerate(done.t_events) if len(times))
        c, (_, _, what) = watches[fired]
        return self.after(c, what)

    def fly(self, time: float) -> Pause:
        """Move on parabolas to the next touch."""
        n, pull = self.n, self.newton.pull
        p = [(float(self.y[c]), float(self.y[n + c]), 0.5 * pull[c]) for c in range(n)]
        when = {c: first_rise_of_parabola(math, p[c]) for c in range(n) if self.mode[c] == OPEN}
        touches = {x: c for c, x in when.items() if x is not None}
        dt = min(touches, default=math.inf)
        if dt == time == math.inf:
            return Pause.quiet
        if self.t + dt >= time:
            self.t = time
            return Pause.reached
        self.t += dt
        for c in range(n):
            self.y[c], self.y[n + c] = p[c][0] + dt * (p[c][1] + dt * p[c][2]), p[c][1] + 2.0 * dt * p[c][2]
        return self.after(touches[dt], "touch")

    def after(self, c: int, what: str) -> Pause:
        """Apply an event to pair c; return whether the run goes on."""
        done, rates = self.act(c, what), self.y[self.n :].tolist()
        closed = any(mode in (ACTIVE, RESIDUAL) for mode in self.mode)
        return Pause.until if done or self.log.separated(rates, closed) else Pause.full

    def watches(self, c: int) -> list[Watch]:
        """What may happen to pair c."""
        n, bracket, line = self.n, self.newton.bracket, SLEEP * self.scales[c]

        def overlap(t: float, y: Array) -> float:
            return float(y[c])

        def push(t: float, y: Array) -> float:
            return bracket(c, float(y[c]), float(y[n + c]))

        if self.mode[c] == OPEN:
            return [(overlap, 1, "touch")]
        if self.mode[c] == DORMANT:
            return [(lambda t, y: y[c] - line, 1, "begin"), (lambda t, y: y[c] + line, -1, "part")]
        if self.mode[c] == RESIDUAL:
            return [(push, 1, "begin"), (overlap, -1, "part")]
        law = self.newton.each[c]
        if not law.memory:
            return [(push, -1, "release") if law.rate_dependent else (overlap, -1, "part")]
        deepest = self.newton.deepest[c]
        turn = (lambda t, y: y[n + c], -1, "turn") if self.loading[c] else (lambda t, y: y[c] - deepest, 1, "turn")
        return [(push, -1, "release"), turn]

    def act(self, c: int, what: str) -> bool:
        """Apply an event to pair c; return whether it ends the run."""
        if what in ("touch", "part") and self.mode[c] != DORMANT:
            self.y[c] = 0.0
        if what == "turn":
            self.newton.deepest[c], self.loading[c] = max(self.newton.deepest[c], float(self.y[c])), not self.loading[c]
        elif what in ("touch", "begin"):
            if self.log.begin(c, *(self.since.pop(c, None) or (self.t, self.bodies(c)))):
                return True
            self.mode[c], self.loading[c] = ACTIVE, True
        else:
            if self.mode[c] == ACTIVE:
                self.log.end(c, self.t, self.bodies(c))
            self.mode[c] = RESIDUAL if what == "release" else OPEN
            if what == "part":
                self.newton.deepest[c] = 0.0
        return False

    def bodies(self, c: int) -> tuple[float, float]:
        """Velocities of the bodies of pair c in m/s."""
        v = self.newton.velocities(self.y, self.t)
        lower, upper = self.newton.scene.bodies(c)
        return float(v[lower]), float(v[upper])


def _event(function: Callable[[float, Array], float], direction: int) -> Any:
    """A terminal event in scipy's form: a function with attributes."""
    event = partial(function)
    vars(event).update(terminal=True, direction=direction)
    return event

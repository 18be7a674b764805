"""Reference solution of a scene, independent of the engines, with its error.

SciPy's DOP853 is restarted at every event. It shares no code with the methods of `granular.md`: a driven wall is
evaluated from the sine or the polynomials that define it. Each scene is solved with two tolerances, and the difference
is the reported error. In the six scenes of `guide/frontier.md` it is 4e-12 to 7e-10 of the impact speed, 3 to 40 times
the true error (4e-13 to 6e-11).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from granular._engine import check
from granular._engine.check import Array
from granular.laws.kinds import SceneLaws, checked
from granular.run import until as stop
from granular.scene import Scene, checked as a_scene, speed_scale, velocities
from granular.scene.places import WallMeeting, with_fitted_walls
from granular.studies.reference_events import (
    ACTIVE,
    DORMANT,
    OPEN,
    Reference,
    ReferenceContact,
    Run,
    Watch,
    distance,
)
from granular.studies.reference_walls import heats, paths

__all__ = ["Reference", "ReferenceContact", "solve"]

REFERENCE_TOLERANCES = (3e-14, 1e-12)
"""Relative tolerances of the two solutions by DOP853."""
STEPS_PER_PIECE = 20
"""Minimum number of steps per period, and per polynomial of a driven wall's path.

With larger steps the solver can miss a short contact.
"""
RESTING_OVERLAP_SHARE = 1e-13
"""Maximum overlap of a pair that touches at rest, as a fraction of an impact's."""


class Problem(NamedTuple):
    """Checked inputs of a reference solution. Times in s."""

    scene: Scene
    laws: SceneLaws
    until: stop.Until | None
    t_end: float | None
    t_start: float


def solve(
    scene: Scene, law: Any, *, until: stop.Until | None = None, t_end: float | None = None, t_start: float = 0.0,
) -> Reference:
    """Solve a scene of soft spheres independently of the engines.

    The error of the solution is estimated.

    Parameters
    ----------
    scene : Scene
        Initial state.
    law : force law or sequence of force laws
        One for all pairs, or one per pair from the bottom up.
    until, t_end : stop condition, float, optional
        Stop condition and end time in s. One of them is required if the motion never ends.
    t_start : float
        Time in s of the initial state. Defaults to 0.

    Returns
    -------
    Reference
        Contacts with estimated errors.

    Raises
    ------
    ValueError
        If the motion never ends, if the path of a wall ends before the run, or if walls meet.
    TooMuchWork
        If the solution needs more than two million evaluations of the forces, or if the solver of SciPy fails.

    Notes
    -----
    A `Sine` wall is evaluated in closed form, a `Motion` by its panels. Each period of a driven wall, and each
    polynomial of its path, is integrated in at least twenty steps. Contacts shorter than a step can be missed.
    """
    problem = checked_problem(scene, law, until, t_end, t_start)
    best, looser = (
        solve_with(*problem[:4], "DOP853", rtol, t_start=problem.t_start)[0] for rtol in REFERENCE_TOLERANCES
    )
    v_error, t_error = distance(best, looser)
    return replace(best, velocity_error=v_error, time_error=t_error)


def checked_problem(scene: Scene, law: Any, until: stop.Until | None, t_end: float | None, t_start: float) -> Problem:
    """Return the checked inputs, with polynomials fitted to the motions of walls."""
    start = check.number("t_start", t_start)
    stop.refuse_levels(stop.checked(until, a_scene(scene)), "the reference")
    end = None if t_end is None else check.number("t_end", t_end, at_least=start)
    scene = with_fitted_walls(scene, start, math.inf if end is None else end)
    if end is not None:
        WallMeeting(scene, start, flattened=True).refuse(end, end)
    return Problem(scene, checked(law, scene), until, end, start)


def solve_with(
    scene: Scene, laws: SceneLaws, until: stop.Until | None, t_end: float | None, method: str, rtol: float,
    max_evaluations: int = 2_000_000, t_start: float = 0.0,
) -> tuple[Reference, int]:
    """Solve a scene with a method of `scipy.integrate.solve_ivp`.

    `rtol` is the relative tolerance. Returns the solution and the number of evaluations.

    Raises
    ------
    TooMuchWork
        After `max_evaluations` evaluations, or if the solver fails.
    """
    motion = Restarted(scene, laws, method, rtol, max_evaluations, t_start)
    return Run(motion, until, t_end).solve(f"{method}, restarted at events, rtol {rtol:g}"), motion.evaluations


class Newton:
    """Right-hand side d(ξ, ξ̇)/dt of all pairs, as a user of a solver would write it.

    The state has the overlaps in m of all pairs (negative for gaps), then their rates in m/s. It excludes the motion of
    driven walls in addition to their constant velocities, which `driven_by` adds.

    Parameters
    ----------
    scene : Scene
        The initial state.
    laws : SceneLaws
        Force laws, one per pair.
    max_evaluations : int
        Number of evaluations after which `TooMuchWork` is raised.
    t_start : float
        Time in s of the initial state.

    Attributes
    ----------
    zero : float
        Time in s at which the time of the solver is 0.
    evaluations : int
        Number of evaluations so far. Each costs one force per overlapping pair.
    deepest : list of float
        Largest overlap in m of the current contact, for laws with memory.
    own : list of float
        Sum of the inverse masses of each pair in 1/kg: its closing deceleration per force.
    shared : list of tuples
        Neighbouring pairs, the lower one first, and the inverse mass of their common body in 1/kg.
    """

    def __init__(self, scene: Scene, laws: SceneLaws, max_evaluations: int = 2_000_000, t_start: float = 0.0) -> None:
        self.scene, self.laws, self.pairs = scene, laws, scene.n_pairs
        self.t_start, self.zero, self.paths = t_start, t_start, paths(math, scene)
        self.begin = {b: path.moved(t_start) for b, path in self.paths.items()}
        self.each, w = list(laws), scene.inverse_mass.tolist()
        self.own: list[float] = [w[lower] + w[upper] for lower, upper in map(scene.bodies, range(self.pairs))]
        self.shared: list[tuple[int, int, float]] = [
            (below, above, w[scene.bodies(below)[1]]) for below, above in np.transpose(scene.neighbours).tolist()]
        self.fall: list[float] = scene.closing_acceleration.tolist()
        self.square = scene.pendulum * scene.pendulum
        self.rest: list[float] = [0.0] * self.pairs if scene.rest_gap is None else scene.rest_gap.tolist()
        self.deepest = np.maximum(-scene.gap, 0.0).tolist()
        self.evaluations, self.most = 0, max_evaluations

    def start(self) -> Array:
        """Return the initial state: overlaps in m (negative for gaps), then rates in m/s."""
        return np.concatenate([-self.scene.gap, -self.scene.across(self.scene.velocity)])

    def scales(self) -> Array:
        """Return scales of the state: overlap in m of an impact, and its speed in m/s.

        The impact has the largest speed of the scene.
        """
        speed = speed_scale(self.scene) + sum(path.fastest for path in self.paths.values()) or 1.0
        return np.append(self.laws.column(lambda law: law.overlap_at(speed)), np.full(self.pairs, speed))

    def driven_by(self, t: float, y: Any) -> Any:
        """Return the state `y` with the motion of driven walls added.

        `t` is the time in s. The state has overlaps in m, then rates in m/s.
        """
        driven = y.copy() if self.paths else y
        for b, path in self.paths.items():
            c, sign = (0, 1.0) if b == 0 else (self.pairs - 1, -1.0)
            driven[c] += sign * (path.moved(t) - self.begin[b])
            driven[self.pairs + c] += sign * path.rates(t)[0]
        return driven

    def bracket(self, c: int, xi: float, eta: float) -> float:
        """Return the force of pair c in N before it is clipped."""
        xi = max(xi, 0.0)
        return float(self.each[c].given(xi, eta, max(self.deepest[c], xi)))

    def force(self, c: int, xi: float, eta: float) -> float:
        """Return the force of pair c in N, clipped at 0."""
        return max(0.0, self.bracket(c, xi, eta)) if xi > 0.0 else 0.0

    def __call__(self, t: float, y: Array) -> Array:
        """Return the rates of change of the state `y`, at time `t` in s of the solver."""
        self.evaluations += 1
        if self.evaluations > self.most:
            raise TooMuchWork(f"The reference needs more than {self.most} evaluations of the forces. Give an earlier "
                              "t_end= or until=, or a softer law.")
        n = self.pairs
        state = y.tolist()
        driven = self.driven_by(self.zero + t, state) if self.paths else state
        force = [self.force(c, driven[c], driven[n + c]) for c in range(n)]
        rates = state[n:] + self.fall
        if self.square:
            for c in range(n):
                rates[n + c] -= self.square * (driven[c] + self.rest[c])
        for c, f in enumerate(force):
            rates[n + c] -= self.own[c] * f
        for below, above, shared in self.shared:
            rates[n + above] += shared * force[below]
            rates[n + below] += shared * force[above]
        return np.array(rates)

    def velocities(self, y: Array, t: float) -> Array:
        """Return the velocities of all bodies in m/s, `t` s after the initial state.

        They are summed from the velocity of a wall or of the centre of mass.
        """
        rate = -self.driven_by(self.t_start + t, y)[None, self.pairs :]
        return np.asarray(velocities(self.scene, rate, np.array([t]), self.t_start)[0])


class Restarted(Newton):
    """Solver that advances a scene from event to event.

    The current state is `y` at the time `t` in s. The solver is restarted after each event.
    """

    mp = math

    def __init__(
        self, scene: Scene, laws: SceneLaws, method: str, rtol: float, max_evaluations: int, t_start: float = 0.0
    ) -> None:
        super().__init__(scene, laws, max_evaluations, t_start)
        self.t, self.y, self.scale = t_start, self.start(), self.scales()
        self.curved, self.ring, self.heat = scene.driven or scene.pendulum > 0.0, scene.ring, heats(scene)
        self.mode, self.loading = [OPEN] * self.pairs, [True] * self.pairs
        self.edge = math.inf  # time in s of the next break of a wall's path, or of a kick
        self.options = {"method": method, "rtol": rtol, "atol": rtol * self.scale}

    def force(self, c: int, xi: float, eta: float) -> float:
        """Return the force of pair c in N by its mode. It is clipped at 0 only at rest.

        The force of an active pair ends at an event, where it changes its sign.
        """
        if c in self.heat:
            return 0.0
        if self.mode[c] == ACTIVE:
            return self.bracket(c, xi, eta)
        return super().force(c, xi, eta) if self.mode[c] == DORMANT else 0.0

    @property
    def pull(self) -> list[float]:
        """Closing accelerations of all pairs in m/s² without contacts.

        Walls move at their constant velocities.
        """
        state = zip(self.fall, self.y.tolist(), self.rest, strict=False)
        return [fall - self.square * (xi + rest) for fall, xi, rest in state]

    def read(self, t: float, y: Array, c: int, quantity: str) -> float:
        """Return a quantity of pair c in the state `y` at time `t` in s.

        `quantity` is "overlap" in m, "rate" in m/s, or "bracket", the force in N before it is clipped. At a negative
        overlap, "bracket" returns the overlap, because its sign is the same.
        """
        driven = self.driven_by(t, y)
        xi, eta = float(driven[c]), float(driven[self.pairs + c])
        if quantity == "bracket" and xi >= 0.0:
            return self.bracket(c, xi, eta)
        return eta if quantity == "rate" else xi  # an open pair has no force, not even one that is exactly 0

    def now(self, c: int, quantity: str) -> float:
        """Return the quantity of pair c at the current time, see `read`."""
        return self.read(self.t, self.y, c, quantity)

    def bodies(self, c: int) -> tuple[float, float]:
        """Return the velocities of the lower and the upper body of pair c in m/s."""
        lower, upper = self.velocities(self.y, self.t - self.t_start)[list(self.scene.bodies(c))].tolist()
        return lower, upper

    def resting_overlap(self, c: int) -> float:
        """Return the overlap in m up to which pair c, touching at rest, has no force."""
        return RESTING_OVERLAP_SHARE * float(self.scale[c])

    def ends(self, c: int) -> list[Watch]:
        """Return the possible events of pair c while its force acts."""
        law = self.each[c]
        end_of_force = Watch(c, "release", "bracket", -1) if law.rate_dependent else Watch(c, "part", "overlap", -1)
        if not law.memory:
            return [end_of_force]
        turn = ("rate", -1) if self.loading[c] else ("overlap", 1, self.deepest[c])
        return [Watch(c, "release", "bracket", -1), Watch(c, "turn", *turn)]

    def fly(self, dt: float) -> None:
        """Advance by the time `dt` in s without contact forces."""
        for c, pull in enumerate(self.pull):
            xi, eta = self.now(c, "overlap"), self.now(c, "rate")
            self.y[c], self.y[self.pairs + c] = xi + dt * (eta + dt * 0.5 * pull), eta + dt * pull
        self.t += dt

    def go(self, watches: list[Watch], end: float) -> Watch | None:
        """Advance to the first event, to the time `end` in s, or to a break of a path.

        A break is a time at which one polynomial of the path of a driven wall ends and the next one begins. Returns
        the event that occurred, or None.
        """
        from scipy.integrate import solve_ivp

        self.zero, events = self.t, [partial(self.event, watch) for watch in watches]
        if self.t >= self.edge:  # events caused by a velocity jump are not roots within a step
            for watch, event in zip(watches, events, strict=True):
                if event(0.0, self.y) > 0.0:
                    return watch
        self.edge = min((path.until(self.t) for path in self.paths.values()), default=math.inf)
        end = min(end, self.edge)
        period = 2.0 * math.pi / self.scene.pendulum if self.square else self.edge - self.t
        step_limit = {"max_step": period / STEPS_PER_PIECE} if period < math.inf else {}
        for event in events:
            vars(event).update(terminal=True, direction=1)
        solution = solve_ivp(self, (0.0, end - self.t), self.y, events=events, **self.options, **step_limit)
        if solution.status < 0:
            raise TooMuchWork(f"SciPy's solver failed at t = {self.t:.9g} s: {solution.message}")
        self.t, self.y = end if solution.status == 0 else self.t + float(solution.t[-1]), solution.y[:, -1]
        return next((watch for watch, times in zip(watches, solution.t_events, strict=True) if len(times)), None)

    def event(self, watch: Watch, t: float, y: Array) -> float:
        """Return the function that rises through zero at the event `watch`.

        `t` is the time of the solver in s, `y` the state.
        """
        return float(watch.sign * (self.read(self.zero + t, y, watch.pair, watch.quantity) - watch.level))

    def record_event(self, c: int, event: str) -> None:
        """Update overlap and memory of pair c for the event `event`.

        The overlap is set to zero at touch and separation. For laws with memory, the largest overlap is stored.
        """
        if event in ("touch", "part") and self.mode[c] != DORMANT:
            self.y[c] = 0.0
            self.y[c] = -self.now(c, "overlap")  # minus the displacement of a driven wall
        if event == "turn":
            self.deepest[c], self.loading[c] = max(self.deepest[c], self.now(c, "overlap")), not self.loading[c]
        elif event == "part":
            self.deepest[c] = 0.0
        elif event != "release":
            self.loading[c] = True

    def kick(self, c: int) -> None:
        """Give the ball of pair c its new speed after a collision with a thermal wall.

        The speed is drawn at random. The overlap at this time is zero.
        """
        wall, n = self.heat[c], self.pairs
        speed_change = self.now(c, "rate") + wall.next_speed()
        self.y[n + c] -= speed_change
        neighbour = c + 1 if wall.side == 0 else c - 1
        if 0 <= neighbour < n:
            self.y[n + neighbour] += speed_change
        self.edge = self.t  # forces that begin or end now do so without a change of sign

    def account(self) -> None:
        """Return None: no energy balance is recorded."""


class TooMuchWork(RuntimeError):
    """Raised if a solver needs too many evaluations or fails."""

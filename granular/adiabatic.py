"""A light ball on a heavy one that bounces: three-body impact in closed form, after appendix A of the paper.

Two balls fall on a floor, linear dashpots in both contacts. If the upper ball is far lighter than the lower one
(m2 ≪ m1), the lower ball moves as if it were alone and the upper one follows. With overlaps ξ0 (floor), ξ1 (balls)
and the accelerations a_c = (k_c ξ_c + γ_c ξ̇_c) / m_(c+1) of an active contact, 0 of any other:

    ξ̈0 = g - a0(t),        ξ̈1 = a0(t) - a1(t).

(Newton: ξ̈0 = g - a0 + (m2/m1) a1, ξ̈1 = a0 - (1 + m2/m1) a1.) The four types of motion are a0 on or off, a1 on or off.
Each is linear: z = (ξ0, ξ̇0, ξ1, ξ̇1, 1) moves by the exponential of a 5 × 5 matrix, whatever the damping: under, over,
critical, in resonance. Over one step its power series *is* that exponential to rounding, so the begin or end of a
contact is a root of a polynomial, and `granular._roots` certifies that it is the first.

Müller & Pöschel, Phys. Rev. E 83, 041304 (2011); what their appendix leaves out is told in ``docs/adiabatic.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from typing import Any

import numpy as np

from granular import _check
from granular._check import Array
from granular._flight import rate_at_contact, time_to_contact
from granular._roots import first_up_crossing, workspace
from granular.laws.check import checked
from granular.scene import Scene
from granular.trajectory import Status

__all__ = ["AdiabaticSolution", "contacts"]


def __dir__() -> list[str]:
    return __all__


DEGREE = 20
"""Degree of a piece: over a step of 1/(ω + 2β) the first term left out is 1/21! = 2e-20."""

OPEN, ACTIVE, RESIDUAL = range(3)  # ξ ≤ 0; F > 0; ξ > 0 with the force clipped to 0

NEVER_PARTED = (math.nan, math.nan, math.nan)  # end of the last contact of the balls in s, ξ̇ of both pairs there


@dataclass(frozen=True, eq=False)
class AdiabaticSolution:
    """How the light ball fares; made by `contacts`. The clock is 0 as the lower ball first touches the floor.

    Attributes
    ----------
    t10, v10 : float
        Time from the scene's instant to the first floor contact in s, and the lower ball's velocity there in m/s.
    contacts : (count, 2) array
        Begin and end in s of every contact of the two balls that begins before the second floor contact; the end is
        inf for a contact that lasts for ever, nan where the work limit cut it off.
    floor_end, floor_again : float
        End of the first floor contact and begin of the second in s; inf for never, nan if beyond the work limit.
    t_f : float
        End of the last of `contacts` in s; nan if there is none.
    v1, v2 : float
        Velocities of the lower and the upper ball at `t_f` in m/s, upwards positive.
    ongoing : bool
        A contact of the balls was still running when the second floor contact began. It was followed to its end,
        with the floor pushing again.
    status : Status
        `until`: the second floor contact has begun. `quiet`: nothing can follow (no gravity). `resting`: both
        contacts last for ever, proved. `max_events`: the work limit was reached.
    steps : int
        Steps that were needed.
    """

    t10: float
    v10: float
    contacts: Array
    floor_end: float
    floor_again: float
    t_f: float
    v1: float
    v2: float
    ongoing: bool
    status: Status
    steps: int

    @property
    def count(self) -> int:
        """Number of contacts of the two balls."""
        return len(self.contacts)

    @property
    def v_rel(self) -> float:
        """v_r′ = v2 - v1 at `t_f` in m/s: how fast the balls part."""
        return self.v2 - self.v1


def contacts(scene: Scene, law: Any, *, max_steps: int = 200_000) -> AdiabaticSolution:
    """Return the contacts of a light upper ball with the lower one, up to the second floor contact.

    Exact in the limit m2 → 0 with k/m2 and γ/m2 of the upper contact held; the error is of order m2/m1.

    Parameters
    ----------
    scene : Scene
        A floor and two balls, such as `granular.scenes.three_balls`; the lower ball reaches the floor first.
    law : force law, or two of them
        Linear in both pairs (trait ``linear(pair) -> (k, gamma)``).
    max_steps : int
        Work limit. A contact takes its duration times (ω + 2β) steps, ω² = k/m, 2β = γ/m: few unless a stiff or
        strongly over-damped upper contact lasts as long as a soft floor contact.

    Raises
    ------
    TypeError, ValueError
        If the scene is another one, or a law is not linear.
    """
    limit = _check.whole("max_steps", max_steps, at_least=1)
    system = _linear_system(scene, law)
    t10, start = _first_touch(scene)
    run = _Scheme(system, start)
    status = run.follow(limit)
    never = math.nan if status is Status.max_events else math.inf
    floor = float(scene.velocity[0])
    t_f, floor_rate, upper_rate = run.parted
    return AdiabaticSolution(
        t10=t10,
        v10=floor - float(start[1]),
        contacts=np.array([*zip_longest(run.begin[1], run.end[1], fillvalue=never)]).reshape(-1, 2),
        floor_end=run.end[0][0] if run.end[0] else never,
        floor_again=run.begin[0][1] if len(run.begin[0]) > 1 else never,
        t_f=t_f,
        v1=floor - floor_rate,
        v2=floor - floor_rate - upper_rate,
        ongoing=run.ongoing,
        status=status,
        steps=run.steps,
    )


class _System:
    """The equations of motion: a matrix for every combination of active contacts.

    Parameters
    ----------
    gravity : float
        g in m/s².
    square, damping : two floats
        ω² = k/m in 1/s² and 2β = γ/m in 1/s of the floor contact (m = m1) and the upper one (m = m2).
    """

    def __init__(self, gravity: float, square: tuple[float, float], damping: tuple[float, float]) -> None:
        self.gravity, self.square, self.damping = gravity, square, damping
        self._tables: dict[tuple[bool, bool], tuple[float, Array]] = {}

    def matrix(self, active: tuple[bool, bool]) -> Array:
        """ż = M z with z = (ξ0, ξ̇0, ξ1, ξ̇1, 1)."""
        m = np.zeros((5, 5))
        m[0, 1] = m[2, 3] = 1.0
        m[1, 4] = self.gravity
        if active[0]:
            floor = np.array([self.square[0], self.damping[0]])
            m[1, :2] -= floor
            m[3, :2] += floor
        if active[1]:
            m[3, 2:4] -= (self.square[1], self.damping[1])
        return m

    def contact_step(self, active: tuple[bool, bool]) -> tuple[float, Array]:
        """Length h in s of a step with a contact, and its table (M h)^j / j!."""
        if active not in self._tables:
            rate = max(math.sqrt(w) + b for w, b, on in zip(self.square, self.damping, active, strict=True) if on)
            self._tables[active] = 1.0 / rate, _exponential(self.matrix(active) / rate, DEGREE)
        return self._tables[active]

    def flight_step(self, z: Array) -> tuple[float, Array]:
        """Step with both balls free, long enough to hold whatever comes next; h = 0 if nothing moves.

        Its table is exact for any length. With gravity the floor is met again at the latest at the end of a flight
        through ξ0 = 0, or, from an overlap that never opens, when the ball has turned back.
        """
        if self.gravity > 0.0:
            fall = math.sqrt(max(0.0, z[1] * z[1] - 2.0 * self.gravity * z[0]))
            last = (abs(float(z[1])) + fall) / self.gravity
        else:
            last = max((abs(float(x / y)) for x, y in (z[:2], z[2:4]) if y != 0.0), default=0.0)
        h = 1.001 * last
        return h, _exponential(self.matrix((False, False)) * h, 2)

    def events(self, c: int, mode: int, piece: Array, at_zero: bool) -> Iterator[tuple[list[float], float, int]]:
        """Yield (polynomial, direction of its crossing, new mode) of what may happen to pair c.

        `at_zero`: the last event was a zero of this pair's force, which must not be found again.
        """
        xi = piece[:, 2 * c]
        if mode == OPEN:
            yield xi.tolist(), 1.0, ACTIVE
            return
        force = (self.square[c] * xi + self.damping[c] * piece[:, 2 * c + 1]).tolist()
        if at_zero:
            force[0] = 0.0
        if mode == ACTIVE:
            yield force, -1.0, RESIDUAL if self.damping[c] > 0.0 else OPEN
        else:
            yield force, 1.0, ACTIVE
            yield xi.tolist(), -1.0, OPEN

    def rests(self, z: Array) -> bool:
        """Whether two active contacts are proved to stay so for ever.

        With w the deviation from equilibrium, scaled to speeds, and AᵀP + PA = -1, V = wᵀPw only falls; if no w with
        that V has a force deviation |r_c w| = √(r_c P⁻¹ r_cᵀ V) of g, no force can reach 0 (equilibrium: a_c = g).
        """
        if self.gravity == 0.0 or 0.0 in self.damping:
            return False
        form, largest = self._lyapunov
        root = np.sqrt(self.square)
        w = np.array([root[0] * z[0], z[1], root[1] * z[2], z[3]])
        w[::2] -= self.gravity / root
        return bool((w @ form @ w) * largest < self.gravity * self.gravity)

    @cached_property
    def _lyapunov(self) -> tuple[Array, float]:
        """P, and the larger r_c P⁻¹ r_cᵀ."""
        scale = np.array([math.sqrt(self.square[0]), 1.0, math.sqrt(self.square[1]), 1.0])
        a = self.matrix((True, True))[:4, :4] * scale[:, None] / scale
        one = np.eye(4)
        form = np.linalg.solve(np.kron(a.T, one) + np.kron(one, a.T), -one.ravel()).reshape(4, 4)
        r = np.zeros((2, 4))
        r[0, :2], r[1, 2:] = (scale[0], self.damping[0]), (scale[2], self.damping[1])
        return form, float(np.einsum("ci,ij,cj->c", r, np.linalg.inv(form), r).max())


class _Scheme:
    """Strings the types of motion together: from one begin or end of a contact to the next."""

    def __init__(self, system: _System, z: Array) -> None:
        self.system, self.z, self.t, self.steps = system, z, 0.0, 0
        self.mode = [ACTIVE, OPEN]
        self.at_zero = -1  # the pair whose force has just passed zero
        self.begin: tuple[list[float], list[float]] = ([0.0], [])
        self.end: tuple[list[float], list[float]] = ([], [])
        self.parted = NEVER_PARTED
        self.ongoing = False
        self._work = workspace(DEGREE)

    def follow(self, limit: int) -> Status:
        """Go on until the second floor contact begins and no contact of the balls is running."""
        status = None
        while status is None and self.steps < limit:
            self.steps += 1
            status = self._step()
        return status or Status.max_events

    def _step(self) -> Status | None:
        active = (self.mode[0] == ACTIVE, self.mode[1] == ACTIVE)
        if all(active) and self.system.rests(self.z):
            self.parted = (math.inf, 0.0, 0.0)
            return Status.resting
        h, table = self.system.contact_step(active) if any(active) else self.system.flight_step(self.z)
        piece = table @ self.z
        hit, pair, new = 1.0, -1, OPEN
        for c in (0, 1):
            for p, sign, mode in self.system.events(c, self.mode[c], piece, c == self.at_zero):
                root = first_up_crossing(p, hit, self._work, sign)
                if root <= hit:
                    hit, pair, new = root, c, mode
        self.t += hit * h
        self.z = hit ** np.arange(len(piece)) @ piece
        self.at_zero = -1
        if pair >= 0:
            return self._change(pair, new)
        return None if any(active) else Status.quiet

    def _change(self, c: int, new: int) -> Status | None:
        old, self.mode[c] = self.mode[c], new
        if OPEN in (old, new):
            self.z[2 * c] = 0.0
        else:
            self.at_zero = c
        if new == ACTIVE:
            return self._begins(c)
        return self._ends(c) if old == ACTIVE else None

    def _begins(self, c: int) -> Status | None:
        self.begin[c].append(self.t)
        if c == 1:
            self.parted = NEVER_PARTED
        if c == 0 and len(self.begin[0]) == 2:
            self.ongoing = self.mode[1] == ACTIVE
            return None if self.ongoing else Status.until
        return None

    def _ends(self, c: int) -> Status | None:
        self.end[c].append(self.t)
        if c == 0:
            return None
        self.parted = (self.t, float(self.z[1]), float(self.z[3]))
        return Status.until if self.ongoing else None


def _exponential(m: Array, degree: int) -> Array:
    """Terms m^j / j! of the exponential of a matrix, j = 0 … degree: times z the coefficients of a piece on [0, 1]."""
    terms = [np.eye(len(m))]
    for j in range(1, degree + 1):
        terms.append(m @ terms[-1] / j)
    return np.array(terms)


def _linear_system(scene: Scene, law: Any) -> _System:
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {scene!r}: a granular.Scene is needed, such as granular.scenes.three_balls().")
    if scene.n != 3 or scene.is_wall.tolist() != [True, False, False]:
        raise ValueError(f"scene is {scene!r}: a floor and two balls are needed, as in granular.scenes.three_balls().")
    square, damping = [], []
    for one in checked(law, scene):
        pair = one.pair
        if one.form is None or not one.is_linear:
            raise ValueError(f"law of pair {pair.index} is {one.law!r}: a linear law is needed, such as LinearDashpot; "
                             "for others use granular.md.")
        k, _, gamma, _ = one.form
        mass = float(scene.mass[scene.bodies(pair.index)[1]])
        square.append(_check.number(f"k of pair {pair.index}", k, above=0.0) / mass)
        damping.append(_check.number(f"gamma of pair {pair.index}", gamma, at_least=0.0) / mass)
    return _System(scene.gravity, (square[0], square[1]), (damping[0], damping[1]))


def _first_touch(scene: Scene) -> tuple[float, Array]:
    """Time in s to the first floor contact, and the state z there."""
    _check.every("gap", scene.gap, scene.gap >= 0.0, "balls that do not overlap yet are needed")
    (floor, upper), (fall, follow) = scene.gap.tolist(), scene.across(scene.velocity).tolist()
    t10 = time_to_contact(floor, fall, scene.gravity)
    if t10 == math.inf:
        raise ValueError(f"gap[0] is {floor!r}, closing at {-fall!r} m/s: the lower ball must fall on the floor.")
    gap = upper + follow * t10
    if gap < 0.0:
        raise ValueError(f"gap[1] is {upper!r}, closing at {-follow!r} m/s: the lower ball must reach the floor before "
                         "the balls meet.")
    return t10, np.array([0.0, -rate_at_contact(floor, fall, scene.gravity), -gap, -follow, 1.0])

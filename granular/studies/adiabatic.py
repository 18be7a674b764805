"""Three-body impact in the adiabatic limit: a light ball on a heavy one.

Two balls fall on a floor, with linear dashpots in both contacts. If the upper ball is far lighter than the lower one
(m2 ≪ m1), the lower ball moves as if it were alone and the upper one follows. With overlaps ξ0 (floor), ξ1 (balls)
and the accelerations a_c = (k_c ξ_c + γ_c ξ̇_c) / m_(c+1) of an active contact, 0 of any other:

    ξ̈0 = g - a0(t),        ξ̈1 = a0(t) - a1(t).

(Newton: ξ̈0 = g - a0 + (m2/m1) a1, ξ̈1 = a0 - (1 + m2/m1) a1.) This is Newton's equation for an upper ball so light
that the terms with m2/m1 are below rounding. `granular.md.simulate` solves it with m2, k12 and γ12 multiplied by 2⁻⁶⁰.

Müller & Pöschel, Phys. Rev. E 83, 041304 (2011), appendix A. Details beyond it are in ``docs/adiabatic.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granular import md
from granular._engine import check
from granular._engine.flight import rate_at_contact, time_to_contact
from granular.laws import LinearDashpot
from granular.laws.kinds import checked
from granular.run import until
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene, checked as checked_scene

__all__ = ["AdiabaticSolution", "contacts"]
__dir__ = __all__.copy

MASS_FACTOR = 2.0**-60
"""Factor of the upper ball's mass and of its law: m2/m1 becomes 1e-18 of itself.

It is a power of two, so that the motion of the upper ball is bitwise identical. With a smaller factor, rest could not
be distinguished from rounding.
"""


@check.face
@dataclass(frozen=True, eq=False)
class AdiabaticSolution:
    """Contacts of the light ball, as returned by `contacts`.

    The clock is 0 at the first touch of the lower ball and the floor.

    Attributes
    ----------
    t10, v10 : float
        Time from the scene's start to the first floor contact in s, and the lower ball's velocity there in m/s.
    contacts : (count, 2) array
        Onset and end in s of every contact of the two balls that begins before the second floor contact. The end is
        inf for a contact that lasts forever, and nan if the work limit was reached during it.
    floor_end, floor_again : float
        End of the first floor contact and onset of the second in s, inf for never, nan beyond the work limit.
    t_f : float
        End of the last of `contacts` in s, nan without contacts.
    v1, v2 : float
        Velocities of the lower and the upper ball at `t_f` in m/s, upwards positive.
    ongoing : bool
        Whether a contact of the balls was running when the second floor contact began. It was followed to its end,
        while the floor pushes again.
    status : Status
        `until`: the second floor contact has begun. `quiet`: no contact can follow (no gravity). `resting`: both
        contacts last forever (proved). `max_events`: the work limit was reached.
    steps : int
        Number of steps of `granular.md.simulate`.
    """

    t10: float
    v10: float
    contacts: check.Array
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
        """Separation speed v_r′ = v2 - v1 of the balls at `t_f` in m/s."""
        return self.v2 - self.v1


@check.face
def contacts(scene: Scene, law: Any, *, max_steps: int = 200_000) -> AdiabaticSolution:
    """Return the contacts of a light upper ball with the lower one.

    They end with the second floor contact. The solution is exact in the limit m2 → 0 with constant k/m2 and γ/m2 of the
    upper contact. The error is of order m2/m1.

    Parameters
    ----------
    scene : Scene
        A floor and two balls, such as `granular.scenes.three_balls`. The lower ball reaches the floor first.
    law : force law, or two force laws
        Linear in both pairs (trait ``linear(pair) -> (k, gamma)``).
    max_steps : int
        Work limit, in steps of `granular.md.simulate`. Few are needed unless a stiff or strongly over-damped upper
        contact lasts as long as a soft floor contact.

    Raises
    ------
    TypeError, ValueError
        If the scene is another one, or a law is not linear.
    """
    limit = check.whole("max_steps", max_steps, at_least=1)
    laws = _light_laws(scene, law)
    t10, touch = _first_touch(scene)
    first = md.simulate(touch, laws, until=until.contact(0, 2), max_steps=limit)
    count = first.count(1)
    run = _followed(first, laws, limit)
    never = math.nan if run.status is Status.max_events else math.inf
    log, floor = run.of(1)[:count], first.of(0)
    times = np.stack([log["t_begin"], np.where(np.isnan(log["t_end"]), never, log["t_end"])], axis=1)
    v1, v2 = log["v_out"][-1].tolist() if count else (math.nan, math.nan)
    if run.status is Status.resting:
        v1 = v2 = 0.0
    return AdiabaticSolution(
        t10=t10,
        v10=float(scene.velocity[0] + touch.velocity[1]),
        contacts=times,
        floor_end=float(floor["t_end"][0]) if floor["t_end"][0] > 0.0 else never,
        floor_again=float(first.time[-1]) if first.status is Status.until else never,
        t_f=float(times[-1, 1]) if count else math.nan,
        v1=float(scene.velocity[0]) + v1,
        v2=float(scene.velocity[0]) + v2,
        ongoing=run is not first,
        status=run.status,
        steps=run.stats["steps"],
    )


def _light_laws(scene: Scene, law: Any) -> list[LinearDashpot]:
    """Return the linear laws of both contacts, the upper one for a ball `MASS_FACTOR`."""
    walls = checked_scene(scene).is_wall.tolist()
    check.refuse({
        f"`scene` must have a floor and two balls, as in granular.scenes.three_balls(), got {scene}.":
            walls != [True, False, False],
        f"`scene` must have a floor at constant velocity and no forces, got {scene}. For other scenes use granular.md.":
            scene._flags,
    })
    laws = []
    for one, factor in zip(checked(law, scene), (1.0, MASS_FACTOR), strict=True):
        pair = one.pair
        if one.form is None or not one.is_linear:
            raise ValueError(f"The law of pair {pair.name} must be linear, such as LinearDashpot, got {one.law!r}. "
                             "For other laws use granular.md.")
        k, _, gamma, _ = one.form
        laws.append(LinearDashpot(check.number(f"`k` of pair {pair.name}", k, above=0.0) * factor,
                                  check.number(f"`gamma` of pair {pair.name}", gamma, at_least=0.0) * factor))
    return laws


def _first_touch(scene: Scene) -> tuple[float, Scene]:
    """Return the time in s of the first floor contact, and the scene there.

    The scene is in the frame of the floor, with an upper ball `MASS_FACTOR`.
    """
    check.every("gap", scene.gap, scene.gap >= 0.0, "non-negative")
    (floor, upper), (fall, follow) = scene.gap.tolist(), scene.across(scene.velocity).tolist()
    t10 = time_to_contact(floor, fall, scene.gravity)
    if t10 == math.inf:
        raise ValueError(f"The lower ball must fall on the floor, got gap[0] = {floor!r} m closing at {-fall!r} m/s.")
    gap = upper + follow * t10
    if gap < 0.0:
        raise ValueError(f"The lower ball must reach the floor before the balls meet, got gap[1] = {upper!r} m closing "
                         f"at {-follow!r} m/s.")
    v10 = rate_at_contact(floor, fall, scene.gravity)
    return t10, scene.replace(
        mass=scene.mass * [1.0, 1.0, MASS_FACTOR], gap=[0.0, gap], velocity=[0.0, v10, v10 + follow]
    )


def _followed(run: Trajectory, laws: list[LinearDashpot], limit: int) -> Trajectory:
    """Continue a run to the end of a ball contact at the second floor contact."""
    count = run.count(1)
    if run.status is not Status.until or not count or run.of(1)["t_end"][-1] > 0.0:
        return run
    run = md.simulate(run.scene, laws, until=until.contact(1, count + 1), max_steps=limit)
    return replace(run, status=Status.until) if run.of(1)["t_end"][count - 1] > 0.0 else run

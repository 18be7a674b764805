"""Three-body impact in the adiabatic limit: a light ball on a heavy one.

Two balls fall on a floor, with linear dashpots in both contacts. If the upper ball is far lighter than the lower one
(m2 ≪ m1), the lower ball moves as if the upper ball were absent. ξ0 is the overlap of floor and lower ball, ξ1 of the
two balls. With a_c = (k_c ξ_c + γ_c ξ̇_c) / m_(c+1) for an active contact c, and a_c = 0 without contact:

    ξ̈0 = g - a0(t),        ξ̈1 = a0(t) - a1(t).

(Newton: ξ̈0 = g - a0 + (m2/m1) a1, ξ̈1 = a0 - (1 + m2/m1) a1.) These are Newton's equations for an upper ball so light
that the terms with m2/m1 are below rounding error. `granular.md.simulate` solves them with m2, k12 and γ12 multiplied
by 2⁻⁶⁰.

Müller & Pöschel, Phys. Rev. E 83, 041304 (2011), appendix A. ``docs/theory/adiabatic.md`` has further details.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granular import md
from granular._engine import check, signature
from granular._engine.flight import rate_at_contact, time_to_contact
from granular.laws import LinearDashpot
from granular.laws.kinds import checked
from granular.run import until
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene, checked as checked_scene

__all__ = ["AdiabaticSolution", "contacts"]
__dir__ = __all__.copy

MASS_FACTOR = 2.0**-60
"""Factor of the upper ball's mass, stiffness and damping, about 1e-18.

It is a power of two, so that the motion of the upper ball is bitwise identical. With a smaller factor, rest could not
be distinguished from rounding errors.
"""


@signature.face
@dataclass(frozen=True, eq=False)
class AdiabaticSolution:
    """Contacts of the light ball, as returned by `contacts`.

    All times except `t10` are measured from the first contact of the lower ball with the floor.

    Attributes
    ----------
    t10, v10 : float
        Time from the scene's start to the first floor contact in s, and the lower ball's velocity there in m/s.
    contacts : (count, 2) array
        Onset and end in s of every contact of the two balls that begins before the second floor contact. The end is
        inf for a contact that lasts forever, and nan if the work limit was reached during it.
    floor_end, floor_again : float
        End of the first floor contact and onset of the second in s. inf: it never occurs. nan: the work limit was
        reached before it.
    t_f : float
        End of the last of `contacts` in s, nan without contacts.
    v1, v2 : float
        Velocities of the lower and the upper ball at `t_f` in m/s, upwards positive.
    ongoing : bool
        Whether the two balls were in contact when the second floor contact began. The solution then continues to the
        end of the contact of the balls, while the floor acts again.
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


@signature.face
def contacts(scene: Scene, law: Any, *, max_steps: int = 200_000) -> AdiabaticSolution:
    """Return the contacts of a light upper ball with the lower ball.

    The solution ends when the second floor contact begins. It is exact in the limit m2 → 0 with constant k/m2 and γ/m2
    of the upper contact. For a finite mass ratio its error is of order m2/m1.

    Parameters
    ----------
    scene : Scene
        A floor and two balls, such as `granular.scenes.three_balls`. The lower ball reaches the floor first.
    law : force law, or two force laws
        Linear in both pairs (trait ``linear(pair) -> (k, gamma)``).
    max_steps : int
        Work limit, in steps of `granular.md.simulate`. Defaults to 200 000. Few steps are needed, except if a stiff or
        strongly over-damped upper contact lasts as long as a soft floor contact.

    Raises
    ------
    TypeError, ValueError
        If the scene is not of this kind, or a law is not linear.
    """
    limit = check.integer("max_steps", max_steps, at_least=1)
    laws = _light_laws(scene, law)
    t10, scene_at_touch = _first_touch(scene)
    first_run = md.simulate(scene_at_touch, laws, until=until.contact(0, 2), max_steps=limit)
    count = first_run.count(1)
    run = _with_last_contact_completed(first_run, laws, limit)
    unfinished_end = math.nan if run.status is Status.max_events else math.inf
    ball_contacts, floor_contacts = run.of(1)[:count], first_run.of(0)
    intervals = np.stack([
        ball_contacts["t_begin"], np.where(np.isnan(ball_contacts["t_end"]), unfinished_end, ball_contacts["t_end"])
    ], axis=1)
    v1, v2 = ball_contacts["v_out"][-1].tolist() if count else (math.nan, math.nan)
    if run.status is Status.resting:
        v1 = v2 = 0.0
    return AdiabaticSolution(
        t10=t10,
        v10=float(scene.velocity[0] + scene_at_touch.velocity[1]),
        contacts=intervals,
        floor_end=float(floor_contacts["t_end"][0]) if floor_contacts["t_end"][0] > 0.0 else unfinished_end,
        floor_again=float(first_run.time[-1]) if first_run.status is Status.until else unfinished_end,
        t_f=float(intervals[-1, 1]) if count else math.nan,
        v1=float(scene.velocity[0]) + v1,
        v2=float(scene.velocity[0]) + v2,
        ongoing=run is not first_run,
        status=run.status,
        steps=run.stats["steps"],
    )


def _light_laws(scene: Scene, law: Any) -> list[LinearDashpot]:
    """Return the laws of the floor contact and of the ball contact as LinearDashpot.

    Stiffness and damping of the ball contact are multiplied by `MASS_FACTOR`.
    """
    walls = checked_scene(scene).is_wall.tolist()
    check.raise_if_true({
        f"`scene` must have a floor and two balls, as in granular.scenes.three_balls(), got {scene}.":
            walls != [True, False, False],
        f"`scene` must have a floor at constant velocity and no forces, got {scene}. For other scenes use granular.md.":
            scene._flags,
    })
    laws = []
    for law_of_pair, factor in zip(checked(law, scene), (1.0, MASS_FACTOR), strict=True):
        pair = law_of_pair.pair
        if law_of_pair.form is None or not law_of_pair.is_linear:
            raise ValueError(f"The law of pair {pair.name} must be linear, such as LinearDashpot, got "
                             f"{law_of_pair.law!r}. For other laws use granular.md.")
        k, _, gamma, _ = law_of_pair.form
        laws.append(LinearDashpot(check.number(f"`k` of pair {pair.name}", k, above=0.0) * factor,
                                  check.number(f"`gamma` of pair {pair.name}", gamma, at_least=0.0) * factor))
    return laws


def _first_touch(scene: Scene) -> tuple[float, Scene]:
    """Return the time in s of the first floor contact, and the scene at that time.

    The scene is in the frame of the floor, and the mass of the upper ball is multiplied by `MASS_FACTOR`.
    """
    check.every("gap", scene.gap, scene.gap >= 0.0, "non-negative")
    (floor_gap, ball_gap), (floor_gap_rate, ball_gap_rate) = scene.gap.tolist(), scene.across(scene.velocity).tolist()
    t10 = time_to_contact(floor_gap, floor_gap_rate, scene.gravity)
    if t10 == math.inf:
        raise ValueError(f"The lower ball must fall on the floor, got gap[0] = {floor_gap!r} m closing at "
                         f"{-floor_gap_rate!r} m/s.")
    gap = ball_gap + ball_gap_rate * t10
    if gap < 0.0:
        raise ValueError(f"The lower ball must reach the floor before the balls meet, got gap[1] = {ball_gap!r} m "
                         f"closing at {-ball_gap_rate!r} m/s.")
    v10 = rate_at_contact(floor_gap, floor_gap_rate, scene.gravity)
    return t10, scene.replace(
        mass=scene.mass * [1.0, 1.0, MASS_FACTOR], gap=[0.0, gap], velocity=[0.0, v10, v10 + ball_gap_rate]
    )


def _with_last_contact_completed(run: Trajectory, laws: list[LinearDashpot], limit: int) -> Trajectory:
    """Return a run that continues to the end of an unfinished contact of the balls.

    `run` ended when the second floor contact began. If the balls are not in contact then, `run` is returned unchanged.
    """
    count = run.count(1)
    if run.status is not Status.until or not count or run.of(1)["t_end"][-1] > 0.0:
        return run
    run = md.simulate(run.scene, laws, until=until.contact(1, count + 1), max_steps=limit)
    return replace(run, status=Status.until) if run.of(1)["t_end"][count - 1] > 0.0 else run

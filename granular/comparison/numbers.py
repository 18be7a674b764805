"""Numbers that describe the difference between the two runs of a comparison."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import edmd
from granular._engine import check
from granular._engine.callables import callback
from granular.comparison import align, measures, outcome
from granular.comparison.episodes import Departure, Departures, is_at_rest, rest_differences
from granular.comparison.measures import Overlap
from granular.comparison.outcome import Components, PairOutcome, components, counted, units
from granular.laws.kinds import resolved
from granular.laws.rules import ConstantRestitution
from granular.md.binary import LawRule, restitution_or_nan
from granular.run import until as stop
from granular.run.trajectory import EARLY_STATUSES, Trajectory
from granular.scene import Scene

if TYPE_CHECKING:
    from granular.comparison.further import Rises

STICKING_SPEED_FACTOR = 1e-9
"""Speed up to which hard spheres stick, relative to the fastest approach."""


@dataclass(frozen=True, eq=False)
class ComparedRuns:
    """Hard and soft run of one scene, with all derived numbers; see `Comparison`."""

    scene: Scene
    law: tuple[Any, ...]
    rule: Any
    until: stop.Until | None
    t_end: float | None
    hard: Trajectory
    soft: Trajectory
    hard_options: Mapping[str, Any]
    soft_options: Mapping[str, Any]

    @cached_property
    def impact_speed(self) -> float:
        """Approach speed v₁ in m/s of the first collision of hard spheres, or nan.

        See `granular.measures.impact_speed`.
        """
        return measures.impact_speed(self.counted[0])

    @cached_property
    def settled(self) -> Trajectory:
        """The hard run. If it collapsed, it is repeated with slow collisions sticking."""
        return self._carried_on(self.hard, self.hard_options)

    @cached_property
    def counted(self) -> tuple[Trajectory, Trajectory]:
        """The hard and the soft run, without contacts at rounding level.

        Simultaneous collisions of a pair of hard spheres are combined into one contact.
        """
        return counted(outcome.combine_simultaneous(self.settled), self.soft)

    @cached_property
    def continued(self) -> tuple[Trajectory, Trajectory]:
        """Both runs, continued to equal contact counts of each pair if possible.

        Every contact is followed to its end. See `granular.comparison.align.equalize_counts`.
        """
        return align.equalize_counts(*self.counted, self.soft_options)

    @property
    def followed(self) -> Trajectory:
        """The soft run of `continued`."""
        return self.continued[1]

    @cached_property
    def pairs(self) -> tuple[PairOutcome, ...]:
        """Numbers of contacts and separation speeds of each pair."""
        return outcome.pair_outcomes(*self.continued, self.counted[1])

    @cached_property
    def components(self) -> Components:
        """Components: groups of balls that touch each other in either run."""
        return components(*self.continued)

    @cached_property
    def units(self) -> check.Array:
        """Unit U of the error in m/s of each component, (count,).

        See `granular.comparison.outcome.units`.
        """
        return units(*self.continued, self.components, self.weight)

    @cached_property
    def weight(self) -> check.Array:
        """Speed in m/s that a ball of each pair gains by weight during a contact, (n-1,).

        See `granular.comparison.outcome.Components.weight`.
        """
        return self.components.weight(self.continued[1])

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Soft contacts of neighbouring pairs that overlap in time.

        Such overlaps are the reason why the results of the two engines differ.
        """
        return measures.overlapping(self.counted[1])

    @cached_property
    def groups(self) -> dict[str, float]:
        """Dimensionless groups of the scene at the speed of the first collision."""
        return measures.groups(self.scene, self.law, self.impact_speed)

    @cached_property
    def restitution_spec(self) -> tuple[float, ...]:
        """ε of each pair by the collision rule, at the speed of the first collision."""
        if isinstance(self.rule, LawRule) and self.rule.laws is self.law:
            return self.law_restitution
        rules = self.rule if isinstance(self.rule, (list, tuple)) else [self.rule] * len(self.pairs)
        return tuple(float(rule(self._speed, pair)) for rule, pair in zip(rules, self.scene.pairs, strict=True))

    @cached_property
    def law_restitution(self) -> tuple[float, ...]:
        """ε of an isolated contact of each pair under its force law.

        The approach speed is the speed of the first collision. nan if such a contact does not end.
        """
        return tuple(resolved(self.law, self.scene).column(lambda law: restitution_or_nan(law, self._speed)).tolist())

    @cached_property
    def restitution_ratio(self) -> float:
        """Ratio ε_eff/ε_spec for a floor and two balls with equal ε.

        Closed form of Müller and Pöschel (2011). nan for other scenes, also with a driven floor or with forces.
        """
        eps, v_rel = self.restitution_spec, self.pairs[-1].soft_v_rel
        if not is_drop(self.scene) or max(eps) - min(eps) > 1e-9 or not self.impact_speed > 0.0:
            return math.nan
        return float(effective(v_rel, self.impact_speed)) / eps[0]

    @property
    def drop(self) -> float:
        """Height in m through which two to five balls fall together onto a floor, or nan.

        It is also nan for more balls, because the free flight of the top ball takes longer than the comparison.
        """
        falls = 2 < self.scene.n <= 6 and fall_together(self.scene) and self.scene.gravity > 0.0
        return self.impact_speed**2 / (2.0 * self.scene.gravity) if falls else math.nan

    @cached_property
    def rises(self) -> Rises:
        """Height in m to which the top ball rises, in the hard run and in the soft run.

        It is the first apex of its free flight after a contact. A run that stops earlier is continued.
        ``rises(bounce=2)`` starts at the second contact with the floor. Heights are measured from the floor, radii
        subtracted. A driven floor counts without its motion m(t) - m(t_start), so its initial position has the height
        0 if its constant velocity is 0. A ball whose last contact is at height 0 leaves it at √(2 g rise). nan without
        gravity, for balls that rest on a driven floor, or if the apex cannot be determined.
        """
        from granular.comparison.further import rises

        return rises(self)

    def effective_restitution(
        self, observable: Callable[[Trajectory], float] | None = None, resolution: int = 41
    ) -> tuple[float, ...]:
        """All common ε in [0, 1] with which EDMD reproduces the soft run's observable.

        Parameters
        ----------
        observable : callable, optional
            Function of a trajectory that returns a number. Defaults to the separation speed of the last pair after its
            last contact.
        resolution : int
            Number of values of ε at which EDMD is run to find sign changes. Defaults to 41.

        Returns
        -------
        tuple of float
            Empty if there is no such ε, several values if it is not unique. EDMD is discontinuous in ε where the
            number of collisions changes. A jump across the value is not a root and is left out.

        Raises
        ------
        ValueError
            If no observable is given and a wall is driven or thermal. The separation speed then depends on the phase
            of the wall, which the duration of soft contacts shifts, or on a random speed.
        """
        if observable is None and (self.scene.driven or self.scene.heated):
            reason = "driven wall, a speed depends on the phase, which the duration of soft contacts shifts" if (
                self.scene.driven) else "thermal wall, a speed depends on the last random draw"
            raise ValueError(f"`observable` must be given for this scene, got None. At a {reason}. Give a function of "
                             "the run, such as a mean height.")
        from granular.comparison.further import roots

        callback("observable", observable, "run")
        restitutions = np.linspace(
            0.0, 1.0, check.integer("resolution", resolution, at_least=2, at_most=check.MAX_REQUESTED_COUNT)
        )
        measure = observable or self._last_separation
        target = observable(self.soft) if observable else self.pairs[-1].soft_v_rel

        def miss(eps: float) -> float:
            return measure(edmd.simulate(self.scene, ConstantRestitution(eps), **self.hard_options)) - target

        return roots(miss, restitutions[1:], abs(target))

    def _last_separation(self, hard: Trajectory) -> float:
        """Separation speed in m/s of the last pair of a hard run after its last contact.

        Contacts at rounding level are ignored.
        """
        return float(outcome.separations(counted(hard, self.soft)[0])[0][-1])

    @cached_property
    def error(self) -> float:
        """Error of the hard spheres, the number that decides the answer.

        error = max over components, episodes E and balls i of |u(i, E, soft) - u(i, E, hard)| / U

        An episode E is a group of soft contacts linked by common balls and overlaps in time. u is the velocity with
        which a ball leaves its last contact in E, and U the unit of the component, see
        docs/guide/error-definition.md. If a pair that comes to rest differs by more, its difference is the error. The
        error is 0 if nothing collides, and nan if a run did not reach its end.
        """
        return math.nan if self._early else float(self.errors.max(initial=0.0))

    @cached_property
    def errors(self) -> check.Array:
        """Error of each component in its unit U, (count,).

        It is 0 for a component whose hard spheres rest on each other from the start.
        """
        rest_difference = np.zeros(self.scene.n_pairs)
        rest_difference[list(self.resting)] = list(self.resting.values())
        departure_error = np.maximum(self.components.largest(rest_difference) / self.units, self._departures[1])
        return np.where(self.lying[:-1], 0.0, departure_error)

    @property
    def deciding(self) -> Departure | None:
        """Ball and episode with the largest error.

        None if nothing collides, or if a pair at rest has the largest error.
        """
        return self.departure(int(self.errors.argmax())) if self.error > 0.0 else None

    def departure(self, j: int) -> Departure | None:
        """Ball and episode with the largest error of component `j`.

        None if the component has no error, or if a pair at rest has the largest error.
        """
        departures, largest, index = self._departures
        decides = self.errors[j] == largest[j] > 0.0
        return departures.departure(int(index[j]), float(self.units[j])) if decides else None

    @cached_property
    def _departures(self) -> tuple[Departures, check.Array, Any]:
        """All departures, and the largest error of each component with its departure.

        The second array has the errors in the unit U, (count,). The third array has the numbers of the departures.
        """
        departures = Departures(*self.continued, self.weight,
                           lambda pair, speed: align.allowed_delay(*self.counted)(pair, speed))
        part, largest = self.components.of_ball[departures.ball], np.zeros(self.components.count + 1)
        index = np.zeros(self.components.count + 1, np.int64)
        error = np.fmax(departures.apart, 0.0) / np.append(self.units, math.inf)[part]
        order = np.argsort(error, kind="stable")
        largest[part[order]], index[part[order]] = error[order], order  # the last assignment stays
        return departures, largest[:-1], index[:-1]

    @cached_property
    def lying(self) -> Any:
        """Whether the hard spheres of each component rest on each other from the start.

        The array has shape (count + 1,). The last entry is False. It is used for balls that belong to no component.
        """
        hard, is_lying = self.continued[0], np.append(np.ones(self.components.count, np.bool_), False)
        is_lying[self.components.of_pair[(outcome.counts(hard) > 0) | (hard.gap[-1] != 0.0)]] = False
        return is_lying

    @cached_property
    def resting(self) -> dict[int, float]:
        """Pairs that come to rest in one of the runs, with their differences in m/s.

        See `granular.comparison.episodes.rest_differences`.
        """
        hard, soft = self.continued
        any_rest = np.any(is_at_rest(hard, soft))
        return dict(rest_differences(hard, soft, self.weight)) if any_rest else {}

    @cached_property
    def other_counts(self) -> Any:
        """Whether the contact counts of each pair differ, (n-1,).

        False for pairs in `resting`.
        """
        differ = np.not_equal(*map(outcome.counts, self.continued))
        differ[list(self.resting)] = False
        return differ

    @cached_property
    def unknown(self) -> Any:
        """Whether each pair's last soft contact could not be followed to its end, (n-1,)."""
        return align.has_unfollowed_contact(self.continued[1])

    @property
    def _early(self) -> bool:
        return self.settled.status in EARLY_STATUSES or self.soft.status in EARLY_STATUSES

    @property
    def _speed(self) -> float:
        """Approach speed in m/s at which ε is evaluated: `impact_speed`, or 1 without one."""
        return self.impact_speed if self.impact_speed > 0.0 else 1.0

    def _carried_on(self, run: Trajectory, options: Mapping[str, Any]) -> Trajectory:
        """Repeat a hard run that collapsed, with slow collisions that stick.

        Other runs are returned unchanged, as are collapsed runs that the tie rule cannot repeat.
        """
        if "verdict" in run.stats:
            merge_options = {
                **options,
                "collapse": "merge",
                "merge_below": STICKING_SPEED_FACTOR * measures.fastest_approach(run),
            }
            with suppress(ValueError, ArithmeticError):  # the tie rule cannot be applied
                return edmd.simulate(run.scene, self.rule, **merge_options)
        return run

def fall_together(scene: Scene) -> bool:
    """Whether all balls have equal velocities above an undriven floor.

    There must be no ceiling, thermal wall or external force.
    """
    return scene.is_wall.tolist() == [True] + [False] * (scene.n - 1) and (
        bool((scene.velocity[1:] == scene.velocity[1]).all()) and not scene._flags)


def is_drop(scene: Scene) -> bool:
    """Whether two balls fall together on an undriven floor without other forces."""
    return scene.n == 3 and fall_together(scene)


def effective(v_rel: Any, impact: Any) -> Any:
    """Effective ε from separation and impact speeds, elementwise.

    ε_eff = (√(1 + 4x) - 1)/2 with x = v_r′/|v10|. nan for balls that approach each other (v_r′ < 0).

    Parameters
    ----------
    v_rel : float or array
        Separation speed v_r′ of the two balls in m/s.
    impact : float or array
        Speed |v10| in m/s with which the lower ball hits the floor.
    """
    x = np.where(v_rel >= 0.0, v_rel, math.nan) / impact
    return 2.0 * x / (1.0 + np.sqrt(1.0 + 4.0 * x))


def smaller_radius(scene: Scene) -> Any:
    """Smaller radius in m of the balls of each pair, inf if neither has a radius.

    Walls and points have the radius 0, which is ignored.
    """
    return np.minimum(*scene.sides(np.where(scene.radius > 0.0, scene.radius, math.inf)))

"""Numbers that describe the difference of the two runs of a comparison."""

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
from granular.comparison import align, measures, outcome
from granular.comparison.episodes import Departure, Departures, at_rest, rests_apart
from granular.comparison.measures import Overlap
from granular.comparison.outcome import Components, PairOutcome, components, counted, units
from granular.laws.kinds import resolved
from granular.laws.rules import ConstantRestitution
from granular.md.binary import LawRule, at_speed_or_nan
from granular.run import until as stop
from granular.run.trajectory import EARLY_STATUSES, Trajectory
from granular.scene import Scene

if TYPE_CHECKING:
    from granular.comparison.further import Rises

STICKING_SPEED_FACTOR = 1e-9
"""Hard spheres stick after a collapse below this share of the fastest approach."""


@dataclass(frozen=True, eq=False)
class Compared:
    """One scene run as hard and as soft spheres, with numbers; see `Comparison`."""

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
        """Speed v₁ in m/s of the first hard-sphere collision, or nan.

        See `granular.measures.impact_speed`.
        """
        return measures.impact_speed(self.counted[0])

    @cached_property
    def settled(self) -> Trajectory:
        """The hard run. After a collapse it is continued, and slow collisions stick."""
        return self._carried_on(self.hard, self.hard_options)

    @cached_property
    def counted(self) -> tuple[Trajectory, Trajectory]:
        """The hard and the soft run, without contacts at rounding level.

        Simultaneous collisions of a pair are combined.
        """
        return counted(outcome.at_once(self.settled), self.soft)

    @cached_property
    def levelled(self) -> tuple[Trajectory, Trajectory]:
        """Both runs, continued until contact counts are equal where possible.

        Every contact is followed to its end.
        """
        return align.levelled(*self.counted, self.soft_options)

    @property
    def followed(self) -> Trajectory:
        """The soft run of `levelled`."""
        return self.levelled[1]

    @cached_property
    def pairs(self) -> tuple[PairOutcome, ...]:
        """Numbers of contacts and separation speeds of each pair."""
        return outcome.pair_outcomes(*self.levelled, self.counted[1])

    @cached_property
    def components(self) -> Components:
        """Components: balls that touch each other in either run."""
        return components(*self.levelled)

    @cached_property
    def units(self) -> check.Array:
        """Unit of the error in m/s of each component.

        See `granular.comparison.outcome.units`.
        """
        return units(*self.levelled, self.components)

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Soft contacts of neighbouring pairs that overlap in time.

        They are the reason why the two engines differ.
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
        return tuple(resolved(self.law, self.scene).column(lambda law: at_speed_or_nan(law, self._speed)).tolist())

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
        """Height in m from which two to five balls fall together on a floor, or nan.

        It is also nan for more balls, because their `rises` take longer than the comparison.
        """
        falls = 2 < self.scene.n <= 6 and fall_together(self.scene) and self.scene.gravity > 0.0
        return self.impact_speed**2 / (2.0 * self.scene.gravity) if falls else math.nan

    @cached_property
    def rises(self) -> Rises:
        """Height in m to which the top ball rises, as a hard and as a soft sphere.

        It is the first apex of its free flight after a contact. A run that stops earlier is continued.
        ``rises(bounce=2)`` starts at the second contact with the floor. A ball whose last contact is at height 0
        leaves it at √(2 g rise). nan without gravity, or if the apex cannot be determined.
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
            Number of values of ε at which EDMD is run to find sign changes.

        Returns
        -------
        tuple of float
            Empty without such an ε, several values if it is not unique. EDMD is discontinuous in ε where the
            number of collisions changes. A jump across the value is not a root and is left out.

        Raises
        ------
        ValueError
            Without an observable if a wall is driven or thermal. The separation speed then depends on the phase of the
            wall, which is shifted by the duration of soft contacts, or on the drawn speed.
        """
        if observable is None and (self.scene.driven or self.scene.heated):
            why = "driven wall, a speed depends on the phase, which the duration of soft contacts shifts" if (
                self.scene.driven) else "thermal wall, a speed depends on the last random draw"
            raise ValueError(f"`observable` must be given for this scene, got None. At a {why}. Give a function of the "
                             "run, such as a mean height.")
        from granular.comparison.further import roots

        check.callback("observable", observable, "run")
        fractions = np.linspace(
            0.0, 1.0, check.whole("resolution", resolution, at_least=2, at_most=check.MAX_REQUESTED_COUNT)
        )
        measure = observable or self._last_separation
        target = observable(self.soft) if observable else self.pairs[-1].soft_v_rel

        def miss(eps: float) -> float:
            return measure(edmd.simulate(self.scene, ConstantRestitution(eps), **self.hard_options)) - target

        return roots(miss, fractions[1:], abs(target))

    def _last_separation(self, hard: Trajectory) -> float:
        """Separation speed in m/s of the last pair after its last contact that counts."""
        return float(outcome.separations(counted(hard, self.soft)[0])[0][-1])

    @cached_property
    def error(self) -> float:
        """Error of the hard spheres, the number that decides the answer.

        error = max over components, episodes E and balls i of |u(i, E, soft) - u(i, E, hard)| / U

        An episode E is a group of soft contacts linked by common balls and overlaps in time. u is the velocity with
        which a ball leaves its last contact in E, and U the unit of the component, see docs/concepts.md. The largest
        difference of a pair that comes to rest counts if it is larger. The error is 0 if nothing collides, and nan if
        a run did not reach its end.
        """
        return math.nan if self._early else float(self.errors.max(initial=0.0))

    @cached_property
    def errors(self) -> check.Array:
        """Error of each component in its unit. 0 if its balls rest from the start."""
        at_rest = np.zeros(self.scene.n_pairs)
        at_rest[list(self.resting)] = list(self.resting.values())
        off = np.maximum(self.components.largest(at_rest) / self.units, self._departures[1])
        return np.where(self.lying[:-1], 0.0, off)

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
        found, largest, which = self._departures
        decides = self.errors[j] == largest[j] > 0.0
        return found.departure(int(which[j]), float(self.units[j])) if decides else None

    @cached_property
    def _departures(self) -> tuple[Departures, check.Array, Any]:
        """All departures, and the largest difference and its row for each component."""
        found = Departures(*self.levelled, self.components.weight(self.levelled[1]),
                           lambda pair, speed: align.lags(*self.counted)(pair, speed))
        part, largest = self.components.of_ball[found.ball], np.zeros(self.components.count + 1)
        which = np.zeros(self.components.count + 1, np.int64)
        off = np.nan_to_num(found.apart) / np.append(self.units, math.inf)[part]
        order = np.argsort(off, kind="stable")
        largest[part[order]], which[part[order]] = off[order], order  # the last assignment stays
        return found, largest[:-1], which[:-1]

    @cached_property
    def lying(self) -> Any:
        """Whether the hard spheres of each component rest on each other from the start.

        A last entry, False, stands for no component.
        """
        hard, lies = self.levelled[0], np.append(np.ones(self.components.count, np.bool_), False)
        lies[self.components.of_pair[(outcome.counts(hard) > 0) | (hard.gap[-1] != 0.0)]] = False
        return lies

    @cached_property
    def resting(self) -> dict[int, float]:
        """Pairs that come to rest in one of the runs, and their difference in m/s."""
        hard, soft = self.levelled
        rest = np.any(at_rest(hard, soft))
        return dict(rests_apart(hard, soft, self.components.weight(soft))) if rest else {}

    @cached_property
    def other_counts(self) -> Any:
        """Whether the contact counts of each pair differ, except at rest, (n-1,)."""
        other = np.not_equal(*map(outcome.counts, self.levelled))
        other[list(self.resting)] = False
        return other

    @cached_property
    def unknown(self) -> Any:
        """Whether the last soft contact of each pair could not be followed, (n-1,)."""
        return align.unfollowed(self.levelled[1])

    @property
    def _early(self) -> bool:
        return self.settled.status in EARLY_STATUSES or self.soft.status in EARLY_STATUSES

    @property
    def _speed(self) -> float:
        """Speed in m/s at which ε is evaluated."""
        return self.impact_speed if self.impact_speed > 0.0 else 1.0

    def _carried_on(self, run: Trajectory, options: Mapping[str, Any]) -> Trajectory:
        """Repeat a hard run that ended in a collapse, with slow collisions sticking."""
        if "verdict" in run.stats:
            merging = {
                **options,
                "collapse": "merge",
                "merge_below": STICKING_SPEED_FACTOR * measures.fastest_approach(run),
            }
            with suppress(ValueError, ArithmeticError):  # a tie rule that has no answer
                return edmd.simulate(run.scene, self.rule, **merging)
        return run

def fall_together(scene: Scene) -> bool:
    """Whether all balls fall on, or hit, an undriven floor with equal velocities.

    Other forces are absent.
    """
    return scene.is_wall.tolist() == [True] + [False] * (scene.n - 1) and (
        bool((scene.velocity[1:] == scene.velocity[1]).all()) and not scene._flags)


def is_drop(scene: Scene) -> bool:
    """Whether two balls fall together on an undriven floor without other forces."""
    return scene.n == 3 and fall_together(scene)


def effective(v_rel: Any, impact: Any) -> Any:
    """Effective ε from separation and impact speeds, nan for approaching balls.

    ε_eff = (√(1 + 4x) - 1)/2 with x = v_r′/|v10|, elementwise.
    """
    x = np.where(v_rel >= 0.0, v_rel, math.nan) / impact
    return 2.0 * x / (1.0 + np.sqrt(1.0 + 4.0 * x))


def smaller_radius(scene: Scene) -> Any:
    """Smaller radius in m of the balls of each pair; inf if neither has a radius."""
    return np.minimum(*scene.sides(np.where(scene.radius > 0.0, scene.radius, math.inf)))

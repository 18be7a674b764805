"""Both runs of a scene, and the numbers that tell them apart."""

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
from granular.run.trajectory import EARLY, Trajectory
from granular.scene import Scene

if TYPE_CHECKING:
    from granular.comparison.further import Rises

MERGED = 1e-9
"""After a collapse, hard spheres that collide at less than this share of the fastest impact stick."""


@dataclass(frozen=True, eq=False)
class Compared:
    """One scene run as hard and as soft spheres, and the numbers that tell the two runs apart; see `Comparison`."""

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
        """v₁ in m/s, the speed of the first collision of the hard spheres, `measures.impact_speed`; nan without."""
        return measures.impact_speed(self.counted[0])

    @cached_property
    def settled(self) -> Trajectory:
        """The hard run; one that ended in a collapse is carried on, those that collide ever more slowly stick."""
        return self._carried_on(self.hard, self.hard_options)

    @cached_property
    def counted(self) -> tuple[Trajectory, Trajectory]:
        """The hard and the soft run without contacts that are rounding; collisions of a pair in one instant are one."""
        return counted(outcome.at_once(self.settled), self.soft)

    @cached_property
    def levelled(self) -> tuple[Trajectory, Trajectory]:
        """Both runs with the same contacts of every pair as far as they have them, each followed to its end."""
        return align.levelled(*self.counted, self.soft_options)

    @property
    def followed(self) -> Trajectory:
        """The soft run without contacts that are rounding, those running or to come at its end followed to theirs."""
        return self.levelled[1]

    @cached_property
    def pairs(self) -> tuple[PairOutcome, ...]:
        """Contacts and separation speeds, pair by pair."""
        return outcome.pair_outcomes(*self.levelled, self.counted[1])

    @cached_property
    def components(self) -> Components:
        """Balls that touch each other in either run."""
        return components(*self.levelled)

    @cached_property
    def units(self) -> check.Array:
        """Largest closing speed in m/s of each component, see `granular.comparison.outcome.units`."""
        return units(*self.levelled, self.components)

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Contacts of neighbouring pairs that share a span of time in the soft run: why the engines differ."""
        return measures.overlapping(self.counted[1])

    @cached_property
    def groups(self) -> dict[str, float]:
        """Dimensionless groups of the scene at the speed of its first collision."""
        return measures.groups(self.scene, self.law, self.impact_speed)

    @cached_property
    def restitution_spec(self) -> tuple[float, ...]:
        """ε with which the hard balls of each pair collide, by the rule, at the speed of the first collision."""
        if isinstance(self.rule, LawRule) and self.rule.laws is self.law:
            return self.law_restitution
        rules = self.rule if isinstance(self.rule, (list, tuple)) else [self.rule] * len(self.pairs)
        return tuple(float(rule(self._speed, pair)) for rule, pair in zip(rules, self.scene.pairs, strict=True))

    @cached_property
    def law_restitution(self) -> tuple[float, ...]:
        """ε that the force law of each pair gives an isolated contact at the speed of the first collision.

        nan where such a contact does not end.
        """
        return tuple(resolved(self.law, self.scene).column(lambda law: at_speed_or_nan(law, self._speed)).tolist())

    @cached_property
    def restitution_ratio(self) -> float:
        """ε_eff/ε_spec for floor and two balls of one ε, from the closed form of the paper; nan for other scenes, with
        a driven floor or forces too."""
        eps, v_rel = self.restitution_spec, self.pairs[-1].soft_v_rel
        if not is_drop(self.scene) or max(eps) - min(eps) > 1e-9 or not self.impact_speed > 0.0:
            return math.nan
        return float(effective(v_rel, self.impact_speed)) / eps[0]

    @property
    def drop(self) -> float:
        """Height in m from which two to five balls fall on a floor together; nan for other scenes, also of more balls,
        whose `rises` take longer than the comparison."""
        falls = 2 < self.scene.n <= 6 and fall_together(self.scene) and self.scene.gravity > 0.0
        return self.impact_speed**2 / (2.0 * self.scene.gravity) if falls else math.nan

    @cached_property
    def rises(self) -> Rises:
        """How high in m the top ball rises as hard and as soft sphere, if need be after the stop; nan without gravity,
        or if it cannot be told.

        The first apex of its free flight after it has been touched; a run that stops earlier is carried on.
        ``rises(bounce=2)`` counts from the second contact with the floor on. A ball that was last touched at the
        height 0 left at √(2 g rise).
        """
        from granular.comparison.further import rises

        return rises(self)

    def effective_restitution(
        self, observable: Callable[[Trajectory], float] | None = None, resolution: int = 41
    ) -> tuple[float, ...]:
        """All common ε in [0, 1] with which EDMD gives the soft run's value of an observable.

        Parameters
        ----------
        observable : callable, optional
            Trajectory → float; default: the separation speed of the last pair after its last contact.
        resolution : int
            Number of ε at which EDMD is run to find changes of sign.

        Returns
        -------
        tuple of float
            Empty: no ε does it. Several: it is not unique. EDMD is not continuous in ε where the number of collisions
            changes; a jump across the value is not a root and is left out.

        Raises
        ------
        ValueError
            Without an observable where a wall is driven or thermal: there a speed hangs on the phase, which soft
            contacts shift, or on what was drawn.
        """
        if observable is None and (self.scene.driven or self.scene.heated):
            why = "a driven wall a speed hangs on the phase, which the duration of soft contacts shifts" if (
                self.scene.driven) else "a thermal wall a speed hangs on what was drawn last"
            raise ValueError(f"observable is None: at {why}; give a function of the run, such as a mean height.")
        from granular.comparison.further import roots

        check.callback("observable", observable, "run")
        fractions = np.linspace(0.0, 1.0, check.whole("resolution", resolution, at_least=2, at_most=check.MOST))
        measure = observable or self._last_separation
        target = observable(self.soft) if observable else self.pairs[-1].soft_v_rel

        def miss(eps: float) -> float:
            return measure(edmd.simulate(self.scene, ConstantRestitution(eps), **self.hard_options)) - target

        return roots(miss, fractions[1:], abs(target))

    def _last_separation(self, hard: Trajectory) -> float:
        """Separation speed in m/s of the last pair after its last contact that is not rounding."""
        return float(outcome.separations(counted(hard, self.soft)[0])[0][-1])

    @cached_property
    def error(self) -> float:
        """How far hard spheres are off, in closing speeds: the one number that the answer judges.

        error = max over components, episodes E and balls i of |u(i, E, soft) - u(i, E, hard)| / U

        An episode is a group of soft contacts linked by common balls and overlaps in time, u the velocity with which a
        ball leaves its last contact in it, U the largest closing speed of the component; see docs/concepts.md. The
        largest difference of a pair that comes to rest counts if it is larger. 0 where nothing collides; nan where a
        run did not get to its end.
        """
        return math.nan if self._early else float(self.errors.max(initial=0.0))

    @cached_property
    def errors(self) -> check.Array:
        """The error of each component, in its unit; 0 where balls rest on each other from the start."""
        at_rest = np.zeros(self.scene.n_pairs)
        at_rest[list(self.resting)] = list(self.resting.values())
        off = np.maximum(self.components.largest(at_rest) / self.units, self._departures[1])
        return np.where(self.lying[:-1], 0.0, off)

    @property
    def deciding(self) -> Departure | None:
        """The ball and the episode that decide the error; None if nothing collides, or a pair at rest decides."""
        return self.departure(int(self.errors.argmax())) if self.error > 0.0 else None

    def departure(self, j: int) -> Departure | None:
        """The ball and the episode that decide the error of component `j`; None if it has none, or at rest."""
        found, largest, which = self._departures
        decides = self.errors[j] == largest[j] > 0.0
        return found.departure(int(which[j]), float(self.units[j])) if decides else None

    @cached_property
    def _departures(self) -> tuple[Departures, check.Array, Any]:
        """All departures; of each component the largest difference in its unit, and the number of its departure."""
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
        """Whether hard spheres of each component rest on each other from the start, and one more for no component."""
        hard, lies = self.levelled[0], np.append(np.ones(self.components.count, np.bool_), False)
        lies[self.components.of_pair[(outcome.counts(hard) > 0) | (hard.gap[-1] != 0.0)]] = False
        return lies

    @cached_property
    def resting(self) -> dict[int, float]:
        """Pairs whose last contact has no end in one of the runs, and how far in m/s the runs differ there."""
        hard, soft = self.levelled
        rest = np.any(at_rest(hard, soft))
        return dict(rests_apart(hard, soft, self.components.weight(soft))) if rest else {}

    @cached_property
    def other_counts(self) -> Any:
        """Whether each pair has other numbers of contacts in the two runs, (n-1,), otherwise than where it rests."""
        other = np.not_equal(*map(outcome.counts, self.levelled))
        other[list(self.resting)] = False
        return other

    @cached_property
    def unknown(self) -> Any:
        """Whether the last soft contact of each pair was still running and could not be followed, (n-1,)."""
        return align.unfollowed(self.levelled[1])

    @property
    def _early(self) -> bool:
        return self.settled.status in EARLY or self.soft.status in EARLY

    @property
    def _speed(self) -> float:
        """A speed in m/s at which ε can be asked for."""
        return self.impact_speed if self.impact_speed > 0.0 else 1.0

    def _carried_on(self, run: Trajectory, options: Mapping[str, Any]) -> Trajectory:
        """The run of hard spheres; after a collapse with those that collide ever more slowly sticking."""
        if "verdict" in run.stats:
            merging = {**options, "collapse": "merge", "merge_below": MERGED * measures.fastest_approach(run)}
            with suppress(ValueError, ArithmeticError):  # a tie rule that has no answer
                return edmd.simulate(run.scene, self.rule, **merging)
        return run

def fall_together(scene: Scene) -> bool:
    """Whether balls fall on a floor, or meet it, all at one speed, without driven walls or other forces."""
    return scene.is_wall.tolist() == [True] + [False] * (scene.n - 1) and (
        bool((scene.velocity[1:] == scene.velocity[1]).all()) and not scene._flags)


def is_drop(scene: Scene) -> bool:
    """Whether two balls fall on a floor together, without driven walls or other forces."""
    return scene.n == 3 and fall_together(scene)


def effective(v_rel: Any, impact: Any) -> Any:
    """ε_eff = (√(1 + 4x) - 1)/2, x = v_r′/|v10|, of arrays; nan where the balls still approach."""
    x = np.where(v_rel >= 0.0, v_rel, math.nan) / impact
    return 2.0 * x / (1.0 + np.sqrt(1.0 + 4.0 * x))


def smaller_radius(scene: Scene) -> Any:
    """Smaller radius in m of the balls of each pair; inf if neither has one."""
    return np.minimum(*scene.sides(np.where(scene.radius > 0.0, scene.radius, math.inf)))

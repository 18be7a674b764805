"""Both runs of a scene, and the numbers that tell them apart.
May be skipped: numbers, to be looked up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import _check, edmd, end_time, isolation, measures, outcome, until as stop
from granular.binary import LawRule, at_speed_or_nan
from granular.laws.kinds import resolved
from granular.measures import Overlap
from granular.outcome import Components, PairOutcome, components, counted, differences, rests_apart, units
from granular.rules import ConstantRestitution
from granular.scene import Scene
from granular.trajectory import EARLY, Trajectory

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
        return end_time.levelled(*self.counted, self.soft_options)

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
    def units(self) -> _check.Array:
        """Largest closing speed in m/s of each component, see `granular.outcome.units`."""
        return units(*self.levelled, self.components)

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Contacts of neighbouring pairs that share a span of time in the soft run: why the engines differ."""
        return measures.overlapping(self.counted[1])

    @cached_property
    def measures(self) -> dict[str, float]:
        """The measures of `granular.measures` for these two runs, and the share of soft contacts that were isolated."""
        hard, soft = self.counted
        hard_cm, soft_cm = (measures.mass_centre_restitution(run) for run in (hard, soft))
        return {
            "shared_impulse": measures.shared_impulse(self.soft),
            "crowding": measures.crowding(hard, self.law),
            "occupation": measures.occupation(soft),
            "distance": math.nan if self._early else self._distance(self._apart[0]),
            "predictability": math.nan if self._twin.status in EARLY else self._distance(
                differences(*self._shifted)[0]),
            "mass_centre_ratio": soft_cm / hard_cm if hard_cm and not self._early else math.nan,
            "isolated_share": isolation.isolated_share(self.levelled[1]),
            "lag": float(self.soft.time[-1] - self.hard.time[-1]),
        }

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

        _check.callback("observable", observable, "run")
        fractions = np.linspace(0.0, 1.0, _check.whole("resolution", resolution, at_least=2, at_most=_check.MOST))
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

        error = max over components of max( max_i |u_i(soft) - u_i(hard)|, max_c |v′_c(soft) - v′_c(hard)| ) / U

        over all balls i, walls left out, and pairs c of the component. u_i is the velocity with which ball i leaves the
        last of its contacts, v′_c the separation speed of pair c at the end of its last contact, U the largest closing
        speed of the component; see docs/concepts.md. 0 where nothing collides; nan where a run did not get to its end.
        """
        return math.nan if self._early else float(self.errors.max(initial=0.0))

    @cached_property
    def errors(self) -> _check.Array:
        """The error of each component, in its unit; 0 where balls rest on each other from the start."""
        moves = ~self.lying[self.components.of_pair]
        off = self.components.largest(np.where(moves, self._apart[1], 0.0), self._apart[0]) / self.units
        return np.where(self.lying[:-1], 0.0, off)

    @cached_property
    def lying(self) -> Any:
        """Whether hard spheres of each component rest on each other from the start, and one more for no component."""
        hard, lies = self.levelled[0], np.append(np.ones(self.components.count, np.bool_), False)
        lies[self.components.of_pair[(outcome.counts(hard) > 0) | (hard.gap[-1] != 0.0)]] = False
        return lies

    @cached_property
    def tie_errors(self) -> dict[str, _check.Array]:
        """How far balls leave, and come to rest, in units of their component, under each other tie rule; empty without
        ties."""
        return {name: self._apart_by_ties(run) for name, run in self._other_answers.items()}

    @cached_property
    def shift_errors(self) -> _check.Array:
        """How far balls leave, in units of their component, from gaps shifted by 1e-12 of themselves."""
        return self.components.largest(np.zeros(self.scene.n_pairs), differences(*self._shifted)[0]) / self.units

    @cached_property
    def shifts(self) -> _check.Array:
        """D of hard spheres against themselves, gaps shifted by 1e-12 of themselves, of each component."""
        mass = np.where(self.scene.is_wall, 0.0, self.scene.mass)
        apart = differences(*self._shifted)[0]
        return np.sqrt(self.components.total(mass * apart**2) / self.components.total(mass)) / self.units

    @cached_property
    def resting(self) -> dict[int, float]:
        """Pairs whose last contact has no end in one of the runs, and how far in m/s the runs differ there."""
        hard, soft = self.levelled
        rest = np.any(outcome.at_rest(hard, soft))
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
        return end_time.unfollowed(self.levelled[1])

    @property
    def _early(self) -> bool:
        return self.settled.status in EARLY or self.soft.status in EARLY

    @property
    def _speed(self) -> float:
        """A speed in m/s at which ε can be asked for."""
        return self.impact_speed if self.impact_speed > 0.0 else 1.0

    @cached_property
    def _apart(self) -> tuple[_check.Array, _check.Array]:
        """Differences in m/s of the two runs, by balls and by pairs; where a pair rests, of all its contacts."""
        balls, pairs = differences(*self.levelled)
        for c, apart in self.resting.items():
            pairs[c] = apart
        return balls, pairs

    @cached_property
    def twin(self) -> Trajectory:
        """The hard run from gaps shifted a little."""
        most = end_time.MOST_OF_OTHERS * (self.hard.stats["events"] + self.scene.n)
        options = {**self.hard_options, "max_events": min(self.hard_options["max_events"], most)}
        return edmd.simulate(end_time.nudged(self.scene), self.rule, **options)

    @cached_property
    def _twin(self) -> Trajectory:
        return self._carried_on(self.twin, self.hard_options)

    @cached_property
    def _shifted(self) -> tuple[Trajectory, Trajectory]:
        """The twin and the hard run, without contacts that are rounding or just at the end time."""
        hard = self.settled
        twin = hard if self._twin.status in EARLY else self._twin
        return measures.before_the_end(*(counted(outcome.at_once(run), self.soft)[0] for run in (twin, hard)))

    @cached_property
    def _other_answers(self) -> dict[str, Trajectory]:
        found = {}
        for options in end_time.others(self.settled, self.hard_options):
            with suppress(ValueError, ArithmeticError):  # no answer, as for balls wedged between two walls
                run = self._carried_on(edmd.simulate(self.scene, self.rule, **options), options)
                if run.status not in EARLY:
                    found[options["ties"]] = counted(outcome.at_once(run), self.soft)[0]
        return found

    def _carried_on(self, run: Trajectory, options: Mapping[str, Any]) -> Trajectory:
        """The run of hard spheres; after a collapse with those that collide ever more slowly sticking."""
        if "verdict" in run.stats:
            merging = {**options, "collapse": "merge", "merge_below": MERGED * measures.fastest_approach(run)}
            with suppress(ValueError, ArithmeticError):  # a tie rule that has no answer
                return edmd.simulate(run.scene, self.rule, **merging)
        return run

    def _apart_by_ties(self, one: Trajectory) -> _check.Array:
        """Largest difference of a run under another tie rule, in units of each component."""
        hard, weight = self._shifted[1], self.components.weight(self.levelled[1])
        stuck = outcome.stuck_apart(one, hard, weight)
        return self.components.largest(stuck, differences(one, hard)[0]) / self.units

    def _distance(self, apart: _check.Array) -> float:
        """D = √(Σ m Δu² / Σ m U²) over all balls that touch one, U the unit of a ball's component."""
        mass, of = np.where(self.scene.is_wall, 0.0, self.scene.mass), self.components.of_ball
        scale = float(mass @ np.append(self.units, 0.0)[of] ** 2)
        return math.sqrt(float(np.nansum(mass * apart**2)) / scale) if scale > 0.0 else math.nan


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

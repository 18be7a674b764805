"""Both runs of a scene, and the numbers that tell them apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from granular import _check, certificate, edmd, measures, outcome, theory, tie_rules, timing
from granular import until as stop
from granular.binary import at_speed
from granular.comparison.restitution import LawRule, roots
from granular.comparison.rises import hard_rise, soft_rise
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import resolved
from granular.measures import Overlap
from granular.outcome import SAME, PairOutcome
from granular.rules import ConstantRestitution
from granular.scene import Scene
from granular.scene.state import forced
from granular.trajectory import EARLY, Trajectory


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
    twin: Trajectory
    pairs: tuple[PairOutcome, ...]
    followed: Trajectory
    hard_options: Mapping[str, Any]
    soft_options: Mapping[str, Any]

    @cached_property
    def impact_speed(self) -> float:
        """v₁ in m/s, the speed of the first collision of the hard spheres, `measures.impact_speed`; nan without."""
        return measures.impact_speed(self.counted[0])

    @cached_property
    def counted(self) -> tuple[Trajectory, Trajectory]:
        """The hard and the soft run without contacts that are rounding (`granular.measures.without_rounding`)."""
        return measures.counted(self.hard, self.soft)

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
            "distance": math.nan if self._early else measures.distance(self.followed, hard),
            "predictability": measures.distance(*self._shifted),
            "mass_centre_ratio": soft_cm / hard_cm if hard_cm and not self._early else math.nan,
            "isolated_share": certificate.isolated_share(self.soft),
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
        return tuple(resolved(self.law, self.scene).column(lambda law: _restitution(law, self._speed)).tolist())

    @cached_property
    def restitution_ratio(self) -> float:
        """ε_eff/ε_spec for floor and two balls of one ε, from the closed form of the paper; nan for other scenes, with
        a driven floor or forces too."""
        eps, v_rel = self.restitution_spec, self.pairs[-1].soft_v_rel
        if not self._is_drop or max(eps) - min(eps) > 1e-9 or not self.impact_speed > 0.0 or math.isnan(v_rel):
            return math.nan
        return theory.effective_restitution(v_rel, self.impact_speed) / eps[0]

    @property
    def drop(self) -> float:
        """Height in m from which two balls fall on a floor together; nan for other scenes."""
        falls = self._is_drop and self.scene.gravity > 0.0
        return self.impact_speed**2 / (2.0 * self.scene.gravity) if falls else math.nan

    @property
    def _is_drop(self) -> bool:
        """Whether two balls fall on a floor together, without driven walls or other forces."""
        scene = self.scene
        together = scene.n == 3 and scene.is_wall.tolist() == [True, False, False]
        return together and scene.velocity[1] == scene.velocity[2] and not forced(scene)

    @cached_property
    def rises(self) -> tuple[float, float]:
        """How high in m the top ball rises as hard and as soft sphere, if need be after the stop; nan without gravity,
        or if it cannot be told.

        The first apex of its free flight after it has been touched; a run that stops earlier is carried on.
        """
        if self._early:
            return math.nan, math.nan
        ties = self.hard_options["ties"]
        return (hard_rise(self.hard, self.rule, ties, self.impact_speed),
                soft_rise(self.scene, self.law, float(self.soft.time[-1])))

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
        if observable is None and self.scene.driven:
            raise ValueError("observable is None: at a driven wall a speed hangs on the phase, which the duration of "
                             "soft contacts shifts; give a function of the run, such as a mean height.")  # fmt: skip
        if observable is None and self.scene.heated:
            raise ValueError("observable is None: at a thermal wall a speed hangs on what was drawn last; give a "
                             "function of the run, such as a mean height.")  # fmt: skip
        _check.callback("observable", observable, "run")
        measure = observable or self._last_separation
        target = observable(self.soft) if observable else self.pairs[-1].soft_v_rel

        def miss(eps: float) -> float:
            return measure(edmd.simulate(self.scene, ConstantRestitution(eps), **self.hard_options)) - target

        return roots(miss, np.linspace(0.0, 1.0, resolution)[1:], abs(target))

    def _last_separation(self, hard: Trajectory) -> float:
        """Separation speed in m/s of the last pair after its last contact that is not rounding."""
        return float(outcome.separations(measures.counted(hard, self.soft)[0])[0][-1])

    @cached_property
    def error(self) -> float:
        """How far hard spheres are off, in speeds of the first collision: the one number that the verdict judges.

        error = max( max_i |u_i(soft) - u_i(hard)|, max_c |v′_c(soft) - v′_c(hard)| ) / v₁

        over all balls i, walls left out, and all pairs c. u_i is the velocity with which ball i leaves the last of its
        contacts that ends, the initial one without contacts; v′_c is the separation speed of pair c at the end of its
        last contact. A soft contact still running at the end of the run is followed to its own end, a contact that is
        rounding does not count, and what has no value, such as v′ of a contact that never ends, is left out. v₁ is
        `impact_speed`. Free fall and the lag of soft spheres do not enter.

        0 where nothing collides; nan where no contact comes to its end, and where a run did not get to its end, for
        nothing is claimed of it.
        """
        return math.nan if self._early else self._apart(self.followed, self.counted[0])

    @cached_property
    def tie_errors(self) -> dict[str, float]:
        """How far the answer of each other tie rule is from the hard run, as `error` says; empty without ties."""
        return {name: self._apart(run, self.counted[0]) for name, run in self._other_answers.items()}

    @cached_property
    def shift_error(self) -> float:
        """How far hard spheres from gaps shifted by 1e-12 of themselves are from the hard run, as `error` says."""
        return self._apart(*self._shifted)

    @cached_property
    def unsettled_counts(self) -> Any:
        """Whether each pair collides another number of times under another tie rule, or from shifted gaps, (n-1,)."""
        twin, usual = (outcome.counts(run) for run in self._shifted)
        others = [outcome.counts(run) != outcome.counts(self.counted[0]) for run in self._other_answers.values()]
        return np.array([twin != usual, *others]).any(axis=0)

    @cached_property
    def only_timing(self) -> bool:
        """Whether counts differ only by contacts that fall on the other side of `t_end`.

        Soft spheres lag by about t_c per collision; so contacts that began within that lag of the end do not count.
        A lag that meets a driven wall in another phase is more than timing: velocities differ then.
        """
        hard, soft = self.counted
        return timing.same_but_for_timing(soft, hard, SAME * measures.fastest_approach(hard))

    @property
    def _early(self) -> bool:
        return self.hard.status in EARLY or self.soft.status in EARLY

    @property
    def _speed(self) -> float:
        """A speed in m/s at which ε can be asked for."""
        return self.impact_speed if self.impact_speed > 0.0 else 1.0

    @cached_property
    def _shifted(self) -> tuple[Trajectory, Trajectory]:
        """The twin and the hard run, without contacts that are rounding or just at the end time."""
        return measures.before_the_end(measures.counted(self.twin, self.soft)[0], self.counted[0])

    @cached_property
    def _other_answers(self) -> dict[str, Trajectory]:
        runs = tie_rules.other_answers(self.hard, self.rule, self.hard_options)
        return {name: measures.counted(run, self.soft)[0] for name, run in runs.items()}

    def _apart(self, one: Trajectory, other: Trajectory) -> float:
        """Largest difference of two runs in impact speeds."""
        return outcome.largest_difference(one, other) / self.impact_speed if self.impact_speed > 0.0 else 0.0


def _restitution(law: PairLaw, speed: float) -> float:
    """ε of an isolated contact; nan if it does not end."""
    try:
        return at_speed(law, speed)
    except (ValueError, ArithmeticError):
        return math.nan

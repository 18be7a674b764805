"""Checks of the hard run: under other tie rules, and from gaps shifted by 1e-12 of themselves."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from granular import edmd
from granular._engine import check
from granular.comparison import align, measures, outcome
from granular.comparison.numbers import Compared
from granular.comparison.outcome import counted, differences
from granular.md import isolation
from granular.run.trajectory import EARLY, Trajectory


class Checked(Compared):
    """Both runs of a scene, and the further hard runs that check whether hard spheres have one answer."""

    @cached_property
    def measures(self) -> dict[str, float]:
        """The measures of `granular.measures` for these two runs, and the share of soft contacts that were isolated."""
        hard, soft = self.counted
        hard_cm, soft_cm = (measures.mass_centre_restitution(run) for run in (hard, soft))
        return {
            "shared_impulse": measures.shared_impulse(self.soft),
            "crowding": measures.crowding(hard, self.law),
            "occupation": measures.occupation(soft),
            "distance": math.nan if self._early else self._distance(differences(*self.levelled)),
            "predictability": math.nan if self._twin.status in EARLY else self._distance(
                differences(*self._shifted)),
            "mass_centre_ratio": soft_cm / hard_cm if hard_cm and not self._early else math.nan,
            "isolated_share": isolation.isolated_share(self.levelled[1]),
            "lag": self._lag,
        }

    @property
    def _lag(self) -> float:
        """Soft end time minus hard end time in s. After a collapse both are the times at which balls come to rest: the
        time of the collapse, and the onset of the last soft contact without end."""
        log, end = self.soft.contacts, float(self.soft.time[-1])
        if "collapse_time" not in self.hard.stats:
            return end - float(self.hard.time[-1])
        rest = log["t_begin"][np.isnan(log["t_end"])]
        return (float(rest.max()) if len(rest) else end) - float(self.hard.stats["collapse_time"])

    @cached_property
    def tie_errors(self) -> dict[str, check.Array]:
        """How far balls leave, and come to rest, in units of their component, under each other tie rule; empty without
        ties."""
        return {name: self._apart_by_ties(run) for name, run in self._other_answers.items()
                if not isinstance(run, str)}

    @cached_property
    def shift_errors(self) -> check.Array:
        """How far balls leave, in units of their component, from gaps shifted by 1e-12 of themselves."""
        return self.components.largest(np.zeros(self.scene.n_pairs), differences(*self._shifted)) / self.units

    @cached_property
    def shifts(self) -> check.Array:
        """D of hard spheres against themselves, gaps shifted by 1e-12 of themselves, of each component."""
        mass = np.where(self.scene.is_wall, 0.0, self.scene.mass)
        apart = differences(*self._shifted)
        return np.sqrt(self.components.total(mass * apart**2) / self.components.total(mass)) / self.units

    @cached_property
    def twin(self) -> Trajectory:
        """The hard run from gaps shifted a little."""
        most = align.MOST_OF_OTHERS * (self.hard.stats["events"] + self.scene.n)
        options = {**self.hard_options, "max_events": min(self.hard_options["max_events"], most)}
        return edmd.simulate(align.nudged(self.scene), self.rule, **options)

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
    def _other_answers(self) -> dict[str, Trajectory | str]:
        """The hard run under each other tie rule, or why there is none."""
        found: dict[str, Trajectory | str] = {}
        for options in align.others(self.settled, self.hard_options):
            name = options["ties"]
            try:
                first = edmd.simulate(self.scene, self.rule, **options)
                if name == "poisson" and "verdict" in first.stats:
                    continue  # it cannot be carried on: this rule is not defined for balls that stick
                run = self._carried_on(first, options)
            except (ValueError, ArithmeticError):  # no answer, as for balls wedged between two walls
                found[name] = "refused the scene"
                continue
            found[name] = f"stopped early ({run.status.name})" if run.status in EARLY else counted(
                outcome.at_once(run), self.soft)[0]
        return found

    def unchecked(self, j: int) -> str:
        """Say which check of component `j` could not be made; empty if all were."""
        if self._twin.status in EARLY:
            return f"the run from gaps shifted by 1e-12 of themselves stopped early ({self._twin.status.name})"
        pairs = self.components.of_pair == j
        if pairs.sum() < 2 or not align.tied(self.settled)[pairs].any():
            return ""
        failed = [(name, why) for name, why in self._other_answers.items() if isinstance(why, str)]
        return f"the run with ties={failed[0][0]!r} {failed[0][1]}" if failed else ""

    def _apart_by_ties(self, one: Trajectory) -> check.Array:
        """Largest difference of a run under another tie rule, in units of each component."""
        hard, weight = self._shifted[1], self.components.weight(self.levelled[1])
        stuck = outcome.stuck_apart(one, hard, weight)
        return self.components.largest(stuck, differences(one, hard)) / self.units

    def _distance(self, apart: check.Array) -> float:
        """D = √(Σ m Δu² / Σ m U²) over all balls that touch one, U the unit of a ball's component."""
        mass, of = np.where(self.scene.is_wall, 0.0, self.scene.mass), self.components.of_ball
        scale = float(mass @ np.append(self.units, 0.0)[of] ** 2)
        return math.sqrt(float(np.nansum(mass * apart**2)) / scale) if scale > 0.0 else math.nan

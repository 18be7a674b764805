"""Answer of a comparison, with its reasons.

The hard spheres run again to check their result: under other tie rules, and from gaps shifted by a relative 1e-12.
The answer of the scene is the worst answer of its components. For a component, the first matching rule determines the
answer:

================  ====================================================================================================
no                hard spheres collide forever where soft spheres separate; or nothing collides, and soft spheres sink
not_unique        a ball leaves with another velocity under another tie rule, or from the shifted gaps
not_ball_by_ball  hard spheres diverge from the run with shifted gaps, so single balls cannot be predicted
undecided         a soft contact had not ended when its run stopped, and cannot be continued
no                other numbers of contacts, an error above `ERROR_LIMIT`, or soft spheres at rest that sink
undecided         another tie rule, or the run from the shifted gaps, was refused or stopped early
yes               the error is at most `ERROR_LIMIT`, and all other balls are at rest in both runs
================  ====================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from granular import edmd
from granular._engine import check as _check, signature as _signature
from granular._engine.reports import percent, rounded_bound
from granular.comparison import align, measures, outcome
from granular.comparison.measures import static_overlaps
from granular.comparison.numbers import ComparedRuns, smaller_radius
from granular.comparison.outcome import ERROR_LIMIT, MIN_CONTACT_STRENGTH, counted, differences
from granular.comparison.reason_texts import departure_text, endless_collisions_text, miscount_text
from granular.md import isolation
from granular.run.trajectory import EARLY_STATUSES, Status, Trajectory


@_signature.face
class Answer(Enum):
    """Can the collisions of a scene be treated as instantaneous? From worst to best.

    Attributes
    ----------
    no
        The hard-sphere run is wrong: numbers of contacts or velocities differ.
    not_unique
        Hard spheres have no unique result, because balls touch or collide simultaneously.
    not_ball_by_ball
        Single balls are beyond predictability. Compare means over many draws, see `granular.ensemble`.
    undecided
        A run or a check stopped early. The reason names it.
    yes
        The hard-sphere run is right within 1 % of the fastest impact.
    """

    no = "No"
    not_unique = "Not uniquely"
    not_ball_by_ball = "Not ball by ball"
    undecided = "No verdict"
    yes = "Yes"


ANSWER_ORDER = tuple(Answer)


@_signature.face
@dataclass(frozen=True)
class Reason:
    """Reason for the answer of one component of a scene.

    Attributes
    ----------
    answer : Answer
        Answer of the component.
    words : str
        The reason as text. Appended to the value of `answer`, it gives the verdict.
    balls, pairs : tuple of int
        Bodies of the component without walls, and the pairs to which the reason refers.
    error, unit : float
        Error of the component, in its unit U, and U in m/s. Both are nan for a reason that refers to the whole scene.
    """

    answer: Answer
    words: str
    balls: tuple[int, ...] = ()
    pairs: tuple[int, ...] = ()
    error: float = math.nan
    unit: float = math.nan

    def __str__(self) -> str:
        return f"{self.answer.value}{self.words}."


class Checked(ComparedRuns):
    """Hard and soft run of a scene, with further hard runs that check the result."""

    @cached_property
    def measures(self) -> dict[str, float]:
        """Measures of `granular.measures` and further measures of the comparison, by name.

        The names are "shared_impulse", "crowding", "occupation", "distance" (D of hard against soft spheres),
        "predictability" (D of two hard runs, see `twin`), "mass_centre_ratio" (soft over hard), "isolated_share"
        (fraction of isolated soft contacts) and "lag" in s. Values that cannot be computed are nan.
        """
        return {name: measure(self) for name, measure in MEASURES.items()}

    @property
    def _mass_centre_ratio(self) -> float:
        """Ratio K_cm, soft over hard, or nan."""
        hard_cm, soft_cm = map(measures.mass_centre_restitution, self.counted)
        return soft_cm / hard_cm if hard_cm and not self._early else math.nan

    @property
    def _lag(self) -> float:
        """Time in s by which the soft run ends later than the hard run.

        If the hard spheres collapse, the runs are compared at the times at which their balls come to rest. These are
        the time of the collapse, and the onset of the last soft contact without end.
        """
        log, end = self.soft.contacts, float(self.soft.time[-1])
        if "collapse_time" not in self.hard.stats:
            return end - float(self.hard.time[-1])
        rest = log["t_begin"][np.isnan(log["t_end"])]
        return (float(rest.max()) if len(rest) else end) - float(self.hard.stats["collapse_time"])

    @cached_property
    def tie_errors(self) -> dict[str, _check.Array]:
        """Error of the hard run against its run under each other tie rule, by name.

        Each value is an array (count,) with the largest velocity difference in each component, in its unit U. The
        differences of balls that leave and of pairs that come to rest are included. The dictionary is empty without
        simultaneous collisions.
        """
        return {name: self._tie_error(run) for name, run in self._runs_under_other_ties.items()
                if not isinstance(run, str)}

    @cached_property
    def shift_errors(self) -> _check.Array:
        """Error of the hard run against its run from shifted gaps (see `twin`), (count,).

        It is the largest velocity difference in each component, in its unit U.
        """
        return self.components.largest(np.zeros(self.scene.n_pairs), self._shift_differences) / self.units

    @cached_property
    def shifts(self) -> _check.Array:
        """Distance D of the hard run from its run from shifted gaps, (count,).

        D = √(Σ m Δu² / Σ m) / U, summed over the balls of each component. Δu is the difference of a ball's velocities
        after its last contact.
        """
        mass = np.where(self.scene.is_wall, 0.0, self.scene.mass)
        mean_square = self.components.total(mass * self._shift_differences**2) / self.components.total(mass)
        return np.sqrt(mean_square) / self.units

    @cached_property
    def twin(self) -> Trajectory:
        """Second hard run, from gaps shifted by a relative 1e-12."""
        limit = align.COLLISION_LIMIT_FACTOR * (self.hard.stats["events"] + self.scene.n)
        options = {**self.hard_options, "max_events": min(self.hard_options["max_events"], limit)}
        return edmd.simulate(align.with_shifted_gaps(self.scene), self.rule, **options)

    @cached_property
    def _twin(self) -> Trajectory:
        return self._carried_on(self.twin, self.hard_options)

    @cached_property
    def _shifted(self) -> tuple[Trajectory, Trajectory]:
        """The hard run from shifted gaps and the hard run itself, ready to be compared.

        Contacts at rounding level are removed, and both include a collision at a common end time. If the run from
        changed gaps stopped early, the hard run is returned twice.
        """
        return self._with_hard_run(self.settled if self._twin.status in EARLY_STATUSES else self._twin)

    @cached_property
    def _shift_differences(self) -> _check.Array:
        """Velocity difference in m/s of each ball between the runs of `_shifted`."""
        return differences(*self._shifted)

    def _with_hard_run(self, run: Trajectory) -> tuple[Trajectory, Trajectory]:
        """Return a hard run and the hard run of the report, ready to be compared.

        See `_shifted`.
        """
        def without_weak(each: Trajectory) -> Trajectory:
            known = each is self.settled
            return self.counted[0] if known else counted(outcome.combine_simultaneous(each), self.soft)[0]

        run, hard = align.continue_past_end(run, self.settled)
        return without_weak(run), without_weak(hard)

    @cached_property
    def _runs_under_other_ties(self) -> dict[str, Trajectory | str]:
        """Hard run under each other tie rule, or the reason as text why it cannot be used."""
        runs: dict[str, Trajectory | str] = {}
        for options in align.other_tie_rules(self.settled, self.hard_options):
            name = options["ties"]
            try:
                first = edmd.simulate(self.scene, self.rule, **options)
                if name == "poisson" and "verdict" in first.stats:
                    continue  # cannot be continued: this rule is not defined for balls that stick
                run = self._carried_on(first, options)
            except (ValueError, ArithmeticError):  # no result, as for balls wedged between two walls
                runs[name] = "refused the scene"
                continue
            runs[name] = f"stopped early ({run.status.name})" if run.status in EARLY_STATUSES else run
        return runs

    def unchecked(self, j: int) -> str:
        """Return why the answer for component `j` could not be checked, or ""."""
        if self._twin.status in EARLY_STATUSES:
            return f"the run from gaps shifted by a relative 1e-12 stopped early ({self._twin.status.name})"
        pairs = self.components.of_pair == j
        if pairs.sum() < 2 or not align.has_ties(self.settled)[pairs].any():
            return ""
        failed = [(name, why) for name, why in self._runs_under_other_ties.items() if isinstance(why, str)]
        return f"the run with ties={failed[0][0]!r} {failed[0][1]}" if failed else ""

    def _tie_error(self, tied_run: Trajectory) -> _check.Array:
        """Error of the hard run against a run under another tie rule, (count,)."""
        runs = self._with_hard_run(tied_run)
        stuck_difference = outcome.stuck_differences(*runs, self.weight)
        return self.components.largest(stuck_difference, differences(*runs)) / self.units

    def _distance(self, difference: _check.Array) -> float:
        """D = √(Σ m Δu² / Σ m U²) for velocity differences Δu in m/s of all balls, (n,).

        U is the unit of the component of each ball. Balls without contacts are not counted. nan if no ball has a
        contact.
        """
        mass, component = np.where(self.scene.is_wall, 0.0, self.scene.mass), self.components.of_ball
        scale = float(mass @ np.append(self.units, 0.0)[component] ** 2)
        return math.sqrt(float(np.nansum(mass * difference**2)) / scale) if scale > 0.0 else math.nan


MEASURES: dict[str, Callable[[Checked], float]] = {
    "shared_impulse": lambda report: measures.shared_impulse(report.soft),
    "crowding": lambda report: measures.crowding(report.counted[0], report.law),
    "occupation": lambda report: measures.occupation(report.counted[1]),
    "distance": lambda report: math.nan if report._early else report._distance(differences(*report.continued)),
    "predictability": lambda report: math.nan if report._twin.status in EARLY_STATUSES else report._distance(
        report._shift_differences),
    "mass_centre_ratio": lambda report: report._mass_centre_ratio,
    "isolated_share": lambda report: isolation.isolated_share(report.continued[1]),
    "lag": lambda report: report._lag,
}
"""Measures of a comparison by name, see `Checked.measures`."""


class ComparisonWithAnswer(Checked):
    """Hard and soft run of a scene, with the answer and its reasons."""

    @cached_property
    def reasons(self) -> tuple[Reason, ...]:
        """Reasons for the answers of all components, the worst answer first.

        Equal answers are sorted by decreasing error. If all answers are "yes", a reason for the whole scene is added
        in front.
        """
        ordered = [*_reasons_for_early_stops(self)] or [
            _component_reason(self, j) for j in range(self.components.count)]
        ordered.sort(key=lambda reason: (ANSWER_ORDER.index(reason.answer), -float(np.nan_to_num(reason.error))))
        if not ordered or ordered[0].answer is Answer.yes:
            ordered[:0] = [_reason_for_yes(self, [reason.words for reason in ordered if reason.words])]
        return tuple(ordered)

    @property
    def answer(self) -> Answer:
        """Can the collisions of this scene be treated as instantaneous?"""
        return self.reasons[0].answer

    @property
    def verdict(self) -> str:
        """The answer in one line, with its first reason."""
        return str(self.reasons[0])


def _reasons_for_early_stops(report: Checked) -> Iterator[Reason]:
    """Yield the reasons that follow from runs that stopped early, for the whole scene.

    The answer is "undecided". It is "no" if the soft run is complete and the hard spheres would collide forever.
    """
    soft, hard = report.soft, report.settled
    if (
        soft.status not in EARLY_STATUSES
        and hard.status in EARLY_STATUSES
        and (forever := endless_collisions_text(report, range(report.scene.n_pairs)))
    ):
        yield Reason(Answer.no, forever)
    for name, run in (("soft-sphere", soft), ("event-driven", hard)):
        if run.status in EARLY_STATUSES:
            yield Reason(Answer.undecided, f": the {name} run did not finish ({run.status.name}: "
                                           f"{run.message.rstrip('.')})")


def _component_reason(report: Checked, j: int) -> Reason:
    """Return the reason for the answer of component `j`, by the rules of this module."""
    components, error, unit = report.components, float(report.errors[j]), float(report.units[j])
    balls, pairs = (tuple(np.flatnonzero(of == j).tolist()) for of in (components.of_ball, components.of_pair))
    miscounted = tuple(filter(report.other_counts.__getitem__, pairs))

    def reason(answer: Answer, words: str, about: tuple[int, ...] = pairs) -> Reason:
        return Reason(answer, words, balls, about, error, unit)

    if forever := endless_collisions_text(report, pairs):
        return reason(Answer.no, forever)
    sinking = _sinking(report, pairs)
    if sinking and report.lying[j]:
        return reason(*sinking)
    ties, rule = max([(float(e[j]), name) for name, e in report.tie_errors.items()], default=(0.0, ""))
    if ties > ERROR_LIMIT:
        return reason(Answer.not_unique,
                      ": hard spheres have no unique answer for simultaneous collisions; the tie rules "
                      f"{report.hard_options['ties']} and {rule} differ by {percent(ties)} of the fastest impact")
    chaos, shift, overlap = float(report.shifts[j]), float(report.shift_errors[j]), _has_overlap(report, pairs)
    if chaos > ERROR_LIMIT and align.balls_touch_at_start(report.scene)[list(pairs)].any():
        return reason(Answer.not_unique,
                      ": hard spheres have no unique answer for touching balls; it depends on the tie rule")
    if chaos > ERROR_LIMIT:
        crowded = "; contacts overlap in time" if overlap else ""
        return reason(Answer.not_ball_by_ball, f": single balls are not predictable (compare ensembles){crowded}")
    if shift > ERROR_LIMIT:
        return reason(Answer.not_unique,
                      ": balls collide almost simultaneously, and a relative shift of the gaps by 1e-12 changes the "
                      f"hard spheres by {percent(shift)} of the fastest impact")
    if unfinished := [c for c in pairs if report.unknown[c]]:
        return reason(Answer.undecided,
                      f": a soft contact of pair {report.scene.pairs.name(unfinished[0])} had not ended when its run "
                      "stopped, and cannot be continued; choose a later end or method='located'", tuple(unfinished))
    if miscounted:
        return reason(Answer.no, f": {miscount_text(report, miscounted, len(pairs))}", miscounted)
    if not error <= ERROR_LIMIT:
        no_overlap = "" if overlap else ", though no contacts overlap in time"
        driven = "; at a driven wall, timing affects the outcome" if report.scene.driven and not overlap else ""
        leaves = departure_text(report, j)
        differ = f"{leaves}, an error of" if leaves else "outcomes differ by"
        return reason(Answer.no, f": {differ} {percent(error)} of the fastest impact{no_overlap}{driven}")
    if not sinking and (failed_check := report.unchecked(j)):
        return reason(Answer.undecided, f": {failed_check}, so the answer could not be checked")
    return reason(*(sinking or (Answer.yes, "")))


def _reason_for_yes(report: Checked, trivial_reasons: list[str]) -> Reason:
    """Return the reason for the answer "yes" of the whole scene.

    If the error is nan, because no contact has ended, the answer is "undecided".

    Parameters
    ----------
    trivial_reasons : list of str
        Reasons of the components that agree trivially because their balls rest from the start, as text.
    """
    error, isolated = report.error, isolation.isolated_share(report.continued[1])
    if not error <= ERROR_LIMIT:
        return Reason(Answer.undecided, ": no contact has ended")
    bound = f"within {rounded_bound(100.0 * error, 1, up=True)} % of the fastest impact"
    within = bound if error >= MIN_CONTACT_STRENGTH else "to rounding"
    agree = f"outcomes agree {within}"
    if len(trivial_reasons) == report.components.count:
        touch = len(report.settled.contacts) + len(report.soft.contacts) > 0
        nothing = f", trivially: {'balls touch only at speeds of rounding errors' if touch else 'nothing collides'}"
        words = max(trivial_reasons, default=nothing)
    elif isolated == 1.0:
        words = f": every contact is binary (certified), and {agree}"
    elif measures.shared_impulse(report.soft) > MIN_CONTACT_STRENGTH:
        words = f", {within}, though contacts overlap in time"
    else:
        why = "every contact is binary" if not isolated < 1.0 else (
            "contacts that overlap in time share no relevant impulse")
        words = f": {why}, and {agree}"
    return Reason(Answer.yes, words, error=error)


def _sinking(report: Checked, pairs: tuple[int, ...]) -> tuple[Answer, str] | None:
    """Answer and reason for soft spheres that sink at rest, or None.

    The answer is "no" if soft spheres at rest overlap by more than `ERROR_LIMIT` times the smaller radius of the pair.
    It is "yes" if they overlap by less and the hard spheres of the component rest on each other from the start.
    Otherwise None is returned.
    """
    lying, soft = report.lying[report.components.of_pair[pairs[0]]], report.continued[1]
    has_no_end = np.isnan(soft.contacts["t_end"])
    if not lying and not has_no_end.any():
        return None
    log = soft.contacts[np.isin(soft.contacts["pair"], pairs) & (has_no_end | lying)]
    if not len(log) or not (report.scene.closing_acceleration.any() or report.scene.driven):
        return None
    settled = log["v_in"][:, 0] - log["v_in"][:, 1] <= report.components.weight(soft)[log["pair"]]
    depth = np.where(settled, log["xi_max"], -report.soft.gap[-1][log["pair"]])
    if report.soft.status is Status.resting:
        static_overlap = static_overlaps(report.soft)[log["pair"]]
        depth = np.fmax(static_overlap, np.where(settled | np.isnan(static_overlap), depth, 0.0))
    load = "their weight" if report.scene.external_force is None and not report.scene.driven else "the applied forces"
    depth_ratio = float(np.max(depth / smaller_radius(report.scene)[log["pair"]]))
    if depth_ratio > ERROR_LIMIT:
        subject = "nothing collides, but soft spheres" if lying else "soft spheres that come to rest"
        return Answer.no, f": {subject} sink by {percent(depth_ratio)} of a radius under {load}"
    deepest = f"soft spheres overlap by {depth.max():.3g} m under {load}"
    return (Answer.yes, f", trivially: nothing collides; {deepest}") if lying else None


def _has_overlap(report: Checked, pairs: tuple[int, ...]) -> bool:
    """Whether a soft contact of these pairs overlaps in time with a neighbour's."""
    pair_set, log = set(pairs), report.counted[1].contacts["pair"]
    return any(int(log[o.lower]) in pair_set for o in report.overlaps)

"""Answer of a comparison, with its reasons.

The hard spheres run again to check their result: under other tie rules, and from gaps shifted by 1e-12 of themselves.
The answer of the scene is the worst answer of its components. For a component, the first matching rule determines the
answer:

==================  ==================================================================================================
no                  hard spheres collide forever where soft ones separate; or nothing collides, and soft ones sink
not uniquely        a ball leaves with another velocity under another tie rule, or from gaps shifted by 1e-12
not ball by ball    hard spheres diverge from those with gaps shifted by 1e-12 of themselves: beyond predictability
no verdict          a soft contact was still running and cannot be followed
no                  other numbers of contacts, an error above `ERROR_LIMIT`, or soft balls at rest that sink
no verdict          another tie rule, or the run from shifted gaps, was refused or stopped early
yes                 the error is at most `ERROR_LIMIT`, and all other balls are at rest in both runs
==================  ==================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from granular import edmd
from granular._engine import check as _check
from granular._engine.reports import percent, rounded
from granular.comparison import align, measures, outcome
from granular.comparison.measures import static_overlaps
from granular.comparison.numbers import Compared, smaller_radius
from granular.comparison.outcome import ERROR_LIMIT, MIN_CONTACT_STRENGTH, counted, differences
from granular.md import isolation
from granular.run.trajectory import EARLY_STATUSES, Status, Trajectory


@_check.face
class Answer(Enum):
    """Can the collisions of a scene be treated as instantaneous? From worst to best."""

    no = "No"
    not_unique = "Not uniquely"
    not_ball_by_ball = "Not ball by ball"
    undecided = "No verdict"
    yes = "Yes"


ANSWER_ORDER = tuple(Answer)


@_check.face
@dataclass(frozen=True)
class Reason:
    """Reason for the answer of one component of a scene.

    Attributes
    ----------
    answer : Answer
        The answer that follows.
    words : str
        The reason as text that continues the answer.
    balls, pairs : tuple of int
        Bodies of the component without walls, and the pairs to which the reason refers.
    error, unit : float
        Error of the component in its unit, and the unit in m/s. nan without one.
    """

    answer: Answer
    words: str
    balls: tuple[int, ...] = ()
    pairs: tuple[int, ...] = ()
    error: float = math.nan
    unit: float = math.nan

    def __str__(self) -> str:
        return f"{self.answer.value}{self.words}."


class Checked(Compared):
    """Both runs of a scene, with further hard runs that check the result."""

    @cached_property
    def measures(self) -> dict[str, float]:
        """Measures of `granular.measures`, and the share of isolated soft contacts."""
        hard, soft = self.counted
        hard_cm, soft_cm = (measures.mass_centre_restitution(run) for run in (hard, soft))
        return {
            "shared_impulse": measures.shared_impulse(self.soft),
            "crowding": measures.crowding(hard, self.law),
            "occupation": measures.occupation(soft),
            "distance": math.nan if self._early else self._distance(differences(*self.levelled)),
            "predictability": math.nan if self._twin.status in EARLY_STATUSES else self._distance(
                differences(*self._shifted)),
            "mass_centre_ratio": soft_cm / hard_cm if hard_cm and not self._early else math.nan,
            "isolated_share": isolation.isolated_share(self.levelled[1]),
            "lag": self._lag,
        }

    @property
    def _lag(self) -> float:
        """Soft end time minus hard end time in s.

        After a collapse the times at which balls come to rest are used: the time of the collapse, and the onset of the
        last soft contact without end.
        """
        log, end = self.soft.contacts, float(self.soft.time[-1])
        if "collapse_time" not in self.hard.stats:
            return end - float(self.hard.time[-1])
        rest = log["t_begin"][np.isnan(log["t_end"])]
        return (float(rest.max()) if len(rest) else end) - float(self.hard.stats["collapse_time"])

    @cached_property
    def tie_errors(self) -> dict[str, _check.Array]:
        """Largest difference under each other tie rule, in the unit of each component.

        Differences of leaving balls and of balls that come to rest. Empty without simultaneous collisions.
        """
        return {name: self._apart_by_ties(run) for name, run in self._other_answers.items()
                if not isinstance(run, str)}

    @cached_property
    def shift_errors(self) -> _check.Array:
        """Largest difference from gaps shifted by 1e-12, in the unit of each component."""
        return self.components.largest(np.zeros(self.scene.n_pairs), differences(*self._shifted)) / self.units

    @cached_property
    def shifts(self) -> _check.Array:
        """D between the hard run and its run from gaps shifted by 1e-12, per component."""
        mass = np.where(self.scene.is_wall, 0.0, self.scene.mass)
        apart = differences(*self._shifted)
        return np.sqrt(self.components.total(mass * apart**2) / self.components.total(mass)) / self.units

    @cached_property
    def twin(self) -> Trajectory:
        """Second hard run, from gaps shifted by 1e-12 of themselves."""
        most = align.COLLISION_LIMIT_FACTOR * (self.hard.stats["events"] + self.scene.n)
        options = {**self.hard_options, "max_events": min(self.hard_options["max_events"], most)}
        return edmd.simulate(align.nudged(self.scene), self.rule, **options)

    @cached_property
    def _twin(self) -> Trajectory:
        return self._carried_on(self.twin, self.hard_options)

    @cached_property
    def _shifted(self) -> tuple[Trajectory, Trajectory]:
        """The second and the first hard run, without contacts at rounding level.

        Contacts just before a common end time are also removed.
        """
        hard = self.settled
        twin = hard if self._twin.status in EARLY_STATUSES else self._twin
        return measures.before_the_end(*(counted(outcome.at_once(run), self.soft)[0] for run in (twin, hard)))

    @cached_property
    def _other_answers(self) -> dict[str, Trajectory | str]:
        """Hard run under each other tie rule, or the reason why it cannot be used."""
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
            found[name] = f"stopped early ({run.status.name})" if run.status in EARLY_STATUSES else counted(
                outcome.at_once(run), self.soft)[0]
        return found

    def unchecked(self, j: int) -> str:
        """Return why the answer for component `j` could not be checked, or ""."""
        if self._twin.status in EARLY_STATUSES:
            return f"the run from gaps shifted by 1e-12 of themselves stopped early ({self._twin.status.name})"
        pairs = self.components.of_pair == j
        if pairs.sum() < 2 or not align.tied(self.settled)[pairs].any():
            return ""
        failed = [(name, why) for name, why in self._other_answers.items() if isinstance(why, str)]
        return f"the run with ties={failed[0][0]!r} {failed[0][1]}" if failed else ""

    def _apart_by_ties(self, one: Trajectory) -> _check.Array:
        """Largest difference of a run under another tie rule, per component."""
        hard, weight = self._shifted[1], self.components.weight(self.levelled[1])
        stuck = outcome.stuck_apart(one, hard, weight)
        return self.components.largest(stuck, differences(one, hard)) / self.units

    def _distance(self, apart: _check.Array) -> float:
        """D = √(Σ m Δu² / Σ m U²) over balls with contacts, with the unit U of each."""
        mass, of = np.where(self.scene.is_wall, 0.0, self.scene.mass), self.components.of_ball
        scale = float(mass @ np.append(self.units, 0.0)[of] ** 2)
        return math.sqrt(float(np.nansum(mass * apart**2)) / scale) if scale > 0.0 else math.nan


class Judged(Checked):
    """Both runs of a scene, with the answer and its reasons."""

    @cached_property
    def reasons(self) -> tuple[Reason, ...]:
        """Reason of each component, the worst first, then by decreasing error."""
        found = [*_unfinished(self)] or [_judged(self, j) for j in range(self.components.count)]
        found.sort(key=lambda reason: (ANSWER_ORDER.index(reason.answer), -float(np.nan_to_num(reason.error))))
        if not found or found[0].answer is Answer.yes:
            found[:0] = [_yes(self, [reason.words for reason in found if reason.words])]
        return tuple(found)

    @property
    def answer(self) -> Answer:
        """Can the collisions of this scene be treated as instantaneous?"""
        return self.reasons[0].answer

    @property
    def verdict(self) -> str:
        """The answer in one line, with its first reason."""
        return str(self.reasons[0])


def _unfinished(report: Checked) -> Iterator[Reason]:
    """Yield reasons for runs that stopped before their end.

    It is "no" if the soft run is complete and the hard spheres would collide forever, otherwise "undecided".
    """
    soft, hard = report.soft, report.settled
    if (
        soft.status not in EARLY_STATUSES
        and hard.status in EARLY_STATUSES
        and (so := _forever(report, range(report.scene.n_pairs)))
    ):
        yield Reason(Answer.no, so)
    for name, run in (("soft-sphere", soft), ("event-driven", hard)):
        if run.status in EARLY_STATUSES:
            yield Reason(Answer.undecided, f": the {name} run did not finish ({run.status.name}: "
                                           f"{run.message.rstrip('.')})")


def _judged(report: Checked, j: int) -> Reason:
    """Return the reason of component `j`."""
    parts, error, unit = report.components, float(report.errors[j]), float(report.units[j])
    balls, pairs = (tuple(np.flatnonzero(of == j).tolist()) for of in (parts.of_ball, parts.of_pair))
    wrong = tuple(c for c in pairs if report.other_counts[c])

    def so(answer: Answer, words: str, about: tuple[int, ...] = pairs) -> Reason:
        return Reason(answer, words, balls, about, error, unit)

    if forever := _forever(report, pairs):
        return so(Answer.no, forever)
    sinking = _sinking(report, pairs)
    if sinking and report.lying[j]:
        return so(*sinking)
    ties, rule = max(((float(e[j]), name) for name, e in report.tie_errors.items()), default=(0.0, ""))
    if ties > ERROR_LIMIT:
        return so(Answer.not_unique,
                  ": hard spheres have no unique answer for simultaneous collisions; the tie rules "
                  f"{report.hard_options['ties']} and {rule} differ by {percent(ties)} of the fastest impact")
    chaos, shift, overlap = float(report.shifts[j]), float(report.shift_errors[j]), _overlap(report, pairs)
    if chaos > ERROR_LIMIT and align.touching(report.scene)[list(pairs)].any():
        return so(Answer.not_unique,
                  ": hard spheres have no unique answer for touching balls; it depends on the tie rule")
    if chaos > ERROR_LIMIT:
        crowded = "; contacts overlap in time" if overlap else ""
        return so(Answer.not_ball_by_ball, f": single balls are not predictable (compare ensembles){crowded}")
    if shift > ERROR_LIMIT:
        return so(Answer.not_unique,
                  ": balls collide almost simultaneously, and gaps shifted by 1e-12 of themselves change the hard "
                  f"spheres by {percent(shift)} of the fastest impact")
    if lasting := [c for c in pairs if report.unknown[c]]:
        return so(Answer.undecided, f": a soft contact of pair {report.scene.pairs.name(lasting[0])} was still running "
                                    "at the end and cannot be continued; choose a later end or method='located'",
                  tuple(lasting))
    if wrong:
        return so(Answer.no, f": {_other_counts(report, wrong, len(pairs))}", wrong)
    if not error <= ERROR_LIMIT:
        alone = "" if overlap else ", though no contacts overlap in time"
        driven = "; at a driven wall, timing affects the outcome" if report.scene.driven and not overlap else ""
        leaves = _leaves(report, j)
        differ = f"{leaves}, an error of" if leaves else "outcomes differ by"
        return so(Answer.no, f": {differ} {percent(error)} of the fastest impact{alone}{driven}")
    if not sinking and (check := report.unchecked(j)):
        return so(Answer.undecided, f": {check}, so the answer could not be checked")
    return so(*(sinking or (Answer.yes, "")))


def _yes(report: Checked, trivially: list[str]) -> Reason:
    """Return the reason for "yes" if the error is at most `ERROR_LIMIT`.

    Otherwise return the reason for "undecided". `trivially` contains the texts of components that agree trivially.
    """
    error, isolated = report.error, report.measures["isolated_share"]
    if not error <= ERROR_LIMIT:
        return Reason(Answer.undecided, ": no contact has ended")
    bound = f"within {rounded(100.0 * error, 1, up=True)} % of the fastest impact"
    within = bound if error >= MIN_CONTACT_STRENGTH else "to rounding"
    agree = f"outcomes agree {within}"
    if len(trivially) == report.components.count:
        touch = len(report.settled.contacts) + len(report.soft.contacts) > 0
        nothing = f", trivially: {'balls touch only at speeds of rounding errors' if touch else 'nothing collides'}"
        words = max(trivially, default=nothing)
    elif isolated == 1.0:
        words = f": every contact is binary (certified), and {agree}"
    elif report.measures["shared_impulse"] > MIN_CONTACT_STRENGTH:
        words = f", {within}, though contacts overlap in time"
    else:
        how = "every contact is binary" if not isolated < 1.0 else (
            "contacts that overlap in time share no relevant impulse")
        words = f": {how}, and {agree}"
    return Reason(Answer.yes, words, error=error)


def _sinking(report: Checked, pairs: tuple[int, ...]) -> tuple[Answer, str] | None:
    """Return answer and text for soft spheres that sink at rest, or None.

    Also the answer for hard spheres that rest and never collide.
    """
    lying, soft = report.lying[report.components.of_pair[pairs[0]]], report.levelled[1]
    log = soft.contacts[np.isin(soft.contacts["pair"], pairs) & (np.isnan(soft.contacts["t_end"]) | lying)]
    if not len(log) or not (report.scene.pull.any() or report.scene.driven):
        return None
    settled = log["v_in"][:, 0] - log["v_in"][:, 1] <= report.components.weight(soft)[log["pair"]]
    depth = np.where(settled, log["xi_max"], -report.soft.gap[-1][log["pair"]])
    if report.soft.status is Status.resting:
        still = static_overlaps(report.soft)[log["pair"]]
        depth = np.fmax(still, np.where(settled | np.isnan(still), depth, 0.0))
    load = "their weight" if report.scene.external_force is None and not report.scene.driven else "the applied forces"
    share = float(np.max(depth / smaller_radius(report.scene)[log["pair"]]))
    if share > ERROR_LIMIT:
        subject = "nothing collides, but soft spheres" if lying else "soft spheres that come to rest"
        return Answer.no, f": {subject} sink by {percent(share)} of a radius under {load}"
    deepest = f"soft spheres overlap by {depth.max():.3g} m under {load}"
    return (Answer.yes, f", trivially: nothing collides; {deepest}") if lying else None


def _forever(report: Checked, pairs: Sequence[int]) -> str:
    """Text for hard spheres that collide forever while soft ones separate, or ""."""
    hard = report.hard
    if "verdict" not in hard.stats:
        return ""
    first, last = hard.stats["pairs"]
    group = [c for c in pairs if (first <= c <= last if first <= last else c >= first or c <= last)]
    soft = report.levelled[1]
    if not any(soft.count(c) and not math.isnan(float(soft.of(c)["t_end"][-1])) for c in group):
        return ""
    n = sum(map(report.soft.count, group))
    return (f": hard spheres {'possibly ' * (hard.status is Status.bounded)}collide forever ({hard.stats['verdict']}), "
            f"soft spheres separate after {n} contact{'s' * (n != 1)}")


def _other_counts(report: Checked, wrong: tuple[int, ...], of: int) -> str:
    """Text on pairs with different numbers of contacts."""
    p = max((report.pairs[c] for c in reversed(wrong)), key=lambda p: abs(p.soft_contacts - p.hard_contacts))
    counted = f"{p.soft_contacts} contact{'s' * (p.soft_contacts != 1)}, not {p.hard_contacts}"
    said = f"pair {report.scene.pairs.name(p.pair)} has {counted}"
    many = f"{len(wrong)} of {of} pairs differ in contacts; " if len(wrong) > 1 else ""
    j = int(report.components.of_pair[p.pair])
    error = f"outcomes differ by {percent(float(report.errors[j]))} of the fastest impact"
    return f"{many}{said}, and {_leaves(report, j) or error}"


def _leaves(report: Checked, j: int) -> str:
    """Text on the ball of component `j` with the largest difference, or ""."""
    one = report.departure(j)
    if one is None or not one.difference > ERROR_LIMIT:
        return ""
    digits = 3 + 3 * (f"{one.soft_velocity:.3g}" == f"{one.hard_velocity:.3g}")
    return f"ball {one.ball} leaves at {one.soft_velocity:.{digits}g} instead of {one.hard_velocity:.{digits}g} m/s"


def _overlap(report: Checked, pairs: tuple[int, ...]) -> bool:
    """Whether soft contacts of a component overlap in time."""
    of, log = set(pairs), report.counted[1].contacts["pair"]
    return any(int(log[o.lower]) in of for o in report.overlaps)

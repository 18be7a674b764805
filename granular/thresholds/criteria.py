"""What is asked of one value of the parameter: do hard spheres hold there, do they fail, or is it undecided?
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from granular import isolation
from granular.cases import Case
from granular.comparison.answer import Answer as Judgement
from granular.outcome import SAME
from granular.sweeps.results import Answer
from granular.trajectory import EARLY

HOLDS, FAILS, UNDECIDED = VERDICTS = ("holds", "fails", "undecided")


@dataclass(frozen=True, slots=True)
class Value:
    """One value of the parameter.

    Attributes
    ----------
    value : float
        In SI units.
    verdict : str
        "holds", "fails", or "undecided" where a run did not come to its end.
    measure : float
        What decides: the error, in units of the fastest impact; or the time in s up to which every contact was
        isolated, nan where that is the whole run.
    why : str
        The verdict's reason in words.
    """

    value: float
    verdict: str
    measure: float
    why: str


@dataclass(frozen=True)
class Criterion:
    """A question about a case.

    Attributes
    ----------
    judge : callable
        Verdict, measure and reason for a case, and a limit.
    what, how : str
        What is so where hard spheres hold: `what` is `how`.
    words : (2,) strs
        The same in a word or two, and its contrary.
    """

    judge: Callable[[Case, float], tuple[str, float, str]]
    what: str
    how: str
    words: tuple[str, str]


def isolated(case: Case, limit: float) -> tuple[str, float, str]:
    """Whether every contact up to the end of the soft run is isolated; the run ends at the first that is not."""
    run = case.simulate("md", disturbed="stop", log=False)
    time, pair = run.first_disturbed
    if pair >= 0:
        return FAILS, time, f"the first disturbed: {isolation.first_disturbed(run)}"
    if run.status in EARLY:
        return UNDECIDED, math.nan, f"{run.status.name}: {run.message}"
    return HOLDS, math.nan, isolation.sentence(run) or "no contact"


def error(case: Case, limit: float) -> tuple[str, float, str]:
    """Whether the error of hard spheres, `granular.Comparison.error`, is at most `limit`, and nothing else is wrong."""
    report = Answer(case).report
    if report.answer is Judgement.undecided:
        return UNDECIDED, math.nan, report.verdict
    if report.error <= SAME and report.answer is not Judgement.yes:  # small, but for another reason it is no yes
        return FAILS, report.error, report.verdict
    return HOLDS if report.error <= limit else FAILS, report.error, f"error {report.error:.3g}"


CRITERIA = {
    "isolated": Criterion(isolated, "every contact", "isolated", ("isolated", "disturbed")),
    "error": Criterion(error, "the error of hard spheres", "at most {error:g} of the fastest impact",
                       ("small error", "large error")),
}

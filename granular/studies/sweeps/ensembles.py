"""`ensemble`: both engines over many random draws of a scene.

The means can agree where single runs cannot be compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cache
from os import PathLike
from typing import Any

import numpy as np

from granular._engine import check, files
from granular._engine.check import Array
from granular._engine.reports import HARD_COLOUR, SOFT_COLOUR, Report, aligned, canvas, number, rough, with_unit
from granular.cases import Case
from granular.comparison.answer import ANSWER_ORDER, Answer as Judgement
from granular.run.trajectory import EARLY_STATUSES, Trajectory
from granular.studies.sweeps.plan import Plan, planned
from granular.studies.sweeps.results import MISUSE_CODE, NOT_RUN, RESULTS, STATUS_CODES
from granular.studies.sweeps.run import sweep
from granular.studies.sweeps.subject import SceneLike

Way = tuple[float, float] | Callable[[np.random.Generator], Any] | None
"""Distribution of a parameter.

Mean and standard deviation, a function of the random generator, or None for a seed of its own.
"""
COMMON_RESULTS = tuple(name for name in RESULTS if f"hard_{name}" in RESULTS)
"""Results that both engines have."""
RESULT_PREFIXES = {"md": "", "edmd": "hard_"}
"""First letters of the names of results of each engine."""
DEFAULT_MARGIN = 0.1
"""Default margin for equal means, in standard deviations of the soft spheres."""
CONFIDENCE_LEVEL = 0.95
"""Confidence with which all answers hold simultaneously."""
DIFFERENCE_ROUNDING = 1e-9
"""Relative rounding error of a difference."""
STATUSES_WITHOUT_VALUE = (NOT_RUN, MISUSE_CODE, *(STATUS_CODES[status.name] for status in EARLY_STATUSES))
"""Statuses of runs without results: the state after a collapse is not an outcome."""


@check.face
@dataclass(frozen=True, eq=False)
class Quantity:
    """One result over all draws.

    Attributes
    ----------
    name, units : str
        Name and unit.
    hard, soft : (n,) arrays
        Values by draw, nan if a run did not end properly, or has no value.
    means, spreads, errors : (2,) arrays
        Mean, standard deviation and standard error of the mean, of hard and of soft spheres.
    difference, error : float
        Mean of hard minus mean of soft spheres, and its standard error: of the paired differences if both have the same
        draws, otherwise of two samples.
    reach : float
        Half the width of the confidence interval of the true difference, 95 % for all quantities together.
    margin : float
        Means that differ by at most this are equivalent.
    draws, lacking : int
        Number of compared draws, of the engine with fewer, and of draws for which only one of the engines has a value.
    answer : Answer
        yes: the interval is within the margin, and no draw is lacking. no: it is beyond. Otherwise undecided.
    """

    name: str
    units: str
    hard: Array
    soft: Array
    means: Array
    spreads: Array
    errors: Array
    difference: float
    error: float
    reach: float
    margin: float
    draws: int
    lacking: int
    answer: Judgement


@check.face
@dataclass(frozen=True, repr=False)
class Ensemble(Report):
    """Both engines over the same, or over independent draws. Draw it with `plot`.

    Attributes
    ----------
    title : str
        Description of the draws.
    n, seed : int
        Number of draws, and their seed.
    independent : bool
        Whether the engines have draws of their own.
    quantities : tuple of Quantity
        Every result, by pair or body if it has several values.
    refused : str
        Reason of the first refused draw, empty if none was refused.
    """

    title: str
    n: int
    seed: int
    independent: bool
    quantities: tuple[Quantity, ...]
    refused: str

    @property
    def worst(self) -> Quantity:
        """The quantity that decides: worst answer, then farthest from its margin."""
        return min(
            self.quantities, key=lambda q: (ANSWER_ORDER.index(q.answer), -abs(q.difference) / (q.margin or 1.0))
        )

    @property
    def answer(self) -> Judgement:
        """Can the collisions be treated as instantaneous, for the means?"""
        return self.worst.answer

    @property
    def verdict(self) -> str:
        """The answer in one line."""
        q, room = self.worst, abs(self.worst.margin - abs(self.worst.difference))
        off = (f"{q.name} {q.means[0]:.4g} (hard) and {q.means[1]:.4g} (soft) differ by {q.difference:.2g} ± "
               f"{q.reach:.2g}")
        return f"{q.answer.value}: " + {
            Judgement.yes: f"the means agree within {q.margin:.2g}: {off}",
            Judgement.no: f"the means of {off}, by more than {q.margin:.2g}",
        }.get(q.answer, f"{off}; " + (
            f"{q.lacking} {'draw lacks' if q.lacking == 1 else 'draws lack'} a value of one engine" if q.lacking else
            f"to tell that from {q.margin:.2g} takes " + (
                f"about {rough(self.n * (q.reach / room) ** 2)} draws" if room > 0.0 else "more draws"))) + "."

    def __str__(self) -> str:
        engines = [["", "hard", "± s.e.", "sd", "soft", "± s.e.", "sd"]]
        differences = [["", "difference", "± 95 %", "margin", "draws", "answer"]]
        for q in self.quantities:
            of_engines = [number(x, ".4g") for one in zip(q.means, q.errors, q.spreads, strict=True) for x in one]
            judged = [number(x, ".3g") for x in (q.difference, q.reach, q.margin)]
            engines.append([with_unit(q.name, q.units), *of_engines])
            differences.append([with_unit(q.name, q.units), *judged, str(q.draws), q.answer.name])
        how = f"{self.title}: {self.n} {'independent draws' if self.independent else 'draws, the same for both'}"
        return "\n".join([self.verdict, "", how, aligned(engines, "<>"), "", aligned(differences, "<>>>><"),
                          *[f"refused: {self.refused}"] * bool(self.refused)])

    _headline = verdict

    def _numbers(self) -> dict[str, Any]:
        return {**vars(self), "quantities": [{**vars(q), "answer": q.answer.name} for q in self.quantities],
                "answer": self.answer.name, "verdict": self.verdict}

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw the cumulative distributions. Return the figure, or save it to `path`."""
        figure, axes = canvas(3.4, 1.0 + 1.6 * len(self.quantities), len(self.quantities))
        for axis, q in zip(axes[:, 0], self.quantities, strict=True):
            for values, colour, name in ((q.hard, HARD_COLOUR, "hard"), (q.soft, SOFT_COLOUR, "soft")):
                known = np.sort(values[np.isfinite(values)])
                axis.step(known, np.arange(1, len(known) + 1) / max(1, len(known)), color=colour, label=name)
            axis.set(xlabel=f"{q.name}, {q.units}", ylabel="share of draws below", ylim=(0.0, 1.0))
        axes[0, 0].legend()
        return files.write_figure(path, figure, dpi=150)


@check.face
def ensemble(
    scene: SceneLike,
    n: int,
    /,
    vary: str | Mapping[str, Way],
    results: str | Callable[[Trajectory], float] | Iterable[str | Callable[[Trajectory], float]] = "energy_left",
    *,
    margin: float | Mapping[str, float] = DEFAULT_MARGIN,
    seed: int = 0,
    independent: bool = False,
    executor: Executor | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    **fixed: Any,
) -> Ensemble:
    """Run both engines for many random draws of a scene, and compare the means.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        The scene, as in `granular.sweep`.
    n : int
        Number of draws, at least 2. The first draws of a larger ensemble are those of a smaller one.
    vary : mapping, or str
        Parameters by the names of `granular.sweep`, and their distributions: (mean, standard deviation) of a normal
        distribution, a function of a `numpy.random.Generator`, or None for a parameter that is a seed, such as the one
        of a gas: an integer from 0 to 2³¹ - 1. A single name means the name of a seed.
    results : names, or functions of a run that return a number
        Results to compare: contacts, v_rel, t_f, v_final, time, energy_left as in `granular.sweep`, of all pairs or
        bodies, or of one: ``v_rel[1]``. A function is called for both runs.
    margin : float, or mapping
        Means that differ by no more are equivalent. In standard deviations of the soft spheres, or by the names of
        results in their own units (0.1 standard deviations for names that are missing).
    seed : int
        Seed of the draws.
    independent : bool
        Use the n following draws for hard spheres. The difference is then one of two samples.
    executor, on_progress, progress
        As in `granular.sweep`. Soft spheres come first. Results are bitwise identical for any executor.
    **fixed
        Parameters that all draws share.

    Returns
    -------
    Ensemble
        Both engines' results, their means, and the answer.

    Raises
    ------
    TypeError, ValueError
        For an unknown parameter, result or distribution, or if all draws are refused.

    Notes
    -----
    With d the mean difference, s its standard error and q the quantile of Student's t at 1 - 0.025/m of m
    quantities, all m intervals |d| ± q s contain the true differences with 95 % or more (Bonferroni). The answer is
    "yes" if |d| + q s is at most the margin, and "no" if |d| - q s is above it. This concerns means. Distributions may
    differ, see `plot`.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.ensemble("gas", 20, "seed", t_end=0.05)
    >>> found.answer.name
    'yes'
    """
    count, need = check.whole("n", n, at_least=2), "a mapping of parameters to their distributions"
    ways = {vary: None} if isinstance(vary, str) else check.of_kind("vary", vary, Mapping, need)
    if not ways:
        raise ValueError("`vary` must have at least one parameter with its distribution, got an empty mapping.")
    plan = planned(scene, dict.fromkeys(ways, np.zeros(0)), (), fixed)
    for name, way in ways.items():
        _check_way(plan, name, way)
    draws = Draws(plan, tuple(ways.values()), check.whole("seed", seed))
    asked, whole = _requested(results)
    each = margin if isinstance(margin, Mapping) else {"": margin}
    own = {name: check.number(f"the margin of {name}" if name else "margin", x, at_least=0.0)
           for name, x in each.items()}
    share, apart = own.pop("", DEFAULT_MARGIN), check.truth("independent", independent)
    data = [sweep(draws, {"draw": np.arange(first, first + count)},
                  [Of(ask, engine) if callable(ask) else RESULT_PREFIXES[engine] + name for name, ask in whole.items()],
                  executor=executor, on_progress=on_progress, progress=progress)
            for engine, first in (("md", 0), ("edmd", count * apart))]
    soft, hard = ({name: values for one in whole for name, values in _values(of_engine, one, prefix)}
                  for of_engine, prefix in zip(data, RESULT_PREFIXES.values(), strict=True))
    check.known([*asked, *own], {*soft, *whole}, "result")
    found = {name: (hard[name], values) for name, values in soft.items() if not asked.keys().isdisjoint(_names(name))}
    quantities = tuple(
        judged(name, data[0][_names(name)[1]].attrs["units"], values, share,
               next((own[x] for x in _names(name) if x in own), None), (not apart, len(found)))
        for name, values in found.items())
    return Ensemble(plan.subject.title, count, draws.seed, apart, quantities,
                    next((str(one.attrs["refusal"]) for one in data if "refusal" in one.attrs), ""))


def _check_way(plan: Plan, name: str, way: Any) -> None:
    """Raise an error unless it is a distribution for that parameter."""
    fix = "Give (mean, sd), a function of the generator, or None for a seed."
    if way is None and not (plan.subject.is_whole(name) or str(plan.subject.way(name)[-1]) == "seed"):
        raise ValueError(f"`vary[{name!r}]` must not be None, because {name} is not an integer seed. {fix}")
    if callable(way):
        check.takes(f"vary[{name!r}]", way, "generator")
    elif way is not None:
        _, spread = check.array(f"vary[{name!r}]", way, (2,), fix=fix, finite="a finite number").tolist()
        check.number(f"the standard deviation of {name}", spread, at_least=0.0)


def _requested(results: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the requested quantities, and the results that contain them."""
    given = check.several("results", results, "a name or a function of a run, or several")
    asked = {ask if isinstance(ask, str) else getattr(ask, "__name__", "result"): ask for ask in given}
    if len(asked) < len(given) or not given:
        raise ValueError("`results` must have one or more entries of different names, got "
                         f"{', '.join(asked) or 'none'}.")
    whole = {name.partition("[")[0]: ask for name, ask in asked.items()}
    for name, ask in whole.items():
        check.takes(f"the result {name}", ask, "run") if callable(ask) else check.choice("result", name, COMMON_RESULTS)
    return asked, whole


@dataclass(frozen=True)
class Draws:
    """Case number `draw` of an ensemble, a function of this number and the seed."""

    plan: Plan
    ways: tuple[Way, ...]
    seed: int

    def __call__(self, draw: int = 0) -> Case:
        random = np.random.default_rng([self.seed, draw])
        values = [int(random.integers(2**31)) if way is None else way(random) if callable(way) else
                  float(way[0] + way[1] * random.standard_normal()) for way in self.ways]
        case = replace(self.plan.case(values))
        vars(case)["simulate"] = cache(case.simulate)  # several results ask for the same run
        return case


@dataclass(frozen=True)
class Of:
    """A function of a run, called for one engine."""

    function: Callable[[Trajectory], float]
    engine: str

    @property
    def __name__(self) -> str:
        return RESULT_PREFIXES[self.engine] + getattr(self.function, "__name__", "result")

    def __call__(self, case: Case) -> float:
        return float(self.function(case.simulate(self.engine)))


def _names(name: str) -> tuple[str, str]:
    """Return the name of a quantity such as "rise[1]", and of its result "rise"."""
    return name, name.partition("[")[0]


def _values(data: Any, name: str, prefix: str) -> Iterator[tuple[str, Array]]:
    """Return the quantities of a result of one engine by name, shape (n,), or nan."""
    values = data[prefix + name].values.astype(float)
    values[np.isin(data["status"].values, STATUSES_WITHOUT_VALUE)] = math.nan
    yield from [(name, values)] if values.ndim == 1 else [(f"{name}[{k}]", row) for k, row in enumerate(values.T)]


def judged(
    name: str, units: str, values: tuple[Array, Array], share: float, own: float | None, how: tuple[bool, int],
) -> Quantity:
    """Judge one quantity by its values of both engines, paired or not.

    There are `of` quantities in all, see `ensemble`.
    """
    from scipy.special import stdtrit

    (paired, of), known = how, [np.isfinite(one) for one in values]
    kept = [one[known[0] & known[1] if paired else there] for one, there in zip(values, known, strict=True)]
    lacking = int((known[0] != known[1]).sum() if paired else 2 * len(known[0]) - sum(map(len, kept)))
    draws = min(map(len, kept))
    if draws < 2:
        kept = [np.full(2, math.nan)] * 2
    size = np.array([len(one) for one in kept])
    means, spreads = np.array([(one.mean(), one.std(ddof=1)) for one in kept]).T
    errors = spreads / np.sqrt(size)
    error = float(np.hypot(*errors) if not paired else (kept[0] - kept[1]).std(ddof=1) / math.sqrt(size[0]))
    apart, reach = (
        float(means[0] - means[1]),
        error * float(stdtrit(size.min() - 1, 1.0 - 0.5 * (1.0 - CONFIDENCE_LEVEL) / of)),
    )
    margin = max(share * spreads[1] if own is None else own, DIFFERENCE_ROUNDING * np.abs(means).max())
    answer = (Judgement.yes if abs(apart) + reach <= margin and not lacking else
              Judgement.no if abs(apart) - reach > margin else Judgement.undecided)
    return Quantity(name, units, *values, means, spreads, errors, apart, error, reach, float(margin), draws, lacking,
                    answer)

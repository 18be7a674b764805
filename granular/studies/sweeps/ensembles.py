"""`ensemble`: both engines over many random draws of a scene.

The means can agree even if single runs cannot be compared.
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

from granular._engine import check, files, signature
from granular._engine.callables import function_of
from granular._engine.check import Array
from granular._engine.reports import (
    HARD_COLOUR,
    SOFT_COLOUR,
    Report,
    add_letters,
    aligned,
    axis_label,
    canvas,
    number,
    rough_text,
    style,
    with_unit,
)
from granular.cases import Case
from granular.comparison.answer import ANSWER_ORDER, Answer as Judgement
from granular.run.trajectory import EARLY_STATUSES, Trajectory
from granular.studies.sweeps.plan import Plan, make_plan
from granular.studies.sweeps.results import MISUSE_CODE, NOT_RUN, RESULTS, STATUS_CODES
from granular.studies.sweeps.run import sweep
from granular.studies.sweeps.subject import SceneLike

Distribution = tuple[float, float] | Callable[[np.random.Generator], Any] | None
"""Distribution of a parameter.

It is (mean, standard deviation) of a normal distribution, a function of the random generator, or None for a random
seed.
"""
COMMON_RESULTS = tuple(name for name in RESULTS if f"hard_{name}" in RESULTS)
"""Results that both engines have."""
RESULT_PREFIXES = {"md": "", "edmd": "hard_"}
"""Prefix of the names of results of each engine."""
DEFAULT_MARGIN = 0.1
"""Default margin of equivalent means, in standard deviations of the soft spheres."""
CONFIDENCE_LEVEL = 0.95
"""Probability with which all confidence intervals contain the true differences."""
DIFFERENCE_ROUNDING = 1e-9
"""Relative rounding error of a difference."""
STATUSES_WITHOUT_VALUE = (NOT_RUN, MISUSE_CODE, *(STATUS_CODES[status.name] for status in EARLY_STATUSES))
"""Statuses of runs without results.

The state after a collapse, for example, is not an outcome.
"""


@signature.face
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
    difference : float
        Mean of hard minus mean of soft spheres.
    error : float
        Standard error of `difference`. If both engines have the same draws, it is computed from the paired differences,
        otherwise from two independent samples.
    reach : float
        Half the width of the confidence interval of the true difference, 95 % for all quantities together.
    margin : float
        Means that differ by at most this value are equivalent.
    draws : int
        Number of compared draws. With independent draws, the smaller number of the two engines.
    lacking : int
        Number of draws with a value of only one engine. With independent draws, the number of missing values.
    answer : Answer
        "yes" if the confidence interval lies within ± `margin` and no draw is lacking. "no" if it lies outside.
        Otherwise undecided.
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


@signature.face
@dataclass(frozen=True, repr=False)
class Ensemble(Report):
    """Both engines over the same or independent draws. Draw it with `plot`.

    Attributes
    ----------
    title : str
        Description of the draws.
    n, seed : int
        Number of draws, and their seed.
    independent : bool
        Whether the two engines have different draws.
    quantities : tuple of Quantity
        Every result, by pair or body if it has several values.
    refused : str
        Message of the first draw whose run raised an exception, otherwise empty.
    """

    title: str
    n: int
    seed: int
    independent: bool
    quantities: tuple[Quantity, ...]
    refused: str

    @property
    def worst(self) -> Quantity:
        """Quantity that determines the answer.

        It has the worst answer, and among these the largest difference relative to its margin.
        """
        return min(
            self.quantities, key=lambda q: (ANSWER_ORDER.index(q.answer), -abs(q.difference) / (q.margin or 1.0))
        )

    @property
    def answer(self) -> Judgement:
        """Can the collisions be treated as instantaneous, for the means?"""
        return self.worst.answer

    @property
    def verdict(self) -> str:
        """Sentence that states the answer and its reason."""
        q, distance = self.worst, abs(self.worst.margin - abs(self.worst.difference))
        statement = (f"{q.name} {q.means[0]:.4g} (hard) and {q.means[1]:.4g} (soft) differ by {q.difference:.2g} ± "
               f"{q.reach:.2g}")
        return f"{q.answer.value}: " + {
            Judgement.yes: f"the means agree within {q.margin:.2g}: {statement}",
            Judgement.no: f"the means of {statement}, by more than {q.margin:.2g}",
        }.get(q.answer, f"{statement}; " + (
            f"{q.lacking} {'draw lacks' if q.lacking == 1 else 'draws lack'} a value of one engine" if q.lacking else
            f"deciding whether this exceeds {q.margin:.2g} requires " + (
                f"about {rough_text(self.n * (q.reach / distance) ** 2)} draws" if distance > 0.0 else "more draws"
            ))) + "."

    def __str__(self) -> str:
        engines = [["", "hard", "± s.e.", "sd", "soft", "± s.e.", "sd"]]
        differences = [["", "difference", "± 95 %", "margin", "draws", "answer"]]
        for q in self.quantities:
            of_engines = [number(x, ".4g") for values in zip(q.means, q.errors, q.spreads, strict=True) for x in values]
            numbers = [number(x, ".3g") for x in (q.difference, q.reach, q.margin)]
            engines.append([with_unit(q.name, q.units), *of_engines])
            differences.append([with_unit(q.name, q.units), *numbers, str(q.draws), q.answer.name])
        heading = f"{self.title}: {self.n} {'independent draws' if self.independent else 'draws, the same for both'}"
        return "\n".join([self.verdict, "", heading, aligned(engines, "<>"), "", aligned(differences, "<>>>><"),
                          *[f"refused: {self.refused}"] * bool(self.refused)])

    _headline = verdict

    def _numbers(self) -> dict[str, Any]:
        return {**vars(self), "quantities": [{**vars(q), "answer": q.answer.name} for q in self.quantities],
                "answer": self.answer.name, "verdict": self.verdict}

    @style()
    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw the cumulative distributions. Return the figure, or save it to `path`."""
        figure, axes = canvas(3.4, 1.0 + 1.6 * len(self.quantities), len(self.quantities))
        for axis, q in zip(axes[:, 0], self.quantities, strict=True):
            for values, colour, line, name in ((q.hard, HARD_COLOUR, "--", "hard"), (q.soft, SOFT_COLOUR, "-", "soft")):
                finite = np.sort(values[np.isfinite(values)])
                axis.step(finite, np.arange(1, len(finite) + 1) / max(1, len(finite)), color=colour, ls=line,
                          label=f"{name} spheres")
            axis.set(xlabel=axis_label(q.name, q.units), ylabel="fraction of draws below", ylim=(0.0, 1.03))
        add_letters(axes[:, 0] if len(axes) > 1 else ())
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return files.write_figure(path, figure, dpi=200)


@signature.face
def ensemble(
    scene: SceneLike,
    n: int,
    /,
    vary: str | Mapping[str, Distribution],
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
        Number of draws, at least 2. A larger ensemble begins with the draws of a smaller one.
    vary : mapping, or str
        Parameters by the names of `granular.sweep`, and their distributions: (mean, standard deviation) of a normal
        distribution, a function of a `numpy.random.Generator`, or None. None stands for a random seed, such as the
        parameter `seed` of a gas: an integer from 0 to 2³¹ - 1. A string is the name of such a parameter.
    results : names, or functions of a run that return a number
        Results to compare: contacts, v_rel, t_f, v_final, time, energy_left as in `granular.sweep`, of all pairs or
        bodies, or of one: ``v_rel[1]``. A function is called for both runs.
    margin : float, or mapping
        Means that differ by at most this margin are equivalent. A number is in standard deviations of the soft
        spheres. A mapping has margins by names of results, in their units. The default for missing names is 0.1
        standard deviations.
    seed : int
        Seed of the draws. Defaults to 0.
    independent : bool
        Whether to use n further draws for hard spheres. Defaults to False. The means are then compared as two
        independent samples.
    executor, on_progress, progress
        As in `granular.sweep`. Soft spheres come first. Results are bitwise identical for any executor.
    **fixed
        Parameters that have the same value in all draws.

    Returns
    -------
    Ensemble
        Both engines' results, their means, and the answer.

    Raises
    ------
    TypeError, ValueError
        For an unknown parameter, result or distribution, or if the runs of all draws raise exceptions.

    Notes
    -----
    Let d be the mean difference, s its standard error, m the number of quantities, and q the quantile of Student's t at
    1 - 0.025/m. All m intervals d ± q s contain the true differences with a probability of 95 % or more (Bonferroni).
    The answer is "yes" if |d| + q s is at most the margin, and "no" if |d| - q s is above it. This concerns means.
    Distributions can differ, see `plot`.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.ensemble("gas", 20, "seed", t_end=0.05)
    >>> found.answer.name
    'yes'
    """
    count, need = check.integer("n", n, at_least=2), "a mapping of parameters to their distributions"
    distributions = {vary: None} if isinstance(vary, str) else check.of_kind("vary", vary, Mapping, need)
    if not distributions:
        raise ValueError("`vary` must have at least one parameter with its distribution, got an empty mapping.")
    plan = make_plan(scene, dict.fromkeys(distributions, np.zeros(0)), (), fixed)
    for name, distribution in distributions.items():
        _check_distribution(plan, name, distribution)
    draws = Draws(plan, tuple(distributions.values()), check.integer("seed", seed))
    requested, whole = _requested(results)
    margins = margin if isinstance(margin, Mapping) else {"": margin}
    margin_by_name = {name: check.number(f"the margin of {name}" if name else "margin", x, at_least=0.0)
           for name, x in margins.items()}
    default_margin, separate = margin_by_name.pop("", DEFAULT_MARGIN), check.boolean("independent", independent)
    data = [sweep(draws, {"draw": np.arange(first, first + count)},
                  [EngineResult(entry, engine) if callable(entry) else RESULT_PREFIXES[engine] + name
                   for name, entry in whole.items()],
                  executor=executor, on_progress=on_progress, progress=progress)
            for engine, first in (("md", 0), ("edmd", count * separate))]
    soft, hard = ({name: values for result in whole for name, values in _quantity_values(of_engine, result, prefix)}
                  for of_engine, prefix in zip(data, RESULT_PREFIXES.values(), strict=True))
    check.known_names([*requested, *margin_by_name], {*soft, *whole}, "result")
    compared = {name: (hard[name], values) for name, values in soft.items()
                if not requested.keys().isdisjoint(_quantity_and_result(name))}
    quantities = tuple(
        compared_quantity(name, data[0][_quantity_and_result(name)[1]].attrs["units"], values, default_margin,
               next((margin_by_name[x] for x in _quantity_and_result(name) if x in margin_by_name), None),
               (not separate, len(compared)))
        for name, values in compared.items())
    return Ensemble(plan.subject.title, count, draws.seed, separate, quantities,
                    next((str(data_set.attrs["refusal"]) for data_set in data if "refusal" in data_set.attrs), ""))


def _check_distribution(plan: Plan, name: str, distribution: Any) -> None:
    """Raise an error if `distribution` is not a distribution of the parameter `name`."""
    fix = "Give (mean, sd), a function of the generator, or None for a seed."
    if distribution is None and not (plan.subject.is_whole(name) or str(plan.subject.way(name)[-1]) == "seed"):
        raise ValueError(f"`vary[{name!r}]` must not be None, because {name} is not an integer seed. {fix}")
    if callable(distribution):
        function_of(f"vary[{name!r}]", distribution, "generator")
    elif distribution is not None:
        _, spread = check.array(f"vary[{name!r}]", distribution, (2,), fix=fix, finite="a finite number").tolist()
        check.number(f"the standard deviation of {name}", spread, at_least=0.0)


def _requested(results: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the requested quantities, and the results that contain them, by name.

    The quantity "v_rel[1]" is contained in the result "v_rel".
    """
    entries = check.several("results", results, "a name or a function of a run, or several")
    requested = {entry if isinstance(entry, str) else getattr(entry, "__name__", "result"): entry for entry in entries}
    if len(requested) < len(entries) or not entries:
        raise ValueError("`results` must have one or more entries of different names, got "
                         f"{', '.join(requested) or 'none'}.")
    results_by_name = {name.partition("[")[0]: entry for name, entry in requested.items()}
    for name, entry in results_by_name.items():
        function_of(f"the result {name}", entry, "run") if callable(entry) else (
            check.choice("results", name, COMMON_RESULTS))
    return requested, results_by_name


@dataclass(frozen=True)
class Draws:
    """Function of the number `draw` of a draw that returns its case.

    The random parameters depend only on this number and on the seed.
    """

    plan: Plan
    ways: tuple[Distribution, ...]
    seed: int

    def __call__(self, draw: int = 0) -> Case:
        random = np.random.default_rng([self.seed, draw])
        values = [int(random.integers(2**31)) if spec is None else spec(random) if callable(spec) else
                  float(spec[0] + spec[1] * random.standard_normal()) for spec in self.ways]
        case = replace(self.plan.case(values))
        vars(case)["simulate"] = cache(case.simulate)  # several results use the same run
        return case


@dataclass(frozen=True)
class EngineResult:
    """Result function of a case: the user's function of a run of one engine."""

    function: Callable[[Trajectory], float]
    engine: str

    @property
    def __name__(self) -> str:
        return RESULT_PREFIXES[self.engine] + getattr(self.function, "__name__", "result")

    def __call__(self, case: Case) -> float:
        return float(self.function(case.simulate(self.engine)))


def _quantity_and_result(name: str) -> tuple[str, str]:
    """Return `name`, such as "rise[1]", and the name of the whole result, "rise"."""
    return name, name.partition("[")[0]


def _quantity_values(data: Any, name: str, prefix: str) -> Iterator[tuple[str, Array]]:
    """Yield the quantities of a result of one engine: name, and values of shape (n,).

    The values of runs without results are nan.
    """
    values = data[prefix + name].values.astype(float)
    values[np.isin(data["status"].values, STATUSES_WITHOUT_VALUE)] = math.nan
    yield from [(name, values)] if values.ndim == 1 else [(f"{name}[{k}]", column) for k, column in enumerate(values.T)]


def compared_quantity(
    name: str, units: str, values: tuple[Array, Array], default: float, own: float | None, pairing: tuple[bool, int],
) -> Quantity:
    """Compare the values of both engines for one quantity.

    Parameters
    ----------
    name, units : str
        Name and unit of the quantity.
    values : two (n,) arrays
        Values of hard and of soft spheres by draw, nan if missing.
    default : float
        Margin in standard deviations of the soft spheres.
    own : float or None
        Margin in the unit of the quantity, which replaces the default.
    pairing : (bool, int)
        Whether both engines have the same draws, and the number of all compared quantities.
    """
    from scipy.special import stdtrit

    (paired, of), finite = pairing, [np.isfinite(sample) for sample in values]
    used = [sample[finite[0] & finite[1] if paired else mask] for sample, mask in zip(values, finite, strict=True)]
    lacking = int((finite[0] != finite[1]).sum() if paired else 2 * len(finite[0]) - sum(map(len, used)))
    draws = min(map(len, used))
    if draws < 2:
        used = [np.full(2, math.nan)] * 2
    size = np.array([len(sample) for sample in used])
    means, spreads = np.array([(sample.mean(), sample.std(ddof=1)) for sample in used]).T
    errors = spreads / np.sqrt(size)
    error = float(np.hypot(*errors) if not paired else (used[0] - used[1]).std(ddof=1) / math.sqrt(size[0]))
    difference, reach = (
        float(means[0] - means[1]),
        error * float(stdtrit(size.min() - 1, 1.0 - 0.5 * (1.0 - CONFIDENCE_LEVEL) / of)),
    )
    margin = max(default * spreads[1] if own is None else own, DIFFERENCE_ROUNDING * np.abs(means).max())
    answer = (Judgement.yes if abs(difference) + reach <= margin and not lacking else
              Judgement.no if abs(difference) - reach > margin else Judgement.undecided)
    return Quantity(name, units, *values, means, spreads, errors, difference, error, reach, float(margin), draws,
                    lacking, answer)

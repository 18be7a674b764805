"""`sweep`: results over all combinations of parameters, with bisected jumps."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular._engine.progress import ProgressCallback, progress_callback
from granular._engine.reports import cores
from granular.cases import Case
from granular.studies.sweeps import schedule
from granular.studies.sweeps.executors import checked_executor
from granular.studies.sweeps.plan import Plan, check_names, dataset, make_plan, resume, write, xarray_
from granular.studies.sweeps.results import MISUSE_CODE, NOT_RUN, Answers
from granular.studies.sweeps.subject import SceneLike, Values, checked_axes

if TYPE_CHECKING:
    import xarray


DEFAULT_RESULTS = ("contacts", "v_rel", "eps_ratio")
"""Default results."""
SAVE_EVERY = 30.0
"""Minimum time in s between two writes of the file."""
Counts = Callable[[list[Values]], Values]
"""Function that returns contact counts, shape (cells, pairs).

Its argument is a list of columns of parameters, each with one value per cell.
"""
Where = tuple[Executor | None, int]
"""An executor or None, and the number of threads without an executor."""


@signature.face
def sweep(
    scene: SceneLike,
    over: Mapping[str, ArrayLike] | Iterable[str] | str,
    results: str | Callable[[Case], float] | Iterable[str | Callable[[Case], float]] = DEFAULT_RESULTS,
    *,
    run: Mapping[str, Any] | None = None,
    refine: str | None = None,
    precision: float = 1e-6,
    save: str | PathLike[str] | None = None,
    key: str | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    **fixed: Any,
) -> xarray.Dataset:
    """Solve a scene for all combinations of parameter values.

    Each combination is a cell of the sweep.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        Name of a ready-made case, a TOML file, a function of the parameters that returns a `granular.Case` (importable
        for other processes), a case itself, or a scene, with `law`, `rule`, `until`, `t_end` as further parameters.
    over : mapping, or text
        Values of the parameters to vary: ``{"gap": [1e-5, 1e-4]}``, or texts such as ``"gap=1e-7:1e-2:300:log"``.
        ``radii[0]`` is one entry of a list of values. Parameters of a file are the numbers in its tables. Parameters
        of a case are the numbers of its scene, laws and rule: ``mass[1]``, ``gravity``, ``law.k`` (of all pairs),
        ``law[0].k``, ``t_end``. ``gap`` is the gap of all pairs of balls. ``restitution`` is the restitution of all
        laws (at constant stiffness) and of the rule.
    results : names, or functions of the case that return a number
        Results of every cell in addition to its `status`, such as contacts, v_rel, v_final, time, error or answer.
        `granular.studies.sweeps.results.RESULTS` has all names.
    run : mapping, optional
        Options of ``simulate``, such as ``{"engine": "plain"}``. Without such options, and for laws that are powers of
        the overlap, cells run compiled in one call per batch.
    refine : str, optional
        Parameter along which jumps of the contact counts are bisected. It requires the result "contacts". The jumps are
        `edge`, `edge_contacts` along the dimension "jump". Windows narrower than the spacing of the grid can be missed.
    precision : float
        Relative width to which jumps are bisected. Defaults to 1e-6.
    save : path, optional
        A netCDF file for the result. It is written every half minute, at the end and on interruption. If it exists,
        only missing cells are solved.
    key : str, optional
        Identifies user-defined functions and classes in the file, such as ``"version 2"``. Change it whenever you
        change them. Without a key, an existing file is refused if the sweep uses a scene, law, rule, wall or result of
        your own.
    executor : concurrent.futures.Executor, optional
        A ``ProcessPoolExecutor``, ``client.get_executor()`` of dask, an ``MPIPoolExecutor``. Defaults to this process.
        The results are bitwise identical.
    workers : int, optional
        Number of threads of this process, without an executor, for cells that run compiled in one call per batch.
        Defaults to one thread per available core if this is faster. Threads do not accelerate cells that run one by
        one. Use processes for them.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called with two numbers. `reached` is the fraction of this call's cells that
        are solved. `count` is the number of all solved cells, including the cells of a file.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.
    **fixed
        Parameters that have the same value in all cells.

    Returns
    -------
    xarray.Dataset
        One dimension per parameter, then "pair" or "body". `status` marks cells that were refused (``misuse``) or did
        not end properly. The attribute `refusal` is the first message of a refused cell.

    Raises
    ------
    TypeError, ValueError
        For an unknown parameter or result, and for a sweep in which all cells are refused.

    Examples
    --------
    >>> import granular as gr
    >>> data = gr.sweep("three-balls", {"restitution": [0.5, 0.7, 0.9]}, "contacts")
    >>> data["contacts"].sel(pair=1).values.tolist()
    [4, 4, 3]
    """
    checked_executor(executor)
    threads = cores() if workers is None else check.integer("workers", workers, at_least=1)
    xarray_()
    varied = checked_axes(over)
    requested = check.several("results", results, "a name or a function, or several")
    version_key = check.of_kind("key", key, str | None, "a text or None")
    plan = replace(make_plan(scene, varied, tuple(requested), fixed, run), version=version_key)
    check_names(plan, save)
    if refine is not None:
        check.choice("refine", refine, list(varied))
        check.choice("the result to refine by", "contacts", list(plan.results))
        if varied[refine].dtype.kind not in "if":
            raise TypeError(f"`refine` must name a parameter of numbers, got {refine!r} with values "
                            f"{varied[refine].tolist()}.")
    job = _Job(plan, varied, [values.ravel() for values in np.meshgrid(*varied.values(), indexing="ij")], save)
    where = executor, threads
    if executor is not None and progress:
        executor.submit(int)  # its processes start before there is a second thread
    with progress_callback(progress, on_progress, "cells") as tell:
        job.solve(where, tell)
        return job.dataset() if refine is None else job.refined(refine, precision, where)


class _Job:
    """A sweep in progress.

    `columns` has one array per parameter, with one value per cell. `save` is the path of the file, or None.
    """

    def __init__(self, plan: Plan, over: dict[str, Values], columns: list[Values], save: Any) -> None:
        self.plan, self.over, self.columns, self.save = plan, over, columns, save
        self.answers = Answers(plan.results, len(columns[0]))
        saved_columns, self.notes = resume(save, plan, over) if save is not None else ({}, {})
        self.answers.put(slice(None), saved_columns)

    def solve(self, where: Where, report_progress: ProgressCallback | None) -> None:
        """Solve the missing cells.

        If a file is given, solved cells are written to it even if an exception is raised.
        """
        missing = np.flatnonzero(self.answers.columns["status"] == NOT_RUN)
        saved_count = solved_count = len(self.columns[0]) - len(missing)
        save_time = time.monotonic()
        try:
            for cells, batch_answers in schedule.solve_in_batches(self.plan, self.columns, missing, *where):
                self.answers.take(cells, batch_answers)
                solved_count += len(cells)
                if report_progress is not None:
                    report_progress((solved_count - saved_count) / len(missing), solved_count)
                if time.monotonic() > save_time + SAVE_EVERY:
                    self.written(self.dataset())
                    save_time = time.monotonic()
        finally:
            if solved_count > saved_count:
                self.written(self.dataset())
        if (self.answers.columns["status"] == MISUSE_CODE).all():
            raise ValueError(self.answers.refusal[1] if self.answers.refusal else self.notes.get(
                "refusal", f"All cells of {self.save!r} were refused, and the file does not contain a reason. Remove "
                           "the file."))

    def dataset(self) -> xarray.Dataset:
        """Return the results of all cells that have been solved as a data set."""
        notes = {"refusal": self.answers.refusal[1]} if self.answers.refusal else self.notes
        return dataset(self.plan, self.over, self.answers.columns, notes)

    def written(self, data: xarray.Dataset) -> xarray.Dataset:
        """Write the data set if a file is given, and return it."""
        if self.save is not None:
            write(data, self.save)
        return data

    def refined(self, name: str, precision: float, where: Where) -> xarray.Dataset:
        """Return the data set with the jumps of the contact counts along one parameter.

        It is also written to the file of the sweep, if there is one.
        """
        plan = replace(self.plan, asked=("contacts",))
        axis, shape = list(self.over).index(name), tuple(map(len, self.over.values()))

        def counts(columns: list[Values]) -> Values:
            answers = Answers(plan.results, len(columns[0]))
            answers.put([], {"contacts": self.answers.columns["contacts"][:0]})  # as wide
            for cells, batch_answers in schedule.solve_in_batches(plan, columns, np.arange(len(columns[0])), *where):
                answers.take(cells, batch_answers)
            return np.asarray(answers.columns["contacts"])

        whole = self.plan.subject.is_whole(name)
        row, intervals, sides = bisect_jumps(
            axis, self.columns, self.answers.columns["contacts"], shape, counts, precision, whole
        )
        data = self.dataset()
        attributes = data[name].attrs | {"comment": f"interval of {name} in which a count jumps"}
        data["edge"] = ("jump", "side"), intervals, attributes
        data["edge_contacts"] = ("jump", "side", "pair"), sides.astype(np.int64), data["contacts"].attrs
        for other, column in zip(self.over, self.columns, strict=True):
            if other != name:
                data[f"edge_{other}"] = "jump", column[row], data[other].attrs
        return self.written(data)


def bisect_jumps(axis: int, columns: Sequence[Values], grid: Values, shape: tuple[int, ...], counts: Counts,
          precision: float, integers_only: bool = False) -> tuple[Values, Values, Values]:
    """Bisect every jump of contact counts between neighbours of the grid along `axis`.

    Jumps are known to a relative `precision`, for an integer parameter to two consecutive integers. If a midpoint has
    a third count, both halves of the interval are bisected. An interval with other counts is missed if it lies between
    two neighbours with equal counts. Cells without counts are ignored, and an interval whose midpoint has no count is
    not divided.

    Parameters
    ----------
    axis : int
        Number of the parameter, whose values are ``columns[axis]``.
    columns : sequence of arrays
        Values of all parameters, one per cell.
    grid : array (cells, pairs)
        Contact counts of all cells, negative if there are none.
    shape : tuple of int
        Shape of the grid.
    counts : callable
        Function that returns the contact counts of further cells.
    precision : float
        Relative width of an interval that is not divided further.
    integers_only : bool
        Whether the parameter is an integer.

    Returns
    -------
    row, ends, counts : arrays (j,), (j, 2), (j, 2, pairs)
        For each jump: the number of a cell with the same other parameters, the ends of the interval of the parameter,
        and the contact counts there.
    """
    check.number("precision", precision, at_least=1e-15, at_most=0.1)
    cells = np.moveaxis(np.arange(len(grid)).reshape(shape), axis, -1)
    pairs = np.stack([cells[..., :-1].ravel(), cells[..., 1:].ravel()], axis=1)
    has_counts: Any = (grid >= 0).any(axis=1)
    pairs = pairs[(grid[pairs[:, 0]] != grid[pairs[:, 1]]).any(axis=1) & has_counts[pairs].all(axis=1)]
    row, ends, found = pairs[:, 0], columns[axis].astype(np.float64)[pairs], grid[pairs]
    failed = np.zeros(len(row), bool)
    while True:
        middle = 0.5 * (ends[:, 0] + ends[:, 1])
        middle = np.floor(middle) if integers_only else middle
        wide = ~failed & (np.abs(ends[:, 1] - ends[:, 0]) > precision * np.abs(ends).max(axis=1))
        wide &= (middle != ends[:, 0]) & (middle != ends[:, 1])
        if not wide.any():
            break
        at = middle[wide].astype(np.int64) if integers_only else middle[wide]
        there = counts([at if k == axis else column[row[wide]] for k, column in enumerate(columns)])
        failed[wide] = (there < 0).all(axis=1)
        there, wide = there[~failed[wide]], wide & ~failed
        halves = [(row[~wide], ends[~wide], found[~wide], failed[~wide])]
        for side in (0, 1):  # the halves that contain a jump
            end, count = ends[wide].copy(), found[wide].copy()
            end[:, 1 - side], count[:, 1 - side] = middle[wide], there
            has_jump = (count[:, 0] != count[:, 1]).any(axis=1)
            halves.append((row[wide][has_jump], end[has_jump], count[has_jump], failed[wide][has_jump]))
        row, ends, found, failed = map(np.concatenate, zip(*halves, strict=True))
    order = np.lexsort([ends[:, 0], *[column[row] for k, column in enumerate(columns) if k != axis][::-1]])
    return row[order], ends[order], found[order]

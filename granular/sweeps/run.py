"""`sweep`: any parameter × any parameter × any result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from granular import _check
from granular.cases import Case
from granular.sweeps import axes, cells, refine, schedule, store
from granular.sweeps.axes import Values
from granular.sweeps.plan import Plan, planned
from granular.sweeps.results import MISUSE, NOT_RUN

if TYPE_CHECKING:
    import xarray

DEFAULT = ("contacts", "v_rel", "eps_ratio")
"""What is kept of every cell if nothing is said."""
SAVE_EVERY = 30.0
"""Seconds between two writes of what is done so far."""


def sweep(
    scene: str | Callable[..., Case],
    over: Mapping[str, ArrayLike] | Iterable[str] | str,
    results: str | Callable[[Case], float] | Iterable[str | Callable[[Case], float]] = DEFAULT,
    *,
    run: Mapping[str, Any] | None = None,
    refine: str | None = None,
    precision: float = 1e-6,
    save: str | PathLike[str] | None = None,
    executor: Executor | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    **fixed: Any,
) -> xarray.Dataset:
    """Solve a scene for every combination of some parameters.

    Parameters
    ----------
    scene : str or callable
        Name of a ready-made case, or a function of the parameters that returns a `granular.cases.Case` (for other
        processes one they can import).
    over : mapping, or text
        Values of the parameters to vary: ``{"gap": [1e-5, 1e-4]}``, or texts such as ``"gap=1e-7:1e-2:300:log"``.
        ``radii[0]`` is one entry of a list of values.
    results : names, or functions of the case that return a number
        What to keep of every cell, besides its `status`; see `granular.sweeps.results.RESULTS`.
    run : mapping, optional
        Options of ``simulate``, such as ``{"engine": "plain"}``. Without them, and for laws that are powers of the
        overlap, cells run compiled in one call per batch.
    refine : str, optional
        The parameter along which jumps of the contact counts are bisected; needs the result "contacts". They come as
        `edge`, `edge_contacts` along the dimension "jump". Windows narrower than the grid's spacing can be missed.
    precision : float
        Relative width to which jumps are bisected.
    save : path, optional
        A netCDF file for the result. It is written every half minute as well as at the end or on interruption; if it
        is there already, only the cells it lacks are solved.
    executor : concurrent.futures.Executor, optional
        Where to run: a ``ProcessPoolExecutor``, ``client.get_executor()`` of dask, an ``MPIPoolExecutor``; default
        this process. The result is the same, bit for bit.
    on_progress : callable, optional
        ``on_progress(reached, count)`` now and then: the share of this call's cells that is solved, and the number of
        all cells that are, those of a file included.
    **fixed
        Parameters that all cells share.

    Returns
    -------
    xarray.Dataset
        One dimension per parameter, then "pair" or "body". Cells that were refused (status ``misuse``) or did not end
        properly say so in `status`; the first sentence of a refusal is the attribute `refusal`.

    Raises
    ------
    TypeError, ValueError
        For an unknown parameter or result; for a sweep all of whose cells are refused.
    """
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor is {executor!r}: an object with submit() is needed, such as a ProcessPoolExecutor "
                        "or client.get_executor() of dask.")  # fmt: skip
    _check.callback("on_progress", on_progress)
    store.xarray_()
    varied = axes.checked(over)
    asked = (results,) if isinstance(results, str) or callable(results) else tuple(results)
    plan = planned(scene, varied, asked, fixed, run or {})
    job = _Job(plan, varied, save, on_progress)
    if refine is not None:
        _check.choice("refine", refine, list(varied))
        _check.choice("result to refine by", "contacts", list(plan.results))
    job.solve(executor)
    data = job.dataset()
    return data if refine is None else job.refined(data, refine, precision, executor)


class _Job:
    """A sweep under way."""

    def __init__(self, plan: Plan, over: dict[str, Values], save: Any, on_progress: Any) -> None:
        self.plan, self.over, self.save, self.on_progress = plan, over, save, on_progress
        self.shape = tuple(len(array) for array in over.values())
        grid = np.unravel_index(np.arange(np.prod(self.shape, dtype=np.int64)), self.shape)
        self.columns = [array[index] for array, index in zip(over.values(), grid, strict=True)]
        self.bodies = plan.bodies(over)
        self.values = cells.empty(plan, len(self.columns[0]), self.bodies)
        self.refusal: tuple[int, str] | None = None
        self.notes = store.resume(save, plan, over, self.values) if save is not None else {}
        self.saved = time.monotonic()

    def solve(self, executor: Executor | None) -> None:
        """Solve what is not solved yet; keep what is done, however it ends."""
        missing = np.flatnonzero(self.values["status"] == NOT_RUN)
        if not len(missing):
            return
        known = done = len(self.columns[0]) - len(missing)
        try:
            for places, block in schedule.batches(self.plan, self.columns, self.bodies, missing, executor):
                self.take(places, block)
                done += len(places)
                if self.on_progress is not None:
                    self.on_progress((done - known) / len(missing), done)
                if self.save is not None and time.monotonic() > self.saved + SAVE_EVERY:
                    self.write()
        finally:
            if self.save is not None:
                self.write()
        if (self.values["status"] == MISUSE).all() and self.refusal is not None:
            raise ValueError(f"every cell is refused: {self.refusal[1]}")

    def take(self, places: Values, block: cells.Block) -> None:
        """Write a solved batch to its places."""
        for name, array in block.values.items():
            self.values[name][places] = array
        if block.refusal is not None:
            first = (int(places[block.refusal[0]]), block.refusal[1])
            self.refusal = first if self.refusal is None else min(first, self.refusal)

    def dataset(self) -> xarray.Dataset:
        """What is known so far."""
        notes = self.notes if self.refusal is None else {"refusal": self.refusal[1]}
        return store.dataset(self.plan, self.over, self.values, notes)

    def write(self) -> None:
        """Write what is known so far."""
        store.write(self.dataset(), self.save)
        self.saved = time.monotonic()

    def refined(self, data: xarray.Dataset, name: str, precision: float, executor: Executor | None) -> xarray.Dataset:
        """Add the jumps of the contact counts along one parameter."""
        plan = replace(self.plan, asked=("contacts",))
        axis = list(self.over).index(name)

        def counts(columns: list[Values]) -> Values:
            found = np.zeros((len(columns[0]), self.bodies - 1), np.int64)
            everything = np.arange(len(columns[0]))
            for places, block in schedule.batches(plan, columns, self.bodies, everything, executor):
                found[places] = block.values["contacts"]
            return found

        jumps = refine.edges(axis, self.columns, self.values["contacts"], self.shape, counts, precision)
        data["edge"] = ("jump", "side"), jumps.ends, {"units": data[name].attrs["units"],
                                                     "long_name": f"interval of {name} in which a count jumps"}
        data["edge_contacts"] = ("jump", "side", "pair"), jumps.counts, data["contacts"].attrs
        for other, column in zip(self.over, jumps.columns, strict=True):
            if other != name:
                data[f"edge_{other}"] = "jump", column, data[other].attrs
        if self.save is not None:
            store.write(data, self.save)
        return data

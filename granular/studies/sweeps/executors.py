"""Calls in this process or on an executor, whose workers end with their parent."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, as_completed
from functools import cache
from typing import Any


def checked_executor(executor: Executor | None) -> None:
    """Raise `TypeError` if `executor` has no method `submit`. None is allowed."""
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"`executor` must be an object with submit(), such as a ProcessPoolExecutor or "
                        f"client.get_executor() of dask, got {executor!r}.")


def run_tasks(
    executor: Executor | None, function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]],
) -> Iterator[tuple[int, Any]]:
    """Call `function` for each task, here or on an executor. Yield number and result.

    The number is the position of the task. Results of an executor are yielded as soon as they are available. On an
    exception the remaining calls are cancelled.
    """
    if executor is None:
        yield from ((k, function(*task)) for k, task in enumerate(tasks))
        return
    futures: dict[Any, int] = {}
    try:
        for k, task in enumerate(tasks):
            futures[executor.submit(_call_for_parent, function, task)] = k
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def _call_for_parent(function: Callable[..., Any], task: tuple[Any, ...]) -> Any:
    end_with_parent(os.getpid())
    return function(*task)


@cache
def end_with_parent(process: int) -> None:
    """End this process of a pool as soon as the process that started it ends.

    Otherwise it would wait for work forever. `process` is the id of this process, so that the call has an effect once.
    """
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None and threading.current_thread() is threading.main_thread():
        threading.Thread(target=_follow, args=[parent], daemon=True).start()


def _follow(parent: Any) -> None:
    parent.join()
    os._exit(1)

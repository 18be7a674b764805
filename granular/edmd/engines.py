"""Which queue runs a scene."""

from __future__ import annotations

from granular import _check
from granular._kernels import no_compiler
from granular.edmd.blocks import BlockQueue
from granular.edmd.model import Model
from granular.edmd.run import Queue
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.tree_queue import TreeQueue

LARGE = 100_000
"""Bodies from which on working in blocks pays."""
ENGINES = ("auto", "sorted", "compiled")


def choose(engine: str, model: Model) -> tuple[type[Queue], type[Queue] | None]:
    """Return the queue to begin with and the one to go over to in a long run, if any."""
    fast = BlockQueue if model.scene.n > LARGE else TreeQueue
    name = _check.choice("engine", engine, ENGINES)
    if name == "sorted":
        return SortedQueue, None
    why = obstacle(model)
    if name == "auto":
        return SortedQueue, None if why or no_compiler() else fast
    if why:
        raise ValueError(f"engine is 'compiled': {why}; use engine='sorted' or 'auto'.")
    missing = no_compiler()
    if missing:
        raise ImportError(f"engine is 'compiled': {missing}.")
    return fast, None


def obstacle(model: Model) -> str:
    """Return why `model` cannot be compiled, or nothing."""
    if model.rule is not None:
        return "every rule must be a ConstantRestitution"
    if model.solver is not None:
        return f"ties={model.ties!r} runs interpreted only"
    return ""

"""Which queue runs a scene."""

from __future__ import annotations

from granular import _check
from granular._kernels import no_compiler
from granular.edmd.blocks import BlockQueue
from granular.edmd.groups import RULES
from granular.edmd.model import Model
from granular.edmd.run import Queue
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.tree_queue import TreeQueue, pays

LARGE = 100_000
"""Bodies from which on working in blocks pays."""
ENGINES = ("auto", "sorted", "compiled")


def choose(engine: str, model: Model) -> tuple[type[Queue], type[Queue] | None]:
    """Return the queue to begin with and the one to go over to in a long run, if any.

    To set a scene up is work too: as much as a collision of every pair.
    """
    fast = BlockQueue if model.scene.n > LARGE else TreeQueue
    name, why = _check.choice("engine", engine, ENGINES), ""
    if model.rule is not None:
        why = "every rule must be a ConstantRestitution"
    elif model.ties in RULES:
        why = f"ties={model.ties!r} runs interpreted only"
    missing = no_compiler()
    if name == "sorted" or (name == "auto" and (why or missing)):
        return SortedQueue, None
    if name == "auto":
        return (fast, None) if pays(model.scene.n_pairs) else (SortedQueue, fast)
    if why:
        raise ValueError(f"engine is 'compiled': {why}; use engine='sorted' or 'auto'.")
    if missing:
        raise ImportError(f"engine is 'compiled': {missing}.")
    return fast, None

"""A cell of the table: what is run, what truth it is judged by, and to what tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Concatenate, ParamSpec

import numpy as np

from granular import edmd, md
from granular._engine.kernels import have_numba
from granular.laws.rules import ConstantRestitution
from granular.md.fixed.integrators import INTEGRATORS
from granular.run.trajectory import Trajectory
from granular.scene import Scene

FIXED_METHODS = tuple(INTEGRATORS)
SOFT_METHODS = ("located", *FIXED_METHODS)
DEFAULT_METHODS = ("located", "edmd")
ALL_METHODS = (*DEFAULT_METHODS, *FIXED_METHODS)
ELASTIC_RULE = ConstantRestitution(1.0)

P = ParamSpec("P")
Rerun = Callable[..., Trajectory]
"""``rerun(scene=..., law=..., **options)``: the cell once more by the same method, with these changes."""


class Verdict(Enum):
    """How a cell ended; the value is the sentence that explains it."""

    right = "within the tolerance"
    flagged = "wrong or unfinished, and a status or a warning says so"
    wrong = "wrong, and nothing says so"
    crashed = "ended in an error that is not a sentence about its arguments"
    limit = "did not end within the limit of processor time"


@dataclass(frozen=True)
class Truth:
    """What a run is judged by.

    Attributes
    ----------
    words : str
        What it is compared with.
    error : callable
        ``error(trajectory, rerun)``: the error, dimensionless; nan counts as wrong.
    """

    words: str
    error: Callable[[Trajectory, Rerun], float]


def compared_with(words: str) -> Callable[[Callable[Concatenate[Trajectory, Rerun, P], float]], Callable[P, Truth]]:
    """Make ``error(run, rerun, *known)`` a function that returns the `Truth` for what is known."""
    return lambda error: lambda *known, **named: Truth(words, lambda run, rerun: error(run, rerun, *known, **named))


@dataclass(frozen=True)
class Cell:
    """One case of one axis, for one or several methods.

    Attributes
    ----------
    axis, case : str
        The row of the table, and what is special here.
    scene : Scene
        What is run.
    truth : Truth
        What it is judged by.
    law, rule : force law(s), collision rule
        For soft and for hard spheres; None where they do not take part.
    tolerance : float
        Largest error that is right for "located" and "edmd".
    loose : float
        The same for methods with a fixed step, at their default dt unless `options` names one.
    options : mapping
        Keyword arguments of ``simulate``.
    methods : tuple of str
        Who takes part.
    slow : bool
        Left out of a quick study.
    cut : bool
        Whether reaching `max_events` is what was asked for, and no flag.
    """

    axis: str
    case: str
    scene: Scene
    truth: Truth
    law: Any = None
    rule: Any = None
    tolerance: float = 1e-12
    loose: float = 0.01
    options: Mapping[str, Any] = field(default_factory=dict)
    methods: tuple[str, ...] = ("located",)
    slow: bool = False
    cut: bool = False


def at_wall(gap: Any, velocity: Any, mass: Any = 1.0, gravity: float = 0.0) -> Scene:
    """Return balls above a wall or floor at rest."""
    n = len(gap)
    return Scene([math.inf, *np.broadcast_to(mass, n)], [0.0, *np.full(n, 0.1)], gap, [0.0, *velocity], gravity)


@dataclass(frozen=True)
class Result:
    """A judged cell: the error (dimensionless, nan if there is none), its tolerance and what the run said."""

    axis: str
    case: str
    method: str
    truth: str
    verdict: Verdict
    error: float
    tolerance: float
    said: str
    seconds: float


SHORT_RUN_STEPS = 5_000
"""Steps at most of an interpreted run."""


def rerun_function(cell: Cell, method: str, plain: bool = False) -> Rerun:
    """Return the function that runs `cell` by `method`, with changes if asked for; `plain`: interpreted, and short."""

    def rerun(**changes: Any) -> Trajectory:
        options = {"scene": cell.scene, "law": cell.law} | dict(cell.options) | changes
        scene, law, most = options.pop("scene"), options.pop("law"), options.pop("max_steps", None)
        if method == "edmd":
            return edmd.simulate(scene, cell.rule, **options | ({"engine": "sorted"} if plain else {}))
        if plain:
            options, most = options | {"engine": "plain"}, min(SHORT_RUN_STEPS, most or SHORT_RUN_STEPS)
        if most is not None:
            options["max_steps"] = most
        if method != "located":
            options = {"method": method, "engine": "compiled" if have_numba() else "plain"} | options
        return md.simulate(scene, law, **options)

    return rerun

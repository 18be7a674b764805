"""Cell of the study: a case, its reference and its tolerance."""

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
"""``rerun(scene=..., law=..., **options)`` repeats the cell with these changes.

The method stays the same.
"""


class Verdict(Enum):
    """Verdict on a cell. The value is a sentence that explains it."""

    right = "within the tolerance"
    flagged = "wrong or unfinished, with a status or a warning"
    wrong = "wrong, without a status or a warning"
    crashed = "ended with an error that is not a message about misuse"
    limit = "did not end within the limit of processor time"


@dataclass(frozen=True)
class Truth:
    """Reference with which a run is compared.

    Attributes
    ----------
    words : str
        Description of the reference.
    error : callable
        ``error(trajectory, rerun)`` returns the dimensionless error. The value nan counts as wrong.
    """

    words: str
    error: Callable[[Trajectory, Rerun], float]


def compared_with(words: str) -> Callable[[Callable[Concatenate[Trajectory, Rerun, P], float]], Callable[P, Truth]]:
    """Turn ``error(run, rerun, *known)`` into a function that makes a `Truth`.

    The function takes the values in `known`.
    """
    return lambda error: lambda *known, **named: Truth(words, lambda run, rerun: error(run, rerun, *known, **named))


@dataclass(frozen=True)
class Cell:
    """One case of one axis, for one or several methods.

    Attributes
    ----------
    axis, case : str
        Row of the table, and description of the case.
    scene : Scene
        Initial state.
    truth : Truth
        Reference of the result.
    law, rule : force law(s), collision rule
        For soft and for hard spheres, or None without such a run.
    tolerance : float
        Largest right error of "located" and "edmd".
    loose : float
        Largest right error of methods with a fixed step, at their default dt unless `options` contains dt.
    options : mapping
        Keyword arguments of ``simulate``.
    methods : tuple of str
        Methods that run the cell.
    slow : bool
        Whether a quick study leaves the cell out.
    cut : bool
        Whether the run is meant to reach `max_events`, which is then not a flag.
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
    """Balls above a wall or floor at rest."""
    n = len(gap)
    return Scene([math.inf, *np.broadcast_to(mass, n)], [0.0, *np.full(n, 0.1)], gap, [0.0, *velocity], gravity)


@dataclass(frozen=True)
class Result:
    """Verdict on a cell by one method.

    The error is dimensionless, and nan if it is unknown. `said` is the final message of the run, with its warnings.
    """

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
"""Maximum number of steps of an interpreted run."""


def rerun_function(cell: Cell, method: str, plain: bool = False) -> Rerun:
    """Function that runs `cell` by `method`, with optional changes.

    With `plain` the run is interpreted and short.
    """

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

"""Complete cases, and parameters of documented functions as data.

The command line and its help texts are derived from the signatures and docstrings of functions.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any

from granular._engine import check, signature
from granular.run.trajectory import Trajectory
from granular.run.until import Until
from granular.scene import Scene

ENGINE_NAMES = ("edmd", "md")
CASE_ARGUMENTS = {"t_end", "until", "on_event", "on_progress", "progress"}
"""Arguments of `simulate` that a `Case` contains, or that are not data."""


@dataclass(frozen=True, slots=True)
class Option:
    """One parameter of a function.

    Attributes
    ----------
    name, kind, about : str
        The parameter's name, its annotation as written ("float", "Sequence[float] | None", ...), and its description.
    default : object
        Its default value.
    """

    name: str
    kind: str
    default: Any
    about: str


def parameters_of(function: Callable[..., Any]) -> tuple[inspect.Parameter, ...]:
    """Return the parameters of a function."""
    return tuple(inspect.signature(function).parameters.values())


def options_of(function: Callable[..., Any]) -> list[Option]:
    """Return the parameters of `function` with a default, and their descriptions.

    The descriptions come from its NumPy-style docstring.
    """
    about = descriptions(function)
    return [Option(p.name, str(p.annotation), p.default, about.get(p.name, ""))
            for p in parameters_of(function) if p.default is not p.empty]


def integer_parameters(function: Callable[..., Any]) -> frozenset[str]:
    """Return the names of the parameters of `function` annotated as integers."""
    return frozenset(p.name for p in parameters_of(function) if p.annotation in (int, "int", "int | None"))


def descriptions(function: Callable[..., Any]) -> dict[str, str]:
    """Return the description of each parameter in a NumPy-style docstring.

    The keys are names of parameters. Each description is joined into one line. If the type of the parameter lists
    choices, such as ``{"left", "right"}``, the description begins with them.
    """
    text = inspect.getdoc(function) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
    entry_of_names = r"^(\w[\w, ]*) : (.*)\n((?:[ \t]+.*\n?|\n)*)"
    result: dict[str, str] = {}
    for names, kind, about in re.findall(entry_of_names, section[1] if section else "", re.MULTILINE):
        choices = kind.partition("}")[0] + "}: " if kind.startswith("{") else ""
        result |= dict.fromkeys(names.split(", "), choices + " ".join(about.split()))
    return result


@cache
def summary(function: Callable[..., Any]) -> str:
    """Return the first paragraph of a docstring on one line."""
    return " ".join((inspect.getdoc(function) or "").split("\n\n")[0].split())


@signature.face
@dataclass(frozen=True, eq=False, repr=False)
class Case:
    """A scene with its law, rule and stop condition, for both engines.

    Attributes
    ----------
    scene : Scene
        The initial state.
    law : force law, sequence of force laws, or None
        Force law for `granular.md`, one for all pairs or one per pair. None for a case of hard spheres only.
    rule : collision rule, sequence of collision rules, or None
        Collision rule for `granular.edmd`. If None, the restitution of the force laws is used.
    until : stop condition or None
        Condition at which a run ends.
    t_end : float or None
        End time of a run in s. With both `until` and `t_end`, a run ends at whichever comes first.
    run : mapping
        Further options of ``edmd.simulate`` or ``md.simulate`` (method, dt, samples, ties, ...). Each engine uses the
        options that it has.
    about : str
        Description in one line.
    """

    scene: Scene
    law: Any
    rule: Any = None
    until: Until | None = None
    t_end: float | None = None
    run: Mapping[str, Any] = field(default_factory=dict)
    about: str = ""

    def __post_init__(self) -> None:
        check.of_kind("scene", self.scene, Scene, "a granular.Scene")
        checked_run(self.run)

    def __repr__(self) -> str:
        return f"Case({self.about or self.scene})"

    def simulate(self, engine: str, **changes: Any) -> Trajectory:
        """Run the case with one engine.

        Parameters
        ----------
        engine : {"edmd", "md"}
            "edmd" for hard spheres, "md" for soft spheres.
        **changes
            Options of the engine's ``simulate`` that replace options of the case.

        Raises
        ------
        TypeError, ValueError
            For misuse, such as an unknown option, or ``"md"`` for a case without force law.
        """
        simulate = engine_named(engine)
        known = keyword_options(simulate) | CASE_ARGUMENTS
        check.known_names(changes, known, f"option of {engine}.simulate", TypeError)
        return simulate(self.scene, self.physics(engine), **self.options(simulate) | changes)

    def options(self, run: Callable[..., Any]) -> dict[str, Any]:
        """Return the end of a run and its further options, as arguments of `run`.

        `run` is a function such as ``md.simulate``. The result has the keys `until` and `t_end`, and each option of
        the case that `run` accepts.
        """
        accepted = keyword_options(run)
        return {"until": self.until, "t_end": self.t_end} | {k: v for k, v in self.run.items() if k in accepted}

    def physics(self, engine: str) -> Any:
        """Return the force law for ``"md"``, or the collision rule for ``"edmd"``.

        Without a rule, the collision rule is derived from the force law. Raises `ValueError` if a law is needed and
        missing.
        """
        if engine == "edmd" and self.rule is not None:
            return self.rule
        if self.law is None:
            raise ValueError(f"`law` must be a force law for {engine}, got None. Give one, such as "
                             "LinearDashpot(k=5e7).")
        if engine == "md":
            return self.law
        from granular.md.binary import restitution_of

        return restitution_of(self.law)


def checked_run(run: Any) -> Mapping[str, Any]:
    """Return engine options unchanged.

    Raises `TypeError` if neither engine has an option of that name.
    """
    if check.of_kind("run", run, Mapping, "a mapping of options to values"):
        check.known_names(run, set().union(*(keyword_options(engine_named(engine)) for engine in ENGINE_NAMES)),
                     "option", TypeError)
    return run  # type: ignore[no-any-return]


def engine_named(engine: str) -> Callable[..., Trajectory]:
    """Return the function `simulate` of ``"edmd"`` or ``"md"``."""
    simulate: Callable[..., Trajectory] = import_module(
        f"granular.{check.choice('engine', engine, ENGINE_NAMES)}"
    ).simulate
    return simulate


def keyword_options(run: Callable[..., Any]) -> set[str]:
    """Return the keyword options of a function, without `CASE_ARGUMENTS`."""
    return {p.name for p in parameters_of(run) if p.kind is p.KEYWORD_ONLY} - CASE_ARGUMENTS

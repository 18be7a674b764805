"""Results of a cell, with dimensions and units, and the arrays that collect them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from granular._engine.check import per_pair
from granular._engine.flight import rate_at_contact
from granular.comparison.answer import ANSWER_ORDER, MEASURES
from granular.comparison.numbers import effective, is_drop
from granular.comparison.outcome import combine_simultaneous, counts, energy_left, separations
from granular.md.binary import restitution
from granular.run.trajectory import Status
from granular.scene.state import Scene

NOT_RUN, MISUSE_CODE = -1, 8
STATUS_NAMES = {NOT_RUN: "not_run", **{code + (code >= MISUSE_CODE): status.name for code, status in enumerate(Status)},
          MISUSE_CODE: "misuse"}
"""Status codes of cells, as stored in files.

``misuse``: the cell's parameters are invalid, or its run raised an exception. Its code does not change if statuses are
added.
"""
STATUS_CODES = {name: code for code, name in STATUS_NAMES.items()}
CELL_ERRORS = (ValueError, ArithmeticError)
"""Exceptions of a cell that do not stop the sweep. Other exceptions are raised."""


@dataclass(frozen=True)
class Result:
    """One quantity of every cell.

    Attributes
    ----------
    dim : str
        "pair" or "body" if there is one value per pair or body, otherwise empty.
    units, about : str
        SI unit and description.
    of : callable
        Function of an `Answer` that returns the value.
    fill : float or int
        Value of cells without a result. It determines the data type.
    many : str
        "always" if a compiled call of many cells also computes the result. "ended" if it does so only without
        unfinished contacts at the end of the run. Otherwise empty.
    meanings : mapping
        Names of the values, for results that are codes.
    """

    dim: str
    units: str
    about: str
    of: Callable[[Any], Any]
    fill: Any = math.nan
    many: str = ""
    meanings: Mapping[int, str] = field(default_factory=dict)


def impact_speed(scene: Scene) -> float:
    """Impact speed |v10| in m/s of two balls that fall together, otherwise nan."""
    if not is_drop(scene):
        return math.nan
    return -rate_at_contact(float(scene.gap[0]), float(scene.velocity[1] - scene.velocity[0]), scene.gravity)


def common_restitution(scene: Scene, laws: Any) -> float:
    """Return the common ε of all contacts at the impact speed.

    It is nan if ε differs between pairs, or if the scene is not a drop of two balls.
    """
    speed = impact_speed(scene)
    if not speed > 0.0:
        return math.nan
    laws_and_pairs = zip(per_pair("law", laws, scene.n_pairs), scene.pairs, strict=True)
    eps = [restitution(law, pair, speed) for law, pair in laws_and_pairs]
    return eps[0] if max(eps) - min(eps) <= 1e-9 else math.nan


def _measure(name: str, about: str, units: str = "1") -> Result:
    return Result("", units, about, lambda answer: MEASURES[name](answer.report))


RESULTS = {
    "contacts": Result("pair", "1", "contacts, soft spheres", lambda a: a.contacts, -1, "always"),
    "v_rel": Result("pair", "m s-1", "separation speed after the pair's last contact, soft", lambda a: a.v_rel,
                    many="ended"),
    "t_f": Result("pair", "s", "end of the pair's last contact, soft", lambda a: a.t_f, many="always"),
    "duration": Result("pair", "s", "longest contact, soft", lambda a: a.longest, many="always"),
    "v_final": Result("body", "m s-1", "velocity at the end, soft", lambda a: a.v_final, many="always"),
    "time": Result("", "s", "end of the run, soft", lambda a: a.time, many="always"),
    "eps_eff": Result("", "1", "ε with which independent collisions give v_rel",
                      lambda a: effective(a.v_rel[..., -1], a.impact), many="ended"),
    "eps_ratio": Result("", "1", "ε_eff/ε_spec, floor and two balls",
                        lambda a: effective(a.v_rel[..., -1], a.impact) / a.eps, many="ended"),
    "energy_left": Result("", "1", "E/E0, final over initial energy, soft",
                          lambda a: energy_left(a.soft)),
    "hard_contacts": Result("pair", "1", "contacts, hard spheres", lambda a: counts(combine_simultaneous(a.hard)), -1),
    "hard_v_final": Result("body", "m s-1", "velocity at the end, hard", lambda a: a.hard.velocity[-1]),
    "hard_v_rel": Result("pair", "m s-1", "separation speed after the pair's last contact, hard",
                         lambda a: separations(combine_simultaneous(a.hard))[0]),
    "hard_t_f": Result(
        "pair", "s", "end of the pair's last contact, hard", lambda a: separations(combine_simultaneous(a.hard))[1]
    ),
    "hard_time": Result("", "s", "end of the run, hard", lambda a: a.hard.time[-1]),
    "hard_energy_left": Result("", "1", "E/E0, final over initial energy, hard",
                               lambda a: energy_left(a.hard)),
    "hard_status": Result("", "1", "status of the hard run", lambda a: STATUS_CODES[a.hard.status.name], NOT_RUN,
                          meanings=STATUS_NAMES),
    "error": Result("", "1", "largest difference of a velocity with which a ball leaves an episode of contacts, "
                    "hard to soft, per fastest impact", lambda a: a.report.error),
    "answer": Result("", "1", "answer of the comparison", lambda a: ANSWER_ORDER.index(a.report.answer), NOT_RUN,
                     meanings={NOT_RUN: "not_run"} | {i: answer.name for i, answer in enumerate(ANSWER_ORDER)}),
    "shared_impulse": _measure("shared_impulse", "φ: fraction of impulse exchanged while a neighbour is in contact"),
    "crowding": _measure("crowding", "p: fraction of hard collisions with a neighbour's within t_c"),
    "occupation": _measure("occupation", "Λ: fraction of time in which a pair is in contact"),
    "distance": _measure("distance", "D between the engines"),
    "predictability": _measure("predictability", "D of two hard-sphere runs, gaps shifted by 1e-12"),
    "mass_centre_ratio": _measure("mass_centre_ratio", "K_cm: soft over hard restitution of the centre of mass"),
    "isolated_share": _measure("isolated_share", "fraction of soft contacts that are isolated"),
    "order": Result("", "1", "number that identifies the order of all onsets and ends", lambda a: a.order, -1),
    "lag": _measure("lag", "how much later the soft run ends", "s"),
}


class Answers:
    """Arrays of all results of a sweep, and the message of the first refused cell.

    Arrays with one column per pair or body have the columns of the largest scene.

    Parameters
    ----------
    results : mapping
        Requested results, by name.
    count : int
        Number of cells.
    """

    def __init__(self, results: Mapping[str, Result], count: int) -> None:
        self.fill = {name: result.fill for name, result in results.items()}
        self.columns: dict[str, Any] = {"status": np.full(count, NOT_RUN)}
        self.columns |= {name: np.full((count, 0) if result.dim else count, result.fill)
                         for name, result in results.items()}
        self.refusal: tuple[int, str] | None = None

    def put(self, cells: Any, columns: Mapping[str, Any]) -> None:
        """Store results of the cells with the numbers `cells`."""
        for name, values in columns.items():
            missing = values.shape[1] - self.columns[name].shape[1] if values.ndim > 1 else 0
            if missing > 0:
                self.columns[name] = np.pad(self.columns[name], ((0, 0), (0, missing)), constant_values=self.fill[name])
            self.columns[name][(cells, *map(slice, values.shape[1:]))] = values

    def refuse(self, cell: int, sentence: str) -> None:
        """Store the message of the exception that a cell raised."""
        self.columns["status"][cell] = MISUSE_CODE
        self.refusal = min(self.refusal or (cell, sentence), (cell, sentence))

    def take(self, cells: Any, answers: Answers) -> None:
        """Copy the results of some cells from `answers`.

        The message of the first refused cell is copied, too. Row i of `answers` belongs to the cell with the number
        ``cells[i]``.
        """
        self.put(cells, answers.columns)
        if answers.refusal is not None:
            self.refuse(int(cells[answers.refusal[0]]), answers.refusal[1])

"""Results of a cell, with dimensions and units, and the arrays that collect them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine.check import per_pair
from granular._engine.flight import rate_at_contact
from granular.comparison.numbers import effective, is_drop
from granular.comparison.outcome import at_once, counts, energy_left, separations
from granular.md.binary import restitution
from granular.run.trajectory import Status
from granular.scene.state import Scene

NOT_RUN, MISUSE_CODE = -1, 8
STATUS_NAMES = {NOT_RUN: "not_run", **{code + (code >= MISUSE_CODE): status.name for code, status in enumerate(Status)},
          MISUSE_CODE: "misuse"}
"""Status codes of cells, as stored in the maps of files.

``misuse``: the cell's parameters were refused, or its run raised. It keeps its number, so that later statuses follow
it.
"""
STATUS_CODES = {name: code for code, name in STATUS_NAMES.items()}
CELL_ERRORS = (ValueError, ArithmeticError)
"""Exceptions of a cell that do not stop the sweep. All others are mistakes."""


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
        Value if there is none. It decides the type.
    many : str
        "always" if a compiled call of many cells computes it as well. "ended" if contacts that are running at the end
        first have to be followed, cell by cell.
    """

    dim: str
    units: str
    about: str
    of: Callable[[Any], Any]
    fill: Any = math.nan
    many: str = ""


def impact_speed(scene: Scene) -> float:
    """Impact speed |v10| in m/s of two balls that fall together, otherwise nan."""
    if not is_drop(scene):
        return math.nan
    return -rate_at_contact(float(scene.gap[0]), float(scene.velocity[1] - scene.velocity[0]), scene.gravity)


def specified(scene: Scene, laws: Any) -> float:
    """Common ε of both contacts at the impact speed, nan if different or other scenes."""
    speed = impact_speed(scene)
    if not speed > 0.0:
        return math.nan
    each = zip(per_pair("law", laws, scene.n_pairs), scene.pairs, strict=True)
    eps = [restitution(law, pair, speed) for law, pair in each]
    return eps[0] if max(eps) - min(eps) <= 1e-9 else math.nan


def _measure(name: str, about: str, units: str = "1") -> Result:
    return Result("", units, about, lambda answer: answer.report.measures[name])


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
    "energy_left": Result("", "1", "E/E0, energy at the end over that at the start, soft",
                          lambda a: energy_left(a.soft)),
    "hard_contacts": Result("pair", "1", "contacts, hard spheres", lambda a: counts(at_once(a.hard)), -1),
    "hard_v_final": Result("body", "m s-1", "velocity at the end, hard", lambda a: a.hard.velocity[-1]),
    "hard_v_rel": Result("pair", "m s-1", "separation speed after the pair's last contact, hard",
                         lambda a: separations(at_once(a.hard))[0]),
    "hard_t_f": Result("pair", "s", "end of the pair's last contact, hard", lambda a: separations(at_once(a.hard))[1]),
    "hard_time": Result("", "s", "end of the run, hard", lambda a: a.hard.time[-1]),
    "hard_energy_left": Result("", "1", "E/E0, energy at the end over that at the start, hard",
                               lambda a: energy_left(a.hard)),
    "hard_status": Result("", "1", "status of the hard run", lambda a: STATUS_CODES[a.hard.status.name], NOT_RUN),
    "error": Result("", "1", "largest difference of a velocity with which a ball leaves an episode of contacts, "
                    "hard to soft, per fastest impact", lambda a: a.report.error),
    "shared_impulse": _measure("shared_impulse", "φ: share of impulse exchanged while a neighbour is in contact"),
    "crowding": _measure("crowding", "p: share of hard collisions with a neighbour's within t_c"),
    "occupation": _measure("occupation", "Λ: share of time a pair is in contact"),
    "distance": _measure("distance", "D between the engines"),
    "predictability": _measure("predictability", "D of hard spheres to themselves, gaps shifted by 1e-12"),
    "mass_centre_ratio": _measure("mass_centre_ratio", "K_cm: soft over hard restitution of the centre of mass"),
    "isolated_share": _measure("isolated_share", "share of soft contacts that are isolated"),
    "order": Result("", "1", "a number that stands for the order of all begins and ends", lambda a: a.order, -1),
    "lag": _measure("lag", "how much later the soft run ends", "s"),
}


class Answers:
    """An array for each result, as wide as the largest scene, and the first refusal.

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

    def put(self, places: Any, columns: Mapping[str, Any]) -> None:
        """Store results of the cells at these places."""
        for name, values in columns.items():
            more = values.shape[1] - self.columns[name].shape[1] if values.ndim > 1 else 0
            if more > 0:
                self.columns[name] = np.pad(self.columns[name], ((0, 0), (0, more)), constant_values=self.fill[name])
            self.columns[name][(places, *map(slice, values.shape[1:]))] = values

    def refuse(self, place: int, sentence: str) -> None:
        """Store the reason why a cell has no answer."""
        self.columns["status"][place] = MISUSE_CODE
        self.refusal = min(self.refusal or (place, sentence), (place, sentence))

    def take(self, places: Any, others: Answers) -> None:
        """Copy the answers of the cells at these places."""
        self.put(places, others.columns)
        if others.refusal is not None:
            self.refuse(int(places[others.refusal[0]]), others.refusal[1])

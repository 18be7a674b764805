"""The numbers of the independent solver for one case, and their form in a file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.helpers.fuzz.scenes import Case


@dataclass
class Truth:
    """What is compared: sequence of contacts, numbers by name, the scale of each, and how much each responds."""

    status: str
    pairs: list[int]
    numbers: dict[str, Any]
    scale: dict[str, Any]
    response: dict[str, Any]
    condition: float


def to_json(one: Truth) -> dict[str, Any]:
    """A plain dict; of the responses only those that exceed what the condition allows anyway, to two digits."""
    responses = {}
    for name, response in one.response.items():
        beyond = np.where(response > one.scale[name] * max(1.0, one.condition), response, 0.0)
        if beyond.any():
            responses[name] = [[float(f"{x:.1e}") for x in row] for row in np.atleast_2d(beyond).tolist()]
    numbers = {name: _plain(x) for name, x in one.numbers.items()}
    return {"status": one.status, "pairs": one.pairs, "numbers": numbers, "responses": responses,
            "condition": float(f"{one.condition:.2e}")}


def _plain(x: Any) -> Any:
    """Nested lists of a whole array, null for nan."""
    if isinstance(x, np.ndarray):
        return [_plain(one) for one in x.tolist()] if x.ndim == 1 else [_plain(one) for one in x]
    return None if math.isnan(x) else x


def from_json(case: Case, plain: dict[str, Any]) -> Truth:
    """The inverse of `to_json`."""
    n, rows = len(case.mass), len(plain["pairs"])
    shape = {"velocity": (-1, n), "gap": (-1, n - 1), "time": (-1,), "v_in": (rows, 2), "v_out": (rows, 2)}
    numbers = {name: np.array(x, np.float64).reshape(shape.get(name, (rows,))) for name, x in plain["numbers"].items()}
    response = {
        name: np.array(plain["responses"].get(name, np.zeros_like(x)), np.float64).reshape(x.shape)
        for name, x in numbers.items()
    }
    return Truth(plain["status"], plain["pairs"], numbers, scales(case, numbers), response, plain["condition"])


def scales(case: Case, numbers: dict[str, Any]) -> dict[str, Any]:
    """The size each number is compared with."""
    closing = abs(np.concatenate([numbers["v_in"], numbers["v_out"]]) @ [1.0, -1.0])
    speed = float(np.nanmax(closing, initial=0.0)) or float(abs(numbers["velocity"]).max()) or 1.0
    longest = float(np.nanmax(numbers["duration"], initial=0.0)) or 1.0
    out: dict[str, Any] = {"velocity": speed, "v_in": speed, "v_out": speed}
    for name in ("duration", "xi_max", "force_max", "impulse"):
        out[name] = float(np.nanmax(numbers[name], initial=0.0)) or 1.0
    momentum = min(case.mass) * speed  # what rounding of speeds amounts to, however weak the contacts are
    out["impulse"] = max(out["impulse"], momentum)
    out["force_max"] = max(out["force_max"], momentum / longest)
    for name in ("t_begin", "t_end", "time"):
        if name in numbers:
            out[name] = np.fmax(abs(numbers[name]), longest)
    if "gap" in numbers:
        out["gap"] = max(float(abs(numbers["gap"]).max()), out["xi_max"], speed * float(numbers["time"].max()))
    return out

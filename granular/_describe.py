"""Force laws, collision rules, walls and scenes as JSON: class and numbers, nothing that could run code from a file.
May be skipped: files, no physics.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

import numpy as np


def to_json(physics: Any) -> dict[str, Any]:
    """Class and numbers of a law, rule or wall; of one's own, and of a function, only the name."""
    kind = type(physics)
    described: dict[str, Any] = {"class": f"{kind.__module__}:{kind.__qualname__}", "shown": repr(physics)}
    if kind.__module__.startswith("granular.") and is_dataclass(kind):
        described["fields"] = _numbers(physics)
    return described


def _numbers(physics: Any) -> dict[str, Any]:
    return {f.name: _as_json(getattr(physics, f.name)) for f in fields(physics)}


def _as_json(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [_as_json(one) for one in value]
    return to_json(value) if is_dataclass(value) or callable(value) else value


def scene_to_json(scene: Any) -> dict[str, Any]:
    """The numbers of a scene, with the word inf for the mass of a wall."""
    return _numbers(scene) | {"mass": ["inf" if m == np.inf else m for m in scene.mass.tolist()]}


def from_json(value: Any) -> Any:
    """Make the object that `to_json` described; LookupError with its text if it is not of this package."""
    if isinstance(value, list):
        return tuple(from_json(one) for one in value)
    if not isinstance(value, dict):
        return value
    module, name = value["class"].split(":")
    if "fields" not in value or not module.startswith("granular."):
        raise LookupError(value["shown"])
    kind = getattr(import_module(module), name)
    return kind(**{key: from_json(one) for key, one in value["fields"].items()})

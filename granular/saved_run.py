"""Runs in files: all of a `Trajectory` as arrays and words, and back.
May be skipped: files, no physics.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from granular import _check, _files
from granular._describe import from_json, to_json
from granular.scene import Scene
from granular.scene.walls import fitted

PLAIN = (bool, int, float, str, tuple)
"""What is saved of `stats`."""
ARRAYS = ("time", "position", "velocity", "gap", "force", "contacts", "ledger")
SCENE = ("mass", "radius", "gap", "velocity", "gravity", "origin", "external_force", "ring", "pendulum", "rest_gap")
MAYBE = {"force", "ledger", "scene.external_force", "scene.ring", "scene.pendulum", "scene.rest_gap"}
"""Those that a run may lack."""
WORDS = {"status", "message", "stats", "law", "rule"}
OTHERS = {"format", "walls"}
"""Words that a saved run may lack."""
NEEDED = {*ARRAYS, *(f"scene.{name}" for name in SCENE)} - MAYBE
"""What a saved run holds at least; besides that the number of its format, forces, walls and the state."""


def write(path: str | PathLike[str], run: Any) -> None:
    """Write a run to one ``.npz`` file, whole or not at all."""
    import json

    _files.check_ending(path, ".npz")
    scene = fitted(run.scene, float(run.time[0]), float(run.time[-1]))
    arrays = {name: getattr(run, name) for name in ARRAYS}
    arrays |= {f"scene.{name}": getattr(scene, name) for name in SCENE}
    has = {"scene.ring": scene.ring, "scene.pendulum": scene.pendulum > 0.0}
    arrays = {name: value for name, value in arrays.items() if value is not None and has.get(name, True)}
    arrays |= {f"state.{name}": np.asarray(value) for name, value in run.state.items()}
    words = {
        "format": _files.FORMAT,
        "status": run.status.name,
        "message": run.message,
        "stats": {name: value for name, value in run.stats.items() if isinstance(value, PLAIN)},
        "law": None if run.law is None else [to_json(law) for law in run.law],
        "rule": None if run.rule is None else [to_json(rule) for rule in run.rule],
    }
    if scene.driven or scene.heated:
        words["walls"] = [wall and to_json(wall) for wall in (scene.floor, scene.ceiling)]

    def fill(draft: str) -> None:
        with open(draft, "wb") as file:
            np.savez_compressed(file, words=np.array(json.dumps(words)), **arrays)

    _files.write(path, fill)


def read(path: str | PathLike[str], law: Any, rule: Any) -> dict[str, Any]:
    """Return what `write` has written by the names of `Trajectory`, the status by its name; raise as `Trajectory.load`.
    """
    words, stored = _read(path)
    numbers = {name: _plain(stored[f"scene.{name}"]) for name in SCENE if f"scene.{name}" in stored}
    floor, ceiling = map(from_json, words.get("walls", (None, None)))
    scene = Scene(**numbers, floor=floor, ceiling=ceiling)
    state = {name[6:]: _plain(value) for name, value in stored.items() if name.startswith("state.")}
    arrays: dict[str, Any] = {name: stored.get(name) for name in ARRAYS}
    return arrays | {
        "scene": scene,
        "law": _revived("law", words["law"], law, scene),
        "rule": _revived("rule", words["rule"], rule, scene),
        "status": words["status"],
        "message": words["message"],
        "stats": {name: tuple(value) if isinstance(value, list) else value for name, value in words["stats"].items()},
        "state": state if words["rule"] is not None or "creeping" in state else {},  # md was not to be gone on from
    }


def _read(path: str | PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The words and the arrays of a file that `Trajectory.save` wrote, or a sentence."""
    import json
    import zlib
    from zipfile import BadZipFile

    try:
        with open(path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
            stored = {name: file[name] for name in file.files}
        words = json.loads(str(stored.pop("words")))
        complete = words.keys() >= WORDS and stored.keys() >= NEEDED
    except (KeyError, ValueError, EOFError, TypeError, AttributeError, NotImplementedError, BadZipFile, zlib.error):
        complete = False
    if not complete:
        raise ValueError(
            f"path is {str(path)!r}: it is not a run saved by granular, or is cut short; "
            "a file written by Trajectory.save is needed."
        )
    others = {name for name in stored if not name.startswith("state.")} - NEEDED - MAYBE
    _files.check_format(path, words.get("format", 1), others | words.keys() - WORDS - OTHERS)
    return words, stored


def _revived(name: str, stored: Any, given: Any, scene: Scene) -> tuple[Any, ...] | None:
    """The given or the stored laws (rules), one per pair; None if the run had none."""
    if stored is None:
        return None
    if given is not None:
        return _check.per_pair(name, given, scene.n_pairs)
    try:
        return tuple(from_json(one) for one in stored)
    except LookupError as own:
        fix = f"your own {name} is not stored; pass load(path, {name}=...)"
        raise ValueError(f"{name} in the file is {own}: {fix}.") from None


def _plain(value: Any) -> Any:
    """A number or word instead of an array of no dimension."""
    return value.item() if value.ndim == 0 else value

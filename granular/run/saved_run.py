"""Save a run in a file: convert a `Trajectory` to arrays and metadata.

The metadata are a dictionary that is stored as JSON text in the entry "words" of the file. `granular.run.loaded_run`
reads the file.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from hashlib import blake2b
from typing import Any
from zlib import crc32

import numpy as np

from granular._engine import files
from granular._engine.describe import to_json
from granular.scene.places import with_fitted_walls

PLAIN_TYPES = (bool, int, float, str)
"""Types of the values of `stats` that are saved, also within tuples."""
RUN_ARRAYS = {
    "time": "t", "position": "tn", "velocity": "tn", "gap": "tp", "force": "tp", "contacts": "c", "ledger": "tl",
}
SCENE_ARRAYS = {
    "mass": "n", "radius": "n", "gap": "p", "velocity": "n", "gravity": "", "origin": "", "external_force": "n",
    "ring": "", "pendulum": "", "rest_gap": "p",
}
"""Arrays of a run and of its scene, with their dimensions.

The letters are t for samples, n for bodies, p for pairs, c for contacts and l for the five energies of the ledger.
"""
HARD_LOG_COLUMNS = {
    "contacts.pair": np.int32, "contacts.t_begin": float, "contacts.v_in": float, "contacts.v_out": float,
    "contacts.impulse": float,
}
"""Columns of the contact log that are saved for hard spheres, with their types.

The other columns follow from them, because collisions are instantaneous and their forces infinite.
"""
TABLE_ARRAYS = {"time", "position", "velocity", "gap", "force", "ledger", "contacts", *HARD_LOG_COLUMNS}
"""Arrays that are separate variables of a netCDF file."""


def write(path: str | os.PathLike[str], run: Any, compressed: bool = False) -> None:
    """Write a run to one ``.npz`` file atomically."""
    files.check_suffix(path, ".npz")
    metadata, arrays = file_contents(run)

    def fill(draft: str) -> None:
        with open(draft, "wb") as file:
            (np.savez_compressed if compressed else np.savez)(file, words=np.array(metadata_json(metadata)), **arrays)

    files.write(path, fill)


def file_contents(run: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the metadata and the arrays of a run for a file, each by name."""
    if run.law is None and run.rule is None:
        raise ValueError("`run` must have laws or rules to be saved in this format, got a run of another program. Save "
                         "it as .csv or .extxyz, or with to_xarray().")
    scene = with_fitted_walls(run.scene, float(run.time[0]), float(run.time[-1]))
    values = {name: getattr(run, name) for name in RUN_ARRAYS} | {
        f"scene.{name}": getattr(scene, name) for name in SCENE_ARRAYS}
    has = {"scene.ring": scene.ring, "scene.pendulum": scene.pendulum > 0.0}
    values = {name: value for name, value in values.items() if value is not None and has.get(name, True)}
    arrays = {name: np.asarray(value) for name, value in values.items()} | {
        f"state.{name}": np.asarray(value) for name, value in run.state.items()}
    if run.rule is not None:
        log, arrays["contacts"] = run.contacts, run.contacts[:0]
        arrays |= {name: log[name[9:]].astype(kind, order="C") for name, kind in HARD_LOG_COLUMNS.items()}
    metadata = {
        "format": files.FILE_FORMAT,
        "status": run.status.name,
        "message": run.message,
        "stats": {name: value for name, value in run.stats.items() if isinstance(value, (*PLAIN_TYPES, tuple))},
        "law": _description(run.law),
        "rule": _description(run.rule),
    }
    if scene.driven or scene.heated:
        metadata["walls"] = [wall and to_json(wall) for wall in (scene.floor, scene.ceiling)]
    metadata["digest"] = digest_of(metadata, arrays)
    return metadata, arrays


def _description(physics: tuple[Any, ...] | None) -> Any:
    """Return the JSON description of the laws or rules of a run, or None without them.

    It is a single description if all pairs have the same law or rule, and otherwise a list with one per pair.
    """
    if physics is None:
        return None
    same = all(item is physics[0] for item in physics)
    return to_json(physics[0]) if same else [to_json(item) for item in physics]


def metadata_json(metadata: Mapping[str, Any]) -> str:
    """Return metadata as JSON text.

    Values of types that JSON does not support, such as numpy numbers, are converted to floats.
    """
    return json.dumps(metadata, sort_keys=True, default=float)


def digest_of(metadata: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    """Return a checksum of all metadata and arrays of a file."""
    rest = {name: value for name, value in metadata.items() if name != "digest"}
    digest = blake2b(metadata_json(rest).encode(), digest_size=16)
    for name in sorted(arrays):
        array = arrays[name]
        if name in HARD_LOG_COLUMNS:  # long columns: crc32 is six times as fast
            digest.update(f"{name} {array.shape} {array.dtype.str} {crc32(np.ascontiguousarray(array).data)}".encode())
            continue
        columns = [array[column] for column in array.dtype.names or ()] or [array]  # padding is undefined
        digest.update(f"{name} {array.dtype.names} {array.shape}".encode())
        for column in columns:
            digest.update(f"{column.dtype.str} ".encode())
            digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()

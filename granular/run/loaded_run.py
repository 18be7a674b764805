"""Load the file of a run, check it, and return the fields of a `Trajectory`.

The types and sizes of all arrays are checked before memory is allocated.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Mapping
from io import BytesIO
from typing import Any

import numpy as np

from granular._engine import check, files
from granular._engine.describe import from_json
from granular._engine.package import import_optional
from granular.run.saved_run import HARD_LOG_COLUMNS, PLAIN_TYPES, RUN_ARRAYS, SCENE_ARRAYS, digest_of
from granular.scene import Scene

ARRAY_SHAPES = RUN_ARRAYS | {f"scene.{name}": dimensions for name, dimensions in SCENE_ARRAYS.items()}
OPTIONAL_ARRAYS = {"force", "ledger", "scene.external_force", "scene.ring", "scene.pendulum", "scene.rest_gap"}
"""Arrays that do not exist for every run."""
NEEDED_ENTRIES = ARRAY_SHAPES.keys() - OPTIONAL_ARRAYS | {"words"}
"""Entries that every file of a run contains."""
PHYSICS_TYPES = (dict, list, type(None))
METADATA_TYPES = {"status": str, "message": str, "stats": dict, "law": PHYSICS_TYPES, "rule": PHYSICS_TYPES}
LATER_METADATA_TYPES = {"format": int, "walls": list, "digest": str}
"""Types of the metadata entries.

Files of earlier formats do not contain the entries of `LATER_METADATA_TYPES`.
"""
MAX_METADATA_LENGTH, METADATA_PER_PAIR = 100_000_000, 2_000
"""Maximum number of characters of the metadata, and additional number per pair.

The longest metadata contain the path of a wall with 2¹⁸ panels.
"""
MAX_STATE_RECORDS, MAX_RECORD_BYTES = 10_000, 1 << 16
"""Limits of an array of the saved state.

They are the maximum number of records in addition to eight per pair, and the maximum number of bytes per record.
"""


def read(
    path: str | os.PathLike[str], law: Any, rule: Any, statuses: Collection[str], log: np.dtype[Any]
) -> dict[str, Any]:
    """Read a saved run, and return the fields of `Trajectory` by name.

    Parameters
    ----------
    law, rule : optional
        Replacements for the stored laws or rules, or None.
    statuses : collection of str
        Allowed names of the status. The returned status is a name.
    log : dtype
        Type of the records of the contact log.

    Raises
    ------
    OSError, TypeError, ValueError
        See `Trajectory.load`.
    """
    name = files.checked_source("path", path)
    try:
        with open(name, "rb") as file:
            if name.lower().endswith(".nc"):
                stored = _read_netcdf(name, log)
            else:
                _check_heads(files.array_headers(file), log)
                stored = files.read_arrays(file)
        metadata = _parse_metadata(str(stored.pop("words")))
        files.check_format(name, metadata.get("format", 1),
                           metadata.keys() - METADATA_TYPES.keys() - LATER_METADATA_TYPES.keys())
        _check_metadata(metadata, stored, statuses)
        if "contacts.pair" in stored:
            stored["contacts"] = _hard_log(stored, log)
        _check_rows(stored, metadata["status"])
        return _constructor_arguments(metadata, stored, law, rule)
    except (files.InvalidArchiveError, RecursionError):
        raise ValueError(
            f"`path` must be a complete file written by Trajectory.save, got {name!r}."
        ) from None
    except files.LaterVersionError:
        raise
    except (TypeError, ValueError) as error:
        error_type = TypeError if isinstance(error, TypeError) else ValueError
        raise error_type(f"The file {name!r} is not a valid run: {error}") from None


def _read_netcdf(name: str, log: np.dtype[Any]) -> dict[str, Any]:
    """Return the entries of a netCDF file, named as in an ``.npz`` file.

    `name` is the path of the file, and `log` the type of the records of the contact log.
    """
    xarray = import_optional("xarray", "a file that ends in .nc")
    import_optional("netCDF4", "a file that ends in .nc")
    try:
        data = xarray.open_dataset(name, engine="netcdf4", decode_cf=False)
    except (OSError, ValueError, RuntimeError):
        raise files.InvalidArchiveError from None
    with data:
        max_bytes = files.MAX_EXPANSION * os.path.getsize(name) + files.MAX_HEADER_BYTES
        if data.nbytes > max_bytes or any(data[key].dtype.kind not in "fiu" for key in data.variables if key != "side"):
            raise files.InvalidArchiveError
        arrays = {key: data[key].values for key in data.variables if key not in ("side", "mass", "radius")}
    try:
        file = BytesIO(arrays.pop("checkpoint").tobytes())
        files.array_headers(file)  # check the headers before any data is read
        stored = files.read_arrays(file)
        columns = {key: arrays.pop("contact_pair" if key == "pair" else key) for key in log.names or ()}
        stored = arrays | stored
        if "contacts" in stored:  # hard spheres: an empty array
            stored |= {key: columns[key[9:]].astype(kind) for key, kind in HARD_LOG_COLUMNS.items()}
        else:
            stored["contacts"] = np.zeros(len(columns["pair"]), log)
            for key, values in columns.items():
                stored["contacts"][key] = values
    except (KeyError, ValueError):
        raise files.InvalidArchiveError from None
    _check_heads({key: (value.dtype, value.shape) for key, value in stored.items()}, log)
    return stored


def _check_heads(heads: Mapping[str, files.ArrayHeader], log: np.dtype[Any]) -> None:
    """Raise an exception if an array is missing or has a wrong type or shape.

    `heads` contains type and shape of each array, and `log` is the type of the records of the contact log.
    """
    if not heads.keys() >= NEEDED_ENTRIES or any(len(heads[name][1]) != 1 for name in ("scene.mass", "time")):
        raise files.InvalidArchiveError
    n, t = heads["scene.mass"][1][0], heads["time"][1][0]
    sizes = {"n": n, "p": n - 1 + ("scene.ring" in heads), "t": t, "l": 5}
    kinds = {"contacts": log, "scene.ring": np.dtype(bool)} | {
        name: np.dtype(HARD_LOG_COLUMNS[name]) for name in HARD_LOG_COLUMNS}
    if heads.keys() & HARD_LOG_COLUMNS.keys() and not heads.keys() >= HARD_LOG_COLUMNS.keys():
        raise ValueError(f"its log lacks columns. {check.EDITED_STATE}")
    for name, (dtype, shape) in heads.items():
        shown = files.plain_text(name, 60)
        if name == "words":
            is_valid = dtype.kind == "U" and shape == () and dtype.itemsize <= 4 * (
                MAX_METADATA_LENGTH + METADATA_PER_PAIR * sizes["p"])
        elif name.startswith("state."):  # checked in detail when the run is resumed
            is_valid = (len(shape) <= 1 and math.prod(shape) <= MAX_STATE_RECORDS + 8 * sizes["p"]
                    and dtype.itemsize <= MAX_RECORD_BYTES)
        elif name in ARRAY_SHAPES:
            expected_shape = tuple(sizes.get(letter, shape[0] if shape else 0) for letter in ARRAY_SHAPES[name])
            is_valid = dtype == kinds.get(name, np.dtype(float)) and shape == expected_shape
        elif name in HARD_LOG_COLUMNS:
            is_valid = dtype == kinds[name] and shape == heads["contacts.pair"][1][:1] + (2,) * ("v_" in name)
        else:
            raise ValueError(f"it contains {shown}, which this version cannot read. Read it with a later version of "
                             "granular.")
        if not is_valid:
            raise ValueError(f"{shown} does not fit a run of {n} bodies and {t} samples, got an array of shape "
                             f"{files.plain_text(str(shape), 60)} and kind {dtype.kind!r}. {check.EDITED_STATE}")


def _hard_log(stored: Mapping[str, Any], log: np.dtype[Any]) -> Any:
    """Return the contact log of hard spheres from its saved columns."""
    rows = np.zeros(len(stored["contacts.pair"]), log)
    for name in HARD_LOG_COLUMNS:
        rows[name[9:]] = stored[name]
    rows["t_end"], rows["force_max"] = rows["t_begin"], math.nan
    return rows


def _parse_metadata(text: str) -> dict[str, Any]:
    """Return the metadata of a run from JSON text, after checking their types."""
    try:
        metadata = json.loads(text)
    except ValueError:
        raise files.InvalidArchiveError from None
    kinds: dict[str, Any] = METADATA_TYPES | LATER_METADATA_TYPES
    if not isinstance(metadata, dict) or not metadata.keys() >= METADATA_TYPES.keys():
        raise files.InvalidArchiveError
    for name in kinds.keys() & metadata.keys():
        if not isinstance(metadata[name], kinds[name]):
            raise ValueError(f"its {name} is {files.plain_text(repr(metadata[name]), 60)}. {check.EDITED_STATE}")
    return metadata


def _check_metadata(metadata: Mapping[str, Any], stored: Mapping[str, Any], statuses: Collection[str]) -> None:
    """Raise `ValueError` if the metadata are invalid or do not match their digest.

    Descriptions of laws, rules and walls are not checked here.
    """
    check.raise_if_true({
        f"its status must be one of {', '.join(statuses)}, got {files.plain_text(repr(metadata['status']), 60)}.":
            metadata["status"] not in statuses,
        f"it has both laws and rules, or neither. {check.EDITED_STATE}":
            (metadata["law"] is None) is (metadata["rule"] is None),
    })
    for name, value in metadata["stats"].items():
        entries = value if isinstance(value, list) else [value]
        is_pair = name != "first_disturbed" or (len(entries) == 2 and not any(isinstance(x, str) for x in entries))
        if not is_pair or not all(isinstance(entry, PLAIN_TYPES) for entry in entries):
            raise ValueError(f"its number {files.plain_text(repr(name), 60)} is "
                             f"{files.plain_text(repr(value), 60)}. {check.EDITED_STATE}")
    walls, has_digest = len(metadata.get("walls", (None, None))), metadata.get("format", 1) > 2 or "digest" in metadata
    check.raise_if_true({
        f"its walls must be 2, a floor and a ceiling or None, got {walls}.": walls != 2,
        "its numbers do not match its digest. "
        f"{check.EDITED_STATE}": has_digest and metadata.get("digest") != digest_of(metadata, stored),
    })


def _check_rows(stored: Mapping[str, Any], status: str) -> None:
    """Raise `ValueError` for times that decrease, or samples that are not finite.

    Pair numbers of contacts are checked as well. Samples of runs with status ``unstable`` can contain any values.
    """
    time, log = stored["time"], stored["contacts"]
    if not len(time) or not np.isfinite(time).all() or (np.diff(time) < 0.0).any():
        raise ValueError(f"its times decrease or are not finite. {check.EDITED_STATE}")
    rows = [*(stored.get(name) for name in ("position", "velocity", "gap", "force")),
            *(log[name] for name in ("t_begin", "duration", "v_in", "impulse"))]
    if status != "unstable" and not all(np.isfinite(values).all() for values in rows if values is not None):
        raise ValueError(f"its samples or contacts are not finite. {check.EDITED_STATE}")
    last = stored["gap"].shape[1] - 1
    if len(log) and not 0 <= log["pair"].min() <= log["pair"].max() <= last:
        raise ValueError(f"its contacts must be of pairs 0 to {last}, got {log['pair'].min()} to {log['pair'].max()}.")


def _constructor_arguments(
    metadata: Mapping[str, Any], stored: Mapping[str, Any], law: Any, rule: Any
) -> dict[str, Any]:
    """Return the constructor arguments of a `Trajectory` from the contents of a file.

    `law` and `rule` replace the stored laws or rules if they are not None.
    """
    numbers = {name: _scalar_or_array(stored[f"scene.{name}"]) for name in SCENE_ARRAYS if f"scene.{name}" in stored}
    floor, ceiling = (wall and from_json("wall", wall) for wall in metadata.get("walls", (None, None)))
    scene = Scene(**numbers, floor=floor, ceiling=ceiling)
    state = {name[6:]: _scalar_or_array(value) for name, value in stored.items() if name.startswith("state.")}
    arrays: dict[str, Any] = {name: stored.get(name) for name in RUN_ARRAYS}
    stats = (_missing_log_mark(metadata, stored, scene) | metadata["stats"]).items()
    return arrays | {
        "scene": scene,
        "law": _restored_physics("law", metadata["law"], law, scene),
        "rule": _restored_physics("rule", metadata["rule"], rule, scene),
        "status": metadata["status"],
        "message": files.plain_text(metadata["message"]),
        "stats": {files.plain_text(name): tuple(value) if isinstance(value, list) else value for name, value in stats},
        "state": state if metadata["rule"] is not None or "origin" in state else {},  # older md runs cannot be resumed
    }


def _missing_log_mark(metadata: Mapping[str, Any], stored: Mapping[str, Any], scene: Scene) -> dict[str, bool]:
    """Return {"log": False} for a run that kept no contact log, else an empty dict.

    Files of earlier versions do not contain this entry of `stats`. A run without log is recognised by a positive number
    of contacts in `stats` and an empty log, if its first sample is the initial scene.
    """
    starts_at_scene = all(np.array_equal(stored[name][0], getattr(scene, name)) for name in ("gap", "velocity"))
    count = metadata["stats"].get("contacts" if metadata["rule"] is None else "events", 0)
    return {"log": False} if starts_at_scene and count and not len(stored["contacts"]) else {}


def _restored_physics(name: str, stored: Any, replacement: Any, scene: Scene) -> tuple[Any, ...] | None:
    """Return the laws or rules of a saved run, one per pair, or None if it has none.

    `name` is "law" or "rule", `stored` their description in the file, and `replacement` the laws to use instead.
    """
    if stored is None:
        return None
    if replacement is not None:
        return check.per_pair(name, replacement, scene.n_pairs)
    try:
        restored = [from_json(name, item) for item in stored] if isinstance(stored, list) else from_json(name, stored)
        return check.per_pair(name, restored, scene.n_pairs)
    except LookupError as unknown:
        raise ValueError(f"the {name} in the file is your own, {unknown}, which is not stored. Pass load(path, "
                         f"{name}=...).") from None


def _scalar_or_array(value: Any) -> Any:
    """Return an array, or its value as a number or string if it has no dimensions."""
    return value.item() if value.ndim == 0 else value

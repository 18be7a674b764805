"""Conversion of a `Trajectory` to arrays and metadata in a file, and back."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Mapping
from hashlib import blake2b
from io import BytesIO
from typing import Any
from zlib import crc32

import numpy as np

from granular._engine import check, files
from granular._engine.describe import from_json, to_json
from granular.scene import Scene
from granular.scene.places import fitted

PLAIN_TYPES = (bool, int, float, str)
"""Types of entries of `stats` that are saved, also within tuples."""
RUN_ARRAYS = {
    "time": "t", "position": "tn", "velocity": "tn", "gap": "tp", "force": "tp", "contacts": "c", "ledger": "tl",
}
SCENE_ARRAYS = {
    "mass": "n", "radius": "n", "gap": "p", "velocity": "n", "gravity": "", "origin": "", "external_force": "n",
    "ring": "", "pendulum": "", "rest_gap": "p",
}
"""Arrays and their dimensions.

The letters are t for rows, n for bodies, p for pairs, c for contacts and l for the five sums of the ledger.
"""
ARRAY_SHAPES = RUN_ARRAYS | {f"scene.{name}": dimensions for name, dimensions in SCENE_ARRAYS.items()}
OPTIONAL_ARRAYS = {"force", "ledger", "scene.external_force", "scene.ring", "scene.pendulum", "scene.rest_gap"}
"""Arrays that a run can lack."""
HARD_LOG_COLUMNS = {
    "contacts.pair": np.int32, "contacts.t_begin": float, "contacts.v_in": float, "contacts.v_out": float,
    "contacts.impulse": float,
}
"""Columns of a hard log that are saved.

The other columns follow from them, because a collision is instantaneous with an infinite force.
"""
TABLE_ARRAYS = {"time", "position", "velocity", "gap", "force", "ledger", "contacts", *HARD_LOG_COLUMNS}
"""Arrays that are separate variables of a netCDF file."""
NEEDED_ENTRIES = ARRAY_SHAPES.keys() - OPTIONAL_ARRAYS | {"words"}
"""Entries that every saved run contains. Forces, walls and the state are optional."""
PHYSICS_TYPES = (dict, list, type(None))
METADATA_TYPES = {"status": str, "message": str, "stats": dict, "law": PHYSICS_TYPES, "rule": PHYSICS_TYPES}
LATER_METADATA_TYPES = {"format": int, "walls": list, "digest": str}
"""Metadata entries and their types.

Files of earlier formats lack the entries in OTHERS.
"""
MAX_METADATA_LENGTH, METADATA_PER_PAIR = 100_000_000, 2_000
"""Maximum number of characters of the metadata, and additional number per pair.

The path of a wall with 2¹⁸ panels is the longest text.
"""
MAX_STATE_RECORDS, MAX_RECORD_BYTES = 10_000, 1 << 16
"""Limits for an array of the state.

They are the number of records beyond eight per pair, and the bytes per record.
"""


def write(path: str | os.PathLike[str], run: Any, compressed: bool = False) -> None:
    """Write a run to one ``.npz`` file atomically."""
    files.check_ending(path, ".npz")
    words, arrays = packed(run)

    def fill(draft: str) -> None:
        with open(draft, "wb") as file:
            (np.savez_compressed if compressed else np.savez)(file, words=np.array(said(words)), **arrays)

    files.write(path, fill)


def packed(run: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return metadata and arrays of a run, by name."""
    if run.law is None and run.rule is None:
        raise ValueError("`run` must have laws or rules to be saved this way. Save numbers of another program as .csv "
                         "or .extxyz, or with to_xarray().")
    scene = fitted(run.scene, float(run.time[0]), float(run.time[-1]))
    held = {name: getattr(run, name) for name in RUN_ARRAYS} | {
        f"scene.{name}": getattr(scene, name) for name in SCENE_ARRAYS}
    has = {"scene.ring": scene.ring, "scene.pendulum": scene.pendulum > 0.0}
    held = {name: value for name, value in held.items() if value is not None and has.get(name, True)}
    arrays = {name: np.asarray(value) for name, value in held.items()} | {
        f"state.{name}": np.asarray(value) for name, value in run.state.items()}
    if run.rule is not None:
        log, arrays["contacts"] = run.contacts, run.contacts[:0]
        arrays |= {name: log[name[9:]].astype(kind, order="C") for name, kind in HARD_LOG_COLUMNS.items()}
    words = {
        "format": files.FILE_FORMAT,
        "status": run.status.name,
        "message": run.message,
        "stats": {name: value for name, value in run.stats.items() if isinstance(value, (*PLAIN_TYPES, tuple))},
        "law": _described(run.law),
        "rule": _described(run.rule),
    }
    if scene.driven or scene.heated:
        words["walls"] = [wall and to_json(wall) for wall in (scene.floor, scene.ceiling)]
    words["digest"] = _digest(words, arrays)
    return words, arrays


def _described(physics: tuple[Any, ...] | None) -> Any:
    """Return the description of the laws or rules.

    It is a single description if all pairs have the same law, else one per pair. The result is None without laws or
    rules.
    """
    if physics is None:
        return None
    same = all(one is physics[0] for one in physics)
    return to_json(physics[0]) if same else [to_json(one) for one in physics]


def said(words: Mapping[str, Any]) -> str:
    """Return metadata as JSON text.

    Numbers of other types, such as numpy's, become floats.
    """
    return json.dumps(words, sort_keys=True, default=float)


def _digest(words: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    """Return a checksum of all metadata and arrays of a file."""
    rest = {name: value for name, value in words.items() if name != "digest"}
    digest = blake2b(said(rest).encode(), digest_size=16)
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


def read(
    path: str | os.PathLike[str], law: Any, rule: Any, statuses: Collection[str], log: np.dtype[Any]
) -> dict[str, Any]:
    """Read a file of `write` and return the fields of `Trajectory` by name.

    The status is given by its name, which must be one of `statuses`. Contacts are records of type `log`. Exceptions
    are the same as in `Trajectory.load`.
    """
    name = files.checked_source("path", path)
    try:
        with open(name, "rb") as file:
            if name.lower().endswith(".nc"):
                stored = _of_netcdf(name, log)
            else:
                _check_heads(files.heads(file), log)
                stored = files.arrays(file)
        words = _words(str(stored.pop("words")))
        files.check_format(name, words.get("format", 1),
                           words.keys() - METADATA_TYPES.keys() - LATER_METADATA_TYPES.keys())
        _check_words(words, stored, statuses)
        if "contacts.pair" in stored:
            stored["contacts"] = _hard_log(stored, log)
        _check_rows(stored, words["status"])
        return _made(words, stored, law, rule)
    except (files.Foreign, RecursionError):
        raise ValueError(
            f"`path` must be a complete file written by Trajectory.save, got {name!r}."
        ) from None
    except files.Later:
        raise
    except (TypeError, ValueError) as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError
        raise kind(f"The file {name!r} is not a valid run: {error}") from None


def _of_netcdf(name: str, log: np.dtype[Any]) -> dict[str, Any]:
    """Return the arrays of a netCDF file and its checkpoint, as in an ``.npz`` file."""
    xarray = check.optional("xarray", "a file that ends in .nc")
    check.optional("netCDF4", "a file that ends in .nc")
    try:
        data = xarray.open_dataset(name, engine="netcdf4", decode_cf=False)
    except (OSError, ValueError, RuntimeError):
        raise files.Foreign from None
    with data:
        most = files.MAX_EXPANSION * os.path.getsize(name) + files.ROOM
        if data.nbytes > most or any(data[one].dtype.kind not in "fiu" for one in data.variables if one != "side"):
            raise files.Foreign
        table = {key: data[key].values for key in data.variables if key not in ("side", "mass", "radius")}
    try:
        file = BytesIO(table.pop("checkpoint").tobytes())
        files.heads(file)  # check the headers before any data is read
        stored = files.arrays(file)
        columns = {key: table.pop("contact_pair" if key == "pair" else key) for key in log.names or ()}
        stored = table | stored
        if "contacts" in stored:  # hard spheres: an empty array
            stored |= {key: columns[key[9:]].astype(kind) for key, kind in HARD_LOG_COLUMNS.items()}
        else:
            stored["contacts"] = np.zeros(len(columns["pair"]), log)
            for key, values in columns.items():
                stored["contacts"][key] = values
    except (KeyError, ValueError):
        raise files.Foreign from None
    _check_heads({key: (value.dtype, value.shape) for key, value in stored.items()}, log)
    return stored


def _check_heads(heads: Mapping[str, files.Head], log: np.dtype[Any]) -> None:
    """Raise unless a file contains the arrays of a run with valid types and shapes."""
    if not heads.keys() >= NEEDED_ENTRIES or any(len(heads[name][1]) != 1 for name in ("scene.mass", "time")):
        raise files.Foreign
    n, t = heads["scene.mass"][1][0], heads["time"][1][0]
    size = {"n": n, "p": n - 1 + ("scene.ring" in heads), "t": t, "l": 5}
    kinds = {"contacts": log, "scene.ring": np.dtype(bool)} | {
        name: np.dtype(HARD_LOG_COLUMNS[name]) for name in HARD_LOG_COLUMNS}
    if heads.keys() & HARD_LOG_COLUMNS.keys() and not heads.keys() >= HARD_LOG_COLUMNS.keys():
        raise ValueError(f"its log lacks columns. {check.EDITED_STATE}")
    for name, (dtype, shape) in heads.items():
        shown = files.plain_text(name, 60)
        if name == "words":
            good = dtype.kind == "U" and shape == () and dtype.itemsize <= 4 * (
                MAX_METADATA_LENGTH + METADATA_PER_PAIR * size["p"])
        elif name.startswith("state."):  # checked in detail when the run is resumed
            good = (len(shape) <= 1 and math.prod(shape) <= MAX_STATE_RECORDS + 8 * size["p"]
                    and dtype.itemsize <= MAX_RECORD_BYTES)
        elif name in ARRAY_SHAPES:
            wanted = tuple(size.get(one, shape[0] if shape else 0) for one in ARRAY_SHAPES[name])
            good = dtype == kinds.get(name, np.dtype(float)) and shape == wanted
        elif name in HARD_LOG_COLUMNS:
            good = dtype == kinds[name] and shape == heads["contacts.pair"][1][:1] + (2,) * ("v_" in name)
        else:
            raise ValueError(f"it contains {shown}, which this version does not know. Read it with a later version of "
                             "granular.")
        if not good:
            raise ValueError(f"{shown} does not fit a run of {n} bodies and {t} samples, got an array of shape "
                             f"{files.plain_text(str(shape), 60)} and kind {dtype.kind!r}. {check.EDITED_STATE}")


def _hard_log(stored: Mapping[str, Any], log: np.dtype[Any]) -> Any:
    """Return the log of a hard run from its saved columns."""
    rows = np.zeros(len(stored["contacts.pair"]), log)
    for name in HARD_LOG_COLUMNS:
        rows[name[9:]] = stored[name]
    rows["t_end"], rows["force_max"] = rows["t_begin"], math.nan
    return rows


def _words(text: str) -> dict[str, Any]:
    """Return the metadata of a run after a check of their types."""
    try:
        words = json.loads(text)
    except ValueError:
        raise files.Foreign from None
    kinds: dict[str, Any] = METADATA_TYPES | LATER_METADATA_TYPES
    if not isinstance(words, dict) or not words.keys() >= METADATA_TYPES.keys():
        raise files.Foreign
    for name in kinds.keys() & words.keys():
        if not isinstance(words[name], kinds[name]):
            raise ValueError(f"its {name} is {files.plain_text(repr(words[name]), 60)}. {check.EDITED_STATE}")
    return words


def _check_words(words: Mapping[str, Any], stored: Mapping[str, Any], statuses: Collection[str]) -> None:
    """Raise `ValueError` for invalid metadata, except laws, rules and walls."""
    check.refuse({
        f"its status must be one of {', '.join(statuses)}, got {files.plain_text(repr(words['status']), 60)}.":
            words["status"] not in statuses,
        f"it has both laws and rules, or neither. {check.EDITED_STATE}":
            (words["law"] is None) is (words["rule"] is None),
    })
    for name, value in words["stats"].items():
        several = value if isinstance(value, list) else [value]
        pair = name != "first_disturbed" or (len(several) == 2 and not any(isinstance(one, str) for one in several))
        if not pair or not all(isinstance(one, PLAIN_TYPES) for one in several):
            raise ValueError(f"its number {files.plain_text(repr(name), 60)} is "
                             f"{files.plain_text(repr(value), 60)}. {check.EDITED_STATE}")
    walls, signed = len(words.get("walls", (None, None))), words.get("format", 1) > 2 or "digest" in words
    check.refuse({
        f"its walls must be 2, a floor and a ceiling or None, got {walls}.": walls != 2,
        "its numbers do not match its digest. "
        f"{check.EDITED_STATE}": signed and words.get("digest") != _digest(words, stored),
    })


def _check_rows(stored: Mapping[str, Any], status: str) -> None:
    """Raise `ValueError` unless times increase and all rows are finite.

    Rows of unstable runs can contain any values.
    """
    time, log = stored["time"], stored["contacts"]
    if not len(time) or not np.isfinite(time).all() or (np.diff(time) < 0.0).any():
        raise ValueError(f"its times decrease or are not finite. {check.EDITED_STATE}")
    rows = [*(stored.get(name) for name in ("position", "velocity", "gap", "force")),
            *(log[name] for name in ("t_begin", "duration", "v_in", "impulse"))]
    if status != "unstable" and not all(np.isfinite(one).all() for one in rows if one is not None):
        raise ValueError(f"its samples or contacts are not finite. {check.EDITED_STATE}")
    last = stored["gap"].shape[1] - 1
    if len(log) and not 0 <= log["pair"].min() <= log["pair"].max() <= last:
        raise ValueError(f"its contacts must be of pairs 0 to {last}, got {log['pair'].min()} to {log['pair'].max()}.")


def _made(words: Mapping[str, Any], stored: Mapping[str, Any], law: Any, rule: Any) -> dict[str, Any]:
    """Return the constructor arguments of a run from its stored data."""
    numbers = {name: _plain(stored[f"scene.{name}"]) for name in SCENE_ARRAYS if f"scene.{name}" in stored}
    floor, ceiling = (wall and from_json("wall", wall) for wall in words.get("walls", (None, None)))
    scene = Scene(**numbers, floor=floor, ceiling=ceiling)
    state = {name[6:]: _plain(value) for name, value in stored.items() if name.startswith("state.")}
    arrays: dict[str, Any] = {name: stored.get(name) for name in RUN_ARRAYS}
    words["stats"].update(_unlogged(words, stored, scene))
    stats = words["stats"].items()
    return arrays | {
        "scene": scene,
        "law": _revived("law", words["law"], law, scene),
        "rule": _revived("rule", words["rule"], rule, scene),
        "status": words["status"],
        "message": files.plain_text(words["message"]),
        "stats": {files.plain_text(name): tuple(value) if isinstance(value, list) else value for name, value in stats},
        "state": state if words["rule"] is not None or "origin" in state else {},  # older md runs cannot be resumed
    }


def _unlogged(words: Mapping[str, Any], stored: Mapping[str, Any], scene: Scene) -> dict[str, bool]:
    """Return {"log": False} for a run without its log, else an empty dict.

    Files of earlier versions lack this mark. Such a run starts at the initial scene and has a positive number of
    contacts in `stats`, but no rows of contacts.
    """
    begun = all(np.array_equal(stored[name][0], getattr(scene, name)) for name in ("gap", "velocity"))
    counted = words["stats"].get("contacts" if words["rule"] is None else "events", 0)
    return {"log": False} if begun and counted and not len(stored["contacts"]) else {}


def _revived(name: str, stored: Any, given: Any, scene: Scene) -> tuple[Any, ...] | None:
    """Return the given or the stored laws (rules), one per pair, or None without any."""
    if stored is None:
        return None
    if given is not None:
        return check.per_pair(name, given, scene.n_pairs)
    try:
        made = [from_json(name, one) for one in stored] if isinstance(stored, list) else from_json(name, stored)
        return check.per_pair(name, made, scene.n_pairs)
    except LookupError as own:
        raise ValueError(f"the {name} in the file is your own, {own}, which is not stored. Pass load(path, {name}=...)."
                         ) from None


def _plain(value: Any) -> Any:
    """Return a number or string in place of an array without dimensions."""
    return value.item() if value.ndim == 0 else value

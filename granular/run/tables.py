"""Conversion of a run to xarray, pandas, netCDF, CSV and extended XYZ.

OVITO and ASE read extended XYZ. The module also creates a run from arrays that another program has computed.
"""

from __future__ import annotations

import io
import json
import math
import os
import sys
from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np

from granular._engine import check, files
from granular._engine.package import import_optional
from granular.run import saved_run
from granular.scene import Scene, positions

ROW_UNITS = {"position": ("body", "m"), "velocity": ("body", "m/s"), "gap": ("pair", "m"), "force": ("pair", "N"),
        "ledger": ("share", "J")}
"""Second dimension and unit of each array of samples."""
LOG_UNITS = {"pair": "1", "t_begin": "s", "t_end": "s", "duration": "s", "v_in": "m/s", "v_out": "m/s", "xi_max": "m",
       "force_max": "N", "impulse": "N s"}
"""Unit of each column of the contact log."""
LOG_NAMES = {name: "contact_pair" if name == "pair" else name for name in LOG_UNITS}
"""Name of each column of the contact log in a dataset."""
SUFFIX_PACKAGES = {".npz": (), ".nc": ("xarray", "netCDF4"), ".csv": ("pandas",), ".extxyz": ()}
"""Packages that each supported file suffix requires."""


def description_of_run(run: Any) -> dict[str, str]:
    """Return the metadata of a run for the header of a file, as strings by name.

    They describe scene, laws or rules, status and origin (versions and command).
    """
    laws = run.law or run.rule or ("none: numbers of another program",)
    laws_shown = [repr(law) for law in (laws[:1] if len(set(map(repr, laws))) == 1 else laws)]
    command = " ".join([os.path.basename(sys.argv[0]), *sys.argv[1:]])
    descriptions = {
        "scene": str(run.scene), "rule" if run.rule else "law": "; ".join(laws_shown), "status": run.status.name,
        "message": run.message, "units": "SI", "versions": json.dumps(files.provenance()["versions"]),
        "command": command}
    return {name: files.plain_text(text) for name, text in descriptions.items()}


def dataset(run: Any) -> Any:
    """Convert a run to a dataset, see `granular.Trajectory.to_xarray`."""
    xarray = import_optional("xarray", "to_xarray")
    rows = {name: (("time", dim), getattr(run, name), {"units": unit}) for name, (dim, unit) in ROW_UNITS.items()
            if getattr(run, name) is not None}
    log = {LOG_NAMES[name]: (("contact", "side")[: run.contacts[name].ndim], run.contacts[name], {"units": unit})
           for name, unit in LOG_UNITS.items()}
    scene = run.scene
    labels = {"time": ("time", run.time, {"units": "s"}), "side": ["lower", "upper"],
              "mass": ("body", scene.mass, {"units": "kg"}), "radius": ("body", scene.radius, {"units": "m"})}
    return xarray.Dataset(rows | log, labels, description_of_run(run))


def frame(run: Any, what: str = "contacts") -> Any:
    """Convert a run to a data frame, see `granular.Trajectory.to_frame`."""
    pandas = import_optional("pandas", "to_frame")
    if check.choice("what", what, ("contacts", "samples")) == "contacts":
        columns = [_columns(name, run.contacts[name], ("lower", "upper")) for name in LOG_UNITS]
    else:
        columns = [_columns(name, values, range(values.shape[-1])) for name in ("time", *ROW_UNITS)
                if (values := getattr(run, name)) is not None]
    return pandas.DataFrame(dict(chain.from_iterable(columns)))


def _columns(name: str, values: Any, labels: Any) -> list[tuple[str, Any]]:
    """Return the columns of an array, as pairs of a name and values.

    A one-dimensional array is one column. The columns of a table get `labels` appended to their name.
    """
    if values.ndim == 1:
        return [(name, values)]
    return [(f"{name}_{label}", values[:, k]) for k, label in enumerate(labels)]


def of_arrays(scene: Scene, time: Any, position: Any, gap: Any, velocity: Any) -> dict[str, Any]:
    """Return the arrays of a run that another program has computed, by field name.

    See `granular.Trajectory.from_arrays`.
    """
    check.of_kind("scene", scene, Scene, "a granular.Scene", "Give the scene from which the other program started.")
    if (position is None) is (gap is None):
        raise ValueError(f"One of `position` and `gap` must be given, got {'both' if gap is not None else 'neither'}.")
    times = check.array("time", time)
    invalid = np.flatnonzero(~np.isfinite(times) | (np.diff(times, prepend=-np.inf) < 0.0))
    if not len(times) or len(invalid):
        name, got = (f"time[{invalid[0]}]", f"{times[invalid[0]]}") if len(invalid) else ("time", "an empty array")
        need = "a finite time in s, not before its predecessor" if len(invalid) else "an array of at least one time"
        raise ValueError(check.must(name, need, got, "Sort the samples by time." * bool(len(invalid))))
    n, sizes = scene.n, np.add(*scene.sides(scene.radius))
    speed = None if velocity is None else _checked_table("velocity", velocity, (len(times), n))
    name, given, width = ("position", position, n) if gap is None else ("gap", gap, scene.n_pairs)
    rows = _checked_table(name, given, (len(times), width), lost=speed is None)
    seen = ~np.isnan(rows).any(axis=1)
    times, rows = times[seen], rows[seen]
    if gap is None:
        place = rows
        lower, upper = scene.bodies(np.arange(scene.n_pairs))
        gaps = place[:, upper] - place[:, lower] - sizes
        if scene.ring:
            gaps[:, -1] += float(scene.gap.sum() + sizes.sum())
    else:
        gaps = rows
        place = positions(scene, gaps, times - times[:1], float(times[0])) if len(times) else np.zeros((0, n))
    message, stats = "numbers of another program: samples without a contact log", {"contacts": math.nan}
    if speed is None:
        from granular.run.recordings import velocities

        check.raise_if_true({check.must("time", "an array of at least 3 times with positions, without `velocity`",
                                        f"{len(times)}"): len(times) < 3})
        speed, errors = velocities(scene, times, place, gaps)
        stats |= errors | {"lost_frames": len(seen) - len(times)}
        message += (f"; velocities are central differences with a standard error of {errors['velocity_error']:.2g} m/s "
                    f"(positions: {errors['position_error']:.2g} m), nan at the ends and next to bounces; lost frames "
                    f"left out: {stats['lost_frames']}")
    return {"scene": scene, "time": times, "position": place, "velocity": speed, "gap": gaps, "message": message,
            "stats": stats}


def _checked_table(name: str, values: Any, shape: tuple[int, int], lost: bool = False) -> Any:
    """Return a copy of a table of numbers, after checking its shape and values.

    With `lost`, entries of lost frames can be nan.
    """
    try:
        if np.iscomplexobj(np.asarray(values)):
            raise TypeError
        rows = np.array(values, dtype=float)
    except (TypeError, ValueError):
        requirement = f"a table of numbers of shape {shape}"
        raise TypeError(check.must(name, requirement, f"a value of type {type(values).__name__}")) from None
    if rows.shape != shape:
        advice = f"Give a row per time and a column per {'pair' if name == 'gap' else 'body, walls included'}."
        raise ValueError(check.must(name, f"an array of shape {shape}", f"an array of shape {rows.shape}", advice))
    invalid = np.argwhere(~np.isfinite(rows) & ~(lost & np.isnan(rows)))
    if len(invalid):
        row, column = invalid[0]
        raise ValueError(check.must(f"{name}[{row}, {column}]", "a finite number", f"{rows[row, column]}"))
    return rows


def suffix_of(path: str | os.PathLike[str]) -> str:
    """Return the suffix of a path in lower case, such as ".npz".

    It is ".npz" for a pipe or device, such as standard output. An exception is raised if the suffix is not supported,
    or if a package that it requires is not installed.
    """
    name = os.fspath(path) if isinstance(path, os.PathLike) else path
    suffix = os.path.splitext(str(name))[1].lower()
    if isinstance(name, str) and files.is_stream(name):
        return ".npz"
    if not isinstance(name, str) or "\0" in name or suffix not in SUFFIX_PACKAGES:
        raise ValueError(check.misuse("path", name, f"the name of a file that ends in {', '.join(SUFFIX_PACKAGES)}"))
    for package in SUFFIX_PACKAGES[suffix]:
        import_optional(package, f"a file that ends in {suffix}")
    return suffix


def save(path: str | os.PathLike[str], run: Any, compressed: bool = False) -> None:
    """Write a run atomically, in the format of the suffix of `path`."""
    suffix = suffix_of(path)
    if suffix == ".npz":
        saved_run.write(path, run, compressed)
    elif suffix == ".nc":
        _write_netcdf(path, run, compressed)
    elif suffix == ".csv":
        head = "".join(f"# {name}: {text}\n" for name, text in description_of_run(run).items())
        files.write_text(path, head + frame(run).to_csv(index=False, na_rep="nan"))
    else:
        files.write_text(path, "".join(_extxyz_frames(run)))


def _write_netcdf(path: str | os.PathLike[str], run: Any, compressed: bool) -> None:
    """Write a run to a netCDF file.

    The variable `checkpoint` contains scene, law and state as bytes, with which `granular.load` restores the run.
    """
    metadata, arrays = saved_run.file_contents(run)
    stream, data = io.BytesIO(), dataset(run)
    table_arrays = saved_run.TABLE_ARRAYS - ({"contacts"} if run.rule is not None else set())  # empty: hard spheres
    np.savez(stream, words=np.array(saved_run.metadata_json(metadata)),
             **{name: array for name, array in arrays.items() if name not in table_arrays})
    data["checkpoint"] = "byte", np.frombuffer(stream.getvalue(), np.uint8), {"long_name": "read by granular.load"}
    encoding = {name: {"_FillValue": None} | ({"zlib": True} if compressed and data[name].size else {})
           for name in data.variables if name != "side"}

    def fill(draft: str) -> None:
        files.check_disk_space(draft, data.nbytes)
        data.to_netcdf(draft, engine="netcdf4", format="NETCDF4", encoding=encoding)

    files.write(path, fill)


def _extxyz_frames(run: Any) -> Iterator[str]:
    """Yield the lines of an extended XYZ file, with one frame per sample.

    Balls are on the x axis. Positions of walls are entries in the header of each frame. A ring is a periodic cell.
    """
    scene, balls = run.scene, np.flatnonzero(~run.scene.is_wall).tolist()
    size = float(scene.gap.sum() + 2.0 * scene.radius.sum())
    width = 4.0 * float(scene.radius.max()) or 1.0
    cell = f'Lattice="{size!r} 0 0 0 {width!r} 0 0 0 {width!r}" pbc="T F F"' if scene.ring else 'pbc="F F F"'
    replacements = str.maketrans({'"': "'", "\\": "/"})  # the text is inside quotation marks
    header = " ".join(f'{name}="{text.translate(replacements)}"' for name, text in description_of_run(run).items())
    for k, (time, x, v) in enumerate(zip(run.time.tolist(), run.position.tolist(), run.velocity.tolist(), strict=True)):
        walls = "".join(f" {name}={x[i]!r}" for name, i in (("floor", 0), ("ceiling", -1)) if math.isinf(scene.mass[i]))
        yield (f"{len(balls)}\n{cell} Properties=species:S:1:pos:R:3:velo:R:3:radius:R:1:mass:R:1 Time={time!r}{walls}"
               f"{' ' + header if k == 0 else ''}\n")
        for i in balls:
            yield f"X {x[i]!r} 0 0 {v[i]!r} 0 0 {float(scene.radius[i])!r} {float(scene.mass[i])!r}\n"

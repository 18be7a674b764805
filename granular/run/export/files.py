"""Files that others read: netCDF, CSV, and extended XYZ, which OVITO and ASE open."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from granular._engine import check, files
from granular.run import saved_run
from granular.run.export.table import about, dataset, frame

NEEDS = {".npz": (), ".nc": ("xarray", "netCDF4"), ".csv": ("pandas",), ".extxyz": ()}
"""Endings, and the packages that write them."""


def ending_of(path: str | os.PathLike[str]) -> str:
    """Return the ending of a path, in small letters, if it is one that is written, and what writes it is installed."""
    name = os.fspath(path) if isinstance(path, os.PathLike) else path
    ending = os.path.splitext(str(name))[1].lower()
    if isinstance(name, str) and files.is_stream(name):
        return ".npz"
    if not isinstance(name, str) or "\0" in name or ending not in NEEDS:
        raise ValueError(f"path is {name!r}: the name of a file that ends in {', '.join(NEEDS)} is needed.")
    for package in NEEDS[ending]:
        check.optional(package, f"a file that ends in {ending}")
    return ending


def save(path: str | os.PathLike[str], run: Any, compressed: bool = False) -> None:
    """Write a run in the format of the path's ending, whole or not at all."""
    ending = ending_of(path)
    if ending == ".npz":
        saved_run.write(path, run, compressed)
    elif ending == ".nc":
        _netcdf(path, run, compressed)
    elif ending == ".csv":
        head = "".join(f"# {name}: {text}\n" for name, text in about(run).items())
        files.write_text(path, head + frame(run).to_csv(index=False, na_rep="nan"))
    else:
        files.write_text(path, "".join(_extxyz(run)))


def _netcdf(path: str | os.PathLike[str], run: Any, compressed: bool) -> None:
    """Tables for everybody, and in the variable `checkpoint` what a run needs besides to go on: scene, law, state."""
    words, arrays = saved_run.packed(run)
    stream, data = io.BytesIO(), dataset(run)
    own = saved_run.TABLES - ({"contacts"} if run.rule is not None else set())  # empty: tells hard spheres
    np.savez(stream, words=np.array(saved_run.said(words)),
             **{name: array for name, array in arrays.items() if name not in own})
    data["checkpoint"] = "byte", np.frombuffer(stream.getvalue(), np.uint8), {"long_name": "read by granular.load"}
    how = {name: {"_FillValue": None} | ({"zlib": True} if compressed and data[name].size else {})
           for name in data.variables if name != "side"}

    def fill(draft: str) -> None:
        files.check_room(draft, data.nbytes)
        data.to_netcdf(draft, engine="netcdf4", format="NETCDF4", encoding=how)

    files.write(path, fill)


def _extxyz(run: Any) -> Iterator[str]:
    """A frame for each row: balls on the x axis, walls as numbers of the frame; a ring is a periodic cell."""
    scene, balls = run.scene, np.flatnonzero(~run.scene.is_wall).tolist()
    size = float(scene.gap.sum() + 2.0 * scene.radius.sum())
    width = 4.0 * float(scene.radius.max()) or 1.0
    cell = f'Lattice="{size!r} 0 0 0 {width!r} 0 0 0 {width!r}" pbc="T F F"' if scene.ring else 'pbc="F F F"'
    marks = str.maketrans({'"': "'", "\\": "/"})  # between quotation marks
    said = " ".join(f'{name}="{text.translate(marks)}"' for name, text in about(run).items())
    for k, (time, x, v) in enumerate(zip(run.time.tolist(), run.position.tolist(), run.velocity.tolist(), strict=True)):
        walls = "".join(f" {name}={x[i]!r}" for name, i in (("floor", 0), ("ceiling", -1)) if math.isinf(scene.mass[i]))
        yield (f"{len(balls)}\n{cell} Properties=species:S:1:pos:R:3:velo:R:3:radius:R:1:mass:R:1 Time={time!r}{walls}"
               f"{' ' + said if k == 0 else ''}\n")
        for i in balls:
            yield f"X {x[i]!r} 0 0 {v[i]!r} 0 0 {float(scene.radius[i])!r} {float(scene.mass[i])!r}\n"

"""A run as labelled arrays (xarray), as a table (pandas), and made of arrays that another program has computed."""

from __future__ import annotations

import json
import os
import sys
from itertools import chain
from typing import Any

import numpy as np

from granular._engine import check, files
from granular.scene import Scene, positions

ROWS = {"position": ("body", "m"), "velocity": ("body", "m/s"), "gap": ("pair", "m"), "force": ("pair", "N"),
        "ledger": ("share", "J")}
"""Second dimension and unit of what a run has at its times."""
LOG = {"pair": "1", "t_begin": "s", "t_end": "s", "duration": "s", "v_in": "m/s", "v_out": "m/s", "xi_max": "m",
       "force_max": "N", "impulse": "N s"}
"""Units of the contact log."""
NAMES = {name: "contact_pair" if name == "pair" else name for name in LOG}
"""Names of its columns beside those of rows."""


def about(run: Any) -> dict[str, str]:
    """What a run is of, and where it comes from: for the head of a file."""
    laws = run.law or run.rule or ("none: numbers from elsewhere",)
    shown = [repr(one) for one in (laws[:1] if len(set(map(repr, laws))) == 1 else laws)]
    command = " ".join([os.path.basename(sys.argv[0]), *sys.argv[1:]])
    said = {"scene": str(run.scene), "rule" if run.rule else "law": "; ".join(shown), "status": run.status.name,
            "message": run.message, "units": "SI", "versions": json.dumps(files.provenance()["versions"]),
            "command": command}
    return {name: files.plain_text(text) for name, text in said.items()}


def dataset(run: Any) -> Any:
    """See `granular.Trajectory.to_xarray`."""
    xarray = check.optional("xarray", "to_xarray")
    rows = {name: (("time", dim), getattr(run, name), {"units": unit}) for name, (dim, unit) in ROWS.items()
            if getattr(run, name) is not None}
    log = {NAMES[name]: (("contact", "side")[: run.contacts[name].ndim], run.contacts[name], {"units": unit})
           for name, unit in LOG.items()}
    scene = run.scene
    labels = {"time": ("time", run.time, {"units": "s"}), "side": ["lower", "upper"],
              "mass": ("body", scene.mass, {"units": "kg"}), "radius": ("body", scene.radius, {"units": "m"})}
    return xarray.Dataset(rows | log, labels, about(run))


def frame(run: Any, what: str = "contacts") -> Any:
    """See `granular.Trajectory.to_frame`."""
    pandas = check.optional("pandas", "to_frame")
    if check.choice("what", what, ("contacts", "samples")) == "contacts":
        flat = [_flat(name, run.contacts[name], ("lower", "upper")) for name in LOG]
    else:
        flat = [_flat(name, values, range(values.shape[-1])) for name in ("time", *ROWS)
                if (values := getattr(run, name)) is not None]
    return pandas.DataFrame(dict(chain.from_iterable(flat)))


def _flat(name: str, values: Any, labels: Any) -> list[tuple[str, Any]]:
    """A column, or several, each with its label behind the name."""
    if values.ndim == 1:
        return [(name, values)]
    return [(f"{name}_{label}", values[:, k]) for k, label in enumerate(labels)]


def of_arrays(scene: Scene, time: Any, position: Any, gap: Any, velocity: Any) -> dict[str, Any]:
    """The parts of a run that another program has computed; see `granular.Trajectory.from_arrays`."""
    check.of_kind("scene", scene, Scene, "a granular.Scene", "that from which the other program started")
    if (position is None) is (gap is None):
        raise ValueError(f"position and gap are {'both' if gap is not None else 'not'} given: one of them is needed.")
    moments = check.array("time", time)
    bad = np.flatnonzero(~np.isfinite(moments) | (np.diff(moments, prepend=-np.inf) < 0.0))
    if not len(moments) or len(bad):
        at = f"[{bad[0]}] is {moments[bad[0]]}" if len(bad) else " is empty"
        raise ValueError(f"time{at}: finite times in s that do not decrease are needed; sort the rows by time.")
    n, sizes = scene.n, np.add(*scene.sides(scene.radius))
    speed = _rows("velocity", velocity, (len(moments), n))
    if gap is None:
        place = _rows("position", position, (len(moments), n))
        lower, upper = scene.bodies(np.arange(scene.n_pairs))
        gaps = place[:, upper] - place[:, lower] - sizes
        if scene.ring:
            gaps[:, -1] += float(scene.gap.sum() + sizes.sum())
    else:
        gaps = _rows("gap", gap, (len(moments), scene.n_pairs))
        place = positions(scene, gaps, moments - moments[0], float(moments[0]))
    return {"scene": scene, "time": moments, "position": place, "velocity": speed, "gap": gaps}


def _rows(name: str, values: Any, shape: tuple[int, int]) -> Any:
    """A table of numbers of that shape, copied."""
    try:
        if np.iscomplexobj(np.asarray(values)):
            raise TypeError
        rows = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {type(values).__name__}: a table of numbers of shape {shape} is needed.") from None
    if rows.shape != shape:
        raise ValueError(f"{name} has the shape {rows.shape}: {shape} is needed, a row for each time and a column for "
                         f"each {'pair' if name == 'gap' else 'body, walls too'}.")
    if not np.isfinite(rows).all():
        row, column = np.argwhere(~np.isfinite(rows))[0]
        raise ValueError(f"{name}[{row}, {column}] is {rows[row, column]}: finite numbers are needed.")
    return rows

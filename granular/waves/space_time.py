"""A run as a picture of space and time: force or velocity by shade, contact by contact.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from granular import _check, _files
from granular._reports import COLUMN, canvas, style
from granular.trajectory import Trajectory

SHADES = {"force": ("contact", "force, N"), "velocity": ("ball", "velocity, m/s")}
"""What is shown: what counts upwards, and what the bar says."""


def picture(
    run: Trajectory, show: str = "force", path: str | PathLike[str] | None = None, *, beyond: bool = False,
    axis: Any = None,
) -> Any:
    """Draw force or velocity over time and place; return the figure, or save it to `path`.

    Parameters
    ----------
    run : Trajectory
        With rows (``samples``) that are evenly spaced; a few hundred do. Of soft spheres for forces.
    show : {"force", "velocity"}
        What the shades mean.
    path : str or path, optional
        PNG, PDF or SVG file.
    beyond : bool
        Show what is beyond the first row, such as the static force of a chain.
    axis : matplotlib axis, optional
        Where to draw it, in place of a figure of its own.
    """
    across, bar = SHADES[_check.choice("show", show, list(SHADES))]
    if not isinstance(run, Trajectory) or (show == "force" and run.force is None):
        raise TypeError(f"run is {run!r}: a run of granular.md is needed; of hard spheres show='velocity'.")
    if len(run.time) < 5:
        raise ValueError(f"run has {len(run.time)} rows: at least 5 are needed; pass samples= to simulate.")
    values = np.asarray(getattr(run, show))
    if beyond:
        values, bar = values - values[0], f"{bar}, beyond the first row"
    with style():
        figure, one = None, axis
        if axis is None:
            figure, ((one,),) = canvas(1.3 * COLUMN, COLUMN)
        signed = bool((values < -1e-3 * np.abs(values).max()).any())
        most = float(np.abs(values).max()) or 1.0
        image = one.pcolormesh(run.time, np.arange(values.shape[1]), values.T, shading="nearest", rasterized=True,
                               cmap="RdBu_r" if signed else "magma_r", vmin=-most * signed, vmax=most)
        one.set(xlabel="time, s", ylabel=across)
        one.figure.colorbar(image, ax=one, label=bar)
        return None if figure is None else _files.write_figure(path, figure, dpi=200)

"""Pulses in a run: arrival, strength and width at each contact, and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from granular._engine import check, files
from granular._engine.check import Array
from granular._engine.reports import COLUMN_WIDTH, canvas, style
from granular.run.trajectory import Trajectory

PICTURE_LABELS = {"force": ("contact", "force, N"), "velocity": ("ball", "velocity, m/s")}
"""Quantities that can be drawn: labels of the vertical axis and colour bar."""
ROUNDING_FORCE_SHARE = 1e-13
"""Share of the largest force of a run up to which a force is rounding error."""


@check.face
@dataclass(frozen=True, eq=False)
class Pulse:
    """Arrival time, strength and width of a pulse at each of p pairs.

    Attributes
    ----------
    time : (p,) array
        Time in s of the largest force. It is nan if this is at the first or the last sample of the run, or if the force
        is at most rounding error: 1e-13 of the largest force of the run.
    peak : (p,) array
        Largest force in N above the static force. It is not interpolated where `time` is nan.
    width : (p, w) array
        Duration in s for which the force around the peak exceeds each of the requested shares of it. It is nan where
        `time` is nan, or if the run does not contain both crossings.
    place : (p,) array
        Position in m of the upper surface of the lower body of each pair, in the initial scene.
    """

    time: Array
    peak: Array
    width: Array
    place: Array

    def speed(self, first: int = 0, last: int | None = None) -> float:
        """Return the speed in m/s between the contacts `first` and `last`.

        It is the slope of position over time (least squares).
        """
        part = slice(*(one if one is None else check.whole(name, one, at_least=-len(self.time))
                       for name, one in (("first", first), ("last", last))))
        seen = np.isfinite(self.time[part])
        if len(np.unique(self.time[part][seen])) < 2:
            raise ValueError("`first` and `last` must enclose at least 2 contacts that the pulse passes one after the "
                             f"other, got {first!r} and {last!r}.")
        t, x = self.time[part][seen], self.place[part][seen]
        t = t - t.mean()
        return float(t @ (x - x.mean()) / (t @ t))


@check.face
def pulse(run: Trajectory, shares: Sequence[float] = (0.5, 0.01, 0.001), static: float = 0.0) -> Pulse:
    """Measure the largest pulse at each contact in a run of soft spheres.

    Between samples the force is interpolated by a cubic spline, with an error of about (dt/duration)⁴.

    Parameters
    ----------
    run : Trajectory
        Run of `granular.md` with sufficient `samples`: 20 per pulse give 4 digits, 200 give 8.
    shares : floats
        Shares of the peak, in (0, 1), at which the width is measured.
    static : float
        Force in N in all contacts at rest. The pulse is the force above it.

    Returns
    -------
    Pulse
        Arrival times, peaks and widths.
    """
    forces = _rows(run, "force", "Hard spheres have no forces.")
    parts = check.array("shares", shares)
    check.every("shares", parts, (parts > 0.0) & (parts < 1.0), "a number in (0, 1)")
    base = check.number("static", static, at_least=0.0)
    faint = ROUNDING_FORCE_SHARE * float(np.abs(forces).max())
    seen = [_of_one(run.time, force - base, parts, faint) for force in forces.T]
    place = run.scene.sides(run.scene.position + run.scene.radius)[0]
    return Pulse(np.array([one[0] for one in seen]), np.array([one[1] for one in seen]),
                 np.array([one[2] for one in seen]).reshape(len(seen), len(parts)), place)


def _of_one(time: Array, force: Array, shares: Array, faint: float) -> tuple[float, float, list[float]]:
    """Return time, peak and widths of the largest force of one contact.

    Time and widths are nan if the force does not exceed `faint`, or if the first or the last sample is the largest.
    """
    from scipy.interpolate import CubicSpline

    i = int(force.argmax())
    if not 0 < i < len(time) - 1 or not force[i] > faint:
        return np.nan, float(force[i]), [np.nan] * len(shares)
    spline: Any = CubicSpline(time - time[i], force)
    near = spline.derivative().roots(extrapolate=False)
    # keep only extrema next to the largest sample; the sample itself is the fallback
    near = np.append(near[np.abs(near) <= max(time[i] - time[i - 1], time[i + 1] - time[i])], 0.0)
    top = float(near[spline(near).argmax()])
    peak = float(spline(top))
    widths = []
    for share in shares.tolist():
        roots = spline.solve(share * peak, extrapolate=False)
        before, after = roots[roots < top], roots[roots > top]
        widths.append(float(after.min() - before.max()) if len(before) and len(after) else np.nan)
    return float(time[i]) + top, peak, widths


@check.face
def picture(
    run: Trajectory, show: str = "force", path: str | PathLike[str] | None = None, *, beyond: bool = False,
    axis: Any = None,
) -> Any:
    """Draw force or velocity over time and position, and return or save the figure.

    Parameters
    ----------
    run : Trajectory
        Run with evenly spaced ``samples``, a few hundred are enough. Forces require soft spheres.
    show : {"force", "velocity"}
        Quantity shown by the colours.
    path : str or path, optional
        PNG, PDF or SVG file.
    beyond : bool
        Subtract the first sample, for example the static force of a chain.
    axis : matplotlib axis, optional
        Axis to draw on. By default a new figure is made.
    """
    across, bar = PICTURE_LABELS[check.choice("show", show, list(PICTURE_LABELS))]
    values = _rows(run, show, "For hard spheres use show='velocity'.")
    if beyond:
        values, bar = values - values[0], f"{bar}, beyond the first row"
    with style():
        figure, ((one,),) = canvas(1.3 * COLUMN_WIDTH, COLUMN_WIDTH) if axis is None else (None, ((axis,),))
        signed = bool((values < -1e-3 * np.abs(values).max()).any())
        most = float(np.abs(values).max()) or 1.0
        image = one.pcolormesh(run.time, np.arange(values.shape[1]), values.T, shading="nearest", rasterized=True,
                               cmap="RdBu_r" if signed else "magma_r", vmin=-most * signed, vmax=most)
        one.set(xlabel="time, s", ylabel=across)
        one.figure.colorbar(image, ax=one, label=bar)
        return None if figure is None else files.write_figure(path, figure, dpi=200)


def _rows(run: Any, what: str, fix: str) -> Array:
    """Return forces or velocities of a run, or raise.

    Forces exist for soft spheres only, and 5 samples are required.
    """
    if not isinstance(run, Trajectory) or (what == "force" and run.force is None):
        raise TypeError(f"`run` must be a run of granular.md, got {run!r}. {fix}")
    if len(run.time) < 5:
        raise ValueError(f"`run` must have at least 5 samples, got {len(run.time)}. Pass samples= to simulate.")
    return np.asarray(getattr(run, what))

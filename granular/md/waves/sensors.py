"""Pulses in a run: arrival, strength and width at each contact, and a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from granular._engine import check, files, signature
from granular._engine.check import Array
from granular._engine.reports import COLUMN_WIDTH, canvas, style, unit_of
from granular.run.trajectory import Trajectory

PICTURE_LABELS = {"force": ("contact", "force", "N"), "velocity": ("ball", "velocity", "m/s")}
"""Labels of the vertical axis and of the colour bar, and the unit of the bar."""
ROUNDING_FORCE_RATIO = 1e-13
"""Largest rounding error of a force, relative to the largest force of the run."""


@signature.face
@dataclass(frozen=True, eq=False)
class Pulse:
    """Arrival time, strength and width of a pulse at each of p pairs.

    Attributes
    ----------
    time : (p,) array
        Time in s of the largest force. It is nan if the largest force is at the first or the last sample of the run.
        It is also nan if the force is at most the rounding error, 1e-13 of the largest force of the run.
    peak : (p,) array
        Largest force in N above the static force. It is not interpolated where `time` is nan.
    width : (p, w) array
        Duration in s for which the force exceeds each requested fraction of its peak. It is nan where `time` is nan, or
        if the run does not contain both crossings.
    place : (p,) array
        Position in m of the upper surface of the lower body of each pair, in the initial scene.
    """

    time: Array
    peak: Array
    width: Array
    place: Array

    def speed(self, first: int = 0, last: int | None = None) -> float:
        """Return the speed in m/s of the pulse between two contacts.

        It is the least-squares slope of position over time. Contacts with arrival time nan are ignored.

        Parameters
        ----------
        first, last : int, optional
            The pairs `first` to `last` - 1 are used, counted like a slice. Defaults to all pairs.

        Raises
        ------
        ValueError
            If fewer than two different arrival times remain.
        """
        selected = slice(*(value if value is None else check.integer(name, value, at_least=-len(self.time))
                       for name, value in (("first", first), ("last", last))))
        is_passed = np.isfinite(self.time[selected])
        if len(np.unique(self.time[selected][is_passed])) < 2:
            raise ValueError("`first` and `last` must enclose at least 2 contacts that the pulse passes one after the "
                             f"other, got {first!r} and {last!r}.")
        t, x = self.time[selected][is_passed], self.place[selected][is_passed]
        t = t - t.mean()
        return float(t @ (x - x.mean()) / (t @ t))


@signature.face
def pulse(run: Trajectory, shares: Sequence[float] = (0.5, 0.01, 0.001), static: float = 0.0) -> Pulse:
    """Measure the largest pulse at each contact in a run of soft spheres.

    Between samples the force is interpolated by a cubic spline, with an error of about (dt/duration)⁴.

    Parameters
    ----------
    run : Trajectory
        Run of `granular.md` with sufficient `samples`: 20 per pulse give 4 digits, 200 give 8.
    shares : floats
        Fractions of the peak, in (0, 1), at which the width is measured. Defaults to (0.5, 0.01, 0.001).
    static : float
        Force in N in all contacts at rest. The pulse is the excess over this force. Defaults to 0.

    Returns
    -------
    Pulse
        Arrival times, peaks and widths.
    """
    forces = _checked_samples(run, "force", "Hard spheres have no forces.")
    levels = check.array("shares", shares)
    check.every("shares", levels, (levels > 0.0) & (levels < 1.0), "a number in (0, 1)")
    base = check.number("static", static, at_least=0.0)
    smallest_force = ROUNDING_FORCE_RATIO * float(np.abs(forces).max())
    pulses = [_largest_pulse(run.time, force - base, levels, smallest_force) for force in forces.T]
    place = run.scene.sides(run.scene.position + run.scene.radius)[0]
    return Pulse(np.array([result[0] for result in pulses]), np.array([result[1] for result in pulses]),
                 np.array([result[2] for result in pulses]).reshape(len(pulses), len(levels)), place)


def _largest_pulse(time: Array, force: Array, levels: Array, smallest_force: float) -> tuple[float, float, list[float]]:
    """Return time in s, peak in N and widths in s of the largest force of one contact.

    Time and widths are nan if the force does not exceed `smallest_force` in N. They are also nan if the largest sample
    is the first or the last sample.
    """
    from scipy.interpolate import CubicSpline

    i = int(force.argmax())
    if not 0 < i < len(time) - 1 or not force[i] > smallest_force:
        return np.nan, float(force[i]), [np.nan] * len(levels)
    spline: Any = CubicSpline(time - time[i], force)
    extrema = spline.derivative().roots(extrapolate=False)
    # keep only extrema near the largest sample, which is itself the fallback
    extrema = np.append(extrema[np.abs(extrema) <= max(time[i] - time[i - 1], time[i + 1] - time[i])], 0.0)
    peak_time = float(extrema[spline(extrema).argmax()])
    peak = float(spline(peak_time))
    widths = []
    for fraction in levels.tolist():
        roots = spline.solve(fraction * peak, extrapolate=False)
        before, after = roots[roots < peak_time], roots[roots > peak_time]
        widths.append(float(after.min() - before.max()) if len(before) and len(after) else np.nan)
    return float(time[i]) + peak_time, peak, widths


@signature.face
def picture(
    run: Trajectory, show: str = "force", path: str | PathLike[str] | None = None, *, beyond: bool = False,
    axis: Any = None,
) -> Any:
    """Draw force or velocity over time and position, and return or save the figure.

    Parameters
    ----------
    run : Trajectory
        Run with evenly spaced ``samples``. A few hundred are enough. Forces require soft spheres.
    show : {"force", "velocity"}
        Quantity shown by the colours. Defaults to "force".
    path : str or path, optional
        PNG, PDF or SVG file.
    beyond : bool
        Whether to subtract the first sample, for example the static force of a chain. Defaults to False.
    axis : matplotlib axis, optional
        Axis to draw on. By default a new figure is created.

    Returns
    -------
    matplotlib figure or None
        None if `axis` is given or if the figure was written to `path`.
    """
    across, bar, unit = PICTURE_LABELS[check.choice("show", show, list(PICTURE_LABELS))]
    values = _checked_samples(run, show, "For hard spheres use show='velocity'.")
    if beyond:
        values, bar = values - values[0], f"{bar} above the first sample"
    with style():
        figure, ((panel,),) = canvas(1.3 * COLUMN_WIDTH, COLUMN_WIDTH) if axis is None else (None, ((axis,),))
        signed = bool((values < -1e-3 * np.abs(values).max()).any())
        largest, (scale, clock) = float(np.abs(values).max()) or 1.0, unit_of(float(np.ptp(run.time)), "s")
        image = panel.pcolormesh(run.time / scale, np.arange(values.shape[1]), values.T, shading="nearest",
                                 rasterized=True, cmap="RdBu_r" if signed else "magma_r", vmin=-largest * signed,
                                 vmax=largest)
        panel.set(xlabel=f"time ({clock})", ylabel=across)
        panel.figure.colorbar(image, ax=panel, label=f"{bar} ({unit})")
        return None if figure is None else files.write_figure(path, figure, dpi=200)


def _checked_samples(run: Any, quantity: str, advice: str) -> Array:
    """Return the forces (T, p) or velocities (T, n) of a run, after checking the run.

    `quantity` is "force" or "velocity". An exception is raised if the run has no forces or fewer than 5 samples.
    `advice` is added to its message.
    """
    if not isinstance(run, Trajectory):
        raise TypeError(f"`run` must be a Trajectory, got {run!r}.")
    if quantity == "force" and run.force is None:
        raise TypeError(f"`run` must be a run of granular.md, got {run!r}. {advice}")
    if len(run.time) < 5:
        raise ValueError(f"`run` must have at least 5 samples, got {len(run.time)}. Pass samples= to simulate.")
    return np.asarray(getattr(run, quantity))

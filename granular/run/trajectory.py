"""Result of a run: the class `Trajectory` with samples, contact log and status."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from granular._engine.check import Array, integer, raise_if_true
from granular._engine.signature import face
from granular.laws.kinds import resolved
from granular.run.contact_log import (
    CONTACT as CONTACT,
    LazyContacts,
    batches,
    group_by_key,
    open_log_file,
    wall_momentum,
)
from granular.scene import Scene
from granular.scene.places import point_positions as scene_points


class Status(Enum):
    """Reason for the end of a run. Its value is a phrase for output."""

    time = "the end time was reached"
    until = "the stop condition was met"
    quiet = "no further contact is possible"
    resting = "the balls rest on each other, and no contact can open or begin"
    collapse = "inelastic collapse: infinitely many collisions in a finite time"
    disturbed = "a contact is about to disturb another, so contacts are no longer isolated"
    max_events = "the limit on the amount of work was reached"
    unstable = "the time step exceeds the stability limit, so the numbers are meaningless"
    broken = "the final state is invalid, so the numbers are meaningless"
    bounded = "possible inelastic collapse: whether the collisions are infinitely many is unknown"


@face
@dataclass(frozen=True, eq=False)
class Trajectory(LazyContacts):
    """Result of a run: samples, contact log and status.

    Attributes
    ----------
    scene : Scene
        The initial state, unchanged.
    law, rule : tuple or None
        One force law per pair (soft spheres) or one restitution rule per pair (hard spheres). The attribute that does
        not apply is None.
    time : (T,) array
        Sample times in s. With ``samples=None`` they are the start and the end of the run.
    position, velocity : (T, n) arrays
        Positions of the bodies in m and velocities in m/s, upwards positive. A sample at the time of a collision
        contains the velocities after it.
    gap : (T, n-1) array, (T, n) on a ring
        Distances between surfaces in m, negative while balls overlap.
    force : (T, n-1) array or None
        Contact forces in N, ≥ 0 for repulsion. None for hard spheres.
    contacts : structured array
        Contact log, see `granular.run.contact_log.CONTACT`. It is empty with ``log=False``, or if the log is a file.
        For hard spheres it is created on first access.
    status, message : Status, str
        Reason for the end of the run, and a sentence with the time and other numbers.
    stats : dict
        Counters of the engine, such as the numbers of contacts and steps, and notes.
    state : dict
        Internal state at the end of the run, from which `granular.edmd.resume` or `granular.md.resume` continues. It is
        empty for fixed-step integrators, whose runs cannot be resumed.
    ledger : (T, 5) array or None
        Energies in J since the start, accumulated by the engine if walls are driven or thermal: work of the floor and
        of the ceiling, heat of the floor and of the ceiling, and dissipated energy, see `account`.
    """

    scene: Scene
    law: tuple[Any, ...] | None
    rule: tuple[Any, ...] | None
    time: Array
    position: Array
    velocity: Array
    gap: Array
    force: Array | None
    contacts: np.ndarray[tuple[int], np.dtype[np.void]]
    status: Status
    message: str
    stats: Mapping[str, Any] = field(default_factory=dict)
    state: Mapping[str, Any] = field(default_factory=dict)
    ledger: Array | None = None

    def __post_init__(self) -> None:
        values = vars(self)
        if isinstance(self.contacts, tuple):  # see `LazyContacts`
            values["settled"] = values.pop("contacts")
        if callable(self.state):
            values["kept"] = values.pop("state")
        for array in (self.time, self.position, self.velocity, self.gap, self.force, values.get("contacts"),
                      self.ledger):
            if array is not None:
                array.flags.writeable = False

    @cached_property
    def by_pair(self) -> tuple[Any, Any]:
        """Row numbers of the contact log grouped by pair, and the start of each group.

        The first array contains the row numbers, in order of time within each pair. The rows of pair c are at the
        positions from entry c of the second array to before entry c + 1.
        """
        return group_by_key(self.contacts["pair"], self.scene.n_pairs)

    def rows(self, pair: int) -> Any:
        """Return the row numbers of the contact log that belong to `pair`."""
        order, starts = self.by_pair
        c = pair if type(pair) is int else integer("pair", pair)
        return order[starts[c] : starts[c + 1]] if 0 <= c < len(starts) - 1 else order[:0]

    def of(self, pair: int) -> np.ndarray[tuple[int], np.dtype[np.void]]:
        """Return the rows of the contact log that belong to `pair`."""
        rows: np.ndarray[tuple[int], np.dtype[np.void]] = self.contacts[self.rows(pair)]
        return rows

    def count(self, pair: int) -> int:
        """Return the number of contacts of `pair` that have begun."""
        return len(self.rows(pair))

    def contact_batches(self, size: int = 100_000) -> Iterator[np.ndarray[tuple[int], np.dtype[np.void]]]:
        """Iterate over the contact log in batches.

        The log can also be stored in a file. Rows of a file (``log="run.npy"``) are in the order in which contacts end,
        and are read batch by batch.

        Parameters
        ----------
        size : int
            Number of rows per batch. Defaults to 100 000.

        Yields
        ------
        structured array
            Rows as in `contacts`.

        Raises
        ------
        OSError, ValueError
            If the file does not exist any more, or is not a contact log.
        """
        count = integer("size", size, at_least=1)
        path = self.stats.get("log")
        return batches(open_log_file(path) if path else self.contacts, count)

    @property
    def first_disturbed(self) -> tuple[float, int]:
        """Time in s at which two neighbouring pairs first overlap, and the lower pair.

        All contacts that end before this time are isolated. The value is (nan, -1) if all contacts are isolated, or if
        the run did not check. Runs of hard spheres check only with `watch`, as an estimate.
        """
        time, pair = self.stats.get("first_disturbed", (math.nan, -1))
        return time, pair

    def momentum(self) -> Array:
        """Return the total momentum of the balls (without walls) in kg m/s, shape (T,)."""
        balls = ~self.scene.is_wall
        return np.asarray(self.velocity[:, balls] @ self.scene.mass[balls])

    def energy(self) -> Array:
        """Return the total energy of the balls in J at every sample, shape (T,).

        The energy is Σ ½ m v² + Σ m g x + Σ U(ξ), summed over balls and overlaps. Constant external forces f add
        -Σ f x. Pendula of angular frequency Ω that are displaced by y from rest add Σ ½ m Ω² y². The elastic energy
        U(ξ) is included wherever ξ > 0, also while the force is clipped at zero. For laws with memory the energy is
        nan at samples with an overlap, because the overlap alone does not determine the recoverable energy.
        """
        balls = ~self.scene.is_wall
        m, v, x = self.scene.mass[balls], self.velocity[:, balls], self.position[:, balls]
        energy: Array = 0.5 * (v * v) @ m + self.scene.gravity * (x @ m)
        if self.scene.external_force is not None:
            energy -= x @ self.scene.external_force[balls]
        if self.scene.pendulum > 0.0:
            displacement = x - self.scene.at_rest[balls]
            energy += 0.5 * self.scene.pendulum**2 * (displacement * displacement) @ m
        if self.law is not None:
            laws = resolved(self.law, self.scene)
            for c in np.flatnonzero(~(self.gap >= 0.0).all(axis=0)).tolist():
                energy += list(map(laws[c].energy, (-self.gap[:, c]).tolist()))
        return energy

    def account(self) -> dict[str, Array]:
        """Return the balance of energy and momentum at every sample.

        The sum energy - work - heat + dissipated is constant. For scenes without pendula, `momentum` - Σ momentum +
        Σ (m g - f) t is constant, too.

        Returns
        -------
        dict
            Energies in J, and momenta in N s:

            *energy* (T,)
                See `energy`.
            *work* (T, 2)
                Work ∫ F ẋ_w dt on the balls since the start, by the first and the last body if they are walls.
            *heat* (T, 2)
                Heat transferred to the balls by these walls since the start.
            *dissipated* (T,)
                Energy dissipated in contacts since the start.
            *momentum* (T, 2)
                Momentum ∫ F dt transferred to the balls by these walls since the first sample, upwards positive.

        Notes
        -----
        If walls are driven or thermal, each energy is accumulated separately with a compensated sum. Otherwise the
        dissipated energy is the energy loss, and work is momentum times the constant wall velocity. With a fixed time
        step the sum is constant only to the order of the method.

        With one wall, its momentum is the momentum change of the balls minus the part of gravity and external forces.
        With two walls, it is computed in the same way for the balls between the wall and the widest gap. The logged
        impulses through that gap are added. The momentum is then nan at samples at which every pair is in contact, and
        without a log. It is also nan for hard balls that could have stuck to a ceiling. For pendula the momentum is the
        sum of the logged impulses of the wall, and nan at samples during a contact with it.
        """
        energy, momentum = self.energy(), wall_momentum(self)
        if self.ledger is None:
            speed = np.where(self.scene.is_wall, self.scene.velocity, 0.0)[[0, -1]]
            speed[[motion is not None for motion in self.scene.motions]] = math.nan
            work = np.where(speed == 0.0, 0.0, momentum * speed)
            return {"energy": energy, "work": work, "heat": np.zeros((len(energy), 2)), "momentum": momentum,
                    "dissipated": energy[0] - energy + work.sum(axis=1)}
        return {"energy": energy, "work": self.ledger[:, :2], "heat": self.ledger[:, 2:4], "momentum": momentum,
                "dissipated": self.ledger[:, 4]}

    @cached_property
    def dissipated(self) -> Array:
        """Energy in J that each contact dissipates, one entry per row of `contacts`.

        It is ∫ F ξ̇ dt from onset to end, or so far, with the contact force F in N and the rate ξ̇ of the overlap in
        m/s. For soft spheres the first access repeats the run, because this integral would slow down every run. The
        integral holds for every law, also where contacts overlap in time. For an isolated contact it is ½ m_eff (w_in²
        - w_out²) with the closing rates w_in and w_out. A contact that is clipped while balls overlap also dissipates
        its elastic energy, and a contact that begins overlapped can have a negative value. For hard spheres, and for
        hits of thermal walls, it is J (w_in + w_out) / 2 with the impulse J in N s. For a hit of a thermal wall this is
        minus the heat transferred to the ball.

        Raises
        ------
        ValueError
            For a run of soft spheres that was loaded from a file or copied from another process.
        """
        log, again = self.contacts, vars(self).get("again")
        energies: Array = log["impulse"] * ((log["v_in"] + log["v_out"]) @ (0.5, -0.5))
        if not (has_duration := ~np.isnan(log["force_max"])).any():
            return energies
        if again is None:
            raise ValueError("`dissipated` requires a run of soft spheres that this process has simulated, got a "
                             "loaded run or a copy. Simulate it again.")
        return np.where(has_duration, again().contacts["force_max"], energies)

    def dissipation(self) -> Array:
        """Return the rate of dissipation in W at every sample, shape (T,).

        It is the derivative of the dissipated energy of `account`, Σ (F - F_el(ξ)) ξ̇ over the overlapping pairs. F is
        the contact force in N, F_el = dU/dξ the elastic force at the overlap ξ, and ξ̇ its rate in m/s. Where the force
        is clipped at zero, elastic energy is dissipated. Hits of thermal walls are instantaneous and have no rate.

        Raises
        ------
        ValueError
            For hard spheres, and for laws with memory, whose elastic energy does not follow from the overlap.
        """
        laws = () if self.law is None else resolved(self.law, self.scene)
        raise_if_true({
            "`dissipation` requires soft spheres, got instantaneous collisions. Use `dissipated`.":
                self.law is None,
            "`dissipation` requires laws with a potential, got a law with memory. Use `dissipated`.":
                any(law.memory for law in laws)})
        rate, power = -self.scene.across(self.velocity), np.zeros(len(self.time))
        for c in np.flatnonzero((self.gap < 0.0).any(axis=0)).tolist():
            elastic_force = np.array([laws[c].force(xi, 0.0, xi) if xi > 0.0 else 0.0 for xi in -self.gap[:, c]])
            power += (np.asarray(self.force)[:, c] - elastic_force) * rate[:, c]
        return power

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw the paths of the balls over time without their radii, with all contacts.

        If all contacts lie within a small part of the run, that part is drawn again in a second panel.

        Parameters
        ----------
        path : str or path, optional
            File with a suffix that matplotlib supports, such as ``.png``. By default no file is written.

        Returns
        -------
        matplotlib.figure.Figure or None
            The figure, or None if it was written to `path`.

        Raises
        ------
        ModuleNotFoundError
            If matplotlib is not installed.
        OSError
            If the file cannot be written.
        ValueError
            If matplotlib does not support the suffix, or if the run has too few samples for its paths.

        Notes
        -----
        Paths of hard spheres are exact under constant forces, because they follow from the contact log. Long contacts,
        pendula, driven walls and runs without a log need samples, for example ``samples=np.linspace(0.0, end, 1000)``.
        """
        from granular.run import figures

        return figures.plot(self, path)

    def animate(self, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25) -> None:
        """Write a film of the run, for scenes of at most 60 bodies.

        If all contacts lie within a small part of the run, the film shows only that part.

        Parameters
        ----------
        path : str or path
            File that ends in ``.gif``, or in ``.mp4``, which requires ffmpeg.
        seconds : float, optional
            Duration of the film in s, positive. Defaults to 7.
        fps : int, optional
            Frames per second. Defaults to 25.

        Raises
        ------
        ModuleNotFoundError
            If matplotlib is not installed.
        OSError
            If the file cannot be written.
        ValueError
            If there are too many bodies, if the suffix is not supported, or if the run has too few samples, see `plot`.
        """
        from granular.run import films

        films.animate(self, path, seconds, fps)

    def save(self, path: str | PathLike[str], *, compressed: bool = False) -> None:
        """Write the run to one file atomically, in the format of its suffix.

        * ``.npz`` and ``.nc`` (netCDF, extra ``sweep``) contain the whole run. `load` restores it bitwise identically.
        * ``.csv`` contains the contact log in the columns of `to_frame`.
        * ``.extxyz`` contains the samples, one frame each, for OVITO and ASE. Balls are on the x axis. The positions of
          walls are the entries ``floor`` and ``ceiling`` of each frame.

        All numbers are written with all digits, in SI units.

        Parameters
        ----------
        path : str or path
            Name of the file.
        compressed : bool
            Whether to compress ``.npz`` and ``.nc``. The file is smaller by a third or more, and writing takes about
            twenty times as long. Defaults to False.

        Notes
        -----
        For hard spheres only the independent columns of the log are written to ``.npz``, 52 bytes per collision. `load`
        computes the other columns.

        Force laws and rules of this package are stored with their numbers. User-defined laws and rules are stored by
        name only. If a function moves a wall, its path is stored for the time of the run.
        """
        from granular.run import tables

        tables.save(path, self, compressed)

    def to_xarray(self) -> Any:
        """Return samples and contacts as an `xarray.Dataset` (extra ``sweep``).

        Units are attributes of the variables. Scene, law and versions are attributes of the dataset. Dimensions are
        *time*, *body*, *pair*, *contact*, and *side* (lower, upper). The variable ``contact_pair`` is the pair of a
        contact. The dataset can be written as netCDF or zarr by xarray.
        """
        from granular.run import tables

        return tables.dataset(self)

    def to_frame(self, what: str = "contacts") -> Any:
        """Return contacts or samples as a `pandas.DataFrame` (extra ``sweep``).

        All values are in SI units.

        Parameters
        ----------
        what : str
            "contacts" gives the columns *pair*, *t_begin*, *t_end*, *duration*, *v_in_lower*, *v_in_upper*, …
            "samples" gives *time*, *position_0*, …, *velocity_0*, …, *gap_0*, … and, for soft spheres, *force_0*, …
            Defaults to "contacts".

        Returns
        -------
        pandas.DataFrame
        """
        from granular.run import tables

        return tables.frame(self, what)

    @classmethod
    def from_arrays(
        cls, scene: Scene, time: Any, *, position: Any = None, gap: Any = None, velocity: Any = None
    ) -> Trajectory:
        """Create a run from arrays of another program, or from a recording.

        The run can be plotted, written, and compared with both engines.

        Parameters
        ----------
        scene : Scene
            Initial state of the other program or of the experiment.
        time : (T,) array
            Times in s, not decreasing. Without `velocity` they must increase.
        position : (T, n) array
            Positions in m of all bodies including walls, from the bottom up. Either `position` or `gap` is required.
        gap : (T, n-1) array, (T, n) on a ring
            Distances between surfaces in m, as an alternative to `position`.
        velocity : (T, n) array, optional
            Velocities in m/s of all bodies including walls. Defaults to central differences of the positions, see the
            notes.

        Returns
        -------
        Trajectory

        Raises
        ------
        TypeError, ValueError
            If shapes do not match, times decrease, or a number is not finite. Without `velocity`, also if there are
            fewer than 3 samples, times do not increase, or balls overlap by more than the mean of their radii.

        Notes
        -----
        The result contains only samples, without law, rule, forces and state. Its contact log is empty, because samples
        do not determine the onsets and ends of contacts. Its energy does not include the elastic energy of overlaps.

        Without `velocity`, samples with a position of nan are lost frames and are ignored. The velocity is the central
        difference over three samples. It is nan for the first and the last sample, and next to each change of velocity
        that is too large for free flight, because a difference across a bounce is meaningless. The standard error σ of
        a position is estimated from the scatter of the samples about free flight in `scene`. The standard error of a
        velocity is σ/(√2 h) for a time step h: 21 mm/s for 1 mm at 30 Hz. Both are in `message`, in m and m/s in
        ``stats["position_error"]`` and ``stats["velocity_error"]``. The number of lost frames is
        ``stats["lost_frames"]``. Fit positions, not these velocities.
        """
        from granular.run import tables

        parts = tables.of_arrays(scene, time, position, gap, velocity)
        return cls(**parts, law=None, rule=None, force=None, contacts=np.zeros(0, CONTACT), status=Status.time)

    @classmethod
    def load(cls, path: str | PathLike[str], law: Any = None, rule: Any = None) -> Trajectory:
        """Read a trajectory that was written by `save`.

        Parameters
        ----------
        path : str or path
            The ``.npz`` or ``.nc`` file.
        law, rule : optional
            Replacement for the stored laws or rules. It is required for user-defined laws or rules.

        Returns
        -------
        Trajectory

        Raises
        ------
        OSError
            If the file cannot be read.
        TypeError, ValueError
            If the file is not a trajectory, was written by a later version, or was changed after it was saved. A
            user-defined law or rule without a replacement also raises an error.

        Notes
        -----
        No code in the file is executed: laws, rules and walls are created from a closed list of types and from stored
        numbers. Control characters are removed from the message, and it is truncated to 500 characters.
        """
        from granular.run import loaded_run

        read = loaded_run.read(path, law, rule, Status.__members__, CONTACT)
        return cls(**read | {"status": Status[read["status"]]})

    def _repr_html_(self) -> str:
        from granular._engine.reports import abridged_rows, html
        bodies = zip(self.position[-1].tolist(), self.velocity[-1].tolist(), strict=True)
        rows = [[str(i), f"{x:.6g}", f"{v:.6g}"] for i, (x, v) in enumerate(bodies)]
        return html(repr(self), [["body", "position / m", "velocity / (m/s)"], *abridged_rows(rows)])

    def __repr__(self) -> str:
        engine = "edmd" if self.rule is not None else "md" if self.law is not None else "from elsewhere"
        return (f"Trajectory({engine}, {self.scene}, t = {self.time[0]:g} … {self.time[-1]:.6g} s, "
                f"{len(self.contacts)} contacts, {self.status.name}: {self.message})")


EARLY_STATUSES = (Status.collapse, Status.bounded, Status.max_events, Status.unstable, Status.broken)
"""Statuses of runs that ended before their end time or stop condition.

No conclusion is drawn from the final state of such a run.
"""


def points(run: Trajectory) -> Array:
    """Return positions in m of all bodies with radii subtracted, shape (T, n).

    Two touching balls have the same position. Body 0 is at 0 at the start.
    """
    return scene_points(run.scene, run.gap, run.position)


load = Trajectory.load

"""What a run returns: one frozen `Trajectory` for both engines, with its status and its log of contacts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from granular._engine.check import Array, face, whole
from granular.laws.kinds import resolved
from granular.run.contact_log import CONTACT as CONTACT, PublicWhenRead, batches, given_by_walls, grouped, mapped
from granular.scene import Scene
from granular.scene.places import points as scene_points


class Status(Enum):
    """Why a run ended; the value is the sentence to print."""

    time = "the end time was reached"
    until = "the stop condition was met"
    quiet = "no contact can follow"
    resting = "the balls rest on each other; no contact can open or begin"
    collapse = "inelastic collapse: infinitely many collisions in a finite time"
    disturbed = "a contact is about to disturb another; isolated contacts are over here"
    max_events = "the limit on the amount of work was reached"
    unstable = "the time step is beyond the stability limit; the numbers mean nothing"
    broken = "the last state is none that there can be; the numbers mean nothing"
    bounded = "collisions pile up down to the bound in the message; whether they are infinitely many is not known"


@face
@dataclass(frozen=True, eq=False)
class Trajectory(PublicWhenRead):
    """What happened: samples, contact log, and how it ended.

    Attributes
    ----------
    scene : Scene
        The initial state, untouched.
    law, rule : tuple or None
        One force law per pair (md) or one collision rule per pair (edmd); the other is None.
    time : (T,) array
        Sample times in s; first and last instant if ``samples=None``.
    position, velocity : (T, n) arrays
        In m and m/s, upwards positive; right-continuous at collisions.
    gap : (T, n-1) array, (T, n) on a ring
        Distances between surfaces in m, negative while balls overlap.
    force : (T, n-1) array or None
        Contact forces in N, ≥ 0 for repulsion (md only).
    contacts : structured array
        The contact log, see `CONTACT`; empty if ``log=False`` or a file. Of hard spheres it is made when first read.
    status, message : Status, str
        Why the run ended, and the sentence with its numbers.
    stats : dict
        Amount of work and notes of the engine.
    state : dict
        The raw state at the end of a run, from which `granular.edmd.resume` or `granular.md.resume` goes on; empty for
        fixed steps, whose runs cannot be resumed.
    ledger : (T, 5) array or None
        In J since the start, accumulated by the engine where walls are driven or thermal: work of floor and ceiling,
        heat of both, and what was dissipated; see `account`.
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
        held = vars(self)
        if isinstance(self.contacts, tuple):  # see `PublicWhenRead`
            held["settled"] = held.pop("contacts")
        if callable(self.state):
            held["kept"] = held.pop("state")
        for array in (self.time, self.position, self.velocity, self.gap, self.force, held.get("contacts"), self.ledger):
            if array is not None:
                array.flags.writeable = False

    @cached_property
    def by_pair(self) -> tuple[Any, Any]:
        """Numbers of the rows of the contact log, pair by pair in order of time, and where those of each pair begin."""
        return grouped(self.contacts["pair"], self.scene.n_pairs)

    def rows(self, pair: int) -> Any:
        """Numbers of the rows of the contact log that belong to `pair`."""
        order, edge = self.by_pair
        c = pair if type(pair) is int else whole("pair", pair)
        return order[edge[c] : edge[c + 1]] if 0 <= c < len(edge) - 1 else order[:0]

    def of(self, pair: int) -> np.ndarray[tuple[int], np.dtype[np.void]]:
        """Rows of the contact log that belong to `pair`."""
        rows: np.ndarray[tuple[int], np.dtype[np.void]] = self.contacts[self.rows(pair)]
        return rows

    def count(self, pair: int) -> int:
        """Number of contacts of `pair` that began."""
        return len(self.rows(pair))

    def contact_batches(self, size: int = 100_000) -> Iterator[np.ndarray[tuple[int], np.dtype[np.void]]]:
        """Go through the contact log, as in `contacts`, so many rows at a time; also where it is a file.

        Rows of a file (``log="run.npy"``) come in the order in which contacts end, each read when its turn comes.

        Raises
        ------
        OSError, ValueError
            If the file is not there any more, or is no log.
        """
        count = whole("size", size, at_least=1)
        path = self.stats.get("log")
        return batches(mapped(path) if path else self.contacts, count)

    @property
    def first_disturbed(self) -> tuple[float, int]:
        """Time in s at which two neighbouring pairs first overlap at once, and the lower one; up to then every contact
        is isolated. (nan, -1) if there are none, or nobody looked (hard runs do with `watch`, a warning).
        """
        time, pair = self.stats.get("first_disturbed", (math.nan, -1))
        return time, pair

    def momentum(self) -> Array:
        """Total momentum of the balls (walls excluded) in kg m/s, shape (T,)."""
        balls = ~self.scene.is_wall
        return np.asarray(self.velocity[:, balls] @ self.scene.mass[balls])

    def energy(self) -> Array:
        """Energy in J, shape (T,): Σ ½ m v² + Σ m g x - Σ f x + Σ ½ m Ω² y² + Σ U(ξ) over balls and overlaps.

        The elastic energy U(ξ) counts wherever ξ > 0, also while the force is clipped at zero. It is nan at samples
        with a closed contact of a law with memory, whose recoverable energy the overlap alone does not determine.
        """
        balls = ~self.scene.is_wall
        m, v, x = self.scene.mass[balls], self.velocity[:, balls], self.position[:, balls]
        energy: Array = 0.5 * (v * v) @ m + self.scene.gravity * (x @ m)
        if self.scene.external_force is not None:
            energy -= x @ self.scene.external_force[balls]
        if self.scene.pendulum > 0.0:
            off = x - self.scene.at_rest[balls]
            energy += 0.5 * self.scene.pendulum**2 * (off * off) @ m
        if self.law is not None:
            laws = resolved(self.law, self.scene)
            for c in np.flatnonzero(~(self.gap >= 0.0).all(axis=0)).tolist():
                energy += list(map(laws[c].energy, (-self.gap[:, c]).tolist()))
        return energy

    def account(self) -> dict[str, Array]:
        """Where energy and momentum come from, at every row: energy - work - heat + dissipated is constant, and so is
        `momentum` - Σ momentum + Σ (m g - f) t, but for pendula.

        Returns
        -------
        dict
            In J: *energy* (T,), see `energy`; *work* (T, 2) that the first and the last body, if they are walls, have
            done on the balls since the start, ∫ F ẋ_w dt; *heat* (T, 2) that they have given; *dissipated* (T,) in
            contacts. Where walls are driven or thermal each is accumulated by itself, with the rounding of its sum
            carried along; else what is dissipated is what is lost, and work is momentum times the constant speed.
            Under a fixed time step the sum is constant to the order of the method only.

            In N s: *momentum* (T, 2) that these walls have given the balls since the first row, ∫ F dt, upwards
            positive. It is what the balls beyond the wall, up to the widest gap, have gained, without gravity and
            forces, and what the log says has passed that gap: nothing beyond the last ball. So nan only between two
            walls, at rows at which every pair is in contact, without a log, and of hard balls that may have stuck to a
            ceiling; of pendula at rows within a contact at that wall.
        """
        energy, momentum = self.energy(), given_by_walls(self)
        if self.ledger is None:
            speed = np.where(self.scene.is_wall, self.scene.velocity, 0.0)[[0, -1]]
            speed[[motion is not None for motion in self.scene.motions]] = math.nan
            work = np.where(speed == 0.0, 0.0, momentum * speed)
            return {"energy": energy, "work": work, "heat": np.zeros((len(energy), 2)), "momentum": momentum,
                    "dissipated": energy[0] - energy + work.sum(axis=1)}
        return {"energy": energy, "work": self.ledger[:, :2], "heat": self.ledger[:, 2:4], "momentum": momentum,
                "dissipated": self.ledger[:, 4]}

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw the paths of the balls over time, radii taken out, with all contacts marked; return the figure, or save
        it to `path`. Contacts that fill a small part of the run only are drawn once more by themselves.

        Parameters
        ----------
        path : str or path, optional
            A file whose ending matplotlib knows, such as ``.png``.

        Raises
        ------
        ModuleNotFoundError, OSError, ValueError
            If matplotlib is not installed; if the file cannot be written, or has no ending that matplotlib knows;
            if the run has too few rows for its paths.

        Notes
        -----
        Paths of hard spheres are exact under constant forces: they follow from the contact log. Long contacts, pendula,
        shaken walls and runs without a log need rows, ``samples=np.linspace(0.0, end, 1000)`` or the like.
        """
        from granular.run import figures

        return figures.plot(self, path)

    def animate(self, path: str | PathLike[str], seconds: float = 7.0, fps: int = 25) -> None:
        """Write a film of the run, of its contacts if they are a small part of it; of at most 60 balls.

        Parameters
        ----------
        path : str or path
            A file that ends in ``.gif``, or in ``.mp4``, which needs ffmpeg.
        seconds : float, optional
            How long the film is in s, positive.
        fps : int, optional
            Pictures per second.

        Raises
        ------
        ModuleNotFoundError, OSError, ValueError
            If matplotlib is not installed, or the file cannot be written; for too many balls, another ending, or
            a run with too few rows, see `plot`.
        """
        from granular.run import films

        films.animate(self, path, seconds, fps)

    def save(self, path: str | PathLike[str], *, compressed: bool = False) -> None:
        """Write the run to one file in the format of its ending, whole or not at all.

        ``.npz`` and ``.nc`` (netCDF, extra ``sweep``) hold everything: `load` reads them back, bit for bit. ``.csv``
        is the contact log as `to_frame` has it, ``.extxyz`` the rows, for OVITO and ASE: balls on the x axis, walls as
        numbers ``floor`` and ``ceiling`` of each frame. All digits are written, in SI units.

        Of the log of a hard run only its own columns are written to ``.npz``, 52 bytes a collision; `load` derives the
        others. A file that is `compressed` is smaller, by a third or more, and takes some twenty times as long.

        Force laws and rules of this package are stored with their numbers; your own by name only. The path of a wall
        that a function of yours moves is stored as far as the run goes.
        """
        from granular.run import tables

        tables.save(path, self, compressed)

    def to_xarray(self) -> Any:
        """Rows and contacts as an `xarray.Dataset` (extra ``sweep``), with units, scene, law and versions in its attrs.

        Dimensions are *time*, *body*, *pair*, *contact*, and *side* (lower, upper); the pair of a contact is
        ``contact_pair``. By xarray's own writers it becomes netCDF or zarr.
        """
        from granular.run import tables

        return tables.dataset(self)

    def to_frame(self, what: str = "contacts") -> Any:
        """The contacts, or the samples, as a `pandas.DataFrame` (extra ``sweep``) of flat columns, in SI units.

        Of contacts *pair*, *t_begin*, *t_end*, *duration*, *v_in_lower*, *v_in_upper*, …; of samples *time*,
        *position_0*, …, *velocity_0*, …, *gap_0*, … and, of soft spheres, *force_0*, ….
        """
        from granular.run import tables

        return tables.frame(self, what)

    @classmethod
    def from_arrays(
        cls, scene: Scene, time: Any, *, position: Any = None, gap: Any = None, velocity: Any
    ) -> Trajectory:
        """Make a run of what another program has computed, to be drawn, written, or held against both engines.

        Parameters
        ----------
        scene : Scene
            What it started from.
        time : (T,) array
            In s, not decreasing.
        position, velocity : (T, n) arrays
            Of all bodies, walls too, from the bottom up, in m and m/s; instead of positions the
        gap : (T, n-1) array, (T, n) on a ring
            between surfaces in m.

        Raises
        ------
        TypeError, ValueError
            With a sentence, if shapes do not fit, times decrease, or a number is not finite.

        Notes
        -----
        It has rows only: no law, no rule, no forces, no state, and an empty log, for when contacts began and ended is
        not known from rows; its energy is without that of overlaps.
        """
        from granular.run import tables

        parts = tables.of_arrays(scene, time, position, gap, velocity)
        return cls(**parts, law=None, rule=None, force=None, contacts=np.zeros(0, CONTACT), status=Status.time,
                   message="numbers from elsewhere: rows only, no contact log", stats={"contacts": math.nan})

    @classmethod
    def load(cls, path: str | PathLike[str], law: Any = None, rule: Any = None) -> Trajectory:
        """Read a trajectory that `save` wrote.

        Parameters
        ----------
        path : str or path
            The ``.npz`` or ``.nc`` file.
        law, rule : optional
            In place of the stored ones; needed where they were your own.

        Raises
        ------
        OSError, TypeError, ValueError
            If the file cannot be read, is not a trajectory, one of a later version, or one that was changed after it
            was saved; if it holds a law or rule of your own and none is given.

        Notes
        -----
        Nothing in a file is run: laws, rules and walls are made of a closed list, from their numbers. The message is
        read without control characters, up to 500 characters of it.
        """
        from granular.run import saved_run

        read = saved_run.read(path, law, rule, Status.__members__, CONTACT)
        return cls(**read | {"status": Status[read["status"]]})

    def _repr_html_(self) -> str:
        from granular._engine.reports import abridged, html
        end = zip(self.position[-1].tolist(), self.velocity[-1].tolist(), strict=True)
        rows = [[str(i), f"{x:.6g}", f"{v:.6g}"] for i, (x, v) in enumerate(end)]
        return html(repr(self), [["body", "position / m", "velocity / (m/s)"], *abridged(rows)])

    def __repr__(self) -> str:
        engine = "edmd" if self.rule is not None else "md" if self.law is not None else "from elsewhere"
        return (f"Trajectory({engine}, {self.scene}, t = {self.time[0]:g} … {self.time[-1]:.6g} s, "
                f"{len(self.contacts)} contacts, {self.status.name}: {self.message})")


EARLY = (Status.collapse, Status.bounded, Status.max_events, Status.unstable, Status.broken)
"""Statuses of runs that did not get to their end: nothing is claimed of what they would have come to."""


def points(run: Trajectory) -> Array:
    """Positions in m of the same bodies with their radii taken out, from 0 on, shape (T, n): touching ones coincide."""
    return scene_points(run.scene, run.gap, run.position)


load = Trajectory.load

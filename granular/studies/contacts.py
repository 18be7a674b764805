"""Contact lists of runs in three dimensions, and deviation from hard spheres.

A contact of a soft run acts like a collision of hard spheres if it is short and undisturbed. For gases, two numbers
estimate the relative error of means: s = π⟨ξ_max⟩/(R₁ + R₂), with the largest overlap ξ_max of each contact, and Z, the
mean number of contacts of a particle. Cooling rate, energy loss, collisional pressure and number of collisions differ
by at most about B = s + Z/2. The estimate is calibrated on homogeneous gases of frictionless spheres without cohesion.
It is not certified, unlike a `granular.Answer`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular._engine.check import Array
from granular._engine.reports import Report, number, percent
from granular.studies import contact_files, contact_lists
from granular.studies.contact_files import read_csv, read_lammps, snapshots
from granular.studies.contact_lists import Bools, Ints

__all__ = ["Contacts", "analyse", "read_csv", "read_lammps", "snapshots"]
__dir__ = __all__.copy

MAX_DEVIATION = 0.01
"""Deviation B below which means agree with hard spheres."""
GAS_OCCUPATION, GAS_DURATION = 0.5, 1.5
"""Largest Z of a gas, and largest mean duration relative to undisturbed contacts."""
CALIBRATION = ("B is calibrated on homogeneous gases of frictionless spheres without cohesion, and not certified. "
               "Particles are not compared one by one.")


@signature.face
@dataclass(frozen=True, eq=False, repr=False)
class Contacts(Report):
    """Result of `analyse`. Arrays are in the order of the list.

    Attributes
    ----------
    particles : int
        Number of particles, without walls.
    occupation : float
        Z, the mean number of contacts of a particle.
    relative_overlap : float
        Mean ratio of largest overlap to R₁ + R₂. nan if unknown.
    disturbed : (n,) array of bool
        Whether another contact of one of the two particles overlaps with the contact in time.
    shared_impulse : float
        Fraction of the impulse that is exchanged during another contact of one of the particles. The force of a contact
        is assumed to be a half sine. Without impulses, all contacts have the same weight.
    durations : (n,) array
        Durations of the contacts in s. Contacts without an end last until the end of the run.
    isolated_duration : float
        Median duration in s of undisturbed contacts, t_c. nan without such contacts.
    free_times : array
        Times in s between the end of all contacts of a particle and its next contact, particle by particle.
    clusters : dict of int to int
        Number of clusters by number of contacts. Contacts that disturb each other belong to one cluster.
    n_open : int
        Number of contacts without an end.
    notes : tuple of str
        Sentences about contacts that are missing or ignored.
    """

    particles: int
    occupation: float
    relative_overlap: float
    disturbed: Bools
    shared_impulse: float
    durations: Array
    isolated_duration: float
    free_times: Array
    clusters: dict[int, int]
    n_open: int
    notes: tuple[str, ...]

    @property
    def disturbed_share(self) -> float:
        """Fraction of contacts that are disturbed by another contact of the same particle."""
        return float(self.disturbed.mean())

    @property
    def deviation(self) -> float:
        """B = π⟨ξ_max⟩/(R₁ + R₂) + Z/2, the estimated largest relative error of means.

        nan if the overlap is unknown.
        """
        return math.pi * self.relative_overlap + 0.5 * self.occupation

    @property
    def relative_duration(self) -> float:
        """Mean duration over `isolated_duration`, nan without undisturbed contacts."""
        return float(self.durations.mean()) / (self.isolated_duration or math.nan)

    @property
    def statement(self) -> str:
        """Sentence about the agreement of means with hard spheres."""
        if self.occupation > GAS_OCCUPATION or self.relative_duration > GAS_DURATION:
            return "Many contacts last: this is not a gas, and hard spheres cannot replace it."
        if math.isnan(self.deviation):
            return f"B is at least Z/2 = {percent(0.5 * self.occupation)}. Give the largest overlaps and R₁ + R₂ to "\
                   "estimate how far means deviate from hard spheres."
        return "Means " + ("agree with hard spheres within" if self.deviation < MAX_DEVIATION else
                           "differ from hard spheres by up to") + f" about {percent(self.deviation)}."

    def __str__(self) -> str:
        return "\n".join([
            f"{self.statement} Z = {number(self.occupation, '.4g')} contacts per particle, s = "
            f"{number(math.pi * self.relative_overlap, '.3g')}, B = s + Z/2 = {number(self.deviation, '.3g')}.",
            f"{percent(self.disturbed_share)} of {len(self.disturbed)} contacts of {self.particles} particles are "
            f"disturbed, {percent(self.shared_impulse)} of the impulse is shared, and the largest cluster has "
            f"{_counted(max(self.clusters))}. Relative to undisturbed contacts, the mean duration is "
            f"{number(self.relative_duration, '.3g')}.",
            CALIBRATION, *self.notes])

    def _numbers(self) -> dict[str, Any]:
        return vars(self) | {"disturbed": self.disturbed_share, "durations": self.durations.mean(), "free_times":
                             self.free_times.mean() if len(self.free_times) else math.nan, "deviation": self.deviation,
                             "statement": self.statement}


@signature.face
def analyse(i: ArrayLike, j: ArrayLike, begin: ArrayLike, end: ArrayLike, *, impulse: ArrayLike | None = None,
            overlap: ArrayLike | None = None, distance: ArrayLike | None = None, particles: int | None = None,
            span: float | Sequence[float] | None = None, walls: Sequence[int] = (), notes: Sequence[str] = ()
            ) -> Contacts:
    """Analyse the list of all contacts of a run, of any program and in any dimension.

    Parameters
    ----------
    i, j : (n,) array of int
        Numbers of the two particles of each contact.
    begin, end : (n,) array
        Onset and end in s. An end of nan is a contact that lasts until the end of the run.
    impulse : (n,) array, optional
        Impulse of each contact in N s.
    overlap : (n,) array, optional
        Largest overlap of each contact in m. It is ignored without `distance`.
    distance : float or (n,) array, optional
        R₁ + R₂ in m.
    particles : int, optional
        Number of particles of the run, without walls. Defaults to the number of particles with a contact.
    span : float or (float, float), optional
        Start and end of the run in s. A single number is the end of a run that starts at 0. Defaults to the first onset
        and the last onset or end. Give it if contacts have no end, because their durations depend on it.
    walls : sequence of int
        Numbers of bodies in `i` and `j` that are walls. Contacts with the same wall do not disturb each other. Defaults
        to none.
    notes : sequence of str
        Sentences about the list that the report repeats, such as the notes of `read_lammps`. Defaults to none.

    Returns
    -------
    Contacts
        Numbers of the run. They print as a paragraph.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, if a contact is outside `span`, or if two contacts of one pair overlap in time.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.contacts.analyse([0, 1, 3], [1, 2, 4], [0.0, 0.5, 0.0], [1.0, 1.5, 1.0], particles=5)
    >>> round(found.disturbed_share, 6), round(found.shared_impulse, 6), found.clusters, round(found.occupation, 6)
    (0.666667, 0.333333, {1: 1, 2: 1}, 0.8)
    """
    onset, shape = check.array("begin", begin, finite="a finite time"), np.shape(begin)
    stop = check.array("end", end, shape)
    check.every("end", stop, np.isnan(stop) | (stop >= onset) & (stop < math.inf), "a finite time not before the begin")
    push = check.array("impulse", np.ones(shape) if impulse is None else impulse, shape)
    start, final = _span(span, onset, stop)
    is_open, stop = np.isnan(stop), np.where(np.isnan(stop), final, stop)
    check.every("begin", onset, (onset <= final) & (stop >= start), f"within the span from {start:g} to {final:g}")
    check.every("impulse", push, (push >= 0.0) & (push < math.inf), "a finite number of at least 0")
    # the order of simultaneous onsets matters for instantaneous contacts only
    order = np.lexsort((stop, onset)) if (stop == onset).any() else np.argsort(onset)
    bodies, onset, stop, push = contact_files.particles(i, j, shape)[:, order], onset[order], stop[order], push[order]
    at_wall = np.isin(bodies, check.array("walls", walls))
    _refuse_simultaneous(bodies - bodies.min(), onset, stop)
    particle, contact, is_first, latest = contact_lists.sides(bodies - bodies.min(), stop, at_wall)
    found = int(is_first.sum() - at_wall.sum())
    count = check.integer("particles", found if particles is None else particles, at_least=max(found, 1))
    pause = np.where(is_first, 0.0, onset[contact] - stop[latest])
    links, disturbed, durations = pause < 0.0, np.zeros(shape, np.bool_), np.empty(shape)
    disturbed[order[np.concatenate([contact[links], latest[links]])]] = True
    durations[order] = stop - onset
    sizes = np.bincount(contact_lists.clusters(len(order), contact[links], latest[links]))
    size, number_of = np.unique(sizes[sizes > 0], return_counts=True)
    # disturbed instantaneous contacts share their whole impulse
    swept = disturbed[order] & (stop > onset)
    kept = swept[contact]
    alone = push[~disturbed[order]].sum() + contact_lists.unshared_impulse(
        onset[swept], stop[swept], push[swept], particle[kept], (np.cumsum(swept) - 1)[contact[kept]])
    within = (np.minimum(stop, final) - np.maximum(onset, start)) * (2 - at_wall.sum(axis=0))
    lone = f"Particles without a contact are unknown, so Z is a mean over the {found} particles of the list."
    return Contacts(
        count, float(within.sum()) / (count * (final - start)), _relative_overlap(overlap, distance, shape), disturbed,
        max(1.0 - float(alone) / (float(push.sum()) or math.nan), 0.0), durations,
        math.nan if disturbed.all() else float(np.median(durations[~disturbed])), pause[pause > 0.0],
        dict(zip(size.tolist(), number_of.tolist(), strict=True)), int(is_open.sum()),
        (*check.several("notes", notes, "a sentence, or several"), *[lone] * (particles is None),
         *[f"{_counted(int(is_open.sum()))} without an end."] * bool(is_open.any())))


def _counted(n: int) -> str:
    """Return a number of contacts as text."""
    return f"{n} contact{'s' * (n != 1)}"


def _span(span: float | Sequence[float] | None, begin: Array, end: Array) -> tuple[float, float]:
    """Return start and end of the run in s."""
    if not len(begin):
        raise ValueError(check.must("begin", "an array of at least one contact", "an empty array"))
    whole = [begin.min(), np.nanmax(np.concatenate([begin, end]))] if span is None else span
    whole = [0.0, whole] if check.is_single(whole) else whole
    start, final = check.array("span", whole, (2,), finite="a finite time").tolist()
    if not start < final:
        raise ValueError(check.must("span", "a start and a later end", f"{start:g} and {final:g}"))
    return start, final


def _refuse_simultaneous(bodies: Ints, begin: Array, end: Array) -> None:
    """Raise `ValueError` if two contacts of a pair overlap in time."""
    pair = bodies.min(axis=0) * (bodies.max() + 1) + bodies.max(axis=0)
    order = np.argsort(pair, kind="stable")
    again = order[1:][(np.diff(pair[order]) == 0) & (begin[order[1:]] < end[order[:-1]])]
    if len(again):
        raise ValueError("The contacts of a pair must not overlap in time, got a second contact at "
                         f"{begin[again].min():.6g}. List each contact once.")


def _relative_overlap(overlap: ArrayLike | None, distance: ArrayLike | None, shape: tuple[int, ...]) -> float:
    """Return the mean of overlap over distance, or nan if one of them is not given."""
    if distance is None:
        return math.nan
    lengths = check.positive("distance", np.full(shape, distance) if check.is_single(distance) else distance,
                             "distance", shape=shape)
    if overlap is None:
        return math.nan
    depth = check.array("overlap", overlap, shape)
    check.every("overlap", depth, (depth >= 0.0) & (depth < lengths), "of at least 0 and less than `distance`")
    return float((depth / lengths).mean())

"""Small-amplitude waves in a chain under a static force: bands, gaps and decay.

For small oscillations about the equilibrium, contacts act as linear springs. The stiffness of a contact is its tangent
stiffness K = dF/dξ under the static force F₀. For Hertz's law F = A ξ^(3/2) it is (3/2) A^(2/3) F₀^(1/3). A chain is
described by one unit cell: the masses of its balls, and the stiffness of the contact between each ball and the next
ball. The last contact connects to the next cell. Damping is ignored.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular.laws import MatchedEnd
from granular.laws.kinds import resolved
from granular.laws.springs import stiffness_at
from granular.scene import Scene, checked

MAX_FREQUENCY = 1e100
"""Angular frequency in rad/s above which squares leave the range of floats."""


@signature.face
def stiffness(scene: Scene, law: Any) -> check.Array:
    """Return the tangent stiffness of every contact of a scene.

    Parameters
    ----------
    scene : Scene
        A scene with overlaps, such as `granular.scenes.compressed_chain`.
    law : force law or sequence of force laws
        One law for all pairs, or one per pair.

    Returns
    -------
    (n-1,) array
        K = dF/dξ in N/m at the overlaps of the scene, 0 for pairs without contact.
    """
    kind, each = resolved(check.per_pair("law", law, checked(scene).n_pairs), scene).in_pairs
    contacts = list(zip(kind.tolist(), scene.gap.tolist(), strict=True))
    stiffnesses = {(k, gap): stiffness_at(each[k], -gap) for k, gap in dict.fromkeys(contacts)}
    return np.array([stiffnesses[contact] for contact in contacts])


@signature.face
def dispersion(phase: ArrayLike, stiffness: float | ArrayLike, mass: float | ArrayLike) -> check.Array:
    """Return the angular frequencies of waves in an infinite chain.

    With one ball per cell, ω = 2 √(K/m) |sin(θ/2)|. With two balls of masses m and M, ω² = K (1/m + 1/M) ± K √((1/m +
    1/M)² - 4 sin²(θ/2)/(m M)). In general, the values of ω² are the eigenvalues of a Hermitian matrix. The frequencies
    ω are computed as the singular values of a factor of this matrix.

    Parameters
    ----------
    phase : float or array
        Phase difference θ in rad between neighbouring cells: wave number times length of a cell.
    stiffness, mass : float or (p,) arrays
        Stiffness in N/m and mass in kg of one unit cell of p balls. One number applies to all p.

    Returns
    -------
    (…, p) array
        ω in rad/s, one frequency per branch, with the lowest branch first. The dimensions of `phase` precede.
    """
    k, m = _cell(stiffness, mass)
    theta, p = check.array("phase", phase, ..., finite="a finite angle in rad"), len(m)
    strain = np.zeros((*theta.shape, p, p), dtype=np.complex128)  # overlaps for unit displacements
    for j in range(p):
        strain[..., j, j] += 1.0 / math.sqrt(m[j])
        strain[..., j, (j + 1) % p] -= np.exp(1j * theta * (j == p - 1)) / math.sqrt(m[(j + 1) % p])
    return np.asarray(np.linalg.svd(np.sqrt(k)[:, None] * strain, compute_uv=False)[..., ::-1])


@signature.face
def band_edges(stiffness: float | ArrayLike, mass: float | ArrayLike) -> check.Array:
    """Return the lower and the upper edge of every frequency band of a chain.

    Waves with frequencies between two bands do not propagate.

    Parameters
    ----------
    stiffness, mass : float or (p,) arrays
        Unit cell, see `dispersion`. For balls of masses m < M and one stiffness the bands are 0 … √(2K/M) and √(2K/m) …
        √(2K (1/m + 1/M)).

    Returns
    -------
    (p, 2) array
        Edges in rad/s.
    """
    k, m = _cell(stiffness, mass)
    edges = np.sort(dispersion([0.0, math.pi], k, m).T, axis=1)
    edges[0, 0] = 0.0  # the chain as a whole moves freely
    return edges


@signature.face
def decay(omega: float | ArrayLike, stiffness: float | ArrayLike, mass: float | ArrayLike) -> Any:
    """Return the factor by which a wave of angular frequency ω decays per ball.

    It is 1 in a frequency band and less than 1 outside the bands. With one ball per cell it is exp(-2 acosh(ω/ω_c))
    above ω_c = 2 √(K/m). For larger cells the geometric mean over one cell is returned.

    Parameters
    ----------
    omega : float or array
        ω in rad/s, not negative.
    stiffness, mass : float or (p,) arrays
        Unit cell, see `dispersion`.

    Returns
    -------
    float or array
        The amplitude ratio, with the shape of `omega`.
    """
    k, m = _cell(stiffness, mass)
    w = check.array("omega", omega, ...)
    check.every("omega", w.ravel(), ((w >= 0.0) & (w <= MAX_FREQUENCY)).ravel(),
                 f"an angular frequency in [0, {MAX_FREQUENCY:g}] rad/s")
    matrix, log_scale = np.broadcast_to(np.eye(2), (*w.shape, 2, 2)), np.zeros(w.shape)
    for k_j, m_j in zip(k.tolist(), m.tolist(), strict=True):  # transfer matrix of displacement and force
        step = np.zeros((*w.shape, 2, 2))
        step[..., 0, 0], step[..., 0, 1] = 1.0 - m_j * w * w / k_j, 1.0 / k_j
        step[..., 1, 0], step[..., 1, 1] = -m_j * w * w, 1.0
        matrix = step @ matrix
        size = np.abs(matrix).max(axis=(-2, -1))  # scaled out: the product over hundreds of balls would overflow
        matrix, log_scale = matrix / size[..., None, None], log_scale + np.log(size)
    unit = np.exp(-log_scale)
    # rounding can put half the trace slightly below 1, where acosh is not real
    half_trace = np.maximum(0.5 * np.abs(matrix[..., 0, 0] + matrix[..., 1, 1]), unit)
    return np.exp(-(log_scale + np.log(half_trace + np.sqrt((half_trace - unit) * (half_trace + unit)))) / len(m))[()]


@signature.face
def sound_speed(stiffness: float | ArrayLike, mass: float | ArrayLike, length: float) -> float:
    """Return the speed in m/s of waves much longer than a cell.

    It is L / √(Σ m Σ 1/K) with sums over one cell. For equal balls it is 2R √(K/m).

    Parameters
    ----------
    stiffness, mass : float or (p,) arrays
        Unit cell, see `dispersion`.
    length : float
        Length L of the cell in m, for equal balls 2R.
    """
    k, m = _cell(stiffness, mass)
    return check.number("length", length, above=0.0) / math.sqrt(float(m.sum() * (1.0 / k).sum()))


@signature.face
def modes(scene: Scene, law: Any) -> check.Array:
    """Return the angular frequencies of the normal modes of a whole chain at rest.

    Parameters
    ----------
    scene, law
        As for `stiffness`. Pairs without contact exert no force, and damping is ignored.

    Returns
    -------
    (balls,) array
        ω in rad/s, ascending, one per ball.
    """
    k, balls = stiffness(scene, law), ~scene.is_wall
    m = scene.mass[balls]
    strain = scene.across(np.eye(scene.n)[balls])  # change of the gaps for a unit displacement of each ball
    of_contacts = np.linalg.eigvalsh(strain * k @ strain.T / np.sqrt(np.outer(m, m)))
    return np.asarray(np.sqrt(np.maximum(of_contacts, 0.0) + scene.pendulum**2))  # pendula add Ω² to ω²


@signature.face
def crossing_time(scene: Scene, law: Any) -> float:
    """Return the time in s in which a long wave crosses the balls in contact.

    For balls that are connected by contacts, the time is √(Σ m Σ 1/K). If the scene has several separate groups of
    connected balls, the longest time is returned. Without any contact the result is inf.
    """
    k = stiffness(scene, law)
    closed = k > 0.0
    pile = np.append(0, np.cumsum(~closed))  # set of each body, on a ring the first repeated
    pile[scene.ring & (pile == pile[-1])] = 0
    masses = np.bincount(pile[: scene.n], np.where(scene.is_wall, 0.0, scene.mass))
    times = np.bincount(pile[:-1][closed], 1.0 / k[closed], len(masses)) * masses
    return math.sqrt(float(times.max())) or math.inf


@signature.face
def matched_end(scene: Scene, law: Any) -> list[Any]:
    """Return the force laws of a chain, with a last law that absorbs long waves.

    Parameters
    ----------
    scene, law
        As for `stiffness`: a chain at rest whose last body is a wall.

    Returns
    -------
    list
        One law per pair. The last one is a `granular.MatchedEnd` for the force at the wall and the stiffness of the
        contact before it. In a chain of two masses the ball at the wall does not have the mean mass, so the match is
        approximate.
    """
    laws = resolved(check.per_pair("law", law, checked(scene).n_pairs), scene)
    if not scene.is_wall[-1] or scene.n_pairs < 2 or not (scene.gap[-2:] < 0.0).all():
        raise ValueError("`scene` must be a chain at rest that is pressed against a wall as its last body, got "
                         f"{scene}.")
    load = laws[scene.n_pairs - 1].force(-float(scene.gap[-1]), 0.0, -float(scene.gap[-1]))
    return [*laws.given[:-1], MatchedEnd(load, float(stiffness(scene, law)[-2]))]


def _cell(stiffness: float | ArrayLike, mass: float | ArrayLike) -> tuple[check.Array, check.Array]:
    """Return checked stiffnesses in N/m and masses in kg of a cell, shapes (p,)."""
    arguments = ("stiffness", stiffness, "Without compression a chain has no linear waves."), ("mass", mass, "")
    k, m = (check.positive(name, np.atleast_1d(check.array(name, value, ...)), name, fix)
            for name, value, fix in arguments)
    if len(k) != len(m) and 1 not in (len(k), len(m)):
        raise ValueError(f"`stiffness` and `mass` must have one entry each per ball of a cell, got {len(k)} and "
                         f"{len(m)} entries.")
    k, m = np.broadcast_arrays(k, m)
    return k, m

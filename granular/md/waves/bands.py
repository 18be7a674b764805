"""Small waves in a chain under a static force: frequencies, bands, decay in a gap.

Small swings of a chain at rest see springs: the tangent stiffness K = dF/dξ of every contact under its static force F₀,
which is (3/2) A^(2/3) F₀^(1/3) under Hertz's law F = A ξ^(3/2). A chain is described by one unit cell: the masses of
its balls, and the stiffness of the contact from each to the next, for the last that to the next cell. Damping is left
out.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check
from granular.laws import MatchedEnd
from granular.laws.kinds import resolved
from granular.laws.springs import stiffness_at
from granular.scene import Scene, checked

FASTEST = 1e100
"""Angular frequency in rad/s above which squares are beyond the range of numbers."""


@check.face
def stiffness(scene: Scene, law: Any) -> check.Array:
    """Return the stiffness K = dF/dξ in N/m of every contact at the overlaps of a scene, shape (n-1,); 0 where it is
    open.

    Parameters
    ----------
    scene : Scene
        Such as `granular.scenes.compressed_chain`.
    law : force law or sequence of them
        One for all pairs, or one per pair.
    """
    kind, each = resolved(check.per_pair("law", law, checked(scene).n_pairs), scene).in_pairs
    contacts = list(zip(kind.tolist(), scene.gap.tolist(), strict=True))
    found = {(k, gap): stiffness_at(each[k], -gap) for k, gap in dict.fromkeys(contacts)}
    return np.array([found[contact] for contact in contacts])


@check.face
def dispersion(phase: ArrayLike, stiffness: float | ArrayLike, mass: float | ArrayLike) -> check.Array:
    """Return the angular frequencies ω in rad/s of waves in an endless chain, lowest branch first.

    One ball to a cell: ω = 2 √(K/m) |sin(θ/2)|. Two of masses m and M: ω² = K (1/m + 1/M) ± K √((1/m + 1/M)² -
    4 sin²(θ/2)/(m M)). More: eigenvalues of a Hermitian matrix.

    Parameters
    ----------
    phase : float or array
        θ in rad from cell to cell: wave number times length of a cell.
    stiffness, mass : float or (p,) arrays
        Of one unit cell of p balls, in N/m and kg; one number stands for all p.

    Returns
    -------
    (…, p) array
        One frequency for each branch.
    """
    k, m = _cell(stiffness, mass)
    theta, p = check.array("phase", phase, ..., finite="finite angles in rad are needed"), len(m)
    strain = np.zeros((*theta.shape, p, p), dtype=np.complex128)  # overlaps of the contacts for balls that move by 1
    for j in range(p):
        strain[..., j, j] += 1.0 / math.sqrt(m[j])
        strain[..., j, (j + 1) % p] -= np.exp(1j * theta * (j == p - 1)) / math.sqrt(m[(j + 1) % p])
    return np.asarray(np.linalg.svd(np.sqrt(k)[:, None] * strain, compute_uv=False)[..., ::-1])


@check.face
def band_edges(stiffness: float | ArrayLike, mass: float | ArrayLike) -> check.Array:
    """Return lower and upper edge in rad/s of every band, shape (p, 2); between two bands nothing is carried on.

    Parameters
    ----------
    stiffness, mass : float or (p,) arrays
        Of one unit cell, see `dispersion`. Of balls of masses m < M and one stiffness: 0 … √(2K/M) and
        √(2K/m) … √(2K (1/m + 1/M)).
    """
    k, m = _cell(stiffness, mass)
    edges = np.sort(dispersion([0.0, math.pi], k, m).T, axis=1)
    edges[0, 0] = 0.0  # the chain as a whole moves freely
    return edges


@check.face
def decay(omega: float | ArrayLike, stiffness: float | ArrayLike, mass: float | ArrayLike) -> Any:
    """Return by which factor a wave of angular frequency ω shrinks from ball to ball: 1 in a band, below 1 in a gap.

    One ball to a cell: exp(-2 acosh(ω/ω_c)) above ω_c = 2 √(K/m). Of larger cells the geometric mean over one.

    Parameters
    ----------
    omega : float or array
        ω in rad/s, not negative.
    stiffness, mass : float or (p,) arrays
        Of one unit cell, see `dispersion`.
    """
    k, m = _cell(stiffness, mass)
    w = check.array("omega", omega, ...)
    check.every("omega", w.ravel(), ((w >= 0.0) & (w <= FASTEST)).ravel(),
                 f"an angular frequency from 0 to {FASTEST:g} rad/s is needed")
    cell, grown = np.broadcast_to(np.eye(2), (*w.shape, 2, 2)), np.zeros(w.shape)
    for stiff, heavy in zip(k.tolist(), m.tolist(), strict=True):  # of displacement and force, from ball to ball
        step = np.zeros((*w.shape, 2, 2))
        step[..., 0, 0], step[..., 0, 1] = 1.0 - heavy * w * w / stiff, 1.0 / stiff
        step[..., 1, 0], step[..., 1, 1] = -heavy * w * w, 1.0
        cell = step @ cell
        size = np.abs(cell).max(axis=(-2, -1))  # taken out: over hundreds of balls it is beyond all numbers
        cell, grown = cell / size[..., None, None], grown + np.log(size)
    one = np.exp(-grown)
    turn = np.maximum(0.5 * np.abs(cell[..., 0, 0] + cell[..., 1, 1]), one)
    return np.exp(-(grown + np.log(turn + np.sqrt((turn - one) * (turn + one)))) / len(m))[()]


@check.face
def sound_speed(stiffness: float | ArrayLike, mass: float | ArrayLike, length: float) -> float:
    """Return the speed in m/s of waves much longer than a cell: L / √(Σ m Σ 1/K), of equal balls 2R √(K/m).

    Parameters
    ----------
    stiffness, mass : float or (p,) arrays
        Of one unit cell, see `dispersion`.
    length : float
        Length L of the cell in m, for equal balls 2R.
    """
    k, m = _cell(stiffness, mass)
    return check.number("length", length, above=0.0) / math.sqrt(float(m.sum() * (1.0 / k).sum()))


@check.face
def modes(scene: Scene, law: Any) -> check.Array:
    """Return the angular frequencies in rad/s of the small swings of a whole chain at rest, one per ball, ascending.

    Parameters
    ----------
    scene, law
        As for `stiffness`. Contacts that are open bear nothing; damping is left out.
    """
    k, balls = stiffness(scene, law), ~scene.is_wall
    m = scene.mass[balls]
    strain = scene.across(np.eye(scene.n)[balls])  # rows: balls
    of_contacts = np.linalg.eigvalsh(strain * k @ strain.T / np.sqrt(np.outer(m, m)))
    return np.asarray(np.sqrt(np.maximum(of_contacts, 0.0) + scene.pendulum**2))  # strings pull all balls alike


@check.face
def crossing_time(scene: Scene, law: Any) -> float:
    """Return the time in s that a slow wave takes through balls at rest that press on each other; inf if none do.

    It is √(Σ m Σ 1/K) over them; where there are several such piles, the longest.
    """
    k = stiffness(scene, law)
    closed = k > 0.0
    pile = np.append(0, np.cumsum(~closed))  # of each body, and on a ring of the first one again
    pile[scene.ring & (pile == pile[-1])] = 0
    masses = np.bincount(pile[: scene.n], np.where(scene.is_wall, 0.0, scene.mass))
    times = np.bincount(pile[:-1][closed], 1.0 / k[closed], len(masses)) * masses
    return math.sqrt(float(times.max())) or math.inf


@check.face
def matched_end(scene: Scene, law: Any) -> list[Any]:
    """Return the laws of a chain between walls with the last one replaced: slow waves do not come back from there.

    Parameters
    ----------
    scene, law
        As for `stiffness`: a chain at rest whose last body is a wall.

    Returns
    -------
    list
        One law per pair, the last a `granular.MatchedEnd` for the force at the wall, and the stiffness of the contact
        before it. In a chain of two masses its mass is not the mean one: the match is rough.
    """
    laws = resolved(check.per_pair("law", law, checked(scene).n_pairs), scene)
    if not scene.is_wall[-1] or scene.n_pairs < 2 or not (scene.gap[-2:] < 0.0).all():
        raise ValueError(f"scene is {scene}: a chain at rest that is pressed against a wall as its last body is "
                         "needed.")
    load = laws[scene.n_pairs - 1].force(-float(scene.gap[-1]), 0.0, -float(scene.gap[-1]))
    return [*laws.given[:-1], MatchedEnd(load, float(stiffness(scene, law)[-2]))]


def _cell(stiffness: float | ArrayLike, mass: float | ArrayLike) -> tuple[check.Array, check.Array]:
    given = ("stiffness", stiffness, "a chain that is not pressed bears no small waves"), ("mass", mass, "")
    k, m = (check.positive(name, np.atleast_1d(check.array(name, one, ...)), name, fix) for name, one, fix in given)
    if len(k) != len(m) and 1 not in (len(k), len(m)):
        raise ValueError(f"stiffness has {len(k)} entries and mass {len(m)}: one of each for every ball of a cell.")
    k, m = np.broadcast_arrays(k, m)
    return k, m

"""Rows of balls that are struck, compressed, or hang side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.callables import function_of
from granular.cases.scenes.falling import count_of, gaps_of, geometric_masses, mass_of, radius_of
from granular.laws.kinds import resolved
from granular.scene import Scene, in_order


@signature.face
def newtons_cradle(
    n: int = 5, moving: int = 1, gap: float | Sequence[float] = 0.0, speed: float = 1.0, mass: float = 1.0,
    density: float = 7800.0,
) -> Scene:
    """Newton's cradle: equal balls in a row, some of which arrive from the left.

    There is no gravity along the row.

    Parameters
    ----------
    n : int
        Number of balls, at least 2.
    moving : int
        Number of arriving balls, fewer than `n`.
    gap : float or floats
        Distances between the surfaces in m: one, or n-1 left to right. 0 means touching balls: the outcome of hard
        spheres then depends on the tie rule for simultaneous collisions (``ties``).
    speed : float
        Speed of the arriving balls in m/s.
    mass : float
        Mass of a ball in kg.
    density : float
        Density in kg/m³ (steel), which determines the radius.
    """
    count = count_of(n, 2)
    fix = "At least one ball has to be at rest."
    arriving = check.integer("moving", moving, at_least=1, at_most=count - 1, fix=fix)
    return _in_a_row(np.full(count, check.number("mass", mass, above=0.0)), arriving, speed, gap, density)


@signature.face
def pendulum_cradle(
    n: int = 5, moving: int = 1, amplitude: float = 0.05, rest_gap: float | Sequence[float] = 0.0, length: float = 1.0,
    mass: float = 1.0, density: float = 7800.0, gravity: float = 9.81,
) -> Scene:
    """Newton's cradle of pendula: equal balls that hang side by side.

    Some balls are pulled aside and released. Each ball is a pendulum with Ω² = g/l, for small angles. For any
    restitution ε < 1, hard balls finally swing together. If one of N balls was pulled aside, 1/N of the energy
    remains. Soft balls lose less energy.

    Parameters
    ----------
    n : int
        Number of balls, at least 2.
    moving : int
        Number of balls that are pulled to the left, fewer than `n`.
    amplitude : float
        Initial displacement in m, small compared with `length`.
    rest_gap : float or floats
        Distances between the surfaces at rest in m: one, or n-1 left to right. 0 means touching balls: the outcome of
        hard spheres then depends on the tie rule for simultaneous collisions (``ties``).
    length : float
        Length l of the strings in m.
    mass : float
        Mass of a ball in kg.
    density : float
        Density in kg/m³ (steel), which determines the radius.
    gravity : float
        g in m/s², perpendicular to the row. It only provides the restoring force of the pendula.
    """
    count = count_of(n, 2)
    aside = check.integer("moving", moving, at_least=1, at_most=count - 1, fix="At least one ball has to be at rest.")
    rest = gaps_of(rest_gap, count - 1, "rest_gap")
    pulled, gap = check.number("amplitude", amplitude, at_least=0.0, fix="Positive is to the left."), rest.copy()
    gap[aside - 1] += pulled
    square = check.number("gravity", gravity, above=0.0) / check.number("length", length, above=0.0)
    m = np.full(count, check.number("mass", mass, above=0.0))
    return Scene(m, radius_of(m, density), gap, np.zeros(count), origin=0.0 - pulled, pendulum=math.sqrt(square),
                 rest_gap=rest)


@signature.face
def chain(
    n: int = 10, mass_ratio: float = 1.0, dimer: float = 1.0, striker: float | None = None, speed: float = 1.0,
    gap: float | Sequence[float] = 0.0, mass: float = 1.0, density: float = 7800.0,
) -> Scene:
    """Chain of balls at rest, struck from the left: uniform, tapered or diatomic.

    Ball k has mass ``mass * mass_ratio**k``, times `dimer` for odd k. Ball 0 is the striker.

    Parameters
    ----------
    n : int
        Number of balls including the striker, at least 2.
    mass_ratio : float
        m[k+1]/m[k]. Below 1 the chain tapers towards its far end.
    dimer : float
        Mass of every second ball relative to its neighbours.
    striker : float, optional
        Mass of the striker in kg, instead of `mass`.
    speed : float
        Speed of the striker in m/s.
    gap : float or floats
        Distances between the surfaces in m: one, or n-1 left to right.
    mass : float
        Mass of ball 0 in kg, which determines all others.
    density : float
        Density in kg/m³ (steel), which determines the radii.
    """
    m = check.number("mass", mass, above=0.0) * geometric_masses(count_of(n, 2), mass_ratio)
    m[1::2] *= check.number("dimer", dimer, above=0.0)
    if striker is not None:
        m[0] = check.number("striker", striker, above=0.0)
    return _in_a_row(m, 1, speed, gap, density)


@signature.face
def compressed_chain(
    n: int = 20, force: float = 20.0, *, law: Any, ends: str = "walls", dimer: float = 1.0,
    striker: float | None = None, speed: float = 0.1, floor: Any = None, radius: float = 0.009525,
    density: float = 8027.0,
) -> Scene:
    """Chain of balls at rest under a static force (granular crystal).

    Each contact has the overlap at which its law gives this force. Small waves in the chain have the dispersion of
    `granular.waves`, with the stiffness of the contacts under that force.

    Parameters
    ----------
    n : int
        Number of balls, without a striker.
    force : float
        Force in N of every contact, not negative. At 0 the balls just touch.
    law : force law, sequence of force laws, function of a pair, or None
        Law of the contacts: one for all, one per pair left to right, or a function that returns one for each pair.
        None: the balls just touch, as for force 0.
    ends : {"walls", "force", "forces"}
        "walls": two walls. "force": a floor and a force on the last ball. "forces": forces on both ends of the chain.
    dimer : float
        Mass of every second ball relative to its neighbours, with the same density.
    striker : float, optional
        Mass in kg of an additional ball that arrives from the left and touches the first one, for ends="forces".
    speed : float
        Speed of the striker in m/s.
    floor : granular.walls.Sine, Piecewise or Motion, optional
        Motion of the floor. On the command line type=Sine amplitude=1e-9 frequency=5000.
    radius : float
        Radius of the first ball in m.
    density : float
        Density in kg/m³ (steel).

    Raises
    ------
    TypeError, ValueError
        For misuse, such as a force that no overlap gives under that law.
    """
    count, load = count_of(n), check.number("force", force, at_least=0.0, fix="A positive force compresses the chain.")
    check.choice("ends", ends, ("walls", "force", "forces"))
    r = np.full(count, check.number("radius", radius, above=0.0))
    r[1::2] *= np.cbrt(check.number("dimer", dimer, above=0.0))
    force_on = np.zeros(count)
    force_on[0] += load * (ends == "forces")
    force_on[-1] -= load * (ends != "walls")
    first_bodies, last_bodies = [WALL_BODY] * (ends != "forces"), [WALL_BODY] * (ends == "walls")
    if striker is not None:
        if first_bodies:
            raise ValueError(f"`striker` must be None if the chain ends at walls, got {striker!r}. Use ends='forces'.")
        m = check.number("striker", striker, above=0.0)
        first_bodies = [(m, float(radius_of(np.array(m), density)), check.number("speed", speed, above=0.0), 0.0)]
    balls = zip(mass_of(r, density).tolist(), r.tolist(), [0.0] * count, force_on.tolist(), strict=True)
    bodies = [*first_bodies, *balls, *last_bodies]
    mass, radii, velocity, forces = zip(*bodies, strict=True)
    scene = Scene(mass, radii, np.zeros(len(bodies) - 1), velocity, external_force=forces, floor=floor)
    return scene if law is None else _pressed(scene, law, load, first=int(striker is not None))


WALL_BODY = math.inf, 0.0, 0.0, 0.0
"""Mass in kg, radius in m, velocity in m/s, and external force in N of a wall."""


def _pressed(scene: Scene, law: Any, load: float, first: int) -> Scene:
    """Return `scene` with the overlap at which each contact has the force `load`.

    `law` is one law, one law per pair, or a function of a pair. `load` is in N. The pairs before number `first` only
    touch: their gap is 0.
    """
    if callable(law) and not hasattr(law, "force"):
        function_of("law", law, "pair")
        law = [law(pair) for pair in scene.pairs]
    from granular.laws.springs import static_overlap

    laws = resolved(check.per_pair("law", law, scene.n_pairs), scene)
    gap = -laws.column(lambda law_of_pair: static_overlap(law_of_pair, load))
    gap[:first] = 0.0
    return in_order(scene.replace(gap=gap + 0.0))


def _in_a_row(mass: check.Array, moving: int, speed: float, gap: float | Sequence[float], density: float) -> Scene:
    """Return a scene of a row of balls, of which the first `moving` move right.

    The moving balls have `speed` in m/s. The others are at rest. `mass` is in kg, `gap` in m and `density` in kg/m³.
    """
    v = np.where(np.arange(len(mass)) < moving, check.number("speed", speed, above=0.0), 0.0)
    return in_order(Scene(mass, radius_of(mass, density), gaps_of(gap, len(mass) - 1), v))

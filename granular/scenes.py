"""Ready-made scenes: physical parameters in, `Scene` out.
May be skipped: ready-made scenes, to be looked up.

Everywhere the lowest (leftmost) body comes first, masses and radii of spheres are tied by m = (4/3) π R³ ρ, and one
number for `gap` means the same gap in every pair between balls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granular import _check
from granular._check import Array
from granular.balls import Ball, named
from granular.laws.kinds import resolved
from granular.laws.statics import overlap_under
from granular.scene import Scene, in_order
from granular.walls import Sine

__all__ = [
    "ball_stack", "bouncing_ball", "chain", "column", "compressed_chain", "gas", "newtons_cradle", "real_balls",
    "three_balls", "vibrated_column",
]
__dir__ = __all__.copy

def three_balls(
    radii: Sequence[float] = (0.10, 0.01), gap: float = 1e-4, height: float = 0.6, density: float = 900.0,
    gravity: float = 9.81,
) -> Scene:
    """Two balls, one above the other, dropped on a floor: the scene of the paper (the floor is the third ball).

    Both are released from rest. Pair 0 is floor and lower ball, pair 1 the two balls (Müller & Pöschel 2011, Fig. 1).

    Parameters
    ----------
    radii : two floats
        Radii R1, R2 in m, bottom to top.
    gap : float
        Distance Δh between the surfaces of the two balls in m.
    height : float
        Height z1 of the *centre* of the lower ball above the floor in m, at least R1.
    density : float
        Density ρ in kg/m³. The paper gives none: only 858 to 936 makes all of its observations true.
    gravity : float
        g in m/s².
    """
    r = _check.array("radii", radii, (2,), fix="give the lower and the upper radius")
    _check.every("radii", r, np.isfinite(r) & (r > 0.0), "a radius must be positive and finite")
    lower = float(r[0])
    z1 = _check.number("height", height, at_least=lower, fix="it is the height of the lower ball's centre")
    return _above_floor(_mass(r, density), r, z1 - lower, _check.number("gap", gap), 0.0, gravity)


def ball_stack(
    n: int = 3, mass_ratio: float = 0.1, masses: Sequence[float] | None = None, height: float | None = None,
    speed: float | None = None, gap: float | Sequence[float] = 1e-4, density: float = 900.0, gravity: float = 9.81,
) -> Scene:
    """Stack of balls, lighter and lighter, that falls on a floor and throws its top ball high (Harter, Kerwin).

    Either dropped from rest, or meeting the floor at t = 0 with a given speed.

    Parameters
    ----------
    n : int
        Number of balls.
    mass_ratio : float
        m[k+1]/m[k] from each ball to the one above; the lowest has 1 kg.
    masses : floats, optional
        All masses in kg, bottom to top, in place of `n` and `mass_ratio`.
    height : float, optional
        Drop height in m, from the floor to the lowest point of the lowest ball (default 1 m).
    speed : float, optional
        In place of `height`: all balls move down at this speed in m/s as the lowest touches the floor.
    gap : float or floats
        Distances between the surfaces of the balls in m: one, or n-1 bottom to top.
    density : float
        Density in kg/m³, from which the radii follow.
    gravity : float
        g in m/s²; 0 gives the textbook stack in free flight.
    """
    if height is not None and speed is not None:
        raise ValueError(f"height is {height!r} and speed is {speed!r}: give one of the two; a stack that starts at "
                         "the floor with a speed has no drop height.")
    m = _geometric(n, mass_ratio) if masses is None else _given(masses)
    drop = 0.0 if speed is not None else _check.number("height", 1.0 if height is None else height, at_least=0.0)
    v = 0.0 if speed is None else _check.number("speed", speed, above=0.0, fix="downwards is built in")
    return _above_floor(m, _radius(m, density), drop, gap, v, gravity)


def real_balls(
    lower: str | Ball = "basketball", upper: str | Ball | None = "tennis ball", gap: float = 0.0, height: float = 1.0,
    gravity: float = 9.81,
) -> Scene:
    """Two real balls, one on top of the other, dropped on a hard floor; or one alone.

    What they do to each other is in `granular.balls`.

    Parameters
    ----------
    lower, upper : str or Ball
        Names of `granular.balls.BALLS`, or balls of one's own; without an upper one the lower falls alone.
    gap : float
        Distance between the surfaces of the two balls in m.
    height : float
        Drop height in m, from the floor to the lowest point of the lower ball.
    gravity : float
        g in m/s².
    """
    balls = [named(lower)] if upper is None else [named(lower), named(upper)]
    m, r = (np.array([getattr(ball, name) for ball in balls]) for name in ("mass", "radius"))
    drop = _check.number("height", height, at_least=0.0)
    return _above_floor(m, r, drop, [_check.number("gap", gap)] * (len(balls) - 1), 0.0, gravity)


def newtons_cradle(
    n: int = 5, moving: int = 1, gap: float | Sequence[float] = 0.0, speed: float = 1.0, mass: float = 1.0,
    density: float = 7800.0,
) -> Scene:
    """Newton's cradle: equal balls in a row, some of which arrive from the left; no gravity along the row.

    Parameters
    ----------
    n : int
        Number of balls, at least 2.
    moving : int
        How many of them arrive, fewer than `n`.
    gap : float or floats
        Distances between the surfaces in m: one, or n-1 left to right. 0 means balls that touch: then the outcome of
        hard spheres depends on the rule for simultaneous contacts (``ties``).
    speed : float
        Speed of the arriving balls in m/s.
    mass : float
        Mass of a ball in kg.
    density : float
        Density in kg/m³ (steel), from which the radius follows.
    """
    count = _check.whole("n", n, at_least=2)
    arriving = _check.whole("moving", moving, at_least=1, at_most=count - 1, fix="at least one ball waits at rest")
    return _in_a_row(np.full(count, _check.number("mass", mass, above=0.0)), arriving, speed, gap, density)


def chain(
    n: int = 10, mass_ratio: float = 1.0, dimer: float = 1.0, striker: float | None = None, speed: float = 1.0,
    gap: float | Sequence[float] = 0.0, mass: float = 1.0, density: float = 7800.0,
) -> Scene:
    """Chain of balls at rest, struck from the left: uniform, tapered, or of alternating masses.

    Ball k has mass ``mass * mass_ratio**k``, times `dimer` for odd k; ball 0 is the striker.

    Parameters
    ----------
    n : int
        Number of balls including the striker, at least 2.
    mass_ratio : float
        m[k+1]/m[k]; below 1 the chain tapers towards its far end.
    dimer : float
        Mass of every second ball relative to its neighbours.
    striker : float, optional
        Mass of the striker in kg, in place of `mass`.
    speed : float
        Speed of the striker in m/s.
    gap : float or floats
        Distances between the surfaces in m: one, or n-1 left to right.
    mass : float
        Mass of ball 0 in kg, from which all others follow.
    density : float
        Density in kg/m³ (steel), from which the radii follow.
    """
    m = _check.number("mass", mass, above=0.0) * _geometric(_check.whole("n", n, at_least=2), mass_ratio)
    m[1::2] *= _check.number("dimer", dimer, above=0.0)
    if striker is not None:
        m[0] = _check.number("striker", striker, above=0.0)
    return _in_a_row(m, 1, speed, gap, density)


def column(
    n: int = 5, gap: float | Sequence[float] = 1e-3, speed: float = 1.0, mass: float = 1.0, density: float = 900.0,
    gravity: float = 0.0,
) -> Scene:
    """Column of equal balls that falls on a floor as one: how much of it bounces back?

    Parameters
    ----------
    n : int
        Number of balls.
    gap : float or floats
        Distances between the surfaces in m: one, or n bottom to top, that of the floor first.
    speed : float
        Speed in m/s with which all balls move down at the start.
    mass : float
        Mass of a ball in kg.
    density : float
        Density in kg/m³, from which the radius follows.
    gravity : float
        g in m/s².
    """
    count = _check.whole("n", n, at_least=1)
    m = np.full(count, _check.number("mass", mass, above=0.0))
    v = _check.number("speed", speed, at_least=0.0, fix="downwards is built in")
    floor, *between = _gaps(gap, count)
    return _above_floor(m, _radius(m, density), floor, between, v, gravity)


def gas(
    n: int = 50, length: float = 50.0, packing: float = 0.1, temperature: float = 1.0, speeds: str = "maxwell",
    mass: float = 1.0, mass_spread: float = 1.0, walls: bool = True, seed: int = 1,
) -> Scene:
    """Gas of balls between two walls (or free), at random places with random velocities.

    The places are an equilibrium of hard spheres on a line (Tonks gas): every free arrangement is equally likely.

    Parameters
    ----------
    n : int
        Number of balls.
    length : float
        Length of the line in m.
    packing : float
        Share of the length that the balls' diameters fill, in [0, 1); 0 gives point particles.
    temperature : float
        T = ⟨m v²⟩ in J.
    speeds : str
        "maxwell" (normal distribution), "uniform" (between ±√(3T/m)) or "two" (±√(T/m)).
    mass : float
        Mass in kg: the geometric mean if the masses differ.
    mass_spread : float
        Heaviest over lightest possible mass, at least 1: masses are drawn log-uniformly, the radii follow as m^(1/3).
    walls : bool
        Whether walls close the line at both ends.
    seed : int
        Seed of the random numbers (numpy's default generator).
    """
    count = _check.whole("n", n, at_least=1 if walls else 2)
    line = _check.number("length", length, above=0.0)
    filled = _check.number("packing", packing, at_least=0.0)
    if filled >= 1.0:
        raise ValueError(f"packing is {packing!r}: a share of the length below 1 is needed.")
    random = np.random.default_rng(_check.whole("seed", seed))
    spread = math.log(_check.number("mass_spread", mass_spread, at_least=1.0))
    m = _check.number("mass", mass, above=0.0) * np.exp(spread * random.uniform(-0.5, 0.5, count))
    r = np.cbrt(m)
    r *= 0.5 * filled * line / r.sum()
    share = random.standard_exponential(count + 1)  # spacings of ordered uniform points, without their cancellation
    gap = (1.0 - filled) * line * share / share.sum()
    thermal = math.sqrt(_check.number("temperature", temperature, at_least=0.0))
    v = thermal / np.sqrt(m) * _unit_speeds(random, speeds, count)
    if walls:
        return Scene([math.inf, *m, math.inf], [0.0, *r, 0.0], gap, [0.0, *v, 0.0])
    return Scene(m, r, gap[1:-1], v, origin=float(gap[0] + r[0]))


def bouncing_ball(
    height: float = 1.0, radius: float = 0.01, speed: float = 0.0, density: float = 900.0, gravity: float = 9.81,
    plate: Any = None,
) -> Scene:
    """One ball bouncing on a floor until it comes to rest, or on a plate that is shaken.

    On a plate z = A sin(ωt) that is shaken with Γ = A ω²/g, hard spheres have a bounce of k periods for Γ > G_k =
    kπ (1 - ε)/(1 + ε); it doubles its period at Γ = √(G_k² + [2(1 + ε²)/(1 + ε)²]²).

    Parameters
    ----------
    height : float
        Drop height in m, from the floor to the lowest point of the ball.
    radius : float
        Radius in m.
    speed : float
        Speed in m/s with which it is thrown down.
    density : float
        Density in kg/m³.
    gravity : float
        g in m/s².
    plate : granular.walls.Sine, Piecewise or Motion, optional
        How the floor moves; to the command type=Sine gamma=2 frequency=50, or amplitude= (in m) in place of gamma=.
    """
    r = np.array([_check.number("radius", radius, above=0.0)])
    drop = _check.number("height", height, at_least=0.0)
    v = _check.number("speed", speed, at_least=0.0, fix="downwards is built in")
    return _above_floor(_mass(r, density), r, drop, (), v, gravity, plate)


def vibrated_column(
    n: int = 10, gamma: float = 10.0, frequency: float = 20.0, amplitude: float | None = None,
    phase: float = 0.5 * math.pi, gap: float | Sequence[float] = 1e-3, radius: float = 0.005, density: float = 900.0,
    gravity: float = 9.81,
) -> Scene:
    """Column of equal balls on a floor that is shaken: z = A sin(2π f t + φ), Γ = A (2π f)²/g.

    Hard spheres are fluidized while N (1 - ε) is small, up to a height of their centre of mass h_cm of about
    1.25 (A 2π f)²/(g N (1 - ε)), and move as one piece where it is large (Luding et al. 1994).

    Parameters
    ----------
    n : int
        Number of balls N.
    gamma : float
        Largest acceleration Γ of the floor, as a multiple of g.
    frequency : float
        Frequency f in Hz.
    amplitude : float, optional
        Amplitude A in m, in place of `gamma`.
    phase : float
        Phase φ in rad at t = 0: at π/2 the floor starts from its highest point at rest, at 0 with a jolt 2π f A.
    gap : float or floats
        Distances between the surfaces in m: one, or n bottom to top, that of the floor first.
    radius : float
        Radius of a ball in m.
    density : float
        Density in kg/m³.
    gravity : float
        g in m/s², positive where `gamma` is to count.
    """
    count = _check.whole("n", n, at_least=1)
    r = np.full(count, _check.number("radius", radius, above=0.0))
    if amplitude is None:
        plate = Sine.from_acceleration(gamma, frequency, gravity, phase)
    else:
        plate = Sine(amplitude, frequency, phase)
    floor, *between = _gaps(gap, count)
    return _above_floor(_mass(r, density), r, floor, between, 0.0, gravity, plate)


def compressed_chain(
    n: int = 20, force: float = 20.0, *, law: Any, ends: str = "walls", dimer: float = 1.0,
    striker: float | None = None, speed: float = 0.1, floor: Any = None, radius: float = 0.009525,
    density: float = 8027.0,
) -> Scene:
    """Chain of balls at rest under a static force (granular crystal): each contact is as deep as the law says.

    Small waves in it have the dispersion of `granular.waves`, with the stiffness of its contacts under that force.

    Parameters
    ----------
    n : int
        Number of balls, without a striker.
    force : float
        Force in N that every contact bears, not negative; at 0 the balls just touch.
    law : force law, sequence of them, function of a pair, or None
        Law of the contacts: one for all, one per pair left to right, or one made for each pair; None: the balls only
        touch, as without a force.
    ends : {"walls", "force", "forces"}
        What holds the chain: two walls, a floor and a force on the last ball, or forces on both of its ends.
    dimer : float
        Mass of every second ball relative to its neighbours, of the same density.
    striker : float, optional
        Mass in kg of one more ball that arrives from the left and touches the first; for ends="forces".
    speed : float
        Speed of the striker in m/s.
    floor : granular.walls.Sine, Piecewise or Motion, optional
        How the floor moves; to the command type=Sine amplitude=1e-9 frequency=5000.
    radius : float
        Radius of the first ball in m.
    density : float
        Density in kg/m³ (steel).

    Raises
    ------
    TypeError, ValueError
        For misuse, such as a force that no overlap gives under that law.
    """
    count, load = _check.whole("n", n, at_least=1), _check.number("force", force, at_least=0.0, fix="it presses")
    _check.choice("ends", ends, ("walls", "force", "forces"))
    r = np.full(count, _check.number("radius", radius, above=0.0))
    r[1::2] *= np.cbrt(_check.number("dimer", dimer, above=0.0))
    force_on = np.zeros(count)
    force_on[0] += load * (ends == "forces")
    force_on[-1] -= load * (ends != "walls")
    front, back = [WALL] * (ends != "forces"), [WALL] * (ends == "walls")
    if striker is not None:
        if front:
            raise ValueError(f"striker is {striker!r}: a wall is in its way; ends='forces' is needed.")
        front = [_striker(striker, speed, density)]
    balls = zip(_mass(r, density).tolist(), r.tolist(), [0.0] * count, force_on.tolist(), strict=True)
    bodies = [*front, *balls, *back]
    mass, radii, velocity, forces = zip(*bodies, strict=True)
    scene = Scene(mass, radii, np.zeros(len(bodies) - 1), velocity, external_force=forces, floor=floor)
    return scene if law is None else _pressed(scene, law, load, first=int(striker is not None))


WALL = math.inf, 0.0, 0.0, 0.0
"""Mass, radius, velocity, and force on it."""


def _striker(mass: float, speed: float, density: float) -> tuple[float, float, float, float]:
    """Mass, radius, velocity of a ball that arrives, and no force."""
    m = _check.number("striker", mass, above=0.0)
    return m, float(_radius(np.array(m), density)), _check.number("speed", speed, above=0.0), 0.0


def _pressed(scene: Scene, law: Any, load: float, first: int) -> Scene:
    """Return `scene` with the overlaps, from the pair `first` on, at which contacts at rest bear `load`."""
    if callable(law) and not hasattr(law, "force"):
        law = [law(pair) for pair in scene.pairs]
    laws = resolved(_check.per_pair("law", law, scene.n_pairs), scene)
    gap = -laws.column(lambda one: overlap_under(one, load))
    gap[:first] = 0.0
    return in_order(scene.replace(gap=gap + 0.0))


def _above_floor(
    mass: Array, radius: Array, drop: float, gap: float | Sequence[float], speed: float, gravity: float,
    plate: Any = None,
) -> Scene:
    """Balls that all move down at `speed`, the lowest point of the lowest at height `drop` above a floor."""
    n = len(mass)
    velocity = [0.0] + [0.0 - speed] * n  # not -speed, which makes -0.0 of rest
    gaps = [drop, *_gaps(gap, n - 1)]
    return in_order(Scene([math.inf, *mass], [0.0, *radius], gaps, velocity, gravity, floor=plate))


def _in_a_row(mass: Array, moving: int, speed: float, gap: float | Sequence[float], density: float) -> Scene:
    """Balls of which the first few arrive with `speed` at the others, which are at rest."""
    v = np.where(np.arange(len(mass)) < moving, _check.number("speed", speed, above=0.0), 0.0)
    return in_order(Scene(mass, _radius(mass, density), _gaps(gap, len(mass) - 1), v))


def _gaps(gap: float | Sequence[float], n_pairs: int) -> Array:
    if np.ndim(gap) == 0:
        return np.full(n_pairs, _check.number("gap", gap))
    return _check.array("gap", gap, (n_pairs,), fix="one gap for all, or one per pair from the bottom up")


def _geometric(n: int, mass_ratio: float) -> Array:
    count = _check.whole("n", n, at_least=1)
    return np.asarray(np.power(_check.number("mass_ratio", mass_ratio, above=0.0), np.arange(count, dtype=np.float64)))


def _given(masses: Sequence[float]) -> Array:
    m = _check.array("masses", masses)
    _check.every("masses", m, np.isfinite(m) & (m > 0.0), "a mass must be positive and finite", "the floor is built in")
    return m


def _mass(radius: Array, density: float) -> Array:
    return 4.0 / 3.0 * math.pi * _check.number("density", density, above=0.0) * radius**3


def _radius(mass: Array, density: float) -> Array:
    return np.asarray(np.cbrt(mass * 0.75 / (math.pi * _check.number("density", density, above=0.0))))


def _unit_speeds(random: np.random.Generator, speeds: str, n: int) -> Array:
    """Random velocities of mean 0 and variance 1."""
    draw: dict[str, Callable[[], Array]] = {
        "maxwell": lambda: random.standard_normal(n),
        "uniform": lambda: random.uniform(-math.sqrt(3.0), math.sqrt(3.0), n),
        "two": lambda: random.choice([-1.0, 1.0], n),
    }
    return draw[_check.choice("speeds", speeds, tuple(draw))]()

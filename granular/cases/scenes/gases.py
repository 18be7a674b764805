"""Gases: between walls, on a ring, between thermal walls, above a hot floor."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from granular._engine import check, signature
from granular.cases.scenes.falling import count_of
from granular.scene import Scene
from granular.scene.walls import Thermal


@signature.face
def gas(
    n: int = 50, length: float = 50.0, packing: float = 0.1, temperature: float = 1.0, speeds: str = "maxwell",
    mass: float = 1.0, mass_spread: float = 1.0, walls: bool = True, seed: int = 1,
) -> Scene:
    """Gas of balls between two walls (or free), with random places and velocities.

    The places are an equilibrium of hard spheres on a line (Tonks gas): every arrangement without overlaps has the same
    probability.

    Parameters
    ----------
    n : int
        Number of balls.
    length : float
        Length of the line in m.
    packing : float
        Fraction of the length that the balls' diameters fill, in [0, 1). 0 gives point particles.
    temperature : float
        T = ⟨m v²⟩ in J.
    speeds : str
        "maxwell" (normal distribution), "uniform" (between ±√(3T/m)) or "two" (±√(T/m)).
    mass : float
        Mass in kg, or the geometric mean if the masses differ.
    mass_spread : float
        Largest divided by smallest possible mass, at least 1. Masses are drawn log-uniformly; radii follow as m^(1/3).
    walls : bool
        Whether walls close the line at both ends.
    seed : int
        Seed of the random numbers (numpy's default generator).
    """
    alike = np.ones(count_of(n, 1 if check.boolean("walls", walls) else 2))
    random, m, r, gap = _places(alike, length, packing, mass, mass_spread, seed, spaces=1)
    thermal = math.sqrt(check.number("temperature", temperature, at_least=0.0))
    v = thermal / np.sqrt(m) * _unit_speeds(random, speeds, len(m))
    if walls:
        return Scene([math.inf, *m, math.inf], [0.0, *r, 0.0], gap, [0.0, *v, 0.0])
    return Scene(m, r, gap[1:-1], v, origin=float(gap[0] + r[0]))


@signature.face
def ring_gas(
    n: int = 50, length: float = 50.0, packing: float = 0.1, temperature: float = 1.0, speeds: str = "maxwell",
    mass: float = 1.0, mass_spread: float = 1.0, seed: int = 1,
) -> Scene:
    """Gas of balls on a ring, with random places and velocities.

    Its centre of mass is at rest. It cools by Haff's law, T = T0/(1 + t/t0)², until clusters form.

    Parameters
    ----------
    n : int
        Number of balls, at least 2.
    length : float
        Circumference in m.
    packing : float
        Fraction of the length that the balls' diameters fill, in [0, 1). 0 gives point particles.
    temperature : float
        T = ⟨m v²⟩ in J.
    speeds : str
        "maxwell" (normal distribution), "uniform" or "two" (equal speeds before the centre of mass is brought to rest).
    mass : float
        Mass in kg, or the geometric mean if the masses differ.
    mass_spread : float
        Largest divided by smallest possible mass, at least 1. Masses are drawn log-uniformly; radii follow as m^(1/3).
    seed : int
        Seed of the random numbers (numpy's default generator).
    """
    random, m, r, gap = _places(np.ones(count_of(n, 2)), length, packing, mass, mass_spread, seed, spaces=0)
    v = _unit_speeds(random, speeds, len(m)) / np.sqrt(m)
    v -= m @ v / m.sum()
    mean = float(m @ (v * v)) / len(m)
    v *= math.sqrt(check.number("temperature", temperature, at_least=0.0) / mean) if mean > 0.0 else 0.0
    return Scene(m, r, gap, v, ring=True)


@signature.face
def heated_gas(
    n: int = 50, length: float = 50.0, packing: float = 0.1, lower: float = 2.0, upper: float | None = None,
    gravity: float = 0.0, mass: float = 1.0, dimer: float = 1.0, seed: int = 1,
) -> Scene:
    """Gas of balls between two thermal walls, or a column above a hot floor.

    Between walls of temperatures T1 and T2, N hard elastic balls of equal mass m carry the heat flow
    n (T1 - T2) / (√(πm/2) (T1^-½ + T2^-½)), where n is N over the free length. Their temperature is √(T1 T2)
    everywhere, for any N. The centre of mass of point particles above a floor of temperature T has the mean height
    T/(mg).

    Parameters
    ----------
    n : int
        Number N of balls.
    length : float
        Length of the line in m. For an open column it only determines the size of the balls.
    packing : float
        Fraction of the length that the balls' diameters fill, in [0, 1). 0 gives point particles.
    lower : float
        T1 = k_B T in J of the floor.
    upper : float, optional
        T2 of the ceiling in J. Defaults to half of `lower`. With gravity, the default is a column without a ceiling.
    gravity : float
        g in m/s².
    mass : float
        Mass of the first ball in kg.
    dimer : float
        Mass of every second ball relative to its neighbours. The radii follow as m^(1/3).
    seed : int
        Seed of the random numbers, for places, velocities and walls.
    """
    g = check.number("gravity", gravity, at_least=0.0, fix="It always points downwards.")
    floor = Thermal(check.number("lower", lower, above=0.0, fix="It is k_B T in J."), seed)
    hot = floor.temperature
    cold = 0.5 * hot if upper is None else check.number("upper", upper, above=0.0, fix="It is k_B T in J.")
    pattern = np.ones(count_of(n))
    pattern[1::2] = check.number("dimer", dimer, above=0.0)
    random, m, r, gap = _places(pattern, length, packing, mass, 1.0, seed, spaces=1)
    if upper is None and g > 0.0:  # open above
        gap = hot / (g * np.cumsum(m[::-1])[::-1]) * random.standard_exponential(len(m))
        v = math.sqrt(hot) / np.sqrt(m) * random.standard_normal(len(m))
        return Scene([math.inf, *m], [0.0, *r], gap, [0.0, *v], g, floor=floor)
    v = math.sqrt(math.sqrt(hot * cold)) / np.sqrt(m) * random.standard_normal(len(m))
    return Scene([math.inf, *m, math.inf], [0.0, *r, 0.0], gap, [0.0, *v, 0.0], g, floor=floor,
                 ceiling=Thermal(cold, seed))


@np.errstate(over="ignore", invalid="ignore")
def _places(
    pattern: check.Array, length: float, packing: float, mass: float, mass_spread: float, seed: int, *, spaces: int
) -> tuple[np.random.Generator, check.Array, check.Array, check.Array]:
    """Return a random generator, masses in kg, radii in m and gaps in m of a gas.

    Parameters
    ----------
    pattern : array, shape (n,)
        Masses of the balls relative to `mass`, before the random spread.
    length, packing, mass, mass_spread, seed
        As for `gas`.
    spaces : int
        Number of gaps minus number of balls: 1 between two walls, 0 on a ring.
    """
    count = len(pattern)
    line_length = check.number("length", length, above=0.0)
    filled = check.number("packing", packing, at_least=0.0)
    if filled >= 1.0:
        raise ValueError(f"`packing` must be a fraction of the length below 1, got {packing!r}.")
    random = np.random.default_rng(check.integer("seed", seed))
    spread = math.log(check.number("mass_spread", mass_spread, at_least=1.0))
    m = check.number("mass", mass, above=0.0) * np.exp(spread * random.uniform(-0.5, 0.5, count)) * pattern
    r = np.cbrt(m)
    r *= 0.5 * filled * line_length / r.sum()
    spacing = random.standard_exponential(count + spaces)  # spacings of ordered uniform points, without cancellation
    return random, m, r, (1.0 - filled) * line_length * spacing / spacing.sum()


def _unit_speeds(random: np.random.Generator, speeds: str, n: int) -> check.Array:
    """Return `n` random velocities from a distribution of mean 0 and variance 1."""
    draw: dict[str, Callable[[], check.Array]] = {
        "maxwell": lambda: random.standard_normal(n),
        "uniform": lambda: random.uniform(-math.sqrt(3.0), math.sqrt(3.0), n),
        "two": lambda: random.choice([-1.0, 1.0], n),
    }
    return draw[check.choice("speeds", speeds, tuple(draw))]()

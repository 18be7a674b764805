"""The one builder of random scenes and laws, by seed or by hypothesis: what fuzz, invariants and benches run.

Every number comes from a `numpy.random.Generator`, in an order that is kept: stored truths name their scenes by seed.
Masses are equal, alike, or decades apart; velocities at random, symmetric, all the same, or none but one; gaps wide,
all equal, touching rows that move together, or overlapping; floor, ceiling, moving walls and gravity come by chance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

import granular as gr

INF = math.inf
HARD = ("wide", "equal", "touching")
ALL = (*HARD, "overlapping")
"""Ways of gaps; "uneven" is one more: some of them 1e-9 of the others."""


def scene(
    rng: Any, balls: tuple[int, int] = (2, 6), *, walls: tuple[float, float, float] = (0.5, 0.2, 0.0),
    gravity: tuple[float, ...] = (0.0, 9.81), gaps: Collection[str] = HARD, size: float = 1e-3, decades: float = 2.0,
) -> gr.Scene:
    """Balls at speeds up to 1 m/s, at gaps between 2e-3 `size` and 2e3 `size` m.

    `balls` are the least and the most of them; `walls` the chances that there is a floor, a ceiling, and that they
    move; `gravity` is chosen where there is a floor; masses are up to `decades` apart.
    """
    n = int(rng.integers(balls[0], balls[1] + 1))
    floor, ceiling, moving = (bool(rng.random() < chance) for chance in walls)
    floor = floor or (n == 1 and not ceiling)
    mass, velocity = walled(rng, masses(rng, n, decades), velocities(rng, n, 1.0), (floor, ceiling, moving), 1.0)
    below, above = velocity[0], velocity[-1]
    pull = float(rng.choice(gravity)) if floor else 0.0
    gap, velocity = spaced(rng, len(mass) - 1, size, velocity, gaps)
    if floor:
        velocity[0] = min(below, above) if ceiling else below  # or the walls would meet
    if ceiling:
        velocity[-1] = max(below, above) if floor else above
    if "uneven" in gaps and rng.random() < 0.3:
        gap = [x * (1e-9 if rng.random() < 0.5 else 1.0) for x in gap]
    return built(mass, gap, velocity, pull)


def scenes(**options: Any) -> st.SearchStrategy[gr.Scene]:
    """`scene` of a seed, as a strategy."""
    return seeds().map(lambda seed: scene(np.random.default_rng(seed), **options))


def soft_scenes(names: Collection[str], k: tuple[float, float] = (2.0, 6.0), **options: Any) -> Any:
    """A scene with one law for each pair, all of one kind or mixed; `k` are the decades of the stiffness."""

    def draw(seed: int) -> tuple[gr.Scene, tuple[Any, ...]]:
        rng = np.random.default_rng(seed)
        one = scene(rng, **options)
        return one, laws(rng, one, names, k)

    return seeds().map(draw)


def seeds() -> st.SearchStrategy[int]:
    """Seeds of a generator."""
    return st.integers(0, 2**32 - 1)


def gas(seed: int, n: int, spread: float = 0.0, gravity: float = 0.0, ceiling: bool = True) -> gr.Scene:
    """`n` balls of one temperature, their masses e^(± `spread`), about 1 m apart in a box."""
    rng = np.random.default_rng(seed)
    mass = np.exp(rng.uniform(-spread, spread, n))
    v = rng.normal(size=n) / np.sqrt(mass)
    above = [0.0] * ceiling
    return gr.Scene([INF, *mass, *([INF] * ceiling)], np.zeros(n + 1 + ceiling), rng.uniform(0.5, 1.5, n + ceiling),
                    [0.0, *v, *above], gravity)


def built(mass: Any, gap: Any, velocity: Any, gravity: float) -> gr.Scene:
    """Balls of radius 0.5 m and walls."""
    return gr.Scene(mass, [0.0 if m == INF else 0.5 for m in mass], gap, velocity, gravity)


# masses, velocities, gaps


def nice(rng: Any, x: float) -> float:
    """Sometimes a number of few digits, as people give."""
    return float(f"{x:.1g}") if rng.random() < 0.4 else float(x)


def masses(rng: Any, n: int, decades: float = 6.0) -> list[float]:
    """Equal, alike, or up to `decades` apart."""
    way = rng.random()
    if way < 0.35:
        return [nice(rng, 10.0 ** rng.uniform(-2.0, 1.0))] * n
    if way < 0.7:
        return [nice(rng, x) for x in rng.uniform(0.3, 3.0, n)]
    apart = rng.uniform(0.0, decades)
    return [nice(rng, 10.0 ** (rng.uniform(-0.5, 0.5) * apart)) for _ in range(n)]


def velocities(rng: Any, n: int, speed: float) -> list[float]:
    """Symmetric, one that comes, all that fall together, none, or any."""
    way = rng.random()
    if way < 0.15:
        return [float(x) for x in np.linspace(speed, -speed, n)] if n > 1 else [-speed]
    if way < 0.3:
        return [speed, *[0.0] * (n - 1)]
    if way < 0.4:
        return [-speed] * n
    if way < 0.45:
        return [0.0] * n
    return [nice(rng, x) if rng.random() < 0.9 else 0.0 for x in rng.uniform(-1.0, 1.0, n) * speed]


def walled(
    rng: Any, mass: list[float], velocity: list[float], walls: tuple[bool, bool, bool], speed: float
) -> tuple[list[float], list[float]]:
    """Masses and velocities with those of a floor, of a ceiling, that perhaps move."""
    floor, ceiling, moving = walls
    if floor:
        mass, velocity = [INF, *mass], [float(rng.uniform(-0.5, 0.5) * speed) if moving else 0.0, *velocity]
    if ceiling:
        mass, velocity = [*mass, INF], [*velocity, float(rng.uniform(-0.5, 0.5) * speed) if moving else 0.0]
    return mass, velocity


def spaced(
    rng: Any, n: int, depth: float, velocity: list[float], ways: Collection[str] = ALL
) -> tuple[list[float], list[float]]:
    """Gaps of 2e-3 to 2e3 times `depth`; ties, touching rows (as fast as each other), overlaps."""
    way, size = rng.random(), nice(rng, depth * 10.0 ** rng.uniform(-1.0, 3.0))
    if way < 0.2 and "equal" in ways:
        return [size] * n, velocity
    gap = [nice(rng, size * x) for x in rng.uniform(0.02, 2.0, n)]
    if way < 0.45 and "touching" in ways:
        v = list(velocity)
        for c in range(n):
            if rng.random() < 0.6:
                gap[c] = 0.0
                if rng.random() < 0.8:
                    v[c + 1] = v[c]
        if any(v[c] != v[c + 1] or gap[c] > 0.0 for c in range(n)):
            velocity = v
    elif way < 0.6 and "overlapping" in ways:
        gap = [-depth * float(rng.uniform(0.05, 1.0)) if rng.random() < 0.4 else x for x in gap]
    return gap, velocity


# laws


@dataclass(frozen=True)
class OwnHertz:
    """F = k ξ^(3/2), as a user writes it."""

    k: float

    def force(self, xi: float, xi_dot: float, pair: gr.Pair) -> float:
        return self.k * xi * math.sqrt(xi)


@dataclass(frozen=True)
class OwnDashpot:
    """F = k ξ + γ ξ̇, as a user writes it."""

    k: float
    gamma: float

    def force(self, xi: float, xi_dot: float, pair: gr.Pair) -> float:
        return self.k * xi + self.gamma * xi_dot


@dataclass(frozen=True)
class OwnPlastic:
    """Loading k ξ; unloading straight to zero at half the largest overlap."""

    k: float
    memory = True
    rate_dependent = False

    def force(self, xi: float, xi_dot: float, pair: gr.Pair, xi_max: float) -> float:
        return self.k * xi if xi >= xi_max else self.k * (2.0 * xi - xi_max)


@dataclass(frozen=True)
class Softening:
    """F = k ξ (1 + x/(x + ξ)), without any trait."""

    k: float
    x: float

    def force(self, xi: float, xi_dot: float, pair: gr.Pair) -> float:
        return self.k * xi * (1.0 + self.x / (self.x + xi))


@dataclass(frozen=True)
class Stiffening:
    """F = k ξ + k3 ξ³ + γ ξ̇."""

    k: float
    k3: float
    gamma: float

    def force(self, xi: float, xi_dot: float, pair: gr.Pair) -> float:
        return self.k * xi + self.k3 * xi**3 + self.gamma * xi_dot


EXPONENTS = {0.02: 1.25, 0.2: 4.0 / 3.0, 1.0: 2.0}
"""Powers instead of damping ratios."""
LAWS: dict[str, Callable[[float, float, float], Any]] = {
    "spring": lambda k, zeta, m: gr.LinearDashpot(k),
    "dashpot": lambda k, zeta, m: gr.LinearDashpot(k, 2.0 * zeta * math.sqrt(k * m)),
    "Hertz": lambda k, zeta, m: gr.Hertz(k),
    "viscoelastic": lambda k, zeta, m: gr.ViscoelasticHertz(k, 2.0 * zeta * k**0.6 * m**0.4),
    "Tsuji": lambda k, zeta, m: gr.TsujiHertz(k, 2.0 * zeta),
    "power": lambda k, zeta, m: gr.PowerLaw(k, EXPONENTS.get(zeta, 3.0)),
    "Walton-Braun": lambda k, zeta, m: gr.WaltonBraun(k, 2.0 * k),
    "own Hertz": lambda k, zeta, m: OwnHertz(k),
    "own dashpot": lambda k, zeta, m: OwnDashpot(k, 2.0 * zeta * math.sqrt(k * m)),
    "own with memory": lambda k, zeta, m: OwnPlastic(k),
    "stiffening": lambda k, zeta, m: Stiffening(k, 1e3 * k, 2.0 * zeta * math.sqrt(k * m)),
    "softening": lambda k, zeta, m: Softening(k, 0.01),
}
"""Law of stiffness k, about the damping ratio ζ, for a reduced mass."""
POWERS = ("spring", "dashpot", "Hertz", "viscoelastic", "Tsuji", "power")
"""Those that the located method compiles."""
ELASTIC = ("spring", "Hertz", "power", "own Hertz", "softening")


def laws(rng: Any, one: gr.Scene, names: Collection[str], k: tuple[float, float] = (2.0, 6.0)) -> tuple[Any, ...]:
    """One law for each pair: of one kind, mixed, or one and the same for all."""
    chosen = list(names) if rng.random() < 0.3 else [str(rng.choice(list(names)))]
    each = tuple(
        LAWS[str(rng.choice(chosen))](10.0 ** rng.uniform(*k), float(rng.choice([0.02, 0.2, 1.0])), pair.m_eff)
        for pair in one.pairs
    )
    return each[:1] * len(each) if rng.random() < 0.4 else each


def m_effs(mass: list[float]) -> list[float]:
    """Reduced masses of neighbours."""
    inverse = [0.0 if m == INF else 1.0 / m for m in mass]
    return [1.0 / (a + b) for a, b in pairwise(inverse)]


def motion(rng: Any, t_end: float = 1.0) -> Any:
    """How a wall moves from 0 to `t_end`, at some 0.3 m/s at most: a sine, cubics, or a function."""
    frequency, phase = 10.0 ** rng.uniform(0.0, 2.0) / t_end, float(rng.uniform(-4.0, 4.0))
    sine = gr.walls.Sine(0.05 * float(rng.random()) / frequency, frequency, phase)
    sort = rng.integers(4)
    if sort == 0:
        breaks = t_end * np.array([0.0, *np.sort(rng.uniform(0.0, 1.0, 3)), 1.0])
        return gr.walls.Piecewise(CubicHermiteSpline(breaks, *(rng.normal(size=(2, 5)) * [[0.02 * t_end], [0.1]])))
    return sine if sort < 3 else gr.walls.Motion(sine.displacement)


def driven(rng: Any, one: gr.Scene, t_end: float = 1.0) -> gr.Scene:
    """The scene with walls that move by `motion`, forces on balls, or both, as far as there are walls."""
    floor, ceiling = (motion(rng, t_end) if wall and rng.random() < 0.7 else None for wall in one.is_wall[[0, -1]])
    force = np.where(one.is_wall, 0.0, rng.normal(size=one.n) * np.where(one.is_wall, 0.0, one.mass))
    return one.replace(floor=floor, ceiling=ceiling, external_force=force if rng.random() < 0.5 else None)

"""Scenes of balls that fall on a floor, and helpers for all scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine import check, signature
from granular._engine.check import Array
from granular.scene import Scene, in_order, walls

if TYPE_CHECKING:
    from granular.cases.balls import Ball


@signature.face
def three_balls(
    radii: Sequence[float] = (0.10, 0.01), gap: float = 1e-4, height: float = 0.6, density: float = 900.0,
    gravity: float = 9.81,
) -> Scene:
    """Two balls, one above the other, dropped on a floor (Müller & Pöschel 2011).

    The floor counts as the third ball, as in Fig. 1 of the paper. Both balls are released from rest. Pair 0 is the
    floor and the lower ball, pair 1 the two balls.

    Parameters
    ----------
    radii : two floats
        Radii R1, R2 in m, bottom to top.
    gap : float
        Distance Δh between the surfaces of the two balls in m.
    height : float
        Height z1 of the *centre* of the lower ball above the floor in m, at least R1.
    density : float
        Density ρ in kg/m³. The paper does not give it. Only 858 to 936 reproduces all of its observations.
    gravity : float
        g in m/s².
    """
    r = check.positive("radii", radii, "radius", "Give the lower and the upper radius.", (2,))
    lower = float(r[0])
    z1 = check.number("height", height, at_least=lower, fix="It is the height of the lower ball's centre.")
    return above_floor(mass_of(r, density), r, z1 - lower, check.number("gap", gap), 0.0, gravity)


@signature.face
def ball_stack(
    n: int = 3, mass_ratio: float = 0.1, masses: Sequence[float] | None = None, height: float | None = None,
    speed: float | None = None, gap: float | Sequence[float] = 1e-4, density: float = 900.0, gravity: float = 9.81,
) -> Scene:
    """Stack of balls that fall on a floor, each lighter than the ball below.

    The stack throws its top ball high (Harter, Kerwin). It is either dropped from rest, or hits the floor at t = 0
    with a given speed.

    Parameters
    ----------
    n : int
        Number of balls.
    mass_ratio : float
        m[k+1]/m[k], the mass of a ball divided by the mass of the ball below. The lowest ball has 1 kg.
    masses : floats, optional
        All masses in kg, bottom to top, instead of `n` and `mass_ratio`.
    height : float, optional
        Drop height in m, from the floor to the lowest point of the lowest ball (default 1 m).
    speed : float, optional
        Instead of `height`: downward speed in m/s of all balls at t = 0, when the lowest ball touches the floor.
    gap : float or floats
        Distances between the surfaces of the balls in m: one, or n-1 bottom to top.
    density : float
        Density in kg/m³, which determines the radii.
    gravity : float
        g in m/s². 0 gives the textbook stack in free flight.
    """
    if height is not None and speed is not None:
        raise ValueError(f"Only one of `height` and `speed` can be given, got {height!r} and {speed!r}. A stack with a "
                         "speed starts at the floor.")
    m = geometric_masses(n, mass_ratio) if masses is None else (
        check.positive("masses", masses, "mass", "The floor is part of the scene."))
    drop = 0.0 if speed is not None else check.number("height", 1.0 if height is None else height, at_least=0.0)
    v = 0.0 if speed is None else check.number("speed", speed, above=0.0, fix="It always points downwards.")
    return above_floor(m, radius_of(m, density), drop, gap, v, gravity)


@signature.face
def column(
    n: int = 5, gap: float | Sequence[float] = 1e-3, speed: float = 1.0, mass: float = 1.0, density: float = 900.0,
    gravity: float = 0.0,
) -> Scene:
    """Column of equal balls that falls on a floor.

    It shows how a column bounces back as a whole.

    Parameters
    ----------
    n : int
        Number of balls.
    gap : float or floats
        Distances between the surfaces in m: one, or n bottom to top, beginning at the floor.
    speed : float
        Downward speed in m/s of all balls at the start.
    mass : float
        Mass of a ball in kg.
    density : float
        Density in kg/m³, which determines the radius.
    gravity : float
        g in m/s².
    """
    count = count_of(n)
    m = np.full(count, check.number("mass", mass, above=0.0))
    v = check.number("speed", speed, at_least=0.0, fix="It always points downwards.")
    floor, *between = gaps_of(gap, count)
    return above_floor(m, radius_of(m, density), floor, between, v, gravity)


@signature.face
def bouncing_ball(
    height: float | None = None, radius: float = 0.01, speed: float = 0.0, density: float = 900.0,
    gravity: float = 9.81, plate: Any = None,
) -> Scene:
    """One ball bouncing on a floor until it comes to rest, or on a shaken plate.

    On a plate z = A sin(ωt) with Γ = A ω²/g, a hard ball can bounce once per k periods if Γ > G_k = kπ (1 - ε)/(1 + ε).
    The period of this motion doubles at Γ = √(G_k² + [2(1 + ε²)/(1 + ε)²]²).

    Parameters
    ----------
    height : float, optional
        Drop height in m, from the floor to the lowest point of the ball. Defaults to 1, on a plate to 0, where the ball
        starts at rest.
    radius : float
        Radius in m.
    speed : float
        Downward speed of the ball in m/s at the start.
    density : float
        Density in kg/m³.
    gravity : float
        g in m/s².
    plate : granular.walls.Sine, Piecewise or Motion, optional
        Motion of the floor. On the command line type=Sine gamma=2 frequency=50, or amplitude= (in m) instead of gamma=.
    """
    r = np.array([check.number("radius", radius, above=0.0)])
    drop = check.number("height", (1.0 if plate is None else 0.0) if height is None else height, at_least=0.0)
    v = check.number("speed", speed, at_least=0.0, fix="It always points downwards.")
    return above_floor(mass_of(r, density), r, drop, (), v, gravity, plate)


@signature.face
def vibrated_column(
    n: int = 10, gamma: float = 10.0, frequency: float = 20.0, amplitude: float | None = None,
    phase: float = 0.5 * math.pi, gap: float | Sequence[float] = 1e-3, radius: float = 0.005, density: float = 900.0,
    gravity: float = 9.81,
) -> Scene:
    """Column of equal balls on a shaken floor: z = A sin(2π f t + φ), Γ = A (2π f)²/g.

    If N (1 - ε) is small, hard spheres are fluidized: their centre of mass rises to h_cm ≈ 1.25 (A 2π f)²/(g N (1 -
    ε)). If N (1 - ε) is large, the column moves as one body (Luding et al. 1994).

    Parameters
    ----------
    n : int
        Number of balls N.
    gamma : float
        Largest acceleration Γ of the floor, as a multiple of g.
    frequency : float
        Frequency f in Hz.
    amplitude : float, optional
        Amplitude A in m, instead of `gamma`.
    phase : float
        Phase φ in rad at t = 0. At π/2 the floor starts at its highest point at rest. At 0 it starts with its largest
        speed 2π f A.
    gap : float or floats
        Distances between the surfaces in m: one, or n bottom to top, beginning at the floor.
    radius : float
        Radius of a ball in m.
    density : float
        Density in kg/m³.
    gravity : float
        g in m/s², positive if `gamma` is used.
    """
    count = count_of(n)
    r = np.full(count, check.number("radius", radius, above=0.0))
    plate = walls.Sine(amplitude, frequency, phase) if amplitude is not None else (
        walls.Sine.from_acceleration(gamma, frequency, gravity, phase))
    floor, *between = gaps_of(gap, count)
    return above_floor(mass_of(r, density), r, floor, between, 0.0, gravity, plate)


@signature.face
def real_balls(
    lower: str | Ball = "basketball", upper: str | Ball | None = "tennis ball", gap: float = 0.0, height: float = 1.0,
    gravity: float = 9.81,
) -> Scene:
    """Two real balls, one on top of the other, dropped on a hard floor; or one ball.

    `granular.balls` describes the contact of the two balls.

    Parameters
    ----------
    lower, upper : str or Ball
        Names in `granular.balls.BALLS`, or your own balls. If `upper` is None, the lower ball falls alone.
    gap : float
        Distance between the surfaces of the two balls in m.
    height : float
        Drop height in m, from the floor to the lowest point of the lower ball.
    gravity : float
        g in m/s².
    """
    from granular.cases.balls import named

    balls = [named(lower, "lower"), *([] if upper is None else [named(upper, "upper")])]
    m, r = (np.array([getattr(ball, name) for ball in balls]) for name in ("mass", "radius"))
    drop = check.number("height", height, at_least=0.0)
    return above_floor(m, r, drop, [check.number("gap", gap)] * (len(balls) - 1), 0.0, gravity)


@np.errstate(over="ignore")
def mass_of(radius: Array, density: float) -> Array:
    """Masses in kg of spheres with radii in m and a density in kg/m³."""
    return 4.0 / 3.0 * math.pi * check.number("density", density, above=0.0) * radius**3


@np.errstate(over="ignore")
def radius_of(mass: Array, density: float) -> Array:
    """Radii in m of spheres with masses in kg and a density in kg/m³."""
    return np.asarray(np.cbrt(mass * 0.75 / (math.pi * check.number("density", density, above=0.0))))


def count_of(n: int, at_least: int = 1) -> int:
    """Return the number of balls `n` as an int, at least `at_least`."""
    return check.integer("n", n, at_least=at_least, at_most=check.MAX_REQUESTED_COUNT)


@np.errstate(over="ignore")
def geometric_masses(n: int, mass_ratio: float) -> Array:
    """Return `n` masses in kg: 1, mass_ratio, mass_ratio², …"""
    count = count_of(n)
    return np.asarray(np.power(check.number("mass_ratio", mass_ratio, above=0.0), np.arange(count, dtype=np.float64)))


def gaps_of(gap: float | Sequence[float], n_pairs: int, name: str = "gap") -> Array:
    """Return `n_pairs` gaps in m from one number or a sequence.

    `name` is the name of the argument in error messages.
    """
    if check.is_single(gap):
        return np.full(n_pairs, check.number(name, gap))
    return check.array(name, gap, (n_pairs,), fix="Give one gap for all pairs, or one per pair from the bottom up.")


def above_floor(
    mass: Array, radius: Array, drop: float, gap: float | Sequence[float], speed: float, gravity: float,
    plate: Any = None,
) -> Scene:
    """Return a scene of balls above a floor, all moving down with `speed` in m/s.

    Parameters
    ----------
    mass, radius : array
        Masses in kg and radii in m, bottom to top, without the floor.
    drop : float
        Gap in m between the floor and the lowest ball.
    gap : float or floats
        Gaps in m between the balls, one or one per pair.
    speed, gravity : float
        Downward speed in m/s of all balls, and g in m/s².
    plate : granular.walls.Sine, Piecewise or Motion, optional
        Motion of the floor.
    """
    n = len(mass)
    velocity = [0.0] + [0.0 - speed] * n  # not -speed, which would be -0.0 at rest
    gaps = [drop, *gaps_of(gap, n - 1)]
    return in_order(Scene([math.inf, *mass], [0.0, *radius], gaps, velocity, gravity, floor=plate))

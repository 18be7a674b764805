"""A wall at a temperature: every ball that hits it leaves with a speed drawn anew."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular._engine import check
from granular._engine.kernels import kernel

WORD = 0xFFFFFFFF
"""Mask of 32 bits: no sum or shift of such words exceeds 63 bits, so that compiled and plain agree."""
PARITY = 0x1BD11BDA
TURNS = (13, 15, 26, 6, 17, 29, 16, 24)
LARGEST = math.sqrt(2.0 * 53.0 * math.log(2.0))
"""Speed, in √(T/m), above which nothing is ever drawn: that of the smallest U, 2^-53."""


@check.face
@dataclass(frozen=True)
class Thermal:
    """A wall that gives a ball of mass m that hits it the speed √(-2 (T/m) ln U) away from it, U uniform in (0, 1).

    That is the Maxwellian of the flux, v/(T/m) exp(-m v²/2T), with which a gas at rest at temperature T meets the
    wall; half a Gaussian would be colder. What the ball brought is forgotten, and the rule or law of that pair is not
    asked: also between soft spheres the wall acts at once, at the touch.

    Parameters
    ----------
    temperature : float
        T, the temperature times Boltzmann's constant, in J; positive.
    seed : int
        Of the random numbers, not negative.

    Raises
    ------
    TypeError, ValueError
        For what is no such number.

    Notes
    -----
    U = (n + ½)·2⁻⁵² with 52 bits n of the counter-based generator Threefry-2×32, of 20 rounds (Salmon, Moraes, Dror &
    Shaw, Proc. SC11, 2011), at (seed, floor or ceiling, how-manieth hit of that wall): all engines and a run that is
    resumed draw the same numbers.
    """

    temperature: float
    seed: int = 0

    def __post_init__(self) -> None:
        fix = "k_B T in J; a wall that only reflects needs none"
        self.__dict__.update(temperature=check.number("temperature", self.temperature, above=0.0, fix=fix),
                             seed=check.whole("seed", self.seed))

    def drawn(self, side: int, hit: int, mass: float) -> float:
        """Return the speed in m/s that the hit of number `hit`, from 0, gives a ball of `mass` in kg.

        Parameters
        ----------
        side : int
            0 for a floor, 1 for a ceiling.
        """
        return drawn(self.temperature, self.seed, side, hit, mass)

    def fastest(self, mass: float) -> float:
        """Return a speed in m/s that no ball of `mass` in kg leaves with."""
        return LARGEST * math.sqrt(self.temperature / mass)


@kernel
def drawn(temperature: float, seed: int, side: int, hit: int, mass: float) -> float:
    """Return the speed in m/s away from a thermal wall after a hit; see `Thermal.drawn`."""
    high, low = threefry(seed & WORD, ((seed >> 32) << 1 | side) & WORD, hit & WORD, hit >> 32)
    u = (float(high << 20 | low >> 12) + 0.5) * 2.0**-52
    return math.sqrt(-2.0 * (temperature / mass) * math.log(u))


@kernel
def threefry(key_0: int, key_1: int, count_0: int, count_1: int) -> tuple[int, int]:
    """Return two random words of 32 bits, those of Threefry-2×32 with 20 rounds, from a key and a counter."""
    key_2 = PARITY ^ key_0 ^ key_1
    x, y = (count_0 + key_0) & WORD, (count_1 + key_1) & WORD
    for five in range(1, 6):
        for turn in range(4):
            r = TURNS[(five - 1) % 2 * 4 + turn]
            x = (x + y) & WORD
            y = ((y << r | y >> (32 - r)) & WORD) ^ x
        key_0, key_1, key_2 = key_1, key_2, key_0
        x, y = (x + key_0) & WORD, (y + key_1 + five) & WORD
    return x, y

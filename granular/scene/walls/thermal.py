"""Thermal wall: every ball that hits it leaves with a random speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular._engine import check, signature
from granular._engine.kernels import kernel

WORD_MASK = 0xFFFFFFFF
"""Mask of a word of 32 bits.

Sums and shifts of such words need less than 63 bits, so compiled and interpreted code give the same numbers.
"""
# key parity and rotation distances as given by Salmon et al.
KEY_PARITY = 0x1BD11BDA
ROTATION_BITS = (13, 15, 26, 6, 17, 29, 16, 24)
MAX_THERMAL_SPEED = math.sqrt(2.0 * 53.0 * math.log(2.0))
"""Largest possible speed of a ball that leaves a thermal wall, in units of √(T/m).

It belongs to the smallest random number U = 2⁻⁵³ of `Thermal`.
"""


@signature.face
@dataclass(frozen=True)
class Thermal:
    """Wall at a temperature T, which every ball leaves with a random speed.

    A ball of mass m leaves with the speed v = √(-2 (T/m) ln U) away from the wall, where U is uniform in (0, 1). Its
    probability density v/(T/m) exp(-m v²/2T) is the speed distribution of the particles of a gas at temperature T that
    hit a wall. A half Gaussian would be colder. The outgoing speed does not depend on the incoming speed. The rule or
    force law of the pair is ignored. Also for soft spheres the wall acts instantaneously, when ball and wall touch.

    Parameters
    ----------
    temperature : float
        T in J, the temperature times Boltzmann's constant; positive.
    seed : int
        Seed of the random numbers, not negative. Defaults to 0.

    Raises
    ------
    TypeError, ValueError
        If an argument is not a number in its range.

    Notes
    -----
    U = (n + ½)·2⁻⁵², where n has 52 bits of the counter-based generator Threefry-2×32 with 20 rounds (Salmon, Moraes,
    Dror & Shaw, Proc. SC11, 2011). Key and counter are the seed, floor or ceiling, and the number of the hit on that
    wall. All engines, and a resumed run, therefore draw the same numbers.
    """

    temperature: float
    seed: int = 0

    def __post_init__(self) -> None:
        fix = "It is k_B T in J. A wall that only reflects balls is not thermal."
        self.__dict__.update(temperature=check.number("temperature", self.temperature, above=0.0, fix=fix),
                             seed=check.integer("seed", self.seed))

    def drawn(self, side: int, hit: int, mass: float) -> float:
        """Return the speed in m/s with which a ball leaves the wall after a hit.

        Parameters
        ----------
        side : int
            0 for a floor, 1 for a ceiling.
        hit : int
            Number of the hit on that wall, from 0.
        mass : float
            Mass of the ball in kg.
        """
        return drawn(self.temperature, self.seed, side, hit, mass)

    def fastest(self, mass: float) -> float:
        """Return an upper bound (m/s) of the speed of a ball of `mass` (kg) after a hit."""
        return MAX_THERMAL_SPEED * math.sqrt(self.temperature / mass)


@kernel
def drawn(temperature: float, seed: int, side: int, hit: int, mass: float) -> float:
    """Return the speed in m/s with which a ball leaves a thermal wall.

    `temperature` (J), `seed`, `side`, `hit` and `mass` (kg) are explained in `Thermal.drawn`.
    """
    high, low = threefry(seed & WORD_MASK, ((seed >> 32) << 1 | side) & WORD_MASK, hit & WORD_MASK, hit >> 32)
    # the upper 52 of 64 bits; U is never 0 or 1
    u = (float(high << 20 | low >> 12) + 0.5) * 2.0**-52
    return math.sqrt(-2.0 * (temperature / mass) * math.log(u))


@kernel
def threefry(key_0: int, key_1: int, count_0: int, count_1: int) -> tuple[int, int]:
    """Return two random words of 32 bits from a key and a counter of two words each.

    The generator is Threefry-2×32 with 20 rounds.
    """
    key_2 = KEY_PARITY ^ key_0 ^ key_1
    x, y = (count_0 + key_0) & WORD_MASK, (count_1 + key_1) & WORD_MASK
    # each block of four rounds ends with an injection of the key
    for injection in range(1, 6):
        for i in range(4):
            r = ROTATION_BITS[(injection - 1) % 2 * 4 + i]
            x = (x + y) & WORD_MASK
            y = ((y << r | y >> (32 - r)) & WORD_MASK) ^ x
        key_0, key_1, key_2 = key_1, key_2, key_0
        x, y = (x + key_0) & WORD_MASK, (y + key_1 + injection) & WORD_MASK
    return x, y

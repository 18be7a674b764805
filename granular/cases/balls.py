"""Real balls: masses, radii, contact durations on a hard floor and restitutions.

A contact duration is measured from a film of a single bounce. With the restitution it determines the stiffness of a
linear spring and dashpot, k = m (2f(ζ)/t_c)², and its damping γ. `granular.laws.dashpot` defines f(ζ).

**Masses, radii and restitutions are measured. Contact durations are estimates** from inflation pressures, Hertz's
theory and static compression. They are accurate to ±20 % at best, for a superball to a factor of 2: `Ball.spread`.
All values hold for approach speeds near 4.4 m/s, a drop from 1 m.

Sources: rules of the sports (ITF, ITTF, FIFA, basketball); bounces on hard floors and steel plates; Cross, Am. J. Phys.
67, 222 (1999) and Sports Eng. 2, 23 (1999); Hertz's theory for steel and glass on a thick steel plate. The contact of
two balls has not been measured, see `contact`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular._engine import check, signature
from granular.laws.dashpot import damping_ratio, reduced_duration

__all__ = ["BALLS", "PRESETS", "RULES", "Ball", "Contact", "contact", "named"]
__dir__ = __all__.copy


@signature.face
@dataclass(frozen=True)
class Ball:
    """A ball and its bounce on a hard, flat floor.

    Parameters
    ----------
    mass, radius : float
        Mass in kg and radius in m.
    duration : float
        Contact duration t_c of a bounce in s.
    restitution : float
        Coefficient of restitution ε of a bounce, in (0, 1].
    filled : bool
        Whether the stiffness of the ball comes from the air inside, not from its wall.
    spread : float
        Uncertainty factor of `duration`: the true value is between `duration` / `spread` and `duration` · `spread`.
    """

    mass: float
    radius: float
    duration: float
    restitution: float
    filled: bool = False
    spread: float = 1.2

    def __post_init__(self) -> None:
        for name in ("mass", "radius", "duration"):
            check.number(name, getattr(self, name), above=0.0)
        check.number("restitution", self.restitution, above=0.0, at_most=1.0)
        check.number("spread", self.spread, at_least=1.0)
        check.boolean("filled", self.filled)

    @property
    def stiffness(self) -> float:
        """Stiffness k = m (2f(ζ)/t_c)² in N/m of a dashpot with this duration t_c and ε.

        The damping ratio ζ follows from ε. `granular.laws.dashpot` defines f(ζ).
        """
        frequency = reduced_duration(damping_ratio(self.restitution)) / self.duration
        return self.mass * frequency * frequency


BALLS = {
    "basketball": Ball(0.624, 0.119, 12e-3, 0.82, filled=True),
    "football": Ball(0.430, 0.110, 9e-3, 0.84, filled=True),
    "volleyball": Ball(0.270, 0.105, 11.5e-3, 0.78, filled=True),
    "tennis ball": Ball(0.0577, 0.033, 5e-3, 0.78, filled=True),
    "superball": Ball(0.045, 0.0225, 4e-3, 0.88, spread=2.0),
    "small superball": Ball(0.0098, 0.0135, 2.4e-3, 0.88, spread=2.0),
    "golf ball": Ball(0.0459, 0.02135, 0.85e-3, 0.83),
    "table-tennis ball": Ball(0.0027, 0.020, 0.8e-3, 0.88),
    "steel ball": Ball(0.0642, 0.0125, 0.064e-3, 0.90),
    "small steel ball": Ball(0.00411, 0.005, 0.026e-3, 0.90),
    "glass marble": Ball(0.0053, 0.008, 0.035e-3, 0.92),
}
"""Balls by name, see `granular.balls`.

The restitution of steel and glass, and all values of the volleyball, are estimates without a source.
"""

PRESETS = (
    ("basketball", "tennis ball", 0.05), ("basketball", "table-tennis ball", 0.05), ("football", "tennis ball", 0.04),
    ("golf ball", "table-tennis ball", 3e-3), ("superball", "small superball", 0.02),
    ("steel ball", "small steel ball", 1e-3),
)
"""Lower ball, upper ball, and a gap in m at which hard spheres are accurate.

After a drop from 1 m, the error of the hard-sphere model is at most 1 % of the impact speed. With a basketball as the
lower ball, an error of 0.7 to 1.8 % remains at any gap. Its contact is so long that gravity matters.
"""

RULES = ("lens", "series")
"""Rules for the contact of two balls, see `contact`."""


@signature.face
@dataclass(frozen=True)
class Contact:
    """Stiffness in N/m and coefficient of restitution of the contact of two balls."""

    stiffness: float
    restitution: float


@signature.face
def named(ball: str | Ball, what: str = "ball") -> Ball:
    """Return a ball of `BALLS` by its name. A `Ball` is returned unchanged.

    `what` is the name of the argument in error messages.
    """
    return ball if isinstance(ball, Ball) else BALLS[check.choice(what, ball, list(BALLS))]


@signature.face
def contact(lower: str | Ball, upper: str | Ball, rule: str = "lens") -> Contact:
    """Return the contact of two balls, estimated from their bounces on a floor.

    The contact stores energy in both balls, in proportion to 1/k_i. Each ball dissipates the fraction 1 - ε_i² of its
    part: 1 - ε₁₂² = Σ (1 - ε_i²)/k_i / Σ 1/k_i. There are two rules for the stiffness k₁₂. Neither rule has been
    tested by measurements. The rules agree for two air-filled balls of equal pressure.

    Parameters
    ----------
    lower, upper : str or Ball
        Names in `BALLS`, or your own balls.
    rule : {"lens", "series"}
        "series": two springs in series, 1/k₁₂ = 1/k₁ + 1/k₂. "lens": on an air-filled lower ball, the contact area
        with the upper ball is smaller than with a floor. This reduces k₁ to k₁ R₂/(R₁ + R₂), in series with k₂. If
        both balls are air-filled, k₂ is left out. If the lower ball is not air-filled, "lens" equals "series".
    """
    lower_ball, upper_ball = named(lower, "lower"), named(upper, "upper")
    lower_compliance, upper_compliance = 1.0 / lower_ball.stiffness, 1.0 / upper_ball.stiffness
    energy_loss = ((1.0 - lower_ball.restitution**2) * lower_compliance
                   + (1.0 - upper_ball.restitution**2) * upper_compliance)
    eps = math.sqrt(1.0 - energy_loss / (lower_compliance + upper_compliance))
    if check.choice("rule", rule, RULES) == "lens" and lower_ball.filled:
        lens_compliance = lower_compliance * (lower_ball.radius + upper_ball.radius) / upper_ball.radius
        return Contact(1.0 / (lens_compliance if upper_ball.filled else lens_compliance + upper_compliance), eps)
    return Contact(1.0 / (lower_compliance + upper_compliance), eps)

"""How small a fixed time step must be, before a run (default, warning) and after it (what really happened).

Explicit methods follow a contact only while dt·λ stays well below a limit: 2, and 1.05 for Gear's five values, whose
spectral radius is 1 + 6e-8 at dt·λ = 0.1, 1.01 at 1 and grows steeply from there. For the closed pairs of an assembly,
row sums of M⁻¹K and M⁻¹C bound its sharpest rate λ = ½ (b + √(b² + 4a)): ω₀ for one pair, 2√(k/m) inside a chain of
equal balls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from granular.laws import traits
from granular.scene import Pair, Scene, speed_scale
from granular.trajectory import stored_energy

WARN = 0.2
"""dt·λ from which results are doubtful."""
LIMIT = {"verlet": 2.0, "symplectic-euler": 2.0, "rk4": 2.0, "gear5": 1.05}
"""dt·λ from which results mean nothing. (RK4 grows only from 2√2, but at 2 it damps by a quarter a step.)"""


def expected_overlap(law: Any, pair: Pair, speed: float) -> float:
    """Overlap in m at which the elastic energy holds the kinetic energy ½ m_eff v² of an isolated contact."""
    energy = 0.5 * pair.m_eff * speed * speed
    plain = _without_memory(law)
    if not energy > 0.0:
        return 0.0
    xi = 1.0
    while stored_energy(plain, xi, pair) < energy and xi < 1e100:
        xi *= 2.0
    while stored_energy(plain, xi, pair) > energy and xi > 1e-100:
        xi *= 0.5
    lo, hi = xi, 2.0 * xi
    for _ in range(20):
        xi = math.sqrt(lo * hi)
        lo, hi = (xi, hi) if stored_energy(plain, xi, pair) < energy else (lo, xi)
    return xi


def sharpest_rate(
    scene: Scene, laws: Sequence[Any], overlap: Sequence[float], beside: Sequence[int] | None = None
) -> float:
    """Bound λ in 1/s over all pairs closed to the given overlaps in m (0: not closed).

    `beside[c]` says whether pairs c and c+1 are ever closed together (all are if not given).
    """
    w, n = scene.inverse_mass.tolist(), scene.n - 1
    slope = [
        traits.tangent(law, xi, pair) if xi > 0.0 else (0.0, 0.0)
        for law, xi, pair in zip(laws, overlap, scene.pairs, strict=True)
    ]
    together = [True] * n if beside is None else [bool(x) for x in beside]
    worst = 0.0
    for c in range(n):
        a, b = (x * (w[c] + w[c + 1]) for x in slope[c])
        if c > 0 and together[c - 1]:
            a, b = a + slope[c - 1][0] * w[c], b + slope[c - 1][1] * w[c]
        if c + 1 < n and together[c]:
            a, b = a + slope[c + 1][0] * w[c + 1], b + slope[c + 1][1] * w[c + 1]
        worst = max(worst, 0.5 * (b + math.sqrt(b * b + 4.0 * a)))
    return worst


def expected_rate(scene: Scene, laws: Sequence[Any]) -> float:
    """Sharpest rate λ in 1/s of any single contact, at the overlaps expected from the scene's speeds."""
    speed = speed_scale(scene)
    depth = [
        max(expected_overlap(law, pair, speed), -float(gap), 1e-30)
        for law, pair, gap in zip(laws, scene.pairs, scene.gap, strict=True)
    ]
    return sharpest_rate(scene, laws, depth, [0] * (scene.n - 1))


class _Loading:
    """A law with memory, as it is while loading."""

    def __init__(self, law: Any) -> None:
        self.law = law

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return float(self.law.force(xi, xi_dot, pair, xi))


def _without_memory(law: Any) -> Any:
    return _Loading(law) if getattr(law, "memory", False) else law

"""Random three-ball scenes against a slow twin: short Taylor steps in 40 digits and bisection, nothing shared."""

from __future__ import annotations

import math
import random
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from granular import until
from granular.laws import LinearDashpot
from granular.md import simulate as run
from granular.scene import Scene


class Twin:
    """Two balls over a floor with clipped linear dashpots, by short Taylor steps and bisection in many digits.

    The state is (ξ0, ξ1, η0, η1). A pair is wrong when it pushes without ξ > 0 and φ = kξ + γη > 0, or the reverse.
    """

    ORDER, FINE, LOOKS = 24, 6, 4

    def __init__(self, scene: Scene, laws: tuple[LinearDashpot, ...]) -> None:
        self.w = [mp.mpf(0), 1 / mp.mpf(float(scene.mass[1])), 1 / mp.mpf(float(scene.mass[2]))]
        self.k, self.gamma = [mp.mpf(law.k) for law in laws], [mp.mpf(law.gamma) for law in laws]
        v = [mp.mpf(float(x)) for x in scene.velocity]
        self.y = [*(-mp.mpf(float(x)) for x in scene.gap), v[0] - v[1], v[1] - v[2]]
        self.pull = [mp.mpf(scene.gravity), mp.mpf(0)]
        self.t, self.pushes = mp.mpf(0), [False, False]
        self.log: list[list[Any]] = []

    def phi(self, y: list[Any], c: int) -> Any:
        return self.k[c] * y[c] + self.gamma[c] * y[2 + c]

    def wrong(self, y: list[Any]) -> list[int]:
        return [c for c in (0, 1) if self.pushes[c] != (y[c] > 0 and self.phi(y, c) > 0)]

    def series(self) -> list[list[Any]]:
        """Taylor coefficients of the state in the current mode."""
        rows = [list(self.y)]
        for n in range(self.ORDER):
            y = rows[-1]
            f = [self.phi(y, c) if self.pushes[c] else 0 for c in (0, 1)]
            push = [self.w[1] * (f[1] - f[0]), self.w[1] * f[0] - (self.w[1] + self.w[2]) * f[1]]
            rate = [push[c] + (self.pull[c] if n == 0 else 0) for c in (0, 1)]
            rows.append([value / (n + 1) for value in (y[2], y[3], *rate)])
        return rows

    def ahead(self, rows: list[list[Any]], t: Any) -> list[Any]:
        out = rows[-1]
        for row in reversed(rows[:-1]):
            out = [a * t + b for a, b in zip(out, row, strict=True)]
        return out

    def step(self) -> Any:
        """A time short against the motion of the current mode; to the next change of mode if nothing pushes."""
        rates = [self.w[1], self.w[1] + self.w[2]]
        fast = [mp.sqrt(rates[c] * self.k[c]) + rates[c] * self.gamma[c] for c in (0, 1) if self.pushes[c]]
        return 1 / (sum(fast) * self.FINE) if fast else min(self.flight(c) for c in (0, 1)) * (1 + mp.mpf(10) ** -35)

    def flight(self, c: int) -> Any:
        """Time until ξ or φ of a ballistic pair next changes sign."""
        half, later = self.pull[c] / 2, []
        slope = self.k[c] * self.y[2 + c] + self.gamma[c] * self.pull[c]
        for p, q, r in ((half, self.y[2 + c], self.y[c]), (half * self.k[c], slope, self.phi(self.y, c))):
            root = q * q - 4 * p * r
            if p != 0 and root >= 0:
                later += [(-q + sign * mp.sqrt(root)) / (2 * p) for sign in (1, -1)]
            elif p == 0 and q != 0:
                later.append(-r / q)
        return min((t for t in later if t > mp.mpf(10) ** -32), default=mp.inf)

    def run(self, nth: int, limit: float) -> None:
        """Go on until the floor contact begins for the nth time, or nothing can follow, or to a time limit."""
        self.toggle([c for c in (0, 1) if self.y[c] == 0 and self.y[2 + c] > 0])
        for _ in range(100_000):
            h = self.step()
            if h == mp.inf or self.t > limit:
                return
            rows = self.series()
            looks = [h * (i + 1) / self.LOOKS for i in range(self.LOOKS)] if any(self.pushes) else [h]
            high = next((t for t in looks if self.wrong(self.ahead(rows, t))), None)
            low = mp.mpf(0)
            while high is not None and high - low > high * mp.mpf(10) ** -36:
                middle = (low + high) / 2
                if self.wrong(self.ahead(rows, middle)):
                    high = middle
                else:
                    low = middle
            self.y, self.t = self.ahead(rows, high or h), self.t + (high or h)
            pairs = self.wrong(self.y)
            if 0 in pairs and not self.pushes[0] and sum(row[0] == 0 for row in self.log) + 1 == nth:
                return
            self.toggle(pairs)
        raise RuntimeError("no end")

    def toggle(self, pairs: list[int]) -> None:
        for c in pairs:
            if self.pushes[c]:
                row = next(row for row in reversed(self.log) if row[0] == c)
                row[2], row[3] = self.t, -self.y[2 + c]
            else:
                self.log.append([c, self.t, None, None])
            self.pushes[c] = not self.pushes[c]


def random_scene(seed: int) -> tuple[Scene, tuple[LinearDashpot, ...]]:
    """Two balls over a floor: radii, gap, speed, stiffness and restitution over wide ranges."""
    pick = random.Random(seed)
    r1, r2 = 0.1, 0.1 / 10 ** pick.uniform(-0.5, 1.5)
    m1, m2 = (4.0 / 3.0 * math.pi * r**3 * 900.0 for r in (r1, r2))
    speed, k = 10 ** pick.uniform(-1.0, 1.0), 10 ** pick.uniform(5.0, 9.0)
    contact = math.pi * math.sqrt(m1 / k)
    scene = Scene([math.inf, m1, m2], [0.0, r1, r2], [0.0, speed * contact * 10 ** pick.uniform(-3.0, 0.5)],
                  [0.0, -speed, -speed], pick.choice([0.0, 9.81]))
    eps = 1.0 if pick.random() < 0.2 else pick.uniform(0.3, 1.0)
    return scene, tuple(LinearDashpot.from_restitution(eps, k * pick.choice([1.0, 0.3, 4.0]), p) for p in scene.pairs)


def compare(seed: int) -> None:
    """The same contacts, at the same times, with the same velocities."""
    scene, laws = random_scene(seed)
    soft = run(scene, laws, until=until.contact(0, 2), engine="plain")
    with mp.workdps(40):
        twin = Twin(scene, laws)
        twin.run(2, 3.0 * float(soft.time[-1]))
    expected = sorted((float(b), c, float(e), float(rate)) for c, b, e, rate in twin.log if e is not None)
    found = soft.contacts[~np.isnan(soft.contacts["t_end"])]
    assert [row[1] for row in expected] == found["pair"].tolist()
    speed, duration = abs(float(scene.velocity[1])), math.pi * math.sqrt(float(scene.mass[1]) / laws[0].k)
    ill = 1e3 if len(expected) > 8 else 1e2  # many contacts of a light ball multiply every rounding
    assert found["t_begin"] == pytest.approx([row[0] for row in expected], abs=ill * 1e-14 * duration, rel=0)
    assert found["t_end"] == pytest.approx([row[2] for row in expected], abs=ill * 1e-14 * duration, rel=0)
    parting = found["v_out"][:, 1] - found["v_out"][:, 0]
    assert parting == pytest.approx([row[3] for row in expected], abs=ill * 1e-14 * speed, rel=0)


@pytest.mark.parametrize("seed", [1, *range(3, 10)])
def test_random_scenes(seed: int) -> None:
    """A few of them; `test_many_random_scenes` has five hundred."""
    compare(seed)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 600))
def test_many_random_scenes(seed: int) -> None:
    """Five hundred random scenes."""
    compare(seed)

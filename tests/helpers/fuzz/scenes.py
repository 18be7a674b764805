"""Seeded soft scenes: seed -> `Case`.

The independent solver takes part in choosing where a run ends: away from events, and after a few dozen contacts.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

import granular as gr
from tests.helpers.fuzz.laws import Spec
from tests.helpers.fuzz.solver import solve
from tests.helpers.scenes_at_random import built, m_effs, masses, nice, spaced, velocities, walled

STEPS = 2000
"""Steps of the solver after which a scene is cut off."""


@dataclass(frozen=True)
class Case:
    """A scene, its laws, and how it is run; until is (pair, nth), "separated" or None."""

    mass: tuple[float, ...]
    gap: tuple[float, ...]
    velocity: tuple[float, ...]
    gravity: float
    laws: tuple[Spec, ...]
    t_end: float | None = None
    until: Any = None
    samples: tuple[float, ...] | None = None

    def replace(self, **changes: Any) -> Case:
        """A copy with some fields changed."""
        return dataclasses.replace(self, **changes)

    def scene(self) -> gr.Scene:
        """The scene the engine gets."""
        return built(self.mass, self.gap, self.velocity, self.gravity)

    @property
    def names(self) -> str:
        """Its laws in one word."""
        names = sorted({law.name for law in self.laws})
        return names[0] if len(names) == 1 else "mixed"

    def to_json(self) -> dict[str, Any]:
        """A plain dict."""
        return {k: v for k, v in dataclasses.asdict(self).items() if v is not None} | {
            "laws": [[one.name, *one.numbers] for one in self.laws]
        }

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> Case:
        """The inverse."""
        out = {k: tuple(v) if isinstance(v, list) else v for k, v in plain.items()}
        return cls(**out | {"laws": tuple(Spec(name, tuple(numbers)) for name, *numbers in plain["laws"])})


def generate(seed: int, small: bool = False) -> Case:
    """Return the case of a seed; a `small` one has few balls and contacts, and is chosen by interpreted code."""
    for attempt in range(50):
        rng = np.random.default_rng([seed, attempt])
        case = _finished(rng, _start(rng, 3 if small else 8), small)
        if case is not None:
            return case
    raise AssertionError(f"seed {seed} gives no scene with a contact")


# how it starts


def _start(rng: Any, most: int) -> Case:
    """Masses, velocities, laws and gaps; no end yet."""
    balls = min(most, rng.choice([1, 2, 3, 4, 5, 6, 7, 8], p=[0.1, 0.18, 0.24, 0.18, 0.12, 0.08, 0.05, 0.05]).item())
    floor, ceiling = rng.random() < (0.5 if balls > 1 else 0.8), rng.random() < 0.2
    floor = floor or (balls == 1 and not ceiling)
    mass = masses(rng, balls)
    speed = nice(rng, 10.0 ** rng.uniform(-2.0, 1.0))
    velocity = velocities(rng, balls, speed)
    gravity = 0.0
    if rng.random() < (0.5 if floor else 0.15):
        gravity = 9.81 if rng.random() < 0.5 else nice(rng, 10.0 ** rng.uniform(-1.0, 1.3))
    moving = rng.random() < 0.3
    mass, velocity = walled(rng, mass, velocity, (floor, ceiling, moving), speed)
    m_eff = m_effs(mass)
    k = 10.0 ** rng.uniform(0.0, 10.0)
    laws = _laws(rng, m_eff, speed, k)
    depth = speed * math.sqrt(max(min(m_eff), 1e-3 * max(m_eff)) / k)
    gap, velocity = spaced(rng, len(m_eff), depth, velocity)
    return Case(tuple(mass), tuple(gap), tuple(velocity), gravity, laws)


# laws


def _laws(rng: Any, m_eff: list[float], speed: float, k: float) -> tuple[Spec, ...]:
    built_in = ["LinearDashpot", "Hertz", "ViscoelasticHertz", "TsujiHertz", "PowerLaw", "WaltonBraun"]
    own = ["PlainHertz", "PlainPower", "PlainDashpot", "PlainViscoelastic", "DampedPower", "TwoStiffnesses",
           "TwoDampings", "TwoViscosities", "Stiffening", "Exponential", "Hysteresis", "Saturated"]
    way = rng.random()
    if way < 0.45:
        names = [str(rng.choice(built_in))] * len(m_eff)
    elif way < 0.65:
        names = [str(x) for x in rng.choice(built_in, len(m_eff))]
    elif way < 0.9:
        names = [str(rng.choice(own))] * len(m_eff)
    else:
        names = [str(x) for x in rng.choice(built_in + own, len(m_eff))]
    if len(set(names)) == 1 and rng.random() < 0.5:  # one law for all
        m = m_eff[int(rng.integers(len(m_eff)))]
        return (_law(rng, names[0], m, speed, speed * math.sqrt(m / k)),) * len(m_eff)
    return tuple(_law(rng, name, m, speed, speed * math.sqrt(m / k)) for name, m in zip(names, m_eff, strict=True))


def _law(rng: Any, name: str, m: float, v: float, x: float) -> Spec:
    """A law whose contacts at speed v have about the depth x."""
    zeta = float(rng.choice([0.0, 1.0, 10.0 ** rng.uniform(-2.0, 0.5)], p=[0.1, 0.05, 0.85]))
    p = float(rng.choice([1.0, 1.25, 4.0 / 3.0, 1.5, 2.0, 3.0, 2.2])) if rng.random() < 0.4 else (
        int(rng.integers(12, 37 if rng.random() < 0.6 else 193)) / 12.0)
    if p > 3.0 and "Power" in name:
        x = 10.0 ** float(rng.uniform(-2.0, 0.3))

    def stiff(p: float) -> float:
        return nice(rng, m * v * v / x ** (p + 1.0) * 10.0 ** rng.uniform(-0.7, 0.7))

    def damp(d: float) -> float:
        return 2.0 * zeta * m * v / x ** (1.0 + d)

    if name == "LinearDashpot" or name == "PlainDashpot":
        return Spec(name, (stiff(1.0), nice(rng, damp(0.0))))
    if name == "Hertz" or name == "PlainHertz":
        return Spec(name, (stiff(1.5),))
    if name == "ViscoelasticHertz" or name == "PlainViscoelastic":
        return Spec(name, (stiff(1.5), nice(rng, damp(0.5))))
    if name == "TsujiHertz":
        return Spec(name, (stiff(1.5), nice(rng, 2.0 * zeta)))
    if name == "PowerLaw" or name == "PlainPower":
        return Spec(name, (stiff(p), p))
    if name == "DampedPower":
        p = min(p, 4.0)
        d = float(rng.choice([0.0, 0.25, 0.5, 1.0, p - 1.0, 0.5 * p, 1.0 / 3.0]))
        d = min(d, p - 0.25) if p > 1.0 else 0.0
        return Spec(name, (stiff(p), p, damp(d), d))
    if name == "WaltonBraun":
        k = stiff(1.0)
        return Spec(name, (k, k * (1.0 if rng.random() < 0.05 else float(1.0 + 10.0 ** rng.uniform(-1.5, 1.0)))))
    if name == "TwoStiffnesses":
        k = stiff(1.0)
        return Spec(name, (k, k * 10.0 ** float(rng.uniform(-1.0, 1.5)), x * float(rng.uniform(0.03, 0.9))))
    if name == "TwoDampings" or name == "TwoViscosities":
        d = 0.0 if name == "TwoDampings" else 0.5
        both = [damp(d), damp(d) * float(rng.choice([0.0, 0.3, 3.0]))]
        return Spec(name, (stiff(1.0 + d), *(both if rng.random() < 0.5 else both[::-1])))
    if name == "Stiffening":
        k = stiff(1.0)
        return Spec(name, (k, k / (x * x) * 10.0 ** float(rng.uniform(-1.0, 1.0)), damp(0.0)))
    if name == "Exponential":
        return Spec(name, (m * v * v / x, x * float(rng.uniform(0.2, 1.5))))
    if name == "Hysteresis":
        p = float(rng.choice([1.0, 1.5, 2.0]))
        return Spec(name, (stiff(p), p, float(rng.uniform(0.05, 0.6))))
    return Spec(name, (stiff(1.0), damp(0.0), v * float(rng.uniform(0.1, 1.0))))


# how it ends


def _finished(rng: Any, case: Case, small: bool) -> Case | None:
    """The case with its end, stop condition and samples; None if nothing happens in it."""
    contacts = int(rng.integers(2, 8 if small else 36))
    case = case.replace(t_end=_longest(case))
    tried = solve(case, rows=contacts, most=150 if small else STEPS, compiled=not small)
    case = case.replace(t_end=None)
    if len(tried.rows) == 0:
        return None
    speed = _speed(case, tried.rows)
    if speed < 1e-6 * max(abs(float(v)) for row in tried.rows for v in row[4:6]):
        return None
    first = _first_doubtful(case, tried.rows, speed)
    rows = [row for row in tried.rows if float(row[1]) < first]
    if not rows:
        return None
    times = sorted({float(t) for row in rows for t in (row[1], row[2]) if t <= min(float(tried.time), first)})
    last = min(float(tried.time), first, max(10.0 * times[-1], 0.0) or math.inf)
    bound = case.gravity > 0.0 or tried.status != "quiet" or _longest(case) is not None or first < math.inf
    if bound or rng.random() < 0.4:
        case = case.replace(t_end=_between(rng, times, last))
    way = rng.random()
    alone = _alone(rows)
    if way < 0.15 and alone:
        row = alone[int(rng.integers(len(alone)))]
        nth = sum(1 for one in rows if one[0] == row[0] and one[1] <= row[1])
        case = case.replace(until=(int(row[0]), nth))
    elif way < 0.2 and case.gravity == 0.0:
        case = case.replace(until="separated")
    if rng.random() < 0.4 and case.t_end is not None:
        inside = sorted(float(x) for x in rng.uniform(0.0, case.t_end, int(rng.integers(1, 6))))
        case = case.replace(samples=(*inside, case.t_end))
    return case


def _speed(case: Case, rows: Any) -> float:
    """The largest change of a relative speed by a contact."""
    return max(float(row[10]) * (1.0 / case.mass[int(row[0])] + 1.0 / case.mass[int(row[0]) + 1]) for row in rows)


def _first_doubtful(case: Case, rows: Any, speed: float) -> float:
    """When the first contact begins or ends so slowly that rounding decides whether it does; inf if none."""
    times, seen = [math.inf], set()
    for row in sorted(rows, key=lambda row: float(row[1])):
        c = int(row[0])
        woken = case.gap[c] <= 0.0 and c not in seen  # begins at rest, but there is no doubt
        seen.add(c)
        if abs(row[5] - row[4]) < 1e-6 * speed and not woken:
            times.append(float(row[1]))
        if abs(row[7] - row[6]) < 1e-6 * speed:
            times.append(float(row[2]))
    return min(times)


def _alone(rows: Any) -> list[Any]:
    """Contacts that begin well apart from all others: which of two at once is counted first is not defined."""
    return [
        row for i, row in enumerate(rows)
        if row[1] > 0.0 and all(i == k or abs(row[1] - one[1]) > 1e-9 * row[1] for k, one in enumerate(rows))
    ]


def _longest(case: Case) -> float | None:
    """Walls that approach each other leave no room in the end."""
    closing = case.velocity[0] - case.velocity[-1]
    if case.mass[0] == case.mass[-1] == math.inf and closing > 0.0:
        return 0.8 * max(sum(case.gap), 0.0) / closing
    return None


def _between(rng: Any, times: list[float], last: float) -> float:
    """A time in the second half of a run, well between two events."""
    marks = sorted({0.0, *times, last})
    if len(marks) == 1:
        return 1.0
    late = [(a, b) for a, b in pairwise(marks) if b > 0.4 * last]
    wide = [(a, b) for a, b in late if b - a > 1e-3 * max(d - c for c, d in late)]
    a, b = wide[int(rng.integers(len(wide)))]
    return a + float(rng.uniform(0.3, 0.7)) * (b - a)

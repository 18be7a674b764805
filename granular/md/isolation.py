"""Number of isolated contacts of a run, and durations of isolated contacts.

A contact is isolated if no neighbouring pair overlaps between the touch and the separation of its balls
(docs/concepts.md). It differs from a hard-sphere collision only by a delay and a displacement. The delay depends on the
duration t_c:

| law                                                   | duration                                        |
|-------------------------------------------------------|-------------------------------------------------|
| F = k ξ^p + γ ξ^((p-1)/2) ξ̇, all dashpots included    | D(p, ζ) (m_eff/k)^(1/(p+1)) v^((1-p)/(1+p))     |
| viscoelastic, F = k ξ^(3/2) + γ √ξ ξ̇                  | D(b) (m_eff/k)^(2/5) v^(-1/5)                   |
| any other                                             | integrated at a few speeds, cubic interpolation |

The functions D are dimensionless and therefore shared by pairs of all sizes. Here b = γ k^(-3/5) m_eff^(-2/5) v^(1/5).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import Ints, resolved
from granular.md import binary
from granular.run.trajectory import Trajectory
from granular.scene import Scene, speed_scale


def isolated_share(run: Trajectory) -> float:
    """Return the share of isolated contacts, or nan if they are not counted.

    Runs without contacts, of hard spheres and of fixed-step methods give nan.
    """
    if run.law is None or "isolated" not in run.stats or not run.stats["contacts"]:
        return math.nan
    return float(run.stats["isolated"] / run.stats["contacts"])


def numbers(run: Trajectory) -> dict[str, Any]:
    """Return the numbers of isolated contacts for JSON, None if not counted."""
    known = run.law is not None and "isolated" in run.stats
    return {"isolated": run.stats["isolated"] if known else None, "contacts": run.stats["contacts"] if known else None,
            "first_disturbed": run.first_disturbed if known else None}


def sentence(run: Trajectory) -> str:
    """Return a sentence with the certified number of isolated contacts, or ""."""
    share = isolated_share(run)
    if math.isnan(share):
        return ""
    isolated, contacts = _grouped(run.stats["isolated"]), _grouped(run.stats["contacts"])
    if share == 1.0:
        return "certified: " + ("the only contact" if contacts == "1" else f"all {contacts} contacts") + " isolated"
    return f"certified: {isolated} of {contacts} contacts isolated; first disturbed: {first_disturbed(run)}"


def first_disturbed(run: Trajectory) -> str:
    """Describe the first two neighbouring pairs that overlapped simultaneously.

    The text contains both pairs and the time.
    """
    time, pair = run.first_disturbed
    names = run.scene.pairs.name
    return f"pairs {names(pair)} and {names((pair + 1) % run.scene.n_pairs)} at t = {time:.9g} s"


def _grouped(count: int) -> str:
    """Format an integer in groups of three digits."""
    return f"{count:_}".replace("_", " ")


SMOOTH_VALUES_PER_OCTAVE, COSTLY_VALUES_PER_OCTAVE = 8, 2
"""Number of values per octave, of a closed form and of an integrated contact.

The former is smooth, the latter costly."""
SLOWEST_SPEED_SHARE = 2.0**-30
"""Smallest speed relative to the scene's own speeds.

Slower contacts get the duration at this speed."""


class Durations:
    """Durations of isolated contacts of the pairs of a scene.

    Parameters
    ----------
    laws : sequence
        One force law per pair.
    scene : Scene
        Scene with the pairs. External forces are ignored: a ball on the floor is treated as weightless.
    """

    def __init__(self, laws: Sequence[Any], scene: Scene) -> None:
        self.kind, each = resolved(laws, scene).in_pairs
        shapes: dict[tuple[float, float], float] = {}
        self.unit, self.power, self.damping = np.array([_powers(law, shapes) for law in each]).T
        if (self.damping > -np.inf).any():
            from granular.laws import viscoelastic_restitution

            self.damped = Curve(viscoelastic_restitution.duration, SMOOTH_VALUES_PER_OCTAVE)
        self.curves = {k: Curve(partial(_duration, each[k]), COSTLY_VALUES_PER_OCTAVE)
                       for k in np.flatnonzero(np.isnan(self.unit)).tolist()}
        self.slowest = max(SLOWEST_SPEED_SHARE * speed_scale(scene), 1e-75)

    def __call__(self, pair: Ints, speed: Array) -> Array:
        """Return the durations in s of contacts of pairs at impact speeds in m/s.

        Relative errors are 1e-14 for powers, 1e-7 for viscoelastic spheres and about 1e-5 at most for other laws. They
        are larger at speeds where such a law has a kink. Speeds below `slowest` give the duration at `slowest`. The
        duration of a contact that does not end is inf.
        """
        v = np.log2(np.maximum(speed, self.slowest))
        kind: Any = self.kind[pair] if len(self.unit) > 1 else 0
        lasting: Array = self.unit[kind] + self.power[kind] * v
        damping = np.broadcast_to(self.damping[kind], v.shape)
        rows = damping > -np.inf
        if rows.any():
            lasting[rows] += self.damped(damping[rows] + 0.2 * v[rows])
        for k, curve in self.curves.items():
            rows = np.broadcast_to(kind == k, v.shape)
            lasting[rows] = curve(v[rows])
        return np.exp2(lasting)


class Curve:
    """Cubic interpolation of a positive function, in binary logarithms.

    Parameters
    ----------
    function : callable
        Function of a positive number.
    fine : int
        Number of tabulated values per octave.
    """

    def __init__(self, function: Callable[[float], float], fine: int) -> None:
        self.function, self.fine, self.low, self.known = function, fine, 0, np.zeros(0)

    def __call__(self, x: Array) -> Array:
        """Return the function at many numbers, inf next to points where it is inf."""
        if not len(x):
            return x
        place = self.fine * x
        k = np.floor(place).astype(np.int64)
        self._learn(k)
        z, at = place - k, k - self.low
        a, b, c, d = (self.known[at + i] for i in (-1, 0, 1, 2))
        with np.errstate(invalid="ignore"):
            # mean of the second differences at both nodes, weighted for a four-point cubic
            bends = (2.0 - z) * (a - 2.0 * b + c) + (1.0 + z) * (b - 2.0 * c + d)
            value = b + z * ((c - b) - (1.0 - z) / 6.0 * bends)
        value[np.isnan(value)] = np.inf
        return value

    def _learn(self, k: Ints) -> None:
        """Make sure that the table covers the intervals from each `k` to k + 1."""
        low, end = int(k.min()) - 1, int(k.max()) + 3
        if len(self.known) == 0:
            self.low = low
        before, after = max(self.low - low, 0), max(end - self.low - len(self.known), 0)
        if before or after:
            self.low -= before
            self.known = np.pad(self.known, (before, after), constant_values=np.nan)
        # a cubic needs one neighbour below and two above
        needed = np.unique(np.flatnonzero(np.bincount(k - self.low))[:, None] + np.arange(-1, 3))
        for i in needed[np.isnan(self.known[needed])].tolist():
            self.known[i] = math.log2(self.function(math.pow(2.0, (self.low + i) / self.fine)))


def _powers(law: PairLaw, shapes: dict[tuple[float, float], float]) -> tuple[float, float, float]:
    """Return (unit, power, b) of a law, with unit and b as binary logarithms.

    The duration is unit·v^power, multiplied by D(b v^(1/5)) for viscoelastic spheres. unit is nan for other laws.
    `shapes` caches numbers that are shared by laws of all sizes.
    """
    zeta, m = binary.damping_ratio(law), law.pair.m_eff
    if law.form is None or (zeta is None and law.form[1::2] != (1.5, 0.5)):
        return math.nan, 0.0, -math.inf
    k, p, gamma, _ = law.form
    power, unit = (1.0 - p) / (1.0 + p), math.log2(m / k) / (p + 1.0)
    if zeta is None:
        return unit, power, math.log2(gamma) - 0.6 * math.log2(k) - 0.4 * math.log2(m)
    shape = p, round(zeta, 14)
    if shape not in shapes:
        shapes[shape] = math.log2(_duration(law, 1.0)) - unit
    return shapes[shape] + unit, power, -math.inf


def _duration(law: PairLaw, speed: float) -> float:
    """Return the duration in s of one contact, inf if it does not end.

    Contacts that raise `ValueError` for any other reason also give inf.
    """
    try:
        return binary.collision(law.law, law.pair, speed).duration
    except ValueError:
        return math.inf

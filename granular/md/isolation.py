"""Number of isolated contacts in a run, and duration of an isolated contact.

A contact is isolated if no neighbouring pair overlaps between the touch and the separation of its balls
(docs/guide/concepts.md). It differs from a hard-sphere collision only by a delay and a displacement. The delay depends
on the contact duration t_c, which is computed from the force law:

| law                                                   | duration                                        |
|-------------------------------------------------------|-------------------------------------------------|
| F = k ξ^p + γ ξ^((p-1)/2) ξ̇, including all dashpots   | D(p, ζ) (m_eff/k)^(1/(p+1)) v^((1-p)/(1+p))     |
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
    """Return the fraction of contacts of a run that are isolated, or nan.

    The result is nan for runs that do not count isolated contacts (hard spheres, fixed-step methods), and for runs
    without contacts.
    """
    if run.law is None or "isolated" not in run.stats or not run.stats["contacts"]:
        return math.nan
    return float(run.stats["isolated"] / run.stats["contacts"])


def numbers(run: Trajectory) -> dict[str, Any]:
    """Return numbers of contacts and the first disturbed contact, for JSON output.

    The keys are "isolated", "contacts" and "first_disturbed" (`Trajectory.first_disturbed`: time in s and lower pair,
    or nan and -1). The values are None for runs that do not count isolated contacts.
    """
    is_counted = run.law is not None and "isolated" in run.stats
    return {"isolated": run.stats["isolated"] if is_counted else None,
            "contacts": run.stats["contacts"] if is_counted else None,
            "first_disturbed": run.first_disturbed if is_counted else None}


def sentence(run: Trajectory) -> str:
    """Return a sentence with the number of isolated contacts, or an empty string.

    The string is empty where `isolated_share` is nan.
    """
    share = isolated_share(run)
    if math.isnan(share):
        return ""
    isolated, contacts = _format_count(run.stats["isolated"]), _format_count(run.stats["contacts"])
    if share == 1.0:
        return "certified: " + ("the only contact" if contacts == "1" else f"all {contacts} contacts") + " isolated"
    return f"certified: {isolated} of {contacts} contacts isolated; first disturbed: {first_disturbed(run)}"


def first_disturbed(run: Trajectory) -> str:
    """Return a phrase: the first two neighbouring pairs that overlapped, and when."""
    time, pair = run.first_disturbed
    names = run.scene.pairs.name
    return f"pairs {names(pair)} and {names((pair + 1) % run.scene.n_pairs)} at t = {time:.9g} s"


def _format_count(count: int) -> str:
    """Format an integer in groups of three digits, separated by spaces."""
    return f"{count:_}".replace("_", " ")


SMOOTH_VALUES_PER_OCTAVE, COSTLY_VALUES_PER_OCTAVE = 8, 2
"""Number of tabulated durations per factor of 2 of the argument.

The first is for durations in closed form, the second for durations that need an integration and are expensive."""
MAX_LOGARITHM = 1000.0
"""Limit of the binary logarithms of arguments, 1024 for floating-point numbers."""
SLOWEST_SPEED_RATIO = 2.0**-30
"""Lowest tabulated impact speed, relative to the typical speed of the scene.

Slower contacts get the duration at this speed."""


class Durations:
    """Durations of isolated contacts of the pairs of a scene, as a function of speed.

    Parameters
    ----------
    laws : sequence of force laws
        One force law per pair.
    scene : Scene
        Scene with the pairs. Gravity and external forces are ignored.
    """

    def __init__(self, laws: Sequence[Any], scene: Scene) -> None:
        self.kind, each = resolved(laws, scene).in_pairs
        cache: dict[tuple[float, float], float] = {}
        self.unit, self.power, self.damping = np.array([_power_law_terms(law, cache) for law in each]).T
        self.damped = None
        if (self.damping > -np.inf).any():
            from granular.laws import viscoelastic_restitution

            self.damped = LogInterpolation(viscoelastic_restitution.duration, SMOOTH_VALUES_PER_OCTAVE)
        self.curves = {k: LogInterpolation(partial(_duration_or_inf, each[k]), COSTLY_VALUES_PER_OCTAVE)
                       for k in np.flatnonzero(np.isnan(self.unit)).tolist()}
        self.slowest = max(SLOWEST_SPEED_RATIO * speed_scale(scene), 1e-75)

    def __call__(self, pair: Ints, speed: Array) -> Array:
        """Return the durations in s of isolated contacts.

        `pair` are pair numbers, and `speed` are the impact speeds in m/s. Speeds below `slowest` give the duration at
        `slowest`. The duration of a contact that does not end is inf.

        Relative errors are 1e-14 for powers, 1e-7 for viscoelastic spheres and about 1e-5 at most for other laws. They
        are larger at speeds where the duration has a kink.
        """
        v = np.log2(np.maximum(speed, self.slowest))
        kind: Any = self.kind[pair] if len(self.unit) > 1 else 0
        log_duration: Array = self.unit[kind] + self.power[kind] * v
        if self.damped is not None:
            damping = np.broadcast_to(self.damping[kind], v.shape)
            rows = damping > -np.inf
            log_duration[rows] += self.damped(damping[rows] + 0.2 * v[rows])
        for k, curve in self.curves.items():
            rows = np.broadcast_to(kind == k, v.shape)
            log_duration[rows] = curve(v[rows])
        return np.exp2(log_duration)


def isolated_durations(soft: Trajectory) -> Durations:
    """Return the durations of isolated contacts under the laws of a soft run.

    The last result is cached in the scene, for further calls with the same laws.
    """
    stored = vars(soft.scene)
    laws, durations = stored.get("_durations", ((), None))
    if durations is None or laws is not soft.law:
        durations = Durations(soft.law or (), soft.scene)
        stored["_durations"] = soft.law, durations
    return durations  # type: ignore[no-any-return]


class LogInterpolation:
    """Cubic interpolation of the binary logarithm of a positive function.

    The function is evaluated at equidistant logarithms of its argument. The table of its values grows as needed.

    Parameters
    ----------
    function : callable
        Function of a positive number.
    values_per_octave : int
        Number of tabulated values per factor of 2 of the argument.
    """

    def __init__(self, function: Callable[[float], float], values_per_octave: int) -> None:
        self.function, self.values_per_octave, self.low, self.values = function, values_per_octave, 0, np.zeros(0)

    def __call__(self, x: Array) -> Array:
        """Return the binary logarithms of the function at arguments with logarithms `x`.

        The result is inf in intervals next to tabulated points where the function is inf, and for arguments that are
        not numbers or too large.
        """
        if not len(x):
            return x
        is_known = np.abs(x) < MAX_LOGARITHM  # False for nan, such as speeds of an unstable run
        if not is_known.all():
            result = np.full(x.shape, np.inf)
            result[is_known] = self(x[is_known])
            return result
        position = self.values_per_octave * x
        k = np.floor(position).astype(np.int64)
        self._extend_table(k)
        z, index = position - k, k - self.low
        a, b, c, d = (self.values[index + i] for i in (-1, 0, 1, 2))
        with np.errstate(invalid="ignore"):
            # mean of the second differences at both nodes, weighted for a four-point cubic
            curvature = (2.0 - z) * (a - 2.0 * b + c) + (1.0 + z) * (b - 2.0 * c + d)
            value = b + z * ((c - b) - (1.0 - z) / 6.0 * curvature)
        value[np.isnan(value)] = np.inf
        return value

    def _extend_table(self, k: Ints) -> None:
        """Extend the table so that the intervals [k, k + 1] can be interpolated.

        `k` are numbers of tabulated points.
        """
        low, end = int(k.min()) - 1, int(k.max()) + 3
        if len(self.values) == 0:
            self.low = low
        before, after = max(self.low - low, 0), max(end - self.low - len(self.values), 0)
        if before or after:
            self.low -= before
            self.values = np.pad(self.values, (before, after), constant_values=np.nan)
        # a cubic needs one neighbour below and two above
        needed = np.unique(np.flatnonzero(np.bincount(k - self.low))[:, None] + np.arange(-1, 3))
        for i in needed[np.isnan(self.values[needed])].tolist():
            self.values[i] = math.log2(self.function(math.pow(2.0, (self.low + i) / self.values_per_octave)))


def _power_law_terms(law: PairLaw, cache: dict[tuple[float, float], float]) -> tuple[float, float, float]:
    """Return log2 of the unit, the power and log2 of b of the duration under a law.

    The duration in s at impact speed v is unit·v^power, multiplied by D(b v^(1/5)) for viscoelastic spheres. For all
    other laws of power form log2 of b is -inf, and for laws without such a form log2 of the unit is nan. `cache`
    stores the dimensionless numbers D(p, ζ), which do not depend on masses and stiffnesses.
    """
    zeta, m = binary.damping_ratio(law), law.pair.m_eff
    if law.form is None or (zeta is None and law.form[1::2] != (1.5, 0.5)):
        return math.nan, 0.0, -math.inf
    k, p, gamma, _ = law.form
    power, unit = (1.0 - p) / (1.0 + p), math.log2(m / k) / (p + 1.0)
    if zeta is None:
        return unit, power, math.log2(gamma) - 0.6 * math.log2(k) - 0.4 * math.log2(m)
    shape = p, round(zeta, 14)
    if shape not in cache:
        cache[shape] = math.log2(_duration_or_inf(law, 1.0)) - unit
    return cache[shape] + unit, power, -math.inf


def _duration_or_inf(law: PairLaw, speed: float) -> float:
    """Return the duration in s of a contact at impact speed `speed` in m/s, or inf.

    The result is inf if the contact does not end, or if it cannot be computed for another reason.
    """
    try:
        return binary.collision(law.law, law.pair, speed).duration
    except ValueError:
        return math.inf

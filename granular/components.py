"""Balls that touch each other in either run form a component, and each component is judged on its own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granular._check import Array
from granular.durations import Durations
from granular.outcome import approach, counts, leaving, partings, strengths
from granular.scene import Scene
from granular.trajectory import Trajectory

FAINT = 1e-12
"""Impacts weaker than this share of the fastest are rounding: a contact leaves some 1e-15, a thousand leave this."""
ROUNDING = 1e-13
"""Speeds below this share of the velocities that they are differences of are rounding."""


@dataclass(frozen=True, eq=False)
class Components:
    """Which component pairs and balls belong to.

    Attributes
    ----------
    count : int
        How many there are.
    of_pair, of_ball : (n-1,), (n,) arrays of int
        Number of the component; `count` for pairs that never touch, for balls that touch none, and for walls.
    """

    count: int
    of_pair: Any
    of_ball: Any

    def largest(self, of_pairs: Array, of_balls: Array | None = None) -> Array:
        """Largest of some values of the pairs, and of the balls, of each component, (count,); nan does not count."""
        most = np.zeros(self.count + 1)
        np.fmax.at(most, self.of_pair, of_pairs)
        if of_balls is not None:
            np.fmax.at(most, self.of_ball, of_balls)
        return most[:-1]

    def total(self, of_balls: Array) -> Array:
        """Sum of some values of the balls of each component, (count,); nan does not count."""
        return np.asarray(np.bincount(self.of_ball, np.nan_to_num(of_balls), self.count + 1)[:-1], float)

    def weight(self, soft: Trajectory) -> Array:
        """Speed g t_c in m/s that weight gives a ball in a contact, per pair the largest of its component.

        No more than it gives in the whole run.
        """
        sagging = _sagging(soft.scene, soft.law or ())
        most = soft.scene.gravity * float(soft.time[-1] - soft.time[0])
        weight: Array = np.append(self.largest(np.minimum(sagging, most)), 0.0)[self.of_pair]
        return weight


def components(hard: Trajectory, soft: Trajectory) -> Components:
    """Find the components of two runs of one scene: neighbouring pairs that have contacts belong together."""
    scene, met = hard.scene, (counts(hard) + counts(soft)) > 0
    begins = met.copy()
    begins[1:] &= ~met[:-1]
    of_pair = np.cumsum(begins) - 1
    count = int(of_pair[-1]) + 1
    if scene.ring and count > 1 and met[0] and met[-1]:  # they are one, around the ring
        count -= 1
        of_pair[of_pair == count] = 0
    of_pair[~met] = count
    of_ball = np.full(scene.n, count)
    for of_body in scene.bodies(np.flatnonzero(met)):
        of_ball[of_body] = of_pair[met]
    of_ball[scene.is_wall] = count
    return Components(count, of_pair, of_ball)


def units(hard: Trajectory, soft: Trajectory, parts: Components) -> Array:
    """Largest closing speed U in m/s of each component, during contacts and at their onset, in either run.

    A contact that begins at rest, as of balls that touch, closes later at about the speed with which it parts. U is
    at least what weight gives a ball while a contact lasts, g t_c, and more than rounding.
    """
    speed = parts.weight(soft)
    for run in (hard, soft):
        log = run.contacts
        parting = np.where(approach(run) > 0.0, 0.0, np.nan_to_num(log["v_out"][:, 1] - log["v_out"][:, 0]))
        np.maximum.at(speed, log["pair"], np.maximum(approach(run), parting))
    scale = max(float(np.abs(run.contacts["v_in"]).max(initial=0.0)) for run in (hard, soft))
    return np.maximum(parts.largest(speed), ROUNDING * scale)


def _sagging(scene: Scene, laws: Any) -> Array:
    """Speed in m/s that gravity gives a ball in the duration of a contact that begins with it, per pair."""
    speed, pair = np.full(scene.n_pairs, scene.gravity), np.arange(scene.n_pairs)
    if scene.gravity == 0.0:
        return speed
    alone = Durations(laws, scene)
    for _ in range(8):  # g t_c(v) = v, quickly: t_c falls with v^(-1/5) of Hertz spheres, and not at all of springs
        lasting = alone(pair, speed)
        speed = scene.gravity * np.where(np.isfinite(lasting), lasting, 0.0)
    return speed


def differences(one: Trajectory, other: Trajectory) -> tuple[Array, Array]:
    """Differences in m/s of two runs: of the leaving velocity of every ball (n,), and of the separation speed of every
    pair, shape of the gaps.

    A ball is compared where its last contacts end, or carried in free flight to one time, whichever is less: runs that
    end a contact some time apart under gravity are not that far apart. nan where a contact has no end. What one run
    has alone counts in full.
    """
    (u, at), (v, then) = leaving(one), leaving(other)
    fall = one.scene.fall
    apart = np.abs(u - v)
    if one.scene.pendulum == 0.0:
        apart = np.fmin(apart, np.abs((u - fall * at) - (v - fall * then)))
    apart[one.scene.is_wall] = math.nan
    p, q = partings(one), partings(other)
    return apart, np.where(np.isnan(p), np.abs(q), np.where(np.isnan(q), np.abs(p), np.abs(p - q)))


def rests_apart(hard: Trajectory, soft: Trajectory, weight: Array) -> Iterator[tuple[int, float]]:
    """Yield pairs that come to rest in a contact without end, and how far in m/s the two runs differ there.

    The contacts before it part alike; it begins alike in both; what one run still has from there on, as a ball that
    bounces ever lower, begins no faster, and leaves the pair at rest too. Each is compared, the largest counts.
    Where both rest, speeds up to `weight` (n-1,), which weight gives, are those of balls that settle.
    """
    never = np.isnan(partings(soft)) & (counts(soft) > 0)
    sticks = (np.abs(partings(hard)) <= hard.stats.get("merge_below", 0.0)) & (counts(hard) < counts(soft))
    for c in np.flatnonzero(never | sticks).tolist():
        runs = [(approach(run)[run.rows(c)], np.diff(run.of(c)["v_out"]).ravel()) for run in (hard, soft)]
        (closing, parting), (others, out) = runs if sticks[c] and not never[c] else runs[::-1]
        k = len(closing) - 1  # the number of the contact without end
        if len(others) <= k:  # the other run never got so far
            both = len(others)
            apart = [*np.abs(parting[:both] - out)[:k], *np.abs(parting[both:k]), *closing[both:]]
        else:
            apart = [*np.abs(parting[:k] - out[:k]), abs(closing[k] - others[k]), *(others[k + 1 :] - closing[k])]
        apart += np.abs(np.nan_to_num(out[-1:])).tolist()
        still = not abs(out[-1]) > 0.0 if len(out) else hard.gap[-1][c] == 0.0
        worst = float(np.max(apart, initial=0.0))
        yield c, 0.0 if still and worst <= weight[c] else worst


def counted(hard: Trajectory, soft: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Both runs without contacts that are rounding beside the fastest of either in their component."""
    parts, speed = components(hard, soft), np.zeros(hard.scene.n_pairs)
    for run in (hard, soft):
        np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)[parts.of_pair]
    return without_rounding(hard, fastest), without_rounding(soft, fastest)


def without_rounding(run: Trajectory, fastest: Array) -> Trajectory:
    """The run with only those contacts in its log that are more than rounding beside one at `fastest` (n-1,) m/s.

    Balls that an engine leaves with a relative speed of 1e-16 m/s meet again after some 1e12 s. Such contacts count
    for nothing.
    """
    kept = strengths(run) > FAINT * fastest[run.contacts["pair"]]
    return run if kept.all() else replace(run, contacts=run.contacts[kept])

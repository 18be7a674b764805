"""Constant data of a hard-sphere run: scene, restitution rules and options.

For the window see `granular.edmd.motion`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.kernels import kernel
from granular.laws import rules
from granular.laws.rules import Rule, constants, restitution_at
from granular.scene import Scene
from granular.scene.places import cached_in_scene
from granular.scene.walls.motion import max_wall_speed

Restitution = Callable[[int, float], float]
LEFT, RIGHT, RANDOM, GROUP = range(4)
TIE_ORDERS = {"left": LEFT, "right": RIGHT, "random": RANDOM, "newton": GROUP, "poisson": GROUP, "reflect": GROUP}
"""Order of simultaneous collisions, by the value of the option `ties`.

The last three values solve a touching group as a whole, see `granular.edmd.ties`. Groups that do not touch each other
are then solved one after the other, from left to right.
"""
MASK = (1 << 24) - 1
"""Mask of the 24 bits of a rank that contain the number of the pair.

It is also the largest number of pairs of a scene.
"""
RUN_OPTIONS = ("ties", "seed", "merge_below", "tc", "elastic_below")
"""Names of the options that change the physics, as stored in a saved run."""
WINDOW_TURNS, GAP_SHARE = 4.0, 0.25
"""Numbers that limit the window of pendula.

The window is at most about `WINDOW_TURNS`/Ω. If walls at both ends fix the sum of the gaps, the window is also computed
from `GAP_SHARE` times the mean gap, because the rounding error of the sum acts at every bounce.
"""
MIN_SPEED, MAX_NUMBER = 1e-75, 1e75
"""Smallest speed and largest number in a scene, in SI units.

Squares, products and ratios of such numbers neither underflow nor overflow.
"""
SIZE_REQUIREMENT = f"a number of at most {MAX_NUMBER:g}"


class Physics:
    """Scene, restitution rules and options of a hard-sphere run.

    Attributes
    ----------
    scene, rules, options
        The scene, one rule per pair, and the values of `RUN_OPTIONS` by name.
    has : tuple
        Names of the kernel flags that are true for the scene.
    eps : (p,) array
        Coefficient of restitution of each pair. All entries are nan if any rule is not constant.
    rule : callable or None
        ``rule(c, speed)`` returns ε of pair `c` at an approach speed in m/s. None if all rules are constant.
    """

    rule: Restitution | None = None

    def __init__(self, scene: Scene, rules: tuple[Rule, ...], options: dict[str, Any]) -> None:
        self.scene, self.rules, self.options, self.has = scene, rules, options, tuple(scene._flags)
        constant_eps = constants(rules, scene.gap)
        self.eps = np.array([math.nan] * len(scene.gap) if constant_eps is None else constant_eps)
        if constant_eps is None:
            pairs = tuple(scene.pairs)
            self.rule = lambda c, speed: restitution_at(rules[c], speed, pairs[c])

    @property
    def elastic(self) -> bool:
        """Whether all pairs are declared elastic, and no option changes collisions.

        These options are `merge_below`, `tc` and `elastic_below`.
        """
        return not any(map(self.options.get, ("merge_below", "tc", "elastic_below"))) and rules.elastic(self.rules)


@kernel
def rank(c: int, order: int, seed: int, contacts: int) -> int:
    """Return the rank of pair `c`, which decides between simultaneous collisions.

    Queues are ordered by ``(time, rank)``. The lower 24 bits of a rank are the number of the pair. The upper bits
    order pairs with equal times from the left, from the right, or at random. A random order is a hash of the seed, the
    pair and `contacts`, its number of collisions (the sequential treatment of Han & Gilmore, reproducible).
    """
    if order in (LEFT, GROUP):
        return c
    if order == RIGHT:
        return ((MASK - c) << 24) | c
    # RANDOM
    return (hash_bits(hash_bits(hash_bits(seed & 0x7FFFFFFF) ^ c) ^ (contacts & 0x7FFFFFFF)) << 24) | c


@kernel
def hash_bits(x: int) -> int:
    """Return a hash of `x` with 31 bits.

    For 0 ≤ `x` < 2³¹ no product exceeds 63 bits, so compiled and interpreted code agree.
    """
    x = ((x ^ (x >> 16)) * 0x45D9F3B) & 0x7FFFFFFF
    x = ((x ^ (x >> 15)) * 0x2C1B3C6D) & 0x7FFFFFFF
    return x ^ (x >> 16)


def checked(scene: Scene, rule: Any, *, collapse: Any, merge_below: float | None, **options: Any) -> Physics:
    """Return the `Physics` of a run after checking scene, rule and options.

    Raises `ValueError` or `TypeError` if an argument is invalid.
    """
    check_scene(scene)
    rules_per_pair = rules.checked(rule, scene.gap)
    merges = check.choice("collapse", collapse, ("stop", "merge")) == "merge"
    # Default of `merge_below`: 1/100 of the speed scale.
    below = 0.01 * scales(scene)[0] if merges else 0.0
    if merge_below is not None:
        if not merges:
            raise ValueError(f"`merge_below` must be None unless collapse='merge', got {merge_below!r}.")
        below = check.number("merge_below", merge_below, above=0.0)
    check.choice("ties", options["ties"], tuple(TIE_ORDERS))
    options["seed"] = check.integer("seed", options["seed"])
    for name in ("tc", "elastic_below"):
        options[name] = check.number(name, options[name], at_least=0.0)
    physics = Physics(scene, rules_per_pair, options | {"merge_below": below})
    # Balls that stick merge at any speed.
    if physics.eps.max() == 0.0:
        physics.options["merge_below"] = math.inf
    _check_combination(physics.eps, physics.options, scene)
    return physics


@cached_in_scene
def check_scene(scene: Scene) -> None:
    """Raise `ValueError` if the scene is not valid for hard spheres."""
    fix = "Hard spheres cannot overlap. Set the gap to 0, or use granular.md."
    check.every("gap", scene.gap, scene.gap >= 0.0, "non-negative", fix)
    speed, fix = np.abs(scene.velocity), "Check that it is in SI units."
    speed_requirement = f"0 or a number of magnitude {MIN_SPEED:g} to {MAX_NUMBER:g}"
    check.every("mass", scene.mass, (scene.mass <= MAX_NUMBER) | scene.is_wall, SIZE_REQUIREMENT, fix)
    check.every("gap", scene.gap, scene.gap <= MAX_NUMBER, SIZE_REQUIREMENT, fix)
    check.every("velocity", scene.velocity, (speed == 0.0) | ((speed >= MIN_SPEED) & (speed <= MAX_NUMBER)),
                speed_requirement, fix)
    for name, number in (("gravity", scene.gravity), ("pendulum", scene.pendulum)):
        if not (number == 0.0 or MIN_SPEED <= number <= MAX_NUMBER):
            raise ValueError(check.misuse(name, number, speed_requirement, fix))
    if scene.rest_gap is not None:
        check.every("rest_gap", scene.rest_gap, scene.rest_gap <= MAX_NUMBER, SIZE_REQUIREMENT, fix)
    check.raise_if_true({
        "`external_force` must be None for hard spheres on a ring, got forces, which would press the balls together in "
        "mid-air. Use granular.md.": scene.ring and scene.external_force is not None,
        "`gap` must have a positive entry on a ring, got 0 for all pairs. Leave the balls room to move.":
            scene.ring and not scene.gap.any(),
        f"`scene` must have at most {MASK + 1} bodies, got {scene.n}.": scene.n_pairs > MASK,
    })
    for heat, ball in zip(scene.thermal_walls, (1, scene.n - 2), strict=True) if scene.heated else ():
        if heat is not None and not MIN_SPEED <= math.sqrt(heat.temperature / scene.mass[ball]) <= MAX_NUMBER:
            raise ValueError(
                f"The thermal speed √(T/m) must be in [{MIN_SPEED:g}, {MAX_NUMBER:g}] m/s, got temperature T = "
                f"{heat.temperature!r} J and mass[{ball}] = {float(scene.mass[ball])!r} kg. Give T in J (Boltzmann's "
                "constant times kelvin), and m in kg."
            )


def _check_combination(eps: check.Array, options: dict[str, Any], scene: Scene) -> None:
    """Raise `ValueError` if options and rules cannot be combined.

    `eps` are the coefficients of restitution of the pairs. Each option is valid on its own.
    """
    ties = options["ties"]
    merges, has_tc, has_elastic_below = (
        options["merge_below"] > 0.0, options["tc"] > 0.0, options["elastic_below"] > 0.0)
    if ties in ("newton", "reflect") and eps.min() != eps.max():
        reason = ("Different restitutions can multiply the energy." if ties == "newton" else
                  "It is not defined otherwise.")
        raise ValueError(f"`rule` must be one constant restitution for all pairs if ties={ties!r}, got restitutions "
                         f"from {eps.min():g} to {eps.max():g}. {reason} Use ties='poisson'.")
    if TIE_ORDERS[ties] == GROUP and (merges or has_tc or has_elastic_below):
        raise ValueError(f"`ties` must be 'left', 'right' or 'random' if balls stick, or with collapse='merge', tc= or "
                         f"elastic_below=, got {ties!r}.")
    if merges + has_tc + has_elastic_below > 1:
        remedies = {"sticking or collapse='merge'": merges, "tc": has_tc, "elastic_below": has_elastic_below}
        names = " and ".join(name for name, is_given in remedies.items() if is_given)
        raise ValueError(f"Only one remedy for an inelastic collapse can be given, got {names}.")
    if eps.min() == 0.0 < eps.max():
        pair = scene.pairs.name(int(eps.argmin()))
        raise ValueError(f"The restitution must be 0 for all pairs or for none, got 0 only for some (pair {pair}). 0 "
                         "makes balls stick; use a small number, such as 0.01.")


def frame_gravity(scene: Scene) -> float:
    """Return the gravity (m/s²) in the frame of a run.

    Without a wall the frame falls with the balls, and the result is 0. Velocities then keep their digits.
    """
    return scene.gravity if scene.is_wall[0] or scene.is_wall[-1] else 0.0


def frame_velocity(scene: Scene) -> float:
    """Return the velocity (m/s) of the frame of a run at the start.

    The frame of a ring moves with the centre of mass. The frame of a scene with an undriven wall moves with this wall,
    and velocities of balls near the wall keep their digits. The result is 0 without walls, for pendula, and with
    driven or thermal walls, which do work in the frame of the scene.
    """
    if scene.ring:
        return float(scene.anchor_velocity(0.0))
    if scene.driven or scene.heated or scene.pendulum > 0.0:
        return 0.0
    return float(scene.velocity[0] if scene.is_wall[0] else scene.velocity[-1] if scene.is_wall[-1] else 0.0)


@cached_in_scene
def scales(scene: Scene) -> tuple[float, float, float, float]:
    """Return speed scale, fall speed, mean gap and largest acceleration of a scene.

    The units are m/s, m/s, m and m/s². The fall speed is the speed after a fall through the mean gap, or a larger speed
    of a driven or thermal wall. The speed scale is the maximum of the fall speed and of the relative velocities of all
    pairs. The largest acceleration is the acceleration of a ball in the frame of a run. For pendula the values are
    chosen such that `epoch.window_length` returns the window that `WINDOW_TURNS` and `GAP_SHARE` describe.
    """
    speed = float(np.abs(scene.across(scene.velocity)).max())
    if scene.pendulum > 0.0:
        rest: Any = scene.rest_gap
        fall = scene.pendulum * float(np.abs(scene.gap - rest).max())
        mean_gap = float(np.mean(scene.gap)) if scene.is_wall[[0, -1]].all() else 0.0  # else it depends on Ω only
        return max(speed, fall), fall, GAP_SHARE * mean_gap, scene.pendulum / WINDOW_TURNS * max(speed, fall)
    # Touching balls have no mean gap; their radius sets the length then.
    length, strength = float(np.mean(scene.gap)) or float(np.mean(scene.radius)), frame_gravity(scene)
    if scene.external_force is not None:
        strength = float(np.abs(scene.lift - np.where(scene.is_wall, 0.0, strength)).max())
    fall = math.sqrt(2.0 * strength * length)
    if scene.driven:
        fall = max(fall, *map(max_wall_speed, scene.motions))
    for heat, mass in zip(scene.thermal_walls, scene.mass[[1, -2]].tolist(), strict=True) if scene.heated else ():
        fall = fall if heat is None else max(fall, math.sqrt(heat.temperature / mass))
    return max(speed, fall), fall, length, strength


def mass_fractions(scene: Scene) -> tuple[check.Array, check.Array]:
    """Return the mass ratios m_eff/m_lower and m_eff/m_upper of each pair.

    They are the fractions of a change of the relative velocity that the lower and the upper body receive. The smaller
    ratio is computed, and the larger ratio is 1 minus the smaller.
    """
    a, b = scene.sides(scene.mass)
    ratio = np.minimum(a, b) / np.maximum(a, b)
    small = ratio / (1.0 + ratio)
    return np.where(a >= b, small, 1.0 - small), np.where(a >= b, 1.0 - small, small)

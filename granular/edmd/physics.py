"""Scene, restitution rules and options of a run: everything that stays constant."""

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
from granular.scene.places import remembered
from granular.scene.walls.motion import fastest

Restitution = Callable[[int, float], float]
LEFT, RIGHT, RANDOM, GROUP = range(4)
TIE_ORDERS = {"left": LEFT, "right": RIGHT, "random": RANDOM, "newton": GROUP, "poisson": GROUP, "reflect": GROUP}
"""Order of simultaneous collisions, by the option `ties`.

The last three rules solve a touching group as a whole, see `granular.edmd.ties`. Groups that do not touch each other
act from the left.
"""
MASK = (1 << 24) - 1
"""Mask of the pair number in a rank, and the largest number of pairs of a scene."""
RUN_OPTIONS = ("ties", "seed", "merge_below", "tc", "elastic_below")
"""Names of the options that change the physics, as stored in a saved run."""
WINDOW_TURNS, GAP_SHARE = 4.0, 0.25
"""Limits of the clock window of pendula.

`WINDOW_TURNS` is the window in units of 1/Ω. If two walls fix the sum of the gaps, the window is at most that of a
line with gaps of `GAP_SHARE` times the length. The rounding error of the sum acts at every bounce.
"""
MIN_SPEED, MAX_NUMBER = 1e-75, 1e75
"""Smallest speed and largest number in a scene.

Squares, products and ratios of these numbers neither underflow nor overflow.
"""
SIZE_REQUIREMENT = f"a number of at most {MAX_NUMBER:g}"


class Physics:
    """A scene, one rule per pair, and the values of `RUN_OPTIONS` by name.

    Attributes
    ----------
    scene, rules, options
        The scene, its rules, and the options.
    has : tuple
        Kernel flags that hold for the scene.
    eps : (p,) array
        Restitution per pair. All entries are nan if any rule is not constant; then `rule` is evaluated for every pair.
    rule : callable or None
        Called as ``rule(c, speed)``: ε of pair `c` at a speed (m/s). None if all rules are constant.
    """

    rule: Restitution | None = None

    def __init__(self, scene: Scene, rules: tuple[Rule, ...], options: dict[str, Any]) -> None:
        self.scene, self.rules, self.options, self.has = scene, rules, options, tuple(scene._flags)
        known = constants(rules, scene.gap)
        self.eps = np.array([math.nan] * len(scene.gap) if known is None else known)
        if known is None:
            pairs = tuple(scene.pairs)
            self.rule = lambda c, speed: restitution_at(rules[c], speed, pairs[c])

    @property
    def elastic(self) -> bool:
        """Whether all pairs are declared elastic and no option changes collisions.

        The options concern weak or frequent collisions.
        """
        return not any(map(self.options.get, ("merge_below", "tc", "elastic_below"))) and rules.elastic(self.rules)


@kernel
def rank(c: int, order: int, seed: int, contacts: int) -> int:
    """Return the rank of pair `c` after `contacts` collisions of the pair.

    Queues are ordered by ``(time, rank)``. The lower 24 bits of a rank are the number of the pair. The upper bits order
    pairs with equal times: from the left, from the right, or at random by a hash of the seed, the pair and its number
    of collisions (the sequential treatment of Han & Gilmore, reproducible).
    """
    if order in (LEFT, GROUP):
        return c
    if order == RIGHT:
        return ((MASK - c) << 24) | c
    # RANDOM
    return (mixed(mixed(mixed(seed & 0x7FFFFFFF) ^ c) ^ (contacts & 0x7FFFFFFF)) << 24) | c


@kernel
def mixed(x: int) -> int:
    """Return 31 well-mixed bits of `x`.

    For 0 ≤ `x` < 2³¹ no product exceeds 63 bits, so compiled and interpreted code agree.
    """
    x = ((x ^ (x >> 16)) * 0x45D9F3B) & 0x7FFFFFFF
    x = ((x ^ (x >> 15)) * 0x2C1B3C6D) & 0x7FFFFFFF
    return x ^ (x >> 16)


def checked(scene: Scene, rule: Any, *, collapse: Any, merge_below: float | None, **options: Any) -> Physics:
    """Return the `Physics` of a run, or raise if scene, rule or an option is invalid."""
    check_scene(scene)
    given = rules.checked(rule, scene.gap)
    merging = check.choice("collapse", collapse, ("stop", "merge")) == "merge"
    # Default of `merge_below`: 1/100 of the speed scale.
    below = 0.01 * scales(scene)[0] if merging else 0.0
    if merge_below is not None:
        if not merging:
            raise ValueError(f"`merge_below` must be None unless collapse='merge', got {merge_below!r}.")
        below = check.number("merge_below", merge_below, above=0.0)
    check.choice("ties", options["ties"], tuple(TIE_ORDERS))
    options["seed"] = check.whole("seed", options["seed"])
    for name in ("tc", "elastic_below"):
        options[name] = check.number(name, options[name], at_least=0.0)
    physics = Physics(scene, given, options | {"merge_below": below})
    # Balls that stick merge at any speed.
    if physics.eps.max() == 0.0:
        physics.options["merge_below"] = math.inf
    _check_together(physics.eps, physics.options, scene)
    return physics


@remembered
def check_scene(scene: Scene) -> None:
    """Raise `ValueError` if the scene is not valid for hard spheres."""
    fix = "Hard spheres cannot overlap. Set the gap to 0, or use granular.md."
    check.every("gap", scene.gap, scene.gap >= 0.0, "non-negative", fix)
    size, fix = np.abs(scene.velocity), "Use other units."
    need = f"0 or a number of magnitude {MIN_SPEED:g} to {MAX_NUMBER:g}"
    check.every("mass", scene.mass, (scene.mass <= MAX_NUMBER) | scene.is_wall, SIZE_REQUIREMENT, fix)
    check.every("gap", scene.gap, scene.gap <= MAX_NUMBER, SIZE_REQUIREMENT, fix)
    check.every("velocity", scene.velocity, (size == 0.0) | ((size >= MIN_SPEED) & (size <= MAX_NUMBER)), need, fix)
    for name, one in (("gravity", scene.gravity), ("pendulum", scene.pendulum)):
        if not (one == 0.0 or MIN_SPEED <= one <= MAX_NUMBER):
            raise ValueError(check.misuse(name, one, need, fix))
    if scene.rest_gap is not None:
        check.every("rest_gap", scene.rest_gap, scene.rest_gap <= MAX_NUMBER, SIZE_REQUIREMENT, fix)
    check.refuse({
        "`external_force` must be None for hard spheres on a ring, because it would press them together in mid-air. "
        "Use granular.md.": scene.ring and scene.external_force is not None,
        "`gap` must have a positive entry on a ring, got 0 for all pairs. Leave the balls room to move.":
            scene.ring and not scene.gap.any(),
        f"`scene` must have at most {MASK + 1} bodies, got {scene.n}.": scene.n_pairs > MASK,
    })
    for heat, ball in zip(scene.heat, (1, scene.n - 2), strict=True) if scene.heated else ():
        if heat is not None and not MIN_SPEED <= math.sqrt(heat.temperature / scene.mass[ball]) <= MAX_NUMBER:
            raise ValueError(
                f"The thermal speed √(T/m) must be in [{MIN_SPEED:g}, {MAX_NUMBER:g}] m/s, got temperature "
                f"{heat.temperature!r} and mass[{ball}] = {float(scene.mass[ball])!r}. Use other units."
            )


def _check_together(eps: check.Array, options: dict[str, Any], scene: Scene) -> None:
    """Raise `ValueError` for options and rules that are invalid in combination.

    `eps` are the restitutions of the pairs. Each option is valid on its own.
    """
    ties = options["ties"]
    merges, lasts, spares = options["merge_below"] > 0.0, options["tc"] > 0.0, options["elastic_below"] > 0.0
    if ties in ("newton", "reflect") and eps.min() != eps.max():
        why = "Different ones can multiply the energy." if ties == "newton" else "It is not defined otherwise."
        raise ValueError(f"`rule` must be one constant restitution for all pairs if ties={ties!r}, got restitutions "
                         f"from {eps.min():g} to {eps.max():g}. {why} Use ties='poisson'.")
    if TIE_ORDERS[ties] == GROUP and (merges or lasts or spares):
        raise ValueError(f"`ties` must not solve groups as a whole if balls stick, or with collapse='merge', tc= or "
                         f"elastic_below=, got {ties!r}. Use ties='left'.")
    if merges + lasts + spares > 1:
        given = {"sticking or collapse='merge'": merges, "tc": lasts, "elastic_below": spares}
        names = " and ".join(name for name, is_given in given.items() if is_given)
        raise ValueError(f"Only one remedy for an inelastic collapse can be given, got {names}.")
    if eps.min() == 0.0 < eps.max():
        pair = scene.pairs.name(int(eps.argmin()))
        raise ValueError(f"The restitution must be 0 for all pairs or for none, got 0 only for some (pair {pair}). 0 "
                         "makes balls stick; use a small number, such as 0.01.")


def felt_gravity(scene: Scene) -> float:
    """Return gravity (m/s²) in the frame of a run.

    Without a wall the frame falls with the balls, and the result is 0. Velocities then keep their digits.
    """
    return scene.gravity if scene.is_wall[0] or scene.is_wall[-1] else 0.0


def frame_velocity(scene: Scene) -> float:
    """Return the velocity in m/s of the frame of a run.

    The frame moves with the centre of mass of a ring, else with an undriven wall. The wall is at rest in this frame,
    and velocities of balls near the wall keep their digits. The result is 0 without walls, for pendula, and with driven
    or thermal walls, which do work in the frame of the scene.
    """
    if scene.ring:
        return float(scene.anchor_velocity(0.0))
    if scene.driven or scene.heated or scene.pendulum > 0.0:
        return 0.0
    return float(scene.velocity[0] if scene.is_wall[0] else scene.velocity[-1] if scene.is_wall[-1] else 0.0)


@remembered
def scales(scene: Scene) -> tuple[float, float, float, float]:
    """Return speed scale, fall speed, mean gap and largest acceleration of a scene.

    The units are m/s, m/s, m and m/s². The fall speed is the speed of falling through the mean gap. The largest
    acceleration is that of a ball in the frame of a run.
    """
    speed = float(np.abs(scene.across(scene.velocity)).max())
    if scene.pendulum > 0.0:
        rest: Any = scene.rest_gap
        fall = scene.pendulum * float(np.abs(scene.gap - rest).max())
        room = float(np.mean(scene.gap)) if scene.is_wall[[0, -1]].all() else 0.0  # else it depends on Ω only
        return max(speed, fall), fall, GAP_SHARE * room, scene.pendulum / WINDOW_TURNS * max(speed, fall)
    # Touching balls have no mean gap; their radius sets the length then.
    length, strength = float(np.mean(scene.gap)) or float(np.mean(scene.radius)), felt_gravity(scene)
    if scene.external_force is not None:
        strength = float(np.abs(scene.lift - np.where(scene.is_wall, 0.0, strength)).max())
    fall = math.sqrt(2.0 * strength * length)
    if scene.driven:
        fall = max(fall, *map(fastest, scene.motions))
    for heat, mass in zip(scene.heat, scene.mass[[1, -2]].tolist(), strict=True) if scene.heated else ():
        fall = fall if heat is None else max(fall, math.sqrt(heat.temperature / mass))
    return max(speed, fall), fall, length, strength


def shares(scene: Scene) -> tuple[check.Array, check.Array]:
    """Return m_eff/m_lower and m_eff/m_upper of each pair.

    They are the shares of both bodies in a change of the relative velocity. The smaller share is computed, and the
    other share is 1 minus the smaller.
    """
    a, b = scene.sides(scene.mass)
    ratio = np.minimum(a, b) / np.maximum(a, b)
    small = ratio / (1.0 + ratio)
    return np.where(a >= b, small, 1.0 - small), np.where(a >= b, 1.0 - small, small)

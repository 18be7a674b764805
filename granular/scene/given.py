"""Checks of the arguments of `Scene`, one by one and in combination."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check


def checked_bodies(
    mass: ArrayLike, radius: ArrayLike, gap: ArrayLike, velocity: ArrayLike, ring: bool
) -> dict[str, Any]:
    """Return checked masses, radii, gaps, velocities and `ring`, as fields by name."""
    m = check.array("mass", mass)
    n = len(m)
    if n < 2:
        raise ValueError(check.must("mass", "an array of at least 2 "
                                            "bodies", f"{n}", "A floor counts as a body (mass inf)."))
    check.every("mass", m, m > 0.0, "positive", "Use math.inf for a wall.")
    walls = np.isinf(m)
    if walls[1:-1].any():
        check.every("mass", m, ~walls | (np.arange(n) % (n - 1) == 0), "finite",
                     "Only the first and the last body can be walls.")
    if walls.all():
        raise ValueError("`mass` must be finite for at least one body, got inf for every body.")
    r = check.array("radius", radius, (n,))
    check.every("radius", r, (r >= 0.0) & (r < np.inf), "finite and non-negative")
    check.every("radius", r, ~walls | (r == 0.0), "0", "A wall is flat and has radius 0.")
    is_ring = check.boolean("ring", ring)
    fix = "Give one gap per pair; the last pair joins the last ball and ball 0." if is_ring else (
        "Give one gap per pair of neighbours.")
    d = check.array("gap", gap, (n - 1 + is_ring,), fix=fix, finite="finite")
    v = check.array("velocity", velocity, (n,), finite="finite")
    return {"mass": m, "radius": r, "gap": d, "velocity": v, "ring": is_ring}


def checked_positions(
    mass: ArrayLike, radius: ArrayLike, position: ArrayLike, length: float | None
) -> tuple[check.Array, ...]:
    """Return checked masses (kg), radii (m) and positions (m), and the gaps (m).

    A ring has the circumference `length` (m). Its last gap lies between the last ball and ball 0. Without a ring
    `length` is None.
    """
    m = check.array("mass", mass)
    r = check.array("radius", radius, m.shape)
    x = check.array("position", position, m.shape, finite="finite")
    rising = np.diff(x, prepend=-np.inf) >= 0.0
    check.every("position", x, rising, "at least as large as the entry before it",
                "Number the bodies from bottom to top.")
    gap = np.diff(x) - r[:-1] - r[1:]
    if length is not None and len(x):
        around = check.number("length", length, at_least=float(x[-1] - x[0]), fix="All centres lie on the ring.")
        gap = np.append(gap, around - (x[-1] - x[0]) - r[-1] - r[0])
    return m, r, x, gap


def checked_forces(value: ArrayLike | None, walls: Any) -> check.Array | None:
    """Return the checked external forces in N, shape (n,), or None if all are 0.

    `walls` is a boolean array (n,), true for walls, on which no force may act.
    """
    if value is None:
        return None
    f = check.array("external_force", value, walls.shape, fix="Give one force per body, 0 for walls.", finite="finite")
    check.every("external_force", f, ~walls | (f == 0.0), "0",
                "Forces do not act on walls. Move a wall with floor= or ceiling=.")
    return f if f.any() else None


def checked_rest_gaps(value: ArrayLike | None, pendulum: float, n: int) -> check.Array | None:
    """Return the checked gaps of pendula at rest in m, shape (n-1,).

    They default to 0. Without pendula (`pendulum` = 0) the result is None, and other values raise `ValueError`.
    """
    if pendulum == 0.0:
        if value is None:
            return None
        raise ValueError(check.misuse("rest_gap", value, "None without pendula", "Give `pendulum`, Ω in rad/s."))
    d = check.array("rest_gap", np.zeros(n - 1) if value is None else value, (n - 1,), fix="Give one per pair.")
    check.every("rest_gap", d, np.isfinite(d) & (d >= 0.0), "finite and non-negative")
    return d


def check_exclusive(scene: Any, walls: Any) -> None:
    """Raise `ValueError` if arguments of a scene cannot be combined.

    Rings, pendula and thermal walls exclude other arguments. `walls` is a boolean array (n,), true for walls.
    """
    if not (scene.ring or scene.pendulum > 0.0 or scene.heated):
        return
    has_pendula, is_enclosed = scene.pendulum > 0.0, walls[0] and walls[-1]
    gap_sum, rest_gap_sum = (float(gap.sum()) if has_pendula else 0.0 for gap in (scene.gap, scene.rest_gap))
    zero_gravity = ("0 for pendula", "Gravity acts on them by Ω² = g/l.") if has_pendula else (
        "0 on a ring", "Gravity would accelerate the balls around the ring forever. Use external_force.")
    check.raise_if_true({
        f"`mass[{int(walls.argmax())}]` must be finite on a ring, got inf. A ring has no walls.":
            scene.ring and walls.any(),
        check.misuse("gravity", scene.gravity, *zero_gravity): (scene.ring or has_pendula) and scene.gravity != 0.0,
        f"`pendulum` must be 0 on a ring, got {scene.pendulum!r}.": has_pendula and scene.ring,
        f"`external_force` must be None for pendula, got forces and pendulum = {scene.pendulum!r}. A constant force "
        "shifts their rest positions: change `gap` and `rest_gap` instead.":
            has_pendula and scene.external_force is not None,
        f"Walls next to pendula must be at rest, got pendulum = {scene.pendulum!r} and a moving wall. Leave out "
        "`floor`, `ceiling` and the velocity of the wall.":
            has_pendula and (scene.driven or scene.heated or scene.velocity[walls].any()),
        f"The sum of `rest_gap` must equal the sum of `gap` between two walls, {gap_sum!r}, got {rest_gap_sum!r}.":
            has_pendula and is_enclosed
            and abs(gap_sum - rest_gap_sum) > 1e-12 * float(np.abs(scene.gap).sum() + rest_gap_sum),
        check.misuse("pendulum", scene.pendulum, "a frequency whose square is finite"):
            has_pendula and not np.isfinite(scene.pendulum * scene.pendulum),
    })
    for c, heat in zip((0, scene.n_pairs - 1), scene.thermal_walls, strict=True):
        if heat is not None and scene.gap[c] < 0.0:
            raise ValueError(f"`gap[{c}]` must be at least 0 at a thermal wall, got {float(scene.gap[c])!r}. A thermal "
                             "wall acts at the onset of contact, so balls cannot overlap it.")

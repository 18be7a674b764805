"""Checks of the arguments of `Scene`, each by itself and in combination."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check


def line(mass: ArrayLike, radius: ArrayLike, gap: ArrayLike, velocity: ArrayLike, ring: bool) -> dict[str, Any]:
    """Return masses, radii, gaps, velocities and `ring` as checked fields of a scene."""
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
    closed = check.truth("ring", ring)
    fix = "Give one gap per pair; the last pair joins the last ball and ball 0." if closed else (
        "Give one gap per pair of neighbours.")
    d = check.array("gap", gap, (n - 1 + closed,), fix=fix, finite="finite")
    v = check.array("velocity", velocity, (n,), finite="finite")
    return {"mass": m, "radius": r, "gap": d, "velocity": v, "ring": closed}


def placed(
    mass: ArrayLike, radius: ArrayLike, position: ArrayLike, length: float | None
) -> tuple[check.Array, ...]:
    """Return checked masses, radii and positions, and the gaps between the bodies.

    On a ring of circumference `length` (m), the last gap is the one between the last ball and ball 0.
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


def external_forces(value: ArrayLike | None, walls: Any) -> check.Array | None:
    """Return the checked external forces on the balls, or None if all are 0."""
    if value is None:
        return None
    f = check.array("external_force", value, walls.shape, fix="Give one force per body, 0 for walls.", finite="finite")
    check.every("external_force", f, ~walls | (f == 0.0), "0",
                "Forces do not act on walls. Move a wall with floor= or ceiling=.")
    return f if f.any() else None


def rest_gaps(value: ArrayLike | None, pendulum: float, n: int) -> check.Array | None:
    """Return the checked distances of pendula at rest, or None without pendula."""
    if pendulum == 0.0:
        if value is None:
            return None
        raise ValueError(check.misuse("rest_gap", value, "None without pendula", "Give `pendulum`, Ω in rad/s."))
    d = check.array("rest_gap", np.zeros(n - 1) if value is None else value, (n - 1,), fix="Give one per pair.")
    check.every("rest_gap", d, np.isfinite(d) & (d >= 0.0), "finite and non-negative")
    return d


def check_exclusive(scene: Any, walls: Any) -> None:
    """Raise `ValueError` for arguments that cannot be combined."""
    if not (scene.ring or scene.pendulum > 0.0 or scene.heated):
        return
    hung, boxed = scene.pendulum > 0.0, walls[0] and walls[-1]
    room, rest = (float(gap.sum()) if hung else 0.0 for gap in (scene.gap, scene.rest_gap))
    level = ("0 for pendula", "Gravity acts on them by Ω² = g/l.") if hung else (
        "0 on a ring", "Gravity would accelerate the balls around the ring forever. Use external_force.")
    check.refuse({
        f"`mass[{int(walls.argmax())}]` must be finite on a ring, got inf. A ring has no walls.":
            scene.ring and walls.any(),
        check.misuse("gravity", scene.gravity, *level): (scene.ring or hung) and scene.gravity != 0.0,
        f"`pendulum` must be 0 on a ring, got {scene.pendulum!r}.": hung and scene.ring,
        f"`external_force` must be None for pendula, got forces and pendulum = {scene.pendulum!r}. A constant force "
        "shifts their rest positions: change `gap` and `rest_gap` instead.": hung and scene.external_force is not None,
        f"Walls next to pendula must be at rest, got pendulum = {scene.pendulum!r} and a moving wall. Leave out "
        "`floor`, `ceiling` and the velocity of the wall.":
            hung and (scene.driven or scene.heated or scene.velocity[walls].any()),
        f"The sum of `rest_gap` must equal the sum of `gap` between two walls, {room!r}, got {rest!r}.":
            hung and boxed and abs(room - rest) > 1e-12 * float(np.abs(scene.gap).sum() + rest),
        check.misuse("pendulum", scene.pendulum, "a frequency whose square is finite"):
            hung and not np.isfinite(scene.pendulum * scene.pendulum),
    })
    for c, heat in zip((0, scene.n_pairs - 1), scene.heat, strict=True):
        if heat is not None and scene.gap[c] < 0.0:
            raise ValueError(f"`gap[{c}]` must be at least 0 at a thermal wall, got {float(scene.gap[c])!r}. A thermal "
                             "wall acts at the onset of contact, so balls cannot overlap it.")

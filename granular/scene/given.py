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
        raise ValueError(f"mass has {n} entries: at least 2 bodies are needed; a floor counts as one (mass inf).")
    check.every("mass", m, m > 0.0, "a mass must be positive", "use math.inf for a wall")
    walls = np.isinf(m)
    if walls[1:-1].any():
        check.every("mass", m, ~walls | (np.arange(n) % (n - 1) == 0), "only the first and the last body can be walls",
                     "a wall in the middle makes two separate scenes")
    if walls.all():
        raise ValueError("mass is inf for every body: at least one ball of finite mass is needed.")
    r = check.array("radius", radius, (n,))
    check.every("radius", r, (r >= 0.0) & (r < np.inf), "a radius must be finite and not negative")
    check.every("radius", r, ~walls | (r == 0.0), "a wall is flat and has radius 0")
    closed = check.truth("ring", ring)
    fix = "pair n-1 joins the last ball and ball 0" if closed else "one gap per pair of neighbours"
    d = check.array("gap", gap, (n - 1 + closed,), fix=fix, finite="a gap must be finite")
    v = check.array("velocity", velocity, (n,), finite="a velocity must be finite")
    return {"mass": m, "radius": r, "gap": d, "velocity": v, "ring": closed}


def placed(
    mass: ArrayLike, radius: ArrayLike, position: ArrayLike, length: float | None
) -> tuple[check.Array, ...]:
    """Return checked masses, radii and positions, and the gaps between the bodies.

    On a ring of circumference `length` (m), the last gap is the one between the last ball and ball 0.
    """
    m = check.array("mass", mass)
    r = check.array("radius", radius, m.shape)
    x = check.array("position", position, m.shape, finite="a position must be finite")
    rising = np.diff(x, prepend=-np.inf) >= 0.0
    check.every("position", x, rising, "positions must not decrease", "number bodies bottom to top")
    gap = np.diff(x) - r[:-1] - r[1:]
    if length is not None and len(x):
        around = check.number("length", length, at_least=float(x[-1] - x[0]), fix="all centres lie on the ring")
        gap = np.append(gap, around - (x[-1] - x[0]) - r[-1] - r[0])
    return m, r, x, gap


def external_forces(value: ArrayLike | None, walls: Any) -> check.Array | None:
    """Return the checked external forces on the balls, or None if all are 0."""
    if value is None:
        return None
    f = check.array("external_force", value, walls.shape, fix="one force per body, 0 for walls",
                     finite="a force must be finite")
    check.every("external_force", f, ~walls | (f == 0.0), "a wall takes no force", "let it move: floor=, ceiling=")
    return f if f.any() else None


def rest_gaps(value: ArrayLike | None, pendulum: float, n: int) -> check.Array | None:
    """Return the checked distances of pendula at rest, or None without pendula."""
    if pendulum == 0.0:
        if value is None:
            return None
        raise ValueError(check._sentence("rest_gap", value, "pendula are needed for it", "give pendulum, Ω in rad/s"))
    d = check.array("rest_gap", np.zeros(n - 1) if value is None else value, (n - 1,), fix="one per pair")
    check.every("rest_gap", d, np.isfinite(d) & (d >= 0.0), "a distance must be finite and not negative")
    return d


def refuse_together(scene: Any, walls: Any) -> None:
    """Raise `ValueError` for arguments that cannot be combined."""
    if not (scene.ring or scene.pendulum > 0.0 or scene.heated):
        return
    hung, boxed = scene.pendulum > 0.0, walls[0] and walls[-1]
    room, rest = (float(gap.sum()) if hung else 0.0 for gap in (scene.gap, scene.rest_gap))
    level = ("pendula are held by Ω² = g/l", "give gravity 0") if hung else (
        "a ring lies level, or gravity would turn it forever", "give gravity 0, or forces")
    check.refuse({
        f"mass[{int(walls.argmax())}] is inf: a ring has no walls; leave out the wall, or ring.":
            scene.ring and walls.any(),
        check._sentence("gravity", scene.gravity, *level): (scene.ring or hung) and scene.gravity != 0.0,
        f"pendulum is {scene.pendulum!r}: pendula cannot hang on a ring; give one of the two.": hung and scene.ring,
        f"pendulum is {scene.pendulum!r}: pendula take no external_force; a constant one moves their rest positions, "
        "so give other gaps and rest_gap.": hung and scene.external_force is not None,
        f"pendulum is {scene.pendulum!r}: beside pendula a wall must stand still; leave out floor, ceiling and its "
        "velocity.": hung and (scene.driven or scene.heated or scene.velocity[walls].any()),
        f"rest_gap adds up to {rest!r}: between two walls that do not move pendula at rest leave the same room as the "
        f"gaps, {room!r}; give rest_gap so.":
            hung and boxed and abs(room - rest) > 1e-12 * float(np.abs(scene.gap).sum() + rest),
        check._sentence("pendulum", scene.pendulum, "a frequency whose square is finite is needed"):
            hung and not np.isfinite(scene.pendulum * scene.pendulum),
    })
    for c, heat in zip((0, scene.n_pairs - 1), scene.heat, strict=True):
        if heat is not None and scene.gap[c] < 0.0:
            raise ValueError(f"gap[{c}] is {float(scene.gap[c])!r}: no ball can overlap a thermal wall, which acts at "
                             "the touch; give a gap of at least 0.")

"""One contact at every extreme: its restitution is known in closed form, so every cell has an exact truth."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from granular import until
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz, ViscoelasticHertz, WaltonBraun, dashpot
from granular.rules import ConstantRestitution
from granular.scene import Scene
from granular.stress import truth
from granular.stress.cell import FIXED, METHODS, SOFT, Cell

LINEAR, POWER, TABLE = 2e-14, 1e-12, 1e-9
"""Tolerances, in units of the impact speed: linear laws, powers, restitution from a table good to that."""


def meeting(
    axis: str, case: str, law: str, *, eps: float = 0.7, k: float = 1e6, speed: float = 1.0, gap: float = 1e-3,
    masses: Sequence[float] = (math.inf, 1.0),
) -> Cell:  # fmt: skip
    """Return the cell of two bodies that meet once; the second flies towards the first, at rest (a wall or a ball)."""
    wall = math.isinf(masses[0])
    scene = Scene(masses, [0.0 if wall else 0.1, 0.1], [gap], [0.0, -speed])
    expected = 1.0 if law == "hertz" else eps
    known = {"linear": LINEAR, "viscoelastic": TABLE}.get(law, POWER)
    return Cell(
        axis, f"{case}, {law}" + f", {'wall' if wall else 'pair'}", scene, truth.restitution(expected, speed),
        law=law_of(law, scene, eps, k, speed), rule=ConstantRestitution(expected), tolerance=known,
        options={"until": until.separated(), "max_steps": 50_000}, methods=METHODS,
    )  # fmt: skip


def law_of(name: str, scene: Scene, eps: float, k: float, speed: float) -> Any:
    """Return the force law of that name with restitution `eps` at `speed` in m/s and stiffness `k`."""
    pair = scene.pairs[0]
    laws: dict[str, Callable[[], Any]] = {
        "linear": lambda: LinearDashpot.from_restitution(eps, k, pair),
        "hertz": lambda: Hertz(k),
        "tsuji": lambda: TsujiHertz.from_restitution(eps, k),
        "viscoelastic": lambda: ViscoelasticHertz.from_restitution(eps, speed, k, pair),
        "walton-braun": lambda: WaltonBraun.from_restitution(eps, k),
    }
    return laws[name]()


LAWS = ("linear", "hertz", "viscoelastic", "tsuji")
PAIR = (1.0, 1.0)
WALL = (math.inf, 1.0)


def stiffness() -> Iterator[Cell]:
    """Stiffness from 1 to 1e16."""
    for e, law, masses, eps in itertools.product(range(0, 17, 2), LAWS, (WALL, PAIR), (1.0, 0.7, 0.1)):
        if law != "hertz" or eps == 1.0:
            yield meeting("stiffness", f"k = 1e{e}, ε = {eps:g}", law, k=10.0**e, masses=masses, eps=eps)


def damping() -> Iterator[Cell]:
    """Restitution from 1 to 1e-6, and a dashpot from ζ = 1e-6 to far beyond critical damping."""
    for eps, law, masses in itertools.product(
        (1.0, 1 - 1e-9, 0.999, 0.9, 0.5, 0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6), ("linear", "tsuji"), (WALL, PAIR)
    ):
        yield meeting("damping", f"ε = {eps:g}", law, eps=eps, masses=masses)
    for eps in (0.9, 0.5, 0.1, 0.05):
        yield meeting("damping", f"ε = {eps:g}", "walton-braun", eps=eps)
    for eps in (0.9, 0.5, 0.1, 0.01, 1e-3):
        yield meeting("damping", f"ε = {eps:g}", "viscoelastic", eps=eps)
    for e, masses in itertools.product(range(-6, 7), (WALL, PAIR)):
        yield _dashpot(10.0**e, masses)


def _dashpot(zeta: float, masses: Sequence[float]) -> Cell:
    cell = meeting("damping", f"ζ = {zeta:g}", "linear", masses=masses)
    gamma = 2.0 * zeta * math.sqrt(1e6 * cell.scene.pairs[0].m_eff)
    eps = dashpot.restitution(zeta)
    return replace(
        cell, law=LinearDashpot(1e6, gamma), rule=ConstantRestitution(eps), truth=truth.restitution(eps, 1.0)
    )


def masses() -> Iterator[Cell]:
    """Mass ratio from 1e-9 to 1e9, and both masses tiny or huge."""
    for e, law, eps in itertools.product(range(-9, 10, 2), LAWS, (1.0, 0.3)):
        if law != "hertz" or eps == 1.0:
            yield meeting("mass ratio", f"1 : 1e{e}, ε = {eps:g}", law, masses=(1.0, 10.0**e), eps=eps)
    for e, law in itertools.product((-30, -9, 9, 30), LAWS):
        yield meeting("mass ratio", f"both 1e{e} kg", law, masses=(10.0**e, 10.0**e))


def gaps() -> Iterator[Cell]:
    """Gaps of nothing, of the smallest float, of one ulp, up to 1 km."""
    widths = (0.0, 5e-324, 1e-300, 1e-100, 1e-30, 2.0**-52, 1e-12, 1e-8, 1e-4, 1.0, 1e3)
    for gap, law, masses in itertools.product(widths, LAWS, (WALL, PAIR)):
        yield meeting("gap", f"gap = {gap:.3g}", law, gap=gap, masses=masses)


def speeds() -> Iterator[Cell]:
    """Impact speeds from 1e-9 to 1e6 m/s."""
    for e, law, masses in itertools.product(range(-9, 7, 3), LAWS, (WALL, PAIR)):
        yield meeting("speed", f"v = 1e{e}", law, speed=10.0**e, masses=masses)


def starts() -> Iterator[Cell]:
    """Start times up to 1e12 s."""
    for e, law, k in itertools.product((3, 6, 9, 12), LAWS, (1e6, 1e12)):
        cell = late(meeting("start time", f"t = 1e{e}, k = {k:.0e}", law, k=k), 10.0**e)
        yield replace(cell, methods=("located", "edmd"))
        yield replace(cell, methods=FIXED)


def late(cell: Cell, start: float) -> Cell:
    """Return the cell begun at another time in s."""
    return replace(cell, options=dict(cell.options) | {"t_start": start})


def exponents() -> Iterator[Cell]:
    """Elastic powers of the overlap from 1 to 3."""
    powers = (1.0, 1.1, 1.25, 1.5, 1.7, 2.0, 2.5, 3.0)
    for p, k, v in itertools.product(powers, (1e2, 1e6, 1e12), (1e-3, 1.0, 1e3)):
        cell = meeting("exponent", "", "hertz", k=k, speed=v, masses=PAIR)
        case = f"ξ^{p:g}, k = {k:.0e}, v = {v:g}, power, pair"
        yield replace(cell, case=case, law=PowerLaw(k, p), methods=SOFT)


def corners() -> Iterator[Cell]:
    """All combinations of the ends of these axes."""
    ends = itertools.product((1.0, 1e16), (1e-6, 1.0), (1e-9, 1e6), (1e-9, 1e9), (0.0, 1e3), (0.0, 1e12))
    for k, eps, v, ratio, gap, start in ends:
        case = f"k = {k:.0e}, ε = {eps:g}, v = {v:.0e}, 1 : {ratio:.0e}, gap = {gap:g}, t = {start:.0e}"
        for law in ("linear", "tsuji"):
            cell = meeting("corners", case, law, k=k, eps=eps, speed=v, masses=(1.0, ratio), gap=gap)
            yield late(cell, start)

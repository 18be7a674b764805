"""One contact at extreme parameters, with a restitution known in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, product
from typing import Any

from bench.stability import truth
from bench.stability.cell import ALL_METHODS, FIXED_METHODS, SOFT_METHODS, Cell, Truth
from bench.stability.own import Hysteresis, PlainPower, TwoDampings, TwoStiffnesses
from granular import binary, until
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz, ViscoelasticHertz, WaltonBraun, dashpot
from granular.laws.rules import ConstantRestitution
from granular.scene import Pair, Scene

LINEAR_TOLERANCE, POWER_TOLERANCE, TABLE_TOLERANCE = 2e-14, 1e-12, 1e-9
"""Tolerances in units of the impact speed: linear laws, powers, tabulated laws."""
LAW_FACTORIES: dict[str, Callable[[float, float, float, Pair], Any]] = {
    "linear": lambda eps, k, speed, pair: LinearDashpot.from_restitution(eps, k, pair),
    "hertz": lambda eps, k, speed, pair: Hertz(k),
    "viscoelastic": lambda eps, k, speed, pair: ViscoelasticHertz.from_restitution(eps, speed, k, pair),
    "tsuji": lambda eps, k, speed, pair: TsujiHertz.from_restitution(eps, k),
    "walton-braun": lambda eps, k, speed, pair: WaltonBraun.from_restitution(eps, k),
    "parabola": lambda eps, k, speed, pair: PowerLaw(k, 2.0),
}
"""Laws of restitution `eps` at `speed` in m/s and of stiffness `k`.

A law without damping ignores `eps`.
"""
SWEPT_LAWS = tuple(LAW_FACTORIES)[:4]
WALL_MASSES, PAIR_MASSES = MASS_CASES = (math.inf, 1.0), (1.0, 1.0)


def two_body_cell(
    axis: str, case: str, law: str, *, eps: float = 0.7, k: float = 1e6, speed: float = 1.0, gap: float = 1e-3,
    masses: Sequence[float] = WALL_MASSES,
) -> Cell:
    """Cell of two bodies that collide once.

    The second body flies towards the first, which is at rest and is a wall or a ball.
    """
    wall, expected = math.isinf(masses[0]), 1.0 if law == "hertz" else eps
    scene = Scene(masses, [0.0 if wall else 0.1, 0.1], [gap], [0.0, -speed])
    return Cell(
        axis, f"{case}, {law}, {'wall' if wall else 'pair'}", scene, truth.restitution(expected, speed),
        law=LAW_FACTORIES[law](eps, k, speed, scene.pairs[0]), rule=ConstantRestitution(expected), methods=ALL_METHODS,
        tolerance={"linear": LINEAR_TOLERANCE, "viscoelastic": TABLE_TOLERANCE}.get(law, POWER_TOLERANCE),
        options={"until": until.separated(), "max_steps": 50_000},
    )


def possible(law: str, eps: float) -> bool:
    """Whether the law can have this restitution."""
    return law != "hertz" or eps == 1.0


def stiffness() -> Iterator[Cell]:
    """Stiffness from 1 to 1e16."""
    return (
        two_body_cell("stiffness", f"k = 1e{e}, ε = {eps:g}", law, k=10.0**e, masses=masses, eps=eps)
        for e, law, masses, eps in product(range(0, 17, 2), SWEPT_LAWS, MASS_CASES, (1.0, 0.7, 0.1))
        if possible(law, eps)
    )


def damping() -> Iterator[Cell]:
    """Restitution from 1 to 1e-6, and dashpots from ζ = 1e-6 to 1e6."""
    small = (1.0, 1 - 1e-9, 0.999, 0.9, 0.5, 0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    each = chain(
        product(small, ("linear", "tsuji"), MASS_CASES),
        product((0.9, 0.5, 0.1, 0.05), ["walton-braun"], [WALL_MASSES]),
        product((0.9, 0.5, 0.1, 0.01, 1e-3), ["viscoelastic"], [WALL_MASSES]),
    )
    yield from (two_body_cell("damping", f"ε = {eps:g}", law, eps=eps, masses=masses) for eps, law, masses in each)
    yield from (damping_cell(10.0**e, masses) for e, masses in product(range(-6, 7), MASS_CASES))


def damping_cell(zeta: float, masses: Sequence[float]) -> Cell:
    """Cell of a dashpot with damping ratio `zeta`."""
    cell, eps = two_body_cell("damping", f"ζ = {zeta:g}", "linear", masses=masses), dashpot.restitution(zeta)
    law = LinearDashpot(1e6, 2.0 * zeta * math.sqrt(1e6 * cell.scene.pairs[0].m_eff))
    return replace(cell, law=law, rule=ConstantRestitution(eps), truth=truth.restitution(eps, 1.0))


def mass_ratios() -> Iterator[Cell]:
    """Mass ratio from 1e-9 to 1e9, and both masses tiny or huge."""
    yield from (
        two_body_cell("mass ratio", f"1 : 1e{e}, ε = {eps:g}", law, masses=(1.0, 10.0**e), eps=eps)
        for e, law, eps in product(range(-9, 10, 2), SWEPT_LAWS, (1.0, 0.3)) if possible(law, eps)
    )
    for e, law in product((-30, -9, 9, 30), SWEPT_LAWS):
        yield two_body_cell("mass ratio", f"both 1e{e} kg", law, masses=(10.0**e, 10.0**e))


def gaps() -> Iterator[Cell]:
    """Gaps from 0, the smallest float and one ulp up to 1 km."""
    widths = (0.0, 5e-324, 1e-300, 1e-100, 1e-30, 2.0**-52, 1e-12, 1e-8, 1e-4, 1.0, 1e3)
    each = product(widths, SWEPT_LAWS, MASS_CASES)
    return (two_body_cell("gap", f"gap = {gap:.3g}", law, gap=gap, masses=masses) for gap, law, masses in each)


def speeds() -> Iterator[Cell]:
    """Impact speeds from 1e-9 to 1e6 m/s."""
    each = product(range(-9, 7, 3), SWEPT_LAWS, MASS_CASES)
    return (two_body_cell("speed", f"v = 1e{e}", law, speed=10.0**e, masses=masses) for e, law, masses in each)


def starts() -> Iterator[Cell]:
    """Start times up to 1e12 s."""
    for e, law, k, methods in product((3, 6, 9, 12), SWEPT_LAWS, (1e6, 1e12), (("located", "edmd"), FIXED_METHODS)):
        cell = two_body_cell("start time", f"t = 1e{e}, k = {k:.0e}", law, k=k)
        yield replace(late_cell(cell, 10.0**e), methods=methods)


def late_cell(cell: Cell, start: float) -> Cell:
    """Cell with another start time in s."""
    return replace(cell, options=dict(cell.options) | {"t_start": start})


def exponents() -> Iterator[Cell]:
    """Elastic powers of the overlap from 1 to 3."""
    powers = (1.0, 1.1, 1.25, 1.5, 1.7, 2.0, 2.5, 3.0)
    for p, k, v in product(powers, (1e2, 1e6, 1e12), (1e-3, 1.0, 1e3)):
        cell = two_body_cell("exponent", "", "hertz", speed=v, masses=PAIR_MASSES)
        case = f"ξ^{p:g}, k = {k:.0e}, v = {v:g}, power, pair"
        yield replace(cell, case=case, law=PowerLaw(k, p), methods=SOFT_METHODS)


def corners() -> Iterator[Cell]:
    """All combinations of the extremes of seven parameters."""
    ends = product((1.0, 1e16), (1e-6, 1.0), (1e-9, 1e6), (1e-9, 1e9), (0.0, 1e3), (0.0, 1e12), ("linear", "tsuji"))
    for k, eps, v, ratio, gap, start, law in ends:
        case = f"k = {k:.0e}, ε = {eps:g}, v = {v:.0e}, 1 : {ratio:.0e}, gap = {gap:g}, t = {start:.0e}"
        yield late_cell(two_body_cell("corners", case, law, k=k, eps=eps, speed=v, masses=(1.0, ratio), gap=gap), start)


STEP_SHARES = (1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.63, 0.65, 1.0, 3.0)
"""Values of dt as shares of the contact duration t_c.

For an elastic spring, 2/ω₀ is 0.637 t_c.
"""


def steps() -> Iterator[Cell]:
    """One contact with dt from 1e-3 t_c to 3 t_c, begun at three phases of a step."""
    for law, eps, part, phase in product(SWEPT_LAWS, (1.0, 0.7, 0.1), STEP_SHARES, (0.0, 0.31, 0.83)):
        if possible(law, eps):
            cell = two_body_cell("time step", f"dt = {part:g} t_c, ε = {eps:g}, phase {phase:g}", law, eps=eps)
            dt = part * binary.collision(cell.law, cell.scene.pairs[0], 1.0).duration
            options = {"dt": dt, "t_end": phase * dt + 20.0 * max(dt, dt / part)}
            yield replace(cell, scene=cell.scene.replace(gap=[phase * dt]), methods=FIXED_METHODS, options=options)


def wall_hit_cell(axis: str, case: str, law: Any, expected: Truth, speed: float = 1.0) -> Cell:
    """Cell of a ball of 1 kg that hits a wall."""
    scene = Scene([math.inf, 1.0], [0.0, 0.5], [0.1], [0.0, -speed])
    return Cell(axis, case, scene, expected, law, options={"until": until.separated(), "max_steps": 50_000})


def powers() -> Iterator[Cell]:
    """Elastic powers n/12 from 1 to 16, with and without traits."""
    for n, law in product(range(12, 193), (PowerLaw, PlainPower)):
        yield wall_hit_cell("powers", f"ξ^({n}/12), {law.__name__}", law(1.0, n / 12.0), power_contact(1.0, n / 12.0))


def power_contact(k: float, p: float) -> Truth:
    """Contact of 1 kg at 1 m/s under F = k ξ^p.

    The depth follows from the energy, the duration from the Gamma function.
    """
    a = 1.0 / (p + 1.0)
    depth = ((p + 1.0) / (2.0 * k)) ** a
    duration = 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + a) / math.gamma(0.5 + a) * depth
    return truth.one_contact(1.0, 1.0, duration=duration, xi_max=depth, force_max=k * depth**p, impulse=2.0)


def kinks() -> Iterator[Cell]:
    """Laws with a kink in the overlap, in the rate, or at the start of unloading."""
    for ratio, part, v in product((0.1, 0.5, 3.0, 30.0), (0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99), (1.0, 0.37)):
        bent = TwoStiffnesses(1e4, 1e4 * ratio, part * v / 100.0)
        case = f"stiffness times {ratio:g} at {part:g} of the depth, v = {v:g}"
        yield wall_hit_cell("own laws", case, bent, bent_contact(bent, v), v)
    for first, then in product((0.0, 1e-3, 0.1, 0.5, 0.9), repeat=2):
        damped = TwoDampings(1e4, 200.0 * first, 200.0 * then)
        yield wall_hit_cell("own laws", f"ζ = {first:g} loading, {then:g} unloading", damped, damped_contact(damped))
    for rest, k in product((0.01, 0.1, 0.3, 0.5, 0.8, 0.99), (1.0, 1e4, 1e8)):
        case = f"unloading to {rest:g} of the depth, k = {k:.0e}"
        yield wall_hit_cell("own laws", case, Hysteresis(k, rest), plastic_contact(k, rest))


def bent_contact(law: TwoStiffnesses, v: float) -> Truth:
    """Contact of 1 kg at `v` in m/s with a spring of two stiffnesses.

    The motion follows arcs of two sines.
    """
    w1, w2, bend = math.sqrt(law.k), math.sqrt(law.k2), math.sqrt(law.k) * law.xi1
    turn, shift = math.sqrt((v - bend) * (v + bend)) / w2, law.k * law.xi1 / law.k2
    amplitude = math.hypot(shift, turn)
    duration = 2.0 * (math.asin(bend / v) / w1 + math.atan2(turn, shift) / w2)
    depth = law.xi1 + turn**2 / (amplitude + shift)
    return truth.one_contact(1.0, v, duration=duration, xi_max=depth, force_max=law.k2 * amplitude, impulse=2.0 * v)


def damped_contact(law: TwoDampings) -> Truth:
    """Contact of 1 kg at 1 m/s with different damping in loading and unloading.

    A damped oscillation leads to the peak. A second one, with the other damping, leads from rest there to F = 0.
    """
    w = math.sqrt(law.k)
    zeta = [0.5 * gamma / w for gamma in (law.loading, law.unloading)]
    phase = [math.acos(z) / math.sqrt((1.0 - z) * (1.0 + z)) for z in zeta]
    loss = [z * a for z, a in zip(zeta, phase, strict=True)]
    eps = math.exp(-sum(loss))
    return truth.one_contact(eps, 1.0, duration=sum(phase) / w, xi_max=math.exp(-loss[0]) / w, impulse=1.0 + eps)


def plastic_contact(k: float, rest: float) -> Truth:
    """Contact of 1 kg at 1 m/s with hysteresis.

    The motion consists of two quarter oscillations. Unloading returns a share 1 - rest of the energy.
    """
    w, left = math.sqrt(k), math.sqrt(1.0 - rest)
    return truth.one_contact(left, 1.0, duration=0.5 * math.pi * (1.0 + left) / w, xi_max=1.0 / w, force_max=w,
                             impulse=1.0 + left)

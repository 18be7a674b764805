"""Random comparisons of every kind, and the same ones as another observer describes them: boosts, mirror, units."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import granular as gr

INF = math.inf
LAWS = ("dashpot", "spring", "hertz", "tsuji", "viscoelastic", "power", "walton-braun")
DAMPED = ("dashpot", "tsuji", "viscoelastic", "walton-braun")
RARE = 0.04
"""Share of a law with memory, whose runs are interpreted and slow."""


@dataclass(frozen=True)
class Question:
    """One comparison: a scene, its laws, the end, and the tie rule."""

    scene: gr.Scene
    law: tuple[Any, ...]
    t_end: float
    ties: str = "left"

    def compare(self):
        return gr.compare(self.scene, self.law, t_end=self.t_end, ties=self.ties, max_events=5000)


# scenes: every maker returns a scene and an end in s


def masses(rng, n):
    """Equal masses, powers of two, or any."""
    way = rng.integers(3)
    return [1.0] * n if way == 0 else (2.0 ** rng.integers(-3, 4, n) if way == 1 else 10.0 ** rng.uniform(-1, 1, n))


def gaps(rng, n, touching=0.0):
    """Equal gaps, or any between 10 µm and 0.3 m; a share of 0."""
    size = 10.0 ** rng.uniform(-5.0, -0.5, n) if rng.random() < 0.7 else np.full(n, rng.choice([0.001, 0.1, 0.125]))
    return np.where(rng.random(n) < touching, 0.0, size)


def floor_scene(rng, n, gap, velocity=None):
    return gr.Scene([INF, *masses(rng, n)], [0.0, *[0.05] * n], gap, [0.0] * (n + 1) if velocity is None else velocity,
                    gravity=float(rng.choice([9.81, 8.0, 1.62])))


def stack(rng):
    n = int(rng.integers(1, 5))
    return floor_scene(rng, n, [rng.uniform(0.02, 0.5), *gaps(rng, n - 1)]), float(rng.uniform(0.2, 0.8))


def pile_at_rest(rng):
    """Balls that rest on the floor and on each other with gap 0."""
    n = int(rng.integers(1, 5))
    return floor_scene(rng, n, [0.0] * n), float(rng.uniform(0.02, 0.1))


def nearly_pile(rng):
    """A ball at rest on the floor with gap 0, and balls above it, of which some touch."""
    n = int(rng.integers(2, 5))
    return floor_scene(rng, n, [0.0, *gaps(rng, n - 1, 0.4)]), float(rng.uniform(0.02, 0.2))


def cradle(rng):
    n = int(rng.integers(2, 7))
    velocity = [1.0] * int(rng.integers(1, 3))
    gap = [0.0] * (n - 1) if rng.random() < 0.3 else gaps(rng, n - 1, 0.2)
    return gr.Scene([1.0] * n, [0.05] * n, gap, [*velocity, *[0.0] * n][:n]), float(rng.uniform(0.1, 1.0))


def chain(rng):
    """Balls of any masses in a row, hit by the first, or all moving."""
    n = int(rng.integers(2, 8))
    velocity = [float(rng.uniform(0.1, 3.0)), *[0.0] * (n - 1)] if rng.random() < 0.5 else rng.uniform(-1.0, 1.0, n)
    return gr.Scene(masses(rng, n), [0.05] * n, gaps(rng, n - 1, 0.1), velocity), float(rng.uniform(0.2, 2.0))


def box(rng):
    """Two to four balls between two walls, of which one may move inwards slowly."""
    n = int(rng.integers(1, 5))
    walls = [0.0, 0.0] if rng.random() < 0.7 else [0.05, -0.05]
    gap = gaps(rng, n + 1)
    gap[[0, -1]] += 0.05
    scene = gr.Scene([INF, *masses(rng, n), INF], [0.0, *[0.1] * n, 0.0], gap,
                     [walls[0], *rng.uniform(-1.0, 1.0, n), walls[1]])
    return scene, float(rng.uniform(0.2, 1.0))


def gas(rng):
    n = int(rng.integers(3, 8))
    scene = gr.Scene([INF, *masses(rng, n), INF], [0.0, *[0.02] * n, 0.0], rng.uniform(0.01, 0.1, n + 1),
                     [0.0, *rng.uniform(-1.0, 1.0, n), 0.0])
    return scene, float(rng.uniform(0.1, 0.6))


def ring(rng):
    n = int(rng.integers(2, 6))
    scene = gr.Scene(masses(rng, n), [0.0] * n, rng.uniform(0.05, 0.5, n), rng.uniform(-1.0, 1.0, n), ring=True)
    return scene, float(rng.uniform(0.5, 2.0))


def pushed(rng):
    """A scene without gravity whose balls are pushed by constant forces, some of them together."""
    scene, t_end = (chain, box, cradle)[int(rng.integers(3))](rng)
    force = np.where(scene.is_wall, 0.0, rng.choice([-2.0, 0.0, 1.0], scene.n) if rng.random() < 0.5
                     else rng.uniform(-2.0, 2.0, scene.n))
    return scene.replace(external_force=force), t_end


def pressed(rng):
    """Balls in contact with a wall, at rest, pressed on it by constant forces."""
    n = int(rng.integers(1, 4))
    scene = gr.Scene([INF, *masses(rng, n)], [0.0, *[0.05] * n], [0.0] * n, [0.0] * (n + 1),
                     external_force=[0.0, *-rng.uniform(0.5, 3.0, n)])
    return scene, float(rng.uniform(0.02, 0.1))


def late_ties(rng):
    """Equal balls with equal gaps and whole velocities: some collisions happen at the same time after the start."""
    n = int(rng.integers(3, 7))
    gap, velocity = float(rng.choice([0.1, 0.125, 0.3])), rng.integers(-3, 4, n).astype(float)
    mass, walls = [float(rng.choice([1.0, 2.0]))] * n, rng.random() < 0.3
    if walls:
        scene = gr.Scene([INF, *mass, INF], [0.0, *[0.05] * n, 0.0], [gap] * (n + 1), [0.0, *velocity, 0.0])
    else:
        scene = gr.Scene(mass, [0.05] * n, [gap] * (n - 1), velocity)
    return scene, float(rng.uniform(0.1, 0.6))


KINDS = (stack, pile_at_rest, nearly_pile, cradle, chain, box, gas, ring, pushed, pressed, late_ties)


def kind_of_law(rng, kinds):
    share = np.array([RARE if kind == "walton-braun" else 1.0 for kind in kinds])
    return str(rng.choice(kinds, p=share / share.sum()))


def law_of(rng, kind, pair):
    """A law of a kind, for one pair."""
    k, eps = float(10.0 ** rng.uniform(4.5, 8.5)), float(rng.uniform(0.3, 0.98))
    if kind == "dashpot":
        return gr.LinearDashpot.from_restitution(eps, k=k, pair=pair)
    if kind == "tsuji":
        return gr.TsujiHertz.from_restitution(eps, 10.0 * k)
    if kind == "viscoelastic":
        return gr.ViscoelasticHertz.from_restitution(max(eps, 0.5), 1.0, 10.0 * k, pair)
    if kind == "walton-braun":
        return gr.WaltonBraun.from_restitution(eps, k)
    if kind == "power":
        return gr.PowerLaw(k, float(rng.choice([1.0, 1.5, 2.0])))
    return gr.LinearDashpot(k) if kind == "spring" else gr.Hertz(10.0 * k)


def question(seed):
    """The question of a number; all kinds in turn."""
    rng, maker = np.random.default_rng([8000, seed]), KINDS[seed % len(KINDS)]
    scene, t_end = maker(rng)
    kinds = DAMPED if scene.closing_acceleration.any() and rng.random() < 0.9 else LAWS
    one = kind_of_law(rng, kinds)
    mixed = rng.random() < 0.2
    law = [law_of(rng, kind_of_law(rng, kinds) if mixed else one, pair) for pair in scene.pairs]
    return Question(scene, tuple(law[:1] * len(law) if not mixed and rng.random() < 0.5 else law), t_end)


def grazes(one):
    """Whether an elastic contact begins at rest: its force returns to 0 at speed 0, where rounding is a root of it."""
    s = one.scene
    below, above = s.sides(s.velocity)
    touching = (s.gap == 0.0) & (below == above) & (s.closing_acceleration > 0.0)
    return any(touching[c] and elastic(one.law[c]) for c in range(s.n_pairs))


def elastic(law):
    return isinstance(law, (gr.Hertz, gr.PowerLaw)) or getattr(law, "gamma", 1.0) == 0.0


# the same as another observer describes it


def boosted(one, speed):
    """Seen from a train: all bodies, walls too, have a common velocity."""
    return Question(one.scene.replace(velocity=one.scene.velocity + speed), one.law, one.t_end, one.ties)


def mirrored(one):
    """Seen from behind; the other one of two simultaneous collisions comes first."""
    s = one.scene
    gap = [*s.gap[: s.n - 1][::-1], *s.gap[s.n - 1 :]]
    law = (*one.law[: s.n - 1][::-1], *one.law[s.n - 1 :])
    force = None if s.external_force is None else -s.external_force[::-1]
    scene = gr.Scene(s.mass[::-1], s.radius[::-1], gap, -s.velocity[::-1], external_force=force, ring=s.ring)
    return Question(scene, law, one.t_end, {"left": "right", "right": "left"}.get(one.ties, one.ties))


def law_in_units(law, length, time, mass):
    """The same law in other units, by the dimensions of its numbers."""
    stiffness, root = mass / time**2, math.sqrt(length)
    if isinstance(law, gr.LinearDashpot):
        return gr.LinearDashpot(law.k * stiffness, law.gamma * mass / time)
    if isinstance(law, gr.WaltonBraun):
        return gr.WaltonBraun(law.k_load * stiffness, law.k_unload * stiffness)
    if isinstance(law, gr.ViscoelasticHertz):
        return gr.ViscoelasticHertz(law.k * stiffness / root, law.gamma * mass / time / root)
    if isinstance(law, gr.TsujiHertz):
        return gr.TsujiHertz(law.k * stiffness / root, law.alpha)
    if isinstance(law, gr.PowerLaw):
        return gr.PowerLaw(law.k * stiffness / length ** (law.exponent - 1.0), law.exponent)
    return gr.Hertz(law.k * stiffness / root)


def in_units(one, length, time, mass):
    """In units of which a metre, a second and a kilogram have this many."""
    s, speed = one.scene, length / time
    force = None if s.external_force is None else s.external_force * (mass * length / time**2)
    scene = gr.Scene(s.mass * mass, s.radius * length, s.gap * length, s.velocity * speed, s.gravity * speed / time,
                     external_force=force, ring=s.ring)
    law = {id(each): law_in_units(each, length, time, mass) for each in one.law}
    return Question(scene, tuple(law[id(each)] for each in one.law), one.t_end * time, one.ties)


SPEEDS = (0.5, 10.0, -3.0, 0.3)
UNITS = {"powers of two": (2.0**8, 2.0**-4, 2.0**5), "mm, ms, µg": (1e3, 1e3, 1e9), "cm, s, g": (1e2, 1.0, 1e3),
         "km, h, t": (1e-3, 1.0 / 3600.0, 1e-3)}
SYMMETRIES = {**{f"boost {v}": v for v in SPEEDS}, "mirror": None, **UNITS}
"""Names of the symmetries, with a speed in m/s or with units of length, time and mass."""


def image(one, name):
    """The question under a symmetry, and how many of the new unit of speed are 1 m/s."""
    if name == "mirror":
        return mirrored(one), 1.0
    if name in UNITS:
        length, time, mass = UNITS[name]
        return in_units(one, length, time, mass), length / time
    return boosted(one, SYMMETRIES[name]), 1.0


def symmetry_of(one, seed):
    """The symmetry that a question of a number is tried with: each scene one, all in turn."""
    names = list(SYMMETRIES)
    if one.scene.gravity > 0.0:
        names.remove("mirror")
    return names[seed // len(KINDS) % len(names)]

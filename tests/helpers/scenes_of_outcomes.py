"""Random scenes whose outcomes are compared: damped boxes, cradles, stacks, gases, piles, rings, and their options."""

import math

import numpy as np

import granular as gr

INF = math.inf
OUTCOME_KINDS = ("damped_box", "cradle", "stack", "pile_hit", "gas", "ring", "equal", "boost", "no_end", "threshold")


def dashpots(scene, restitution, k):
    """A dashpot for each pair, with its own restitution."""
    return [gr.LinearDashpot.from_restitution(e, k=k, pair=pair)
            for e, pair in zip(np.broadcast_to(restitution, len(scene.pairs)).tolist(), scene.pairs, strict=True)]


def damped_box(rng):
    """Two to four balls between two walls, some of them close; the walls absorb nearly everything."""
    n = int(rng.integers(2, 5))
    gap = rng.uniform(0.05, 0.3, n + 1)
    near = int(rng.integers(1, n))
    gap[near] = 10.0 ** rng.uniform(-5.0, -1.5)
    mass = np.exp(rng.uniform(-1.5, 1.5, n)).tolist()
    scene = gr.Scene([INF, *mass, INF], [0.0, *[0.1] * n, 0.0], gap, [0.0, *rng.uniform(-1.0, 1.0, n), 0.0])
    restitution = [0.02, *rng.uniform(0.5, 1.0, n - 1), 0.02]
    return scene, dashpots(scene, restitution, 10.0 ** rng.uniform(4.5, 8.0)), float(rng.uniform(0.3, 2.0))


def cradle(rng):
    """Equal balls in a row, hit by one or by two."""
    n = int(rng.integers(3, 7))
    velocity = [1.0] * int(rng.integers(1, 3))
    gap = 10.0 ** rng.uniform(-6.0, -2.0) * rng.uniform(0.5, 1.5, n - 1)
    scene = gr.Scene([1.0] * n, [0.05] * n, gap, [*velocity, *[0.0] * (n - len(velocity))])
    return scene, dashpots(scene, rng.uniform(0.5, 1.0), 10.0 ** rng.uniform(6.0, 10.0)), float(rng.uniform(0.05, 0.5))


def stack(rng):
    """Balls dropped one above the other on a floor."""
    n = int(rng.integers(2, 5))
    mass = (rng.uniform(1.0, 12.0) ** -np.arange(n)).tolist()
    gap = [rng.uniform(0.05, 1.0), *10.0 ** rng.uniform(-4.0, -1.0, n - 1)]
    scene = gr.Scene([INF, *mass], [0.0, *[0.05] * n], gap, [0.0] * (n + 1), gravity=9.81)
    return scene, dashpots(scene, rng.uniform(0.4, 1.0, n), 10.0 ** rng.uniform(5.0, 8.0)), float(rng.uniform(0.3, 1.2))


def pile_hit(rng):
    """A pile at rest, touching the floor, and a ball that falls on it."""
    n = int(rng.integers(1, 4))
    mass = [*rng.uniform(0.5, 2.0, n), 10.0 ** rng.uniform(-3.0, 0.5)]
    gap = [*[0.0] * n, 10.0 ** rng.uniform(-5.0, -0.5)]
    scene = gr.Scene([INF, *mass], [0.0, *[0.05] * (n + 1)], gap, [0.0] * (n + 2), gravity=9.81)
    law = dashpots(scene, rng.uniform(0.1, 0.8, n + 1), 10.0 ** rng.uniform(4.5, 8.0))
    return scene, law, float(rng.uniform(0.1, 0.6))


def gas(rng):
    """Balls in a box, for a few collisions each."""
    n = int(rng.integers(3, 9))
    gap, velocity = rng.uniform(0.01, 0.1, n + 1), rng.uniform(-1.0, 1.0, n)
    mass = np.exp(rng.uniform(-1.0, 1.0, n)).tolist()
    scene = gr.Scene([INF, *mass, INF], [0.0, *[0.02] * n, 0.0], gap, [0.0, *velocity, 0.0])
    return scene, dashpots(scene, rng.uniform(0.7, 1.0), 10.0 ** rng.uniform(6.0, 9.0)), float(rng.uniform(0.1, 0.8))


def ring(rng):
    n = int(rng.integers(2, 6))
    scene = gr.Scene([1.0] * n, [0.0] * n, rng.uniform(0.05, 0.5, n), rng.uniform(-1.0, 1.0, n), ring=True)
    return scene, dashpots(scene, rng.uniform(0.5, 1.0), 10.0 ** rng.uniform(4.0, 8.0)), float(rng.uniform(0.2, 1.0))


def equal(rng):
    """Equal balls with equal gaps, so that collisions happen at the same time."""
    n = int(rng.integers(2, 7))
    velocity = rng.integers(-2, 3, n).astype(float)
    gap = [float(rng.choice([0.0, 0.05, 0.1]))] * (n - 1)
    scene = gr.Scene([1.0] * n, [0.05] * n, gap, velocity)
    return scene, dashpots(scene, rng.uniform(0.3, 1.0), 10.0 ** rng.uniform(5.0, 8.0)), 0.5


def boost(rng):
    """A scene of another kind in which all bodies, walls too, have a common velocity."""
    scene, law, t_end = [damped_box, cradle, stack, gas, equal][int(rng.integers(5))](rng)
    speed = float(rng.choice([0.5, -3.0, 10.0]))
    return scene.replace(velocity=np.asarray(scene.velocity) + speed), law, t_end


def no_end(rng):
    """Free balls, or balls between a floor and a roof far away, until no contact can follow."""
    scene, law, _ = [cradle, equal][int(rng.integers(2))](rng)
    return scene, law, None


def threshold(rng):
    """Balls over a floor whose rule has no rebound below a threshold."""
    return stack(rng)


class BounceThreshold:
    """A constant restitution that is 0 below an approach speed."""

    def __init__(self, restitution, below):
        self.restitution, self.below = restitution, below

    def __call__(self, speed, pair):
        return self.restitution if speed >= self.below else 0.0


MAKERS = (damped_box, cradle, stack, pile_hit, gas, ring, equal, boost, no_end, threshold)


def outcome_question(kind, seed):
    """Scene, laws, rule (None for the rule of the laws) and end (None for no end) of a number."""
    index = OUTCOME_KINDS.index(kind)
    rng = np.random.default_rng([7000 + index, seed])
    scene, law, t_end = MAKERS[index](rng)
    rule = BounceThreshold(float(rng.uniform(0.4, 0.9)), float(rng.uniform(0.05, 1.0))) if kind == "threshold" else None
    return scene, law, rule, t_end


def basketball_and_tennis_ball(gap=0.0236, t_end=0.93):
    """A tennis ball above a basketball: equal counts, outcomes that agree, another speed between the two contacts."""
    case = gr.cases.make("real-balls", lower="basketball", upper="tennis ball", pair_rule="lens", gap=gap, height=1.0)
    return case.scene, case.law, case.rule, t_end


def box_whose_walls_hide_a_wrong_flight():
    """Equal counts and equal last velocities; ball 1 flies back at -0.463 m/s (hard) and -0.698 m/s (soft)."""
    scene = gr.Scene([INF, 0.24, 0.93, INF], [0.0, 0.1, 0.1, 0.0], [0.2, 1e-4, 0.125], [0.0, 0.85, 0.97, 0.0])
    return scene, dashpots(scene, [0.02, 0.9, 0.02], 1.5e5), None, 1.5


def ring_whose_episode_hides_a_wrong_flight():
    """Ball 0 flies at -2.98 m/s (hard) and -1.49 m/s (soft) from ball 1 to ball 2, which absorbs its velocity.

    Both contacts overlap with the long soft contact of balls 1 and 2: the flight lies within one episode.
    """
    scene = gr.Scene([1e-3, 1.0, 1000.0], [0.0] * 3, [0.09, 0.01, 0.04], [2.6, 1.0, 0.0], ring=True)
    law = [gr.LinearDashpot.from_restitution(e, k=k, pair=pair)
           for e, k, pair in zip((0.9, 0.34, 0.01), (1e4, 250.0, 1e4), scene.pairs, strict=True)]
    return scene, law, None, 0.25

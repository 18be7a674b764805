"""Piles of balls that merge: every collision is that of decimal arithmetic of 50 digits, in any units and in a mirror.

Within one fall there are hundreds of collisions that times of 16 digits do not tell apart; which comes first decides
what follows.
"""

import decimal
import math
from decimal import Decimal
from itertools import pairwise

import numpy as np
import pytest

import granular as gr

INF, MOST = Decimal("Infinity"), 400


def pile(seed):
    """Balls on a floor, perhaps some that touch, with and without gravity; and ε of each pair."""
    rng = np.random.default_rng([99, seed])
    n, _ = int(rng.integers(3, 13)), rng.random()
    gap = rng.uniform(0.0, 0.3, n) * 10.0 ** rng.uniform(-3.0, 0.0)
    velocity = rng.normal(size=n) * rng.choice([0, 1, 1])
    mass = 10.0 ** rng.uniform(-1.0, 1.0, n) if rng.random() < 0.6 else np.ones(n)
    if rng.random() < 0.3:
        velocity[:] = -1.0
    gap[rng.random(n) < rng.choice([0.0, 0.5, 1.0]) * 0.99] = 0.0
    if rng.random() < 0.2:
        gap[:] = 0.1
    eps = rng.uniform(0.2, 0.9, n).tolist() if rng.random() < 0.5 else [float(rng.uniform(0.2, 0.9))] * n
    gravity = 9.81 if rng.random() < 0.8 else 0.0
    return gr.Scene([math.inf, *mass], [0.0] + [0.05] * n, gap, [0.0, *velocity], gravity), eps


def run(scene, eps, **options):
    """Hard spheres that merge, until the first of `MOST` collisions or 2 s."""
    rules = [gr.ConstantRestitution(e) for e in eps]
    return gr.edmd.simulate(scene, rules, collapse="merge", max_events=MOST, **{"t_end": 2.0} | options)


def due(gap, rate, a):
    """The time until a gap closes."""
    if a == 0 or (gap == 0 and rate < 0):
        return gap / -rate if rate < 0 else INF
    root = (rate * rate + 2 * a * gap).sqrt()
    if rate > 0:
        return (rate + root) / a
    return 2 * gap / (root - rate) if root else INF


def hit(c, w, e, below, scene):
    """Let pair `c` of (mass, velocity, gap, whether a body rests, g) collide at rate `w`."""
    mass, v, gap, rests, g = scene
    a, z = c, c + 1
    joined = [d == 0 and not (rests[k] or rests[k + 1]) and v[k] == v[k + 1] for k, d in enumerate(gap)]
    if -w < below and g * (rests[a] - rests[z]) >= 0:  # they merge, with all that moves as one with them
        while a > 0 and joined[a - 1]:
            a -= 1
        while z < len(gap) and joined[z]:
            z += 1
        low, high = sum(mass[a : c + 1]), sum(mass[c + 1 : z + 1])
        if rests[c]:
            v[c + 1 : z + 1], rests[c + 1 : z + 1] = [v[c]] * (z - c), [True] * (z - c)
        else:
            v[a : z + 1] = [v[c] + high / (low + high) * w] * (z + 1 - a)
        return
    while z + 1 < len(mass) and rests[z] and rests[z + 1] and gap[z] == 0:
        z += 1
    rests[max(a, 1) : z + 1] = [False] * (z + 1 - max(a, 1))  # what stood on what is hit stands no more
    share = Decimal(0) if c == 0 else mass[c + 1] / (mass[c] + mass[c + 1])
    v[c] += share * (1 + e) * w
    v[c + 1] = v[c] - e * w


def exactly(scene, eps, below, t_end=2.0):
    """The first `MOST` collisions: time, pair and rate."""
    mass, v, gap, eps = ([Decimal(float(x)) for x in given] for given in (scene.mass, scene.velocity, scene.gap, eps))
    rests, g, t, rows = list(map(bool, scene.is_wall)), Decimal(scene.gravity), Decimal(0), []
    while len(rows) < MOST:
        for k in range(len(gap)):
            if g > 0 and rests[k] and gap[k] == 0 and v[k] == v[k + 1]:
                rests[k + 1] = True
        pull, rate = [g * (a - b) for a, b in pairwise(rests)], [b - a for a, b in pairwise(v)]
        dt, c = min((due(*pair), k) for k, pair in enumerate(zip(gap, rate, pull, strict=True)))
        if t + dt > t_end:
            break
        w = -(rate[c] * rate[c] + 2 * pull[c] * gap[c]).sqrt() if pull[c] else rate[c]
        if dt:
            gap = [d + dt * (r - a * dt / 2) for d, r, a in zip(gap, rate, pull, strict=True)]
            v = [x if still else x - g * dt for x, still in zip(v, rests, strict=True)]
        gap[c], t = Decimal(0), t + dt
        rows.append((float(t), c, float(-w)))
        hit(c, w, eps[c], Decimal(below), (mass, v, gap, rests, g))
    return rows


# these but for 3, and 10 more of the first 430, were wrong; what is left is 41: 20000 collisions in one instant, whose
# 578th hangs on 1e-33 s
@pytest.mark.rotating
@pytest.mark.parametrize("seed", [14, 92, 190, 192, 193, 259, 374, 407, 72, 3])
def test_collisions_of_balls_that_merge_are_those_of_fifty_digits(seed):
    scene, eps = pile(seed)
    here = run(scene, eps)
    with decimal.localcontext(prec=50):
        rows = exactly(scene, eps, here.stats["merge_below"])
    log, fastest = here.contacts, max(w for _, _, w in rows)
    assert log["pair"].tolist() == [c for _, c, _ in rows]
    assert log["t_begin"] == pytest.approx([t for t, _, _ in rows], rel=1e-12)
    assert log["v_in"] @ [1.0, -1.0] == pytest.approx([w for _, _, w in rows], rel=1e-9, abs=1e-13 * fastest)
    for length, time in ((1e3, 0.7), (1.0, 3.0)):
        other = gr.Scene(scene.mass, scene.radius * length, scene.gap * length, scene.velocity * (length / time),
                         scene.gravity * (length / time**2))
        assert (run(other, eps, t_end=2.0 * time).contacts["pair"] == log["pair"]).all()


@pytest.mark.parametrize("seed", [5, 27, 63])
def test_the_clock_of_balls_that_merge_never_goes_back(seed):
    assert (np.diff(run(*pile(seed)).contacts["t_begin"]) >= 0.0).all()


@pytest.mark.parametrize("seed", [196, 333, 366])
def test_balls_that_merge_do_so_in_a_mirror(seed):
    scene, eps = pile(seed)
    image = gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1])
    here = gr.edmd.simulate(scene, [gr.ConstantRestitution(e) for e in eps], collapse="merge", max_events=1500,
                            ties="left")
    there = gr.edmd.simulate(image, [gr.ConstantRestitution(e) for e in eps[::-1]], collapse="merge", max_events=1500,
                             ties="right")
    assert (here.contacts["pair"] == scene.n_pairs - 1 - there.contacts["pair"]).all()
    assert here.velocity[-1] == pytest.approx(-there.velocity[-1][::-1], abs=1e-12)

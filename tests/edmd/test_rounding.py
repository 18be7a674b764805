"""What is rounding does not collide: numbers of collisions equal those of exact rational arithmetic."""

import math
from fractions import Fraction

import numpy as np
import pytest

from granular import edmd, until
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import Status
from granular.scene import Scene

ELASTIC = ConstantRestitution(1.0)
ENGINES = ("sorted", "compiled")


def exactly(scene):
    """Return the pairs that collide, elastically, in their order, and the time of the last, in rational arithmetic."""
    m, v = [Fraction(x) for x in scene.mass.tolist()], [Fraction(x) for x in scene.velocity.tolist()]
    gap, now, pairs = [Fraction(x) for x in scene.gap.tolist()], Fraction(0), []
    while True:
        closing = [(gap[c] / (v[c] - v[c + 1]), c) for c in range(len(gap)) if v[c] > v[c + 1]]
        if not closing:
            return pairs, float(now)
        dt, c = min(closing)
        gap = [d + dt * (v[k + 1] - v[k]) for k, d in enumerate(gap)]
        gap[c], now = Fraction(0), now + dt
        mean = (m[c] * v[c] + m[c + 1] * v[c + 1]) / (m[c] + m[c + 1])
        v[c], v[c + 1] = 2 * mean - v[c], 2 * mean - v[c + 1]
        pairs.append(c)


def free(seed, kind):
    """Return balls without walls; of whole masses and velocities many come to move in parallel."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 9))
    gap = random.uniform(0.1, 1.0, n - 1)
    if kind == "whole":
        gap *= random.random(n - 1) > 0.2  # some touch
        return Scene(random.integers(1, 7, n), np.zeros(n), gap, random.integers(-3, 4, n))
    return Scene(np.exp(random.uniform(-3, 3, n)), np.zeros(n), gap, random.normal(size=n))


@pytest.mark.rotating
@pytest.mark.parametrize(("kind", "seeds"), [("whole", [*range(100), 481, 553]), ("any", range(40))])
def test_collisions_are_those_of_exact_arithmetic(kind, seeds) -> None:
    """Seeds 51, 481 and 553 had contacts that were but rounding, the last at a gap of 0."""
    for seed in seeds:
        scene = free(seed, kind)
        pairs, last = exactly(scene)
        run = edmd.simulate(scene, ELASTIC)
        assert run.status is Status.quiet, seed
        assert run.contacts["pair"].tolist() == pairs, seed
        assert float(run.time[-1]) == pytest.approx(last, rel=1e-9), seed


def test_a_ball_that_slows_down_between_walls_is_never_taken_for_rounding() -> None:
    scene = Scene([math.inf, 1.0, math.inf], [0.0] * 3, [1.0, 1.0], [0.0, 1.0, 0.0])
    run = edmd.simulate(scene, ConstantRestitution(0.1), until=until.contact(0, 50))
    assert run.status is Status.until
    assert float(run.velocity[-1, 1]) == pytest.approx(-1e-99, rel=1e-12)


def test_light_balls_on_a_heavy_one_that_hand_on_all_they_have_collide_once_each() -> None:
    """Masses 2/(k(k+1)): all but the top one are left at rest, except for rounding."""
    for n in (4, 5, 8, 12):
        mass = [math.inf, *(2.0 / (k * (k + 1)) for k in range(1, n + 1))]
        for gap in (0.0, 1e-30, 1e-9, 1.0):
            scene = Scene(mass, [0.0] * (n + 1), [1.0] + [gap] * (n - 1), [0.0] + [-1.0] * n)
            run = edmd.simulate(scene, ELASTIC)
            assert run.contacts["pair"].tolist() == list(range(n))
            assert float(run.time[-1]) < 4.0
            apart = edmd.simulate(scene, ELASTIC, until=until.separated())
            assert apart.status is Status.until
            assert apart.contacts.tobytes() == run.contacts.tobytes()
            assert edmd.simulate(scene, ELASTIC, until=until.contact(1, 2)).status is Status.quiet
            part = edmd.resume(edmd.simulate(scene, ELASTIC, max_events=2))
            assert part.stats["events"] == n


def test_a_slow_approach_that_was_given_is_no_rounding() -> None:
    """Also beside faster balls, and after the slow ones have collided among themselves."""
    slow = 1e-17
    scene = Scene([1.0, 2.0, 1.0, 1.0], [0.0] * 4, [1.0] * 3, [slow, 0.0, 0.5, -0.5])
    run = edmd.simulate(scene, ELASTIC)
    pairs, last = exactly(scene)
    assert run.contacts["pair"].tolist() == pairs
    assert float(run.time[-1]) == pytest.approx(last)
    nearly = Scene([1.0, 1.0], [0.0] * 2, [1.0], [1.0, math.nextafter(1.0, 0.0)])
    assert edmd.simulate(nearly, ELASTIC).count(0) == 1


def test_balls_that_fall_freely_collide_as_they_do_without_gravity() -> None:
    """Nothing is lost to the speed of the fall, 500 m/s at the last collision."""
    scene = Scene([1.0, 2.0, 3.0], [0.1] * 3, [6.0, 20.0], [0.03, 0.01, -0.013])
    falling = scene.replace(gravity=9.81)
    rule = ConstantRestitution(0.75)
    for engine in ENGINES:
        weightless = edmd.simulate(scene, rule, t_start=2.0, engine=engine)
        run = edmd.simulate(falling, rule, t_start=2.0, engine=engine)
        assert len(run.contacts) == 3
        for name in ("pair", "t_begin", "impulse"):
            assert run.contacts[name].tobytes() == weightless.contacts[name].tobytes()
        assert run.gap.tobytes() == weightless.gap.tobytes()
        fallen = 9.81 * (run.contacts["t_begin"] - 2.0)[:, None]
        np.testing.assert_allclose(run.contacts["v_in"], weightless.contacts["v_in"] - fallen, rtol=1e-15)
        np.testing.assert_allclose(run.contacts["v_out"], weightless.contacts["v_out"] - fallen, rtol=1e-15)
        end = 9.81 * (run.time[-1] - 2.0)
        np.testing.assert_allclose(run.velocity[-1], weightless.velocity[-1] - end, rtol=1e-15)
        later = edmd.resume(edmd.simulate(falling, rule, t_start=2.0, t_end=400.0, engine=engine), engine=engine)
        assert later.velocity[-1].tobytes() == run.velocity[-1].tobytes()

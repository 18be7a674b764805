"""Closed forms against 72-digit references, exact rational arithmetic and each other."""

import json
import math
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from granular import scenes, theory

ICM = json.loads((Path(__file__).parents[1] / "reference" / "icm.json").read_text())["rows"]


def model(row: dict) -> theory.TwoBallDrop:
    mu = (float(row["R2"]) / float(row["R1"])) ** 3
    thrown = row["v0"] is not None  # these sets start as the lower ball touches the floor
    drop = 0.0 if thrown else float(Fraction(row["z1"]) - Fraction(row["R1"]))
    speed = -float(row["v0"]) if thrown else 0.0
    return theory.two_ball_drop(mu, float(row["eps"]), drop, float(row["dh"]), float(row["g"]), speed)


@pytest.mark.parametrize("row", ICM, ids=lambda row: row["id"])
def test_independent_collisions_of_the_paper(row):
    icm, speed = model(row), abs(row["v10"])
    assert icm.t10 == pytest.approx(row["t10"], rel=1e-15)
    assert icm.t12 == pytest.approx(row["t12"], rel=1e-15)
    assert icm.delay == pytest.approx(row["dt"], rel=1e-15, abs=0.0)
    names = {"v10": "v10", "v10_after": "v10p", "v1": "v12", "v2": "v21", "v1_after": "v1p", "v2_after": "v2p",
             "v_rel_after": "vrp"}
    for ours, theirs in names.items():
        assert getattr(icm, ours) == pytest.approx(row[theirs], rel=0.0, abs=2e-15 * speed), ours


@pytest.mark.parametrize("row", [r for r in ICM if r["v0"] is None], ids=lambda row: row["id"])
def test_the_ready_made_scene_has_the_paper_s_masses_and_heights(row):
    scene = scenes.three_balls((float(row["R1"]), float(row["R2"])), float(row["dh"]), float(row["z1"]),
                               float(row["rho"]), float(row["g"]))
    assert scene.mass[1:] == pytest.approx([row["m1"], row["m2"]], rel=1e-15)
    assert scene.position[2] == pytest.approx(row["z20"], rel=1e-15)


@given(e=st.floats(1e-300, 1.0), v=st.floats(1e-3, 1e3))
def test_effective_restitution_inverts_the_model(e, v):
    assert theory.effective_restitution(e * (1.0 + e) * v, v) == pytest.approx(e, rel=1e-14)


def test_two_balls_may_have_different_restitution_at_the_floor():
    icm = theory.two_ball_drop(0.001, (0.9, 0.5), drop=0.5, gap=1e-4)
    assert icm.v10_after == pytest.approx(0.9 * abs(icm.v10))
    assert icm.v2_after - icm.v1_after == pytest.approx(0.5 * 1.9 * abs(icm.v10), rel=1e-14)
    momentum = icm.v1 + 0.001 * icm.v2
    assert icm.v1_after + 0.001 * icm.v2_after == pytest.approx(momentum, rel=1e-14)


@given(ratios=st.lists(st.floats(1e-6, 2.0), min_size=0, max_size=8), eps=st.floats(0.0, 1.0))
def test_a2_stacks_equal_the_product_formula_in_exact_arithmetic(ratios, eps):
    masses = np.cumprod([1.0, *ratios])
    exact = Fraction(1)
    for lower, upper in pairwise(masses):
        exact /= 1 + Fraction(float(upper)) / Fraction(float(lower))
    exact = exact * (1 + Fraction(eps)) ** len(masses) - 1
    scale = max(1.0, abs(float(exact)))
    assert theory.stack_velocities(masses, eps)[-1] == pytest.approx(float(exact), rel=1e-14, abs=1e-14 * scale)


@pytest.mark.parametrize(("n", "top"), [(3, 6.999984000024), (8, 254.998208007168)])
def test_a3_light_upper_balls(n, top):
    assert theory.stack_velocities(1e-6 ** np.arange(n), 1.0)[-1] == pytest.approx(top, rel=1e-13)
    assert theory.stack_limit(n) == pytest.approx(2**n - 1, rel=1e-15)


def test_a3_rise_to_9_and_49_drop_heights():
    assert theory.rise(theory.stack_limit(2)) == pytest.approx(9.0, rel=1e-14)
    assert theory.rise(theory.stack_limit(3)) == pytest.approx(49.0, rel=1e-14)
    assert theory.rise(-1.0) == 0.0


@pytest.mark.parametrize(("n", "ratio", "middle", "top"), [
    (3, 100.0, [0.1], 5.6115702479338845), (4, 1000.0, [0.1, 0.01], 11.021036814425246)])
def test_a5_best_masses_are_geometric_and_best(n, ratio, middle, top):
    masses = theory.best_masses(1.0, 1.0 / ratio, n)
    assert masses[1:-1] == pytest.approx(middle, rel=1e-14)
    best = theory.stack_velocities(masses, 1.0)[-1]
    assert best == pytest.approx(top, rel=1e-14)
    for k in range(1, n - 1):
        for factor in (0.99, 1.01):
            other = masses.copy()
            other[k] *= factor
            assert theory.stack_velocities(other, 1.0)[-1] < best


@pytest.mark.parametrize(("n", "v"), [(2, 1.980198), (3, 3.305785), (5, 5.3308417503652015), (11, 7.689072)])
def test_a6_tapered_chains(n, v):
    assert theory.chain_velocity(theory.best_masses(100.0, 1.0, n)) == pytest.approx(v, rel=1e-6 if n != 5 else 1e-14)


@pytest.mark.parametrize(("eps", "collisions", "v"), [
    (0.99, 23, 7.942515), (0.95, 10, 5.969254), (0.9, 7, 4.813688823480276), (0.8, 5, 3.537205)])
def test_a6_best_number_of_collisions(eps, collisions, v):
    n, best = theory.best_chain(100.0, eps)
    assert n == collisions
    assert best == pytest.approx(v, rel=1e-13 if eps == 0.9 else 2e-7)
    assert theory.chain_velocity(theory.best_masses(100.0, 1.0, n + 1), eps) == pytest.approx(best, rel=1e-13)


@pytest.mark.parametrize("seed", range(20))
def test_best_number_of_collisions_near_restitution_1(seed):
    """Up to millions of balls, against the sign of a difference in 60 digits."""
    mp = pytest.importorskip("mpmath").MPContext()
    mp.dps, random = 60, np.random.default_rng(seed)
    ratio, eps = 1.0 + 10.0 ** random.uniform(-3, 30), 1.0 - 10.0 ** random.uniform(-15, -0.1)

    def gain(n):
        return n * (mp.log1p(eps) - mp.log1p(mp.mpf(ratio) ** (-mp.one / n)))

    n, best = theory.best_chain(ratio, eps)
    assert gain(n) >= gain(n + 1)
    assert n == 1 or gain(n) >= gain(n - 1)
    assert best == pytest.approx(float(mp.exp(gain(n))), rel=1e-13)


@pytest.mark.parametrize(("eps", "time"), [
    (0.5, 1.3545709229571927), (0.9, 8.578949178728887), (0.99, 89.85320455616036)])
def test_d8_bouncing_ball(eps, time):
    total, path = theory.bouncing_ball(1.0, eps)
    assert total == pytest.approx(time, rel=1e-14)
    bounces = sum(2.0 * eps ** (2 * k) for k in range(1, 5000))
    assert path == pytest.approx(1.0 + bounces, rel=1e-13)


@pytest.mark.parametrize(("masses", "most"), [
    ((1, 1, 1), 3), ((3, 1, 3), 5), ((10, 1, 10), 8), ((1, 5, 2), 3), ((100, 1, 50), 19)])
def test_d7_three_elastic_balls(masses, most):
    assert theory.most_collisions(masses) == most


@pytest.mark.parametrize(("call", "sentence"), [
    (lambda: theory.two_ball_drop(-0.1, 0.7, 0.5, 1e-4), r"`mass_ratio` must be .*at least 0, got -0\.1"),
    (lambda: theory.two_ball_drop(0.1, 1.2, 0.5, 1e-4), r"`restitution\[0\]` must be a number in \[0, 1\], got 1\.2\."),
    (lambda: theory.two_ball_drop(0.1, (0.7, 0.7, 0.7), 0.5, 1e-4),
        r"`restitution` must be an array of shape \(2,\).*, got an array of shape \(3,\)"),
    (lambda: theory.two_ball_drop(0.1, 0.7, 0.0, 1e-4), r"the balls never meet the floor"),
    (lambda: theory.effective_restitution(-1.0, 3.0),
        r"`v_rel_after` must be a finite number of at least 0, got -1\.0\. Balls that still approach have no "
        r"ε_eff\."),
    (lambda: theory.stack_velocities([1.0, math.inf], 1.0), r"`masses\[1\]` must be positive and finite.*, got inf"),
    (lambda: theory.stack_velocities([], 1.0), r"`masses` must be an array of at least one mass, got an empty array\."),
    (lambda: theory.best_chain(100.0, 1.0),
        r"`restitution` must be below 1, got 1\.0\. With 1 the velocity grows with every ball, to √R\."),
    (lambda: theory.bouncing_ball(1.0, 1.0), r"bounces forever"),
])
def test_misuse_is_a_sentence(call, sentence):
    with pytest.raises(ValueError, match=sentence):
        call()

"""Hard spheres on a ring: against a twin, free flights sorted, closed forms, and wherever its numbers begin."""

import math

import mpmath as mp
import numpy as np
import pytest

import granular as gr
from tests.helpers import hard_twin
from tests.helpers.condition import response
from tests.helpers.hard_runs import QUEUES, follows_the_twin, goes_on, loss, run


def ring(seed, n=None, equal=False):
    """Balls on a ring."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8)) if n is None else n
    mass = np.ones(n) if equal else np.exp(rng.normal(size=n))
    return gr.Scene(mass, np.full(n, 0.01), rng.exponential(size=n), rng.normal(size=n), origin=float(rng.normal()),
                    ring=True)


def turned(scene, k):
    """The same ring, numbered from ball `k` on."""
    parts = {name: np.roll(getattr(scene, name), -k) for name in ("mass", "radius", "gap", "velocity")}
    return scene.replace(**parts, origin=float(scene.position[k]))


@pytest.mark.parametrize("eps", [0.9, 0.5])
def test_two_balls_on_a_ring_collide_as_the_formula_says(eps):
    """t_n = g0/u + (L_f/u) Σ ε^-j, to all digits while they slow down by eight orders of magnitude, and in turns."""
    scene = gr.Scene([1.0, 3.0], [0.1, 0.2], [0.3, 0.7], [1.5, 0.5], ring=True)
    n = int(-8.0 / math.log10(eps))
    log = run(scene, eps, max_events=n).contacts
    exact = 0.3 + np.r_[0.0, np.cumsum(eps ** -np.arange(1.0, n))]
    assert log["pair"].tolist() == [0, 1] * (n // 2) + [0] * (n % 2)
    assert np.abs(log["t_begin"] / exact - 1.0).max() < 2e-16 * (50 + n)
    if eps == 0.9:
        assert log["t_begin"][9] == pytest.approx(16.111747917132, abs=5e-13)


def crossings(x, v, end):
    """Times at which free points on a ring of length 1 pass each other, and ranks of the lower one then."""
    n, found = len(x), []
    for i in range(n):
        for j in range(n):
            if v[i] > v[j]:
                ahead = (x[j] - x[i]) % 1.0
                found += [(t, i, j) for t in (ahead + np.arange(end * (v[i] - v[j]) + 1.0)) / (v[i] - v[j]) if t < end]
    at, ranks = list(range(n)), []
    for _, i, j in sorted(found):
        ranks.append(at[i])
        assert at[j] == (at[i] + 1) % n
        at[i], at[j] = at[j], at[i]
    return np.array([t for t, _, _ in sorted(found)]), ranks


def test_equal_elastic_balls_on_a_ring_are_free_flights_sorted():
    """The order of the collisions is theirs; times, positions and velocities have thirteen digits."""
    rng = np.random.default_rng(8)
    x, v, end = np.sort(rng.uniform(0.0, 1.0, 12)), rng.normal(size=12), 40.0
    result = run(gr.Scene.from_positions([1.0] * 12, [0.0] * 12, x, v, length=1.0), t_end=end)
    times, ranks = crossings(x, v, end)
    assert len(ranks) > 2500
    assert result.contacts["pair"].tolist() == ranks
    assert np.abs(times - result.contacts["t_begin"]).max() < 1e-12
    far = np.sort(np.mod(x + v * end, 1.0)) - np.sort(np.mod(result.position[-1], 1.0))
    assert np.abs((far + 0.5) % 1.0 - 0.5).max() < 1e-13
    assert np.abs(np.sort(v) - np.sort(result.velocity[-1])).max() < 1e-15
    assert np.abs(result.gap.sum(axis=1) - result.gap[0].sum()).max() < 1e-14  # twelve gaps, 2 866 times rounded
    assert np.ptp(result.momentum()) < 1e-14
    assert (np.diff(result.position[-1]) > 0.0).all()
    assert result.position[-1, -1] - result.position[-1, 0] < 1.0


@pytest.mark.parametrize("ties", ["newton", "poisson", "reflect"])
def test_touching_balls_on_a_ring_collide_as_a_row_on_a_line_does(ties):
    """Wherever the seam is: a ball hits a row of four, and some of them come round and hit again."""
    gap, velocity = [1.0, 0.0, 0.0, 0.0, 1.5], [1.0, 0.0, 0.0, 0.0, 0.0]
    for eps in (1.0, 0.6):
        scene = gr.Scene([1.0, 2.0, 1.0, 1.5, 1.0], [0.1] * 5, gap, velocity, ring=True)
        line = run(gr.Scene(scene.mass, scene.radius, gap[:4], velocity), eps, ties=ties, t_end=1.1)
        ahead = run(scene, eps, ties=ties, max_events=60)
        for k in range(5):
            other = run(turned(scene, k), eps, ties=ties, max_events=60)
            first = other.contacts[: len(line.contacts)]
            assert sorted(((first["pair"] + k) % 5).tolist()) == line.contacts["pair"].tolist()
            assert np.abs(np.sort(first["impulse"]) - np.sort(line.contacts["impulse"])).max() < 1e-14
            assert ((other.contacts["pair"][4:20] + k) % 5).tolist() == ahead.contacts["pair"][4:20].tolist()
            assert np.ptp(other.momentum()) < 1e-13
            assert loss(other) == pytest.approx(loss(ahead), rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_on_a_ring_every_hit_of_the_twin_is_found(seed):
    scene, eps = ring(seed), [0.8, 0.95, 1.0][seed % 3]
    follows_the_twin(scene, eps, run(scene, eps, max_events=16), 16)


def test_balls_on_a_ring_slow_down_as_far_as_numbers_go():
    scene = gr.Scene([1.0, 1.0], [0.1, 0.1], [0.5, 0.5], [0.5, -0.5], ring=True)
    result = run(scene, 0.05, max_events=400)
    assert result.time[-1] > 1e300
    assert result.status in (gr.Status.quiet, gr.Status.max_events)


@pytest.mark.parametrize(("seed", "n", "eps"), [(0, 3, 0.5), (2, 4, 0.5)])
def test_balls_on_a_ring_cool_without_end(seed, n, eps):
    """What rounding left while they were fast stops no slow collision; the twin has 60 digits."""
    scene = ring(seed, n)
    log = run(scene, eps, max_events=60).contacts
    with mp.workdps(60):
        rows = hard_twin.events(scene, eps, 1e99, 60)
    exact = np.array([float(time) for time, _, _ in rows])
    moved = response(lambda one: run(one, eps, max_events=60).contacts["t_begin"], scene)
    assert log["pair"].tolist() == [pair for _, pair, _ in rows]
    assert (np.abs(log["t_begin"] / exact - 1.0) < 2e-15 * (1.0 + np.maximum.accumulate(moved / exact))).all()
    late = run(scene, eps, max_events=300)
    assert late.status is gr.Status.max_events
    assert late.gap[-1].sum() == pytest.approx(scene.gap.sum(), rel=1e-12)


RINGS = [(2, 0.8, {}), (5, 0.02, {}), (300, 0.3, {}), (9, 0.6, {"collapse": "merge"}), (40, 0.0, {"ties": "random"}),
         (30, 0.8, {"tc": 0.05, "ties": "right"}), (150, 1.0, {"elastic_below": 0.1})]


@pytest.mark.rotating
@QUEUES
@pytest.mark.parametrize(("n", "eps", "options"), RINGS)
def test_on_a_ring_every_queue_and_a_run_that_goes_on_are_the_same(n, eps, options, engine, tmp_path):
    asked = {"t_end": 40.0, "max_events": 2500, "samples": 5}
    whole, rest = goes_on(ring(n, n), eps, engine, tmp_path, asked, **options)
    assert rest.message.partition(" after")[0] == whole.message.partition(" after")[0]


@pytest.mark.rotating
@pytest.mark.parametrize(("n", "eps", "options"), [(5, 0.02, {}), *RINGS[2:4], (40, 0.0, {}), *RINGS[5:]])
def test_where_the_numbers_of_a_ring_begin_does_not_matter(n, eps, options):
    """Nor does a common velocity: the same collisions, a verdict on the same balls."""
    scene = ring(n, n)
    asked = options | {"t_end": 3.0, "max_events": 2500, "ties": "left", "watch": gr.LinearDashpot(1e5, 0.0)}
    one = run(scene, eps, **asked)
    last = int(one.contacts["pair"][-1])
    early = one.status in (gr.Status.collapse, gr.Status.bounded)
    for k in (last, (last + 1) % n):
        other = run(turned(scene, k), eps, **asked)
        assert other.status is one.status
        log, more = one.contacts[:300], other.contacts[:300]
        assert len(one.contacts) == len(other.contacts) or early
        assert ((more["pair"] + k) % n).tolist() == log["pair"].tolist()
        assert np.abs(more["t_begin"] - log["t_begin"]).max() < 1e-9
        assert other.stats["watched"] == one.stats["watched"] or early
        if early:
            assert tuple((c + k) % n for c in other.stats["pairs"]) == one.stats["pairs"]
    moving = run(scene.replace(velocity=scene.velocity + 1024.0), eps, **asked)
    assert moving.contacts["pair"][:300].tolist() == one.contacts["pair"][:300].tolist()
    assert np.abs(moving.contacts["t_begin"][:300] - one.contacts["t_begin"][:300]).max() < 1e-9


def test_balls_that_stick_end_as_one_row_on_a_ring():
    scene = ring(3, 12)
    result = run(scene, 0.0, t_end=1e3)
    speed = scene.momentum() / scene.mass.sum()
    assert len(result.contacts) == 11
    assert np.abs(result.velocity[-1] - speed).max() < 1e-15
    assert np.count_nonzero(result.gap[-1]) == 1
    assert result.gap[-1].sum() == pytest.approx(scene.gap.sum(), rel=1e-15)


def test_haffs_law_on_the_ring_it_is_stated_for():
    """T = T0/(1 + t/τ)², 1/τ = n (1 - ε²) √(T0/(π m)), of nearly elastic points whose speeds are Maxwellian."""
    rng, n, eps = np.random.default_rng(4), 200, 0.998
    velocity = rng.normal(size=n)
    velocity -= velocity.mean()
    velocity /= velocity.std()
    scene = gr.Scene(np.ones(n), np.zeros(n), rng.exponential(size=n), velocity, ring=True)
    tau = scene.gap.sum() / n / ((1.0 - eps * eps) / math.sqrt(math.pi))
    result = run(scene, eps, t_end=0.5 * tau, samples=6, log=False)
    expected = result.energy()[0] / (1.0 + result.time / tau) ** 2
    assert np.abs(result.energy() / expected - 1.0).max() < 0.03


@pytest.mark.parametrize(
    ("changes", "options", "words"),
    [
        ({"external_force": [1.0, 0.0, 0.0]}, {}, "`external_force` must be None for hard spheres on a ring"),
        ({"gap": [0.0, 0.0, 0.0]}, {}, "`gap` must have a positive entry on a ring"),
        ({}, {"t_end": None}, "A run on a ring does not end by itself"),
    ],
)
def test_what_hard_spheres_cannot_do_on_a_ring_is_a_sentence(changes, options, words):
    with pytest.raises(ValueError, match=words):
        run(ring(1, 3).replace(**changes), **{"t_end": 1.0} | options)

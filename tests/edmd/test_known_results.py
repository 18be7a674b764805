"""Hard spheres against results known in closed form; the numbers are in reference/catalogue_edmd.json."""

import itertools
import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from granular import edmd, until
from granular.laws.rules import ConstantRestitution, TabulatedRestitution
from granular.run.trajectory import Status
from granular.scene import Scene

CATALOGUE = json.loads((Path(__file__).parents[1] / "reference" / "catalogue_edmd.json").read_text())
NUMBERS = {name: row["numbers"] for name, row in CATALOGUE["rows"].items()}


def stack(masses, gap=1e-9, speed=1.0):
    """Balls close together that all fall with `speed` on a floor, without gravity."""
    n = len(masses)
    return Scene([math.inf, *masses], [0.0] * (n + 1), [1.0] + [gap] * (n - 1), [0.0] + [-speed] * n)


def chain(masses):
    """Balls at rest in a row, the first of them moving at unit speed."""
    n = len(masses)
    return Scene(masses, [0.0] * n, [1.0] * (n - 1), [1.0] + [0.0] * (n - 1))


def final(scene, eps, **options):
    return edmd.simulate(scene, ConstantRestitution(eps), **options)


def top(scene, eps):
    return final(scene, eps).velocity[-1, -1]


@pytest.mark.parametrize(("key", "mu"), [("mu=1/3", 1 / 3), ("mu=0.1", 0.1), ("mu=0.001", 0.001)])
def test_a1_two_balls(key, mu) -> None:
    run = final(stack([1.0, mu]), 1.0)
    assert run.velocity[-1, 2] == pytest.approx(NUMBERS["A1"][key], rel=1e-12)
    assert run.velocity[-1, 1] == pytest.approx((1 - 3 * mu) / (1 + mu), abs=1e-12)


@pytest.mark.parametrize(
    ("key", "n", "mu", "eps"),
    [
        ("N3_mu.1_eps1", 3, 0.1, 1.0),
        ("N5_mu.1_eps.9", 5, 0.1, 0.9),
        ("N7_mu1/3_eps.7", 7, 1 / 3, 0.7),
        ("N5_mu.9_eps.7_edmd", 5, 0.9, 0.7),
    ],
)
def test_a2_stacks(key, n, mu, eps) -> None:
    assert top(stack([mu**k for k in range(n)]), eps) == pytest.approx(NUMBERS["A2"][key], rel=1e-12)


@pytest.mark.parametrize(("key", "n"), [("N3_mu1e-6", 3), ("N8_mu1e-6", 8)])
def test_a3_light_stacks(key, n) -> None:
    v = top(stack([1e-6**k for k in range(n)]), 1.0)
    assert v == pytest.approx(2**n / (1 + 1e-6) ** (n - 1) - 1, rel=1e-12)
    assert v == pytest.approx(NUMBERS["A3"][key], rel=1e-12)


@pytest.mark.parametrize(("key", "n", "ratio"), [("N3_R100", 3, 100), ("N4_R1000", 4, 1000)])
def test_a5_best_intermediate_masses(key, n, ratio) -> None:
    masses = [ratio ** (-k / (n - 1)) for k in range(n)]
    best = top(stack(masses), 1.0)
    assert best == pytest.approx(NUMBERS["A5"][key], rel=1e-12)
    for factor in (0.98, 1.02):
        assert top(stack([masses[0], masses[1] * factor, *masses[2:]]), 1.0) < best


def test_a6_tapered_chain() -> None:
    def amplified(n, eps):
        return top(chain([100 ** (-k / (n - 1)) for k in range(n)]), eps)

    assert amplified(5, 1.0) == pytest.approx(NUMBERS["A6"]["N5_R100"], rel=1e-12)
    by_collisions = {n: amplified(n + 1, 0.9) for n in range(1, 12)}
    best = max(by_collisions, key=by_collisions.__getitem__)
    assert best == NUMBERS["A6"]["eps.9_best_n"]
    assert by_collisions[best] == pytest.approx(NUMBERS["A6"]["eps.9_best_v"], rel=1e-12)


@pytest.mark.parametrize(("key", "eps"), [("eps1", 1.0), ("eps.9", 0.9), ("eps.7", 0.7)])
def test_a7_the_papers_scene(key, eps) -> None:
    scene = Scene([math.inf, 1.0, 1e-3], [0.0, 0.1, 0.01], [0.5, 1e-4], [0.0] * 3, gravity=9.81)
    run = final(scene, eps, max_events=2)
    assert run.contacts["pair"].tolist() == [0, 1]
    assert run.contacts["v_out"][1][::-1] == pytest.approx(NUMBERS["A7"][key], rel=1e-11)
    if eps == 0.7:
        assert run.contacts["t_begin"][1] == pytest.approx(0.3192942093, abs=1e-10)
        again = final(scene, eps, until=until.contact(0, 2))
        assert again.status is Status.until
        assert again.count(1) == 1
        v = again.of(1)["v_out"][0]
        assert v[1] - v[0] == pytest.approx(3.7272, abs=5e-5)


@pytest.mark.parametrize(("n", "key"), [(20, "N20_desc"), (50, "N50_seed7")])
def test_d6_elastic_balls_sort_their_velocities(n, key) -> None:
    v = np.arange(float(n))[::-1] if key == "N20_desc" else np.random.default_rng(7).normal(size=n)
    inversions = sum(a > b for a, b in itertools.combinations(v.tolist(), 2))
    gap = np.random.default_rng(3).uniform(0.5, 1.5, n - 1)
    run = final(Scene(np.ones(n), np.zeros(n), gap, v), 1.0)
    assert run.status is Status.quiet
    assert len(run.contacts) == inversions
    if key == "N20_desc":
        assert inversions == NUMBERS["D6"][key]
    np.testing.assert_allclose(run.velocity[-1], np.sort(v), rtol=0, atol=1e-14)


@pytest.mark.rotating
@pytest.mark.parametrize("masses", [(1, 1, 1), (3, 1, 3), (10, 1, 10), (1, 5, 2), (100, 1, 50)])
def test_d7_most_collisions_of_three_balls(masses) -> None:
    m1, m2, m3 = masses
    bound = math.ceil(math.pi / math.atan(math.sqrt(m2 * (m1 + m2 + m3) / (m1 * m3))))
    assert bound == NUMBERS["D7"].get(",".join(map(str, masses)), bound)
    random = np.random.default_rng(1)
    counts = []
    for _ in range(300):
        gap, middle = random.uniform(0.01, 1.0, 2), random.uniform(-1.0, 1.0)
        counts.append(len(final(Scene(masses, [0.0] * 3, gap, [1.0, middle, -1.0]), 1.0).contacts))
    assert max(counts) == bound


@pytest.mark.rotating
@pytest.mark.parametrize("power", range(6))
def test_a_wall_a_light_and_a_heavy_ball_count_digits_of_pi(power) -> None:
    scene = Scene([math.inf, 1.0, 100.0**power], [0.0] * 3, [1.0, 1.0], [0.0, 0.0, -1.0])
    run = final(scene, 1.0, log=False, engine="sorted")
    assert run.status is Status.quiet
    assert run.stats["events"] == NUMBERS["WSH"]["counts"][power]


@pytest.mark.parametrize(("key", "eps"), [(".5", 0.5), (".9", 0.9), (".99", 0.99)])
def test_d8_a_bouncing_ball_comes_to_rest(key, eps) -> None:
    run = final(Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=9.81), eps)
    assert run.status is Status.collapse
    assert run.stats["verdict"] == "exact"
    assert run.time[-1] == pytest.approx(NUMBERS["D8"][key], rel=2e-14)
    assert run.gap[-1, 0] == 0.0
    assert run.velocity[-1, 1] == 0.0


@pytest.mark.parametrize(
    ("key", "eps", "tc"), [("(.5,1e-3)", 0.5, 1e-3), ("(.9,1e-3)", 0.9, 1e-3), ("(.9,1e-6)", 0.9, 1e-6)]
)
def test_d8b_the_tc_model_bounces_for_ever(key, eps, tc) -> None:
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=9.81)
    count = NUMBERS["D8b"][key]
    run = final(scene, eps, tc=tc, max_events=count + 50)
    assert run.status is Status.max_events
    speed = -run.contacts["v_in"][:, 1]
    dissipative = run.contacts["v_out"][:, 1] < 0.5 * (1 + eps) * speed
    assert dissipative.tolist() == [True] * count + [False] * 50
    v = math.sqrt(2 * 9.81) * eps**count
    assert run.contacts["v_out"][-1, 1] == pytest.approx(v, rel=1e-10)


@pytest.mark.parametrize(("key", "n", "eps"), [("N5_.9", 5, 0.9), ("N10_.9", 10, 0.9)])
def test_d9b_a_column_loses_its_bounce(key, n, eps) -> None:
    gap = np.random.default_rng(2).uniform(0.5, 1.5, n)
    run = final(Scene([math.inf] + [1.0] * n, np.zeros(n + 1), gap, [0.0] + [-1.0] * n), eps)
    assert len(run.contacts) == n * n
    assert run.velocity[-1, 1:].mean() == pytest.approx(NUMBERS["D9b"][key], rel=1e-12)


@pytest.mark.parametrize(("key", "q"), [("q.05", 0.05), ("q.1", 0.1)])
def test_f3_tapered_chain_grows_by_a_factor_per_bead(key, q) -> None:
    run = final(chain([(1 - q) ** (3 * k) for k in range(40)]), 1.0, max_events=39)
    peak = run.contacts["v_out"][:, 1]
    np.testing.assert_allclose(peak[1:] / peak[:-1], NUMBERS["F3"][key][0], rtol=1e-12)


def exact(scene, eps, events):
    """Run a scene without gravity in exact fractions, looking at every pair at every event: slow, obviously right."""
    m = [None if math.isinf(x) else Fraction(x) for x in scene.mass.tolist()]
    gap, v = [Fraction(x) for x in scene.gap.tolist()], [Fraction(x) for x in scene.velocity.tolist()]
    e, t, log = Fraction(eps), Fraction(0), []
    for _ in range(events):
        times = [(gap[c] / (v[c] - v[c + 1]), c) for c in range(len(gap)) if v[c] > v[c + 1]]
        if not times:
            break
        dt, c = min(times)
        t += dt
        gap = [d + dt * (v[k + 1] - v[k]) for k, d in enumerate(gap)]
        w = v[c + 1] - v[c]
        a, b = m[c], m[c + 1]
        low = Fraction(0) if a is None else Fraction(1) if b is None else b / (a + b)
        v[c] += low * (1 + e) * w
        v[c + 1] -= (1 - low) * (1 + e) * w
        log.append((c, t))
    return log, v, gap


@pytest.mark.parametrize("seed", range(12))
def test_the_exact_twin_agrees(seed) -> None:
    random = np.random.default_rng(seed)
    n, eps = int(random.integers(2, 7)), float(random.choice([1.0, 0.9, 0.75]))
    mass = random.integers(1, 9, n).astype(float)
    if seed % 3 == 0:
        mass[0] = math.inf
    scene = Scene(mass, np.zeros(n), random.integers(1, 64, n - 1) / 32, random.integers(-16, 16, n) / 8)
    log, v, gap = exact(scene, eps, 25)
    run = final(scene, eps, max_events=25)
    assert run.contacts["pair"].tolist() == [c for c, _ in log]
    np.testing.assert_allclose(run.contacts["t_begin"], [float(t) for _, t in log], rtol=1e-11)
    np.testing.assert_allclose(run.velocity[-1], [float(x) for x in v], rtol=0, atol=1e-11)
    if log:
        t = float(log[-1][1])
        np.testing.assert_allclose(run.gap[-1], [float(d) for d in gap], rtol=1e-10, atol=1e-11 * max(t, 1.0))


def test_rows_at_times_are_right_continuous() -> None:
    scene = Scene([1.0, 1.0], [0.0, 0.0], [1.0], [1.0, 0.0])
    run = edmd.simulate(scene, ConstantRestitution(1.0), t_end=2.0, samples=[0.0, 0.5, 1.0, 1.5])
    assert run.status is Status.time
    assert run.time.tolist() == [0.0, 0.5, 1.0, 1.5]
    assert run.velocity.tolist() == [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]
    assert run.gap[:, 0].tolist() == [1.0, 0.5, 0.0, 0.5]
    assert run.position.tolist() == [[0.0, 1.0], [0.5, 1.0], [1.0, 1.0], [1.0, 1.5]]
    assert edmd.simulate(scene, ConstantRestitution(1.0), t_end=2.0, samples=5).time.tolist() == [0, 0.5, 1, 1.5, 2]
    short = edmd.simulate(scene, ConstantRestitution(1.0), until=until.contact(0), samples=[0.25, 3.0])
    assert short.time.tolist() == [0.25, 1.0]


def test_a_run_that_ends_otherwise_than_at_its_end_time_keeps_its_end() -> None:
    """Also when it ends after the last sample."""
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, -1.0])
    rule, times = ConstantRestitution(1.0), [0.25, 0.5]
    for options, end in (({"until": until.contact(0)}, 1.0), ({}, 1.0), ({"max_events": 1, "t_end": 3.0}, None)):
        run = edmd.simulate(scene, rule, samples=times, **options)
        assert run.time.tolist() == ([*times, end] if end else times)
    assert edmd.simulate(scene, rule, samples=times, t_end=3.0).time.tolist() == times
    assert edmd.simulate(scene, rule, samples=[0.25, 1.0], until=until.contact(0)).time.tolist() == [0.25, 1.0]
    part = edmd.simulate(scene, rule, t_end=0.1)
    assert edmd.resume(part, samples=times, until=until.contact(0)).time.tolist() == [*times, 1.0]


def test_separated_stops_after_the_last_push() -> None:
    run = edmd.simulate(stack([1.0, 0.1]), ConstantRestitution(1.0), until=until.separated())
    assert run.status is Status.until
    assert run.contacts["pair"].tolist() == [0, 1]
    never = final(Scene([1.0, 1.0], [0, 0], [1.0], [0.0, 1.0]), 1.0, until=until.separated())
    assert never.status is Status.quiet


def test_until_contact_leaves_the_contact_out() -> None:
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=2.0)
    run = edmd.simulate(scene, ConstantRestitution(0.5), until=until.contact(0, 3))
    assert run.status is Status.until
    assert run.count(0) == 2
    assert run.time[-1] == pytest.approx(1 + 1 + 0.5, rel=1e-15)
    assert run.velocity[-1, 1] == pytest.approx(-0.5, rel=1e-14)
    assert run.gap[-1, 0] == pytest.approx(0.0, abs=1e-15)
    ahead = edmd.simulate(scene, ConstantRestitution(0.5), until=until.contact(0), t_end=0.5)
    assert ahead.status is Status.time


def test_the_log_balances_momentum_and_has_no_duration() -> None:
    run = final(stack([1.0, 0.5, 0.25], gap=0.1), 0.9)
    log, mass = run.contacts, run.scene.mass
    assert (log["t_begin"] == log["t_end"]).all()
    assert not log["duration"].any()
    assert not log["xi_max"].any()
    assert np.isnan(log["force_max"]).all()
    upper = mass[log["pair"] + 1] * (log["v_out"][:, 1] - log["v_in"][:, 1])
    np.testing.assert_allclose(log["impulse"], upper, rtol=1e-13)
    assert final(stack([1.0, 0.5]), 0.9, log=False).contacts.size == 0


def test_callbacks_see_every_collision_and_their_errors_pass() -> None:
    scene, seen = stack([1.0, 0.5, 0.25], gap=0.1), []
    run = final(scene, 0.9, on_event=lambda row: seen.append((int(row["pair"]), float(row["t_begin"]))), log=False)
    assert len(seen) == run.stats["events"]
    assert seen == list(zip(*(final(scene, 0.9).contacts[k].tolist() for k in ("pair", "t_begin")), strict=True))

    def fail(row):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        final(scene, 0.9, on_event=fail)
    reports = []
    box = Scene([math.inf, 1.0, math.inf], [0.0] * 3, [1.0, 1.0], [0.0, 1.0, 0.0])
    final(box, 1.0, max_events=20_000, log=False, on_progress=lambda *so_far: reports.append(so_far))
    assert 3 <= len(reports) <= 12  # also while it is not known how long a collision takes
    assert reports == sorted(reports)


def test_a_callable_and_a_table_of_a_constant_give_the_bits_of_the_constant() -> None:
    scene = stack([1.0, 0.7, 0.4, 0.2], gap=0.01)
    log = final(scene, 0.75).contacts.tobytes()
    assert edmd.simulate(scene, lambda speed, pair: 0.75).contacts.tobytes() == log
    assert edmd.simulate(scene, TabulatedRestitution([0.0, 9.0], [0.75, 0.75])).contacts.tobytes() == log
    assert edmd.simulate(scene, [ConstantRestitution(0.75)] * 4).contacts.tobytes() == log


@pytest.mark.parametrize(("eps", "end"), [(1e-6, 525.8736796815914), (1e-12, None), (1e-100, None)])
def test_rates_far_below_the_velocities_are_not_lost(eps, end) -> None:
    """Two pairs collide in turn forever, their rates shrinking by ε each time; their velocities are equal soon."""
    mass = [0.3642479594038528, 7.436239814034007e-07, 0.03820219111308472, 0.5509859578714925, 326221605.9008801]
    v = [-0.24879696929334982, 0.984756275824729, -0.5057857886655219, -0.9725729003002135, -0.8388367801340211]
    scene = Scene(mass, [0.1] * 5, [1.0, 1e3, 1e-300, 1e-16], v)
    run = final(scene, eps)
    assert run.status is Status.collapse
    assert run.stats["verdict"] == "proved"
    assert run.stats["pairs"] == (1, 2)
    log, *_ = exact(scene, eps, 18)
    assert run.contacts["pair"].tolist()[:18] == [c for c, _ in log]
    assert run.time[-1] == pytest.approx(end or float(log[-1][1]), rel=1e-9)

"""Inelastic collapse: recognised where it is, not claimed where it is not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import granular as gr
from granular import edmd
from granular.cases.scenes import column as scene_column, newtons_cradle
from granular.edmd import collapse as collapses
from granular.run.trajectory import Status
from granular.run.until import separated
from granular.scene import Scene
from tests.helpers.collapsing import column, run


def cluster(n, mass=None):
    """Balls that rush together from both sides."""
    return Scene(mass or [1.0] * n, [0.0] * n, [1.0] * (n - 1), np.linspace(1.0, -1.0, n))


@pytest.mark.parametrize(("eps", "collisions"), [(0.0719, 89), (0.0722, 45), (0.1, 6)])
def test_three_balls_above_the_threshold_part_after_finitely_many(eps, collisions) -> None:
    end = run(cluster(3), eps)
    assert end.status is Status.quiet
    assert end.stats["events"] == collisions


def test_a_cradle_with_gaps_just_above_the_threshold_takes_89_collisions() -> None:
    end = run(newtons_cradle(n=3, gap=1.0), 0.0719)
    assert end.status is Status.quiet
    assert end.stats["events"] == len(end.contacts) == 89
    assert "2 relative velocities fell below the rounding error, so collisions" in end.message


def test_just_above_the_threshold_nothing_is_claimed_but_a_bound() -> None:
    end = run(cluster(3), 0.0718)  # 7 - 4 √3 = 0.071797
    assert end.status is Status.bounded
    assert end.stats["verdict"] == "bounded"
    assert end.stats["bound"] < 1e-59


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("n", "eps", "kind"),
    [(4, 0.05, "proved"), (5, 0.1, "proved"), (6, 0.3, "bounded"), (8, 0.1, "proved"), (20, 0.3, "bounded")],
)
def test_larger_clusters_collapse_in_a_part(n, eps, kind) -> None:
    gap = np.random.default_rng(n).uniform(0.5, 1.5, n - 1)
    end = run(cluster(n).replace(gap=gap), eps)
    assert end.status is (Status.collapse if kind == "proved" else Status.bounded)
    assert end.stats["verdict"] == kind
    assert end.stats["bound"] < 1e-50


@pytest.mark.parametrize("n", [3, 10, 30, 100, 1000])
@pytest.mark.parametrize("eps", [0.9, 0.5])
def test_columns_collapse_on_the_floor(n, eps) -> None:
    end = run(column(n), eps)
    assert end.status is Status.collapse
    assert end.stats["pairs"][0] == 0
    assert (end.gap[-1] >= 0.0).all()
    assert end.stats["events"] < 5000


def test_a_restitution_of_speed_that_tends_to_one_collapses_within_a_bound() -> None:
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=9.81)
    end = edmd.simulate(scene, lambda v, pair: 1.0 / (1.0 + 0.05 * v**0.2))
    assert end.status is Status.bounded
    assert end.stats["verdict"] == "bounded"
    assert end.stats["bound"] < 1e-9


@pytest.mark.rotating
@pytest.mark.parametrize("gravity", [0.0, 1.0])
def test_elastic_scenes_never_look_suspicious(gravity) -> None:
    random = np.random.default_rng(4)
    scene = Scene([math.inf] + [1.0] * 20, np.zeros(21), random.uniform(0, 1e-3, 20), random.normal(size=21), gravity)
    end = run(scene, 1.0, max_events=20_000)
    assert end.stats["zooms"] == 0
    touching = scene.replace(gap=np.zeros(20))
    assert run(touching, 1.0, max_events=20_000).stats["zooms"] == 0


def test_a_cooling_gas_that_does_not_collapse_goes_on() -> None:
    random = np.random.default_rng(6)
    scene = Scene(np.ones(50), np.zeros(50), random.uniform(0.5, 1.5, 49), random.normal(size=50))
    end = run(scene, 0.99)
    assert end.status is Status.quiet
    assert end.stats["zooms"] == 0


@pytest.mark.rotating
def test_a_gas_that_slows_down_without_end_says_so() -> None:
    random = np.random.default_rng(3)
    n = 100
    scene = Scene([math.inf] + [1.0] * n + [math.inf], np.zeros(n + 2), random.uniform(0.5, 1.5, n + 1),
                  [0.0, *random.normal(size=n), 0.0])
    end = run(scene, 0.9, max_events=30_000, log=False)
    assert end.status is Status.max_events
    assert "the balls cluster and slow down, perhaps forever; use collapse='merge', tc= or" in end.message


@pytest.mark.parametrize("engine", ["sorted", "compiled"])
def test_a_gas_that_merely_cools_is_not_said_to_cluster(engine) -> None:
    if engine == "compiled":
        pytest.importorskip("numba")
    random = np.random.default_rng(1)
    scene = Scene([math.inf] + [1.0] * 50 + [math.inf], np.zeros(52), random.uniform(0.5, 1.5, 51),
                  [0.0, *random.normal(size=50), 0.0])
    end = run(scene, 0.999, max_events=20_000, log=False, engine=engine)
    assert end.status is Status.max_events
    assert end.message.endswith("after 20000 collisions; raise max_events=, or give t_end= or until=")


def test_forced_closer_looks_change_nothing(monkeypatch) -> None:
    """A zoom is the same physics: looked at all the time, a gas comes out the same except for rounding."""
    random = np.random.default_rng(8)
    n = 30
    gap, velocity = random.uniform(0.5, 1.5, n), random.normal(size=n + 1)
    velocity[0] = 0.0
    scene = Scene([math.inf] + [1.0] * n, np.zeros(n + 1), gap, velocity)
    plain = run(scene, 0.97, t_end=6.0)
    monkeypatch.setattr("granular.edmd.sorted_queue.SUSPICIOUS_STREAK", 1)
    monkeypatch.setattr("granular.edmd.collision.suspicion_streak", lambda *_: 1)
    monkeypatch.setattr(collapses, "SLICE_REACH", 5)
    forced = run(scene, 0.97, t_end=6.0)
    assert forced.stats["zooms"] > 40
    assert forced.stats["zoomed"] > 20
    assert forced.contacts["pair"].tolist() == plain.contacts["pair"].tolist()
    np.testing.assert_allclose(forced.gap[-1], plain.gap[-1], atol=1e-10)
    np.testing.assert_allclose(forced.contacts["t_begin"], plain.contacts["t_begin"], atol=1e-10)
    assert (np.diff(forced.contacts["t_begin"]) >= 0.0).all()


def test_the_work_is_bounded_and_the_limit_is_exact() -> None:
    end = run(column(10), 0.9, max_events=100)
    assert end.status is Status.max_events
    assert end.stats["events"] == len(end.contacts) == 100
    assert "100 collisions" in end.message


def test_merging_brings_a_column_to_rest() -> None:
    end = run(column(10), 0.9, collapse="merge", merge_below=1e-3)
    assert end.status is Status.quiet
    assert not end.gap[-1].any()
    assert not end.velocity[-1].any()
    assert end.stats["merge_below"] == 1e-3
    assert end.stats["merged"] >= 10
    energy = run(column(10), 0.9, collapse="merge", t_end=20.0, samples=200).energy()
    assert (np.diff(energy) <= 1e-12).all()


@pytest.mark.rotating
@given(
    seed=st.integers(0, 10**6), n=st.integers(1, 12), floor=st.sampled_from([-0.5, 0.0, 0.3, 2.0]),
    gravity=st.sampled_from([0.0, 1.0]), eps=st.sampled_from([0.0, 0.3, 0.9]), below=st.sampled_from([1e-3, 0.1, 10.0]),
)
@settings(max_examples=100, deadline=None)
def test_merging_on_a_moving_floor(seed, n, floor, gravity, eps, below) -> None:
    """Seen from the floor it is a floor at rest: same collisions, and no energy gained."""
    random = np.random.default_rng(seed)
    mass = [math.inf, *np.exp(random.uniform(-2, 2, n))]
    gap, v = random.uniform(0.01, 1.0, n), random.integers(-64, 65, n + 1) / 64.0
    options = {"t_end": 4.0, "max_events": 2000, "samples": 9} | (
        {} if eps == 0.0 else {"collapse": "merge", "merge_below": below}
    )
    v[0] = 0.0
    still = run(Scene(mass, np.zeros(n + 1), gap, v, gravity), eps, **options)
    moved = run(Scene(mass, np.zeros(n + 1), gap, v + floor, gravity), eps, **options)
    assert (moved.gap >= 0.0).all()
    seen = moved.velocity - floor
    energy = (0.5 * seen[:, 1:] ** 2 + gravity * np.cumsum(moved.gap, axis=1)) @ moved.scene.mass[1:]
    assert (np.diff(energy) <= 1e-12 * energy[0] + 1e-13).all()
    if moved.status is not Status.max_events:
        assert (np.diff(moved.velocity[-1])[moved.gap[-1] == 0.0] >= 0.0).all()
    if len(still.contacts) < 60:
        assert moved.contacts["pair"].tolist() == still.contacts["pair"].tolist()
        assert moved.stats["merged"] == still.stats["merged"]
        np.testing.assert_allclose(seen[-1], still.velocity[-1], atol=1e-9)
        np.testing.assert_allclose(moved.gap[-1], still.gap[-1], atol=1e-9)


def test_the_tc_model_runs_on_through_a_collapse() -> None:
    end = run(column(20), 0.9, tc=1e-2, t_end=20.0)
    assert end.status is Status.time
    assert end.stats["zooms"] == 0


def test_elastic_below_a_speed_a_ball_bounces_for_ever() -> None:
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=9.81)
    end = run(scene, 0.5, elastic_below=0.1, max_events=200)
    assert end.status is Status.max_events
    v = end.contacts["v_out"][-1, 1]
    assert 0.05 < v < 0.1
    assert end.contacts["v_out"][50, 1] == pytest.approx(v, rel=1e-12)


def falling_block(n):
    """Touching balls except for small gaps, falling together on a floor."""
    return Scene([math.inf] + [1.0] * n, [0.0] * (n + 1), [1e-3] * n, [0.0] + [-1.0] * n)


@pytest.mark.rotating
@pytest.mark.parametrize(("eps", "last"), [(0.5, 4), (0.7, 8)])
def test_the_foot_of_a_falling_block_collapses_whatever_it_is_run_until(eps, last) -> None:
    ends = [run(falling_block(100), eps, until=until) for until in (None, separated())]
    assert {end.status for end in ends} == {Status.bounded}
    assert ends[0].contacts.tobytes() == ends[1].contacts.tobytes()
    assert ends[0].stats["pairs"] == (0, last)
    assert ends[0].stats["bound"] < 1e-50


@pytest.mark.rotating
def test_a_closer_look_without_a_decision_lasts_longer_the_next_time() -> None:
    pytest.importorskip("numba")
    end = run(falling_block(100), 0.8, until=separated(), log=False)
    assert end.status is Status.bounded
    assert end.stats["bound"] < 1e-15
    assert end.stats["engine"] == "compiled"  # though it began with closer looks, in the reference queue
    assert end.state["allowance"] == 80_000


@pytest.mark.rotating
def test_the_ready_made_column_gets_its_verdict() -> None:
    """Closer looks without end on some 30 balls at the floor, which the next ones hit ever again."""
    pytest.importorskip("numba")
    end = run(scene_column(n=100), 0.9, log=False, max_events=4_000_000)
    assert end.status is Status.bounded
    assert end.stats["verdict"] == "bounded"
    assert end.stats["bound"] < 1e-12
    assert end.stats["pairs"][0] == 0
    undecided = run(scene_column(n=100), 0.9, log=False, max_events=200_000)
    assert undecided.status is Status.max_events
    assert "unless hit from outside, no body of pairs wall–1 to " in undecided.message


@pytest.mark.rotating
@pytest.mark.parametrize("n", [10, 20, 50, 100])
def test_ready_made_columns_end_within_the_default_limits_as_what_they_are(n) -> None:
    pytest.importorskip("numba")
    end = run(scene_column(n=n), 0.9, log=False)
    if n < 50:
        assert end.status is Status.quiet
        return
    assert end.status is Status.bounded
    assert end.stats["bound"] < 1e-6
    assert end.stats["pairs"] == (0, 27)
    words = "inelastic collapse of pairs wall–1 to 27–28 at t = 0.0340116 s after 1000000 collisions: unless hit"
    assert words in end.message
    more = edmd.resume(end, log=False, max_events=3_000_000)  # the limit ended it, so it may go on
    assert more.status is Status.bounded
    assert more.stats["events"] == {50: 2_990_586, 100: 1_410_053}[n]


@pytest.mark.rotating
@pytest.mark.parametrize(("n", "collisions"), [(30, 62_750), (32, 269_265)])
def test_finite_sequences_of_a_column_are_followed_to_their_end(n, collisions) -> None:
    pytest.importorskip("numba")
    end = run(scene_column(n=n), 0.9, log=False)
    assert end.status is Status.quiet
    assert end.stats["events"] == collisions


@pytest.mark.parametrize(("eps", "collisions"), [(0.21, 60), (0.215, 34), (0.22, 28), (0.225, 22)])
@pytest.mark.parametrize("engine", ["sorted", "compiled"])
def test_a_closer_look_ends_where_all_balls_recede(eps, collisions, engine) -> None:
    """The run is to stop there, not to find out that the balls, which fall on the floor again, collide for ever."""
    case = gr.cases.make("ball-stack", n=4, mass_ratio=0.347, gap=0.0, height=0.881)
    end = edmd.simulate(case.scene, gr.ConstantRestitution(eps), until=gr.until.separated(), engine=engine)
    assert (end.status, len(end.contacts)) == (Status.until, collisions)
    assert (np.diff(end.velocity[-1]) > 0.0).all()

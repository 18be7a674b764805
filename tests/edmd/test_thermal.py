"""Hard spheres between thermal walls: against a twin of 30 digits, free flight, and what the walls must draw."""

import math

import numpy as np
import pytest

import granular as gr
from granular.scene.walls import Sine, Thermal
from tests.helpers.hard_runs import INF, QUEUES, follows_the_twin, goes_on, remainder, run


def heated(seed):
    """One to five balls beside one or two thermal walls, perhaps with gravity, forces, and walls that move or shake."""
    rng = np.random.default_rng(seed)
    n, (floor, ceiling) = int(rng.integers(1, 6)), [(1, 0), (0, 1), (1, 1)][int(rng.integers(3))]
    bodies = n + floor + ceiling
    ball = np.r_[[0.0] * floor, [1.0] * n, [0.0] * ceiling]
    mass = np.where(ball > 0.0, np.exp(rng.normal(size=bodies)), INF)
    force = rng.normal(size=bodies) * ball if rng.random() < 0.4 else None
    hot = [Thermal(float(np.exp(rng.normal())), seed + k) for k in range(2)]
    if floor and ceiling and rng.random() < 0.5:
        hot[seed % 2] = [None, Sine(0.05, 1.0, 0.3)][int(rng.integers(2))]
    velocity = rng.normal(size=bodies) * np.where(ball > 0.0, 1.0, 0.1)
    return gr.Scene(mass, 0.05 * ball, rng.uniform(0.5, 1.0, bodies - 1), velocity, float(rng.choice([0.0, 1.0, 9.81])),
                    external_force=force, floor=hot[0] if floor else None, ceiling=hot[1] if ceiling else None)


@pytest.mark.parametrize("seed", range(12))
def test_beside_thermal_walls_every_hit_of_the_twin_is_found(seed):
    scene, eps = heated(seed), [0.8, 0.9, 1.0][seed % 3]
    result = run(scene, eps, t_end=3.0, max_events=16)
    follows_the_twin(scene, eps, result, 16)
    assert remainder(result) < 1e-13


@QUEUES
@pytest.mark.parametrize("seed", range(6))
def test_beside_thermal_walls_every_queue_and_a_run_that_goes_on_are_the_same(seed, engine, tmp_path):
    asked = {"t_end": 30.0, "max_events": 2000, "samples": 7}
    whole, rest = goes_on(heated(seed), 0.7, engine, tmp_path, asked, collapse="merge")
    assert rest.stats["given"] == whole.stats["given"]


def gas(n, floor, ceiling, ratio=1.0, seed=1, gravity=0.0):
    """Points of masses 1, `ratio`, 1, … at a mean distance of 1 m between these walls."""
    rng = np.random.default_rng(seed)
    ends = [INF] * (floor is not None), [INF] * (ceiling is not None)
    mass, room = np.where(np.arange(n) % 2, ratio, 1.0), np.diff(np.sort(rng.uniform(0.0, n, n)), prepend=0.0)
    gap = room[len(ends[0]) == 0 :].tolist() + [n - room.sum()] * len(ends[1])
    velocity = np.r_[0.0 * np.array(ends[0] and [0.0]), rng.normal(size=n) / np.sqrt(mass), [0.0] * len(ends[1])]
    mass = np.r_[ends[0], mass, ends[1]]
    return gr.Scene(mass, np.zeros(len(mass)), gap, velocity, gravity, floor=floor, ceiling=ceiling)


@pytest.mark.rotating
@pytest.mark.parametrize("n", [1, 16])
def test_the_heat_flow_of_equal_masses_is_that_of_free_flight(n):
    """J = n (T1 - T2) / (√(πm/2) (T1^-½ + T2^-½)), whatever their number; the wall's force is n √(T1 T2)."""
    scene = gas(n, Thermal(2.0, 1), Thermal(1.0, 2))
    result = run(scene, t_end={1: 1.5e4, 16: 6e3}[n], samples=41, max_events=10**8, engine="auto")
    account, exact = result.account(), 1.0 / (math.sqrt(0.5 * math.pi) * (2.0**-0.5 + 1.0))
    assert exact == pytest.approx(0.4673899545102182, rel=1e-15)
    parts = np.diff(account["heat"] @ [0.5, -0.5]) / np.diff(result.time)
    error = parts.std(ddof=1) / math.sqrt(len(parts))
    assert error < 0.06 * exact
    assert abs(parts.mean() - exact) < 3.0 * error
    assert np.array(result.stats["given"]) / result.time[-1] == pytest.approx([2.0**0.5] * 2, rel=3.0 * error / exact)
    assert remainder(result) < 1e-14


@pytest.mark.rotating
def test_a_gas_above_a_thermal_floor_is_barometric():
    """Time means of equal elastic points: ⟨x_cm⟩ = T/(mg), ⟨½mv²⟩ = T/2."""
    result = run(gas(2, Thermal(2.0, 3), None, gravity=4.0), log=False, t_end=3.2e3, samples=1601)
    for value, exact in ((result.position[:, 1:], 0.5), (0.5 * result.velocity[:, 1:] ** 2, 1.0)):
        parts = value[1:].mean(axis=1).reshape(40, -1).mean(axis=1)
        error = parts.std(ddof=1) / math.sqrt(len(parts))
        assert error < 0.04 * exact
        assert abs(parts.mean() - exact) < 3.0 * error


@pytest.mark.rotating
def test_balls_may_collapse_between_thermal_walls_but_not_on_them():
    """The verdict never names a pair beside such a wall; merged balls go on forever."""
    scene, verdicts = gas(40, Thermal(2.0, 1), Thermal(1.0, 2)), []
    for eps in (0.3, 0.6):
        stopped = run(scene, eps, t_end=300.0)
        assert stopped.status is gr.Status.bounded
        verdicts.append(stopped.stats["pairs"])
        merged = run(scene, eps, t_end=5.0, collapse="merge", samples=20)
        assert merged.status is gr.Status.time
        assert remainder(merged) < 1e-13
    assert all(0 < first <= last < scene.n_pairs - 1 for first, last in verdicts)
    floor = gr.Scene([INF, 1.0], [0.0, 0.1], [0.0], [0.0, 0.0], 9.81, floor=Thermal(1.0))
    assert len(run(floor, 0.5, t_end=10.0).contacts) > 5


@pytest.mark.parametrize("ties", ["newton", "poisson", "reflect", "right", "random"])
def test_a_thermal_wall_is_no_part_of_a_touching_group(ties):
    """A row of touching balls falls onto it: the wall acts alone, the row as the tie rule says."""
    radius, velocity = [0.0] + [0.1] * 3 + [0.0], [0.0, -1.0, -1.0, -1.0, 0.0]
    scene = gr.Scene([INF, 1.0, 2.0, 3.0, INF], radius, [0.2, 0.0, 0.0, 0.5], velocity, 1.0, floor=Thermal(1.0, 5),
                     ceiling=Thermal(2.0, 6))
    result = run(scene, 0.9, t_end=20.0, ties=ties, samples=30)
    assert result.status is gr.Status.time
    assert remainder(result) < 1e-13
    for side, pair in ((0, 0), (1, 3)):
        hits = result.of(pair)
        wall, ball = (scene.floor, scene.ceiling)[side], (1, 3)[side]
        speeds = [wall.drawn(side, hit, scene.mass[ball]) for hit in range(len(hits))]
        away = hits["v_out"][:, 1 - side] * (1 - 2 * side)
        assert away == pytest.approx(speeds, abs=1e-12)


def test_a_hit_of_a_thermal_wall_is_watched_as_an_instant():
    result = run(gas(3, Thermal(1.0, 1), Thermal(1.0, 2)), t_end=20.0, watch=gr.LinearDashpot(1e6, 0.0))
    assert "none of" in result.message or result.stats["watched"] > 0


def test_what_a_thermal_wall_cannot_be_for_hard_spheres_is_a_sentence():
    scene = gr.Scene([INF, 1.0], [0.0, 0.1], [0.5], [0.0, 1.0], floor=Thermal(1e200))
    with pytest.raises(ValueError, match=r"The thermal speed √\(T/m\) must be in \[1e-75, 1e\+75\] m/s, got "
                                         r"temperature T = 1e\+200 J and mass\[1\] = 1\.0 kg\. Give T in J \(Boltzmann"
                                         r"'s constant times kelvin\), and m in kg\."):
        run(scene, t_end=1.0)
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run with a thermal wall does not "
                                         r"end by itself\. Give t_end=, until= or max_events=\."):
        run(scene.replace(floor=Thermal(1.0)))


# --- what random scenes have brought to light, on lines too


def test_balls_that_merge_do_not_pass_through_each_other():
    """The noise of balls that hit and merge many times was multiplied until it hid their approach."""
    rng, n = np.random.default_rng(9), 140
    mass, gap = np.exp(rng.normal(size=n)), rng.exponential(size=n + 1) * (rng.random(n + 1) < 0.6)
    scene = gr.Scene(np.r_[INF, mass, INF], np.zeros(n + 2), gap, np.r_[0.0, rng.normal(size=n), 0.0])
    result = run(scene, 0.7, collapse="merge", max_events=3000, t_end=8.0, log=False)
    assert result.stats["merged"] > 100
    assert result.gap[-1].sum() == pytest.approx(gap.sum(), rel=1e-12)


def test_a_closer_look_does_not_part_what_forces_press_together():
    """Two of these balls come to rest on each other in mid-air, and are hit while their neighbours are looked at."""
    scene = heated(7661)
    scene = scene.replace(gap=[*scene.gap[:2], 0.0, 0.0])
    for n in (13, 20, 100):
        assert remainder(run(scene, 0.3, ties="poisson", max_events=n, t_end=5.0)) < 1e-13

"""Hard spheres between thermal walls, on rings, as pendula: against a twin of 30 digits, closed forms, symmetries."""

import math

import hard_twin
import mpmath as mp
import numpy as np
import pytest
from condition import response
from fuzz import bounded

import granular as gr
from granular._kernels import have_numba
from granular.walls import Sine, Thermal

INF = math.inf
QUEUES = pytest.mark.parametrize("engine", [
    "sorted", pytest.param("compiled", marks=[pytest.mark.soak, pytest.mark.skipif(not have_numba(), reason="numba")])])
"""To compile what these scenes need takes half a minute for each kind."""


def run(scene, eps=1.0, **options):
    """A run with one coefficient of restitution, by the reference queue."""
    return gr.edmd.simulate(scene, gr.ConstantRestitution(eps), **{"engine": "sorted"} | options)


def remainder(result):
    """What the account leaves over, at most, in units of the energies that came, went, and are added up."""
    account, ball = result.account(), ~result.scene.is_wall
    rest = account["energy"] - account["work"].sum(axis=1) - account["heat"].sum(axis=1) + account["dissipated"]
    most = sum(np.abs(account[name]).max() for name in ("energy", "work", "heat", "dissipated"))
    moving = 0.5 * result.velocity[:, ball] ** 2 @ result.scene.mass[ball]  # by height it is paid back
    return np.abs(rest - rest[0]).max() / (most + moving.max())


def same(a, b):
    """Raise where two runs differ by a bit."""
    for name in ("time", "position", "velocity", "gap", "ledger"):
        one, other = getattr(a, name), getattr(b, name)
        assert (one is None) == (other is None)
        assert one is None or np.array_equal(one, other), name
    assert a.contacts.tobytes() == b.contacts.tobytes()
    assert a.message == b.message


def goes_on(scene, eps, engine, tmp_path, asked, **options):
    """A run, and the rest of it from a file of its first half; raise where they, or the queues, differ by a bit."""
    whole = run(scene, eps, **options, **asked)
    if engine != "sorted":
        same(whole, run(scene, eps, **options, **asked, engine=engine))
    run(scene, eps, **options, max_events=len(whole.contacts) // 2).save(tmp_path / "half.npz")
    half = gr.Trajectory.load(tmp_path / "half.npz")
    left = asked["max_events"] - len(half.contacts)
    rest = gr.edmd.resume(half, t_end=asked["t_end"], max_events=left, engine=engine)
    assert rest.contacts.tobytes() == whole.contacts[len(half.contacts) :].tobytes()
    for name in ("velocity", "gap", *["ledger"] * (whole.ledger is not None)):
        assert getattr(rest, name)[-1].tobytes() == getattr(whole, name)[-1].tobytes(), name
    return whole, rest


def follows_the_twin(scene, eps, result, most):
    """Raise where a run does not make the collisions of the twin, in its order, at its times and speeds."""
    with mp.workdps(30):
        late = 1e-6 * (result.status is gr.Status.max_events)
        rows = hard_twin.events(scene, eps, float(result.time[-1]) + late, most, float(result.time[0]))
    log = result.contacts
    assert [pair for _, pair, _ in rows] == log["pair"].tolist()
    time, speed = (np.array([float(row[k]) for row in rows]) for k in (0, 2))
    assert np.abs(time - log["t_begin"]).max(initial=0.0) < 1e-8
    assert np.abs(speed - (log["v_in"][:, 0] - log["v_in"][:, 1])).max(initial=0.0) < 1e-6


# --- thermal walls


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


def test_a_gas_above_a_thermal_floor_is_barometric():
    """Time means of equal elastic points: ⟨x_cm⟩ = T/(mg), ⟨½mv²⟩ = T/2."""
    result = run(gas(2, Thermal(2.0, 3), None, gravity=4.0), log=False, t_end=3.2e3, samples=1601)
    for value, exact in ((result.position[:, 1:], 0.5), (0.5 * result.velocity[:, 1:] ** 2, 1.0)):
        parts = value[1:].mean(axis=1).reshape(40, -1).mean(axis=1)
        error = parts.std(ddof=1) / math.sqrt(len(parts))
        assert error < 0.04 * exact
        assert abs(parts.mean() - exact) < 3.0 * error


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
    with pytest.raises(ValueError, match=r"temperature is 1e\+200.*use other units"):
        run(scene, t_end=1.0)
    with pytest.raises(ValueError, match="t_end is None: beside a thermal wall"):
        run(scene.replace(floor=Thermal(1.0)))


# --- pendula


def hanging(seed, walls=True):
    """Two to six pendula of unequal masses, perhaps between fixed walls, some at gaps of rest 0."""
    rng = np.random.default_rng(seed)
    floor, ceiling = (bool(x) for x in rng.random(2) < 0.4 * walls)
    n, omega = int(rng.integers(2 - floor, 7)), float(np.exp(rng.normal()))
    ball = np.r_[[0.0] * floor, [1.0] * n, [0.0] * ceiling]
    rest = rng.uniform(0.0, 0.2, len(ball) - 1) * (rng.random(len(ball) - 1) < 0.7)
    gap = np.exp(rng.uniform(-7.0, 0.0, len(rest)))
    if floor and ceiling:
        rest *= gap.sum() / (rest.sum() or 1.0)
        rest[0] += gap.sum() - rest.sum()
    mass = np.where(ball > 0.0, np.exp(rng.normal(size=len(ball))), INF)
    return gr.Scene(mass, 0.05 * ball, gap, rng.normal(size=len(ball)) * ball * omega, origin=float(rng.normal()),
                    pendulum=omega, rest_gap=rest)


def cradle(n, d, eps, periods=1.0, y=-1.0, **options):
    """Equal pendula at rest that touch or nearly do, but for the first, which is drawn aside."""
    gap = np.full(n - 1, d)
    gap[0] -= y
    scene = gr.Scene([1.0] * n, [0.1] * n, gap, [0.0] * n, origin=y, pendulum=1.0, rest_gap=[d] * (n - 1))
    return run(scene, eps, **{"t_end": 2.0 * math.pi * periods} | options)


def loss(result):
    """Share of the energy that is left."""
    return result.energy()[-1] / result.energy()[0]


@pytest.mark.parametrize("seed", range(10))
def test_of_pendula_every_hit_of_the_twin_is_found(seed):
    scene, eps = hanging(seed), [0.8, 0.9, 1.0][seed % 3]
    result = run(scene, eps, t_end=12.0 / scene.pendulum, max_events=14)
    follows_the_twin(scene, eps, result, 14)


@pytest.mark.parametrize("seed", [83, 200, 227])
def test_the_twin_steps_on_from_a_gap_that_opens_faster_than_it_can_fall_back(seed):
    """It divided by zero."""
    one = bounded.generate(seed)
    result = run(one.scene, 0.8, t_start=one.start, t_end=one.end, max_events=14)
    follows_the_twin(one.scene, 0.8, result, 14)


@QUEUES
@pytest.mark.parametrize("seed", range(6))
def test_of_pendula_every_queue_and_a_run_that_goes_on_are_the_same(seed, engine, tmp_path):
    scene, eps = hanging(seed), [0.7, 1.0][seed % 2]
    options = {"collapse": ["stop", "merge"][seed // 2 % 2], "ties": ["left", "random", "right"][seed // 2]}
    asked = {"t_end": 80.0 / scene.pendulum, "max_events": 1500, "samples": 7}
    goes_on(scene, eps, engine, tmp_path, asked, **options)


def test_a_cradle_of_five_after_one_period():
    """Computed by counted events in 30 digits."""
    narrow, touching = cradle(5, 1e-3, 0.95), cradle(5, 0.0, 0.95)
    assert len(narrow.contacts) == 8
    assert loss(narrow) == pytest.approx(0.678909767959, abs=1e-12)
    assert loss(touching) == pytest.approx(0.678908431195, abs=1e-12)


@pytest.mark.parametrize("n", [2, 5])
def test_in_the_end_pendula_swing_together(n):
    """E/E0 → 1/N; without gaps at rest to the last digits, merged ones after the first hits."""
    assert loss(cradle(n, 0.0, 0.7, 100.0)) == pytest.approx(1.0 / n, rel=1e-14)
    assert loss(cradle(n, 0.0, 0.0, 1.0)) == pytest.approx(1.0 / n, rel=1e-14)
    assert loss(cradle(n, 1e-3, 0.7, 100.0)) == pytest.approx(1.0 / n, rel=2e-5)


def test_an_infinite_sequence_of_pendula_has_an_end():
    """Three equal balls meet at ε below 7 - 4√3: their rates fall to nothing, and they go on with their gaps."""
    scene = gr.Scene([1.0] * 3, [0.1] * 3, [0.5, 0.5], [1.0, 0.0, -1.0], pendulum=1.0, rest_gap=[0.1, 0.1])
    result = run(scene, 0.05, t_end=7.0, samples=50)
    burst = result.contacts["t_begin"][:200]
    assert result.status is gr.Status.time
    assert len(burst) > 100
    assert np.ptp(burst) < 0.5
    assert (result.gap[-20:] > 0.0).any()


@pytest.mark.parametrize("seed", range(4))
def test_elastic_pendula_keep_their_energy_and_go_back_in_time(seed):
    scene = hanging([102, 103, 105, 107][seed])
    span = 6.0 / scene.pendulum
    there = run(scene, t_end=span, samples=20)
    energy = there.energy()
    assert len(there.contacts) > 5
    assert np.abs(energy / energy[0] - 1.0).max() < 5e-16 * (20 + len(there.contacts))
    ball = ~scene.is_wall
    middle = scene.replace(gap=there.gap[-1], velocity=-there.velocity[-1], origin=there.position[-1, 0])
    back = run(middle, t_end=span)
    assert len(back.contacts) == len(there.contacts)
    assert np.abs(back.position[-1] - scene.position).max() < 1e-9
    assert np.abs(back.velocity[-1] + scene.velocity)[ball].max() < 1e-9 * scene.pendulum


@pytest.mark.parametrize("seed", range(4))
def test_a_mirror_image_of_pendula_does_the_mirror_image(seed):
    scene = hanging(seed, walls=False)
    end = scene.displacement[-1]
    other = gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1], origin=-end,
                     pendulum=scene.pendulum, rest_gap=scene.rest_gap[::-1])
    a = run(scene, 0.9, t_end=9.0 / scene.pendulum, samples=30)
    b = run(other, 0.9, t_end=9.0 / scene.pendulum, samples=30, ties="right")
    assert len(a.contacts) == len(b.contacts)
    assert np.abs(a.gap - b.gap[:, ::-1]).max() < 1e-10
    assert np.abs(a.velocity + b.velocity[:, ::-1]).max() < 1e-10 * scene.pendulum


def test_between_walls_the_gaps_of_pendula_keep_their_sum():
    gap, rest, velocity = [0.3, 0.1, 0.2, 0.4], [0.1, 0.2, 0.3, 0.4], [0.0, 3.0, 0.0, -1.0, 0.0]
    scene = gr.Scene([INF, 1.0, 2.0, 1.5, INF], np.zeros(5), gap, velocity, pendulum=2.0, rest_gap=rest)
    result = run(scene, t_end=2000.0, samples=50, log=False)
    assert result.stats["events"] > 10_000
    assert np.abs(result.gap.sum(axis=1) - 1.0).max() < 1e-13
    assert np.abs(result.energy() / result.energy()[0] - 1.0).max() < 1e-12


@pytest.mark.parametrize("ties", ["newton", "poisson", "reflect"])
def test_touching_pendula_collide_as_a_row_on_a_line_does(ties):
    for eps in (1.0, 0.6):
        hung = cradle(4, 0.0, eps, 0.4, ties=ties)
        line = run(gr.Scene([1.0] * 4, [0.1] * 4, [0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]), eps, t_end=0.75, ties=ties)
        assert hung.contacts["pair"].tolist() == line.contacts["pair"].tolist()
        for name in ("v_in", "v_out", "impulse"):
            assert np.abs(hung.contacts[name] - line.contacts[name]).max() < 1e-15
        longer = cradle(4, 0.0, eps, 6.0, ties=ties)
        assert longer.status is gr.Status.time
        assert loss(longer) == pytest.approx(1.0, rel=1e-13) or eps < 1.0


def test_the_root_of_pendula_has_all_digits():
    """Against the smallest positive root in 50 digits of it, for gaps down to 1e-150 and rates of both signs."""
    rng = np.random.default_rng(5)
    with mp.workdps(200):
        for _ in range(200):
            gap = float(10.0 ** rng.uniform(*[(-150.0, 0.0), (-12.0, 1.0)][int(rng.integers(2))]))
            d = float(rng.choice([0.0, 10.0 ** rng.uniform(-6.0, 1.0)]))
            omega, rate = float(np.exp(rng.normal())), float(rng.normal())
            scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [gap], [0.0, rate], pendulum=omega, rest_gap=[d])
            log = run(scene, max_events=1, t_end=20.0 / omega).contacts
            x, u = mp.mpf(gap) - d, mp.mpf(rate) / omega
            far = mp.hypot(x, u)
            if far <= d:
                assert len(log) == 0
                continue
            turns = [mp.atan2(u, x) + sign * mp.acos(-d / far) for sign in (-1, 1)]
            exact = min((turn % (2 * mp.pi)) for turn in turns) / omega
            condition = 1 + abs((2 * mp.mpf(d) - gap) * gap) / (u * u - (2 * mp.mpf(d) - gap) * gap)
            assert abs(mp.mpf(float(log["t_begin"][0])) - exact) < 4e-15 * condition * exact


# --- rings


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


@QUEUES
@pytest.mark.parametrize(("n", "eps", "options"), RINGS)
def test_on_a_ring_every_queue_and_a_run_that_goes_on_are_the_same(n, eps, options, engine, tmp_path):
    asked = {"t_end": 40.0, "max_events": 2500, "samples": 5}
    whole, rest = goes_on(ring(n, n), eps, engine, tmp_path, asked, **options)
    assert rest.message.partition(" after")[0] == whole.message.partition(" after")[0]


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
        ({"external_force": [1.0, 0.0, 0.0]}, {}, "hard spheres on a ring take no external_force"),
        ({"gap": [0.0, 0.0, 0.0]}, {}, "on a ring there must be room"),
        ({}, {"t_end": None}, "on a ring a run never comes to an end"),
    ],
)
def test_what_hard_spheres_cannot_do_on_a_ring_is_a_sentence(changes, options, words):
    with pytest.raises(ValueError, match=words):
        run(ring(1, 3).replace(**changes), **{"t_end": 1.0} | options)


# --- what random scenes of all three kinds have brought to light, on lines too


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

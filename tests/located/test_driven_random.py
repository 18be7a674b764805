"""Random scenes with driven walls and forces, by located events: invariances and engines (reference: test_fuzz)."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import granular as gr
from granular._engine.kernels import _all_globals_read, fitted, kernel
from granular.md.located import run as located_run
from granular.md.located.records import BY_PIECES

LAWS = ("spring", "dashpot", "strong", "hertz", "viscoelastic", "tsuji")


def some_law(rng, k, damping):
    kind = LAWS[int(rng.integers(len(LAWS)))]
    return {
        "spring": gr.LinearDashpot(k, 0.0), "dashpot": gr.LinearDashpot(k, damping),
        "strong": gr.LinearDashpot(k, 3.0 * math.sqrt(k)), "hertz": gr.Hertz(10.0 * k),
        "viscoelastic": gr.ViscoelasticHertz(10.0 * k, 3.0 * damping), "tsuji": gr.TsujiHertz(10.0 * k, 0.4),
    }[kind]


def some_path(rng, start):
    kind = rng.integers(4)
    if kind < 2:
        return gr.walls.Sine(*map(float, (rng.uniform(0.005, 0.05), rng.uniform(0.5, 6.0), rng.uniform(0.0, 6.0))))
    breaks = start + np.linspace(-0.05, 1.0, int(rng.integers(3, 8)))
    if kind == 2:  # corners
        height = rng.uniform(-0.05, 0.05, len(breaks))
        return gr.walls.Piecewise(breaks, [np.diff(height) / np.diff(breaks), height[:-1]])
    interpolate = pytest.importorskip("scipy.interpolate")
    return gr.walls.Piecewise(interpolate.CubicSpline(breaks, rng.uniform(-0.05, 0.05, len(breaks))))


def some_scene(seed, *, gravity=None, forces=True):
    """A scene of 1 to 3 balls, one wall or two, one or both driven, with laws and a start."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    mass = np.exp(rng.uniform(-1.5, 1.5, n))
    both = n > 2 and rng.random() < 0.4
    upper = n > 2 and not both and rng.random() < 0.4
    mass[0] = mass[0] if upper else math.inf
    mass[-1] = math.inf if both or upper else mass[-1]
    wall, start = np.isinf(mass), float(rng.choice([0.0, 0.37, 12.0]))
    floor, ceiling = (some_path(rng, start) if wall[i] and rng.random() < 0.85 else None for i in (0, -1))
    force = np.where(wall, 0.0, rng.uniform(-3.0, 3.0, n)) if forces and rng.random() < 0.6 else None
    gap = np.where(rng.random(n - 1) < 0.2, 0.0, rng.uniform(-0.005, 0.05, n - 1))
    velocity = np.where(wall, rng.choice([0.0, 0.1]), rng.normal(size=n) * rng.choice([0.1, 1.0]))
    g = float(rng.choice([0.0, 3.0, 9.81])) if gravity is None else gravity
    scene = gr.Scene(mass, np.where(wall, 0.0, 0.05), gap, velocity, gravity=g, external_force=force, floor=floor,
                     ceiling=ceiling)
    k = 10.0 ** rng.uniform(2.5, 5.0)
    damping = 2.0 * rng.uniform(0.0, 0.9) * math.sqrt(0.5 * k)
    return scene, [some_law(rng, k, damping) for _ in range(n - 1)], start


def run(scene, law, start, length=0.25, **options):
    options = {"engine": "plain", "max_steps": 20_000} | options
    return gr.md.simulate(scene, law, t_start=start, t_end=start + length, **options)


def distance(one, other):
    """Largest difference of gaps and of rates, in units of the largest rate."""
    rates = [np.diff(r.velocity, axis=-1) for r in (one, other)]
    return max(abs(one.gap - other.gap).max(), abs(rates[0] - rates[1]).max()) / max(1.0, abs(rates[0]).max())


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(24))
def test_the_account_closes(seed):
    scene, law, start = some_scene(seed)
    if not scene.driven:
        pytest.skip("no wall is driven")
    soft = run(scene, law, start, samples=17)
    books = soft.account()
    energy, work, lost = books["energy"], books["work"], books["dissipated"]
    size = abs(energy).max() + abs(np.diff(work, axis=0)).sum() + abs(lost).max()
    assert abs(energy - work.sum(axis=1) + lost - energy[0]).max() <= 2e-13 * size
    assert (np.diff(lost) >= -1e-13 * size).all()


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(6))
def test_a_rising_floor_is_gravity(seed):
    scene, law, _ = some_scene(seed, gravity=0.0)
    if not scene.is_wall[0] or scene.is_wall[-1]:
        scene, law = gr.Scene([math.inf, 1.0, 0.3], [0.0, 0.1, 0.1], [0.01, 0.003], [0.0, -0.5, -0.7]), law[0]
    scene = scene.replace(floor=None, ceiling=None, velocity=scene.velocity - scene.velocity[0])
    breaks = np.array([0.0, 0.0625, 0.125, 0.375])
    edges = breaks[:-1]
    rising = gr.walls.Piecewise(breaks, [np.full(3, 1.25), 2.5 * edges, 1.25 * edges**2])
    one, other = run(scene.replace(gravity=2.5), law, 0.0), run(scene.replace(floor=rising), law, 0.0)
    assert len(one.contacts) == len(other.contacts)
    assert distance(one, other) < 1e-11


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(8))
def test_a_mirror_swaps_floor_and_ceiling(seed):
    scene, law, start = some_scene(seed, gravity=0.0)

    def turned(motion):
        panels = None if motion is None else motion.panels(start, start + 0.25)
        return panels and gr.walls.Panels(panels.edges, -panels.series, panels.error, panels.frequency, panels.turn)

    force = None if scene.external_force is None else -scene.external_force[::-1]
    mirror = gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1],
                      external_force=force, floor=turned(scene.ceiling), ceiling=turned(scene.floor))
    one, other = run(scene, law, start), run(mirror, law[::-1], start)
    assert abs(one.gap - other.gap[:, ::-1]).max() < 1e-11
    if one.ledger is not None:
        assert one.ledger[-1, [0, 1, 4]] == pytest.approx(other.ledger[-1, [1, 0, 4]], rel=1e-9, abs=1e-12)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(6))
def test_nobody_knows_how_fast_all_move(seed):
    scene, law, start = some_scene(seed)
    one, other = run(scene, law, start), run(scene.replace(velocity=scene.velocity + 0.75), law, start)
    assert len(one.contacts) == len(other.contacts)
    assert distance(one, other) < 1e-11


@pytest.mark.parametrize("seed", range(6))
def test_units_by_powers_of_two_change_no_bit(seed):
    scene, law, _ = some_scene(seed)
    scene = scene.replace(floor=scene.floor and gr.walls.Sine(0.03, 4.0, 0.5), ceiling=None)
    law = gr.LinearDashpot(1000.0 + seed, 12.0)
    m, x, t = 4.0, 0.5, 8.0
    force = None if scene.external_force is None else scene.external_force * (m * x / t**2)
    floor = scene.floor and gr.walls.Sine(0.03 * x, 4.0 / t, 0.5)
    other = gr.Scene(scene.mass * m, scene.radius * x, scene.gap * x, scene.velocity * (x / t),
                     gravity=scene.gravity * x / t**2, external_force=force, floor=floor)
    rule = gr.LinearDashpot((1000.0 + seed) * m / t**2, 12.0 * m / t)
    a, b = run(scene, law, 0.0, 0.5), run(other, rule, 0.0, 0.5 * t)
    assert (a.gap * x == b.gap).all()
    assert (np.diff(a.velocity) * (x / t) == np.diff(b.velocity)).all()


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(8))
def test_a_resumed_run_is_the_run(seed):
    scene, law, start = some_scene(seed)
    whole = run(scene, law, start, samples=[start + 0.3], length=0.3)
    first = run(scene, law, start, length=0.11)
    rest = gr.md.resume(first, t_end=start + 0.3, samples=[start + 0.3], engine="plain")
    for name in ("gap", "velocity", "force"):
        assert getattr(whole, name).tobytes() == getattr(rest, name).tobytes()
    if whole.ledger is not None:
        assert whole.ledger.tobytes() == rest.ledger.tobytes()


@pytest.mark.soak  # to compile what driven scenes need takes a minute
@pytest.mark.parametrize("disturbed", ["resolve", "stop", "ignore"])
def test_compiled_runs_have_the_same_bits(disturbed):
    pytest.importorskip("numba")
    for seed in range(6):
        scene, law, start = some_scene(seed)
        one, other = (run(scene, law, start, engine=engine, disturbed=disturbed, samples=5)
                      for engine in ("plain", "compiled"))
        assert one.gap.tobytes() == other.gap.tobytes()
        assert one.contacts.tobytes() == other.contacts.tobytes()
        if one.ledger is not None:
            assert one.ledger.tobytes() == other.ledger.tobytes()


@pytest.mark.rotating
def test_isolated_contacts_are_the_same_ignoring_others():
    for seed in range(16):
        scene, law, start = some_scene(seed)
        soft = run(scene, law, start)
        if soft.stats["isolated"] == soft.stats["contacts"] and (scene.gap > 0.0).all():
            other = run(scene, law, start, disturbed="ignore")
            assert len(soft.contacts) == len(other.contacts)
            if np.isfinite(soft.contacts["t_end"]).all():
                assert distance(soft, other) < 1e-12


@dataclass(frozen=True)
class Unseen:
    """A dashpot that no trait tells of."""

    k: float
    gamma: float

    def force(self, xi, xi_dot, pair):
        return self.k * math.sqrt(xi * xi) + self.gamma * xi_dot


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(3))
def test_own_laws_follow_driven_walls(seed):
    scene, _, start = some_scene(seed)
    law = gr.LinearDashpot(2000.0, 20.0)

    one, other = run(scene, law, start, samples=5), run(scene, Unseen(2000.0, 20.0), start, samples=5)
    assert len(one.contacts) == len(other.contacts)
    assert distance(one, other) < 1e-10
    if one.ledger is not None:
        assert one.ledger[-1] == pytest.approx(other.ledger[-1], rel=1e-8, abs=1e-11)


@kernel
def never(s, c):
    """No contact is solved at once."""
    return BY_PIECES


def beside_a_plate(seed):
    """Two or three balls beside a driven floor or ceiling that is near and fast, light or heavy ones, and forces."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    mass = np.append(math.inf, 10.0 ** rng.uniform(-1.0, 1.0, n))
    omega = 10.0 ** rng.uniform(0.0, 4.0)
    amplitude, phase = 10.0 ** rng.uniform(-1.0, 2.5) / omega**2, float(rng.uniform(0.0, 6.0))
    path = gr.walls.Sine(amplitude, omega / (2.0 * math.pi), phase)
    gap = 10.0 ** rng.uniform(-6.0, -2.0, n)
    gap[1] = 10.0 ** rng.uniform(-7.0, -3.0)
    velocity = np.append(0.0, rng.normal(size=n) * 10.0 ** rng.uniform(-2.0, 0.0))
    velocity[2] = velocity[1] - 10.0 ** rng.uniform(-2.0, 0.0)
    if rng.random() < 0.3:
        breaks, height = np.linspace(-1e-3, 2e-2, 6), rng.uniform(-1.0, 1.0, 6) * 10.0 ** rng.uniform(-6.0, -3.0)
        path = gr.walls.Piecewise(breaks, [np.diff(height) / np.diff(breaks), height[:-1]])
    force = np.append(0.0, rng.uniform(-1.0, 1.0, n) * 10.0 ** rng.uniform(-1.0, 3.0))
    law = some_law(rng, 10.0 ** rng.uniform(4.0, 7.0), 10.0)
    g = float(rng.choice([0.0, 9.81, 100.0]))
    if rng.random() < 0.5:
        return gr.Scene(mass, np.zeros(n + 1), gap, velocity, gravity=g, external_force=force, floor=path), law
    return gr.Scene(mass[::-1], np.zeros(n + 1), gap[::-1], -velocity[::-1], gravity=g, external_force=-force[::-1],
                    ceiling=path), law


def by_pieces(kernel, **flags):
    """The kernel, fitted, in which no contact is solved at once."""
    more = {"solve_as_one_event": never} if "solve_as_one_event" in _all_globals_read(kernel) else {}
    return fitted(kernel, **flags, **more)


@pytest.mark.rotating
def test_what_is_certified_as_isolated_is(monkeypatch):
    alone = 0
    for seed in range(20):
        scene, law = beside_a_plate(seed)
        runs = [run(scene, law, 0.0, 0.01, max_steps=2000, max_events=40)]
        with monkeypatch.context() as patch:
            patch.setattr(located_run, "fitted", by_pieces)
            runs.append(run(scene, law, 0.0, 0.01, max_steps=2000, max_events=40))
        if any(r.status is not gr.Status.time for r in runs):
            continue
        alone += runs[0].stats["isolated"]
        assert runs[0].stats["isolated"] == runs[1].stats["isolated"]
        assert abs(runs[0].velocity[-1] - runs[1].velocity[-1]).max() < 1e-10 * max(1.0, abs(scene.velocity).max())
    assert alone > 10


@pytest.mark.parametrize("rate", [0.0, 1.0, 2.0])
def test_where_a_wall_jumps_a_law_with_memory_knows_its_largest_overlap(rate):
    floor = gr.walls.Piecewise([-1.0, 0.016, 2.0], [[0.5, rate], [0.0, 0.508]])
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [-0.01], [0.0, 0.0], floor=floor)
    soft = run(scene, gr.WaltonBraun(1e4, 2e4), 0.0, 0.02)
    top, swing = math.sqrt(1.25) * 0.01, math.sqrt(2e4)  # the force is 1e4 ξ up to there, then 2e4 (ξ - top/2)
    end, away = math.atan(0.5) / 100.0 + 0.5 * math.pi / swing, 0.5 * top * swing
    begins = [0.0, 0.016 + away * (0.016 - end) / (rate - 0.5 - away)] if rate > 0.5 + away else [0.0]
    assert soft.contacts["t_begin"].tolist() == pytest.approx(begins, abs=1e-14)
    assert soft.contacts["t_end"][0] == pytest.approx(end, abs=1e-14)
    assert soft.contacts["xi_max"][0] == pytest.approx(top, rel=1e-13)

"""Fixed steps on rings, beside thermal walls, of pendula: orders, closed forms, engines, the independent reference."""

import math

import numpy as np
import pytest

import granular as gr
from bench import reference
from tests.fixed.test_engines import ALL, in_windows, same

pytest.importorskip("mpmath")


def run(scene, law, method="verlet", **options):
    return gr.md.simulate(scene, law, method=method, **({"engine": "plain"} | options))


def ring(n, seed, touching=0.3):
    """Balls on a ring, some of which touch or overlap."""
    rng = np.random.default_rng(seed)
    gap = np.where(rng.random(n) < touching, rng.choice([0.0, -1e-3], n), rng.uniform(1e-3, 3e-2, n))
    speed = rng.normal(size=n) * (rng.random(n) < 0.5)
    return gr.Scene(np.exp(rng.uniform(-0.7, 0.7, n)), [0.01] * n, gap, speed, ring=True)


def pendula(n, seed):
    """Pendula, the first pushed aside, some that touch; every third row hangs beside a wall."""
    rng = np.random.default_rng(seed)
    mass, gap = np.exp(rng.uniform(-0.7, 0.7, n)), rng.choice([0.0, 0.02, 0.05], n - 1)
    rest = np.where(rng.random(n - 1) < 0.5, gap, rng.choice([0.0, 0.03], n - 1))
    speed = rng.normal(size=n)
    if seed % 3 == 0:
        mass[0], speed[0] = math.inf, 0.0
    return gr.Scene(mass, [0.0] * n, gap, speed, pendulum=3.0, rest_gap=rest, origin=-0.2)


def heated(n, seed):
    """Balls between walls of which one or both are thermal, one of them moving, or above a thermal floor."""
    rng = np.random.default_rng(seed)
    floor, ceiling = gr.walls.Thermal(0.5, seed), gr.walls.Thermal(1.5, seed)
    mass = np.exp(rng.uniform(-0.7, 0.7, n + 2))
    mass[[0, -1]] = math.inf
    gap, speed = rng.choice([0.0, 0.02, 0.05], n + 1), rng.normal(size=n + 2)
    speed[[0, -1]] = 0.0, 0.1
    scene = gr.Scene(mass, [0.0] * (n + 2), gap, speed, 9.81, floor=floor, ceiling=ceiling)
    if seed % 3 == 0:
        return scene.replace(floor=gr.walls.Sine(0.01, 8.0))
    above = {"mass": mass[:-1], "radius": [0.0] * (n + 1), "gap": gap[:-1], "velocity": speed[:-1]}
    return scene if seed % 3 == 1 else scene.replace(**above, ceiling=None)


EACH = pytest.mark.parametrize("make", [ring, pendula, heated])
LAW = gr.LinearDashpot(3e3, 4.0)


def unbalanced(one):
    """How far the account of a run is from closing, in J."""
    account = one.account()
    balance = account["energy"] - account["work"].sum(axis=1) - account["heat"].sum(axis=1) + account["dissipated"]
    return float(np.abs(balance - balance[0]).max())


@pytest.mark.rotating
@EACH
@pytest.mark.parametrize(("seed", "method"), [(0, "verlet"), (2, "rk4"), (3, "gear5")])
def test_random_scenes_agree_with_the_reference(make, seed, method):
    scene = make(3, seed)
    truth = reference.solve(scene, LAW, t_end=0.15, digits=20)
    one = run(scene, LAW, method, t_end=0.15, dt=2e-4, samples=3)
    assert len(one.contacts) > 0
    assert [row.pair for row in truth.contacts] == one.contacts["pair"].tolist()
    assert np.abs(one.gap[-1] - [float(gap) for gap in truth.gap]).max() < 5e-4
    assert np.abs(one.velocity[-1] - [float(v) for v in truth.velocity]).max() < 2e-2
    if one.ledger is not None:
        np.testing.assert_allclose(one.ledger[-1], [float(x) for x in truth.account], rtol=0.0, atol=5e-2)
        assert unbalanced(one) < 2e-2


def slope(errors):
    """How fast errors fall, as a power of the step: the least-squares line through all of them."""
    return float(np.polyfit(np.arange(len(errors)) * -0.5 * math.log(2.0), np.log(errors), 1)[0])


ORDERS = {"verlet": 2.0, "symplectic-euler": 1.0, "rk4": 4.0, "gear5": 4.0}


@pytest.mark.rotating
@pytest.mark.parametrize("method", ALL)
def test_orders_while_no_contact_opens(method):
    rng = np.random.default_rng(4)
    gap, velocity = 0.01 * rng.normal(size=5) - 0.1, rng.normal(size=5)
    scene = gr.Scene(rng.uniform(1.0, 2.0, 5), [0.0] * 5, gap, velocity, ring=True)
    swung = gr.Scene([1.0, 2.0], [0.0] * 2, [-1.0], [0.3, -0.3], pendulum=4.0, rest_gap=[0.0], origin=0.5)
    for one, law in ((scene, gr.LinearDashpot(2e3, 3.0)), (swung, gr.LinearDashpot(20.0, 0.1))):
        t_end = 0.25 if one.ring else 0.2
        truth = [float(v) for v in reference.solve(one, law, t_end=t_end, digits=20).velocity]
        steps = [t_end / (150 * 2**j) for j in (0.0, 0.5, 1.0)]
        errors = [np.abs(run(one, law, method, t_end=t_end, dt=dt).velocity[-1] - truth).max() for dt in steps]
        wanted = 2.5 if method == "gear5" else ORDERS[method]  # Gear starts in contact without derivatives
        assert slope(errors) == pytest.approx(wanted, abs=0.7 if method == "gear5" else 0.25)


@pytest.mark.parametrize("method", [m for m in ALL if m != "symplectic-euler"])
def test_a_hit_alone_has_no_error_of_the_step(method):
    thermal = gr.walls.Thermal(2.0, 3)
    hung = gr.Scene([math.inf, 1.5], [0.0, 0.0], [0.3], [0.25, 1.0], 9.81, floor=thermal)
    between = gr.Scene([math.inf, 1.5, math.inf], [0.0] * 3, [0.3, 0.7], [0.0, 1.0, 0.0], floor=thermal,
                       ceiling=thermal)
    for scene in (hung, between):
        truth = reference.solve(scene, LAW, t_end=9.0, digits=20)
        one = run(scene, LAW, method, t_end=9.0, dt=0.7)
        assert len(one.contacts) == len(truth.contacts) > 5
        assert one.contacts["t_begin"] == pytest.approx([float(row.t_begin) for row in truth.contacts], abs=1e-13)
        v_out = np.array([row.v_out for row in truth.contacts], float)
        np.testing.assert_allclose(one.contacts["v_out"], v_out, rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(one.ledger[-1], [float(x) for x in truth.account], rtol=0.0, atol=1e-12)
        assert not one.contacts["duration"].any()
        momentum = np.where(one.contacts["pair"] == 0, 1.0, -1.0) @ one.contacts["impulse"]
        assert momentum - 1.5 * 9.0 * scene.gravity == pytest.approx(1.5 * (one.velocity[-1, 1] - 1.0), abs=1e-12)


@pytest.mark.rotating
def test_orders_of_hits_beside_contacts():
    scene = heated(3, 2)
    for law, wanted in ((gr.LinearDashpot(3e3, 0.0), 2.0), (LAW, 1.0)):
        truth = [float(v) for v in reference.solve(scene, law, t_end=0.15, digits=20).velocity]
        errors = [np.abs(run(scene, law, "verlet", t_end=0.15, dt=dt).velocity[-1] - truth).max()
                  for dt in 4e-4 / 1.5 ** np.arange(6)]
        found = np.polyfit(np.arange(6) * -math.log(1.5), np.log(errors), 1)[0]
        assert found == pytest.approx(wanted, abs=0.5)


@pytest.mark.parametrize("method", ALL)
def test_the_soft_cradle_of_pendula(method):
    scene = gr.Scene([1.0] * 5, [0.0] * 5, [1.0, 0.0, 0.0, 0.0], [0.0] * 5, origin=-1.0, pendulum=1.0)
    law = gr.LinearDashpot.from_restitution(0.9, 1e6, pair=scene.pairs[0])
    one = run(scene, law, method, t_end=2.0 * math.pi, dt=4e-5)
    y = one.position[-1] - scene.at_rest
    assert np.abs(y - [-0.689972, -0.443893, -0.079961, 0.068495, 0.145331]).max() < 3e-3
    assert one.energy()[-1] / one.energy()[0] == pytest.approx(0.705361, abs=5e-3)
    assert y.mean() == pytest.approx(-0.2, abs=1e-13)
    assert one.stats["steps"] < 25_000  # of 157079: free pendula fly


def test_momentum_and_room_of_a_ring():
    scene = ring(7, 3)
    one = run(scene, LAW, t_end=2.0, dt=1e-4, samples=5)
    assert len(one.contacts) > 10
    assert one.momentum() == pytest.approx(scene.momentum(), abs=1e-13)
    assert one.gap.sum(axis=1) == pytest.approx(scene.gap.sum(), abs=1e-13)


@pytest.mark.rotating
@EACH
@pytest.mark.parametrize("seed", range(3))
def test_windows_give_the_same_bits(make, seed, monkeypatch):
    many, block = (231 + seed, 35) if make is ring else (7, 1 + seed)
    scene, law = make(many, seed), LAW if seed % 2 else gr.WaltonBraun(4e3, 8e3)
    for method in ALL if seed == 1 else (ALL[seed],):
        options = {"t_end": 0.03 if make is ring else 0.2, "dt": 7e-4, "samples": 4}
        if seed == 2:
            options["until"] = gr.until.contact(0, 2)
        one = run(scene, law, method, **options)
        with monkeypatch.context() as patch:
            in_windows(patch, block)
            same(one, run(scene, law, method, **options))


@pytest.mark.soak
@EACH
@pytest.mark.parametrize("method", ALL)
def test_engines_give_the_same_bits(make, method, monkeypatch):
    for seed, law in enumerate((LAW, gr.WaltonBraun(1e4, 2e4))):
        for n in (5, 400):
            scene = make(n, seed)
            options = {"t_end": 0.01 if n > 5 else 0.2, "dt": 5e-4, "samples": 3}
            one = run(scene, law, method, engine="plain", **options)
            with monkeypatch.context() as patch:
                in_windows(patch, 150)
                other = run(scene, law, method, engine="compiled", **options)
            same(one, other)
            if one.ledger is not None:
                np.testing.assert_array_equal(one.ledger, other.ledger)


def test_a_row_at_rest_is_hit_around_a_ring():
    scene = gr.Scene([1.0] * 5, [0.0] * 5, [0.0, 0.0, 0.1, 0.1, 0.0], [0.0, 0.0, 0.0, -1.0, 0.0], ring=True)
    one = run(scene, gr.Hertz(1e6), t_end=0.12, dt=1e-5)
    onset = {row["pair"]: row["t_begin"] for row in one.contacts[::-1]}
    assert onset[2] == onset[1] == onset[0] == onset[4]
    assert onset[2] == pytest.approx(0.1, abs=1e-5)


@pytest.mark.parametrize("method", ALL)
def test_a_run_stops_just_before_a_hit(method):
    scene = gr.Scene([math.inf, 1.0, 0.5], [0.0] * 3, [0.3, 0.1], [0.0, 1.0, 0.0], 9.81, floor=gr.walls.Thermal(2.0, 3))
    whole = run(scene, LAW, method, t_end=2.0, dt=1e-3)
    hits = whole.of(0)
    for nth in (1, 3):
        one = run(scene, LAW, method, until=gr.until.contact(0, nth), dt=1e-3)
        assert one.status is gr.Status.until
        assert one.time[-1] == hits["t_begin"][nth - 1]
        assert one.count(0) == nth - 1
        assert one.gap[-1, 0] == pytest.approx(0.0, abs=1e-5)
        assert one.velocity[-1, 1] == pytest.approx(hits["v_in"][nth - 1, 1], abs=2e-2)


def test_what_rests_on_a_thermal_floor_is_thrown_up():
    scene = gr.Scene([math.inf, 1.0], [0.0] * 2, [0.0], [0.0] * 2, 9.81, floor=gr.walls.Thermal(0.5, 5))
    one = run(scene, LAW, t_end=0.5, dt=1e-2)
    assert one.contacts["t_begin"][0] == 0.0
    assert one.contacts["v_out"][0, 1] == gr.walls.Thermal(0.5, 5).drawn(0, 0, 1.0)


def test_a_floor_too_cold_for_the_step_is_unstable_and_says_so():
    scene = gr.Scene([math.inf, 1.0], [0.0] * 2, [0.0], [0.0] * 2, 9.81, floor=gr.walls.Thermal(1e-9, 5))
    one = run(scene, LAW, t_end=1.0, dt=1e-1)
    assert one.status is gr.Status.unstable
    assert "hits a thermal wall more than 64 times per step; use a shorter step" in one.message


def test_samples_change_no_bit_and_read_off_flights():
    for make in (ring, pendula, heated):
        scene = make(4, 4)
        one, other = (run(scene, LAW, t_end=0.3, dt=1e-3, samples=times) for times in (None, 50))
        np.testing.assert_array_equal(one.velocity[-1], other.velocity[-1])
        assert one.contacts.tobytes() == other.contacts.tobytes()
        if make is pendula:
            center = other.position @ scene.mass / scene.mass.sum() if not scene.is_wall[0] else None
            rest = scene.at_rest @ scene.mass / scene.mass.sum()
            y, v = scene._mass_fraction @ scene.displacement, scene._mass_fraction @ scene.velocity
            swing = y * np.cos(3.0 * other.time) + v / 3.0 * np.sin(3.0 * other.time)
            np.testing.assert_allclose(center - rest, swing, rtol=0.0, atol=1e-14)


def test_the_default_step_knows_how_hot_a_wall_is():
    still = gr.Scene([math.inf, 1.0, 1.0], [0.0, 0.1, 0.1], [0.1, 0.1], [0.0] * 3, 9.81)
    scenes = (still.replace(floor=gr.walls.Thermal(t)) for t in (1.0, 1e4))
    cold, hot = (run(scene, gr.Hertz(1e6), t_end=1e-3).stats["dt"] for scene in scenes)
    assert hot < 0.5 * cold

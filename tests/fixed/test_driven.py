"""Fixed steps under forces and beside driven walls: orders, the account, symmetries, and the independent reference."""

import math

import numpy as np
import pytest

import granular as gr
from bench import reference
from granular.md.fixed.integrators import INTEGRATORS

pytest.importorskip("mpmath")
from tests.fixed.test_engines import in_windows
from tests.helpers.driven_scenes import MP, riding, scenes, shaken

ALL = tuple(INTEGRATORS)


def run(scene, law, method="verlet", **options):
    return gr.md.simulate(scene, law, method=method, **options)


def unbalanced(one):
    """How far the account of a run is from closing, in J."""
    account = one.account()
    balance = account["energy"] - account["work"].sum(axis=1) + account["dissipated"]
    return float(np.abs(balance - balance[0]).max())


# state and account fall with the order that the docstring says: Gear starts in contact, so its account has order 2
ORDERS = {"verlet": (2.0, 2.0), "symplectic-euler": (1.0, 1.1), "rk4": (4.0, 4.0), "gear5": (4.0, 2.0)}


@pytest.mark.rotating
@pytest.mark.parametrize("method", ALL)
def test_orders_beside_a_driven_wall(method):
    scene, law = shaken(0.6, 0.5, 7.0, phase=0.3, gap=-0.02, velocity=0.55)
    scene = scene.replace(external_force=[0.0, -0.25], velocity=[0.5, 1.05])
    still = scene.replace(velocity=[0.0, 0.55])  # the closed form is that of the floor's own frame
    errors, gaps = [], []
    for steps in (1000, 2000):
        one = run(scene, law, method, t_end=9.0, dt=9.0 / steps)
        assert one.status is gr.Status.time
        errors.append(abs(-float(one.gap[-1, 0]) - float(riding(still, law, MP.mpf(9))[0])))
        gaps.append(unbalanced(one))
    found = [math.log2(a / b) for a, b in (errors, gaps)]
    assert found == pytest.approx(ORDERS[method], abs=0.2)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.soak) for seed in (3, 4))])
def test_random_scenes_agree_with_the_reference(seed):
    scene, law = scenes(seed)
    truth = reference.solve(scene, law, t_end=0.3, digits=20)
    for method in ALL:
        one = run(scene, law, method, t_end=0.3, dt=2e-4, samples=4)
        assert [row.pair for row in truth.contacts] == one.contacts["pair"].tolist()
        assert np.abs(one.gap[-1] - [float(gap) for gap in truth.gap]).max() < 6e-4
        assert np.abs(one.velocity[-1] - [float(v) for v in truth.velocity]).max() < 6e-3
        account = one.account()
        scale = np.abs(account["work"][-1]).sum() + account["dissipated"][-1]
        assert unbalanced(one) < 1e-2 * scale


def mirrored(motion):
    if motion is None:
        return None
    if isinstance(motion, gr.walls.Piecewise):
        return gr.walls.Piecewise(motion.breaks, -motion.coefficients)
    if isinstance(motion, gr.walls.Motion):
        return gr.walls.Motion(lambda t: -motion.function(t), motion.accuracy)
    return gr.walls.Sine(motion.amplitude, motion.frequency, motion.phase + math.pi)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_mirror_and_boost(seed):
    scene, law = scenes(seed)
    scene = scene.replace(gravity=0.0)
    other = gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1],
                     external_force=-scene.external_force[::-1], floor=mirrored(scene.ceiling),
                     ceiling=mirrored(scene.floor))
    boosted = scene.replace(velocity=scene.velocity + 2.0)
    options = {"t_end": 0.3, "dt": 2e-4, "samples": 5}
    one, two, three = run(scene, law, **options), run(other, law[::-1], **options), run(boosted, law, **options)
    assert len(one.contacts) > 1
    np.testing.assert_allclose(one.gap, two.gap[:, ::-1], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(one.velocity, -two.velocity[:, ::-1], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(one.ledger[:, :2], two.ledger[:, 1::-1], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(one.gap, three.gap, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(one.ledger[:, 4], three.ledger[:, 4], rtol=0.0, atol=1e-9)
    assert unbalanced(three) < 1e-2


# within a step Runge-Kutta's stages fall by v dt, while the floor is where it is: alike to the order of the method
@pytest.mark.rotating
@pytest.mark.parametrize(("method", "rounding"), [("verlet", 1e-11), ("rk4", 1e-9), ("gear5", 1e-11)])
def test_equivalence_of_a_rising_floor_and_gravity(method, rounding):
    mass, gap, velocity = [math.inf, 1.0, 0.3], [0.125, 0.0625], [0.0, -0.5, 0.25]
    law = [gr.LinearDashpot(4000.0, 12.0), gr.ViscoelasticHertz(1e5, 30.0)]
    parabola = gr.walls.Piecewise([0.0, 0.25, 1.0], [[1.25, 1.25], [0.0, 0.625], [0.0, 0.078125]])
    still = gr.Scene(mass, np.zeros(3), gap, velocity, gravity=2.5)
    rising = gr.Scene(mass, np.zeros(3), gap, velocity, floor=parabola)
    one, other = (run(scene, law, method, t_end=0.9, dt=5e-4, samples=7) for scene in (still, rising))
    assert len(one.contacts) > 2
    np.testing.assert_allclose(one.gap, other.gap, rtol=0.0, atol=rounding)


@pytest.mark.parametrize("method", ALL)
def test_scaling_by_powers_of_two_keeps_the_bits(method):
    scene, law = gr.scene.Scene([math.inf, 1.0, 2.0], [0.0, 0.1, 0.1], [0.01, 0.02], [0.0, 0.3, -0.2], 3.0,
                                floor=gr.walls.Sine(0.02, 3.0, 0.4)), gr.LinearDashpot(3e3, 9.0)
    length, time, mass = 4.0, 0.5, 2.0
    other = gr.Scene(scene.mass * mass, scene.radius * length, scene.gap * length, scene.velocity * (length / time),
                     scene.gravity * length / time**2, floor=gr.walls.Sine(0.02 * length, 3.0 / time, 0.4))
    scaled = gr.LinearDashpot(law.k * mass / time**2, law.gamma * mass / time)
    one = run(scene, law, method, t_end=0.5, dt=2.0**-11, samples=4)
    two = run(other, scaled, method, t_end=0.5 * time, dt=2.0**-11 * time, samples=4)
    np.testing.assert_array_equal(one.gap * length, two.gap)
    np.testing.assert_array_equal(one.ledger * (mass * length**2 / time**2), two.ledger)


def test_late_times_cost_no_digits():
    scene, law = scenes(4)
    scene = scene.replace(floor=gr.walls.Sine(0.03, 4.0, 0.7))
    early = run(scene, law, t_end=0.5, dt=2.0**-12, samples=3)
    start = 2.0**20
    late = run(scene, law, t_start=start, t_end=start + 0.5, dt=2.0**-12, samples=3)
    np.testing.assert_array_equal(early.gap, late.gap)
    np.testing.assert_array_equal(early.velocity, late.velocity)


def test_free_flight_beside_a_driven_wall_is_exact_and_costs_no_steps():
    floor = gr.walls.Sine(0.01, 10.0)
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [0.5], [0.0, 1.0], 9.81, floor=floor)
    law = gr.LinearDashpot(1e6, 10.0)
    truth = reference.solve(scene, law, until=gr.until.contact(0, 2), digits=20)
    one = run(scene, law, until=gr.until.contact(0, 2), dt=1e-6, samples=[0.0, 0.3])
    touch = one.contacts["t_begin"][0]
    assert one.stats["flights"] == 2
    assert one.stats["steps"] < 4000
    assert touch == pytest.approx(float(truth.contacts[0].t_begin), abs=1e-10)
    assert one.contacts["v_in"][0, 0] == pytest.approx(floor.velocity(touch), abs=1e-4)
    height = 0.5 + 0.3 - 0.5 * 9.81 * 0.09
    assert one.position[1] == pytest.approx([floor.displacement(0.3), height], abs=1e-14)


def test_a_run_beside_a_driven_wall_is_quiet_only_where_nothing_can_follow():
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.05], [0.0, 1.0], floor=gr.walls.Sine(1e-3, 20.0))
    law, until = gr.LinearDashpot(1e4, 5.0), gr.until.contact(0, 1)
    assert run(scene, law, until=until).status is gr.Status.quiet  # it flies away for good
    assert run(scene.replace(gravity=9.81), law, until=until).status is gr.Status.until
    assert run(scene.replace(external_force=[0.0, -1.0]), law, until=until).status is gr.Status.until


@pytest.fixture(scope="module")
def remembering():
    """A scene beside a wall moved by a function, a law with memory, and the truth."""
    path = gr.walls.Motion(lambda t: 0.02 * math.sin(12.0 * t), 1e-13)
    scene = gr.Scene([math.inf, 1.0, 0.5], [0.0, 0.1, 0.1], [0.01, 0.02], [0.0, 0.0, -1.0], floor=path)
    law = gr.WaltonBraun(1e4, 3e4)
    return scene, law, reference.solve(scene, law, t_end=0.2)


@pytest.mark.rotating
@pytest.mark.parametrize("method", ALL)
def test_a_path_may_end_with_the_run_and_a_law_may_remember(remembering, method):
    scene, law, truth = remembering
    one = run(scene, law, method, t_end=0.2, dt=2e-5)
    assert isinstance(one.scene.floor, gr.walls.Panels)
    assert [row.pair for row in truth.contacts] == one.contacts["pair"].tolist()
    np.testing.assert_allclose(one.gap[-1], truth.gap, rtol=0.0, atol=2e-5)
    assert one.position[-1, 0] == pytest.approx(0.02 * math.sin(2.4), abs=1e-14)


def test_what_a_law_with_memory_dissipates_is_known_between_its_contacts():
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.0], [1.0, 0.0], external_force=[0.0, 1.0])
    one = run(scene, gr.WaltonBraun(1e4, 4e4), t_end=0.1, dt=1e-5, samples=[0.0, 0.01, 0.1])
    lost = one.account()["dissipated"]
    assert np.isnan(lost[1])
    assert lost[2] == pytest.approx(0.5 * 0.75, rel=0.05)  # ε = ½


@pytest.mark.soak
def test_compiled_and_in_windows_the_same_bits(monkeypatch):
    scene, law = scenes(5)
    law = [gr.LinearDashpot(3e3, 10.0 + c) for c in range(scene.n - 1)]
    rng = np.random.default_rng(3)
    n = 700
    mass = np.exp(rng.uniform(-0.5, 0.5, n))
    mass[[0, -1]] = math.inf
    chain = gr.Scene(mass, np.where(np.isinf(mass), 0.0, 0.01), rng.choice([-1e-5, 1e-4], n - 1),
                     np.where(np.isinf(mass), 0.0, rng.normal(size=n) * 0.1), floor=gr.walls.Sine(1e-3, 30.0),
                     ceiling=gr.walls.Sine(1e-3, 20.0, 1.0))
    for one, laws, options in ((scene, law, {"t_end": 0.4, "dt": 2e-4, "samples": 7}),
                               (chain, gr.LinearDashpot(1e5, 3.0), {"t_end": 3e-3, "dt": 2e-5, "samples": 3})):
        plain = run(one, laws, engine="plain", **options)
        with monkeypatch.context() as patch:
            in_windows(patch, 274)
            compiled = run(one, laws, engine="compiled", **options)
        assert compiled.stats["engine"] == "compiled"
        for name in ("position", "velocity", "gap", "force", "ledger"):
            np.testing.assert_array_equal(getattr(plain, name), getattr(compiled, name))
        assert plain.contacts.tobytes() == compiled.contacts.tobytes()


def test_the_default_step_knows_how_fast_a_wall_is():
    still = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.0], [0.0, 0.0], 9.81)
    law = gr.Hertz(1e6)
    steps = [run(scene, law, t_end=1e-3).stats["dt"]
             for scene in (still.replace(floor=gr.walls.Sine(a, 50.0)) for a in (1e-4, 1e-2))]
    assert steps[1] < 0.6 * steps[0]


def test_misuse_is_one_sentence():
    law = gr.LinearDashpot(1e4, 1.0)
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.1], [0.0, 0.0], 9.81)
    shaking = scene.replace(floor=gr.walls.Sine(1e-3, 50.0))
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run with a driven wall does not end "
                                         r"by itself\. Give t_end=, until= or max_events=\."):
        run(shaking, law)
    with pytest.raises(ValueError, match=r"`t_end` must be .*, got inf\. A wall moved by a function requires t_end=\."):
        run(scene.replace(floor=gr.walls.Motion(math.sin)), law, until=gr.until.contact(0, 2))
    short = gr.walls.Piecewise([0.0, 0.5], [[1.0], [0.0]])
    with pytest.raises(ValueError, match=r"`t_end` must be a number in \[0, 0\.5\], got 1\.0\. The path of the wall"):
        run(scene.replace(floor=short), law, t_end=1.0)
    room = gr.Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [0.1, 0.1], [0.0] * 3, floor=gr.walls.Sine(0.5, 0.5))
    with pytest.raises(ValueError, match=r"`t_end` must be before the walls meet at t = .*, got 2\.0"):
        run(room, law, t_end=2.0, dt=1e-5)


def test_walls_that_meet_for_a_short_time_are_noticed():
    scene = gr.Scene([math.inf, 1e-3, 1e-3, math.inf], [0.0, 1e-3, 1e-3, 0.0], [1e-3] * 3, [0.0] * 4,
                     floor=gr.walls.Sine(2e-2, 10.0))
    with pytest.raises(ValueError, match=r"the walls meet at t = 0\.00569092"):  # at t_end they are apart
        run(scene, gr.LinearDashpot(1e3, 0.1), t_end=0.1, dt=1e-5, engine="plain")


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("method", "order"), [
        ("verlet", 2.0), pytest.param("symplectic-euler", 1.0, marks=pytest.mark.soak), ("rk4", 2.5),
        pytest.param("gear5", 2.5, marks=pytest.mark.soak),
    ]
)
def test_located_is_the_limit_of_small_steps(method, order):
    """Both walls driven, forces, several Hertz contacts: the distance falls as dt to the order of the method."""
    floor, ceiling = gr.walls.Sine(0.02, 3.0, 0.4), gr.walls.Sine(0.01, 5.0, 1.0)
    scene = gr.Scene([math.inf, 1.0, 0.6, math.inf], [0.0, 0.01, 0.01, 0.0], [0.02, 0.03, 0.05], [0.0, -0.5, -0.2, 0.1],
                     9.81, external_force=[0.0, 0.7, -0.4, 0.0], floor=floor, ceiling=ceiling)
    slopes = []
    for t_end in (0.3, 0.37):
        limit = gr.md.simulate(scene, gr.Hertz(2e4), t_end=t_end, engine="plain").velocity[-1]
        steps = t_end / np.round(t_end / (8e-4 * 2.0 ** -np.arange(0.0, 3.5, 0.5)))
        ends = [run(scene, gr.Hertz(2e4), method, t_end=t_end, dt=float(dt)).velocity[-1] for dt in steps]
        errors = [np.abs(end - limit).max() for end in ends]
        slopes.append(np.polyfit(np.log(steps), np.log(errors), 1)[0])
    assert np.mean(slopes) == pytest.approx(order, abs=0.25)

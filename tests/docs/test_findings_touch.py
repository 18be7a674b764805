"""The gallery's findings, second part: what only the duration of contacts makes. See `test_findings`."""

import math
import runpy

import numpy as np
import pytest

import granular as gr
from tests.docs.test_findings import by_scipy
from tests.helpers.findings import FOLDER, printed, script

pi, rebound, touching, cooling = map(script, ("pi", "rebound", "touching", "cooling"))
SOAK = pytest.mark.soak


@pytest.mark.parametrize("digits", [0, 1, 2, 3, *(pytest.param(d, marks=SOAK) for d in (4, 5))])
def test_hard_balls_count_the_digits_of_pi(digits):
    """As many as there are; the heavy ball leaves with its speed, to what the light one may keep: m/M of the energy."""
    count, speed = pi.collision_count(digits)
    assert count == math.floor(math.pi * 10**digits)
    assert speed == pytest.approx(1.0, abs=2.1 * 10.0**-digits)


@pytest.mark.rotating
@pytest.mark.parametrize(("k", "count"), [
    (1e2, 8), (1e4, 26), pytest.param(1e6, 84, marks=SOAK), pytest.param(1e8, 266, marks=SOAK)])
def test_springs_count_no_further_than_their_law(k, count):
    """To one contact, as the last of them hangs on the phase; they part as hard balls do, to m/M."""
    found, speed = pi.collision_count(3, k)
    assert found == count == pytest.approx(pi.contact_limit(k), abs=1.0)
    assert speed == pytest.approx(pi.collision_count(3)[1], abs=2e-3)


@SOAK
def test_the_law_of_counting_at_a_stiffness_and_masses_it_was_not_drawn_for():
    for digits, k in ((4, 1e10), (5, 3e7), (4, 2.5e3)):
        assert pi.collision_count(digits, k)[0] == pytest.approx(pi.contact_limit(k), abs=1.0)
    assert pi.collision_count(4, 1e10)[0] in (839, 840)


def test_the_law_of_counting_goes_like_the_fourth_root():
    assert pi.contact_limit(16.0 * 7.0) == pytest.approx(2.0 * pi.contact_limit(7.0), rel=1e-14)
    assert pi.contact_limit(1.0) == printed(2.656, 3)


@pytest.mark.parametrize("mu", [0.01, 1.0 / 3.0, 0.9])
def test_the_textbook_of_two_balls_is_that_of_hard_spheres(mu):
    scene = gr.Scene([math.inf, 1.0, mu], [0.0] * 3, [1e-3, 1e-9], [0.0, -1.0, -1.0])
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), max_events=2)
    assert run.velocity[-1, 1:] == pytest.approx(rebound.textbook_speeds(mu), abs=1e-12)


@pytest.mark.parametrize(("mu", "speeds"), [
    (0.01, (0.99803, 1.18031)), (1.0 / 3.0, (0.57141, 1.73796)), (3.0, (0.10595, 1.15308))])
def test_touching_balls_on_a_floor(mu, speeds):
    """Elastic: the energy stays, to rounding."""
    found = rebound.touching_speeds(mu)
    assert found == printed(np.array(speeds), 5)
    assert found @ (found * [1.0, mu]) == pytest.approx(1.0 + mu, rel=1e-12)


def test_scipy_has_touching_balls_leave_the_floor_alike():
    mu = 1.0 / 3.0
    radii = np.cbrt(0.75 / math.pi * np.array([1.0, mu]) / rebound.STEEL.density)
    scene = gr.Scene([math.inf, 1.0, mu], [0.0, *radii], [0.0, 0.0], [0.0, -1.0, -1.0])
    law = [rebound.SOFT_LAWS["steel, Hertz"](pair) for pair in scene.pairs]
    run = gr.md.simulate(scene, law, until=gr.until.separated())
    assert by_scipy(scene, law, run.time[-1])[1:] == pytest.approx(rebound.touching_speeds(mu), abs=1e-6)


@pytest.mark.parametrize(("gap", "first", "second"), [
    (0.0, (0.802, 1), (0.975, 2)), (1e-3, (0.881, 4), (1.716, 5)), (5e-2, (2.334, 1), (2.334, 1))])
def test_a_table_tennis_ball_flies_late(gap, first, second):
    for (speed, count), (said, contacts) in zip(rebound.bounces(gap), (first, second), strict=True):
        assert (speed, count) == (printed(said, 3), contacts)
    if gap:
        hard = rebound.bounces(gap, gr.edmd)
        assert hard[0] == hard[1]
        assert hard[0][0] == pytest.approx(2.31, abs=0.01)


def test_rules_for_three_touching_balls():
    at_once = pytest.approx([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], abs=1e-12)
    for ties in touching.TIE_RULES:
        expected = at_once if ties in ("newton", "poisson") else pytest.approx([0.0, 0.0, 1.0])
        assert touching.hard_speeds(ties) == expected
    with pytest.raises(ValueError, match="must be non-negative"):
        gr.edmd.simulate(touching.row(-touching.ROUNDING_OVERLAP), gr.ConstantRestitution(1.0))


@pytest.mark.parametrize(("gap", "speed", "speeds"), [
    (0.0, 1.0, (-0.0710, 0.0764, 0.9945)), (0.0, 0.01, (-0.0710, 0.0764, 0.9945)),
    (-1.5e-7, 1.0, (-0.0727, 0.0785, 0.9943)), (-1.5e-7, 0.01, (-0.1591, 0.1753, 0.9838)),
    (1e-5, 0.01, (0.0, 0.0, 1.0))])
def test_three_balls_by_newton(gap, speed, speeds):
    """What an overlap stores goes over into motion: U = 2/5 k ξ^(5/2) of two pairs."""
    found = touching.soft_speeds(gap, speed)
    assert found == printed(np.array(speeds), 4)
    scene = touching.row(gap, speed)
    stored = 0.8 * gr.Hertz.from_material(*gr.materials.steel, scene.pairs[0]).k * max(0.0, -gap) ** 2.5
    assert found @ found == pytest.approx(1.0 + 2.0 * stored / (scene.mass[0] * speed**2), rel=1e-12)
    assert [1e6 * touching.largest_overlap(v) for v in (1.0, 0.01)] == [printed(26.54, 2), printed(0.67, 2)]


@SOAK
def test_points_with_half_their_speed_left_collapse_unless_something_is_cut_off():
    case = cooling.gas(0)
    assert gr.edmd.simulate(case.scene, case.rule, t_end=16.0).status is gr.Status.bounded
    assert case.simulate("edmd").status is gr.Status.time


@SOAK
def test_soft_points_cool_as_hard_ones_with_a_cut_off():
    """The means agree within the margin at every time of the picture, with fewer contacts than collisions."""
    for end in cooling.OUTPUT_TIMES:
        assert cooling.cooling_ensemble(end).answer is gr.Answer.yes
    gases = [cooling.gas(seed) for seed in range(8)]
    counts = [[len(gas.simulate(engine).contacts) for gas in gases] for engine in ("md", "edmd")]
    assert [sum(of) for of in counts] == pytest.approx([5809, 27_586], rel=0.1)  # where rounding grows, counts follow
    ends = [gr.edmd.simulate(gas.scene, gas.rule, t_end=16.0) for gas in gases]
    assert sum(run.status is gr.Status.bounded for run in ends) == 7


@SOAK
def test_sticking_points_lose_energy_with_the_published_exponent():
    """-2/3 within three standard errors of eight draws, which are those of the page."""
    found = np.array([cooling.cooling_exponent(30_000, seed, 2000.0) for seed in range(8)])
    error = found.std(ddof=1) / math.sqrt(len(found))
    assert (found.mean(), error) == (printed(-0.669, 3), printed(0.004, 3))
    assert abs(found.mean() + 2.0 / 3.0) < 3.0 * error


engines, bouncing = map(script, ("engines", "bouncing"))


def test_rules_for_five_touching_balls():
    at_once = [-0.6, 0.4, 0.4, 0.4, 0.4]
    for ties, expected in {"left": [0, 0, 0, 0, 1], "newton": at_once, "poisson": at_once}.items():
        assert engines.hard_speeds(ties) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_five_touching_balls_by_newton_at_any_speed_and_stiffness(size):
    linear, hertz = gr.LinearDashpot(1e6 * size), gr.Hertz(1e9 * size)
    assert engines.soft_speeds(linear, 0.1 * size) == printed(np.array([-0.132, -0.075, -0.031, 0.296, 0.942]), 3)
    assert engines.soft_speeds(hertz, 0.1 * size) == printed(np.array([-0.071, -0.030, -0.014, 0.127, 0.989]), 3)
    for law in (linear, hertz):
        v = engines.soft_speeds(law)
        assert (v.sum(), v @ v) == pytest.approx((1.0, 1.0), rel=1e-12)


def test_stored_results_of_engines_are_those_of_the_page():
    known = {"pymunk 7.3.1, R = 5 cm": [-1 / 3, 0, 0, 2 / 3, 2 / 3], "pymunk 7.3.1, R = 1 m": [0, 0, 0, 0, 1],
             "Box2D 2.3.10, 3 m/s": [-0.6, 0.4, 0.4, 0.4, 0.4], "Box2D 2.3.10, 0.5 m/s": [0.2] * 5,
             "MuJoCo 4.0.0, springs": [-0.6, 0.4, 0.4, 0.4, 0.4]}
    assert known.keys() == engines.ENGINES.keys()
    for name, values in known.items():
        assert engines.ENGINES[name] == pytest.approx(values, abs=0.0125)
        assert sum(engines.ENGINES[name]) == pytest.approx(1.0, abs=2e-4)


@SOAK
@pytest.mark.parametrize(("engine", "speed", "more", "key"), [
    ("pymunk", 1.0, {}, "pymunk 7.3.1, R = 5 cm"), ("pymunk", 1.0, {"radius": 1.0}, "pymunk 7.3.1, R = 1 m"),
    ("Box2D", 3.0, {}, "Box2D 2.3.10, 3 m/s"), ("Box2D", 0.5, {}, "Box2D 2.3.10, 0.5 m/s"),
    ("mujoco", 1.0, {}, "MuJoCo 4.0.0, springs")])
def test_engines_give_the_stored_results(engine, speed, more, key):
    """Runs where the engine is installed: pip install pymunk Box2D mujoco."""
    pytest.importorskip(engine)
    peer = runpy.run_path(str(FOLDER.parent / "peers" / f"cradle_{engine.lower()}.py"))
    values = [value / speed for value in peer["velocities"](speed, **more)]
    assert values == pytest.approx(engines.ENGINES[key], abs=2e-3)


@pytest.mark.parametrize(("scheme", "rate", "bounce", "energy"), [
    ("explicit Euler", 60, 10, 1.5216), ("explicit Euler", 240, 10, 1.0918),
    ("semi-implicit Euler, put back", 60, 80, 1.012), ("semi-implicit Euler, put back", 240, 80, 0.7748),
    ("semi-implicit Euler, not put back", 60, 10, 0.7852), ("semi-implicit Euler, not put back", 60, 80, 0.0021)])
def test_energy_of_a_bouncing_ball_in_fixed_steps(scheme, rate, bounce, energy):
    assert bouncing.energies(scheme, 1.0 / rate, bounce)[-1] == printed(energy, 4)


@SOAK
def test_a_ball_that_is_put_back_keeps_its_energy_at_one_step():
    energy = bouncing.energies("semi-implicit Euler, put back", 1.0 / 60.0, 36_000)
    assert len(energy) == 36_000
    assert energy[[0, -1]] == printed(np.array([1.012, 1.012]), 3)


@pytest.mark.parametrize("rate", [50.0, 173.0])
def test_explicit_steps_gain_what_their_closed_form_says(rate):
    """A fall of k steps from rest covers g dt² k(k-1)/2, so the first gain is between 0 and 2 g dt |v|."""
    dt, g = 1.0 / rate, bouncing.GRAVITY
    steps = math.ceil(0.5 + math.sqrt(0.25 + 2.0 * bouncing.HEIGHT / (g * dt * dt)))
    assert bouncing.energies("explicit Euler", dt, 1)[0] == pytest.approx(
        0.5 * (g * dt * steps) ** 2 / (g * bouncing.HEIGHT), rel=1e-9)


@pytest.mark.rotating
def test_an_elastic_ball_keeps_its_energy_in_both_models():
    hard = gr.edmd.simulate(bouncing.ball(), gr.ConstantRestitution(1.0), t_end=1e5)
    soft = gr.md.simulate(bouncing.ball(), gr.LinearDashpot(1e6), t_end=1e3)
    assert len(hard.contacts) == 35_928
    assert bouncing.energy_change(hard) < 1e-14
    assert bouncing.energy_change(soft) < 1e-14

"""How high balls rise at each bounce, hard and soft; and the share of the impulse of a floor pressed from above."""

import math

import numpy as np
import pytest

import granular as gr
from granular.comparison import further


@pytest.mark.rotating
@pytest.mark.usefixtures("interpreted")
def test_a_rise_is_given_up_where_a_pile_takes_too_many_steps_to_settle(monkeypatch):
    """Before, the soft run was followed for minutes: steps, not contacts, are many."""
    monkeypatch.setattr(further, "MAX_STEPS_PER_RUN", 3000)
    pile = gr.scenes.ball_stack(8, mass_ratio=0.122, gap=0.0216, height=0.237)
    law = [gr.LinearDashpot.from_restitution(0.642, k=2.02e7, pair=pair) for pair in pile.pairs]
    report = gr.compare(pile, law, until=gr.until.separated(), t_end=3.0)
    assert len(report.soft.contacts) == 8
    assert math.isnan(report.rises[1])
    assert report.rises[0] > 100.0


def basketball_and_table_tennis_ball(floor_contacts):
    case = gr.cases.make("real-balls", lower="basketball", upper="table-tennis ball", pair_rule="lens", gap=0.0)
    return gr.compare(case.scene, case.law, case.rule, until=gr.until.contact(0, floor_contacts))


@pytest.mark.usefixtures("interpreted")
def test_the_rise_of_the_second_bounce_does_not_hang_on_where_the_run_stops():
    """As on the last screen of the teaching page: at the second bounce it flies."""
    short, long = basketball_and_table_tennis_ball(2), basketball_and_table_tennis_ball(3)
    assert short.rises == pytest.approx((5.538, 0.7185), rel=1e-3)
    assert short.rises(bounce=2) == pytest.approx((2.582, 3.630), rel=1e-3)
    for bounce in (1, 2):
        assert long.rises(bounce) == pytest.approx(short.rises(bounce), rel=1e-9)
    lines = [line for line in str(long).splitlines() if line.startswith("rise of ball 2, drops")]
    assert [line.split()[5:7] for line in lines] == [["5.53844", "0.7185"], ["2.58187", "3.63018"]]
    assert lines[1].endswith("of 1 m, bounce 2")
    assert str(short).count("rise of ball 2") == 1
    assert short.rises() == short.rises == short.rises(2)(1)
    assert short.to_dict()["rises"] == list(short.rises)
    with pytest.raises(ValueError, match="bounce"):
        short.rises(0)


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("bounce", [1, 2, 3, 6])
def test_a_ball_alone_rises_by_the_square_of_its_restitution_at_each_bounce(bounce):
    scene = gr.scenes.bouncing_ball(height=1.0)
    law = gr.LinearDashpot.from_restitution(0.8, 1e7, scene.pairs[0])
    report = gr.compare(scene, law, until=gr.until.contact(0, 2))
    assert report.rises(bounce) == pytest.approx((0.64**bounce,) * 2, rel=2e-3)


def test_a_rise_goes_with_the_speed_of_the_touch_before_it():
    report = basketball_and_table_tennis_ball(3)
    for run, bounce, engine in ((report.hard, 1, 0), (report.soft, 1, 1)):
        last = run.of(1)[run.of(1)["t_end"] < report.soft.contacts["t_end"].min() + 0.1][-1]
        rise = report.rises(bounce)[engine]
        assert last["v_out"][1] == pytest.approx(math.sqrt(2.0 * report.scene.gravity * rise), rel=0.01)


@pytest.mark.usefixtures("interpreted")
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("gap", [1e-4, 1e-2])
def test_rises_of_fixed_steps_are_those_of_their_steps_wherever_the_run_stops(gap):
    """Before, a run that stopped before the apex got it from an exact run, 5 % apart."""
    scene = gr.scenes.three_balls(gap=gap)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    end, fixed = gr.until.contact, {"method": "verlet", "dt": 3e-6}
    exact = gr.compare(scene, law, until=end(0, 2)).rises[1]
    rises = [gr.compare(scene, law, until=end(0, nth), **fixed).rises[1] for nth in (1, 2, 3)]
    assert rises == pytest.approx(rises[:1] * 3, rel=1e-4)
    assert abs(rises[0] - exact) > 0.01 * exact
    assert further.apexes(gr.compare(scene, law, until=end(0, 1), **fixed), "soft", [1, 2])[1, 1] == pytest.approx(
        rises[0], rel=1e-9)


@pytest.mark.usefixtures("interpreted")
def test_a_ball_that_hits_a_ceiling_first_has_no_apex_after_that_bounce():
    """Before, the apex of a later bounce was given, and the place of the ceiling as the rise of the top ball."""
    box = gr.Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [1.0, 0.3], [0.0, -8.0, 0.0], 9.81)
    law = gr.LinearDashpot.from_restitution(0.8, k=1e6, pair=box.pairs[0])
    report = gr.compare(box, law, t_end=2.5)
    assert report.soft.contacts["pair"].tolist() == [0, 1, 0, 1, 0, 0]
    heights = report.against_bounces(heights=[1.0] * 4).heights
    assert np.isnan(heights[1:, :2]).all()
    speeds = np.array([run.of(0)["v_out"][2:4, 1] for run in (report.hard, report.soft)])
    assert heights[1, 2] == pytest.approx(speeds[0, 0] ** 2 / 19.62)
    assert heights[2, 2] == pytest.approx(speeds[1, 0] ** 2 / 19.62, rel=1e-3)
    assert np.isnan([*report.rises, *report.rises(2)]).all()
    assert report.rises(3) == pytest.approx(heights[1:, 2])


@pytest.mark.usefixtures("interpreted")
def test_the_lowest_ball_has_no_apex_where_the_ball_above_throws_it_back_to_the_floor():
    """Before, the apex after a later bounce was given for three bounces."""
    scene = gr.Scene([math.inf, 1.0, 3.0], [0.0, 0.1, 0.1], [1.0, 0.3], [0.0] * 3, 9.81)
    law = [gr.LinearDashpot.from_restitution(0.8, k=1e7, pair=pair) for pair in scene.pairs]
    heights = gr.compare(scene, law, t_end=0.9).against_bounces(heights=[0.2] * 3).heights
    assert np.isnan(heights[1:, :2]).all()
    assert heights[1:, 2] == pytest.approx([0.223, 0.2175], rel=1e-3)


@pytest.mark.usefixtures("interpreted")
def test_a_common_velocity_changes_no_rise():
    """Before, a rise of 1.78 m was 0 m at a common velocity of 8 m/s."""
    scene = gr.scenes.three_balls(gap=1e-3)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    at_rest, *moving = (gr.compare(scene.replace(velocity=scene.velocity + boost), law, until=gr.until.contact(0, 2))
                        for boost in (0.0, -3.0, 8.0))
    for report in moving:
        assert report.rises == pytest.approx(at_rest.rises, rel=1e-12)
        assert report.rises(2) == pytest.approx(at_rest.rises(2), rel=1e-12)


@pytest.mark.usefixtures("interpreted")
def test_balls_that_lie_on_a_moving_floor_rise_nothing():
    """Before, the rise was nan unless the floor was at rest."""
    pile = gr.scenes.ball_stack(3, 0.85, gap=6.4e-5)
    law = [gr.LinearDashpot.from_restitution(0.1, 1e5, pair=pair) for pair in pile.pairs]
    still, moving = (gr.compare(pile.replace(velocity=np.full(pile.n, boost)), law, t_end=0.6).rises[0]
                     for boost in (0.0, 0.5))
    assert still == moving == 0.0


def first_apex(report, t_end):
    """First apex of the top ball after a contact, from samples of an uninterrupted hard run; nan without one."""
    scene, options = report.scene, report.hard_options | {"t_end": t_end, "until": None, "samples": 1001}
    run = gr.edmd.simulate(scene, report.rule, **options)
    top = int(np.flatnonzero(~scene.is_wall)[-1])
    drift = scene.velocity[0] * (run.time - run.time[0])
    height = run.position[:, top] - run.position[0, 0] - drift - 2.0 * scene.radius[1:top].sum() - scene.radius[top]
    rate = run.velocity[:, top] - scene.velocity[0]
    touched = run.contacts["t_begin"][run.contacts["pair"] == top - 1].min()
    for k in np.flatnonzero((rate[:-1] > 0.0) & (rate[1:] <= 0.0)):
        apex = run.time[k] + rate[k] / scene.gravity
        log = run.contacts[np.isin(run.contacts["pair"], [top - 1, top])]["t_begin"]
        if run.time[k] > touched and not ((log > run.time[k]) & (log < apex)).any():
            return height[k] + rate[k] ** 2 / (2.0 * scene.gravity)
    return math.nan


@pytest.mark.rotating
@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("seed", range(8))
def test_rises_above_a_driven_floor_are_heights_above_its_start(seed):
    """Before, a continued hard run gave the floor its momentary velocity as a constant one: 0.722 m for 0.824 m."""
    rng = np.random.default_rng([7, seed])
    n, floor = int(rng.integers(1, 4)), gr.walls.Sine(10.0 ** rng.uniform(-4, -2), 10.0 ** rng.uniform(0.5, 1.5), seed)
    scene = gr.Scene([math.inf, *0.5 ** np.arange(n)], [0.0] + [0.02] * n,
                     [rng.uniform(0.1, 0.5), *rng.uniform(1e-3, 1e-2, n - 1)], [0.2 * (seed % 2)] + [0.0] * n, 9.81,
                     floor=floor)
    eps = rng.uniform(0.5, 0.9)
    law = [gr.LinearDashpot.from_restitution(eps, k=1e11, pair=pair) for pair in scene.pairs]
    reports = [gr.compare(scene, law, until=gr.until.contact(0, nth)) for nth in (1, 2)]
    expected = first_apex(reports[0], 1.0)
    for report in reports:
        assert report.rises[0] == pytest.approx(expected, rel=1e-9)
        assert report.rises[1] == pytest.approx(report.rises[0], rel=2e-3)


@pytest.mark.rotating
@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("speed", [None, 0.1, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_rises_of_merged_balls_are_those_of_the_uninterrupted_run(seed, speed):
    """Before, a run was continued with a smaller `merge_below`: 0.21 mm for balls that lie."""
    rng = np.random.default_rng([8, seed])
    n = int(rng.integers(2, 6))
    scene = gr.Scene([math.inf, *rng.uniform(0.3, 1.5, n)], [0.0] + [0.02] * n,
                     [rng.uniform(0.1, 0.5), *10.0 ** rng.uniform(-5, -2, n - 1)], [0.0] * (n + 1), 9.81)
    law = [gr.LinearDashpot.from_restitution(rng.uniform(0.05, 0.6), k=1e9, pair=pair) for pair in scene.pairs]
    ends = {"until": gr.until.contact(0, 1)}, {"until": gr.until.contact(0, 2)}, {"t_end": 1.0}
    reports = [gr.compare(scene, law, **end, collapse="merge", merge_below=speed) for end in ends]
    expected = first_apex(reports[0], 1.0)
    for report in reports:
        assert report.rises[0] == pytest.approx(0.0 if math.isnan(expected) else expected, rel=1e-9)


@pytest.mark.usefixtures("interpreted")
def test_a_rise_above_a_thermal_floor_does_not_hang_on_where_the_run_stops():
    """Before, a continued hard run drew the first speeds again."""
    scene = gr.Scene([math.inf, 1.0, 0.5], [0.0, 0.02, 0.02], [0.1, 1e-3], [0.0] * 3, 9.81,
                     floor=gr.walls.Thermal(2.0, 3))
    law = [gr.LinearDashpot.from_restitution(0.8, k=1e9, pair=pair) for pair in scene.pairs]
    short, long = (gr.compare(scene, law, until=gr.until.contact(0, nth)) for nth in (2, 5))
    assert short.rises == pytest.approx(long.rises, rel=1e-9)
    assert short.rises(2)[0] == pytest.approx(long.rises(2)[0], rel=1e-9)
    assert short.rises(4)[0] == pytest.approx(long.rises(4)[0], rel=1e-9)
    box = gr.Scene([math.inf, 1.0, math.inf], [0.0, 0.02, 0.0], [0.3, 5.0], [0.0] * 3, 9.81,
                   ceiling=gr.walls.Thermal(2.0, 3))
    law = [gr.LinearDashpot.from_restitution(0.4, k=1e8, pair=pair) for pair in box.pairs]
    collapsed = gr.compare(box, law, t_end=3.0)
    assert collapsed.hard.status is gr.Status.collapse
    assert np.isnan(further.apexes(collapsed, "hard", [1])).all()


@pytest.mark.usefixtures("interpreted")
def test_balls_that_rest_on_a_driven_floor_have_no_rise():
    """Before, their rise was 0, also if the floor throws them later."""
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.02], [0.0], [0.0, 0.0], 9.81, floor=gr.walls.Sine(1e-3, 5.0, math.pi / 2))
    report = gr.compare(scene, gr.LinearDashpot.from_restitution(0.5, k=1e8, pair=scene.pairs[0]), t_end=1.0)
    assert np.isnan(further.apexes(report, "hard", [1])).all()


def test_without_a_floor_no_ball_rises():
    """Before, the height above the other ball was given."""
    falling = gr.Scene([1.0, 1.0], [0.1, 0.1], [0.1], [1.0, 0.0], 9.81)
    assert np.isnan(gr.compare(falling, gr.LinearDashpot(1e7), t_end=1.0).rises).all()


@pytest.mark.usefixtures("interpreted")
def test_a_rise_under_a_constant_force_is_the_highest_point():
    """Before, heights were those at the time v/g."""
    ball = gr.scenes.bouncing_ball(height=1.0).replace(external_force=[0.0, -0.02])
    law = gr.LinearDashpot.from_restitution(0.8, 1e7, ball.pairs[0])
    report = gr.compare(ball, law, until=gr.until.contact(0, 2))
    assert report.rises == pytest.approx((0.64, 0.64), rel=2e-3)
    two = gr.scenes.three_balls(gap=1e-3).replace(external_force=[0.0, 0.0, -0.02])
    law = [gr.LinearDashpot.from_restitution(0.3, k=1e4, pair=pair) for pair in two.pairs]
    assert math.isnan(gr.compare(two, law, until=gr.until.contact(0, 2)).rises[1])  # it flies pressed onto the other


def test_balls_that_stick_and_lie_on_the_floor_rise_nothing():
    """Before, it could not be told of hard spheres."""
    scene = gr.scenes.ball_stack(4, 0.85, gap=6.4e-5)
    law = [gr.LinearDashpot.from_restitution(0.316, 1.5e5, pair=pair) for pair in scene.pairs]
    hard, soft = gr.compare(scene, law, until=gr.until.contact(0, 2)).rises
    assert (hard, soft) == (0.0, pytest.approx(0.67, rel=0.01))


def test_the_rise_of_a_stack_is_told_as_that_of_two_balls():
    case = gr.cases.make("ball-stack", n=3)
    report = gr.compare(case.scene, case.law, case.rule, until=case.until)
    assert report.drop == pytest.approx(1.0)
    for text in (str(report), report.details()):
        assert "rise of ball 3, drops             21.7955        1.12327  of 1 m\n" in text
    assert math.isnan(gr.compare(gr.scenes.ball_stack(6), gr.LinearDashpot(1e7), until=gr.until.contact(0, 1)).drop)


@pytest.mark.rotating
@pytest.mark.usefixtures("interpreted")
def test_the_share_of_the_floors_impulse_is_that_under_its_force():
    """From both forces at many moments."""
    random = np.random.default_rng(8)
    for _ in range(3):
        scene = gr.scenes.ball_stack(2, 10.0 ** random.uniform(-2.0, 0.0), gap=10.0 ** random.uniform(-5.0, -3.5))
        law = [gr.LinearDashpot.from_restitution(random.uniform(0.5, 0.9), 5e7, pair=pair) for pair in scene.pairs]
        report = gr.compare(scene, law, until=gr.until.contact(0, 2))
        first = report.soft.of(0)[0]
        run = gr.md.simulate(scene, law, t_end=float(first["t_end"]),
                             samples=np.linspace(first["t_begin"], first["t_end"], 4001))
        pressed = np.where(run.force[:, 1] > 0.0, run.force[:, 0], 0.0)
        expected = np.trapezoid(pressed, run.time) / np.trapezoid(run.force[:, 0], run.time)
        assert further.floor_share(report) == pytest.approx(expected, abs=5e-4)
        share = further.floor_share(report)
        assert f"share of the floor's impulse with a load on ball 1    = {share:.4g}" in report.details()
    far = gr.compare(scene.replace(gap=[scene.gap[0], 0.5]), law, until=gr.until.contact(0, 2))
    assert further.floor_share(far) == 0.0
    row = gr.compare(gr.scenes.newtons_cradle(3), gr.LinearDashpot(1e7), until=gr.until.separated())
    assert math.isnan(further.floor_share(row))
    assert "floor's impulse" not in row.details()

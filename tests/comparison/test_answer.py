"""The answer of a comparison: which contacts count, what is rounding, what is left at the end time, when it is Yes."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.comparison import align, further
from granular.comparison.outcome import differences


def test_verdict_and_certificate_agree():
    scene = gr.scenes.three_balls(gap=1e-2)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    far = gr.compare(scene, law, until=gr.until.contact(0, 2))
    assert "certified: all 2 contacts isolated" in far.details()
    assert far.verdict.startswith("Yes: every contact is binary (certified), and")
    assert far.to_dict()["first_disturbed"] == [None, -1]
    rule = gr.compare(scene, law, gr.ConstantRestitution(0.5), until=gr.until.contact(0, 2))
    assert rule.verdict.endswith("of the fastest impact, though no contacts overlap in time.")
    stepped = gr.compare(scene, law, until=gr.until.contact(0, 2), method="verlet")
    assert "certified" not in stepped.details()
    assert stepped.to_dict()["isolated"] is None
    assert math.isnan(stepped.measures["isolated_share"])


@pytest.mark.parametrize("seed", range(6))
def test_isolated_contacts_are_those_that_share_no_time_with_a_neighbour(seed):
    gas = gr.cases.make("gas", n=30, seed=seed, restitution=1.0, stiffness=10.0 ** (2 + seed % 3))
    report = gr.compare(gas.scene, gas.law, t_end=10.0)
    shared = {row for overlap in report.overlaps for row in (overlap.lower, overlap.upper)}
    assert 0 < len(shared) < len(report.soft.contacts)
    assert report.soft.stats["isolated"] == len(report.soft.contacts) - len(shared)
    assert report.soft.first_disturbed[0] == report.overlaps[0].begin
    assert "binary" not in report.verdict


@pytest.mark.parametrize("gap", [5e-3, 1e-2, 2e-2, 5e-2])
def test_outcomes_agree_within_one_digit_that_is_no_smaller_than_the_error(gap):
    scene = gr.scenes.three_balls(gap=gap)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    report = gr.compare(scene, law, until=gr.until.contact(0, 2))
    said = re.search(r"within (\d*\.?\d*) % of", report.verdict)[1]
    assert len(said.strip("0.")) == 1
    assert report.error <= 0.01 * float(said) < 2.0 * report.error


def test_touching_cradle_has_no_unique_hard_sphere_answer():
    scene = gr.scenes.newtons_cradle(3)
    cradle = gr.compare(scene, gr.Hertz(1e9))
    np.testing.assert_allclose(cradle.hard.velocity[-1], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(cradle.soft.velocity[-1], [-0.071, 0.076, 0.995], atol=1e-3)
    assert cradle.verdict.startswith("Not uniquely")


def test_ongoing_contact_is_followed_to_its_end():
    scene = gr.scenes.three_balls(radii=(0.0105, 0.01), gap=1e-7)
    law = [gr.LinearDashpot.from_restitution(0.9, k=5e7, pair=p) for p in scene.pairs]
    begins = gr.md.simulate(scene, law, until=gr.until.contact(0, 2)).of(1)[0]["t_begin"]
    cut = gr.compare(scene, law, t_end=begins + 1e-6)
    assert cut.pairs[1].ongoing
    assert math.isfinite(cut.pairs[1].soft_v_rel)
    assert cut.pairs[1].soft_t_f > cut.soft.time[-1]


def test_measures_of_a_scene_without_contacts():
    apart = gr.Scene([1.0, 1.0], [0.1, 0.1], [1.0], [-1.0, 1.0])
    nothing = gr.compare(apart, gr.LinearDashpot(1e4))
    assert nothing.verdict == "Yes, trivially: nothing collides."
    assert "nothing collides" in str(nothing)
    assert math.isnan(nothing.measures["shared_impulse"])


def test_distance_counts_only_outcome_not_the_fall():
    scene = gr.scenes.bouncing_ball(height=1.0)
    one, two = (gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=t) for t in (0.5, 0.6))
    assert differences(one, two)[1] < 1e-12


def test_answer_that_hangs_on_the_tie_rule_is_not_called_chaos():
    cradle = gr.compare(gr.scenes.newtons_cradle(n=5), gr.Hertz(1e9), ties="newton")
    assert "tie rule" in cradle.verdict


def test_timing_at_the_end_time_is_not_an_error_of_outcome():
    scene = gr.scenes.bouncing_ball(height=1.0)
    law = gr.LinearDashpot(1e6)
    hit = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), max_events=2).contacts[1]["t_begin"]
    cut = gr.compare(scene, law, t_end=float(hit) + 1e-6)
    assert (cut.hard.count(0), cut.soft.count(0)) == (2, 1)
    assert [(p.hard_contacts, p.soft_contacts) for p in cut.pairs] == [(2, 2)]  # gone on with
    assert cut.answer is gr.Answer.yes


def test_soft_ball_below_the_floor_misses_its_next_contact():
    sunk = gr.compare(gr.scenes.bouncing_ball(1.0, 0.01), gr.LinearDashpot(1e-3), t_end=2.0)
    assert sunk.soft.position[-1][1] < -3.0
    assert sunk.verdict.startswith("No: pair floor–1 has 1 contact, not 2")  # it comes out of the floor after 11.3 s


@pytest.mark.parametrize(("scene", "k"), [(gr.scenes.three_balls(gap=1e-3), 1.0),
                                          (gr.scenes.column(3, gap=0.1, gravity=9.81), 0.1)])
def test_contact_longer_than_the_time_between_contacts_is_no(scene, k):
    assert gr.compare(scene, gr.LinearDashpot(k), t_end=1.0).answer is gr.Answer.no


@pytest.mark.parametrize("n", [3, 5, 30])
def test_contacts_at_the_speed_of_rounding_do_not_count(n):
    cradle = gr.compare(gr.scenes.newtons_cradle(n, gap=1e-3), gr.Hertz(1e9))
    assert len(cradle.soft.contacts) == n - 1 == len(cradle.counted[1].contacts)  # the engine itself leaves them out
    assert cradle.verdict.startswith("Yes: every contact is binary")
    assert all((p.hard_contacts, p.soft_contacts) == (1, 1) for p in cradle.pairs)
    assert all(p.soft_v_rel == pytest.approx(1.0, abs=1e-12) for p in cradle.pairs)
    assert cradle.to_dict()["rounding_contacts"] == {"hard": 0, "soft": 0}


def test_contacts_at_a_given_speed_of_rounding_are_left_out():
    scene = gr.Scene([1.0] * 4, [0.1] * 4, [1e-3, 1e-3, 1e-3], [1.0, 0.0, 1e-13, 0.0])
    report = gr.compare(scene, gr.Hertz(1e9))
    assert any(report.to_dict()["rounding_contacts"].values())
    assert "rounding errors, ignored" in str(report)


def test_impulse_shared_at_the_speed_of_rounding_does_not_count():
    cradle = gr.compare(gr.scenes.newtons_cradle(5, gap=1e-2), gr.LinearDashpot(1e9))
    assert cradle.measures["shared_impulse"] < 1e-14
    assert cradle.verdict.startswith("Yes: every contact is binary")


def test_contacts_of_touching_balls_are_not_taken_for_rounding():
    cradle = gr.compare(gr.scenes.newtons_cradle(3), gr.Hertz(1e9))
    assert cradle.soft.contacts["v_in"][1].tolist() == [0.0, 0.0]
    assert len(cradle.counted[1].contacts) == len(cradle.soft.contacts)


@pytest.mark.rotating
@pytest.mark.parametrize(("k", "verdict"), [
    (1e6, "Yes, trivially: nothing collides; soft spheres overlap by 5.67e-05 m under their weight."),
    (1e2, "No: nothing collides, but soft spheres sink"),
])
@pytest.mark.usefixtures("interpreted")
def test_weight_without_impact_has_its_own_verdict(k, verdict):
    stack = gr.Scene([math.inf, 1.0, 1.0, 1.0], [0.0, 0.1, 0.1, 0.1], [0.0] * 3, [0.0] * 4, gravity=9.81)
    assert gr.compare(stack, gr.LinearDashpot(k, 50.0), t_end=1.0).verdict.startswith(verdict)


def test_no_verdict_says_nan():
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=1e-10, pair=p) for p in scene.pairs]
    soft = gr.compare(scene, law, until=gr.until.contact(0, 2), t_end=3.2)
    assert soft.answer is gr.Answer.no  # hard spheres bounce, soft ones sink forever
    assert math.isnan(soft.pairs[0].soft_v_rel)
    assert "nan" not in soft.verdict


def test_contact_exactly_at_the_end_time_is_predictable():
    late = gr.compare(gr.scenes.newtons_cradle(2, 1.0, 0.5, speed=0.5), gr.Hertz(1e8), t_end=1.0)
    assert late.hard.count(0) == 1
    assert late.measures["predictability"] < 1e-11
    assert late.verdict.startswith("Yes: every contact is binary")


def test_collision_just_at_the_end_time_is_in_both_runs():
    """Rounding decides which of the two runs has it in its log."""
    scene = gr.scenes.newtons_cradle(2, 1.0, 0.5, speed=0.5)
    seen, not_yet = (gr.edmd.simulate(scene.replace(gap=scene.gap * by), gr.ConstantRestitution(0.5), t_end=1.0)
                     for by in (1.0 - 1e-12, 1.0 + 1e-12))
    assert (seen.count(0), not_yet.count(0)) == (1, 0)
    for runs in ((seen, not_yet), (not_yet, seen)):
        assert np.nanmax(differences(*runs)[0]) > 0.1
        assert np.nanmax(differences(*align.continue_past_end(*runs))[0]) == 0.0


def mirror_box(rng):
    """Balls between two walls or in free space that move as mirror images: most collisions are simultaneous."""
    half, middle, walls = int(rng.integers(1, 3)), rng.random() < 0.7, rng.random() < 0.6
    mass, gap, speed = (np.where(rng.random(half + 1) < 0.5, 1.0, rng.uniform(0.5, 2.0, half + 1)) for _ in range(3))
    masses = [*mass[:half], *mass[half:][:middle], *mass[half - 1 :: -1]]
    inner = [*gap[: half - 1], *[gap[half - 1]] * (1 + middle), *gap[: half - 1][::-1]]
    velocity = [*speed[:half], *[0.0] * middle, *-speed[half - 1 :: -1]]
    ends, outer, still = [[math.inf] * walls, [gap[half]] * walls, [0.0] * walls]
    return gr.Scene([*ends, *masses, *ends], [*still, *[0.1] * len(masses), *still], [*outer, *inner, *outer],
                    [*still, *velocity, *still])


@pytest.mark.rotating
def test_answer_at_the_instant_of_a_collision_is_the_answer_before_or_after_it():
    """The balls of mirror images collide at one instant, up to rounding. With an end there, some of these collisions
    may be missing in one run."""
    rng, changed = np.random.default_rng(2), 0
    for _ in range(40):
        scene, restitution, ties = mirror_box(rng), rng.choice([0.8, 1.0]), rng.choice(["left", "right", "poisson"])
        rule, law = gr.ConstantRestitution(restitution), [
            gr.LinearDashpot.from_restitution(restitution, k=1e10, pair=pair) for pair in scene.pairs]
        times = gr.edmd.simulate(scene, rule, t_end=6.0, max_events=12, ties=str(ties)).contacts["t_begin"]
        end = rng.choice(times[:6])
        before, at, after = (gr.compare(scene, law, rule, t_end=end * by, ties=str(ties)).answer
                             for by in (1.0 - 1e-6, 1.0, 1.0 + 1e-6))
        assert at in (before, after)
        changed += before is not after
    assert changed >= 5


def test_measures_do_not_hang_on_the_clock_nor_on_who_watches():
    """Another start of time under gravity; a train that goes along, wall and all."""
    drop = gr.scenes.three_balls()
    for start in (0.0, 5.0):
        run = gr.edmd.simulate(drop, gr.ConstantRestitution(0.8), t_start=start, until=gr.until.contact(0, 2))
        assert measures.impact_velocities(drop, run)[1:] == pytest.approx(-math.sqrt(2.0 * 9.81 * 0.5), rel=1e-14)
    thrown = gr.Scene([math.inf, 1.0, 0.5], [0.0, 0.1, 0.1], [0.1, 0.05], [0.0, -1.0, -1.2])
    for train in (0.0, 0.5):
        scene = thrown.replace(velocity=thrown.velocity + train)
        run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.8), until=gr.until.separated())
        assert run.count(1) > 0
        assert measures.mass_centre_restitution(run) == pytest.approx(0.575, rel=1e-13)


def test_contact_of_hard_spheres_alone_is_not_called_nothing():
    scene = gr.scenes.newtons_cradle(2, 1.0, 0.5, speed=0.5)
    hit = gr.compare(scene, gr.Hertz(1e8), t_end=1.0)
    missed = replace(hit, soft=gr.md.simulate(scene, gr.Hertz(1e8), t_end=1.0 - 1e-15))
    assert not len(missed.soft.contacts)
    assert missed.answer is gr.Answer.yes  # it comes, a little later
    away = gr.md.simulate(scene.replace(velocity=scene.velocity[::-1]), gr.Hertz(1e8), t_end=1.0)
    alone = replace(hit, soft=away)
    assert alone.verdict.startswith("No: pair 0–1 has 0 contacts, not 1")


@pytest.mark.parametrize(("restitution", "k"), [(0.2, 1e5), (0.5, 1e7), (0.8, 1e6)])
def test_an_end_far_beyond_a_collapse_changes_nothing(restitution, k):
    """The run goes on at rest until t_end; lag, row and remedies belong to the time of the collapse."""
    scene = gr.scenes.bouncing_ball(height=1.0)
    law = gr.LinearDashpot.from_restitution(restitution, k, scene.pairs[0])
    one, other = (gr.compare(scene, law, t_end=t_end) for t_end in (None, 30.0))
    assert (other.hard.time[-1], other.hard.status) == (30.0, gr.Status.collapse)
    assert other.answer is one.answer is gr.Answer.yes
    assert (other.error, other.verdict) == (one.error, one.verdict)
    for name in ("lag", "distance", "predictability", "isolated_share"):
        assert other.measures[name] == pytest.approx(one.measures[name], abs=1e-12), name
    assert abs(one.measures["lag"]) < 0.01
    rows = [line.split()[:6] for report in (one, other) for line in str(report).splitlines() if "ended at" in line]
    assert rows[0][:5] == rows[1][:5]
    for row, again in zip(one.remedies().rows, other.remedies().rows, strict=True):
        if row.status != "max_events":  # what bounces forever is cut off without t_end
            assert (again.name, again.contacts, again.value) == (row.name, row.contacts, row.value)
            assert again.error == pytest.approx(row.error, rel=1e-9, abs=1e-12)


def test_apex_of_the_last_flight_is_that_of_the_continued_run(monkeypatch):
    """Stacks at random: the closed form against a run up to the apex."""
    rng, used = np.random.default_rng(5), 0
    for _ in range(12):
        n = int(rng.integers(2, 4))
        scene = gr.Scene([math.inf, *np.sort(rng.uniform(0.01, 1.0, n))[::-1]], [0.0, *[0.05] * n],
                         [rng.uniform(0.1, 1.0), *rng.choice([1e-4, 1e-2, 0.1], n - 1)], [0.0] * (n + 1), gravity=9.81)
        law = [gr.LinearDashpot.from_restitution(rng.uniform(0.6, 1.0), k=10.0 ** rng.uniform(5.0, 8.0), pair=pair)
               for pair in scene.pairs]
        report = gr.compare(scene, law, until=gr.until.contact(0, 2), t_end=5.0)
        known = [further._apex_of_last_flight(run, 1) is not None for run in (report.hard, report.soft)]
        rises = further.rises(report)
        with monkeypatch.context() as patch:
            patch.setattr(further, "_apex_of_last_flight", lambda run, bounce: None)
            assert rises == pytest.approx(further.rises(report), rel=1e-12, nan_ok=True)
        used += sum(known)
    assert used >= 4


@pytest.mark.rotating
@pytest.mark.parametrize("power", [1.0, 1.5])
def test_a_pull_that_is_cut_to_zero_is_no_contact_of_its_own(power):
    """Where the force begins below zero, an engine may log a contact without any force before the one that repels."""
    rng, without_force = np.random.default_rng(7), 0
    for _ in range(4):
        pull, k, mass = 10.0 ** rng.uniform(-13.0, -4.0), 10.0 ** rng.uniform(3.0, 6.0), rng.uniform(0.01, 1.0, 2)

        class Sticky:
            def force(self, xi, xi_dot, pair, k=k, pull=pull):
                return k * xi**power - pull

        scene = gr.Scene(mass, [0.001] * 2, [1e-3], [1.0, 0.0])
        report = gr.compare(scene, Sticky(), engine="plain")
        without_force += int((report.soft.contacts["impulse"] == 0.0).sum())
        assert report.answer is gr.Answer.yes, report.verdict
        assert (report.pairs[0].hard_contacts, report.pairs[0].soft_contacts) == (1, 1)
    assert without_force > 0 or power > 1.0  # at the start of F = k ξ^1.5 the engine steps over the pull

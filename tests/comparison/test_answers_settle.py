"""Answers that hang on nothing that must not matter: when a run was found to rest, what presses balls, what others do
later or far away, and which rows were kept."""

import math

import numpy as np
import pytest

import granular as gr

pytestmark = pytest.mark.usefixtures("interpreted")
INF = math.inf
ON_FLOOR = {"mass": [INF, 1.0], "radius": [0.0, 0.05], "gap": [0.0], "velocity": [0.0, 0.0]}


@pytest.mark.rotating
@pytest.mark.parametrize(("law", "answer"), [
    (gr.LinearDashpot(1e3, 200.0), gr.Answer.no), (gr.LinearDashpot(1.5e4, 20.0), gr.Answer.no),
    (gr.LinearDashpot(1e3, 5000.0), gr.Answer.no), (gr.LinearDashpot(1e5, 2000.0), gr.Answer.yes),
])
@pytest.mark.parametrize("height", [0.0, 0.1])
def test_a_ball_that_rests_sinks_as_far_as_it_will(law, answer, height) -> None:
    """9.81 N / k, of R = 5 cm; that it rests is known long before it has settled."""
    scene = gr.Scene(**ON_FLOOR | {"gap": [height]}, gravity=9.81)
    found = gr.compare(scene, law)
    assert found.soft.status is gr.Status.resting
    assert found.answer is answer is gr.compare(scene, law, t_end=20.0).answer
    assert gr.measures.static_overlaps(found.soft) == pytest.approx([9.81 / law.k], rel=1e-12)


@pytest.mark.rotating
def test_static_overlaps_are_those_of_a_run_that_has_settled() -> None:
    rng = np.random.default_rng(3)
    for law in (gr.LinearDashpot(1e4, 60.0), gr.ViscoelasticHertz(1e6, 4e4)):
        m = rng.uniform(0.5, 2.0, 3)
        scene = gr.Scene([INF, *m], [0.0, 0.1, 0.1, 0.1], [0.0] * 3, [0.0] * 4, 9.81,
                         external_force=[0.0, *rng.uniform(-3.0, 3.0, 3)])
        soft = gr.md.simulate(scene, law, t_end=60.0, max_steps=10**6)
        assert gr.measures.static_overlaps(soft) == pytest.approx(-soft.gap[-1], rel=1e-6)
    pressed = gr.Scene([1.0, 2.0, 1.0], [0.1] * 3, [0.0, 0.0], [0.0] * 3, external_force=[5.0, 0.0, -2.0])
    soft = gr.md.simulate(pressed, gr.LinearDashpot(1e4, 60.0), t_end=30.0)
    assert gr.measures.static_overlaps(soft) == pytest.approx(-soft.gap[-1], rel=1e-6)
    assert np.isnan(gr.measures.static_overlaps(gr.md.simulate(gr.scenes.newtons_cradle(3), gr.Hertz(1e9)))).all()


def test_a_force_presses_as_weight_does() -> None:
    law = gr.LinearDashpot(1e3, 20.0)
    scenes = [gr.Scene(**ON_FLOOR, gravity=9.81), gr.Scene(**ON_FLOOR, external_force=[0.0, -9.81]),
              gr.Scene([1.0, 1.0], [0.05, 0.05], [0.1], [0.0, 0.0], external_force=[9.81, -9.81])]
    found = [gr.compare(scene, law) for scene in scenes]
    assert [one.answer for one in found] == [gr.Answer.no] * 3
    assert "under the applied forces" in found[1].verdict


class Dent:
    """It is five times as stiff on the way back."""

    memory = True

    def force(self, xi, xi_dot, pair, xi_max):
        return min(1e5 * xi, max(1e5 * xi_max - 5e5 * (xi_max - xi), 0.0)) + 5.0 * xi_dot


@pytest.mark.rotating
@pytest.mark.parametrize(("gap", "law"), [
    (1e-5, gr.LinearDashpot.from_restitution(0.7, k=0.981 / 8e-5, pair=gr.Pair(0.1, 0.01, 0))),
    (0.0, gr.LinearDashpot(1.01e4, 1.0)), pytest.param(0.05, Dent(), marks=pytest.mark.soak),
])
def test_the_largest_overlap_counts_with_an_end_or_without(gap, law) -> None:
    """Statically they would sink by 0.8, 1.0 and less than 1 % of a radius."""
    scene = gr.Scene([INF, 0.1], [0.0, 0.01 if gap < 0.01 else 5e-4], [gap], [0.0, 0.0], 9.81)
    assert [gr.compare(scene, law, t_end=end).answer for end in (None, 20.0)] == [gr.Answer.no] * 2


@pytest.mark.rotating
def test_a_contact_cut_in_its_middle_is_waited_for() -> None:
    scene = gr.Scene([INF, 0.1], [0.0, 0.01], [1e-3], [0.0, 0.0], 9.81)
    law = gr.LinearDashpot.from_restitution(0.9, k=1e8, pair=scene.pairs[0])
    log = gr.compare(scene, law).soft.contacts
    for row in log[-6:]:
        end = float(row["t_begin"] + 0.5 * row["duration"])
        assert gr.compare(scene, law, t_end=end).answer is gr.Answer.yes


def test_a_run_is_not_followed_to_where_its_walls_meet() -> None:
    scene = gr.Scene([INF, 1.0, INF], [0.0, 0.05, 0.0], [0.1, 0.1], [0.1, 0.3, 0.0])
    assert gr.compare(scene, gr.LinearDashpot(1e3, 1.0), t_end=1.8).answer is gr.Answer.undecided


@pytest.mark.parametrize("seed", range(12))
def test_a_ball_far_away_changes_nothing(seed) -> None:
    rng = np.random.default_rng(seed)
    gap, v = [float(10.0 ** rng.uniform(-9, -6)), 0.0], rng.normal(size=3)
    law = gr.LinearDashpot(1e7, 50.0)
    near = gr.compare(gr.Scene([1.0, 2.0, 1.0], [0.05] * 3, gap, v), law)
    far = gr.compare(gr.Scene([1.0, 2.0, 1.0, 1.0], [0.05] * 4, [*gap, 1e4], [*v, 5.0]), law)
    assert (near.answer, near.verdict) == (far.answer, far.verdict)


# --- rows


@pytest.mark.parametrize("merged", [{}, {"collapse": "merge", "merge_below": 0.1}])
@pytest.mark.parametrize("seed", range(3))
def test_what_happens_after_the_end_decides_nothing_about_balls_at_rest(seed, merged) -> None:
    """A ball that falls on one at rest, soon after the end or a long time: either engine may have fewer bounces."""
    rng = np.random.default_rng(seed)
    t_end, eps, speed = float(rng.uniform(0.7, 0.9)), float(rng.uniform(0.2, 0.5)), [0.0] * 3

    def found(gap):
        scene = gr.Scene([INF, 1.0, 0.01], [0.0, 0.05, 0.05], [0.2, gap], speed, gravity=9.81)
        law = [gr.LinearDashpot.from_restitution(eps, 1e9, pair) for pair in scene.pairs]
        return gr.compare(scene, law, t_end=t_end, **merged)

    soon, late = found(0.5 * 9.81 * (t_end + rng.uniform(0.1, 0.6)) ** 2), found(500.0)
    assert soon.answer is late.answer
    assert soon.error == pytest.approx(late.error, rel=1e-6)


@pytest.mark.rotating
@pytest.mark.parametrize(("mass", "gap", "velocity", "t_end"), [
    ([INF, 2.0, 1.0, 1.0], [0.1, 0.0, 0.0], [0.0, -1.0, -1.0, -1.0], 0.39),
    ([INF, 1.0, 1.0, 1.0, INF], [0.1, 0.0, 0.0, 0.1], [0.0] * 5, 0.6),
])
def test_balls_that_come_to_rest_by_turns_have_no_unique_answer_in_a_mirror_either(mass, gap, velocity, t_end) -> None:
    radius, found = [0.0 if math.isinf(m) else 0.05 for m in mass], []
    for way in (1, -1):
        force = [0.0 if math.isinf(m) else -9.81 * way * m for m in mass]
        scene = gr.Scene(mass[::way], radius[::way], gap[::way], np.multiply(way, velocity)[::way],
                         external_force=force[::way])
        law = [gr.LinearDashpot.from_restitution(0.5, 1e9, pair) for pair in scene.pairs]
        found.append(gr.compare(scene, law, t_end=t_end, collapse="merge", merge_below=0.1))
    assert [one.answer for one in found] == [gr.Answer.not_unique] * 2


def falling(engine, **options):
    scene = gr.Scene([INF, 0.6, 0.06], [0.0, 0.12, 0.03], [0.1, 1e-3], [0.0] * 3, 9.81)
    if engine == "hard":
        return gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), **options)
    return gr.md.simulate(scene, gr.ViscoelasticHertz(1e7, 1e3), **options)


@pytest.mark.parametrize("engine", ["hard", "soft"])
@pytest.mark.parametrize("samples", [[0.0], [0.0, 0.05, 0.1], [0.0, 0.05]])
def test_a_run_goes_on_from_its_end_whatever_rows_it_kept(engine, samples, tmp_path) -> None:
    resume = gr.edmd.resume if engine == "hard" else gr.md.resume
    part, whole = falling(engine, t_end=0.26, samples=samples), falling(engine, t_end=0.3, samples=[0.26, 0.3])
    part.save(tmp_path / "part.npz")
    for before in (part, gr.load(tmp_path / "part.npz")):
        later = resume(before, t_end=0.3, samples=[0.26, 0.3])
        assert np.array_equal(later.gap, whole.gap)
        assert np.array_equal(later.velocity, whole.velocity)
        with pytest.raises(ValueError, match=r"samples"):
            resume(before, t_end=0.3, samples=[0.1, 0.3])


def test_rows_do_not_change_what_a_sweep_says() -> None:
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    names = ("energy_left", "v_final", "time", "contacts", "hard_energy_left")
    few, all_rows = (gr.sweep(gr.Case(scene, law, t_end=0.4, run=run), {"gravity": [9.81]}, names)
                     for run in ({"samples": [0.0, 0.1]}, {}))
    assert all(np.array_equal(few[name], all_rows[name]) for name in names)


@pytest.mark.parametrize("engine", ["hard", "soft"])
def test_the_account_of_a_run_that_went_on_closes(engine) -> None:
    floor = gr.walls.Sine(amplitude=1e-3, frequency=30.0)
    scene = gr.Scene([INF, 0.6, 0.06], [0.0, 0.12, 0.03], [0.1, 1e-3], [0.0] * 3, 9.81, floor=floor)
    if engine == "hard":
        run = gr.edmd.resume(gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=0.2), t_end=0.9)
    else:
        run = gr.md.resume(gr.md.simulate(scene, gr.ViscoelasticHertz(1e7, 1e3), t_end=0.2), t_end=0.9)
    parts = gr.measures.balance(run)
    assert abs(parts["remainder"]) < 1e-12 * parts["start"]


def test_measures_know_what_the_log_lacks() -> None:
    scene = gr.Scene([1.0] * 4, [0.01] * 4, [0.01, 0.0, 0.1], [1.0, 0.0, 0.0, 0.95])
    law = gr.LinearDashpot(1e6)
    assert math.isnan(gr.measures.shared_impulse(gr.md.resume(gr.md.simulate(scene, law, t_end=0.05), t_end=30.0)))
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=1.0)
    assert gr.measures.shared_impulse(hard) == 0.0
    assert math.isnan(gr.measures.occupation(gr.md.simulate(scene, law, t_end=1.0, log=False)))
    late = gr.md.simulate(gr.scenes.three_balls(), gr.LinearDashpot(5e7, 100.0), t_end=0.4, samples=[0.35, 0.4])
    assert math.isnan(gr.measures.mass_centre_restitution(late))
    between = gr.Scene([INF, 1.0, INF], [0.0, 0.1, 0.0], [0.1, 0.2], [0.1, -1.0, -0.05])
    for run in (gr.edmd.resume(gr.edmd.simulate(between, gr.ConstantRestitution(0.9), t_end=0.15), t_end=0.2),
                gr.md.resume(gr.md.simulate(between, gr.LinearDashpot(1e5, 9.0), t_end=0.15), t_end=0.2)):
        assert len(run.contacts) == 0
        assert not run.account()["momentum"][-1].any()


# --- other fronts


def test_strings_pull_small_swings_back() -> None:
    scene = gr.Scene([1.0, 2.0], [0.1, 0.1], [-1e-3], [0.0, 0.0], pendulum=30.0, rest_gap=[0.0])
    assert gr.waves.modes(scene, gr.LinearDashpot(1e3)) == pytest.approx([30.0, math.sqrt(900.0 + 1500.0)], rel=1e-9)


def test_a_run_of_other_masses_is_of_another_scene() -> None:
    law = gr.LinearDashpot(1.0)
    runs = {m: gr.compare(gr.Scene([m, m], [1e-3] * 2, [1e-3], [1.0, 0.0]), law) for m in (1e-9, 9e-9)}
    with pytest.raises(ValueError, match="of the same scene: its mass"):
        runs[1e-9].against(runs[9e-9].soft)


def test_balls_that_lie_still_rise_nowhere() -> None:
    found = gr.compare(gr.Scene(**ON_FLOOR, gravity=9.81), gr.LinearDashpot(1e5, 5.0), t_end=2.0)
    assert found.rises[0] == 0.0


class Own:
    def force(self, xi, xi_dot, pair):
        return 1e6 * xi + 30.0 * xi_dot


def test_stability_of_a_law_without_numbers_tells_what_it_leaves_out() -> None:
    case = gr.Case(gr.Scene([1.0, 1.0], [0.05] * 2, [0.01], [1.0, 0.0]), Own(), t_end=0.05)
    found = gr.stability(case, methods=("located",))
    assert any("`law` must be a dataclass" in words for words in found.left_out.values())

"""The main job: one scene under both engines, and the discrepancy."""

import json
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.comparison import further
from granular.comparison.report import warnings
from granular.outcome import differences


@pytest.fixture(scope="module")
def report():
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    return gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))


def test_three_balls_of_the_paper(report):
    floor, top = report.pairs
    assert (floor.hard_contacts, floor.soft_contacts) == (1, 1)
    assert (top.hard_contacts, top.soft_contacts) == (1, 4)
    assert top.hard_v_rel == pytest.approx(3.7271894236810663, rel=1e-13)
    assert top.soft_v_rel == pytest.approx(0.17728241069, rel=1e-3)
    assert report.restitution_ratio == pytest.approx(0.0767377994, rel=1e-3)
    assert report.verdict.startswith("No: pair 1 has 4 contacts, not 1")


def test_every_contact_of_the_upper_pair_overlaps_the_floor_contact(report):
    assert len(report.overlaps) == 4
    log = report.soft.contacts
    for overlap in report.overlaps:
        assert (log[overlap.lower]["pair"], log[overlap.upper]["pair"]) == (0, 1)
        assert overlap.end - overlap.begin == pytest.approx(log[overlap.upper]["duration"], rel=1e-9)
    assert report.measures["crowding"] == 1.0
    assert 0.13 < report.measures["shared_impulse"] < 0.15


def test_report_certifies_isolated_contacts(report):
    log = report.soft.contacts
    first = report.overlaps[0]
    assert report.soft.first_disturbed == (log["t_begin"][first.upper], 0)
    when = f"pairs 0 and 1 at t = {first.begin:.9g} s"
    assert f"certified: 0 of 5 contacts isolated; the first disturbed: {when}" in report.details()
    said = report.to_dict()
    assert (said["isolated"], said["contacts"]) == (0, 5)
    assert said["first_disturbed"] == [first.begin, 0]
    assert said["measures"]["isolated_share"] == report.measures["isolated_share"] == 0.0


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


def test_effective_restitution_by_root_is_the_closed_form(report):
    (eps,) = report.effective_restitution()
    assert eps == pytest.approx(0.7 * report.restitution_ratio, rel=1e-9)
    assert report.effective_restitution(lambda run: float(run.count(1))) == ()  # EDMD has one contact for any ε


@pytest.mark.parametrize("gap", [5e-3, 1e-2, 2e-2, 5e-2])
def test_outcomes_agree_within_one_digit_that_is_no_smaller_than_the_error(gap):
    scene = gr.scenes.three_balls(gap=gap)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    report = gr.compare(scene, law, until=gr.until.contact(0, 2))
    said = re.search(r"within (\d*\.?0*[1-9]) of", report.verdict)[1]
    assert report.error <= float(said) < 2.0 * report.error


def test_touching_cradle_has_no_unique_hard_sphere_answer():
    scene = gr.scenes.newtons_cradle(3)
    cradle = gr.compare(scene, gr.Hertz(1e9))
    np.testing.assert_allclose(cradle.hard.velocity[-1], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(cradle.soft.velocity[-1], [-0.071, 0.076, 0.995], atol=1e-3)
    assert cradle.verdict.startswith("Not uniquely")


def test_what_cannot_be_predicted_is_told_from_a_wrong_model(report):
    shifted = report.scene.replace(gap=report.scene.gap * [1.0, 200.0])
    lost = replace(report)
    vars(lost)["twin"] = gr.edmd.simulate(shifted, gr.ConstantRestitution(1.0), until=report.until)
    assert lost.measures["predictability"] > 0.01
    assert "compare ensembles" in lost.verdict


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


def test_table_reads_well(report):
    text = report.details()
    for line in ("hard spheres    soft spheres", "contacts of pair 1                   1               4",
                 "Why: 4 contacts overlap in time", "φ   = 0.14"):
        assert line in text
    assert max(map(len, text.splitlines())) <= 120
    assert text.splitlines()[0] == str(report).splitlines()[0] == report.verdict


@pytest.mark.parametrize("name", ["three-balls", "newtons-cradle", "ball-stack", "bouncing-ball", "heated-gas"])
def test_what_one_needs_is_within_twenty_lines(name):
    report = gr.cases.make(name, **({"n": 8, "t_end": 0.5} if name == "heated-gas" else {}))
    report = gr.compare(report.scene, report.physics("md"), until=report.until, t_end=report.t_end)
    first, *lines, last = str(report).splitlines()
    assert first == report.verdict
    assert last.endswith("report.details().")
    assert len(lines) <= 18
    own = [line for line in lines if line not in report.details().splitlines()]
    assert all(line.startswith(("Scene(", "(")) for line in own)


def test_warnings_are_one_line_of_what_one_needs():
    scene, end = gr.scenes.three_balls(density=9e6), gr.until.contact(0, 2)
    report = gr.compare(scene, gr.LinearDashpot(5e7, 100.0), gr.ConstantRestitution(0.5), until=end)
    first, *more = warnings(report)
    assert more
    assert f"\nwarning: {first} (and {len(more)} more)\n" in str(report)
    assert len(str(report).splitlines()) <= 20
    assert report.details().splitlines()[-len(more) - 1 :] == [f"warning: {one}" for one in (first, *more)]


@pytest.mark.parametrize("seed", range(8))
def test_pairs_that_are_shown_differ_most(seed):
    rng = np.random.default_rng(seed)
    scene = gr.Scene([1.0] * 7, [0.1] * 7, rng.uniform(0.0, 1e-3, 6), rng.normal(0.0, 1.0, 7))
    report = gr.compare(scene, gr.LinearDashpot.from_restitution(0.8, k=1e6, pair=scene.pairs[0]))
    shown = {int(pair) for pair in re.findall(r"^contacts of pair (\d+)", str(report), re.MULTILINE)}
    assert "(4 more pairs, which differ less)" in str(report)
    other = {p.pair for p in report.pairs if p.soft_contacts != p.hard_contacts}
    assert len(shown & other) == min(2, len(other))
    for group in (other, set(range(6)) - other):
        far = {p.pair: abs(p.soft_v_rel - p.hard_v_rel) for p in report.pairs if p.pair in group}
        assert all(far[c] >= far[d] for c in group & shown for d in group - shown if far[d] == far[d])


def test_json_is_whole_and_strict(report, tmp_path):
    path = tmp_path / "report.json"
    report.to_json(path)
    numbers = json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    assert numbers["pairs"][1]["soft_contacts"] == 4
    assert numbers["provenance"]["versions"]["numpy"] == np.__version__
    assert numbers["scene"]["mass"][0] == "inf"
    with pytest.raises(OSError, match=r"output path is .*writable place is needed"):
        report.to_json(tmp_path / "no" / "such" / "folder.json")
    assert list(tmp_path.iterdir()) == [path]


def test_figure_is_drawn(report, tmp_path):
    report.plot(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    figure = gr.compare(gr.scenes.newtons_cradle(9), gr.Hertz(1e9)).plot()
    assert "pair" in {axis.get_ylabel() for axis in figure.axes}


def test_distance_counts_only_outcome_not_the_fall():
    scene = gr.scenes.bouncing_ball(height=1.0)
    one, two = (gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=t) for t in (0.5, 0.6))
    assert differences(one, two)[0][1] < 1e-12


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
    assert sunk.verdict.startswith("No: pair 0 has 1 contact, not 2")  # it comes out of the floor after 11.3 s


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
    assert "left out as rounding" in str(report)


def test_impulse_shared_at_the_speed_of_rounding_does_not_count():
    cradle = gr.compare(gr.scenes.newtons_cradle(5, gap=1e-2), gr.LinearDashpot(1e9))
    assert cradle.measures["shared_impulse"] < 1e-14
    assert cradle.verdict.startswith("Yes: every contact is binary")


def test_contacts_of_touching_balls_are_not_taken_for_rounding():
    cradle = gr.compare(gr.scenes.newtons_cradle(3), gr.Hertz(1e9))
    assert cradle.soft.contacts["v_in"][1].tolist() == [0.0, 0.0]
    assert len(cradle.counted[1].contacts) == len(cradle.soft.contacts)


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


def test_what_happens_just_at_the_end_time_tells_no_runs_apart():
    """Whichever of the two still sees it."""
    scene = gr.scenes.newtons_cradle(2, 1.0, 0.5, speed=0.5)
    seen, not_yet = (gr.edmd.simulate(scene.replace(gap=scene.gap * by), gr.ConstantRestitution(0.5), t_end=1.0)
                     for by in (1.0 - 1e-12, 1.0 + 1e-12))
    assert (seen.count(0), not_yet.count(0)) == (1, 0)
    for runs in ((seen, not_yet), (not_yet, seen)):
        assert np.nanmax(differences(*runs)[0]) > 0.1
        assert np.nanmax(differences(*measures.before_the_end(*runs))[0]) == 0.0


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
    assert alone.verdict.startswith("No: pair 0 has 0 contacts, not 1")


@dataclass(frozen=True)
class Active:
    k: float = 1e6

    def force(self, xi, xi_dot, pair):
        return (self.k - 5e4 * xi_dot) * xi


def test_law_that_gives_no_rule_is_named_rather_than_a_rule():
    scene = gr.scenes.newtons_cradle(2, 1.0, 0.5, speed=0.5)
    with pytest.raises(ValueError, match=r"law of pair 0 is Active.*and so gains energy"):
        gr.compare(scene, Active(), t_end=2.0)


@pytest.fixture(scope="module")
def gas():
    scene = gr.scenes.gas(6)
    law = [gr.LinearDashpot.from_restitution(0.9, k=5e7, pair=p) for p in scene.pairs]
    return gr.compare(scene, law, t_end=150.0)


def test_figure_shows_contacts_however_short_beside_its_span(gas):
    timeline, forces = gas.plot().axes[:2]
    (ticks,) = (c for c in timeline.collections if hasattr(c, "get_segments"))
    assert ticks.get_linewidths()[0] >= 1.5
    assert len(ticks.get_segments()) == len(gas.soft.contacts)
    low, high = forces.images[0].get_clim()
    assert low == 0.0
    assert forces.images[0].get_array().max() == high > 0.0
    assert high * 1e3 == pytest.approx(gas.soft.contacts["force_max"].max(), rel=1e-12)  # in kN


@pytest.mark.thirds
def test_force_map_loses_no_contact_of_very_many():
    busy = gr.compare(gr.scenes.gas(40), gr.LinearDashpot(1e12), t_end=200.0)
    log = busy.soft.contacts
    assert len(log) > 2000
    shown = np.asarray(busy.plot().axes[1].images[0].get_array())
    assert shown.max() * 1e6 == pytest.approx(log["force_max"].max(), rel=1e-12)  # in MN
    for c in range(busy.scene.n - 1):
        assert shown[c].max() * 1e6 == pytest.approx(busy.soft.of(c)["force_max"].max(), rel=1e-12)


def test_time_axis_begins_with_the_run_at_the_earliest(gas):
    assert {axis.get_xlabel() for axis in gas.plot().axes} == {"", "time, s"}


def test_force_curve_meets_contacts_shorter_than_its_samples():
    ball = gr.compare(gr.scenes.bouncing_ball(height=1.0), gr.LinearDashpot(1e12), t_end=3.0)
    curve = ball.plot().axes[1].lines[0].get_ydata()
    assert np.count_nonzero(np.diff((curve > 0.0).astype(int)) == 1) == len(ball.soft.contacts)


def test_time_axis_ends_with_the_last_contact_that_counts():
    from granular.comparison.view import window

    view = window(gr.compare(gr.scenes.newtons_cradle(5, gap=1e-3), gr.Hertz(1e9)))
    assert 0.0 <= view.begin < view.end < 0.1


def test_hard_balls_fly_on_to_the_end_of_the_axis():
    cradle = gr.compare(gr.scenes.newtons_cradle(5), gr.Hertz(1e9), until=gr.until.separated())
    assert cradle.hard.time[-1] == 0.0
    paths = next(axis for axis in cradle.plot().axes if axis.get_ylabel().startswith("paths"))
    hard = [line for line in paths.lines if line.get_linestyle() == "--" and len(line.get_xdata()) > 2]
    assert len(hard) == 5
    for line, velocity in zip(hard, cradle.hard.velocity[-1], strict=True):
        t, x = line.get_xdata(), line.get_ydata()  # µs or ms, µm or mm
        assert t[-1] > 0.95 * paths.get_xlim()[1]
        assert (abs(x[-1] - x[0]) < 1e-9) == (velocity == 0.0)  # but for rounding, 1e-17 m


def test_hard_marks_at_the_start_are_not_cut():
    from granular.comparison.view import window

    cradle = gr.compare(gr.scenes.newtons_cradle(5), gr.Hertz(1e9), until=gr.until.separated())
    assert window(cradle).begin == 0.0 == cradle.hard.contacts["t_begin"].max()
    assert cradle.plot().axes[0].get_xlim()[0] < 0.0


@pytest.mark.thirds
def test_late_straggler_does_not_squeeze_the_picture():
    from granular.comparison.view import window

    scene = gr.scenes.chain(n=12, dimer=0.4)
    chain = gr.compare(scene, gr.TsujiHertz(2e10, 0.0), until=gr.until.separated())
    last = chain.soft.contacts["t_begin"].max()
    end = window(chain).end
    assert end < 0.2 * last
    assert chain.soft.of(0)["t_end"].max() < end
    assert chain.plot().axes[0].get_title(loc="right") == f"1 later contact, the last at t = {1e3 * last:.4g} ms ▸"


def test_plot_shows_the_tie_rule_of_the_run():
    from granular.comparison.further import with_rows

    cradle = gr.compare(gr.scenes.newtons_cradle(3), gr.Hertz(1e9), ties="poisson", until=gr.until.separated())
    again = with_rows(cradle, "hard", np.linspace(0.0, 1e-3, 5))
    assert again.velocity[-1].tolist() == cradle.hard.velocity[-1].tolist()


def test_hard_spheres_that_collapse_may_be_merged():
    """As in `edmd.simulate`; by default the run ends there, and the report says which."""
    row = gr.Scene([1.0] * 4, [0.0] * 4, [0.1, 0.2, 0.15], [1.0, 0.3, 0.0, -1.0])
    law = [gr.LinearDashpot.from_restitution(0.1, k=1e5, pair=pair) for pair in row.pairs]
    plain = gr.compare(row, law, t_end=2.0)
    assert plain.hard.status is gr.Status.collapse
    merged = gr.compare(row, law, t_end=2.0, collapse="merge", merge_below=1e-3)
    alone = gr.edmd.simulate(row, merged.rule, t_end=2.0, collapse="merge", merge_below=1e-3)
    assert merged.hard.status is gr.Status.time
    assert (merged.hard.velocity == alone.velocity).all()
    assert "hard collisions at less than 0.001 m/s were merged" in str(merged)
    assert "merged" not in plain.details()
    with pytest.raises(ValueError, match=r"merge_below is 0\.001: it needs collapse='merge'"):
        gr.compare(row, law, t_end=2.0, merge_below=1e-3)


def test_the_command_merges_too(granular):
    line = "compare vibrated-column --n 2 --restitution 0.5 --t-end 0.1 --collapse merge --merge-below 0.01 --json o"
    assert granular(line)[0] == 0
    assert json.loads(Path("o").read_text(encoding="utf-8"))["hard"]["stats"]["merge_below"] == 0.01


def test_a_root_beside_a_jump_is_found_whatever_rounding_says():
    from granular.comparison.further import roots

    grid = np.linspace(0.0, 1.0, 21)
    for rounding in (-3e-16, 0.0, 3e-16):  # at 0.95, and a jump upwards beyond
        found = roots(lambda x, r=rounding: math.nan if x == 0.0 else 2.0 if x > 0.96 else 0.95 - x + r, grid, 1.0)
        assert found == pytest.approx([0.95], abs=1e-12)


@pytest.mark.usefixtures("interpreted")
def test_a_rise_is_given_up_where_a_pile_takes_too_many_steps_to_settle(monkeypatch):
    """Before, the soft run was followed for minutes: steps, not contacts, are many."""
    monkeypatch.setattr(further, "STEPS", 3000)
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
@pytest.mark.parametrize("bounce", [1, 2, 3])
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
        assert "rise of ball 3, drops          21.7955         1.12327  of 1 m\n" in text
    assert math.isnan(gr.compare(gr.scenes.ball_stack(6), gr.LinearDashpot(1e7), until=gr.until.contact(0, 1)).drop)


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
        assert f"floor's impulse while pressed from above  = {further.floor_share(report):.4g}" in report.details()
    far = gr.compare(scene.replace(gap=[scene.gap[0], 0.5]), law, until=gr.until.contact(0, 2))
    assert further.floor_share(far) == 0.0
    row = gr.compare(gr.scenes.newtons_cradle(3), gr.LinearDashpot(1e7), until=gr.until.separated())
    assert math.isnan(further.floor_share(row))
    assert "floor's impulse" not in row.details()


SOLIDS = {"steel": (7850.0, 206e9, 0.3), "glass": (2500.0, 70e9, 0.22), "rubber": (1100.0, 5e6, 0.49),
          "tungsten carbide": (15_600.0, 600e9, 0.22), "ice": (917.0, 9e9, 0.33)}
"""Density in kg/m³, Young's modulus in Pa and Poisson's ratio."""


def of_solids(rng, mass=1.0, length=1.0, stress=1.0):
    """What a report says of two balls of one solid, or of real balls, whose numbers are in other units than SI."""
    radius, speed, gap = 10.0 ** rng.uniform(-3.5, -0.5, 2), 10.0 ** rng.uniform(-3.0, 1.0), 1e-3
    density, young, poisson = SOLIDS[rng.choice(list(SOLIDS))]
    m, law = 4.0 / 3.0 * math.pi * radius**3 * density, None
    if stress == 1.0 and rng.random() < 0.3:
        two = [gr.balls.BALLS[name] for name in rng.choice(list(gr.balls.BALLS), 2)]
        m, radius, law = np.array([b.mass for b in two]), np.array([b.radius for b in two]), two[0].stiffness * mass
    scene = gr.Scene(mass * m, length * radius, [length * gap], [length * speed, 0.0])
    law = gr.Hertz.from_material(stress * young, poisson, scene.pairs[0]) if law is None else gr.LinearDashpot(law)
    report = gr.compare(scene, law, until=gr.until.contact(0, 2), t_end=2.0 * gap / speed)
    return [w for w in warnings(report) if "solid" in w]


def test_solids_in_si_units_are_not_taken_for_others():
    rng = np.random.default_rng(6)
    assert not any(of_solids(rng) for _ in range(25))


@pytest.mark.parametrize(
    ("mass", "length", "stress", "words"),
    [(1.0, 1e3, 1e-9, "density of ball 0 (and of 1 more) is"), (1.0, 1e2, 1.0, "density of ball"),
     (1e3, 1.0, 1.0, "density of ball"), (1e-3, 1e3, 1.0, "density of ball")],
)
def test_numbers_in_other_units_are_warned_of_once(mass, length, stress, words):
    """mm with GPa; cm; grams; tonnes and mm."""
    rng = np.random.default_rng(7)
    for _ in range(3):
        (said,) = of_solids(rng, mass, length, stress)
        assert words in said
        assert said.endswith("which no solid has: are radii in m and masses in kg?")


def test_a_contact_faster_than_sound_in_solids_is_warned_of():
    """Grams and cm with a modulus in Pa: a density that aerogels have; points have neither, and can say nothing."""
    scene = gr.Scene([32.9] * 3, [1.0] * 3, [0.1] * 2, [100.0, 0.0, 0.0])
    report = gr.compare(scene, gr.Hertz.from_material(206e9, 0.3, scene.pairs[0]), t_end=0.1)
    (line,) = (line for line in str(report).splitlines() if line.startswith("warning: "))
    assert line in report.details()
    assert line == ("warning: waves in the contact of pair 0 (and of 1 more) run at 5.3e+04 m/s, faster than sound in "
                    "any solid: is its stiffness in SI units?")
    points = gr.compare(scene.replace(radius=[0.0] * 3), gr.LinearDashpot(1e12), t_end=0.1)
    assert warnings(points) == []
    still = gr.compare(scene.replace(velocity=[0.0] * 3), gr.LinearDashpot(1e12), t_end=0.1)
    assert warnings(still) == []

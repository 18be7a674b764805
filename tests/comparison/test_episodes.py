"""Episodes and the error against plain loops, on random scenes; scenes whose answer is known."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular.comparison.episodes import _groups, episodes
from granular.comparison.outcome import separation_speeds
from tests.helpers.drawn_reports import INF, drawn
from tests.helpers.error_by_hand import ByHand, contacts_of, episodes as by_loops
from tests.helpers.judge import Judge
from tests.helpers.scenes_of_outcomes import BounceThreshold, ring_whose_episode_hides_a_wrong_flight
from tests.helpers.scenes_to_judge import KINDS


@pytest.mark.rotating
@pytest.mark.parametrize("kind", KINDS)
def test_error_and_episodes_are_those_of_plain_loops(kind):
    known = linked = 0
    for seed in range(700, 708):
        report = drawn(kind, seed)
        if math.isnan(report.error) or len(report.soft.contacts) > 120:
            continue
        hand = ByHand(report)
        for j in range(report.components.count):
            if report.lying[j]:
                continue
            pairs = np.flatnonzero(report.components.of_pair == j).tolist()
            expected = hand.error_of(pairs, float(report.units[j]))
            assert report.errors[j] == pytest.approx(expected, rel=1e-6, abs=1e-9), (kind, seed)
            known += 1
        one = report.deciding
        if one is not None:
            found = [(e.velocities, e.times) for e in hand.entries if (e.ball, e.episode) == (one.ball, one.episode)]
            assert ((one.hard_velocity, one.soft_velocity), [one.hard_t, one.soft_t]) in found
            linked += one.contacts > 1
    assert known > 2
    assert linked or kind not in ("free", "floor", "box", "drop", "touching")


@pytest.mark.parametrize("seed", range(8))
def test_episodes_of_any_log_are_those_of_plain_loops(seed):
    """Intervals at random: on a line, between walls, on rings of two and more, with ties and contacts without end."""
    rng = np.random.default_rng(seed)
    n, ring = int(rng.integers(2, 7)), bool(rng.random() < 0.4)
    mass = [1.0] * n if ring else [INF, *[1.0] * n, INF]
    scene = gr.Scene(mass, [0.0] * len(mass), [1.0] * (n if ring else n + 1), [0.0] * len(mass), ring=ring)
    rows = []
    for pair in range(scene.n_pairs):
        edges = np.cumsum(rng.exponential(1.0, 2 * int(rng.integers(0, 9))))
        edges = np.round(edges, int(rng.integers(0, 4)))  # ties
        rows += [(pair, a, b) for a, b in edges.reshape(-1, 2) if b > a]
    log = np.zeros(len(rows), gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=1.0).contacts.dtype)
    log["pair"], log["t_begin"], log["t_end"] = np.array(rows).T if rows else np.zeros((3, 0))
    for pair in range(scene.n_pairs):
        last = np.flatnonzero(log["pair"] == pair)[-1:]
        log["t_end"][last[rng.random(len(last)) < 0.3]] = math.nan
    run = replace(gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=1.0),
                  contacts=log[np.argsort(log["t_begin"], kind="stable")])
    compared = rng.random(len(log)) < 0.9
    contacts = contacts_of(run)
    left_out = {c[:2] for c, keep in zip(contacts, compared, strict=True) if not keep}
    assert episodes(run, compared).tolist() == by_loops(scene, contacts, left_out)


def test_groups_of_a_long_chain_of_links_take_few_rounds():
    rng = np.random.default_rng(1)
    for one in (np.arange(99_999), rng.permutation(99_999)):
        began = time.process_time()
        assert not _groups(100_000, one, one + 1).any()
        assert time.process_time() - began < 5.0


def test_time_of_episodes_is_about_linear_in_the_number_of_contacts():
    took = []
    for n in (30_000, 120_000):
        scene = gr.Scene([1.0] * 301, [0.0] * 301, [1.0] * 300, [0.0] * 301)
        run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=1.0)
        log = np.zeros(n, run.contacts.dtype)
        log["pair"], log["t_begin"] = np.arange(n) % 300, np.arange(n) // 300 + np.random.default_rng(n).random(n)
        log = log[np.argsort(log["t_begin"])]
        log["t_end"] = log["t_begin"] + 1e-3
        began = time.process_time()
        assert episodes(replace(run, contacts=log), np.ones(n, bool)).max() > n // 2
        took.append(time.process_time() - began)
    assert took[1] < 20.0 * took[0] + 0.1


def dashpots(scene, *constants):
    """A dashpot of each pair with this restitution and stiffness."""
    return [gr.LinearDashpot.from_restitution(e, k=k, pair=p) for (e, k), p in zip(constants, scene.pairs, strict=True)]


def test_an_intermediate_state_of_an_episode_does_not_decide():
    """Basketball and tennis ball: the basketball is faster before it meets the tennis ball, and nobody sees that."""
    case = gr.cases.make("real-balls", lower="basketball", upper="tennis ball", pair_rule="lens", gap=0.0236,
                         height=1.0)
    report = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
    assert report.answer is gr.Answer.yes
    assert report.error == pytest.approx(0.00962, abs=1e-5)
    one = report.deciding
    assert (one.ball, one.pairs, one.contacts) == (1, (0, 1), 2)
    assert (one.hard_velocity, one.soft_velocity) == pytest.approx((2.379, 2.457), abs=1e-3)


def test_a_free_flight_between_two_episodes_does_decide():
    """A damped wall stops what flies back too fast: its speed after the last contact tells nothing."""
    scene = gr.Scene([INF, 0.24, 0.93, INF], [0, 0.1, 0.1, 0], [0.2, 1e-4, 0.125], [0, 0.85, 0.97, 0])
    report = gr.compare(scene, dashpots(scene, (0.02, 1.5e5), (0.9, 1.5e5), (0.02, 1.5e5)), t_end=1.5)
    assert [p.hard_contacts for p in report.pairs] == [p.soft_contacts for p in report.pairs]
    assert report.verdict == ("No: ball 1 leaves at -0.698 instead of -0.463 m/s, "
                              "an error of 24 % of the fastest impact.")
    assert report.to_dict()["deciding"]["ball"] == 1


@pytest.mark.rotating
def test_balls_pressed_together_in_flight_are_compared_when_they_leave_a_wall():
    """They are in a contact without end, but rest on nothing: hard ones stay at the wall, soft ones bounce off."""
    scene = gr.Scene([INF, 1.0, 1.0], [0, 0.1, 0.1], [0.5, 0.1], [0, 0.0, -2.0], external_force=[0.0, 20.0, -20.0])
    law = [gr.LinearDashpot.from_restitution(0.95, k=1e3, pair=scene.pairs[0]), gr.LinearDashpot(1e6, 6.0 * 5e5**0.5)]
    report = gr.compare(scene, law, t_end=2.0)
    assert report.resting == {1: 0.0}
    assert not report.other_counts.any()
    assert report.answer is gr.Answer.no
    assert (report.deciding.ball, report.deciding.pairs) == (1, (0,))
    assert report.error == pytest.approx(0.24, abs=0.005)


def test_speeds_before_a_contact_without_end_are_compared_by_episodes():
    """Two balls that fall and come to rest: errors are those of what leaves, not of pairs within an episode."""
    rng, seen = np.random.default_rng(1_000_846), 0
    scene = gr.Scene([INF, *np.exp(rng.uniform(-2.5, 2.5, 2))], [0.0, 0.05, 0.05], [0.02, 1e-3], [0.0] * 3,
                     gravity=9.81)
    for k in (1e8, 1e9, 1e10):
        report = gr.compare(scene, dashpots(scene, (0.1, k), (0.1, k)), t_end=1.0)
        hand = ByHand(report)
        seen += len(report.resting)
        assert {c: rest[0] for c, rest in hand.rests.items()} == pytest.approx(report.resting, rel=1e-9, abs=1e-15)
    assert seen > 3


SCENE = gr.Scene([INF, 0.44745080468656334, 1.0], [0, 0.1, 0.1], [3.958436963552476e-06, 0.0], [0.0] * 3, 9.81)


def checks(monkeypatch, refuse, status=None):
    """A touching pair, and far away a single ball on the ceiling, where the run under a tie rule raises, or stops."""
    run = gr.edmd.simulate

    def simulate(scene, rule, **options):
        if options["ties"] == refuse and status is None:
            raise ValueError("no answer")
        found = run(scene, rule, **options)
        return replace(found, status=status) if options["ties"] == refuse else found

    monkeypatch.setattr(gr.edmd, "simulate", simulate)
    scene = gr.Scene([1.0, 1.0, 1.0, INF], [0.1] * 3 + [0.0], [0.0, 10.0, 0.1], [0.0, -1.0, 1.0, 0.0])
    return gr.compare(scene, gr.LinearDashpot(1e6), t_end=0.5)


@pytest.mark.parametrize(("status", "words"), [(None, "refused the scene"),
                                               (gr.Status.max_events, "stopped early (max_events)")])
def test_only_components_with_ties_need_the_other_tie_rules(monkeypatch, status, words):
    report = checks(monkeypatch, "poisson", status)
    assert report.answer is gr.Answer.yes  # one pair touches nobody else: no rule matters
    three = gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.5, 0.5], [1.0, 0.0, -1.0])
    report = gr.compare(three, gr.LinearDashpot(1e7), t_end=1.0)
    assert report.answer is gr.Answer.undecided
    assert report.verdict == f"No verdict: the run with ties='poisson' {words}, so the answer could not be checked."
    far = gr.Scene([1.0] * 5, [0.1] * 5, [0.5, 0.5, 1e3, 0.1], [1.0, 0.0, -1.0, 1.0, 0.0])
    answers = {one.balls: one.answer for one in gr.compare(far, gr.LinearDashpot(1e7), t_end=1.0).reasons}
    assert answers == {(0, 1, 2): gr.Answer.undecided, (3, 4): gr.Answer.yes}


def test_a_damped_pile_that_collapses_can_be_yes():
    """The rule of Poisson cannot carry on a collapse, and is no check of it: the other order alone is."""
    scene = gr.Scene([INF, 1.0, 0.033], [0.0, 0.05, 0.05], [0.07, 0.1], [0.0] * 3, 9.81)
    law = dashpots(scene, (0.3, 1e9), (0.3, 3.3e7))
    report = gr.compare(scene, law, t_end=1.5)
    assert gr.edmd.simulate(scene, report.rule, ties="poisson", t_end=1.5).status is gr.Status.collapse
    assert report.hard.status is gr.Status.collapse
    assert set(report.tie_errors) == {"right"}
    assert report.answer is gr.Answer.yes
    assert Judge(scene, report.law, report.rule, 1.5).judge().answer == "yes"


def test_long_flights_within_an_episode_are_compared():
    scene, law, _, t_end = ring_whose_episode_hides_a_wrong_flight()
    report = gr.compare(scene, law, t_end=t_end)
    one = report.deciding
    assert (report.answer, one.ball, one.contacts) == (gr.Answer.no, 0, 3)
    assert (one.hard_velocity, one.soft_velocity) == pytest.approx((-2.98, -1.49), abs=0.01)
    assert report.error == pytest.approx(ByHand(report).error_of([0, 1, 2], float(report.units[0])), rel=1e-9)


@pytest.mark.parametrize("ties", ["left", "right"])
def test_a_pile_under_a_rule_with_a_threshold_sticks_and_is_judged_alike(ties):
    """Balls stick without merge_below: runs under two tie rules are compared contact by contact."""
    for n, gap in ((2, 0.0), (2, 0.05), (3, 1e-3)):
        scene = gr.Scene([INF, *[1.0] * n], [0.0, *[0.05] * n], [0.1, *[gap] * (n - 1)], [0.0] * (n + 1), 9.81)
        report = gr.compare(scene, dashpots(scene, *[(0.5, 1e8)] * n), BounceThreshold(0.5, 0.3), t_end=1.5, ties=ties)
        assert "merge_below" not in report.hard.stats
        assert (separation_speeds(report.hard) == 0.0).all()
        own = Judge(scene, report.law, report.rule, 1.5, ties=ties).judge()
        assert report.answer.name == own.answer
        assert report.error == pytest.approx(own.error, rel=1e-6)


def test_a_shifted_run_that_stops_early_is_no_yes():
    report = gr.compare(gr.Scene([1.0, 1.0], [0.1] * 2, [0.1], [1.0, 0.0]), gr.LinearDashpot(1e7), t_end=1.0)
    assert report.answer is gr.Answer.yes
    cut = replace(report)
    cut.__dict__["twin"] = replace(report.twin, status=gr.Status.max_events)
    assert cut.answer is gr.Answer.undecided
    assert "gaps shifted by a relative 1e-12 stopped early (max_events)" in cut.verdict


@pytest.mark.parametrize("options", [{"collapse": "merge"}, {"tc": 1e-6}, {"elastic_below": 1e-3}])
def test_rules_that_options_exclude_are_no_checks(options):
    scene = gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.5, 0.5], [1.0, 0.0, -1.0])
    report = gr.compare(scene, gr.LinearDashpot(1e7), t_end=1.0, **options)
    assert set(report.tie_errors) == {"right"}
    assert report.answer is gr.Answer.yes
    sticky = gr.compare(scene, gr.LinearDashpot(1e7), gr.ConstantRestitution(0.0), t_end=1.0)
    assert set(sticky.tie_errors) == {"right"}


def test_separation_speed_of_a_sweep_is_that_of_the_contact_it_counts():
    scene = gr.Scene([1.0] * 5 + [INF], [0.1] * 5 + [0.0], [0.1, 100.0, 0.1, 0.05, 0.02],
                     [1.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    law = [gr.LinearDashpot(1e6), gr.LinearDashpot(1e4), *dashpots(scene, *[(0.8, 1e4)] * 5)[2:]]
    for end in (0.2, 0.205, 0.21, 0.22, 0.24):
        case = gr.Case(scene, law, t_end=end)
        found = gr.sweep(case, {"gap[0]": [0.1]}, ("contacts", "v_rel"))
        run, later = (gr.md.simulate(scene, law, t_end=t) for t in (end, 1.0))
        for c in range(scene.n_pairs):
            count = run.count(c)
            assert int(found["contacts"][0, c]) == count
            v = float(np.diff(later.of(c)["v_out"][count - 1])[0]) if count else math.nan
            assert float(found["v_rel"][0, c]) == pytest.approx(v, rel=1e-9, nan_ok=True), (end, c)


@pytest.mark.parametrize("seed", range(6))
def test_separation_speeds_at_any_end_are_those_of_the_counted_contacts(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 7))
    scene = gr.Scene(rng.uniform(0.5, 2.0, n), [0.05] * n, 10.0 ** rng.uniform(-3, -1, n - 1), rng.uniform(-1, 1, n))
    law = dashpots(scene, *[(0.8, 1e4)] * (n - 1))
    whole, end = gr.md.simulate(scene, law, t_end=5.0), float(rng.uniform(0.01, 0.3))
    cut = gr.md.simulate(scene, law, t_end=end)
    found = gr.sweep(gr.Case(scene, law, t_end=end), {"mass[0]": [float(scene.mass[0])]}, ("contacts", "v_rel"))
    for c in range(n - 1):
        last = whole.of(c)[cut.count(c) - 1] if cut.count(c) else None
        expected = math.nan if last is None else float(np.diff(last["v_out"])[0])
        assert float(found["v_rel"][0, c]) == pytest.approx(expected, rel=1e-9, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("height", [0.3, 0.5, 1.0])
def test_a_ball_that_just_reaches_a_ceiling_touches_it(height):
    scene = gr.Scene([1.0, INF], [0.05, 0.0], [height], [math.sqrt(2.0 * 9.81 * height), 0.0], gravity=9.81)
    report = gr.compare(scene, gr.LinearDashpot(1e6), t_end=1.0)
    said = "balls touch only at speeds of rounding errors" if len(report.hard.contacts) else "nothing collides"
    assert report.verdict == f"Yes, trivially: {said}."

"""After a yes, every long free flight of a ball is the same in both runs: a check that uses no episodes."""

import pytest

import granular as gr
from tests.helpers.judge import Judge
from tests.helpers.judged_flights import wrong_flights
from tests.helpers.scenes_of_outcomes import (
    OUTCOME_KINDS,
    basketball_and_tennis_ball,
    box_whose_walls_hide_a_wrong_flight,
    outcome_question,
    ring_whose_episode_hides_a_wrong_flight,
)

pytestmark = pytest.mark.usefixtures("interpreted")
FAST_KINDS = tuple(kind for kind in OUTCOME_KINDS if kind not in ("threshold", "pile_hit", "stack"))


def judge_of(scene, law, rule, t_end):
    """The reference judge of a scene and its judgement."""
    judge = Judge(scene, law, rule or gr.restitution_of(law), t_end)
    return judge, judge.judge()


def wrong_flights_after_yes(question, answer=None):
    """Wrong flights of one question, None unless its answer is yes; by default the answer of the reference judge."""
    judge, judgement = judge_of(*question)
    if (answer or judgement.answer) != "yes":
        return None
    unit = dict.fromkeys(range(judge.n), 0.0)
    for pairs, part in judgement.components.items():
        unit |= {body: part.unit for c in pairs for body in judge.bodies(c)}
    return wrong_flights(*judge.logs, judge, unit)


def library_answer(scene, law, rule, t_end):
    return gr.compare(scene, law, *([rule] if rule else []), t_end=t_end, max_events=20_000).answer.name


def check(kind, seeds):
    """Number of yes, of the reference judge or of the library, among the questions of these seeds."""
    found = 0
    for seed in seeds:
        question = outcome_question(kind, seed)
        wrong = wrong_flights_after_yes(question)
        found += wrong is not None
        assert not wrong, (kind, seed, wrong)
        if wrong is None and library_answer(*question) == "yes":
            assert not wrong_flights_after_yes(question, "yes"), (kind, seed)
            found += 1
    return found


@pytest.mark.rotating
@pytest.mark.parametrize("kind", FAST_KINDS)
def test_flights_after_a_yes_agree(kind):
    assert check(kind, range(12)) >= 4


@pytest.mark.rotating
@pytest.mark.parametrize(("kind", "seeds"), [("stack", range(3)), ("stack", range(3, 8)), ("pile_hit", [1, 3])])
def test_flights_of_stacks_and_piles_after_a_yes_agree(kind, seeds):
    assert check(kind, seeds) >= 1


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(8))
@pytest.mark.parametrize("kind", [kind for kind in OUTCOME_KINDS if kind != "threshold"])
def test_flights_after_many_a_yes_agree(kind, batch):
    """Each batch is one case, so that an interrupted soak can be continued."""
    check(kind, range(100 + 12 * batch, 112 + 12 * batch))


def test_the_flight_that_damped_walls_hide_is_found():
    question = box_whose_walls_hide_a_wrong_flight()
    (hard, soft), = wrong_flights_after_yes(question, "yes")
    assert (hard.ball, round(hard.velocity, 3), round(soft.velocity, 3)) == (1, -0.463, -0.698)
    assert judge_of(*question)[1].answer == "no"


def test_the_flight_that_an_episode_hides_is_found():
    (hard, soft), = wrong_flights_after_yes(ring_whose_episode_hides_a_wrong_flight(), "yes")
    assert (hard.ball, round(hard.velocity, 2), round(soft.velocity, 2)) == (0, -2.98, -1.49)
    assert soft.end - soft.begin > 100.0 * soft.contact_duration


def test_a_wrong_flight_within_an_episode_is_a_no():
    question = ring_whose_episode_hides_a_wrong_flight()
    assert judge_of(*question)[1].answer == library_answer(*question) == "no"


def test_the_basketball_and_the_tennis_ball_agree():
    assert wrong_flights_after_yes(basketball_and_tennis_ball()) == []
    judgement = judge_of(*basketball_and_tennis_ball())[1]
    assert judgement.error == pytest.approx(0.0097, abs=1e-4)
    assert judgement.deciding.ball == 1


def test_the_base_case_is_decided_by_the_upper_ball():
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    judgement = judge_of(scene, law, None, 0.33)[1]
    deciding = judgement.deciding
    assert (judgement.answer, deciding.ball) == ("no", 2)
    assert deciding.episode == [(0, 0), (1, 0), (1, 1), (1, 2), (1, 3)]
    assert (deciding.hard, deciding.soft) == pytest.approx((5.91043, 2.28181), abs=1e-5)
    assert judgement.components[0, 1].unit == pytest.approx(5.32456, abs=1e-5)
    assert judgement.error == pytest.approx(0.680, abs=1e-3)

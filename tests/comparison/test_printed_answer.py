"""Counts, error and answer of a report are those that its own printed numbers give."""

import pytest

import granular as gr
from tests.helpers.judge import Judge
from tests.helpers.judged_reports import Recomputed, is_complete, numbers_of_verdict, saved
from tests.helpers.scenes_of_outcomes import (
    basketball_and_tennis_ball,
    box_whose_walls_hide_a_wrong_flight,
    outcome_question,
)

pytestmark = pytest.mark.usefixtures("interpreted")
PRINTED_KINDS = ("damped_box", "cradle", "stack", "gas", "ring", "boost", "no_end", "equal")
NOT_ABOUT_THE_ERROR = ("forever", "sink")


def reported(question):
    scene, law, rule, t_end = question
    return gr.compare(scene, law, *([rule] if rule else []), t_end=t_end, max_events=20_000)


def check_printed(question, folder):
    """Recompute one report if its logs are complete; whether they were."""
    report = reported(question)
    data = saved(report, folder)
    check_verdict(report, data)
    if question[0].pendulum or not is_complete(data):
        return False
    found = Recomputed(data)
    assert found.error == pytest.approx(report.error, rel=1e-6, abs=1e-12)
    for entry in data["pairs"]:
        if "hard_contacts" in entry:
            assert (entry["hard_contacts"], entry["soft_contacts"]) == found.counts[entry["pair"]]
    if report.answer is gr.Answer.yes:
        assert found.error <= 0.01
    elif report.answer is gr.Answer.no and not any(word in report.verdict for word in NOT_ABOUT_THE_ERROR):
        assert found.error > 0.01
    return True


def check_verdict(report, data):
    """The numbers of the sentence are those of the JSON."""
    assert data["answer"] == report.answer.name
    assert data["verdict"] == report.verdict
    bound, off, counts = numbers_of_verdict(report.verdict)
    if bound is not None:
        assert report.error <= bound <= 2.0 * report.error + 1e-9  # one digit, rounded up
    if off is not None:
        assert off == pytest.approx(report.error, rel=0.06)
    pairs = [(entry["soft_contacts"], entry["hard_contacts"]) for entry in data["pairs"] if "soft_contacts" in entry]
    if counts and pairs:
        assert counts in pairs


@pytest.mark.rotating
@pytest.mark.parametrize("kind", PRINTED_KINDS)
def test_the_printed_numbers_give_the_answer(kind, tmp_path):
    checked = [check_printed(outcome_question(kind, seed), tmp_path) for seed in range(8)]
    assert sum(checked) >= (1 if kind in ("stack", "cradle") else 3)


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(10))
@pytest.mark.parametrize("kind", PRINTED_KINDS)
def test_the_printed_numbers_of_many_give_the_answer(kind, batch, tmp_path):
    for seed in range(1000 + 12 * batch, 1012 + 12 * batch):
        check_printed(outcome_question(kind, seed), tmp_path)


@pytest.mark.rotating
@pytest.mark.parametrize("kind", PRINTED_KINDS)
def test_the_judge_agrees_with_the_printed_logs(kind, tmp_path):
    """Two computations of the error, from runs and from printed digits."""
    for seed in range(20, 26):
        question = outcome_question(kind, seed)
        report = reported(question)
        data = saved(report, tmp_path)
        if is_complete(data):
            own = Judge(question[0], report.law, report.rule, question[3]).judge()
            assert Recomputed(data).error == pytest.approx(own.error, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("question", [basketball_and_tennis_ball(), box_whose_walls_hide_a_wrong_flight()])
def test_the_printed_numbers_of_known_scenes(question, tmp_path):
    data = saved(reported(question), tmp_path)
    assert is_complete(data)
    error = Recomputed(data).error
    assert error == pytest.approx(0.0097 if question[0].gravity else 0.2419, abs=1e-4)

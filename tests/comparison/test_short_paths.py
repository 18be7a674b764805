"""Runs are continued only if necessary. A needless continuation would not change the comparison."""

from collections import Counter
from functools import cached_property

import numpy as np
import pytest

import granular as gr
from granular.comparison import align
from tests.helpers.scenes_of_outcomes import OUTCOME_KINDS, outcome_question

pytestmark = pytest.mark.usefixtures("interpreted")
CHECKS = {"_is_settled": False, "_flies_until": False, "_stay_apart": False}
"""Functions that avoid a continuation, and the return value that forces every continuation."""
LONG_KINDS = ("pile_hit", "boost")


def numbers(report):
    """All numbers of a report that a continuation can change."""
    hard, soft = report.continued
    return (report.answer, report.verdict, report.errors.tolist(), report.units.tolist(),
            hard.contacts.tobytes(), soft.contacts.tobytes(), report.other_counts.tolist(), str(report))


def compared(question, end):
    scene, law, rule, t_end = question
    return gr.compare(scene, law, *([rule] if rule else []), t_end=t_end, max_events=5_000, **end)


@pytest.mark.rotating
@pytest.mark.parametrize("kind", OUTCOME_KINDS)
def test_short_paths_change_nothing(kind, monkeypatch):
    """A stop at a contact leaves one run with fewer contacts, so that the comparison must examine missing contacts."""
    used = Counter()
    for seed in range(2 if kind in LONG_KINDS else 8):
        question = outcome_question(kind, seed)
        floor = np.isinf(question[0].mass[0])
        end = {"until": gr.until.contact(0, 1 + seed % 2)} if floor or question[0].ring else {}
        with monkeypatch.context() as patch:
            for name in CHECKS:
                check = getattr(align, name)
                patch.setattr(align, name, lambda *given, check=check, name=name: note(used, name, check(*given)))
            short = numbers(compared(question, end))
        with monkeypatch.context() as patch:
            for name, value in CHECKS.items():
                patch.setattr(align, name, lambda *given, value=value: value)
            assert numbers(compared(question, end)) == short, seed
    assert used["_is_settled"] + used["_stay_apart"] > 0


def note(used, name, value):
    used[name] += bool(value)
    return value


def test_slow_balls_below_a_fast_ball_need_no_continuation():
    """No ball can reach a light ball that flies away within the allowed delay."""
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    report = gr.compare(scene, law, until=gr.until.contact(0, 2))
    hard, missing = report.counted[0], np.array([1])
    end = float(hard.time[-1])
    assert align._stay_apart(hard, missing, np.full(2, end + 0.04))
    assert not align._stay_apart(hard, missing, np.full(2, end + 4.0))  # at that time they can have met
    assert align._stay_apart(hard, missing[:0], np.full(2, end + 4.0))


@pytest.mark.parametrize("kind", [*OUTCOME_KINDS, "ceiling"])
def test_a_scene_with_other_gaps_is_the_one_that_is_built_anew(kind):
    """Cached properties that the copy keeps do not depend on the gaps; all others are computed again."""
    names = [name for name, member in vars(gr.Scene).items() if isinstance(member, cached_property)]
    for seed in range(4):
        scene = outcome_question(kind, seed)[0] if kind != "ceiling" else gr.Scene(
            [1.0, 2.0, np.inf], [0.1, 0.1, 0.0], np.random.default_rng(seed).uniform(0.1, 1.0, 2), [0.0, 1.0, 0.0])
        undefined = "_mass_fraction" if scene.is_wall.any() else "_anchor_wall_position"
        used = [name for name in names if name != undefined]
        assert [name for name in used if getattr(scene, name) is NotImplemented] == []  # all are cached from now on
        gap = np.where(scene.gap > 0.0, 1.5 * scene.gap, 1e-9)
        copy, anew = scene._with_valid_gaps(gap.copy()), scene.replace(gap=gap)
        assert copy == anew
        for name in used:
            assert repr(getattr(copy, name)) == repr(getattr(anew, name)), name
    assert len(names) > 8

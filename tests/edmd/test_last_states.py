"""Every run examines its last state, and a state that cannot be makes it a broken run."""

import math
import re

import numpy as np
import pytest

import granular as gr
from granular.scene.places import invalid_reason
from granular.scene.walls import Sine

INF = math.inf


def moved(row, **changed):
    return row._replace(**changed)


HARM = {
    "a position or a velocity is not a finite number": lambda row: moved(row, velocity=row.velocity * math.nan),
    "gap 1 is -0.25 m": lambda row: moved(row, gap=row.gap * np.array([1.0, 0.0, 1.0]) - np.array([0.0, 0.25, 0.0])),
    r"gaps add up to 1.3\d* m instead of 1(\.0\d*)? m": lambda row: moved(row, gap=row.gap + np.array([0.3, 0.0, 0.0])),
}


@pytest.mark.parametrize("said", HARM)
def test_a_run_whose_last_state_cannot_be_is_broken(said, monkeypatch):
    scene = gr.Scene([INF, 1.0, 1.0, INF], [0.0, 0.1, 0.1, 0.0], [0.3, 0.4, 0.3], [0.0, 1.0, -0.7, 0.0])
    sound, row = gr.Status.time, gr.edmd.run.Run.row
    monkeypatch.setattr(gr.edmd.run.Run, "row", lambda self, time: HARM[said](row(self, time)))
    broken = gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), t_end=1.0)
    assert broken.status is gr.Status.broken
    expected = rf"the final state is invalid, so the numbers are meaningless: {said}; {sound.value} at .*"
    assert re.fullmatch(expected, broken.message)
    with pytest.raises(ValueError, match=r"`trajectory` must be a run that can be continued, got status broken\."):
        gr.edmd.resume(broken, t_end=2.0)
    assert gr.compare(scene, gr.LinearDashpot(1e6, 10.0), t_end=1.0).verdict.startswith("No verdict: the event-driven")


def test_a_soft_run_whose_last_state_cannot_be_is_broken(monkeypatch):
    scene = gr.Scene([1.0, 1.0], [0.1] * 2, [0.3, 0.2], [0.5, -0.7], ring=True)
    row = gr.md.located.Run.row_after
    monkeypatch.setattr(gr.md.located.Run, "row_after", lambda *given: moved(row(*given), gap=row(*given).gap + 0.1))
    broken = gr.md.simulate(scene, gr.LinearDashpot(1e4, 10.0), until=gr.until.contact(0, 1), t_end=9.0)
    assert broken.status is gr.Status.broken
    assert "gaps add up to 0.7" in broken.message
    with pytest.raises(ValueError, match=r"`trajectory` must be a run that can be continued, got status broken\."):
        gr.md.resume(broken, t_end=10.0)


def test_what_is_judged_is_the_room_between_walls_that_move():
    """One whose gaps are off by 1e-6 m is none there can be, by every engine."""
    scene = gr.Scene([INF, 1.0, 1.0, INF], [0.0, 0.1, 0.1, 0.0], [0.0, 0.0, 0.3], [0.01, 0.5, -0.2, 0.2],
                     floor=Sine(0.01, 3.0))
    for result in (gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=5.0),
                   *(gr.md.simulate(scene, gr.LinearDashpot(1e4, 5.0), t_end=5.0, **how)
                     for how in ({}, {"method": "verlet", "dt": 1e-4}))):
        given = scene, 0.0, result.time[-1:], result.gap[-1], result.position[-1], result.velocity[-1]
        assert result.status is gr.Status.time
        assert invalid_reason(*given, hard=result.law is None, adds_up=True) == ""
        off = given[3] * 1.0
        off[-1] += 1e-6
        assert invalid_reason(*given[:3], off, *given[4:], hard=True, adds_up=True).startswith("gaps add up to ")

"""Soft spheres become hard ones as k → ∞, by the duration of a contact: 1/√k under linear laws, k^(-2/5) of Hertz's.

Under gravity, in random scenes whose collisions are apart: there the duration is all that tells the engines apart.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings, strategies as st

import granular as gr
from tests.helpers.scenes_at_random import scenes

QUICK = settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
DROPPED = scenes(balls=(1, 3), walls=(1.0, 0.0, 0.0), gravity=(9.81,), gaps=("wide",), size=1e-2)
STIFF = 10.0 ** np.arange(10.0, 14.0)
APART = 0.01
"""Time in s between the collisions of a scene, more than a hundred times the longest contact."""


def order(scene: gr.Scene, eps: float, law: Callable[[float], Any], stiff: Any = STIFF) -> float:
    """Exponent of 1/k with which gaps go to those of hard spheres, by regression."""
    rule = gr.ConstantRestitution(eps)
    first = gr.edmd.simulate(scene, rule, t_end=1.0, max_events=6)
    times = [0.0, *first.contacts["t_begin"], first.time[-1]]
    before, after = times[-3:-1] if len(first.contacts) == 6 else times[-2:]
    end = before + 0.3 * (after - before)  # not half: at the top of a bounce a lag of time is not seen
    hard = gr.edmd.simulate(scene, rule, t_end=end)
    assume(len(hard.contacts) > 1 and np.diff([0.0, *hard.contacts["t_begin"], end]).min() > APART)
    assume((hard.contacts["v_in"] @ [1.0, -1.0]).min() > 0.1)
    off = []
    for k in stiff:
        soft = gr.md.simulate(scene, law(float(k)), t_end=end, engine="plain")
        assert soft.contacts["pair"].tolist() == hard.contacts["pair"].tolist()
        off.append(abs(soft.gap[-1] - hard.gap[-1]).max())
    return -float(np.polyfit(np.log(stiff), np.log(off), 1)[0])


@QUICK
@given(DROPPED, st.floats(0.6, 1.0))
def test_dashpots_become_hard_as_one_over_root_k(scene: gr.Scene, eps: float) -> None:
    def law(k: float) -> Any:
        return [gr.LinearDashpot.from_restitution(eps, k, pair) for pair in scene.pairs]

    assert order(scene, eps, law) == pytest.approx(0.5, abs=0.02)


@pytest.mark.rotating
@QUICK
@given(DROPPED)
def test_hertz_spheres_become_hard_as_the_duration_of_their_contacts(scene: gr.Scene) -> None:
    assert order(scene, 1.0, gr.Hertz, 1e3 * STIFF) == pytest.approx(0.4, abs=0.02)

"""Heat flow between thermal walls, hard and soft, against free flight and the counts of an independent program."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular._engine.kernels import have_numba

KNOWN = json.loads((Path(__file__).parents[1] / "reference" / "heat_flow.json").read_text(encoding="utf-8"))
EQUAL, ALTERNATING, SOFT = KNOWN["equal_masses"], KNOWN["alternating_masses"], KNOWN["soft_over_hard"]
COMPILED = [pytest.mark.soak, pytest.mark.skipif(not have_numba(), reason="a million collisions")]
PARTS = 40


def heat(scene, touch, end, engine="auto"):
    """Mean heat flow in W in each part of a run that long."""
    way, more = (gr.md, {"max_steps": 10**9}) if isinstance(touch, gr.LinearDashpot) else (gr.edmd, {})
    asked = {"samples": PARTS + 1, "log": False, "max_events": 10**9, "engine": engine} | more
    run = way.simulate(scene, touch, t_end=end, **asked)
    return np.diff(run.account()["heat"] @ [0.5, -0.5]) / (end / PARTS)


def mean(parts):
    """Mean of the parts, and its standard error."""
    return parts.mean(), parts.std(ddof=1) / math.sqrt(len(parts))


def gas(n, seed=1, **options):
    hot, cold, m = (EQUAL[name] for name in ("T1", "T2", "m"))
    return gr.scenes.heated_gas(n, n / EQUAL["density"], 0.0, hot, cold, mass=m, seed=seed, **options)


ELASTIC = gr.ConstantRestitution(1.0)


@pytest.mark.parametrize("n", [pytest.param(n, marks=COMPILED) for n in EQUAL["n"]])
def test_equal_masses_conduct_like_free_flight(n):
    flow, error = mean(heat(gas(n), ELASTIC, 4e5 if n < 100 else 1e5))
    assert error < 0.015 * EQUAL["J"]
    assert abs(flow - EQUAL["J"]) < 3.0 * error


@pytest.mark.parametrize(("known", "end", "close"), [
    (ALTERNATING[0], 1.5e3, 0.15), *(pytest.param(known, 5e5, 0.015, marks=COMPILED) for known in ALTERNATING)])
def test_masses_in_turn_conduct_less_the_more_they_are(known, end, close):
    exact, uncertainty = known["J"]
    flow, error = mean(heat(gas(known["n"], dimer=known["mass_ratio"]), ELASTIC, end))
    assert error < close * exact
    assert abs(flow - exact) < 3.0 * math.hypot(error, uncertainty)


@pytest.mark.parametrize(("k", "ratio"), SOFT["k"].items())
@pytest.mark.soak
@pytest.mark.skipif(not have_numba(), reason="a million contacts")
def test_soft_gases_conduct_less(k, ratio):
    """Hard and soft balls draw the same speeds, so that most of the noise is in both."""
    gases = [gas(SOFT["n"], seed) for seed in range(48)]
    hard, soft = (np.array([heat(one, touch, 2.5e3, "compiled").mean() for one in gases])
                  for touch in (ELASTIC, gr.LinearDashpot(float(k))))
    less, error = mean((soft - hard) / EQUAL["J"])
    assert error < 0.5 * SOFT["uncertainty"]
    assert 1.0 + less == pytest.approx(ratio, abs=SOFT["uncertainty"])


@pytest.mark.soak
@pytest.mark.skipif(not have_numba(), reason="a hundred thousand contacts")
def test_two_soft_balls_whose_contacts_are_all_binary_conduct_less():
    hard, soft = (heat(gas(2), touch, 1e5) for touch in (ELASTIC, gr.LinearDashpot(100.0)))
    less, error = mean((soft - hard) / EQUAL["J"])
    assert error < 0.02
    assert -0.21 < less < -0.12

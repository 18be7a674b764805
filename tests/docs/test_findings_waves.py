"""The finding about waves: forces beside a wave that meets none, hard spheres beside a formula. See `test_findings`."""

import numpy as np
import pytest

import granular as gr
from tests.helpers.findings import printed, script

SOAK = pytest.mark.soak
waves = script("waves")


@SOAK
@pytest.mark.parametrize(("n", "part"), [(40, 0.0238), (41, 0.0061)])
def test_a_secondary_wave_has_so_much_of_the_first(n, part):
    """To the digits of the page; twice as many samples do not change them."""
    assert waves.secondary_wave(n) == printed(part, 4)
    push = waves.quarter_force(n, samples=8001)[1]
    peaks = push[1:-1][(push[1:-1] > push[:-2]) & (push[1:-1] >= push[2:]) & (push[1:-1] > 1.0)]
    assert peaks[2] / peaks[0] == printed(part, 4)


@SOAK
def test_a_wave_that_meets_no_other_leaves_no_secondary_one():
    """Until the first one is at the end of the chain."""
    scene = gr.scenes.newtons_cradle(40)
    run = gr.md.simulate(scene, waves.HERTZ_LAW, t_end=0.0115, samples=1151)
    near = waves.HERTZ_LAW.k * np.maximum(run.position[:, 10] - run.position[:, 11] + 2.0 * scene.radius[0], 0.0) ** 1.5
    peaks = near[1:-1][(near[1:-1] > near[:-2]) & (near[1:-1] >= near[2:]) & (near[1:-1] > 1.0)]
    assert len(peaks) == 1
    assert peaks[0] == pytest.approx(2547.0, abs=1.0)


def test_hard_waves_leave_nothing_behind():
    assert waves.crossing_waves(40, gr.edmd).velocity[-1].tolist() == [-1.0, *[0.0] * 38, 1.0]


@pytest.mark.rotating
@pytest.mark.parametrize(("mu", "hard", "soft"), [
    pytest.param(2.0, (0.1111, 1, 19), (0.0755, 3, 5), marks=SOAK),
    pytest.param(0.5, (0.0519, 17, 16), (0.0302, 9, 9), marks=SOAK),
    pytest.param(0.1, (0.0051, 23, 22), (0.0458, 17, 15), marks=SOAK), (1.0, (0.0, 1, 1), (0.0063, 1, 1))])
def test_what_an_intruder_sends_back(mu, hard, soft):
    """A heavy one of hard balls has (1 - μ)²/(1 + μ)² from the first collision, and the others do not come back."""
    for engine, (part, before, after) in ((gr.edmd, hard), (gr.md, soft)):
        found = waves.intruder_outcome(mu, engine)
        assert found == (printed(part, 4), before, after)
    if mu >= 1.0:
        assert waves.intruder_outcome(mu, gr.edmd)[0] == pytest.approx(((1.0 - mu) / (1.0 + mu)) ** 2, rel=1e-12)


@SOAK
def test_a_light_intruder_is_told_smoothly_by_newton_only():
    """The grid of the page; hard spheres have bands that end at once, each with a zero."""
    masses = np.geomspace(0.05, 0.5, 61)
    hard, soft = ([waves.intruder_outcome(mu, engine)[0] for mu in masses] for engine in (gr.edmd, gr.md))
    assert 0.03 < min(soft) < max(soft) < 0.052
    assert min(hard) < 1e-3
    assert max(hard) == printed(0.15, 2)
    assert np.max(abs(np.diff(soft))) < 2e-3 < 0.1 < np.max(abs(np.diff(hard)))

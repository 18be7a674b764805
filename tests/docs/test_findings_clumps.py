"""The finding about clumps: means of draws beside those of the page, one hit beside a closed form and scipy."""

import math

import numpy as np
import pytest

import granular as gr
from tests.docs.test_findings import by_scipy
from tests.helpers.findings import printed, script

pytest.importorskip("numba")  # the runs are long
SOAK = pytest.mark.soak
clumps = script("clumps")
ELASTIC, MERGED = {"elastic_below": 0.01}, {"collapse": "merge", "merge_below": 0.01}


def drawn(lasts, remedy, draws=32, **fixed):
    """The spread and the share of the first, of hard and of soft balls."""
    results = [clumps.spread, clumps.first_share]
    return gr.ensemble(clumps.box, draws, "seed", results, lasts=lasts, remedy=remedy, **fixed).quantities


def said(mean, error, digits, draws, of=32):
    """A mean of `of` draws that the page prints with its standard error, as another so many draws may find it: four
    standard errors of the difference, and half a unit of the last digit. Runs are chaotic: no digit is sure."""
    return pytest.approx(mean, abs=4.0 * error * math.sqrt(1.0 + of / draws) + 0.5 * 10.0**-digits)


@pytest.mark.parametrize("lasts", [3e-3, 3e-5])
def test_contacts_last_as_long_as_they_should(lasts):
    """To 1 %, as a dashpot that may not pull lets go early; 30 μs is that of steel balls of 1 cm at 1 m/s."""
    case = clumps.box(lasts, {})
    law, pair = case.law[1], case.scene.pairs[1]
    assert gr.binary.collision(law, pair, 1.0).duration == pytest.approx(lasts, rel=0.0105)
    assert gr.restitution_of(law)(1.0, pair) == pytest.approx(0.95, rel=1e-12)
    mass = gr.materials.steel.density * 4.0 / 3.0 * math.pi * 0.005**3
    steel = gr.Pair(0.5 * mass, 0.0025, 0)
    found = gr.binary.collision(gr.Hertz.from_material(*gr.materials.steel, steel), steel, 1.0).duration
    assert 1e6 * found == pytest.approx(30.0, abs=1.0)


def test_what_one_hit_leaves_in_a_row():
    """The TC model has one inelastic collision: (1 - ε)²/4 stays. From a gap of one contact's way on all are alike."""
    assert clumps.row_energy("md", 1e-6) == printed(0.164, 3)
    assert clumps.row_energy("edmd", 1e-6) == printed(0.0002, 4)
    assert clumps.row_energy("edmd", 1e-6, tc=1e-3) == pytest.approx(0.025**2, rel=1e-9)
    kinds = (("md", {}), ("edmd", {}), ("edmd", {"tc": 1e-3}))
    apart = [clumps.row_energy(engine, 2.0, **options) for engine, options in kinds]
    assert apart == pytest.approx([apart[1]] * 3, rel=1e-2)  # the last contacts, of balls that stay, are no more alike


@SOAK
def test_soft_balls_make_no_clump():
    """Of four draws, at a contact of 0.3 ms; both engines beside the page, and far from each other."""
    spread, first = drawn(3e-4, {}, 4)
    assert spread.answer is first.answer is gr.Answer.no
    assert spread.means.tolist() == [said(0.012, 0.001, 3, 4), said(0.133, 0.002, 3, 4)]
    assert first.means.tolist() == [said(0.965, 0.007, 3, 4), said(0.41, 0.01, 2, 4)]


@SOAK
@pytest.mark.parametrize(("lasts", "remedy", "hard", "soft"), [
    (3e-4, {}, [(0.012, 0.001, 3), (0.965, 0.007, 3)], [(0.133, 0.002, 3), (0.41, 0.01, 2)]),
    (3e-4, {"tc": 3e-4}, [(0.055, 0.002, 3), (0.81, 0.01, 2)], [(0.133, 0.002, 3), (0.41, 0.01, 2)]),
    (3e-5, {"tc": 3e-5}, [(0.026, 0.001, 3), (0.93, 0.01, 2)], [(0.067, 0.003, 3), (0.66, 0.02, 2)]),
    (3e-7, ELASTIC, [(0.015, 0.001, 3), (0.96, 0.01, 2)], [(0.013, 0.001, 3), (0.97, 0.01, 2)])])
def test_spreads_and_shares(lasts, remedy, hard, soft):
    for which, told in enumerate((hard, soft)):
        for one, (mean, error, digits) in zip(drawn(lasts, remedy), told, strict=True):
            assert one.means[which] == said(mean, error, digits, 32)


@SOAK
def test_balls_that_merge_are_all_in_one_place():
    """In most draws; now and then a lump drifts off, so that no mean says much."""
    spread = drawn(3e-7, MERGED)[0]
    assert 3e-4 < np.median(spread.hard) < 3e-3
    assert np.mean(spread.hard < 0.01) > 0.8


@SOAK
def test_fifty_balls():
    """Their clump takes twice as long to come."""
    late = {"n": 50, "start": 600.0, "end": 1500.0}
    spread = drawn(3e-7, {}, 16, **late)[0]
    assert spread.means.tolist() == [said(0.008, 0.002, 3, 16, 16), said(0.053, 0.005, 3, 16, 16)]
    assert drawn(3e-4, {}, 4, **late)[0].means[1] == pytest.approx(0.19, abs=0.01)  # ten times the clump


@SOAK
def test_a_clump_of_hard_spheres_dissolves_by_newton():
    """Soft balls forget it: what they do from then on is what they do from a gas. Its gaps are those of the page."""
    spreads, gaps = [], []
    for seed in range(16):
        case = clumps.box(3e-4, {}, seed)
        run = case.simulate("edmd")
        gaps.append(np.diff(run.position[:, 2:-1]))
        clump = case.scene.replace(gap=np.maximum(np.diff(run.position[-1]), 0.0), velocity=run.velocity[-1])
        rows = np.linspace(300.0, 1200.0, 201)
        spreads.append(clumps.spread(gr.md.simulate(clump, case.law, t_end=1200.0, samples=rows, log=False,
                                                    max_events=10**8, engine="compiled")))
    assert np.mean(spreads) == said(0.133, 0.002, 3, 16)
    assert np.mean(np.array(gaps) < 3e-4) == pytest.approx(0.4, abs=0.1)  # the clump is open now and then: draws differ


@SOAK
def test_fixed_steps_spread_the_balls_alike():
    """Contacts of 3 ms in 40 steps, four draws of 250 s each; a dashpot's first order is below the standard errors."""
    boxes = [clumps.box(3e-3, {}, seed, start=50.0, end=300.0) for seed in range(4)]
    own, steps = (np.array([clumps.spread(one.simulate("md", **options)) for one in boxes])
                  for options in ({}, {"method": "verlet", "dt": 3e-3 / 40.0}))
    assert steps.mean() == pytest.approx(own.mean(), abs=4.0 * math.hypot(own.std(ddof=1), steps.std(ddof=1)) / 2.0)


@SOAK
def test_scipy_leaves_the_same_in_a_row():
    """To 1e-5: its steps do not know where a dashpot's force jumps."""
    scene = gr.Scene([1.0] * 20 + [math.inf], [0.0] * 21, [1e-9] * 20, [1.0] + [0.0] * 20)
    case = clumps.case(scene, 1e-3)
    run = case.simulate("md")
    speeds = by_scipy(scene, case.law, run.contacts["t_end"].max() + 1e-3)
    assert (speeds[1:] ** 2).sum() == pytest.approx(clumps.row_energy("md", 1e-6), abs=1e-5)

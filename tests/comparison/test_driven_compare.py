"""Comparisons of driven scenes: what still holds there, what is left out, and the account of the energy."""

import math

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.comparison import align
from granular.scene.walls import Piecewise, Sine

INF, G, F = math.inf, 9.81, 50.0
OMEGA = 2.0 * math.pi * F
EXACT = {"method": "verlet", "dt": 1e-6}


def orbit(gamma, eps=0.5, off=1e-6):
    """A point ball about to begin its orbit of one period on a plate, some amplitudes `off`."""
    plate = Sine.from_acceleration(gamma, F, G, math.acos(math.pi * (1.0 - eps) / (1.0 + eps) / gamma))
    return gr.Scene([INF, 1.0], [0.0, 0.0], [off * plate.amplitude], [0.0, math.pi * G / OMEGA], G, floor=plate)


def dashpot(scene, eps=0.5, ratio=100.0):
    return gr.LinearDashpot.from_restitution(eps, k=(ratio * OMEGA) ** 2, pair=scene.pairs[0])


def test_a_contact_at_a_shaken_wall_is_followed_in_its_phase():
    scene = orbit(1.4)
    law = dashpot(scene)
    longer = gr.md.simulate(scene, law, t_end=0.03, **EXACT)
    first = longer.contacts[0]
    cut = gr.md.simulate(scene, law, t_end=float(first["t_begin"] + 0.4 * first["duration"]), **EXACT)
    assert np.isnan(cut.contacts["t_end"]).tolist() == [True]
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), t_end=float(cut.time[-1]))
    row = align.equalize_counts(hard, cut, EXACT)[1].contacts[0]
    assert row["t_end"] == pytest.approx(first["t_end"], rel=1e-5)
    assert row["duration"] == pytest.approx(first["duration"], rel=1e-2)
    assert row["v_out"].tolist() == pytest.approx(first["v_out"].tolist(), rel=1e-3)


@pytest.mark.rotating
def test_no_contact_is_followed_beyond_the_path_of_a_wall():
    scene = gr.Scene([INF, 1.0], [0.0, 0.0], [0.0], [0.0, -1.0], floor=Piecewise([0.0, 0.01], [[0.5], [0.0]]))
    law = gr.LinearDashpot(1e4)
    cut = gr.md.simulate(scene, law, t_end=0.01, **EXACT)
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=0.01)
    assert np.isnan(align.equalize_counts(hard, cut, EXACT)[1].contacts["t_end"]).all()
    ends = gr.md.simulate(scene.replace(floor=Piecewise([0.0, 0.1], [[0.5], [0.0]])), law, t_end=0.01, **EXACT)
    hard = gr.edmd.simulate(ends.scene, gr.ConstantRestitution(1.0), t_end=0.01)
    assert not np.isnan(align.equalize_counts(hard, ends, EXACT)[1].contacts["t_end"]).any()


def test_balls_fall_with_their_forces_before_and_after_contacts():
    rng = np.random.default_rng(3)
    scene = gr.Scene([INF, 1.0, 2.0], [0.0, 0.1, 0.1], [0.05, 0.2], [0.3, -1.0, -1.1], G, external_force=[0, -4.0, 3.0])
    run = gr.md.simulate(scene, gr.LinearDashpot(1e5, 20.0), t_end=0.3, **EXACT)
    first = run.contacts[0]
    before = measures.impact_velocities(scene, run)
    assert before[list(scene.bodies(first["pair"]))] == pytest.approx(first["v_in"].tolist(), rel=1e-3)
    later = [gr.md.simulate(scene, gr.LinearDashpot(1e5, 20.0), t_end=t, **EXACT) for t in rng.uniform(0.3, 0.5, 2)]
    same = [measures.mass_centre_restitution(one) for one in later if len(one.contacts) == len(run.contacts)]
    assert same == pytest.approx([measures.mass_centre_restitution(run)] * len(same), rel=1e-3)
    shaken = gr.md.simulate(orbit(1.4), dashpot(orbit(1.4)), t_end=0.05, **EXACT)
    assert math.isnan(measures.mass_centre_restitution(shaken))


def test_a_section_has_phase_and_velocities_of_wall_and_ball():
    scene = orbit(1.4).replace(ceiling=None)
    run = gr.md.simulate(scene, dashpot(scene), t_end=0.1, **EXACT)
    seen, plate = gr.measures.section(run), scene.floor
    angle = OMEGA * run.contacts["t_begin"] + plate.phase
    assert seen["phase"] == pytest.approx((angle / (2.0 * math.pi)) % 1.0, abs=1e-12)
    assert seen["wall"] == pytest.approx(plate.amplitude * OMEGA * np.cos(angle), rel=1e-3)
    assert (seen["after"] > seen["before"]).all()
    with pytest.raises(ValueError, match=r"`pair` must be the pair of a wall, 0, got 1\."):
        gr.measures.section(run, 1)
    upside = gr.Scene([1.0, INF], [0.0, 0.0], [0.01], [1.0, 0.0], ceiling=Sine(1e-3, F))
    above = gr.measures.section(gr.md.simulate(upside, gr.LinearDashpot(1e6), t_end=0.05, **EXACT))
    assert above["before"][0] == pytest.approx(1.0, rel=1e-6)
    assert 0.0 <= above["phase"][0] <= 1.0


# --- both engines ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def steady():
    scene = orbit(1.3)
    return gr.compare(scene, dashpot(scene, ratio=1e4), t_end=0.19)


def test_the_report_has_an_account_that_is_closed(steady):
    said = steady.details()
    assert "work of the floor" in said
    assert "ceiling" not in said
    assert "so timing matters at a driven wall" in said
    for run in (steady.hard, steady.soft):
        parts = measures.balance(run)
        assert abs(parts["remainder"]) <= 1e-12 * parts["dissipated"]
        assert parts["dissipated"] > 0.0
    assert steady.to_dict()["hard"]["account"]["floor"] == measures.balance(steady.hard)["floor"]


def test_groups_of_a_shaken_plate(steady):
    assert steady.groups["shaking"] == pytest.approx(1.3, rel=1e-14)
    assert steady.groups["shaking_omega"] == pytest.approx(1e-4, rel=1e-9)
    assert "Γ 1.3, ω/ω₀ 0.0001" in steady.details()


def test_where_both_agree_they_are_said_to(steady):
    assert steady.verdict.startswith("Yes: every contact is binary (certified)")
    assert steady.error < 0.01
    assert math.isnan(steady.measures["mass_centre_ratio"])


def test_only_where_velocities_agree_may_a_contact_at_the_end_time_be_late():
    scene = orbit(1.3)
    report = gr.compare(scene, dashpot(scene, ratio=1e4), t_end=0.2)  # just as the ball lands
    assert abs(report.hard.count(0) - report.soft.count(0)) == 1
    assert report.answer is gr.Answer.yes


def test_at_a_driven_wall_a_lag_is_no_matter_of_timing():
    scene = orbit(6.0, 0.8, 0.5)
    report = gr.compare(scene, dashpot(scene, 0.8, 20.0), t_end=0.5)
    assert report.answer is gr.Answer.no
    assert report.verdict.endswith("; at a driven wall, timing affects the outcome.")
    with pytest.raises(ValueError, match=r"`observable` must be given for this scene, got None\. At a driven wall, "
                                         "a speed depends on the phase, which the duration of soft contacts "
                                         r"shifts\. Give a function of the run, such as a mean height\."):
        report.effective_restitution()
    assert isinstance(report.effective_restitution(lambda run: float(run.position[-1, 1]), resolution=3), tuple)


def test_a_closed_form_of_two_dropped_balls_needs_a_floor_at_rest():
    scene, law = gr.scenes.three_balls(), gr.LinearDashpot(1e6, 10.0)
    driven = scene.replace(floor=Sine(1e-4, 5.0))
    forced = scene.replace(external_force=[0.0, 1.0, 0.0])
    assert not math.isnan(gr.compare(scene, law, gr.ConstantRestitution(0.7), t_end=0.35).restitution_ratio)
    for one in (driven, forced):
        assert math.isnan(gr.compare(one, law, gr.ConstantRestitution(0.7), t_end=0.35).restitution_ratio)

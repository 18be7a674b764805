"""Recorded runs made small for the page: what is kept of them, what is thinned out, what is added, and their words."""

import base64
import math

import numpy as np
import pytest

import granular as gr
from granular.app.page import recording
from granular.app.page.recording import add_samples


def test_a_short_run_is_recorded_whole(cradle) -> None:
    run = gr.md.simulate(cradle.scene, gr.LinearDashpot(1e7), t_end=3e-3, samples=50)
    data = recording.recorded(run, "soft")
    assert data["whole"] == {"rows": 50, "contacts": len(run.contacts), "bodies": 4}
    path = unpacked(data["path"], "<f4").reshape(50, 4)
    np.testing.assert_allclose(path + unpacked(data["offset"], "<f4"), run.position, atol=1e-6)
    np.testing.assert_allclose(unpacked(data["energy"], "<f8"), run.energy())
    np.testing.assert_array_equal(unpacked(data["contacts"]["pair"], "<i4"), run.contacts["pair"])


def test_a_long_run_is_thinned_out_evenly_and_every_contact_is_counted(monkeypatch) -> None:
    monkeypatch.setattr(recording, "MAX_CONTACTS", 50)
    monkeypatch.setattr(recording, "MAX_SAMPLES", 20)
    scene = gr.scenes.gas(n=30)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=20 * float(scene.gap.mean()), samples=300)
    data = recording.recorded(run, "gas")
    rows = recording.evenly_spaced(300, 20)
    assert (rows[0], rows[-1], len(rows)) == (0, 299, 20)
    assert np.ptp(np.diff(rows)) <= 1
    np.testing.assert_array_equal(unpacked(data["time"], "<f8"), run.time[rows])
    assert len(unpacked(data["contacts"]["pair"], "<i4")) == 50 < data["whole"]["contacts"]
    assert unpacked(data["map"]["counts"], "<u2").sum() == len(run.contacts)


def test_soft_contacts_fill_the_map_as_long_as_they_last(cradle) -> None:
    counts = unpacked(recording.contact_map(cradle.soft)["counts"], "<u2").reshape(600, 3)
    log, span = cradle.soft.contacts, np.ptp(cradle.soft.time)
    lasting = [(counts[:, c] > 0).mean() * span for c in range(3)]
    np.testing.assert_allclose(lasting, [log["duration"][log["pair"] == c].sum() for c in range(3)], atol=span / 200)


def test_velocities_are_kept_as_shares_of_the_largest(cradle) -> None:
    run = gr.md.simulate(cradle.scene, gr.LinearDashpot(1e7), t_end=3e-3, samples=50)
    field = recording.recorded(run, "soft")["field"]
    values = unpacked(field["values"], "i1").reshape(50, field["rows"]) * field["peak"] / 127.0
    assert (field["first"], field["last"]) == (0, run.scene.n - 1)
    np.testing.assert_allclose(values, run.velocity, atol=0.51 * field["peak"] / 127.0)


def test_a_wave_narrower_than_a_lane_is_not_lost(monkeypatch) -> None:
    monkeypatch.setattr(recording, "MAP_SIZE", (600, 8))
    run = gr.edmd.simulate(gr.scenes.chain(n=40), gr.ConstantRestitution(1.0), t_end=1.0, samples=30)
    field = recording.recorded(run, "chain")["field"]
    values = unpacked(field["values"], "i1").reshape(30, 8)
    np.testing.assert_array_equal(np.abs(values).max(axis=1), 127)  # one ball moves with all the momentum at any time


@pytest.mark.parametrize(
    ("scene", "end"),
    [
        (gr.scenes.bouncing_ball(), 20.0),
        (gr.scenes.column(n=4).replace(external_force=[0.0, -1.0, 0.5, 0.0, -2.0]), 1.0),
        (gr.scenes.ring_gas(n=12), 3.0),
        (gr.scenes.heated_gas(n=12), 3.0),
        (gr.scenes.pendulum_cradle(n=3, rest_gap=1e-3), 3.0),
    ],
    ids=["collapse", "forces", "ring", "thermal", "pendula"],
)
def test_a_hard_run_with_few_rows_gets_those_that_the_engine_would_have_recorded(scene, end) -> None:
    """Before, a collapse was drawn with straight lines between a handful of rows."""
    rule = gr.ConstantRestitution(0.8)
    run = gr.edmd.simulate(scene, rule, t_end=end, samples=3)
    more = add_samples(run, 3000)
    assert len(more.time) > len(run.time) + 2 * len(np.unique(run.contacts["t_begin"])) - 2
    last = np.append(np.diff(more.time) > 0.0, True)  # of two rows at a contact that after it
    asked = gr.edmd.simulate(scene, rule, t_end=end, samples=more.time[last])
    size = np.ptp(asked.position, axis=0).max()
    np.testing.assert_allclose(more.position[last], asked.position, atol=1e-8 * size)  # bounces beyond the log: 2e-9
    np.testing.assert_allclose(more.gap[last], asked.gap, atol=1e-8 * size)
    log = run.contacts["t_begin"]
    away = last & ~np.isin(more.time, log) & (more.time < (log[-1] if run.status.name == "collapse" else np.inf))
    fastest = np.abs(asked.velocity).max()
    np.testing.assert_allclose(more.velocity[away], asked.velocity[away[last]], atol=1e-8 * fastest)


def test_rows_are_added_only_where_they_follow_from_the_log() -> None:
    scene, rule = gr.scenes.bouncing_ball(), gr.ConstantRestitution(0.8)
    unlogged = gr.edmd.simulate(scene, rule, t_end=2.0, samples=9, log=False)
    soft = gr.md.simulate(scene, gr.LinearDashpot(1e5), t_end=1.0, samples=9)
    shaken = gr.edmd.simulate(gr.scenes.vibrated_column(n=2), rule, t_end=0.2, samples=9)
    assert all(add_samples(run, 3000) is run for run in (unlogged, soft, shaken))
    assert add_samples(gr.edmd.simulate(scene, rule, t_end=2.0, samples=9), 12).time.shape == (9,)
    mass, radius, gap = [np.inf, 0.03, 0.03], [0.0, 0.01, 0.01], [0.0, 7e-4]
    resting = gr.Scene(mass=mass, radius=radius, gap=gap, velocity=[0.0] * 3, gravity=9.81)
    ends_in_a_contact = gr.edmd.simulate(resting, gr.ConstantRestitution(0.9), max_events=6)
    assert add_samples(ends_in_a_contact, 3000) is ends_in_a_contact  # before, the ball at rest fell through the floor


def test_energy_falls_in_steps_and_only_what_is_needed_is_written() -> None:
    run = gr.edmd.simulate(gr.scenes.bouncing_ball(), gr.ConstantRestitution(0.8), t_end=20.0, samples=3)
    data = recording.recorded(run, "ball")
    time, energy = unpacked(data["time"], "<f8"), unpacked(data["energy"], "<f8")
    assert (np.abs(np.diff(energy))[np.diff(time) > 0.0] < 1e-9 * energy[0]).all()
    assert data["map"] is None
    assert data["contacts"]["end"] is None
    assert data["whole"]["rows"] == len(run.time)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (gr.scenes.gas(n=5), "5 balls, walls at both ends"),
        (gr.scenes.three_balls(), "2 balls, floor, g = 9.81 m/s²"),
        (gr.scenes.ring_gas(n=5), "5 balls, ring"),
        (gr.scenes.heated_gas(n=5), "5 balls, walls at both ends, left wall Thermal(temperature=2, seed=1), right wall "
         "Thermal(temperature=1, seed=1)"),
    ],
)
def test_the_ends_of_a_scene_are_floor_and_ceiling_only_where_things_fall(scene, words) -> None:
    assert recording.scene_in_words(scene) == words


def test_a_recorded_run_says_what_it_was_made_of() -> None:
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    soft = dict(recording.recorded(gr.md.simulate(scene, law, t_end=0.33), "soft")["about"])
    assert soft["law or rule"].count("k=5e+07") == soft["law or rule"].count("ε = 0.7") == 2
    assert soft["radii, m"] == "0.1, 0.01"
    hard = recording.recorded(gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=0.1), "hard")
    assert dict(hard["about"])["law or rule"] == "ConstantRestitution(restitution=0.7)"
    assert hard["upright"]


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def test_a_wall_that_is_shaken_is_drawn_where_it_is():
    run = gr.md.simulate(
        gr.Scene([math.inf, 1.0], [0.0, 0.1], [5.0], [0.0, 0.0], floor=gr.walls.Sine(0.5, 1.0)), gr.LinearDashpot(1e4),
        t_end=1.0, method="verlet", dt=1e-3, samples=201)
    data = recording.recorded(run, "wall")
    path, offset = (np.frombuffer(base64.b64decode(data[name]), np.float32) for name in ("path", "offset"))
    assert path.reshape(201, 2)[:, 0] + offset[0] == pytest.approx(0.5 * np.sin(2.0 * math.pi * run.time), abs=1e-6)
    assert data["account"] == []


def test_real_balls_have_their_names_and_others_numbers() -> None:
    case = gr.cases.make("real-balls", lower="basketball", upper="golf ball", gap=1e-3)
    run = gr.edmd.simulate(case.scene, case.rule, t_end=0.1)
    assert recording.recorded(run, "run")["kinds"] == {1: "basketball", 2: "golf ball"}
    chain = gr.edmd.simulate(gr.scenes.chain(n=3), gr.ConstantRestitution(1.0), t_end=0.1)
    assert recording.recorded(chain, "run")["kinds"] == {}
    laws = [gr.ConstantRestitution(0.9), gr.ConstantRestitution(0.8)]
    assert recording.about(gr.edmd.simulate(chain.scene, laws, t_end=0.1))[0][1].startswith("pair 1–2: ")

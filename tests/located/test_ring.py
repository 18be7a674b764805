"""Soft spheres on a ring by located events: closed forms, modes, symmetries, islands all around."""

import math

import numpy as np
import pytest

import granular as gr
from granular.laws.kinds import checked
from granular.md import isolation
from granular.md.located import Run, pace, system
from granular.md.located.islands import correct_sum_of_gaps
from granular.run.drive import Pause, checked_request
from tests.helpers.soft_blocks import check_blocks
from tests.helpers.soft_twin import distance, twin

LAWS = [gr.LinearDashpot(1e4, 3.0), gr.LinearDashpot(1e4), gr.Hertz(1e5), gr.ViscoelasticHertz(1e5, 50.0),
        gr.TsujiHertz(1e5, 0.4)]
PLASTIC = gr.WaltonBraun(1e4, 2e4)


def crowd(rng, most=7):
    """Balls on a ring that touch, overlap or fly."""
    n = int(rng.integers(2, most))
    gap = rng.choice([-1e-4, 0.0, 0.0, 1e-5, 0.01, 0.1], n)
    velocity = rng.choice([0.0, 1.0, -1.0, 0.3], n)
    return gr.Scene(rng.uniform(0.5, 2.0, n), [0.1] * n, gap, velocity, ring=True)


def rolled(scene, by):
    """The same ring, numbered from another ball on."""
    arrays = {name: np.roll(getattr(scene, name), -by) for name in ("mass", "radius", "gap", "velocity")}
    return scene.replace(**arrays)


def test_two_balls_meet_on_either_side_in_turn():
    scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [0.3, 0.7], [0.5, -0.5], ring=True)
    law = gr.LinearDashpot.from_restitution(0.9, 1e8, scene.pairs[0])
    met = gr.md.simulate(scene, law, t_end=17.0)
    lasts, t, u, want = met.contacts["duration"][0], 0.3, 1.0, []
    for _ in range(10):
        want.append(t)
        u *= 0.9
        t += lasts + (1.0 + law.gamma * u / law.k) / u
    hard = 0.3 + sum(0.9**-j for j in range(1, 10))
    assert met.contacts["pair"].tolist() == [0, 1] * 5
    assert met.contacts["t_begin"] == pytest.approx(want, abs=1e-13)
    assert met.contacts["t_begin"][9] == pytest.approx(hard, abs=3e-3)
    assert met.stats["isolated"] == 10


def test_points_on_a_ring_without_room_end_at_their_time():
    """All lengths of the scene are 0, so the rounding error of the gaps is measured by the gaps at the end."""
    rng = np.random.default_rng(15)
    for n in range(2, 9):
        scene = gr.Scene(rng.uniform(0.5, 2.0, n), [0.0] * n, [0.0] * n, rng.normal(size=n), ring=True)
        run = gr.md.simulate(scene, gr.LinearDashpot(1e4, 3.0), t_end=0.01)
        assert run.status is gr.Status.time, run.message
        assert abs(run.gap[-1].sum()) <= 1e-15 * abs(run.gap[-1]).sum()


@pytest.mark.parametrize("j", range(1, 8))
def test_modes_of_a_ring_under_pressure_come_back(j):
    bent = 1e-4 * np.cos(2.0 * math.pi * j * np.arange(8) / 8.0)
    scene = gr.Scene(np.ones(8), np.full(8, 0.1), -1e-3 + np.roll(bent, -1) - bent, np.full(8, 0.3), ring=True)
    omega = 2.0 * math.sqrt(100.0) * math.sin(math.pi * j / 8.0)
    back = gr.md.simulate(scene, gr.LinearDashpot(100.0), t_end=2.0 * math.pi / omega)
    assert back.gap[-1] == pytest.approx(scene.gap, abs=1e-17)
    assert back.velocity[-1] == pytest.approx(scene.velocity, abs=1e-15)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(6))
def test_symmetries(seed):
    rng = np.random.default_rng([3, seed])
    scene, law, options = crowd(rng), LAWS[seed % 5], {"t_end": 0.12, "max_steps": 4000}
    scene = scene.replace(velocity=scene.velocity + 0.1 * rng.normal(size=scene.n))
    one = gr.md.simulate(scene, law, samples=np.linspace(0.0, 0.12, 7), **options)
    scale, energy = 1.0 + 100.0 * len(one.contacts), one.energy()
    assert (np.diff(energy) <= 1e-13 * energy[0]).all()
    assert one.momentum() == pytest.approx(one.momentum()[0], abs=1e-13)
    assert one.gap.sum(axis=1) == pytest.approx(scene.gap.sum(), abs=1e-14)
    over = one.contacts[~np.isnan(one.contacts["t_end"])]
    seen = gr.md.simulate(scene, law, samples=[0.0, *np.sort(over["t_end"])], **options)
    for row in over:
        at = np.searchsorted(seen.time, row["t_end"])
        lower, upper = scene.bodies(int(row["pair"]))
        assert seen.velocity[at, [lower, upper]] == pytest.approx(row["v_out"], abs=1e-11)
    for by in range(1, min(scene.n, 4)):
        other = gr.md.simulate(rolled(scene, by), law, **options)
        assert np.roll(other.velocity[-1], by) == pytest.approx(one.velocity[-1], abs=1e-12 * scale)
        assert len(other.contacts) == len(one.contacts)
        if scene.gap.sum() > 0.0:  # else one contact begins as another ends
            assert other.stats["isolated"] == one.stats["isolated"]
    boosted = gr.md.simulate(scene.replace(velocity=scene.velocity + 3.0), law, **options)
    assert boosted.velocity[-1] - 3.0 == pytest.approx(one.velocity[-1], abs=1e-12 * scale)
    mirrored = scene.replace(mass=scene.mass[::-1], gap=np.roll(scene.gap[::-1], -1), velocity=-scene.velocity[::-1])
    other = gr.md.simulate(mirrored, law, **options)
    assert -other.velocity[-1][::-1] == pytest.approx(one.velocity[-1], abs=1e-12 * scale)


@pytest.mark.parametrize("law", LAWS[1:3])
def test_elastic_rings_go_back(law):
    scene = gr.Scene([1.0, 2.0, 0.5, 1.0], [0.1] * 4, [1e-3, 0.0, -1e-4, 0.02], [1.0, -0.5, 0.2, 0.3], ring=True)
    there = gr.md.simulate(scene, law, t_end=0.15)
    back = gr.md.simulate(scene.replace(gap=there.gap[-1], velocity=-there.velocity[-1]), law, t_end=0.15)
    assert len(there.contacts) > 4
    assert back.gap[-1] == pytest.approx(scene.gap, abs=1e-11)
    assert back.velocity[-1] == pytest.approx(-scene.velocity, abs=1e-9)


@pytest.mark.parametrize("law", [*LAWS, PLASTIC])
@pytest.mark.parametrize("n", [2, 3])
def test_a_ring_squeezed_at_rest_rests(law, n):
    scene = gr.Scene(np.linspace(0.5, 2.0, n), [0.1] * n, [-1e-3] * n, [0.7] * n, ring=True)
    still = gr.md.simulate(scene, law, t_end=0.5)
    assert (still.force[-1] > 0.0).all()
    assert still.gap[-1] == pytest.approx(scene.gap, rel=1e-12)
    assert still.velocity[-1] == pytest.approx(scene.velocity, abs=1e-14)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(8))
def test_isolated_contacts_are_those_by_pieces(seed):
    rng = np.random.default_rng([5, seed])
    n = 2 + seed
    scene = gr.Scene(rng.uniform(0.5, 2.0, n), [0.0] * n, rng.uniform(0.05, 0.5, n), rng.normal(size=n), ring=True)
    law = [gr.LinearDashpot(1e5, 3.0), gr.Hertz(1e6), gr.ViscoelasticHertz(1e6, 20.0)][seed % 3]
    one, other = (go(scene, law, t_end=1.5, samples=11) for go in (gr.md.simulate, twin))
    assert one.stats["isolated"] >= 3
    assert distance(one, other) < 1e-11
    assert one.gap == pytest.approx(other.gap, abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_records_agree_and_runs_go_on(seed, monkeypatch):
    rng = np.random.default_rng([12, seed])
    monkeypatch.setattr(system, "EXTRA_PLACES", int(rng.choice([1, 64])))
    monkeypatch.setattr(pace, "MAX_PIECES_INTERPRETED", int(rng.integers(1, 12)))
    scene, law = crowd(rng, 10), LAWS[seed % 5]
    request = checked_request(scene, 0.0, 5.0, max_steps=10**6, log=True, max_events=10**5, until=None, samples=None,
                        on_event=None, on_progress=None)
    one = Run(scene, checked(law, scene), request, "plain", 1e-16)
    for time in (0.0, 1e-3, 3e-3, 0.02, 0.05):
        check_blocks(one.s)
        while one.to(time, False) is Pause.full:
            check_blocks(one.s)
            one.rows()
    whole = gr.md.simulate(scene, law, t_end=0.05)
    rest = gr.md.resume(gr.md.simulate(scene, law, t_end=0.0211), t_end=0.05)
    assert rest.gap[-1].tobytes() == whole.gap[-1].tobytes() == one.row(0.05).gap.tobytes()
    assert rest.velocity[-1].tobytes() == whole.velocity[-1].tobytes()


def test_the_free_length_is_given_back_what_rounding_takes():
    scene = gr.Scene([1.0, 2.0, 1.5], [0.1] * 3, [0.1, 0.4, -1e-4], [1.0, 0.0, -0.3], ring=True)
    request = checked_request(scene, 0.0, 5.0, max_steps=10**6, log=True, max_events=10**5, until=None, samples=None,
                        on_event=None, on_progress=None)
    one = Run(scene, checked(LAWS[0], scene), request, "plain", 1e-16)
    one.to(0.005, False)
    one.s.pairs[1].xi += 1e-9
    assert one.row(0.005).gap.sum() - 0.4999 == pytest.approx(-1e-9, abs=1e-15)
    one.fit(correct_sum_of_gaps)(one.s)
    assert one.row(0.005).gap.sum() == pytest.approx(0.4999, abs=1e-15)
    check_blocks(one.s)


def test_stops_limits_and_soft_event_driven():
    rng = np.random.default_rng(8)
    scene, law = crowd(rng).replace(gap=rng.uniform(0.05, 0.1, 2), mass=[1.0, 2.0], radius=[0.1] * 2,
                                    velocity=[1.0, -0.4]), LAWS[0]
    met = gr.md.simulate(scene, law, until=gr.until.contact(1, 2))
    assert (met.status, met.count(1)) == (gr.Status.until, 1)
    assert gr.md.simulate(scene, law, t_end=1e9, max_events=7).status is gr.Status.max_events
    alone = gr.md.simulate(scene, law, t_end=2.0, disturbed="ignore")
    assert alone.velocity[-1] == pytest.approx(gr.md.simulate(scene, law, t_end=2.0).velocity[-1], abs=1e-13)
    close = gr.Scene([1.0] * 3, [0.1] * 3, [1e-3, 1e-4, 0.1], [1.0, 0.0, 0.0], ring=True)
    for by in range(3):
        stop = gr.md.simulate(rolled(close, by), law, t_end=2.0, disturbed="stop")
        assert stop.status is gr.Status.disturbed
        assert stop.first_disturbed[1] == -by % 3
        assert isolation.first_disturbed(stop).startswith(
            f"pairs {stop.scene.pairs.name(-by % 3)} and {stop.scene.pairs.name((1 - by) % 3)} at t = ")
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run on a ring does not end by "
                                         r"itself\. Give t_end=, until= or max_events=\."):
        gr.md.simulate(scene, law)

"""The last row of a run that reaches its end time: the same bits whether it is the end or a sample."""

import numpy as np
import pytest

import granular as gr
from tests.helpers import scenes_at_random as draw
from tests.helpers.fuzz import bounded

LINES = ("time", "position", "velocity", "gap", "force")
ENGINES = {
    "located": lambda scene, laws, **end: gr.md.simulate(scene, laws, engine="plain", **end),
    "ignore": lambda scene, laws, **end: gr.md.simulate(scene, laws, engine="plain", disturbed="ignore", **end),
    "verlet": lambda scene, laws, **end: gr.md.simulate(scene, laws, engine="plain", dt=2e-5, **end),
    "rk4": lambda scene, laws, **end: gr.md.simulate(scene, laws, engine="plain", method="rk4", dt=3e-5, **end),
    "edmd": lambda scene, laws, **end: gr.edmd.simulate(scene, gr.ConstantRestitution(0.8), collapse="merge", **end),
}


def ends_within_a_contact(scene, laws):
    """A time within one of the first contacts, and one a little later."""
    log = gr.md.simulate(scene, laws, engine="plain", max_events=6).contacts
    log = log[log["t_end"] > log["t_begin"]]
    return [float(t) for t in (0.31 * log["t_end"] + 0.69 * log["t_begin"])[:2]]


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ENGINES)
def test_the_end_is_a_sample(engine):
    run, looked = ENGINES[engine], 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        scene = draw.scene(rng, (1, 4))
        laws = draw.laws(rng, scene, ("dashpot", "Hertz", "viscoelastic", "Tsuji"), (4.0, 6.0))
        for t_end in ends_within_a_contact(scene, laws):
            end = run(scene, laws, t_end=t_end)
            if end.status is not gr.Status.time:
                continue
            looked += 1
            for samples in (np.array([0.5 * t_end, t_end]), 5):
                sampled = run(scene, laws, t_end=t_end, samples=samples)
                for name in LINES:
                    mine, other = getattr(end, name), getattr(sampled, name)
                    if mine is not None:
                        assert mine[-1].tobytes() == other[-1].tobytes(), (seed, t_end, name)
                assert end.contacts.tobytes() == sampled.contacts.tobytes()
    assert looked > 6


@pytest.mark.rotating
@pytest.mark.parametrize("kind", ["ring", "thermal walls", "pendula"])
def test_the_end_is_a_sample_in_bounded_scenes(kind):
    looked = 0
    for seed in range(("ring", "thermal walls", "pendula").index(kind), 60, 3):
        one = bounded.generate(seed)
        log = one.run(max_events=6).contacts
        log = log[log["t_end"] > log["t_begin"]][:2]
        for t_end in (0.31 * log["t_end"] + 0.69 * log["t_begin"]).tolist():
            end, sampled = one.run(t_end=t_end), one.run(t_end=t_end, samples=[t_end])
            looked += 1
            for name in (*LINES, "ledger"):
                mine, other = getattr(end, name), getattr(sampled, name)
                assert mine is None or mine[-1].tobytes() == other[-1].tobytes(), (seed, t_end, name)
    assert looked > 5


@pytest.mark.parametrize("seed", range(8))
def test_a_run_that_ends_where_a_contact_does_logs_it_once(seed):
    """To the bit, or one number before or after it; the run that goes on has the others."""
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(2, 5)), float(10.0 ** rng.uniform(4.0, 9.0))
    velocity = np.sort(rng.uniform(-1.0, 1.0, n))[::-1]
    scene = gr.Scene(rng.uniform(0.5, 2.0, n), [0.05] * n, 10.0 ** rng.uniform(-4.0, -1.0, n - 1), velocity)
    laws = gr.Hertz(k), gr.LinearDashpot(k, 0.1 * k**0.5), gr.ViscoelasticHertz(k, 1e-4 * k), gr.LinearDashpot(k)
    law = laws[seed % 4]
    whole = gr.md.simulate(scene, law, t_end=1.0)
    for end in whole.contacts["t_end"]:
        for t_end in (end, np.nextafter(end, 2.0), np.nextafter(end, 0.0)):
            part = gr.md.simulate(scene, law, t_end=float(t_end))
            assert len(part.contacts) == part.stats["contacts"] == (whole.contacts["t_begin"] <= t_end).sum()
            over = ~np.isnan(part.contacts["t_end"])
            assert over.sum() + len(gr.md.resume(part, t_end=1.0).contacts) == len(whole.contacts)


PILE = gr.Scene([np.inf, 1.0, 1.3], [0.0] * 3, [0.02, 0.01], [0.0, 0.0, -1.0], 9.81)
DAMPED = [gr.LinearDashpot.from_restitution(0.6, 1e4, pair) for pair in PILE.pairs]
THREE = gr.Scene([1.0, 2.0, 1.0], [0.0] * 3, [0.1, 0.1], [1.0, 0.0, -2.0])
ENDINGS = {
    "max_events": lambda **rows: gr.md.simulate(PILE, DAMPED, max_events=5, engine="plain", **rows),
    "resting": lambda **rows: gr.md.simulate(PILE, DAMPED, engine="plain", **rows),
    "until": lambda **rows: gr.md.simulate(PILE, DAMPED, until=gr.until.contact(0, 2), engine="plain", **rows),
    "disturbed": lambda **rows: gr.md.simulate(PILE, DAMPED, disturbed="stop", engine="plain", **rows),
    "quiet": lambda **rows: gr.md.simulate(THREE, gr.Hertz(1e6), engine="plain", **rows),
    "fixed": lambda **rows: gr.md.simulate(
        PILE, DAMPED, max_events=2, engine="plain", dt=5e-4, method="verlet", **rows),
    "hard max_events": lambda **rows: gr.edmd.simulate(PILE, gr.ConstantRestitution(0.6), max_events=5, **rows),
    "hard until": lambda **rows: gr.edmd.simulate(
        PILE, gr.ConstantRestitution(0.6), until=gr.until.contact(0, 2), **rows),
    "hard quiet": lambda **rows: gr.edmd.simulate(THREE, gr.ConstantRestitution(1.0), **rows),
    "collapse": lambda **rows: gr.edmd.simulate(gr.scenes.bouncing_ball(), gr.ConstantRestitution(0.6), **rows),
    "bounded": lambda **rows: gr.edmd.simulate(PILE, gr.ConstantRestitution(0.6), **rows),
}


@pytest.mark.rotating
@pytest.mark.parametrize("name", ENDINGS)
def test_a_run_that_ends_by_itself_shows_its_end_once(name):
    """As the run without these rows does, to the bit, however many rows there are."""
    run = ENDINGS[name]
    end = run()
    assert end.status.name in name or name == "fixed"
    for rows in (2, 3, 10, "contacts"):
        sampled = run(samples=rows)
        assert rows == "contacts" or len(sampled.time) == rows
        assert (np.diff(sampled.time) > 0.0).all()
        for line in LINES:
            mine, other = getattr(end, line), getattr(sampled, line)
            assert mine is None or mine[-1].tobytes() == other[-1].tobytes(), (rows, line)
        if name != "collapse":  # how soon it is certain hangs on how often one looks
            assert (end.message, end.contacts.tobytes()) == (sampled.message, sampled.contacts.tobytes())


def test_a_run_that_is_over_at_its_start_has_as_many_rows_as_were_asked_for():
    parting = gr.Scene([1.0, 1.0], [0.0] * 2, [0.1], [-1.0, 1.0])
    for run in (gr.md.simulate(parting, gr.Hertz(1e6), samples=4), gr.edmd.simulate(
            parting, gr.ConstantRestitution(1.0), samples=4)):
        assert run.time.tolist() == [0.0] * 4

"""Rows change nothing about where a run ends: neither by a limit, between two events, nor by time or a condition."""

import numpy as np
import pytest

import granular as gr
from tests.helpers.scenes_at_random import laws, scene


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ["hard", "located"])
def test_a_run_ends_where_it_does_without_rows(engine):
    ends = []
    for seed in range(45):
        rng = np.random.default_rng(seed)
        s = scene(rng, walls=(0.6, 0.3, 0.2))
        t_end, most, pair = float(rng.uniform(0.05, 3.0)), int(rng.integers(0, 6)), int(rng.integers(s.n_pairs))
        until = [None, gr.until.contact(pair, int(rng.integers(1, 4))), gr.until.separated()][seed % 3]
        options = {"t_end": t_end, "max_events": most, "until": until}
        given = laws(rng, s, ["dashpot"])

        def run(s=s, given=given, options=options, **more):
            if engine == "hard":
                return gr.edmd.simulate(s, gr.ConstantRestitution(0.7), **options, **more)
            return gr.md.simulate(s, given, **options, **more, engine="plain")

        end, rows = run(), run(samples=[*np.sort(rng.uniform(0.0, t_end, 20)), t_end])
        assert rows.status is end.status, seed
        assert rows.time[-1] == end.time[-1], seed
        assert (rows.time[:-1] <= end.time[-1]).all(), seed
        assert rows.contacts.tobytes() == end.contacts.tobytes(), seed
        assert rows.velocity[-1] == pytest.approx(end.velocity[-1], rel=1e-12, abs=1e-12), seed
        ends.append(end.status)
    assert ends.count(gr.Status.max_events) > 15


def test_a_run_that_ends_at_its_start_shows_what_collided_there():
    """Where a sample showed the scene as it was given, no row showed what came of it."""
    touching = gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.0, 0.0], [1.0, 0.0, 0.0])
    for samples in (None, 3, [0.0, 1.0]):
        run = gr.edmd.simulate(touching, gr.ConstantRestitution(1.0), t_end=1.0, samples=samples, max_events=1)
        assert run.time.tolist() == [0.0, 0.0]
        assert run.velocity.tolist() == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def test_one_bounce_is_not_said_to_slow_down():
    """Of the last eighth of one collision it was said that it had taken no time."""
    ball = gr.Scene([np.inf, 1.0], [0.0, 0.1], [1.0], [0.0, 0.0], 9.81)
    run = gr.edmd.simulate(ball, gr.ConstantRestitution(0.8), max_events=1)
    assert run.message == ("the limit on the amount of work was reached at t = 0.451524 s after 1 collision; "
                           "raise max_events=, or give t_end= or until=")

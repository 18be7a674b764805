"""Work of a comparison: logs by pair, equal laws and contacts at the end are computed once."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.comparison import align, outcome


@dataclass(frozen=True, eq=False)
class Own:
    """A law that is no power, and cannot be told from another by its numbers."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi * math.sqrt(xi)


def test_log_by_pair_is_the_log_of_each_pair():
    run = gr.edmd.simulate(gr.scenes.gas(30), gr.ConstantRestitution(0.9), t_end=3.0)
    for c in range(-1, run.scene.n):
        rows = run.contacts[run.contacts["pair"] == c]
        assert run.count(c) == len(rows)
        assert run.of(c).tobytes() == rows.tobytes()


@pytest.mark.rotating
def test_laws_alike_are_computed_once_and_give_what_each_gives():
    scene = gr.scenes.gas(12)
    law = [Own(1e9), *[gr.LinearDashpot.from_restitution(0.9, k=5e7, pair=p) for p in scene.pairs[1:]]]
    report = gr.compare(scene, law, gr.ConstantRestitution(0.9), t_end=1.0)
    speed = report.impact_speed
    assert report.law_restitution == tuple(map(gr.binary.restitution, law, scene.pairs, [speed] * len(law)))
    for t, row in zip(measures.durations(report.hard, report.law), report.hard.contacts, strict=True):
        c, speed = int(row["pair"]), float(row["v_in"][0] - row["v_in"][1])
        assert t == pytest.approx(gr.binary.collision(law[c], scene.pairs[c], speed).duration, rel=1e-6)


def test_contacts_running_at_the_end_are_followed_in_one_run(monkeypatch):
    scene, runs = gr.scenes.newtons_cradle(20), []
    resume = align.md.resume
    monkeypatch.setattr(align.md, "resume", lambda *given, **options: runs.append(0) or resume(*given, **options))
    report = gr.compare(scene, gr.LinearDashpot(1e7), t_end=2e-3)
    assert sum(p.ongoing for p in report.pairs) > 2
    assert not any(math.isnan(p.soft_v_rel) for p in report.pairs if p.ongoing)
    assert 0 < len(runs) <= 2  # once until all have begun, once more until all are over


def test_time_of_a_comparison_is_linear_in_the_number_of_balls():
    """Rows of the log that are looked at, counted by numpy's own words: no pair looks at those of all others."""
    looked = []

    class Log(np.ndarray):
        def __getitem__(self, key):
            looked.append(len(self) if isinstance(key, np.ndarray) and key.dtype == bool else 0)
            return super().__getitem__(key)

    run = gr.edmd.simulate(gr.scenes.gas(300), gr.ConstantRestitution(0.9), t_end=3.0)
    watched = replace(run, contacts=run.contacts.view(Log))
    measures.crowding(watched, (gr.LinearDashpot(1e7),) * (run.scene.n - 1))
    measures.overlapping(watched)
    outcome.separations(watched)
    assert sum(looked) <= 10 * len(run.contacts)

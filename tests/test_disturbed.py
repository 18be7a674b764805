"""`disturbed="stop"` against whole runs by pieces, "ignore" against soft event-driven simulation by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scenes_at_random as at_random
from soft_twin import twin

import granular as gr
from granular.md.located import tables

INF = math.inf


def by_hand(scene: gr.Scene, laws: Any, count: int) -> list[tuple[int, float, float, float]]:
    """Pair, onset, and velocities of its bodies after the contact: events with a delay and a displacement."""
    inverse, v = scene.inverse_mass, scene.velocity.copy()
    gap, at, over = scene.gap.copy(), np.zeros(scene.n_pairs), np.zeros(scene.n_pairs)
    out = []
    for _ in range(count):
        rate = v[1:] - v[:-1]
        due = np.where(rate < 0.0, at - gap / np.where(rate < 0.0, rate, -1.0), INF)
        c = int(np.argmin(due))
        if due[c] == INF:
            break
        one = gr.binary.collision(laws[c], scene.pairs[c], -rate[c])
        lasts = one.duration + getattr(laws[c], "gamma", 0.0) / laws[c].k
        end, share = due[c] + lasts, inverse[c : c + 2] / (inverse[c] + inverse[c + 1])
        for f, of in ((c - 1, share[0]), (c + 1, share[1])):
            if 0 <= f < scene.n_pairs:
                gap[f] += rate[f] * (end - at[f]) + of * rate[c] * lasts
                at[f] = end
        v[c : c + 2] += (1.0 + one.restitution) * rate[c] * share * (1.0, -1.0)
        gap[c], at[c], over[c] = 0.0, end, end
        for f, beyond in ((c - 1, c - 2), (c + 1, c + 2)):
            if 0 <= beyond < scene.n_pairs and over[beyond] > end:
                gap[f] += (v[f + 1] - v[f]) * (over[beyond] - end)
                at[f] = over[beyond]
            if 0 <= f < scene.n_pairs:
                gap[f] = max(0.0, gap[f])
        out.append((c, float(due[c]), float(v[c]), float(v[c + 1])))
    return out


OWN = [pytest.param("own Hertz", 1e4, marks=pytest.mark.soak), pytest.param("power", 10.0, marks=pytest.mark.soak)]


@pytest.mark.parametrize(("name", "stiffness"), [("spring", 10.0), ("dashpot", 10.0), ("Hertz", 10.0), *OWN])
def test_ignored_neighbours_begin_when_the_contact_is_over(name, stiffness):
    """In a gas; of the softer balls many a contact is disturbed."""
    scene = at_random.gas(5, 6, 0.5)
    law = at_random.LAWS[name](stiffness, 0.02, 1.0)
    run = gr.md.simulate(scene, law, disturbed="ignore", max_events=40, engine="plain", log=True, max_steps=100_000)
    wanted = by_hand(scene, [law] * scene.n_pairs, 40)
    rows = np.sort(run.contacts, order="t_begin")
    assert run.stats["contacts"] == len(wanted) == 40
    if stiffness == 10.0:
        assert run.stats["isolated"] < 32
    assert rows["pair"].tolist() == [pair for pair, *_ in wanted]
    assert rows["t_begin"] == pytest.approx([t for _, t, *_ in wanted], rel=1e-10)
    free = ~np.isnan(rows["t_end"])
    seen, hand = rows["v_out"][free], np.array([[a, b] for _, _, a, b in wanted])[free]
    assert seen == pytest.approx(hand, rel=0, abs=1e-9)


def stopped(seed: int, names: Any, monkeypatch: Any, **options: Any) -> bool:
    """Hold a run that stops against the whole one by pieces; return whether it is disturbed."""
    monkeypatch.setattr(tables, "WARM", 4)
    rng = np.random.default_rng([31, seed])
    scene = at_random.scene(rng, (2, 5), walls=(0.6, 0.4, 0.3), gaps=("wide", "overlapping", "uneven"), size=1e-4)
    laws = at_random.laws(rng, scene, names, (3.0, 8.0))
    old = twin(scene, laws, engine="plain", **options)
    new = gr.md.simulate(scene, laws, disturbed="stop", engine="plain", **options)
    (time, pair), unsure = old.first_disturbed, 1e-12 * max(1e-3, new.time[-1])
    if pair < 0:
        assert new.status is old.status or gr.Status.max_events in (new.status, old.status)
        assert new.stats["isolated"] == old.stats["isolated"]
        return False
    if new.status is gr.Status.max_events and old.status is gr.Status.max_events:
        return False
    assert new.status is gr.Status.disturbed
    assert new.first_disturbed == (pytest.approx(time, rel=0, abs=unsure), pair)
    assert new.time[-1] == pytest.approx(time, rel=0, abs=unsure)
    before = old.contacts[old.contacts["t_begin"] < time - unsure]
    assert sorted(before["pair"]) == sorted(new.contacts["pair"][new.contacts["t_begin"] < time - unsure])
    return True


def test_stops_where_pieces_find_the_first_that_is_disturbed(monkeypatch):
    ends = [stopped(i, at_random.POWERS, monkeypatch, t_end=1.0, max_events=8, max_steps=500) for i in range(12)]
    assert 3 < sum(ends) < 12


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(10))
def test_stops_of_all_laws(batch, monkeypatch):
    for i in range(50):
        stopped(1000 + 50 * batch + i, tuple(at_random.LAWS), monkeypatch, t_end=1.0, max_events=12, max_steps=1500)

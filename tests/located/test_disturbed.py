"""`disturbed="stop"` against whole runs by pieces, "ignore" against soft event-driven simulation by hand."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

import granular as gr
from granular.md.located.one_contact import tables
from tests.helpers import scenes_at_random as at_random
from tests.helpers.own_laws import Holed, Shell
from tests.helpers.soft_twin import twin

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
    monkeypatch.setattr(tables, "CONTACTS_BEFORE_TABLE", 4)
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


@pytest.mark.rotating
def test_stops_where_pieces_find_the_first_that_is_disturbed(monkeypatch):
    ends = [stopped(i, at_random.POWERS, monkeypatch, t_end=1.0, max_events=8, max_steps=500) for i in range(12)]
    assert 3 < sum(ends) < 12


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(10))
def test_stops_of_all_laws(batch, monkeypatch):
    for i in range(50):
        stopped(1000 + 50 * batch + i, tuple(at_random.LAWS), monkeypatch, t_end=1.0, max_events=12, max_steps=1500)


def crowd(rng: Any, shells: bool) -> tuple[gr.Scene, list[Any]]:
    """Soft balls so close that contacts often share a time; perhaps some overlap from the start, and part or not."""
    n, floor = int(rng.integers(2, 5)), bool(rng.random() < 0.5)
    mass, velocity = [math.inf] * floor + [*rng.uniform(0.5, 2.0, n)], [0.0] * floor + [*rng.uniform(-1.0, 1.0, n)]
    gap = rng.uniform(-0.01 if rng.random() < 0.5 else 0.0, 0.1, len(mass) - 1)
    k = 10.0 ** rng.uniform(2.5, 3.5, len(gap))
    laws = [Shell(stiff, rng.uniform(0.002, 0.02), rng.choice([0.0, 10.0])) if shells and rng.random() < 0.6
            else gr.LinearDashpot(stiff, rng.choice([0.0, 10.0, 40.0])) for stiff in k]
    return gr.Scene(mass, [0.0 if m == INF else 0.5 for m in mass], gap, velocity, gravity=5.0 * floor), laws


def seen(run: gr.Trajectory) -> tuple[int, float, int]:
    """How many contacts are isolated, and since when which two neighbours overlap at once, by samples of the gaps.

    By definition: no neighbouring pair overlaps from where the balls of the contact touch to where they part. The count
    is -1 where two samples more or less on either side decide.
    """
    closed, count = run.gap < 0.0, 0
    for row in run.contacts:
        c, at = row["pair"], int(np.searchsorted(run.time, row["t_begin"])) + 1
        if at >= len(run.time) or not closed[at, c]:
            return -1, math.nan, -1
        touched = max((i + 1 for i in range(at) if not closed[i, c]), default=0)
        parted = min((i for i in range(at, len(run.time)) if not closed[i, c]), default=len(run.time))
        near = [f for f in (c - 1, c + 1) if 0 <= f < closed.shape[1]]
        less, more = (closed[max(0, touched - w) : parted + w, near].any() for w in (-2, 2))
        if less != more:
            return -1, math.nan, -1
        count += not more
    both = np.argwhere(closed[:, :-1] & closed[:, 1:])
    return count, *((run.time[both[0][0]], int(both[0][1])) if len(both) else (math.nan, -1))


def counted(seeds: Iterable[int], shells: bool) -> Counter[str]:
    """Hold the engine's counts against those of the samples."""
    tally: Counter[str] = Counter()
    for seed in seeds:
        scene, laws = crowd(np.random.default_rng([37, seed]), shells)
        run = gr.md.simulate(scene, laws, t_end=0.3, samples=401, engine="plain")
        isolated, time, pair = seen(run)
        if isolated >= 0:
            assert (run.stats["isolated"], run.first_disturbed[1]) == (isolated, pair), seed
            assert pair < 0 or 0.0 <= time - run.first_disturbed[0] + 1e-12 < 8e-4
            stopped = gr.md.simulate(scene, laws, t_end=0.3, disturbed="stop", engine="plain")
            assert stopped.time[-1] == pytest.approx(0.3 if pair < 0 else run.first_disturbed[0], abs=1e-12)
            assert pair < 0 or stopped.status is gr.Status.disturbed
        tally["sure" if isolated >= 0 else "unsure"] += 1
        tally["disturbed"] += pair >= 0
    return tally


@pytest.mark.rotating
@pytest.mark.parametrize(("shells", "many"), [(False, 8), (True, 5)])
def test_isolated_is_what_no_neighbour_overlaps(shells, many):
    tally = counted(range(many), shells)
    assert tally["unsure"] < 0.3 * many
    assert 0.2 * many < tally["disturbed"] < 0.9 * many


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(10))
def test_isolated_is_what_no_neighbour_overlaps_more(batch):
    counted(range(100 + 20 * batch, 120 + 20 * batch), True)


def test_an_overlap_without_a_push_disturbs_whichever_side_it_is_on():
    """From the start one pair pushes and the other parts too fast to; a touch before the push of a law counts too."""
    law = gr.LinearDashpot(1e3, 40.0)
    for velocity in ([0.0, -1.0, 5.0], [-5.0, 1.0, 0.0]):
        run = gr.md.simulate(gr.Scene([1.0] * 3, [0.5] * 3, [-0.01, -0.01], velocity), law, t_end=0.1)
        assert (run.stats["isolated"], run.stats["contacts"], run.first_disturbed) == (0, 1, (0.0, 0))
    scene = gr.Scene([1.0] * 3, [0.5] * 3, [0.01, 0.012], [1.0, 0.0, -1.0])
    run = gr.md.simulate(scene, [gr.LinearDashpot(1e3), Shell(1e3, 0.05)], t_end=0.1)
    assert run.first_disturbed == (pytest.approx(0.012, rel=0.1), 0)
    assert run.stats["isolated"] == 0


@pytest.mark.rotating
def test_pushes_of_one_overlap_share_its_fate():
    """A force with a hole pushes three times while its balls overlap; a third ball is there at the first push only."""
    two = gr.Scene([1.0] * 2, [0.5] * 2, [0.01], [1.0, -1.0])
    three = gr.Scene([1.0] * 3, [0.5] * 3, [0.01, -0.012], [1.0, -1.0, 1.0])
    for scene, law, isolated in ((two, [Holed(1e3)], 3), (three, [Holed(1e3), gr.LinearDashpot(1e3)], 0)):
        run = gr.md.simulate(scene, law, t_end=0.2)
        assert (run.count(0), run.stats["isolated"]) == (3, isolated)
    others = run.of(1)
    assert len(others) == 1
    assert others["t_end"][0] < run.of(0)["t_begin"][1]


@pytest.mark.rotating
def test_an_ignored_neighbour_takes_no_isolated_contact_from_the_count():
    """The first contact overlaps no other; the neighbours of the second are set back, and count for nothing."""
    scene = gr.Scene([INF, 1.2, 0.7, 1.5], [0.0, 0.5, 0.5, 0.5], [0.045, -0.017, 0.04], [0.0, 0.0, -0.1, 0.0], 9.81)
    run = gr.md.simulate(scene, gr.LinearDashpot(500.0), disturbed="ignore", t_end=0.3)
    first, second = run.contacts[:2]
    assert (first["pair"], second["pair"], second["t_begin"] > first["t_end"]) == (1, 0, True)
    assert (run.stats["isolated"], run.first_disturbed[1]) == (1, 0)

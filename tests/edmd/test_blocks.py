"""Blocks within a causal halo give the bits of the scene run as one."""

import math
import tracemalloc

import numpy as np
import pytest

from granular import edmd
from granular.edmd import compiled_queue as blocks, run as runs
from granular.edmd.queue_choice import EXPECTED_PER_PAIR
from granular.edmd.records import LOG_ROW
from granular.laws.rules import ConstantRestitution
from granular.scene import Scene
from tests.helpers.scenes_at_random import gas

pytest.importorskip("numba")


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("spread", "gravity", "eps"),
    [(0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (2.0, 0.01, 0.99), (0.0, 1.0, 1.0), (0.0, 0.0, 0.7)],
)
@pytest.mark.parametrize("log", [False, True])
def test_blocks_give_the_bits_of_one(monkeypatch, spread, gravity, eps, log) -> None:
    swept = []
    sweep = blocks.BlockQueue._sweep
    monkeypatch.setattr(blocks.BlockQueue, "_sweep", lambda self, *a: swept.append(sweep(self, *a)) or swept[-1])
    monkeypatch.setattr(blocks, "PAIRS_PER_BLOCK", 256)
    scene, runs = gas(4000, 4000, spread, gravity), []
    for large in (10**9, 100):
        monkeypatch.setattr(blocks, "BLOCKS_ABOVE", large)
        times = {"t_end": 20.0, "samples": [0.0, 3.3, 3.4, 20.0], "max_events": 10**9}
        runs.append(edmd.simulate(scene, ConstantRestitution(eps), engine="compiled", log=log, **times))
    one, many = runs
    assert one.contacts.tobytes() == many.contacts.tobytes()
    assert len(one.contacts) == log * one.stats["events"]
    assert len(swept) >= 3
    if spread == 0.0 and eps > 0.9:
        assert any(swept)
    assert one.stats == many.stats
    for key, value in one.state.items():
        assert np.array_equal(value, many.state[key], equal_nan=not isinstance(value, str)), key


def test_rows_of_blocks_come_in_the_order_of_their_times() -> None:
    """Of equal ones within a block in its own; which of two blocks is first in one instant, no block knows."""
    def rows(*given):
        made = np.zeros(len(given), LOG_ROW)
        made["pair"], made["t_begin"] = zip(*given, strict=True)
        return made

    below = rows((1, 0.5), (0, 0.5), (1, 2.0))
    both = np.concatenate(blocks.rows_by_time(np.concatenate([below, rows((7, 0.25), (8, 1.0))]), [3, 2]))
    assert both["pair"].tolist() == [7, 1, 0, 8, 1]
    assert both["t_begin"].tolist() == [0.25, 0.5, 0.5, 1.0, 2.0]
    assert blocks.rows_by_time(np.concatenate([below, rows((7, 0.25), (8, 0.5))]), [3, 2]) is None


def test_a_limit_on_the_events_is_exact_in_blocks(monkeypatch) -> None:
    monkeypatch.setattr(blocks, "PAIRS_PER_BLOCK", 256)
    monkeypatch.setattr(blocks, "BLOCKS_ABOVE", 100)
    options = {"engine": "compiled", "log": False, "max_events": 30_001}
    end = edmd.simulate(gas(2000, 2000, 1.0), ConstantRestitution(1.0), **options)
    assert end.stats["events"] == end.state["contacts"].sum() == 30_001


def test_ties_at_random_are_drawn_for_the_pairs_of_the_scene_not_of_a_block(monkeypatch) -> None:
    """Balls on a lattice at whole speeds, which collide three at a time."""
    monkeypatch.setattr(blocks, "PAIRS_PER_BLOCK", 256)
    random, n = np.random.default_rng(5), 2000
    scene = Scene([math.inf, *[1.0] * n, math.inf], np.zeros(n + 2), np.ones(n + 1), [0, *random.integers(-2, 3, n), 0])
    ends = []
    for large in (10**9, 100):
        monkeypatch.setattr(blocks, "BLOCKS_ABOVE", large)
        options = {"engine": "compiled", "log": False, "ties": "random", "seed": 3, "t_end": 4.0}
        ends.append(edmd.simulate(scene, ConstantRestitution(0.9), **options))
    assert ends[0].velocity[-1].tobytes() == ends[1].velocity[-1].tobytes()


def test_blocks_are_given_up_as_soon_as_they_hold_too_many_events(monkeypatch) -> None:
    """A run of one collision does not run the whole window first."""
    tried = []
    run = blocks.BlockQueue._run
    monkeypatch.setattr(blocks.BlockQueue, "_run", lambda self, *a: tried.append(a) or run(self, *a))
    monkeypatch.setattr(blocks, "PAIRS_PER_BLOCK", 512)
    monkeypatch.setattr(blocks, "BLOCKS_ABOVE", 100)
    end = edmd.simulate(gas(8000, 8000), ConstantRestitution(1.0), engine="compiled", log=False, max_events=1)
    assert (end.stats["events"], len(tried)) == (1, 1)


def test_a_large_scene_takes_250_bytes_a_ball() -> None:
    """The state, one more while blocks run, and the rows: the most that Python and numpy hold at a time."""
    n, rule = 130_000, ConstantRestitution(1.0)
    options = {"engine": "compiled", "log": False, "max_events": 10**9, "t_end": 1.0}
    edmd.simulate(gas(n, n), rule, **options)  # machine code is loaded
    scene = gas(n, n)
    tracemalloc.start()
    try:
        end = edmd.simulate(scene, rule, **options)
        assert end.stats["events"] > 10_000
        assert tracemalloc.get_traced_memory()[1] < 260 * n  # 10 of them for what a block takes, less in larger scenes
    finally:
        tracemalloc.stop()


def test_a_closer_look_in_a_large_scene_keeps_a_log_of_bounded_size(monkeypatch) -> None:
    """Whatever `max_events`: the rows of all of them would not fit into any memory."""
    monkeypatch.setattr(blocks, "BLOCKS_ABOVE", 100)
    scene = Scene([math.inf, *[1.0] * 120], np.zeros(121), np.linspace(1.0, 2.0, 120), np.zeros(121), 1.0)
    ends = [edmd.simulate(scene, ConstantRestitution(0.5), engine=e, max_events=10**15) for e in ("sorted", "compiled")]
    assert ends[0].status.name == "collapse"
    assert ends[0].contacts.tobytes() == ends[1].contacts.tobytes()


def test_auto_begins_compiled_where_the_first_collisions_of_all_pairs_are_work_enough(monkeypatch) -> None:
    """Unless no more are asked for."""
    asked = []
    limit = 500 * EXPECTED_PER_PAIR
    monkeypatch.setattr(runs, "compilation_pays", lambda work, has: asked.append(work) or work >= limit)
    for n, most, engine in ((100, 10**6, "sorted"), (600, 10**6, "compiled"), (600, 1, "sorted")):
        run = edmd.simulate(gas(n, n), ConstantRestitution(1.0), max_events=most, t_end=1e-9)
        assert run.stats["engine"] == engine
    assert asked[0] == 101 * (1 + EXPECTED_PER_PAIR)


def test_auto_goes_over_as_soon_as_the_pace_tells_that_it_pays(monkeypatch) -> None:
    """Not only when as much has been done; and never for what `max_events` does not leave."""
    asked = []
    monkeypatch.setattr(runs, "compilation_pays", lambda work, has: asked.append(work) or work >= 100_000)
    scene, rule = gas(100, 100), ConstantRestitution(1.0)
    whole = edmd.simulate(scene, rule, t_end=2000.0, log=False, max_events=10**9)
    assert whole.stats["engine"] == "compiled"
    assert len(asked) < 16  # some thousand collisions, of 100 000
    assert 0.5 < asked[-1] / whole.stats["events"] < 2.0
    assert edmd.simulate(scene, rule, t_end=2000.0, log=False, max_events=20_000).stats["engine"] == "sorted"

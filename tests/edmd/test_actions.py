"""Random actions on a run's state and queues leave them whole; what each must be is said in `whole_states`."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from granular import edmd
from granular._engine.records import column
from granular.edmd import collapse, compiled_queue as blocks
from granular.edmd.checkpoint import checkpoint, is_consistent, restored_state
from granular.edmd.compiled_queue import TreeQueue
from granular.edmd.physics import checked
from granular.edmd.records import LATER, NEVER
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State
from granular.laws.rules import ConstantRestitution
from granular.scene import Scene
from tests.helpers.whole_states import check_queue

ACTIONS = ("events", "until", "shift", "advance_slice", "change", "copy", "saved")


def drawn(seed, n, gravity):
    """Return unequal balls, some touching, on a floor or between walls."""
    random = np.random.default_rng(seed)
    mass = [math.inf, *np.exp(random.uniform(-1.0, 1.0, n))] + [math.inf] * (seed % 2)
    gap = random.uniform(0.1, 1.0, len(mass) - 1) * (random.random(len(mass) - 1) < 0.8)
    return Scene(mass, np.zeros(len(mass)), gap, random.normal(size=len(mass)) * np.isfinite(mass), gravity)


class Acting:
    """A state and its queue, on which actions are done one after the other."""

    def __init__(self, seed, scene, eps, queues, **options):
        self.random, self.queues = np.random.default_rng(seed), queues
        options = {"ties": "left", "seed": 3, "collapse": "stop", "merge_below": None, "tc": 0.0, "elastic_below": 0.0
                   } | options
        self.physics = checked(scene, ConstantRestitution(eps), **options)
        self.state = State.of(self.physics, 0.0)
        self.state.set(stop_pair=NEVER, last_event=10**9)
        self.queue = queues[0](self.state, self.physics)

    def edge(self):
        return math.nextafter(float(self.state.clock.window), 0.0)

    def one_more(self):
        """Let one more collision act, and make its pair the suspect; return whether that was possible."""
        s, log = self.state, []
        before = s.run.events
        self.queue.advance(self.edge(), 1, log)
        if s.run.events != before + 1:
            return False
        c = int(column([rows for rows in log if len(rows)][-1], "pair")[-1])
        u, pair = column(s.bodies, "fall_velocity"), s.pairs[c]
        s.set(suspect=c, rebound=float(u[c + 1] - u[c] - pair["closing_acceleration"] * s.run.now))
        return True

    def do(self, action):
        s, run = self.state, self.state.run
        if action in ("events", "until"):
            part = self.random.random() if action == "until" else 1.0
            edge = run.now + part * (self.edge() - run.now)
            why = self.queue.advance(edge, int(self.random.integers(1, 40)), [])
            if why == LATER and self.queue.soonest() == math.inf:
                run.now = edge
        elif action == "shift":
            due = self.queue.soonest()
            s.shift_to(due if due < math.inf else run.now, self.queue.kernel)
            self.queue.rebuild()
        elif action == "advance_slice" and self.one_more():
            collapse.begin(s, self.queue)
            collapse.advance_slice(s, self.physics, self.queue, self.edge(), int(self.random.integers(0, 30)), [])
            if s.near is not None:
                collapse.end_slice(s, self.queue)
        elif action == "change":
            self.queue = self.queues[int(self.random.integers(len(self.queues)))](s, self.physics)
        elif action == "copy":
            self.queue.state = self.state = s.copied()
        elif action == "saved":
            saved = {k: np.array(v) for k, v in checkpoint(s, s.numbers(), {}).items()} | self.physics.options
            self.state = restored_state(self.physics, saved)
            self.state.set(stop_pair=NEVER, last_event=10**9, suspect=-1)
            self.queue = type(self.queue)(self.state, self.physics)
        self.check()

    def check(self):
        assert is_consistent(self.state)
        check_queue(self.queue)


@given(
    seed=st.integers(0, 10**6), n=st.integers(2, 80), gravity=st.sampled_from([0.0, 1.0]),
    eps=st.sampled_from([1.0, 0.7]),
    extra=st.sampled_from([{}, {"ties": "right"}, {"ties": "random"}, {"ties": "poisson"}, {"collapse": "merge"}]),
    actions=st.lists(st.sampled_from(ACTIONS), min_size=4, max_size=10),
)
@settings(max_examples=40, deadline=None)
def test_interpreted_state_and_queue_stay_whole(seed, n, gravity, eps, extra, actions) -> None:
    acting = Acting(seed, drawn(seed, n, gravity), eps, [SortedQueue], **extra)
    for action in ("events", *actions):
        acting.do(action)


@pytest.mark.rotating
@pytest.mark.parametrize("third", range(3))
def test_compiled_queues_stay_whole(third, monkeypatch) -> None:
    """The same, going to and fro between the tree and blocks; windows that blocks run are seen."""
    pytest.importorskip("numba")
    monkeypatch.setattr(blocks, "PAIRS_PER_BLOCK", 64)
    swept, sweep = [], blocks.BlockQueue._sweep
    monkeypatch.setattr(blocks.BlockQueue, "_sweep", lambda self, *a: swept.append(sweep(self, *a)) or swept[-1])
    for seed in range(third, 6, 3):
        random = np.random.default_rng(seed)
        scene = drawn(seed, int(random.integers(300, 600)), float(seed % 3 == 0) * 1e-3)
        extra = [{}, {"ties": "right"}, {"ties": "random"}, {"collapse": "merge"}][seed % 4]
        acting = Acting(seed, scene, (1.0, 0.9)[seed % 2], [TreeQueue, blocks.BlockQueue], **extra)
        for action in ("change", *random.choice(ACTIONS, 6)):
            acting.do(action)
            now = float(acting.state.run.now)
            acting.queue.advance(now + 0.01 * (acting.edge() - now), 10**9, None)
            assert is_consistent(acting.state)
    assert any(swept)


@pytest.mark.parametrize("damage", ["gap", "due", "closing_acceleration", "contacts"])
def test_damage_is_seen(damage) -> None:
    """Each of the checks can fail."""
    acting = Acting(1, drawn(1, 12, 1.0), 0.9, [SortedQueue])
    acting.do("events")
    pair = acting.state.pairs[2]
    if damage == "due":
        entry = acting.queue.queue[1]
        time, c = min(entry)
        entry[c] = (time + 1.0, c)
    else:
        setattr(pair, damage, -1.0 if damage != "contacts" else pair.contacts + 1)
    with pytest.raises(AssertionError):
        acting.check()


def test_merges_are_counted_in_blocks_too(monkeypatch) -> None:
    """Those of the whole scene, each once, though blocks overlap: they were lost."""
    pytest.importorskip("numba")
    monkeypatch.setattr(blocks, "PAIRS_PER_BLOCK", 256)
    swept, sweep = [], blocks.BlockQueue._sweep
    monkeypatch.setattr(blocks.BlockQueue, "_sweep", lambda self, *a: swept.append(sweep(self, *a)) or swept[-1])
    random, stats = np.random.default_rng(5), []
    scene = Scene(np.ones(2000), np.zeros(2000), random.uniform(0.5, 1.5, 1999), random.normal(size=2000))
    for large in (10**9, 100):
        monkeypatch.setattr(blocks, "BLOCKS_ABOVE", large)
        options = {"collapse": "merge", "merge_below": 0.05, "engine": "compiled", "log": False, "t_end": 30.0,
                   "samples": 31}
        stats.append(edmd.simulate(scene, ConstantRestitution(0.7), **options).stats)
    assert stats[0] == stats[1]
    assert stats[0]["merged"] > 10
    assert len(swept) > 10


def test_walls_stay_exact_when_a_group_hits_them() -> None:
    """What rounding leaves of the velocities of a group is none of a wall's: later, slow balls are to reach it."""
    scene = Scene([math.inf, 1.0, 2.0, math.inf], np.zeros(4), [1.0, 0.0, 1.0], [0.0, -1.0, -1.0, 0.0])
    end = edmd.simulate(scene, ConstantRestitution(0.5), ties="poisson", max_events=4)
    assert end.contacts["t_begin"][0] == end.contacts["t_begin"][1]
    assert end.state["noise"][1:3].all()
    assert not end.state["noise"][[0, 3]].any()

"""The records of islands under random actions: pool, free list, queue and clocks never contradict each other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from granular._engine.kernels import have_numba
from granular.laws import Hertz, LinearDashpot, TsujiHertz, ViscoelasticHertz
from granular.laws.kinds import checked
from granular.md.located import Run, pace, run, system
from granular.run.drive import Pause, checked_request
from granular.scene import Scene
from tests.helpers.soft_blocks import check_blocks

LAWS = [LinearDashpot(1e4, 3.0), LinearDashpot(1e4), Hertz(1e6), ViscoelasticHertz(1e6, 50.0), TsujiHertz(1e6, 0.4)]
NOTHING_ASKED: dict[str, Any] = {"until": None, "samples": None, "on_event": None, "on_progress": None}


def crowd(rng: Any) -> Scene:
    """Balls that touch, overlap or fly, on a floor or not."""
    n, floor = int(rng.integers(2, 12)), bool(rng.random() < 0.5)
    gap = rng.choice([-1e-4, 0.0, 0.0, 1e-5, 0.01, 0.1], n - 1 + floor)
    wall = [math.inf] * floor
    velocity = [0.0] * floor + np.round(rng.choice([0.0, 1.0, -1.0, 0.3], n), 1).tolist()
    return Scene([*wall, *rng.uniform(0.5, 2.0, n)], [*(0.0 for _ in wall), *[0.1] * n], gap, velocity, 9.81 * floor)


def started(scene: Scene, law: Any, engine: str) -> Run:
    request = checked_request(scene, 0.0, 5.0, max_steps=1_000_000, log=True, max_events=100_000, **NOTHING_ASKED)
    return Run(scene, checked(law, scene), request, engine, 1e-16)


@pytest.mark.parametrize("seed", range(8))
def test_records_agree_under_random_actions(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks of any length, a pool that grows, rows read, contacts taken, a change to machine code under way."""
    rng = np.random.default_rng([12, seed])
    monkeypatch.setattr(system, "EXTRA_PLACES", int(rng.choice([1, 4, 64])))
    monkeypatch.setattr(pace.CompilationCost, "due", lambda *_: False)
    monkeypatch.setattr(run.CompilationCost, "due", lambda self, ahead=0.0: False)
    scene, law = crowd(rng), LAWS[seed % len(LAWS)]
    one, whole = started(scene, law, "auto"), started(scene, law, "plain")
    time, taken = 0.0, 0
    check_blocks(one.s)
    for _ in range(25):
        monkeypatch.setattr(pace, "MAX_PIECES_INTERPRETED", int(rng.integers(1, 12)))
        monkeypatch.setattr(pace, "MAX_PIECES_COMPILED", int(rng.integers(1, 12)))
        time += float(rng.choice([0.0, 1e-4, 2e-3]))
        while one.to(time, False) is Pause.full:
            check_blocks(one.s)
        taken += sum(map(len, one.rows()))
        check_blocks(one.s)
        if seed < 2 and one.engine == "auto" and rng.random() < 0.1 and have_numba():
            one.compile()
            check_blocks(one.s)
    while whole.to(time, False) is Pause.full:
        pass
    for here, there in zip(one.row(time)[2:], whole.row(time)[2:], strict=True):
        assert here is there or here.tobytes() == there.tobytes()
    assert taken <= one.progress()[1]


def broken(name: str, value: Any) -> Any:
    """Records of a row of balls under way, one of them wrong."""
    row = started(Scene([1.0] * 4, [0.1] * 4, [0.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.0]), LAWS[2], "plain")
    row.to(1e-4, False)
    setattr(row.s.pairs[0], name, value)
    return row.s


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("hi", 1, "one block"),
        ("slot", -1, "as many places"),
        ("slot", 1, "once"),
        ("first", 1, "one block"),
        ("due", -1.0, "queue"),
    ],
)
def test_contradictions_are_seen(name: str, value: Any, sentence: str) -> None:
    """Each of them by its own sentence."""
    with pytest.raises(AssertionError, match=sentence):
        check_blocks(broken(name, value))

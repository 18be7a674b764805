"""Compiled and interpreted: the same bits. One compilation for the whole file."""

from __future__ import annotations

import math
import sys
import tracemalloc
from typing import Any

import numpy as np
import pytest

from granular import until
from granular.cases.scenes import gas
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz, ViscoelasticHertz
from granular.md import simulate as run
from granular.md.located.many import Scenes, solve_many
from granular.md.located.records import SOFT_PAIR_RECORD
from granular.run.trajectory import Status
from granular.scene import Scene
from granular.scene.walls import Thermal

pytest.importorskip("numba")

LAWS: list[Any] = [
    LinearDashpot(5e7, 1500.0), LinearDashpot(5e7), Hertz(1e7), ViscoelasticHertz(1e7, 2e3), TsujiHertz(1e7, 0.4),
    PowerLaw(1e8, 4.0 / 3.0), PowerLaw(1e8, 2.0),
]
SCENE = Scene([math.inf, 3.77, 0.00377], [0.0, 0.1, 0.01], [0.0, 1e-4], [0.0, -3.0, -3.0], 9.81)
CHAIN = Scene([1.0] * 5, [0.1] * 5, [0.0, 0.0, 1e-5, 0.1], [1.0, 0, 0, 0, -0.5])


@pytest.mark.parametrize("law", LAWS, ids=lambda law: str(law))
@pytest.mark.parametrize("scene", [SCENE, CHAIN], ids=["two balls", "chain"])
def test_same_bits(law: Any, scene: Scene) -> None:
    """Every row of the log and of the samples."""
    laws, times = (law,) * (scene.n - 1), np.linspace(0.0, 0.02, 7)
    plain, fast = (run(scene, laws, t_end=0.02, samples=times, engine=engine) for engine in ("plain", "compiled"))
    assert fast.stats["engine"] == "compiled"
    for name in ("time", "position", "velocity", "gap", "force", "contacts"):
        assert getattr(plain, name).tobytes() == getattr(fast, name).tobytes(), name
    assert plain.status is fast.status
    assert plain.stats["steps"] == fast.stats["steps"]


def test_auto_changes_to_compiled_under_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """`auto` starts interpreted and goes on compiled; nobody sees it in the numbers."""
    driver = sys.modules["granular.md.located.run"]
    looks = iter(range(100_000))
    monkeypatch.setattr(driver.CompilationCost, "due", lambda self, ahead=0.0: next(looks) > 4)
    walls = Scene([math.inf, 1.0, 1.0, math.inf], [0.0] * 4, [0.01] * 3, [0.0, 1.0, -0.5, 0.0])
    changed, plain = (run(walls, (LinearDashpot(1e5),) * 3, t_end=8.0, engine=engine) for engine in ("auto", "plain"))
    assert changed.stats["engine"] == "compiled"
    assert changed.contacts.tobytes() == plain.contacts.tobytes()


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ["plain", "compiled"])
def test_solve_many_is_simulate_many_times(engine: str) -> None:
    """A map over the gap: counts, times and velocities are those of single runs, bit for bit."""
    gaps = np.array([SCENE.replace(gap=[0.0, gap]).gap for gap in (0.0, 1e-6, 1e-5, 1e-4, 1e-3)])
    law = LinearDashpot(5e7, 1500.0)
    scenes = Scenes(SCENE.mass, gaps, SCENE.velocity, [[law.k, 1.0, law.gamma, 0.0]] * 2, 9.81)
    many = solve_many(scenes, until=until.contact(0, 2), engine=engine)
    for i, gap in enumerate(gaps):
        soft = run(SCENE.replace(gap=gap), (law,) * 2, until=until.contact(0, 2), engine="plain")
        last = soft.of(1)[-1]
        assert many.counts[i].tolist() == [soft.count(0), soft.count(1)]
        assert many.time[i] == soft.time[-1]
        assert (many.t_end[i, 1], many.v_lower[i, 1], many.v_upper[i, 1]) == (last["t_end"], *last["v_out"])
        assert many.longest[i, 1] == soft.of(1)["duration"].max()
        assert np.cumsum(many.rate[i]).tolist() == soft.velocity[-1][1:].tolist()
        assert not many.ongoing[i].any()
        assert list(Status)[many.status[i]] is soft.status


def test_solve_many_leaves_balls_that_come_to_rest_to_simulate() -> None:
    """A run without an end goes on from the proof until its overlaps are static."""
    pile = Scene([math.inf, 1.0, 0.1], [0.0, 0.1, 0.1], [1e-3, 1e-3], [0.0] * 3, 9.81)
    scenes = Scenes(pile.mass, [pile.gap], pile.velocity, [[1e5, 1.0, 300.0, 0.0]] * 2, 9.81)
    many = solve_many(scenes, engine="plain")
    alone = run(pile, (LinearDashpot(1e5, 300.0),) * 2, engine="plain")
    assert alone.status is Status.resting
    assert many.time[0] < alone.time[-1]
    assert many.status.tolist() == [-1]


@pytest.mark.rotating
def test_cells_that_want_more_tables_than_there_is_room_for_get_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ball that bounces through the octaves of speed, each with a table; single runs make room, to the same bits."""
    monkeypatch.setattr(sys.modules["granular.md.located.one_contact.tables"], "CONTACTS_BEFORE_TABLE", 1)
    monkeypatch.setattr(sys.modules["granular.md.located.system"], "INITIAL_TABLES", 2)
    ball, k = Scene([math.inf, 1.0], [0.0, 0.1], [0.5], [0.0, 0.0], 9.81), 1e9
    ends, gamma = [0.4, 0.78], 0.8 * k**0.6
    scenes = Scenes(ball.mass, [ball.gap] * 2, ball.velocity, [[k, 1.5, gamma, 0.5]], 9.81)
    many = solve_many(scenes, t_end=ends, engine="plain")
    alone = [run(ball, (ViscoelasticHertz(k, gamma),), t_end=end, engine="plain") for end in ends]
    assert alone[0].stats["tables"] <= 2 < alone[1].stats["tables"]
    assert many.status.tolist() == [list(Status).index(Status.time)] * 2
    assert many.rate[:, 0].tolist() == [one.velocity[-1, 1] for one in alone]


ROW = Scene([1.0] * 60, [0.1] * 60, [0.3, *[0.0] * 58], [1.0, *[0.0] * 59])
COUPLES = Scene([1.0] * 80, [0.1] * 80, [0.1, 1.0] * 39 + [0.1], [1.0, -1.0] * 40)


@pytest.mark.parametrize("engine", ["plain", "compiled"])
@pytest.mark.parametrize("scene", [ROW, COUPLES], ids=["one event, many pairs", "many islands"])
def test_a_pool_that_grows_leaves_no_trace(scene: Scene, engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for one pair in an island, or for all of them from the start: the same bits."""
    runs = []
    for room in (1, scene.n):
        monkeypatch.setattr(sys.modules["granular.md.located.system"], "EXTRA_PLACES", room)
        runs.append(run(scene, (Hertz(1e6),) * (scene.n - 1), t_end=0.5, max_steps=250, engine=engine))
    for name in ("position", "velocity", "gap", "force", "contacts"):
        assert getattr(runs[0], name).tobytes() == getattr(runs[1], name).tobytes(), name
    assert repr(runs[0].stats) == repr(runs[1].stats)  # nan may be among them
    assert runs[0].stats["contacts"] >= 20


def test_a_dilute_gas_is_small() -> None:
    """A pair in free flight has 128 bytes; a run without log holds about 300 a ball, its results among them."""
    assert SOFT_PAIR_RECORD.itemsize <= 128
    scene, law = gas(n=20_000, length=20_000.0, seed=1), LinearDashpot(1e6)
    assert scene.pairs is not None
    run(scene, (law,) * (scene.n - 1), engine="compiled", log=False, max_events=10)
    tracemalloc.start()
    run(scene, (law,) * (scene.n - 1), engine="compiled", log=False, max_events=10)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 330 * scene.n


WALL = {"floor": Thermal(2.0, 1), "ceiling": Thermal(1.0, 2)}
BOUNDED = {
    "ring": Scene([1.0, 2.0, 0.5, 1.0], [0.1] * 4, [0.1, 0.0, -1e-4, 0.3], [1.0, 0.3, -0.5, 0.0], ring=True),
    "pendula": Scene([1.0, 2.0, 0.5], [0.1] * 3, [0.1, 0.0], [1.0, 0.3, -0.5], pendulum=7.0, rest_gap=[0.02, 0.0]),
    "thermal": Scene([math.inf, 1.0, 2.0, math.inf], [0.0] * 4, [0.1, 0.01, 0.2], [0.0, 1.0, -0.5, 0.0], **WALL),
}


@pytest.mark.soak  # each of them takes half a minute to compile
@pytest.mark.parametrize("name", BOUNDED)
def test_same_bits_in_bounded_scenes(name: str) -> None:
    scene = BOUNDED[name]
    for law in (LinearDashpot(1e3, 2.0), Hertz(1e4), ViscoelasticHertz(1e4, 20.0)):
        plain, fast = (run(scene, law, t_end=6.0, samples=31, engine=engine) for engine in ("plain", "compiled"))
        assert fast.stats["engine"] == "compiled"
        for name in ("velocity", "gap", "force", "contacts", "ledger"):
            one, other = getattr(plain, name), getattr(fast, name)
            assert one is other or one.tobytes() == other.tobytes(), name

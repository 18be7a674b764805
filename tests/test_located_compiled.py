"""Compiled and interpreted: the same bits. One compilation for the whole file."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest

from granular import until
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz, ViscoelasticHertz
from granular.md import simulate as run
from granular.md.located.batch import solve_many
from granular.scene import Scene

pytest.importorskip("numba")

LAWS: list[Any] = [
    LinearDashpot(5e7, 1500.0), LinearDashpot(5e7), Hertz(1e7), ViscoelasticHertz(1e7, 2e3), TsujiHertz(1e7, 0.4),
    PowerLaw(1e8, 4.0 / 3.0), PowerLaw(1e8, 2.0),
]  # fmt: skip
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
    monkeypatch.setattr(driver, "WORTH_LOADING", 500)
    monkeypatch.setattr(driver, "WORTH_COMPILING", 500)
    monkeypatch.setattr(driver, "in_memory", lambda _: False)
    walls = Scene([math.inf, 1.0, 1.0, math.inf], [0.0] * 4, [0.01] * 3, [0.0, 1.0, -0.5, 0.0])
    changed, plain = (run(walls, (LinearDashpot(1e5),) * 3, t_end=8.0, engine=engine) for engine in ("auto", "plain"))
    assert changed.stats["engine"] == "compiled"
    assert changed.contacts.tobytes() == plain.contacts.tobytes()


@pytest.mark.parametrize("engine", ["plain", "compiled"])
def test_solve_many_is_simulate_many_times(engine: str) -> None:
    """A map over the gap: counts, times and velocities are those of single runs, bit for bit."""
    gaps = np.array([[0.0, gap] for gap in (0.0, 1e-6, 1e-5, 1e-4, 1e-3)])
    law = LinearDashpot(5e7, 1500.0)
    many = solve_many(SCENE.mass, gaps, SCENE.velocity, [[law.k, 1.0, law.gamma, 0.0]] * 2, gravity=9.81,
                      until=until.contact(0, 2), engine=engine)
    for i, gap in enumerate(gaps):
        soft = run(SCENE.replace(gap=gap), (law,) * 2, until=until.contact(0, 2), engine="plain")
        last = soft.of(1)[-1]
        assert many.counts[i].tolist() == [soft.count(0), soft.count(1)]
        assert many.time[i] == soft.time[-1]
        assert (many.t_end[i], many.v_lower[i], many.v_upper[i]) == (last["t_end"], *last["v_out"])
        assert not many.ongoing[i]

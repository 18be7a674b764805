"""What a hard run of few balls costs, in counts that no load disturbs: this package's own calls, rows made, columns
written."""

from __future__ import annotations

import pickle
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular._engine import kernels
from granular.edmd import hanging, run as runs, wall_state
from granular.edmd.records import LOG_ROW
from granular.edmd.sorted_queue import SortedQueue
from granular.run.contact_log import contacts

THREE, END = gr.scenes.three_balls(gap=1e-4), gr.until.contact(pair=0, nth=2)
PACKAGE = Path(gr.__file__).parent


def simulated(engine: str) -> gr.Trajectory:
    return gr.edmd.simulate(THREE, gr.ConstantRestitution(0.7), until=END, engine=engine)


def place(code) -> tuple[str, str]:
    """File of the package, "" for any other one, and name of a function."""
    path = Path(code.co_filename)
    return path.relative_to(PACKAGE).as_posix() if path.is_relative_to(PACKAGE) else "", code.co_name


def calls(engine: str) -> Counter[tuple[str, str]]:
    """Calls of functions of this package in a run, the third of its kind, by file and name."""
    found: Counter[tuple[str, str]] = Counter()

    def count(frame, event, _) -> None:
        file, name = place(frame.f_code)
        if event == "call" and file:
            found[file, name] += 1

    simulated(engine), simulated(engine)
    before = sys.getprofile()
    sys.setprofile(count)
    try:
        simulated(engine)
    finally:
        sys.setprofile(before)
    return found


@pytest.mark.parametrize(("engine", "most"), [("sorted", 187), ("compiled", 134)])
def test_a_run_of_two_collisions_calls_little_of_this_package(engine, most) -> None:
    if engine == "compiled":
        pytest.importorskip("numba")
    found = calls(engine)
    assert 50 < found.total() <= most, found.most_common(20)


def test_what_a_scene_has_not_is_not_asked_for(monkeypatch) -> None:
    """No walls that move, no pendula; kernels are fitted once for all runs of a kind; few rows are made for few."""
    found, rows, made = calls("sorted"), SortedQueue.rows, []
    idle = (kernels.fitted, kernels.missing_compiler_reason, gr.Scene.thermal_walls.fget, hanging.swing_off,
            wall_state.energy_account, wall_state.walls)
    assert {place(function.__code__) for function in idle}.isdisjoint(found)
    monkeypatch.setattr(SortedQueue, "rows", lambda self, n: made.append(rows(self, n)) or made[-1])
    assert len(simulated("sorted").contacts) == 2
    assert sum(map(len, made)) <= 32


def test_rows_of_the_engine_need_no_memory_once_they_are_in_the_log() -> None:
    settled = [np.zeros(n, LOG_ROW) for n in (3, 5000)]
    assert len(contacts(settled)) == 5003
    assert settled == []


def held(run: gr.Trajectory) -> int:
    """Bytes of the rows that a run keeps of its collisions."""
    return sum(rows.nbytes for rows in vars(run)["settled"])


@pytest.mark.parametrize("engine", ["sorted", "compiled"])
def test_a_log_that_nobody_reads_needs_less_than_its_public_form(engine) -> None:
    """It is made once, of whichever copy and in whichever thread, and then the rows of the engine are given up."""
    if engine == "compiled":
        pytest.importorskip("numba")
    scene = gr.Scene(np.ones(30), np.zeros(30), np.ones(29), np.random.default_rng(1).normal(size=30))
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), engine=engine)
    count = run.stats["events"]
    assert held(run) == 56 * count > 0
    again = replace(copy(run), message="")
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: run.contacts, range(32)))
    assert all(log is found[0] for log in found)
    assert len(found[0]) == count
    assert not found[0].flags.writeable
    assert held(run) == 0
    assert again.contacts.tobytes() == found[0].tobytes() == pickle.loads(pickle.dumps(run)).contacts.tobytes()
    with pytest.raises(AttributeError, match="'Trajectory' object has no attribute 'contact'"):
        run.contact  # noqa: B018


@pytest.mark.parametrize("n", [5, 80])
@pytest.mark.parametrize("engine", ["sorted", "compiled"])
def test_what_a_scene_remembers_no_run_changes(n, engine) -> None:
    """Of few balls the start is remembered, and the state at the end is made once it is read."""
    if engine == "compiled":
        pytest.importorskip("numba")
    rng = np.random.default_rng(n)
    scene = gr.Scene([np.inf, *rng.uniform(0.5, 2.0, n)], np.zeros(n + 1), rng.uniform(0.0, 1.0, n),
                     [0.0, *rng.normal(size=n)], 9.81)
    once, again, anew = (gr.edmd.simulate(of, gr.ConstantRestitution(0.9), max_events=200, engine=engine)
                         for of in (scene, scene, scene.replace()))
    few = n < 64
    assert ("state" in vars(once)) is not few
    assert ("_initial_records" in vars(scene)) is few
    for run in (again, anew, copy(once), pickle.loads(pickle.dumps(once))):
        assert run.contacts.tobytes() == once.contacts.tobytes()
        assert run.state.keys() == once.state.keys()
        assert all(np.array(run.state[name]).tobytes() == np.array(kept).tobytes() for name, kept in once.state.items())
    assert once.state is once.state


def test_auto_counts_samples_too(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(runs, "compilation_pays", lambda work, has: asked.append(work) or False)
    scene = gr.Scene(np.ones(33), np.zeros(33), np.ones(32), np.zeros(33))
    gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=1.0, samples=1000, max_events=1)
    assert asked[0] == 32 + 1 + 2 * 1000


def test_auto_counts_the_balls_that_are_set_up(monkeypatch) -> None:
    """However few collisions are asked for."""
    asked = []
    monkeypatch.setattr(runs, "compilation_pays", lambda work, has: asked.append(work) or False)
    scene = gr.Scene(np.ones(300), np.zeros(300), np.ones(299), np.zeros(300))
    gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), max_events=1)
    assert asked[0] == 300


@pytest.mark.parametrize("compressed", [False, True])
def test_a_file_has_only_the_columns_of_a_hard_log_that_do_not_follow_from_others(compressed, tmp_path) -> None:
    run, path = simulated("sorted"), tmp_path / "run.npz"
    run.save(path, compressed=compressed)
    with np.load(path) as stored:
        logged = {name: stored[name].nbytes for name in stored.files if name.startswith("contacts")}
    assert sum(logged.values()) == 52 * len(run.contacts) > 0
    assert gr.Trajectory.load(path).contacts.tobytes() == run.contacts.tobytes()

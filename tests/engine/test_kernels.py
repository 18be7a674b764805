"""Kernels made to fit, interpreted and compiled: twins with other constants and kernels; the tournament of all."""

import inspect
import math
import random
import subprocess
import sys
import types
from importlib.metadata import version

import numpy as np
import pytest

from granular._engine import kernels, records as _records
from granular._engine.compiler_state import Mode
from granular._engine.kernels import compiled, fitted, have_numba, kernel, specialised
from granular.edmd import motion

SCALE, SHIFT = 2.0, 1


@kernel
def inner(x):
    return SCALE * x


@kernel
def middle(x):
    return inner(x) + SHIFT


@kernel
def outer(x):
    return middle(x) - inner(x)


@kernel
def half(x):
    return x / (2.0 * SCALE)


@kernel
def nested(x):
    return inner(inner(x))


@kernel
def first_of(record):
    return record.first


@kernel
def first_of_all(records):
    return first_of(records[0])


def ways(function):
    """The kernel as it stands, and compiled where it can be."""
    return [function, compiled(function)] if have_numba() else [function]


def both_pipelines():
    """The default pipeline of numba, and the fast one if it is used with the installed version."""
    installed = tuple(map(int, version("numba").split(".")[:2])) if have_numba() else None
    return ["default", "fast"] if installed in kernels.TESTED_NUMBA else ["default"]


def test_a_twin_has_other_constants_and_kernels_however_deep():
    rng = random.Random(1)
    for _ in range(5):
        x, scale, shift = rng.random(), rng.random(), rng.randrange(9)
        twin = specialised(outer, SCALE=scale, SHIFT=shift)
        for run in ways(twin):
            assert run(x) == (scale * x + shift) - scale * x
        for run in ways(specialised(outer, inner=half, SCALE=scale)):
            assert run(x) == (x / (2.0 * scale) + 1) - x / (2.0 * scale)
        for run in ways(specialised(nested, inner=half)):
            assert run(x) == x / 4.0 / 4.0
    for run in ways(outer):
        assert run(0.5) == 1.0  # the kernel itself is as before


def test_the_same_replacements_give_the_same_twin_and_no_others():
    assert specialised(outer, SCALE=3.0, SHIFT=2) is specialised(outer, SHIFT=2, SCALE=3.0)
    ones = [specialised(middle, SHIFT=value) for value in (1, 1.0, True, -1)]
    assert len(set(map(id, ones))) == 4
    if have_numba():
        assert len({compiled(one).__qualname__ for one in ones}) == 4


def test_what_does_not_mention_the_name_is_not_copied():
    assert specialised(outer, SHIFT=5).__globals__["inner"] is inner


def test_a_name_that_nobody_reads_is_refused():
    with pytest.raises(TypeError, match="outer cannot be specialised for SCALES: none of its kernels reads that name"):
        specialised(outer, SCALES=1.0)
    with pytest.raises(TypeError, match="outer cannot be specialised for DRIVE: none of its kernels reads that name"):
        fitted(outer, DRIVE=True)
    assert fitted(outer, DRIVEN=True) is outer


@pytest.mark.parametrize(("work", "memory", "disk", "pays"), [
    (10, True, True, False), (100, False, False, False), (100, False, True, True), (100, True, False, True),
    (1000, False, False, True),
])
def test_machine_code_must_pay(work, memory, disk, pays, monkeypatch):
    from granular._engine import kernels

    monkeypatch.setattr(kernels, "have_numba", lambda: True)
    monkeypatch.setattr(kernels, "is_in_memory", lambda function, inline: memory)
    monkeypatch.setattr(kernels, "is_on_disk", lambda function, inline: disk)
    assert kernels.is_worthwhile(kernels.kernel, work, 50, 500) is pays


@pytest.mark.parametrize("disk", [False, True])
@pytest.mark.parametrize("length", [0.01, 0.9, 1.1, 5.0, 30.0, 34.0, 40.0, 600.0])
@pytest.mark.parametrize("runs", [1, 7])
def test_who_goes_over_when_it_is_due_takes_at_most_twice_as_long_as_the_better_choice(length, disk, runs, monkeypatch):
    """A run of that many seconds interpreted, in looks of 0.1 s, at once or in several runs; compiled it takes no
    time beside loading (1 s) or making (33 s)."""
    from granular._engine import kernels

    clock, made = [0.0], [False]
    monkeypatch.setattr(kernels, "process_time", lambda: clock[0])
    monkeypatch.setattr(kernels, "have_numba", lambda: True)
    monkeypatch.setattr(kernels, "is_in_memory", lambda function, inline=False: made[0])
    monkeypatch.setattr(kernels, "is_on_disk", lambda function, inline: disk)
    monkeypatch.setattr(kernels.CompilationCost, "spent", {})
    price = 1.0 if disk else 33.0
    for _ in range(runs):
        toll, left = kernels.CompilationCost(kernels.kernel, 1.0, 33.0), length / runs
        while left > 0.0 and not made[0]:
            clock[0] += min(left, 0.1)
            left -= min(left, 0.1)
            if left > 0.0 and toll.due():
                made[0], clock[0] = True, clock[0] + price
        if not made[0]:
            toll.lap()
    assert clock[0] <= 2.0 * min(length, price) + 0.2
    if abs(length - price) > 0.2:
        assert made[0] is (length > price)


@pytest.mark.skipif(not have_numba(), reason="numba is not installed")
def test_machine_code_is_cached_under_a_name_that_changes_with_all_it_calls():
    names = []
    for called in (inner, half):
        caller = kernel(types.FunctionType(nested.__code__, globals() | {"inner": called}))
        twin = compiled(caller, inline=True)
        assert twin(1.0) == called(called(1.0))
        names.append(twin.__qualname__)
    assert names[0] != names[1]
    assert names[0] == compiled(nested, inline=True).__qualname__


@pytest.fixture(params=both_pipelines())
def pipeline(request, monkeypatch, tmp_path):
    """Name of a pipeline that compiles all kernels, with empty caches in memory and on disk."""
    kernels.load_numba()
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(Mode, "fast", request.param == "fast")
    for clear in Mode.on_switch:
        clear()
    yield request.param
    for clear in Mode.on_switch:
        clear()


@pytest.mark.skipif(not have_numba(), reason="numba is not installed")
def test_machine_code_is_made_for_what_python_calls_only_and_a_part_is_typed_once(pipeline, tmp_path):
    shared = kernel(types.FunctionType(inner.__code__, globals()))
    callers = [kernel(types.FunctionType(code, globals() | {"inner": shared}))
               for code in (nested.__code__, outer.__code__)]
    assert [compiled(one)(0.25) for one in callers] == [nested(0.25), outer(0.25)]
    part, same = (compiled(one).py_func.__globals__["inner"] for one in callers)
    assert part is same
    assert part is not compiled(shared)
    made = {type(one.library).__name__ for one in part.overloads.values()}
    assert (made, len(part.overloads)) == ({"Part" if pipeline == "fast" else "JITCodeLibrary"}, 1)
    assert compiled(shared)(0.25) == inner(0.25)
    assert len(list(tmp_path.rglob("*.nbi"))) == 3


@pytest.mark.skipif(not have_numba(), reason="numba is not installed")
def test_records_that_begin_alike_are_told_apart_without_a_warning(pipeline):
    caller = kernel(types.FunctionType(first_of_all.__code__, globals()))
    kinds = [np.dtype([("first", float)]), np.dtype([("first", float), ("second", float)])]
    assert [compiled(caller)(np.full(1, 2.0, kind)) for kind in kinds] == [2.0, 2.0]
    assert len(compiled(caller).py_func.__globals__["first_of"].overloads) == 2


@pytest.mark.skipif(not have_numba(), reason="numba is not installed")
def test_machine_code_is_made_where_nothing_can_be_kept(monkeypatch):
    def nowhere(dispatcher):
        raise RuntimeError("no locator available")

    monkeypatch.setattr("numba.core.dispatcher.Dispatcher.enable_caching", nowhere)
    one = kernel(types.FunctionType(inner.__code__, globals()))
    assert compiled(one).stats.cache_path is None
    assert not kernels.is_on_disk(one)


def test_who_asks_while_another_thread_loads_numba_waits_for_it(tmp_path):
    (tmp_path / "numba.py").write_text("import time\ntime.sleep(0.3)\nclass config:\n    DISABLE_JIT = 0\n")
    program = """
import sys, threading, time
sys.path.insert(0, sys.argv[1])
from granular._engine.kernels import have_numba
loading = threading.Thread(target=__import__, args=["numba"])
loading.start()
while "numba" not in sys.modules:
    time.sleep(0.001)
assert not hasattr(sys.modules["numba"], "config")
assert have_numba()
"""
    subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=True)


def test_what_never_happens_is_left_out_of_machine_code():
    plain, forced = motion.next_event_time, kernels.fitted(motion.next_event_time, FORCED=True)
    left = [set(kernels._globals_read(kernels.without_dead_branches(one))) for one in (plain, forced)]
    assert left[1] - left[0] >= {"opening", "next_wall_hit"}
    assert not (left[0] | left[1]) & {"FORCED", "HUNG", "hung"}


@pytest.mark.parametrize("source", ["edited", "missing"])
def test_code_stays_as_it_was_loaded_where_its_source_is_no_longer_that(source, monkeypatch):
    forced = kernels.fitted(motion.next_event_time, FORCED=True)
    lines, first = inspect.getsourcelines(forced.__code__)

    def read(code):
        if source == "missing":
            raise OSError
        return [line.replace("rate < 0.0", "rate < 9.0") for line in lines], first

    monkeypatch.setattr(kernels, "getsourcelines", read)
    assert kernels.without_dead_branches(forced) is forced.__code__


def test_a_tournament_knows_who_is_due_first_and_of_ties_the_lowest_key():
    """Against the least of all, after every change: times that tie, that never come, keys in any order."""
    rng, ways_to_replay = random.Random(4), ways(_records.update_tournament)
    for n in (1, 2, 3, 5, 8, 13, 33):
        trees = [_records.plain(_records.tournament(n)), _records.tournament(n)][: len(ways_to_replay)]
        size, owners = len(trees[0]) // 2, [(math.inf, key) for key in range(n)]
        for turn in range(60):
            first = rng.randrange(n) if turn else 0  # at first all: inner nodes know of no owner before
            last = min(n - 1, first + rng.choice((0, 0, 1, 2, n))) if turn else n - 1
            for owner in range(first, last + 1):
                key = rng.choice((owner, owner + n * rng.randrange(1, 9), owner - 8 * n))
                owners[owner] = (rng.choice((0.0, 0.5, 1.0, rng.random(), math.inf)), key)
                for tree in trees:
                    tree[size + owner]["due"], tree[size + owner]["key"] = owners[owner]
            for tree, run in zip(trees, ways_to_replay, strict=True):
                run(tree, first, last)
                assert (tree[1]["due"], tree[1]["key"]) == min(owners), (n, first, last)


def test_machine_code_that_takes_records_otherwise_is_not_ours(monkeypatch):
    """The name of cached machine code changes with the pipeline and with its source."""
    ours, number = kernels.cache_key(outer, True), kernels.version()
    assert ours != kernels.cache_key(outer, False)
    monkeypatch.setattr(kernels, "version", lambda: number + 1)
    assert kernels.cache_key(outer, True) != ours

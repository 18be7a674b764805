"""Ended from outside: what was solved is kept, and neither files nor processes are left behind."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from granular import cases
from granular._engine import files
from granular.app import cli
from granular.app.cli import ends

ASKING = [signal.Signals(one) for one in ends.END_SIGNALS]
posix = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
PATIENCE = 600.0  # s that a loaded machine may take; nothing waits so long where it is right


def handlers():
    return [signal.getsignal(one) for one in ends.END_SIGNALS]


@pytest.mark.parametrize("asked", ASKING)
def test_what_asks_to_end_is_an_interrupt_and_leaves_no_trace(granular, monkeypatch, asked):
    before = handlers()
    monkeypatch.setattr(cases.Case, "simulate", lambda *_, **__: signal.raise_signal(asked))
    assert granular("run gas") == (128 + asked, "", "granular: interrupted\n")
    assert handlers() == before


def test_a_second_signal_does_not_disturb_who_sees_to_the_first():
    cleaned = []

    def interrupted():
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGINT)
            cleaned.append(True)

    with pytest.raises(ends.EndSignal) as caught, ends.as_interrupts():
        interrupted()
    assert cleaned == [True]
    assert caught.value.number == signal.SIGTERM


@posix
def test_a_signal_that_a_library_swallows_is_heard_again(monkeypatch):
    monkeypatch.setattr(ends, "REPEAT_AFTER_SECONDS", 0.01)

    def swallowing():
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        time.sleep(PATIENCE)

    with pytest.raises(ends.EndSignal), ends.as_interrupts():
        swallowing()


@posix
def test_what_others_see_to_or_ignore_stays_theirs():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with ends.as_interrupts():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("when", ["made", "filled", "moved"])
def test_an_interrupt_at_any_moment_of_writing_leaves_no_draft(tmp_path, monkeypatch, when):
    def then(function):
        def interrupted(*given):
            function(*given)
            raise KeyboardInterrupt
        return interrupted

    name = {"made": "close", "moved": "replace"}.get(when)
    if name is not None:
        monkeypatch.setattr(os, name, then(getattr(os, name)))
    fill = then(lambda draft: Path(draft).write_bytes(b"new"))
    with pytest.raises(KeyboardInterrupt):
        files.write(tmp_path / "a", fill if when == "filled" else lambda draft: Path(draft).write_bytes(b"new"))
    assert os.listdir(tmp_path) == ["a"] * (when == "moved")


SLOW = """
import multiprocessing, os, sys, time
multiprocessing.set_start_method("fork")
from granular.app import cli
from granular.studies.sweeps import schedule
solve = schedule.solve
def slow(plan, columns, threads=1):
    answers = solve(plan, columns, threads)
    if multiprocessing.parent_process() is not None:
        os.write(1, b"solving\\n")  # at once: two processes say so
        time.sleep(1e4)
    return answers
schedule.solve = slow
sys.exit(cli.main(sys.argv[1:]))
"""
"""The command, whose other processes take hours for a cell."""
MAP = ["sweep", "three-balls", "--over", "gap=1e-6:1e-3:30:log", "--workers", "2", "--save", "map.nc"]


def started(folder, *words, **settings):
    return subprocess.Popen([sys.executable, *words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True, start_new_session=True, **settings)


def left_nothing(process):
    """What the process has printed. The pipes end when the last process that has them does: all are gone."""
    return process.communicate(timeout=PATIENCE)


@pytest.mark.rotating
@posix
@pytest.mark.parametrize("asked", [signal.SIGTERM, signal.SIGKILL])
def test_processes_of_a_sweep_end_with_the_command_and_what_was_solved_is_kept(tmp_path, asked):
    xarray = pytest.importorskip("xarray")
    process = started(tmp_path, "-c", SLOW, *MAP)
    assert process.stdout.readline() == "solving\n"
    process.send_signal(asked)
    _, said = left_nothing(process)
    if asked is signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
        return
    assert (process.returncode, said) == (128 + asked, "granular: interrupted\n")
    assert os.listdir(tmp_path) == ["map.nc"]
    assert int((xarray.load_dataset(tmp_path / "map.nc")["status"] >= 0).sum()) == 16  # of the first look


@pytest.mark.rotating
@posix
def test_a_process_of_a_sweep_that_dies_is_one_sentence(tmp_path):
    pytest.importorskip("xarray")
    process = started(tmp_path, "-c", SLOW.replace("time.sleep(1e4)", "os.kill(os.getpid(), 9)"), *MAP)
    _, said = left_nothing(process)
    assert process.returncode == cli.EXIT_MISUSE
    assert said.startswith("granular: A process of the sweep was killed")
    assert said.count("\n") == 1
    assert os.listdir(tmp_path) == ["map.nc"]


LINES = {
    "sweep": "sweep three-balls --over gap=1e-6:1e-2:300:log --over restitution=0.3:0.9:300 --workers 2 --save map.nc",
    "run": "run gas --engine edmd --samples 3000 --save gas.npz",
    "compare": "compare gas --n 60 --json all.json --plot all.png",
    "frontier": "frontier three-balls --json front.json",
    "page": "page -o page.html",
}


@posix
@pytest.mark.soak
@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("compiled_before", [True, False])
def test_kills_at_random_times_leave_nothing_and_lose_nothing(tmp_path, line, compiled_before):
    random.seed(f"{line} {compiled_before}")
    environment = os.environ | ({} if compiled_before else {"NUMBA_CACHE_DIR": str(tmp_path / "cache")})
    folder, solved = tmp_path / "folder", 0
    folder.mkdir()
    for _ in range(4):
        process = started(folder, "-m", "granular", *LINES[line].split(), env=environment)
        time.sleep(0.6 + 8.0 * random.random() ** 2)
        process.send_signal(signal.SIGTERM)
        if random.random() < 0.5:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)  # as `timeout` and batch systems do
        _, said = left_nothing(process)
        early = process.returncode == -signal.SIGTERM  # before the command began, or after it was done
        assert early or process.returncode in (0, 128 + signal.SIGTERM), said
        assert "Traceback" not in said.partition("Exception ignored")[0]
        assert not [name for name in os.listdir(folder) if name.startswith(".")]
        if line == "sweep" and (folder / "map.nc").exists():
            import xarray

            status = xarray.load_dataset(folder / "map.nc")["status"].values
            assert np.count_nonzero(status >= 0) >= solved
            solved = np.count_nonzero(status >= 0)

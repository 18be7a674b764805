"""What the `granular` command says while a person waits."""

import io
import sys
import time

import pytest

from granular import cli
from granular.cli import output as line
from granular.cli.output import Progress, clock


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_says_how_long_a_run_will_take():
    progress = Progress(10.0, Terminal())
    assert progress.line(2.5, 7, 60.0) == "t = 2.5 s, 7 contacts, 1:00 so far, 25% of 10 s, at most 3:00 to go"
    share = Progress(1.0, Terminal(), "cells")
    assert share.line(0.25, 7, 60.0) == "7 cells, 1:00 so far, 25%, at most 3:00 to go"
    assert Progress(None, Terminal()).line(2.5, 7, 3700.0) == "t = 2.5 s, 7 contacts, 1:01:40 so far"


def watched(stream, patience, monkeypatch, rounds=3000):
    """What is written on a stream during a run that tells of itself until the line has been there twice."""
    monkeypatch.setattr(line, "PATIENCE", patience)
    monkeypatch.setattr(line, "INTERVAL", 0.02)
    with Progress(10.0, stream) as progress:
        while stream.getvalue().count("to go") < 2 and rounds > 0:
            progress(1.0, 1)
            time.sleep(0.01)
            rounds -= 1
    return stream.getvalue()


def test_progress_is_silent_on_short_runs_and_without_a_terminal(monkeypatch):
    assert watched(Terminal(), 1e9, monkeypatch, 20) == ""
    assert watched(io.StringIO(), 0.02, monkeypatch, 20) == ""


def test_progress_shows_now_and_then_on_a_long_run_and_clears_its_line(monkeypatch):
    shown = watched(Terminal(), 0.1, monkeypatch)
    assert shown.count("to go") >= 2
    assert shown.endswith("to go\r\x1b[K")


def test_clock():
    assert [clock(s) for s in (0.4, 59.6, 3599.0, 3600.0)] == ["0:00", "1:00", "59:59", "1:00:00"]


def test_who_watches_is_told_once_that_machine_code_is_made(monkeypatch):
    from granular import _kernels
    from granular._roots import first_up_crossing

    pytest.importorskip("numba")
    said = io.StringIO()
    said.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", said)
    monkeypatch.setattr(_kernels, "on_making", [cli._say_compiling])
    _kernels.compiled.cache_clear()
    for known in (True, False, False):
        monkeypatch.setattr(_kernels, "on_disk", lambda function, inline, known=known: known)
        _kernels.compiled(first_up_crossing)
        assert bool(said.getvalue()) is not known
        _kernels.compiled.cache_clear()
    assert said.getvalue().count("compiling, once") == 1


def test_the_line_is_shown_while_nothing_is_told(monkeypatch):
    """As before the first setting of `frontier`, whose reference takes long."""
    monkeypatch.setattr(line, "PATIENCE", 0.05)
    stream = Terminal()
    with Progress(1.0, stream, "settings"):
        rounds = 3000
        while "settings" not in stream.getvalue() and rounds > 0:
            time.sleep(0.01)
            rounds -= 1
    assert stream.getvalue().startswith("\r\x1b[K0 settings, 0:00 so far")
    assert stream.getvalue().endswith("\r\x1b[K")

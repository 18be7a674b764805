"""What is said while a person waits."""

import importlib.util
import io
import math
import re
import sys
import time

import pytest

from granular import _progress as line, cli
from granular._progress import Progress, clock


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_says_how_long_a_run_will_take():
    progress = Progress(10.0)
    assert progress.line(2.5, 7, 60.0) == "t = 2.5 s, 7 contacts, 1:00 so far, 25% of 10 s, at most 3:00 to go"
    share = Progress(1.0, "cells")
    assert share.line(0.25, 7, 60.0) == "7 cells, 1:00 so far, 25%, at most 3:00 to go"
    assert Progress(math.inf).line(2.5, 7, 3700.0) == "t = 2.5 s, 7 contacts, 1:01:40 so far"
    assert Progress(12.0, start=8.0).line(9.0, 7, 60.0).endswith("25% of 12 s, at most 3:00 to go")


@pytest.fixture(autouse=True)
def no_tqdm(monkeypatch):
    monkeypatch.setattr(line, "find_spec", lambda name: None)


def watched(stream, patience, monkeypatch, rounds=3000, wait="INTERVAL"):
    """What is written on a stream during a run that tells of itself until the line has been there twice."""
    monkeypatch.setattr(line, "PATIENCE", patience)
    monkeypatch.setattr(line, wait, 0.02)
    with Progress(10.0, stream=stream) as progress:
        while stream.getvalue().count("to go") < 2 and rounds > 0:
            progress(1.0, 1)
            time.sleep(0.01)
            rounds -= 1
    return stream.getvalue()


def test_progress_is_silent_on_short_runs(monkeypatch):
    assert watched(Terminal(), 1e9, monkeypatch, 20) == watched(io.StringIO(), 1e9, monkeypatch, 20) == ""


def test_without_a_terminal_there_are_whole_lines(monkeypatch):
    lines = watched(io.StringIO(), 0.1, monkeypatch, wait="SELDOM")
    whole = r"granular: t = \d s, \d contacts, \d:\d\d so far(, 10% of 10 s, at most \d+:\d\d to go)?\n"
    assert len(lines.splitlines()) >= 2
    assert re.fullmatch(f"({whole})*", lines)


TQDM = """
class tqdm:
    n = 0.0

    def __init__(self, *, total, bar_format, leave, file):
        assert (total, bar_format, leave) == (1.0, "{bar} {desc}", False)
        self.file = file

    def __enter__(self):
        return self

    def set_description_str(self, text):
        print(f"bar {self.n} {text}", file=self.file)

    def __exit__(self, *error):
        print("closed", file=self.file)
"""


@pytest.mark.parametrize("notebook", [False, True])
def test_where_tqdm_is_installed_and_somebody_watches_there_is_a_bar(notebook, monkeypatch, tmp_path):
    (tmp_path / "tqdm").mkdir()
    (tmp_path / "tqdm" / "__init__.py").touch()
    (tmp_path / "tqdm" / "auto.py").write_text(TQDM, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(line, "find_spec", importlib.util.find_spec)
    for name in ("tqdm", "tqdm.auto"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    if notebook:
        monkeypatch.setitem(sys.modules, "ipykernel", sys)
    *_, last, closed = watched(io.StringIO() if notebook else Terminal(), 0.1, monkeypatch).splitlines()
    assert last.startswith("bar 0.1 t = 1 s, 1 contacts, 0:0")
    assert closed == "closed"
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    assert "bar" not in watched(io.StringIO(), 0.1, monkeypatch, wait="SELDOM")


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
    with Progress(1.0, "settings", stream=stream):
        rounds = 3000
        while "settings" not in stream.getvalue() and rounds > 0:
            time.sleep(0.01)
            rounds -= 1
    assert stream.getvalue().startswith("\r\x1b[K0 settings, 0:00 so far")
    assert stream.getvalue().endswith("\r\x1b[K")

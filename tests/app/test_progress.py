"""What is said while a person waits."""

import importlib.util
import io
import math
import sys

import pytest

from granular._engine import progress as line
from granular.app import cli


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def no_tqdm(monkeypatch):
    monkeypatch.setattr(line, "find_spec", lambda name: None)


def printed(monkeypatch, reached, clock, **options):
    """Lines on stderr of work that reports `reached` at each time of `clock`."""
    stream, times = io.StringIO(), iter(clock)
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(line.time, "monotonic", lambda: next(times))
    with line.progress_callback(True, None, **options) as report:
        for count, one in enumerate(reached):
            report(one, count)
    return stream.getvalue().splitlines()


def test_a_line_is_printed_every_thirty_seconds(monkeypatch):
    run = printed(monkeypatch, [1.0, 2.5, 3.0, 5.0], [0.0, 20.0, 30.0, 59.0, 61.0], end=10.0)
    assert run == ["granular: t = 2.5 s, 1 contacts, 30 s so far, 25%, about 90 s left",
                   "granular: t = 5 s, 3 contacts, 61 s so far, 50%, about 61 s left"]
    assert printed(monkeypatch, [0.25], [0.0, 40.0], things="cells") == [
        "granular: 0 cells, 40 s so far, 25%, about 120 s left"]
    assert printed(monkeypatch, [2.5], [0.0, 40.0], end=math.inf) == ["granular: t = 2.5 s, 0 contacts, 40 s so far"]
    assert printed(monkeypatch, [9.0], [0.0, 40.0], start=8.0, end=12.0)[0].endswith("25%, about 120 s left")


TQDM = """
class tqdm:
    n = 0.0

    def __init__(self, *, total, bar_format, leave, delay):
        assert (total, leave, delay) == (1.0, False, 2.0)

    def set_postfix_str(self, text, refresh):
        self.text = text

    def update(self, more):
        self.n += more
        print(f"bar {self.n} {self.text}")

    def close(self):
        print("closed")
"""


@pytest.mark.parametrize("notebook", [False, True])
def test_where_tqdm_is_installed_and_the_user_watches_there_is_a_bar(notebook, monkeypatch, tmp_path, capsys):
    (tmp_path / "tqdm").mkdir()
    (tmp_path / "tqdm" / "__init__.py").touch()
    (tmp_path / "tqdm" / "auto.py").write_text(TQDM, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(line, "find_spec", importlib.util.find_spec)
    for name in ("tqdm", "tqdm.auto", "ipykernel"):
        monkeypatch.setitem(sys.modules, name, None)  # remembers that it was absent, for the undoing
        monkeypatch.delitem(sys.modules, name)
    if notebook:
        monkeypatch.setitem(sys.modules, "ipykernel", sys)
    monkeypatch.setattr(sys, "stderr", io.StringIO() if notebook else Terminal())
    with line.progress_callback(True, None, end=10.0) as report:
        report(1.0, 1)
        report(12.0, 2)
    assert capsys.readouterr().out == "bar 0.1 t = 1 s, 1 contacts\nbar 1.0 t = 12 s, 2 contacts\nclosed\n"
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with line.progress_callback(True, None) as report:
        report(0.1, 1)
    assert capsys.readouterr().out == sys.stderr.getvalue() == ""


def test_who_watches_is_told_once_that_machine_code_is_made(monkeypatch):
    from granular._engine import kernels
    from granular._engine.roots import first_up_crossing

    pytest.importorskip("numba")
    said = io.StringIO()
    said.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", said)
    monkeypatch.setattr(kernels, "before_compiling", [cli._report_compiling])
    kernels.compiled.cache_clear()
    for known in (True, False, False):
        monkeypatch.setattr(kernels, "is_on_disk", lambda function, inline, known=known: known)
        kernels.compiled(first_up_crossing)
        assert bool(said.getvalue()) is not known
        kernels.compiled.cache_clear()
    assert said.getvalue().count("compiling once") == 1

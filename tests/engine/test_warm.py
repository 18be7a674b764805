"""`granular warm`: which kernels are made, what is said of them, when nothing can be kept; nothing is compiled here."""

from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import pytest

from granular import cases
from granular._engine import kernels
from granular.app.cli import installation
from granular.md.located import many

MAPS = "maps"


@contextmanager
def recorder(kind):
    """As numba's, of what a stubbed call says that it compiled."""
    assert kind == "numba:compile"
    recorder.seen = SimpleNamespace(buffer=[])
    yield recorder.seen


@pytest.fixture
def stubbed(monkeypatch):
    """Calls that note what they are asked for, and compile what is new."""
    asked, event = [], SimpleNamespace(install_recorder=recorder)

    def note(what):
        if what not in asked:
            recorder.seen.buffer.append(what)
        asked.append(what)

    monkeypatch.setattr(cases.Case, "simulate", lambda case, engine, **end: note(
        (frozenset(case.scene._flags), (engine, type(case.law).__name__), *sorted(case.run.items()))))
    monkeypatch.setattr(many, "solve_many", lambda *cells, **end: note(MAPS))
    monkeypatch.setattr(installation, "load_numba", lambda: SimpleNamespace(core=SimpleNamespace(event=event)))
    monkeypatch.setattr(installation, "compiled_kernels_folder", lambda: "the folder")
    return asked


def test_warm_makes_code_for_every_kind_of_ready_made_scene(granular, stubbed):
    """Forces alone have the code of plain scenes (soft) or of thermal walls (hard)."""
    code, out, err = granular("warm")
    assert (code, err, stubbed.count(MAPS)) == (0, "", 1)
    made = [call for call in stubbed if call != MAPS]
    assert {dict(call[2:])["engine"] for call in made} == {"compiled"}
    assert len(made) == len(set(made)) == len(installation.WARM_SCENES) * len(installation.WARM_RUNS)
    assert {call[0] for call in made} == {frozenset(cases.make(name).scene._flags) for name in cases.names()
                                          if name != "compressed-chain"}
    lines = out.splitlines()
    assert lines[0] == "machine code is cached in the folder"
    assert lines[1].split() == ["three-balls", "hard", "0.0", "s"]
    assert len(lines) == len(stubbed) + 1


def test_code_that_is_there_is_not_made_again(granular, stubbed):
    first, again = (granular("warm ring-gas")[1].splitlines() for _ in range(2))
    assert first[1].endswith(" s")
    assert [line.split()[0] for line in again[1:]] == ["ring-gas"] * len(installation.WARM_RUNS)
    assert all(line.endswith("already compiled") for line in again[1:])


def test_what_is_run_calls_what_other_runs_may():
    """Interpreted: hard balls collapse, which a closer look decides; soft ones and cells are in contact again and
    again."""
    ways = installation.warm_up_calls(cases.make("three-balls"))
    hard, soft = (replace(ways[kind].func.__self__, run={}) for kind in ("hard", "soft"))
    assert hard.simulate("edmd", **installation.WARM_END).stats["zooms"] == 1
    end = installation.WARM_END | {"t_end": 0.5}
    assert len(soft.simulate("md", **end).contacts) > 2
    cells = many.solve_many(*ways["maps"].args, t_end=0.5, engine="plain")
    assert cells.status[0] >= 0
    assert cells.counts.sum() > 2


def test_warm_refuses_where_there_is_no_compiler_or_nowhere_to_keep_code(granular, monkeypatch):
    code, _, err = granular("warm gas")
    assert (code, err.count("\n")) == (2, 1)
    assert err.startswith("granular: unknown scene gas; available: heated-gas, ")

    def nowhere():
        raise RuntimeError("no locator available")

    monkeypatch.setattr(kernels, "missing_compiler_reason", str)
    monkeypatch.setattr(kernels, "load_numba", nowhere)
    code, out, err = granular("warm")
    assert (code, out) == (2, "")
    assert err == ("granular: not cached, every process compiles again, because numba cannot write anywhere; set "
                   "NUMBA_CACHE_DIR to a writable folder\n")
    monkeypatch.setattr(kernels, "missing_compiler_reason", lambda: "numba is not installed: pip install it")
    assert granular("warm") == (2, "", "granular: numba is not installed: pip install it\n")

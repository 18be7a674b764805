"""Every test has an environment of its own; those that make machine code come first; some run in
one commit of five only.
"""

import gc
import importlib
import math
import os
import subprocess
from collections import Counter
from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest

from tests.helpers.machine import pytest_configure, pytest_runtest_call, pytest_runtest_setup  # noqa: F401
from tests.helpers.noise import pytest_itemcollected  # noqa: F401

with suppress(ImportError):  # files marked `core` do without
    from hypothesis import settings

    settings.register_profile("same", derandomize=True, deadline=None)  # the same draws everywhere, and no clock
    settings.load_profile("same")
MAKERS = ("studies/test_sweeps_ways", "edmd/test_actions", "edmd/test_blocks", "edmd/test_engines",
          "located/test_compiled", "located/test_rest", "fixed/test_engines")
"""Files that have machine code made for nearly all that others need."""
TAKERS = ("located/test_costs", "edmd/test_costs", "run/test_levels", "comparison/test_episodes",
          "comparison/test_error_in_other_units",
          "comparison/test_figure", "comparison/test_driven_compare", "comparison/test_costs",
          "studies/test_sweeps", "studies/test_sweeps_cases", "studies/test_sweeps_saved")
"""Files that need much of it: the other worker must not come to them while it is being made."""
PATIENCE = {
    "granular.md.located.run": {"LOCATED_COMPILE_SECONDS": math.inf},
    "granular.md.located.pace": {"TEST_COMPILE_SECONDS": math.inf},
    "granular.md.fixed.run": {"COMPILING_SECONDS": math.inf},
    "granular.edmd.queue_choice": {"COMPILING_WORK": math.inf},
    "granular.studies.sweeps.schedule": {"COMPILING_SECONDS": math.inf},
}
"""How long "auto" waits before it makes machine code, by modules and the names of their limits."""
SHARES = 5
"""A commit runs one in this number of cases marked `rotating`. Its hash selects them."""

HERE = Path(__file__).parent
assert [name for name in (*MAKERS, *TAKERS) if not (HERE / f"{name}.py").is_file()] == []


def place(item):
    """The file of a test, as "edmd/test_ties"."""
    return item.path.relative_to(HERE).with_suffix("").as_posix() if item.path.is_relative_to(HERE) else ""


@cache
def turn():
    """Return which share of the cases marked `rotating` this commit runs: 0 to `SHARES` - 1, or 0 without git."""
    with suppress(FileNotFoundError):  # git is not installed
        done = subprocess.run(["git", "rev-parse", "HEAD"], cwd=HERE, capture_output=True, text=True, check=False)
        return int(done.stdout.strip() or "0", 16) % SHARES
    return 0


def pytest_collection_modifyitems(config, items):
    """Have the makers run first, all by one worker, and the takers last: from an empty cache, the other worker would
    make the same code again.

    A run of whole folders has one of `SHARES` cases marked `rotating`. The commit and the name of the test select the
    share. The other cases belong to the soak. A run of named files has all of them.
    """
    items.sort(key=lambda item: (place(item) not in MAKERS) + (place(item) in TAKERS))
    if all(Path(name).is_dir() for name in config.args):
        count = Counter()
        for item in items:
            if item.get_closest_marker("rotating"):
                count[item.originalname] += 1
                if (count[item.originalname] + len(item.originalname) + turn()) % SHARES:
                    item.add_marker("soak")


@pytest.fixture(autouse=True, scope="session")
def wide_terminal():
    """Commands print their lines whole; app/test_width narrows the terminal."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "400")
        yield


def pytest_sessionstart():
    """Let programs that tests start keep their byte code, because compiling it takes 0.3 s each time."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def pytest_collection_finish():
    gc.freeze()  # thousands of tests live on: to look at them again and again took a thirtieth of the time


@pytest.fixture(autouse=True, scope="session")
def no_code_for_its_own_sake():
    """Engine "auto" goes over to machine code that is there, and makes none: else it would hang on the machine's speed
    what is made, and by how many workers at once."""
    with pytest.MonkeyPatch.context() as patch:
        for name, constants in PATIENCE.items():
            for constant, value in constants.items():
                patch.setattr(importlib.import_module(name), constant, value)
        yield


@pytest.fixture
def forty_digits():
    """The numbers of mpmath have 40 digits."""
    import mpmath as mp

    with mp.workdps(40):
        yield


@pytest.fixture
def interpreted(monkeypatch):
    """Engine "auto" stays interpreted: piles that rest are looked at interpreted, which is slow on records of machine
    code."""
    monkeypatch.setattr("granular._engine.kernels.CompilationCost.due", lambda self, ahead=0.0: False)


@pytest.fixture
def compiled_rest_tests(monkeypatch):
    """Compiled runs test for rest by machine code. Interpreted on their records, the same test is 50 times slower."""
    for name in ("TEST_LOAD_SECONDS", "TEST_COMPILE_SECONDS"):
        monkeypatch.setattr(f"granular.md.located.pace.{name}", 0.0)


@pytest.fixture(scope="module")
def cradle():
    """Newton's cradle of four balls under both engines."""
    import granular as gr

    scene, law = gr.scenes.newtons_cradle(4), gr.LinearDashpot(1e7)
    return gr.compare(scene, law)


@pytest.fixture
def granular(capsys, tmp_path, monkeypatch):
    """The command in an empty folder: a line → exit code, standard output, standard error."""
    from granular.app import cli

    monkeypatch.chdir(tmp_path)

    def command(line: str) -> tuple[int, str, str]:
        code = cli.main(line.split())
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return command

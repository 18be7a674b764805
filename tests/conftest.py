"""Every test has an environment of its own; those that make machine code come first."""

import pytest
from hypothesis import settings
from machine import pytest_configure, pytest_runtest_call, pytest_runtest_setup  # noqa: F401
from noise import pytest_itemcollected  # noqa: F401

settings.register_profile("same", derandomize=True, deadline=None)  # the same draws everywhere, and no clock
settings.load_profile("same")
MAKERS = ("test_edmd_actions", "test_edmd_engines", "test_located_compiled", "test_md_fixed_engines")
"""Files that have machine code made for nearly all that others need."""


def pytest_collection_modifyitems(items):
    """Have the makers run first, all by one worker: from an empty cache, the other would make the same code again."""
    items.sort(key=lambda item: item.path.stem not in MAKERS)


@pytest.fixture
def granular(capsys, tmp_path, monkeypatch):
    """The command in an empty folder: a line → exit code, standard output, standard error."""
    from granular import cli

    monkeypatch.chdir(tmp_path)

    def command(line: str) -> tuple[int, str, str]:
        code = cli.main(line.split())
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return command

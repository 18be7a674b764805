"""One thread: these tests are run beside others."""

import os

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")


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

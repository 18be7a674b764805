"""Commands whose reader ends early, and lines of the full report that belong to its run."""

import os
import sys
from pathlib import Path

import pytest

from granular.app.cli import main


@pytest.mark.parametrize("command", ["run three-balls --save out.npz", "compare three-balls --json out.json"])
def test_a_reader_that_closes_the_pipe_early_loses_no_file(monkeypatch, tmp_path, command):
    """``granular run … --save out.npz | head -1``. Before, nothing was written, and the exit code was 0."""
    monkeypatch.chdir(tmp_path)
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w", buffering=1, encoding="utf-8") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        assert main(command.split()) == 0
    assert Path(command.split()[-1]).stat().st_size > 1000


def test_the_full_report_prints_no_sensitivity_of_another_run(granular):
    """Before, v_rel was that of the default end and of the located method."""
    assert "\nsensitivity: v_rel[1] = 0.177282" in granular("compare three-balls -v")[1]
    for option in ("--until pair=0 nth=3", "--method verlet --dt 1e-6", "--max-events 6"):
        assert "sensitivity" not in granular(f"compare three-balls -v {option}")[1]

"""Tests that hang end by processor time, in Python and in code that does not listen."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

HANGS = """
from tests.helpers import machine
machine.LIMIT, machine.GRACE = 0.2, 1
from tests.helpers.machine import pytest_configure, pytest_runtest_call, pytest_runtest_setup
"""
TESTS = """
import os, time

def test_python():
    while True:
        pass

def test_sleep():
    time.sleep(0.5)

def test_machine_code():
    sum(range(1 << 60))
"""


@pytest.mark.skipif(not hasattr(signal, "SIGXCPU"), reason="this system has no limits of processor time")
def test_a_hang_is_ended_by_processor_time(tmp_path):
    (tmp_path / "conftest.py").write_text(f"import sys\nsys.path.append({str(Path(__file__).parents[2])!r})\n{HANGS}")
    (tmp_path / "test_hangs.py").write_text(TESTS)
    run = subprocess.run([sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", "-c", "/dev/null",
                          "--rootdir", str(tmp_path), str(tmp_path)], capture_output=True, text=True,
                         cwd=tmp_path, check=False)
    assert run.returncode == -signal.SIGXCPU
    assert "test_python FAILED" in run.stdout
    assert "test_sleep PASSED" in run.stdout
    assert "test_machine_code" in run.stderr  # its stack

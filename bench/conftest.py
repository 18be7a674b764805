"""Give benchmarks that run as tests the environment and limits of the tests."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent / "tests"))

from machine import pytest_configure, pytest_runtest_call, pytest_runtest_setup  # noqa: F401

"""Give benchmarks that run as tests the environment and limits of the tests."""

from tests.helpers.machine import pytest_configure, pytest_runtest_call, pytest_runtest_setup  # noqa: F401

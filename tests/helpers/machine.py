"""What tests are given of the machine: an environment of their own, and processor time instead of a clock on the wall.

A hang is ended by processor time, so that a slow or loaded machine is no failure.
"""

import faulthandler
import math
import os
import signal
import time

import pytest

LIMIT, GRACE = 300, 30
"""Seconds of processor time of a test; and how much later the process ends that does not listen, as machine code."""
SET = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "COLUMNS": "80",
       "LC_ALL": "C.UTF-8", "TZ": "UTC"}
UNSET = ("MPLBACKEND", "MPLCONFIGDIR", "MATPLOTLIBRC", "NO_COLOR", "FORCE_COLOR", "LINES", "LANGUAGE",
         "PYTHONWARNINGS", "PYTHONOPTIMIZE", "PYTHONIOENCODING", "NUMBA_DISABLE_JIT", "NUMBA_NUM_THREADS")


def _own_environment():
    """Forget what a user, a server or a continuous integration may have set; before numpy is loaded."""
    os.environ.update(SET)
    for name in UNSET:
        os.environ.pop(name, None)
    if hasattr(time, "tzset"):
        time.tzset()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background may ignore it
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)


def pytest_configure(config):
    if hasattr(signal, "SIGXCPU"):  # the stack first, then the end
        faulthandler.register(signal.SIGXCPU, file=os.dup(2), all_threads=True, chain=True)


def _stop(*_):
    pytest.fail(f"it took {LIMIT} s of processor time")


def _limited():
    """Raise in a test that takes too long; end the process where nothing can be raised.

    What a test starts inherits the limit of the process: it may take at least as long, counted on its own.
    """
    if not hasattr(signal, "SIGXCPU"):  # not a POSIX system
        return (yield)
    import resource

    before = signal.signal(signal.SIGPROF, _stop)
    soft, hard = resource.getrlimit(resource.RLIMIT_CPU)
    most = math.ceil(time.process_time() + LIMIT + GRACE)  # not rounded down: the test itself must end first
    if hard == resource.RLIM_INFINITY or most < hard:
        resource.setrlimit(resource.RLIMIT_CPU, (most, hard))
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        resource.setrlimit(resource.RLIMIT_CPU, (soft, hard))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    return (yield from _limited())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    return (yield from _limited())


_own_environment()

"""Pytest plugin: processor time of the tests of each folder, processes that tests start included.

    python -m pytest -p tests.helpers.processor_time

The table at the end has seconds and cases per folder, and the ten files that take longest.
"""

import os
from collections import Counter

import pytest

SECONDS, CASES = Counter(), Counter()
SHOWN_FILES = 10


def spent():
    """Processor time of this process and of those that it waited for, in s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def pytest_collection_finish(session):
    session.config.spent = spent()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item, call):
    """Give each report the time since the one before."""
    report = yield
    now = spent()
    report.user_properties.append(("processor time", now - item.config.spent))
    item.config.spent = now
    return report


def pytest_runtest_logreport(report):
    file = report.nodeid.partition("::")[0]
    SECONDS[file] += report.user_properties[-1][1]
    CASES[file] += report.when == "call"


def pytest_terminal_summary(terminalreporter):
    folders, cases = Counter(), Counter()
    for file, seconds in SECONDS.items():
        folders[os.path.dirname(file)] += seconds
        cases[os.path.dirname(file)] += CASES[file]
    terminalreporter.section("processor time, s")
    for folder, seconds in sorted(folders.items()):
        terminalreporter.write_line(f"{folder:20} {seconds:7.1f} {cases[folder]:6} cases")
    terminalreporter.write_line(f"{'all':20} {folders.total():7.1f} {cases.total():6} cases")
    for file, seconds in SECONDS.most_common(SHOWN_FILES):
        terminalreporter.write_line(f"{file:45} {seconds:7.1f}")

"""Exit codes of the `granular` command."""

from granular.trajectory import Status, Trajectory

OK, MISUSE, ABNORMAL, INTERRUPTED = 0, 2, 3, 130


def exit_code(*runs: Trajectory) -> int:
    """`ABNORMAL` if a run did not come to a proper end."""
    return ABNORMAL if any(run.status in (Status.unstable, Status.max_events) for run in runs) else OK

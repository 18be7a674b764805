"""What asks a process to end is an interrupt, as Ctrl-C is: what was done is kept, and nothing is left behind."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, main_thread

ASKING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Ctrl-C; `kill`, `timeout` and batch systems; a terminal that is closed."""
AGAIN = 0.2
"""Seconds after which it is said again: what is raised is lost where a library calls back, as compilers do."""


class Asked(KeyboardInterrupt):
    """The process is asked to end, by the signal of that number."""

    def __init__(self, number: int) -> None:
        self.number = number


@contextmanager
def as_interrupts() -> Iterator[None]:
    """Raise `Asked`, a `KeyboardInterrupt`, at these signals; a second one does not disturb who sees to the first.

    Signals that somebody else sees to or ignores, as under `nohup`, stay his; in the end all are as before.
    """
    over: list[bool] = []
    main = main_thread().ident or 0

    def say_again(number: int) -> None:
        if not over and hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main, number)  # wakes it, too

    def end(number: int, frame: object) -> None:
        if over:
            return
        again = Timer(AGAIN, say_again, [number])
        again.daemon = True
        again.start()
        if not _seen_to(sys.exception()):
            raise Asked(number)

    usual = (signal.SIG_DFL, signal.default_int_handler) if current_thread() is main_thread() else ()
    before = {one: was for one in ASKING if (was := signal.getsignal(one)) in usual}
    try:
        for one in before:
            signal.signal(one, end)
        yield
    finally:
        over.append(True)
        for one, was in before.items():
            signal.signal(one, was)


def _seen_to(error: BaseException | None) -> bool:
    """Whether what is being handled is an interrupt, or came of one."""
    return error is not None and (isinstance(error, KeyboardInterrupt) or _seen_to(error.__context__))

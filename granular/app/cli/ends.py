"""Signals that end a process, handled like Ctrl-C: finished work is kept."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, main_thread

END_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals of Ctrl-C, `kill`, `timeout`, batch systems, and closed terminals."""
REPEAT_AFTER_SECONDS = 0.2
"""Time in s after which the signal is repeated.

Exceptions that are raised inside callbacks of a library, such as a compiler, get lost.
"""


class Asked(KeyboardInterrupt):
    """The process received the signal with this number."""

    def __init__(self, number: int) -> None:
        self.number = number


@contextmanager
def as_interrupts() -> Iterator[None]:
    """Raise `Asked`, a `KeyboardInterrupt`, when one of the signals arrives.

    A second signal does not interrupt the handling of the first one. Signals that are already handled or ignored, for
    example under `nohup`, are left alone. All handlers are restored at the end.
    """
    over: list[bool] = []
    main = main_thread().ident or 0

    def say_again(number: int) -> None:
        if not over and hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main, number)  # wakes it, too

    def end(number: int, frame: object) -> None:
        if over:
            return
        again = Timer(REPEAT_AFTER_SECONDS, say_again, [number])
        again.daemon = True
        again.start()
        if not _seen_to(sys.exception()):
            raise Asked(number)

    usual = (signal.SIG_DFL, signal.default_int_handler) if current_thread() is main_thread() else ()
    before = {one: was for one in END_SIGNALS if (was := signal.getsignal(one)) in usual}
    try:
        for one in before:
            signal.signal(one, end)
        yield
    finally:
        over.append(True)
        for one, was in before.items():
            signal.signal(one, was)


def _seen_to(error: BaseException | None) -> bool:
    """Whether the exception being handled is an interrupt or was caused by one."""
    return error is not None and (isinstance(error, KeyboardInterrupt) or _seen_to(error.__context__))

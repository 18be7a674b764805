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

An exception raised inside a callback of a library, such as a compiler, can be lost.
"""


class EndSignal(KeyboardInterrupt):
    """Interrupt by a signal, with its `number`."""

    def __init__(self, number: int) -> None:
        self.number = number


@contextmanager
def as_interrupts() -> Iterator[None]:
    """Raise `EndSignal` when the process receives an end signal.

    `EndSignal` is a `KeyboardInterrupt`. A second signal does not interrupt the handling of the first one. Signals that
    are already handled or ignored, for example under ``nohup``, are not changed. The context restores all handlers when
    it ends.
    """
    is_over: list[bool] = []
    main = main_thread().ident or 0

    def repeat_signal(number: int) -> None:
        if not is_over and hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main, number)  # also wakes the main thread

    def handle_signal(number: int, frame: object) -> None:
        """Raise `EndSignal`, and repeat the signal if the program does not end."""
        if is_over:
            return
        timer = Timer(REPEAT_AFTER_SECONDS, repeat_signal, [number])
        timer.daemon = True
        timer.start()
        if not _is_handling_interrupt(sys.exception()):
            raise EndSignal(number)

    default_handlers = (signal.SIG_DFL, signal.default_int_handler) if current_thread() is main_thread() else ()
    handlers = {signal_number: handler for signal_number in END_SIGNALS
                if (handler := signal.getsignal(signal_number)) in default_handlers}
    try:
        for signal_number in handlers:
            signal.signal(signal_number, handle_signal)
        yield
    finally:
        is_over.append(True)
        for signal_number, handler in handlers.items():
            signal.signal(signal_number, handler)


def _is_handling_interrupt(error: BaseException | None) -> bool:
    """Whether the exception being handled is an interrupt or was caused by one."""
    return error is not None and (isinstance(error, KeyboardInterrupt) or _is_handling_interrupt(error.__context__))

"""The `granular` command. Misuse prints one line on stderr, never a traceback.

Support modules: `contacts`, `ends`, `installation`, `one_scene`, `output`, `pages`, `parser`, `sweep`, `verify`.
"""

from __future__ import annotations

import re
import sys
import traceback
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from signal import SIGINT
from typing import Any

import numpy as np

import granular
from granular._engine.files import plain_text
from granular._engine.kernels import before_compiling
from granular._engine.package import VERSION
from granular.app.cli import ends
from granular.run.trajectory import Status

EXIT_OK, EXIT_MISUSE, EXIT_ABNORMAL, EXIT_SIGNAL = 0, 2, 3, 128
EXPECTED_ERRORS = ValueError, TypeError, OSError, ImportError, MemoryError, ArithmeticError, RecursionError
"""Exceptions that are printed in one line, without a traceback.

Exceptions raised by a function of the user are printed in the same way.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with the arguments `argv`, and return its exit code.

    `argv` defaults to the arguments of the process. Exit codes: 0 success · 1 a number of another code is wrong
    or missing · 2 misuse, or a file that cannot be read or written · 3 the run did not end properly (status
    ``unstable``, ``broken`` or ``max_events``) · 128 + the number of the signal that ended the process, 130 for
    Ctrl-C.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        with ends.as_interrupts(), warnings.catch_warnings():
            warnings.simplefilter("default")
            warnings.showwarning = _show_warning
            before_compiling[:] = [_report_compiling]
            code = _run_command(arguments)
        if sys.stdout is not None:  # closed by the shell's >&-
            sys.stdout.flush()
        return code
    except KeyboardInterrupt as interrupt:
        with suppress(OSError):  # a terminal that is closed
            print("granular: interrupted", file=sys.stderr)
        return EXIT_SIGNAL + getattr(interrupt, "number", SIGINT)
    except BrokenPipeError:  # the reader of a pipe, such as `head`, has closed it
        from granular.app.cli.output import discard_output

        discard_output(sys.stdout)
        return EXIT_OK
    except Exception as error:
        if not (isinstance(error, EXPECTED_ERRORS) or hasattr(error, "raised_by")):  # raised by a function of the user
            raise
        if "--traceback" in arguments:
            traceback.print_exc()
        sentence = _error_sentence(error)
        print(f"granular: {plain_text(sentence, len(sentence))}", file=sys.stderr)
        return EXIT_MISUSE


def _run_command(arguments: Sequence[str]) -> int:
    """Run the named command and return its exit code."""
    if getattr(granular, "__version__", None) != VERSION and list(arguments[:1]) != ["info"]:
        from granular.app.cli.installation import overwritten_message

        raise ImportError(overwritten_message())
    from granular.app.cli import output, parser
    from granular.cases.build import user_code_callbacks

    try:
        parsed = parser.parse(arguments)
    except SystemExit:  # --help and --version
        return EXIT_OK
    user_code_callbacks[:] = [parser.code_notice_printer(parsed.target)]
    output.check(parsed)
    # invalid numbers raise errors with a message
    with np.errstate(all="ignore"), _extreme_option_named(parsed.scene_options | parsed.run_options):
        runs = parsed.act(parsed)
    if isinstance(runs, int):
        return runs
    ends = {run.status for run in runs or ()}
    return EXIT_ABNORMAL if ends & {Status.unstable, Status.broken, Status.max_events} else EXIT_OK


@contextmanager
def _extreme_option_named(options: Mapping[str, Any]) -> Iterator[None]:
    """Name an extreme option in the message of an error that it probably caused.

    An option is extreme if its magnitude is outside `MIN_SPEED` to `MAX_NUMBER` of `granular.edmd.physics`. An example
    is a mass so small that the end time is infinite. 0 is not extreme.
    """
    try:
        yield
    except (ValueError, ArithmeticError) as error:
        from granular.edmd.physics import MAX_NUMBER, MIN_SPEED

        from_user = hasattr(error, "raised_by")  # raised by a function of the user
        extreme = [] if from_user else [
            (name, x) for name, x in _nonzero_numbers(options) if not MIN_SPEED <= abs(x) <= MAX_NUMBER]
        if not extreme or any(re.search(rf"\b{name}\b", str(error)) for name, _ in extreme):
            raise
        name, value = extreme[0]
        raise ValueError(f"`{name}` must be 0 or a number of magnitude {MIN_SPEED:g} to {MAX_NUMBER:g}, got {value!r}. "
                         f"Check that it is in SI units. The error was: {str(error).rstrip('.')}.") from error


def _nonzero_numbers(options: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield name and value of all nonzero numbers in the options.

    Numbers in lists and tables are included.
    """
    for name, value in options.items():
        inner = value.items() if isinstance(value, Mapping) else [("", value)]
        for key, entry in inner:
            for x in entry if isinstance(entry, (list, tuple)) else [entry]:
                if isinstance(x, (int, float)) and not isinstance(x, bool) and x != 0:
                    yield key or name, x


def _report_compiling() -> None:
    """Print on a terminal that the first run compiles for up to half a minute."""
    if sys.stderr is not None and sys.stderr.isatty():
        print("granular: compiling once, for up to half a minute; later runs start immediately …", file=sys.stderr)


def _error_sentence(error: Exception) -> str:
    """Return the sentence about an exception that the command prints."""
    if hasattr(error, "raised_by"):
        from granular.cases.build import error_sentence

        return error_sentence(error)
    if isinstance(error, MemoryError):
        return "The memory of this machine is too small for this run. Use fewer samples, balls or cells."
    if isinstance(error, (ArithmeticError, RecursionError)):
        return f"The numbers of this run exceed the range of floating-point numbers ({error}). "\
               "Check that they are in SI units."
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


def _show_warning(message: Warning | str, *where: object, **also: object) -> None:
    print(f"granular: warning: {message}", file=sys.stderr)

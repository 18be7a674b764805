"""Files that a command is to write: looked at before a long run, not after it."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from granular import _files
from granular._optional import optional


def json_file(name: str) -> str:
    """Return the file to write JSON to; ``-`` is standard output."""
    return _files.STDOUT if name == "-" else name


def check_outputs(given: argparse.Namespace) -> None:
    """Raise `ValueError` if a report cannot be drawn or written as is asked."""
    plot = getattr(given, "plot", None)
    check_writable(plot, given.json)
    check_drawable(plot)


def deliver(report: Any, given: argparse.Namespace) -> None:
    """Print a report, on stderr if stdout is to have nothing but JSON; draw and write it where that is asked."""
    print(report, file=sys.stderr if given.json == _files.STDOUT else sys.stdout)
    if getattr(given, "plot", None) is not None:
        report.plot(given.plot)
    if given.json is not None:
        report.to_json(given.json)


def check_writable(*names: str | None) -> None:
    """Raise `ValueError` if a file cannot be written."""
    for name in names:
        if name is None or (_files.is_stream(name) and os.access(name, os.W_OK) and not Path(name).is_dir()):
            continue
        path = Path(os.path.realpath(name))
        if path.is_dir():
            raise ValueError(f"{name}: is a directory; the name of a file is needed.")
        if not path.parent.is_dir():
            raise ValueError(f"{name}: there is no directory {str(Path(name).parent)!r}; make it first.")
        if path.exists() and not os.access(path, os.W_OK):
            raise ValueError(f"{name}: the file is there and may not be changed.")
        try:
            tempfile.TemporaryFile(dir=path.parent).close()
        except OSError as error:
            raise ValueError(
                f"{name}: no file can be made in {str(Path(name).parent)!r}: {error.strerror}."
            ) from None


def check_drawable(name: str | None) -> None:
    """Raise `ValueError` if a figure cannot be drawn, or not in the format of its ending."""
    if name is None:
        return
    try:
        optional("matplotlib.backend_bases", "--plot")
    except ImportError as missing:
        raise ValueError(str(missing)) from None
    _files.check_picture(name)

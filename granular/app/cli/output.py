"""Output of a command: printed text and files.

Options for output files are checked before a long run.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

from granular._engine import files as _files
from granular._engine.package import import_optional
from granular.cases.ready import is_file
from granular.run import tables

LAST_COLUMN_FRACTION = 0.7
"""Largest start of the last column of a table, as a fraction of the width.

The text of a column that starts further to the right is not continued below the column.
"""
DEFAULT_SUFFIXES = {"plot": "png", "film": "gif", "json": "json"}


def add_outputs(parser: argparse.ArgumentParser, save_as: str = "npz", **about: str) -> None:
    """Add the options --plot, --film, --json and --save for which a text is given.

    Parameters
    ----------
    save_as : str
        Suffix of the file of --save, without a dot.
    about : str
        Help text for each option, by its name without dashes.
    """
    for name, text in about.items():
        to_stdout = "; - for standard output" if name == "json" else ""
        suffix = save_as if name == "save" else DEFAULT_SUFFIXES[name]
        parser.set_defaults(**{f"{name}_as": f".{suffix}"})
        parser.add_argument(f"--{name}", metavar=f"FILE.{suffix}", type=_stdout if to_stdout else str,
                            help=text + to_stdout)


def _stdout(name: str) -> str:
    """Return the name of the file to write. ``-`` stands for standard output."""
    return _files.STDOUT if name == "-" else name


def check(parsed: argparse.Namespace) -> None:
    """Raise an error if an output file cannot be written in its format."""
    written = {option: name for option in ("plot", "film", "json", "save")
               if (name := getattr(parsed, option, None)) is not None}
    for name in written.values():
        _files.check_writable(name)
    check_apart([*written.values()], [parsed.target] if parsed.target and is_file(parsed.target) else [])
    if "save" in written:
        tables.suffix_of(parsed.save) if parsed.save_as == ".npz" else _files.check_suffix(parsed.save, parsed.save_as)
    if "plot" in written:
        import_optional("matplotlib.backend_bases", "--plot")
        _files.check_figure_suffix(parsed.plot)
    if "film" in written:
        import_optional("matplotlib.animation", "--film")
        from granular.run.films import check_film

        check_film(parsed.film)


def check_apart(written: Sequence[str], read: Sequence[str]) -> None:
    """Raise an error if an output file is also an input, or is written twice."""
    used = set(map(os.path.realpath, read))
    for name in written:
        if os.path.realpath(name) in used and not _files.is_stream(name):
            raise ValueError(f"{name}: This command already reads or writes this file. Give another name.")
        used.add(os.path.realpath(name))


def wrap_text(text: str) -> str:
    """Wrap lines at the width of the terminal, or at 80 columns if it is unknown.

    A line of a table is continued below its last column, any other line two columns further to the right.
    """
    width = shutil.get_terminal_size((80, 24)).columns
    lines = []
    for line in text.split("\n"):
        last_column = line.rstrip().rfind("  ") + 2  # columns are at least two spaces apart
        margin = len(line) - len(line.lstrip()) + 2
        indent = last_column if margin < last_column <= LAST_COLUMN_FRACTION * width else margin
        lines += [line] if len(line) <= width else textwrap.wrap(
            line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines)


def write_report(report: Any, parsed: argparse.Namespace) -> None:
    """Print a report, and write the files that the options name.

    If standard output receives JSON, the text is printed to stderr.
    """
    text = report.details() if getattr(parsed, "verbose", False) else report
    remedies = f"\n\n{report.remedies()}" if getattr(parsed, "remedies", False) else ""
    print_text(f"{text}{remedies}", text_stream(parsed))
    if getattr(parsed, "plot", None) is not None:
        report.plot(parsed.plot)
    if getattr(parsed, "film", None) is not None:
        report.animate(parsed.film)
    if parsed.json is not None:
        report.to_json(parsed.json)


def print_text(text: str, stream: Any = None) -> None:
    """Print text within the width of the terminal, by default to standard output.

    A reader that closes its pipe early, such as `head`, does not end the command: it still writes its files.
    """
    try:
        print(wrap_text(text), file=stream, flush=True)
    except BrokenPipeError:
        discard_output(sys.stdout if stream is None else stream)


def discard_output(stream: Any) -> None:
    """Redirect a stream whose pipe is closed to the null device."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def text_stream(parsed: argparse.Namespace) -> Any:
    """Return the stream for text: stderr if standard output receives JSON."""
    return sys.stderr if parsed.json == _files.STDOUT else sys.stdout

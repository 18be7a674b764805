"""Files: atomic writing, formats, provenance, JSON numbers, ``.npz`` archives.

Files are written completely or not at all. The data type and the size of each array in an archive are checked before
memory is allocated.
"""

from __future__ import annotations

import math
import os
import stat
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np

from granular._engine.check import misuse
from granular._engine.package import VERSION

FILE_FORMAT = 3
"""Number of the current file format.

Files without a number have format 1. Up to format 2, a file names laws, rules and walls by module and class, such as
"granular.rules:ConstantRestitution". Since then it uses words, such as "constant-restitution".
"""
STDOUT = "/dev/stdout"
FORMAT_BYTES = 1 << 20
"""Upper bound of the bytes that a file contains in addition to its numbers."""
MAX_SHOWN_CHARACTERS = 500
"""Maximum number of characters of a text from a file that are shown."""
MAX_EXPANSION, MAX_HEADER_BYTES = 1032, 4096
"""Maximum ratio of original to compressed size, and size of a header in bytes."""
ArrayHeader: TypeAlias = tuple[np.dtype[Any], tuple[int, ...]]
"""Data type and shape of an array."""


def plain_text(text: str, most: int = MAX_SHOWN_CHARACTERS) -> str:
    """Return a text without control characters, at most `most` characters long.

    Characters that are not printable are replaced by blanks.
    """
    shown = "".join(c if c.isprintable() else " " for c in text[: most + 1])
    return shown if len(text) <= most else shown[: most - 1] + "…"


def write(path: str | os.PathLike[str], fill: Callable[[str], object]) -> None:
    """Write a file completely or not at all.

    `fill` receives the path of a draft in the same folder and writes it. The draft is then moved to `path`, and gets
    the mode of the file that it replaces. If `path` is a link, the file to which it leads is replaced. For
    devices, pipes and open files (``/dev/stdout``, ``/dev/fd/3``) the draft is copied instead.

    Raises
    ------
    OSError
        If the file cannot be written, with the path and the reason.
    """
    target = os.path.abspath(checked_path("the output path", path))
    if os.path.isdir(target):
        raise IsADirectoryError(f"The output path must be the name of a file, got the folder {os.fspath(path)!r}.")
    try:
        (_copy_to_stream if is_stream(target) else _replace_file)(target, fill)
    except OSError as error:
        if error.errno is None:
            raise
        reason = error.strerror or error
        raise type(error)(f"The output path must be writable, got {os.fspath(path)!r} ({reason}).") from None


def checked_path(name: str, path: Any) -> str:
    """Return a path as a string. Numbers are refused, because they denote open files."""
    if not isinstance(path, (str, bytes, os.PathLike)):
        raise TypeError(misuse(name, path, "the name of a file"))
    return os.fsdecode(path)


def checked_source(name: str, path: Any) -> str:
    """Return a path as a string if it is not a device or a pipe.

    Data from a device or a pipe can be endless.
    """
    text = checked_path(name, path)
    if os.path.exists(text) and not (os.path.isfile(text) or os.path.isdir(text)):
        raise ValueError(misuse(name, text, "a regular file", "A device or a pipe cannot be read here."))
    return text


def check_writable(name: str) -> None:
    """Raise `ValueError` if the file `name` cannot be written.

    The check is made before a long computation.
    """
    if is_stream(name) and os.access(name, os.W_OK) and not os.path.isdir(name):
        return
    import tempfile

    path, folder = os.path.realpath(name), os.path.dirname(name) or "."
    complaint = ("This is a directory. Give the name of a file." if os.path.isdir(path) else
             f"The directory {folder!r} does not exist. Create it first." if (
                 not os.path.isdir(os.path.dirname(path))) else
             "The file exists and is read-only." if os.path.exists(path) and not os.access(path, os.W_OK)
             else "")
    if complaint:
        raise ValueError(f"{name}: {complaint}")
    try:
        tempfile.TemporaryFile(dir=os.path.dirname(path)).close()
    except OSError as error:
        raise ValueError(f"{name}: No file can be created in {folder!r} ({error.strerror}).") from None


def is_stream(path: str | os.PathLike[str]) -> bool:
    """Return whether `path` is a device, a pipe or an open file, not a regular file."""
    if os.path.exists(path) and not os.path.isfile(path):
        return True
    name = os.path.abspath(os.fspath(path))
    for _ in range(40):  # limit of the system on links; realpath would not show that a link leads through /proc
        folder = os.path.realpath(os.path.dirname(name))
        name = os.path.join(folder, os.path.basename(name))
        if folder.startswith("/proc/") or not os.path.islink(name):
            return folder.startswith("/proc/")
        name = os.path.join(folder, os.readlink(name))
    return False


def _replace_file(target: str, fill: Callable[[str], object]) -> None:
    """Write a draft by `fill`, and move it to the file `target`, following links."""
    target = os.path.realpath(target)
    folder, name = os.path.split(target)
    stem, suffix = os.path.splitext(name)
    draft = os.path.join(folder, f".{stem[:100]}-{os.urandom(6).hex()}{suffix}")
    try:
        os.close(os.open(draft, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        fill(draft)
        if os.path.exists(target):
            os.chmod(draft, stat.S_IMODE(os.stat(target).st_mode))
        os.replace(draft, target)
    except BaseException:
        with suppress(FileNotFoundError):  # not created yet, or already moved to its place
            os.unlink(draft)
        raise


def check_disk_space(draft: str, size: int) -> None:
    """Raise `OSError` if the disk has no space for `size` bytes of numbers.

    The file `draft` is filled with zeros of this size and of `FORMAT_BYTES`.
    """
    with open(draft, "wb") as file:
        for _ in range(0, size + FORMAT_BYTES, FORMAT_BYTES):
            file.write(bytes(FORMAT_BYTES))


def _copy_to_stream(stream: str, fill: Callable[[str], object]) -> None:
    """Write a draft by `fill`, and copy it into a device, a pipe or an open file."""
    import shutil
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        draft = os.path.join(folder, "draft" + os.path.splitext(stream)[1])
        fill(draft)
        if stream == STDOUT and sys.stdout is not None:
            sys.stdout.flush()  # earlier output comes first
        with open(draft, "rb") as source, open(os.dup(1) if stream == STDOUT else stream, "ab") as sink:
            shutil.copyfileobj(source, sink)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` in UTF-8, completely or not at all."""
    write(path, lambda draft: Path(draft).write_text(text, encoding="utf-8"))


def write_json(path: str | os.PathLike[str], values: Any, indent: int | None = 1) -> None:
    """Write `values` as JSON, completely or not at all."""
    import json

    write_text(path, json.dumps(plain(values), indent=indent, ensure_ascii=False, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Convert values for JSON: arrays and tuples to lists, nan and inf to None."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_figure(path: str | os.PathLike[str] | None, figure: Any, dpi: int) -> Any:
    """Save a matplotlib figure in the format of the file's suffix, or return it.

    Without a path the figure is returned. Files are written completely or not at all.

    Raises
    ------
    OSError, ValueError
        If the file cannot be written, or if matplotlib does not support its suffix.
    """
    if path is None:
        return figure
    check_figure_suffix(path)
    write(path, lambda draft: figure.savefig(draft, dpi=dpi))
    return None


def check_figure_suffix(path: str | os.PathLike[str]) -> None:
    """Raise `ValueError` if matplotlib cannot write files with the suffix of `path`."""
    from matplotlib.backend_bases import FigureCanvasBase

    suffix = os.path.splitext(checked_path("path", path))[1][1:]
    suffixes = sorted(FigureCanvasBase.get_supported_filetypes())
    if suffix.lower() not in suffixes:
        raise ValueError(f"The suffix of {os.fspath(path)} must be one of {', '.join(suffixes)}, got {suffix!r}.")


class LaterVersionError(ValueError):
    """Error for a file that a later version of granular has written."""


def check_suffix(path: str | os.PathLike[str], needed: str, name_of_argument: str = "path") -> None:
    """Raise `ValueError` if `path` does not end with the suffix `needed`.

    Devices and pipes do not need a suffix.
    """
    name = os.fspath(path) if isinstance(path, os.PathLike) else path
    if not isinstance(name, str) or "\0" in name or not (name.lower().endswith(needed) or is_stream(name)):
        raise ValueError(misuse(name_of_argument, name, f"the name of a file that ends in {needed}"))


def check_format(path: str | os.PathLike[str], number: Any, unknown: Iterable[str] = ()) -> None:
    """Raise `LaterVersionError` for a later file format, or for unknown contents.

    `number` is the format of the file, `unknown` the names of contents that this version cannot read.
    """
    name = os.fspath(path)
    if not isinstance(number, int) or not 1 <= number <= FILE_FORMAT:
        shown = plain_text(repr(number), 60)
        is_later = isinstance(number, int) and number > FILE_FORMAT
        fix = "Read it with a later version of granular." if is_later else "The file is damaged or was edited."
        raise LaterVersionError(f"The format of {name} must be an integer from 1 to {FILE_FORMAT}, got {shown}. {fix}")
    if unknown_names := plain_text(", ".join(sorted(unknown))):
        raise LaterVersionError(f"The file {name!r} contains {unknown_names}, which this version cannot read. Read "
                                "it with a later version of granular.")


@cache
def version_of(package: str) -> str | None:
    """Return the version of an installed package, or None."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None


def provenance() -> dict[str, Any]:
    """Return file format, versions and platform, which are stored with every result."""
    import platform

    packages = ("numpy", "scipy", "numba", "sortedcontainers")
    versions = {"granular": VERSION, **{name: version_of(name) for name in packages}}
    return {
        "format": FILE_FORMAT,
        "versions": versions,
        "python": platform.python_version(),
        "machine": platform.machine(),
    }


class InvalidArchiveError(ValueError):
    """Error for a file that is not a complete, undamaged archive of arrays."""


def array_headers(file: IO[bytes]) -> dict[str, ArrayHeader]:
    """Return data type and shape of all arrays of an open ``.npz`` file, by name.

    `InvalidArchiveError` is raised for a damaged archive, for arrays of objects, and if the size of an array differs
    from its header.
    """
    with _opened(file) as archive:
        members, size = archive.infolist(), file.seek(0, os.SEEK_END)
        is_valid = all(
            info.compress_type in (0, 8) and info.file_size <= MAX_EXPANSION * info.compress_size + MAX_HEADER_BYTES
            for info in members
        )
        if not is_valid or sum(info.compress_size for info in members) > size:
            raise ValueError("members overlap, are too large, or use an unsupported compression")
        headers = {_name(info): _head(archive, info) for info in members}
        if len(headers) < len(members):
            raise ValueError("a member occurs twice")
        return headers


def read_arrays(file: IO[bytes]) -> dict[str, Any]:
    """Return all arrays of an open ``.npz`` file, by name."""
    with _opened(file) as archive:
        values = {}
        for info in archive.infolist():
            with archive.open(info) as stream:
                values[_name(info)] = np.lib.format.read_array(stream, allow_pickle=False)
        return values


@contextmanager
def _opened(file: IO[bytes]) -> Iterator[Any]:
    """Yield an open archive.

    Errors of zipfile and numpy are raised as `InvalidArchiveError`.
    """
    from zipfile import ZipFile

    try:
        with ZipFile(file) as archive:
            yield archive
    except MemoryError:
        raise
    except Exception as error:
        raise InvalidArchiveError(str(error)) from None


def _name(info: Any) -> str:
    return str(info.filename).removesuffix(".npy")


def _head(archive: Any, info: Any) -> ArrayHeader:
    """Return dtype and shape of the array `info` of an archive."""
    formats = np.lib.format
    readers = {(1, 0): formats.read_array_header_1_0, (2, 0): formats.read_array_header_2_0}
    with archive.open(info) as stream:
        shape, _, dtype = readers[formats.read_magic(stream)](stream)
        has_sizes = all(type(length) is int and length >= 0 for length in shape) and dtype.itemsize > 0
        if dtype.hasobject or not has_sizes or stream.tell() + dtype.itemsize * math.prod(shape) != info.file_size:
            raise ValueError("an array contains objects, or its size differs from its header")
    return dtype, shape

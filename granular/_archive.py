"""Arrays of an ``.npz`` file: what each is, and how large, is known before memory is taken for any.
May be skipped: files, no physics.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any, TypeAlias

import numpy as np

DENSEST, ROOM = 1032, 4096
"""Bytes that one byte of a deflated member can stand for at most, and the head of a small one."""
Head: TypeAlias = tuple[np.dtype[Any], tuple[int, ...]]
"""Kind and shape of an array."""


class Foreign(ValueError):
    """A file that is no archive of arrays, is cut short or damaged, or has other sizes than it says."""


def heads(file: IO[bytes]) -> dict[str, Head]:
    """Return the heads of all arrays of an open file by name; none is of objects, none larger than its head says."""
    with _opened(file) as archive:
        members, size = archive.infolist(), os.fstat(file.fileno()).st_size
        sound = all(info.compress_type in (0, 8) and info.file_size <= DENSEST * info.compress_size + ROOM
                    for info in members)
        if not sound or sum(info.compress_size for info in members) > size:
            raise ValueError("members that overlap, or are larger than they can be")
        found = {_name(info): _head(archive, info) for info in members}
        if len(found) < len(members):
            raise ValueError("a member is there twice")
        return found


def arrays(file: IO[bytes]) -> dict[str, Any]:
    """Return all arrays of an open file by name."""
    with _opened(file) as archive:
        found = {}
        for info in archive.infolist():
            with archive.open(info) as stream:
                found[_name(info)] = np.lib.format.read_array(stream, allow_pickle=False)
        return found


@contextmanager
def _opened(file: IO[bytes]) -> Iterator[Any]:
    """Open an archive; what zipfile and numpy raise, a dozen kinds, says that it is none."""
    from zipfile import ZipFile

    try:
        with ZipFile(file) as archive:
            yield archive
    except MemoryError:
        raise
    except Exception as error:
        raise Foreign(str(error)) from None


def _name(info: Any) -> str:
    return str(info.filename).removesuffix(".npy")


def _head(archive: Any, info: Any) -> Head:
    form = np.lib.format
    readers = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}
    with archive.open(info) as stream:
        shape, _, dtype = readers[form.read_magic(stream)](stream)
        counted = all(type(length) is int and length >= 0 for length in shape) and dtype.itemsize > 0
        if dtype.hasobject or not counted or stream.tell() + dtype.itemsize * math.prod(shape) != info.file_size:
            raise ValueError("objects, or an array of another size than its head says")
    return dtype, shape

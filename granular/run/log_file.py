"""A file of contacts, written as the run goes on.

It is a plain ``.npy``, whole after every block: its head says how many rows there are, in digits with room to grow
(format 1.0 of numpy), and is written anew after each block. So whatever ends the process, what the head counts is
there, and `numpy.load` reads it, mapped into memory if one likes. (HDF5 would do that too in its mode for one writer,
but cannot be opened to go on after a kill without a repair.)
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any

import numpy as np
from numpy.lib import format as npy

from granular._engine.files import checked_path, is_stream
from granular.run.contact_log import Rows, contacts


class LogFile:
    """Rows of one kind, appended block by block.

    Parameters
    ----------
    path : path
        A name that ends in .npy, of a file that is not there yet.
    kind : dtype
        Of a row where none comes; else the first block says it.

    Raises
    ------
    ValueError, FileExistsError
        If the name is none, or the file is there: nothing is written over.
    """

    def __init__(self, path: str | os.PathLike[str], kind: np.dtype[Any]) -> None:
        self.path, self.kind, self.count = os.path.abspath(checked_path("log", path)), kind, 0
        if not self.path.lower().endswith(".npy"):
            raise ValueError(f"log is {os.fspath(path)!r}: True, False or the name of a file that ends in .npy is "
                             "needed.")
        if is_stream(self.path) or os.path.lexists(self.path):
            raise FileExistsError(f"log is {os.fspath(path)!r}: it is there already; give another name, or remove it.")

    def __enter__(self) -> LogFile:
        try:
            self.file = open(self.path, "xb", buffering=0)
            self._head()
        except OSError as error:
            raise type(error)(f"log is {self.path!r}: a writable place is needed ({error.strerror}).") from None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        self.file.close()

    def extend(self, blocks: Iterable[Rows]) -> None:
        """Append blocks of rows, as to a list.

        Raises
        ------
        OSError
            If there is no more room: what the file had before stays in it.
        """
        for rows in blocks:
            if self.count == 0:
                self.kind = rows.dtype
                self.file.truncate(self._head())
                self.file.seek(0, os.SEEK_END)
            data = memoryview(rows.astype(self.kind, copy=False).tobytes())
            try:
                while data.nbytes:
                    data = data[self.file.write(data):]
                self.count += len(rows)
                self._head()
            except OSError as error:
                raise type(error)(f"log is {self.path!r}: it cannot grow ({error.strerror}); the run ends here, the "
                                  f"first {self.count} contacts are in the file.") from None

    def _head(self) -> int:
        """Write the head anew; return its length."""
        self.file.seek(0)
        head = {"descr": npy.dtype_to_descr(self.kind), "fortran_order": False, "shape": (self.count,)}
        npy.write_array_header_1_0(self.file, head)
        length = self.file.tell()
        self.file.seek(0, os.SEEK_END)
        return length


def mapped(path: str) -> Rows:
    """Return the rows of a file, which are read where they are looked at."""
    try:
        rows: Rows = np.load(path, mmap_mode="r")
    except ValueError as error:
        raise ValueError(f"log is {path!r}: that is no log of contacts ({error}).") from None
    if not {"pair", "t_begin"} <= set(rows.dtype.names or ()):
        raise ValueError(f"log is {path!r}: that is no log of contacts; its numbers have no names pair and t_begin.")
    return rows


def batches(rows: Rows, size: int) -> Iterator[Rows]:
    """Return rows as in the public log, so many at a time."""
    for k in range(0, len(rows), size):
        yield contacts([np.array(rows[k : k + size])])

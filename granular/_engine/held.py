"""Named tuples of arrays that machine code takes by reference: one word instead of some eighty that every call copies.

Machine code reads ``s.pairs`` from where the arrays are noted, in one place; interpreted code from the tuple itself.
What numba is told of it is in `granular._engine.numba_pipeline`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar
from zlib import crc32

import numpy as np

WORDS = 256
"""Room in which the arrays of one tuple are noted, in words of 8 bytes."""


class Held:
    """What a named tuple inherits that is held so; its arrays live as long as it does."""

    _plain: ClassVar[Callable[..., Any]]
    """The named tuple itself."""
    note: ClassVar[Callable[[Any, Any], None]]
    """Writes where the arrays are into a room; see `granular._engine.numba_pipeline`."""

    @cached_property
    def room(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Where they are noted."""
        room = np.zeros(WORDS, np.int64)
        Held.note(self._plain(*self), room)  # type: ignore[misc]  # it is a tuple
        return room


@cache
def version() -> int:
    """Return a number that changes with what numba is told: machine code of another one must not be taken for ours."""
    try:
        return crc32(Path(__file__).with_name("numba_pipeline.py").read_bytes())
    except OSError:  # no source, where nothing is kept on the disk either
        return 0


def held(fields: Any, room: Any) -> Any:
    """Return a tuple as kernels take it: if they are compiled, where it is noted, in a room."""
    return fields

"""Which number on the command line is of a size that no scene has, for a refusal to name it.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


@contextmanager
def named(options: Mapping[str, Any]) -> Iterator[None]:
    """Put the first option that is too large or too small in front of a refusal that names something else, which
    follows from it: an end time that is infinite, a mass that is 0."""
    try:
        yield
    except (ValueError, ArithmeticError) as error:
        from granular.edmd.physics import LARGEST, SMALLEST

        own = hasattr(error, "raised_by")  # by a function of the user's own
        far = [] if own else [(name, x) for name, x in _numbers(options) if not SMALLEST <= abs(x) <= LARGEST]
        if not far or any(re.search(rf"\b{name}\b", str(error)) for name, _ in far):
            raise
        name, value = far[0]
        raise ValueError(f"{name} is {value!r}: 0 or a size from {SMALLEST:g} to {LARGEST:g} is needed; "
                         f"use other units ({str(error).rstrip('.')}).") from error


def _numbers(options: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """The numbers among options and in their lists and tables, except for 0."""
    for name, value in options.items():
        inner = value.items() if isinstance(value, Mapping) else [("", value)]
        for key, entry in inner:
            for x in entry if isinstance(entry, (list, tuple)) else [entry]:
                if isinstance(x, (int, float)) and not isinstance(x, bool) and x != 0:
                    yield key or name, x

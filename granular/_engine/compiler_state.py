"""State of the compiler, its dispatchers, and tuples passed by reference.

The state is shared by `granular._engine.kernels` and `granular._engine.numba_pipeline`.
"""

from __future__ import annotations

import gc
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, wraps
from typing import Any, ClassVar

import numpy as np

REFERENCE_WORDS = 256
"""Length of the table of array addresses of one tuple, in words of 8 bytes."""


class ByReference:
    """Base class of named tuples of arrays that compiled code receives by reference.

    Compiled code reads the fields from a table of addresses, so that a call copies one word instead of about eighty.
    Interpreted code reads the tuple itself. `granular._engine.numba_pipeline` defines the numba type.
    """

    _plain: ClassVar[Callable[..., Any]]
    """The same named tuple without this base class."""
    write_addresses: ClassVar[Callable[[Any, Any], None]]
    """Function that writes the addresses of the arrays into a table.

    It is set by `granular._engine.numba_pipeline`.
    """

    @cached_property
    def room(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Table of the addresses of the arrays, valid as long as the tuple exists."""
        room = np.zeros(REFERENCE_WORDS, np.int64)
        ByReference.write_addresses(self._plain(*self), room)  # type: ignore[misc]  # it is a tuple
        return room


def by_reference(fields: Any, room: Any) -> Any:
    """Return the named tuple `fields` in the form in which kernels receive it.

    For interpreted kernels this is the tuple itself. For compiled kernels it is a pointer to the table `room`, which
    contains the addresses of the arrays.
    """
    return fields


class Mode:
    """State of the compiler in this process."""

    fast: bool | None = None
    """Whether kernels are compiled by the fast pipeline. None before numba is loaded."""
    on_switch: ClassVar[list[Callable[[], None]]] = []
    """Functions without arguments that clear caches, called by `use_default_pipeline`."""


def numba_version() -> tuple[int, ...]:
    """Return the version of numba (major, minor). numba must be loaded."""
    return tuple(map(int, sys.modules["numba"].__version__.split(".")[:2]))


def use_default_pipeline(reason: BaseException) -> None:
    """Switch to numba's default pipeline for all later compilations, and warn once.

    `reason` is the exception of the fast pipeline.
    """
    if Mode.fast:
        Mode.fast = False
        for clear in Mode.on_switch:
            clear()
        warnings.warn(
            f"the fast compiler pipeline failed with numba {sys.modules['numba'].__version__} "
            f"({type(reason).__name__}: {reason}). Kernels are compiled by the default pipeline, which takes two to "
            "three times as long and gives the same results.", RuntimeWarning, stacklevel=2)


def cache_on_disk(function: Any) -> Any:
    """Enable numba's cache on disk for a compiled function, if it can be written."""
    with suppress(RuntimeError):
        function.enable_caching()
    return function


def with_exact_types(result: Any) -> Callable[..., Any]:
    """Return a method that selects the version of a callee by its exact types.

    numba's own method also offers versions for records with fewer fields of which the first are equal, with a warning
    about an experimental feature. The fast pipeline selects versions in the same way.
    """
    template_of_call = result.get_call_template

    def exact_template(*call: Any) -> Any:
        """Return the template of a call, with one version for its types."""
        template, names, types_of_arguments, keywords = template_of_call(*call)
        if exact := result.overloads.get(tuple(types_of_arguments)):
            template.cases = [exact.signature]
        return template, names, types_of_arguments, keywords

    return exact_template


def without_collection(compile_for: Any) -> Any:
    """Return a compile function that disables the garbage collector while it runs.

    Compilation creates millions of objects that stay alive. Their repeated traversal by the collector takes up to a
    tenth of the time.
    """

    @wraps(compile_for)
    def compile_without_collection(signature: Any) -> Any:
        """Compile for a signature without garbage collection, which is faster."""
        enabled = gc.isenabled()
        gc.disable()
        try:
            return compile_for(signature)
        finally:
            if enabled:
                gc.enable()

    return compile_without_collection

"""A function of one's own that a TOML file names: ``"motion.py:shake"`` of a file beside it, or ``"module:shake"``.
May be skipped: files and the command, no physics.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

on_running: list[Callable[[str], object]] = []
"""Who is told that a file read now names Python code, and which, before that runs."""


class Named:
    """A function by its name; it travels to other processes, and is looked up when it is first called.

    Parameters
    ----------
    name : str
        ``"file.py:function"``, or ``"package.module:function"`` of what can be imported.
    folder : str
        Where the file is, if `name` says no more.
    """

    def __init__(self, name: str, folder: str = "") -> None:
        self.name, self.folder = name, folder

    @property
    def place(self) -> str:
        """Path of the file, or name of the module, whose code runs when the function is looked up."""
        place = self.name.partition(":")[0]
        return os.path.join(self.folder, place) if place.endswith(".py") else place

    def __call__(self, *given: Any) -> Any:
        """Call the function; what it raises passes through, marked as its own."""
        function = self.function
        with _marked(self.name):
            return function(*given)

    @cached_property
    def function(self) -> Any:
        """The function itself.

        Raises
        ------
        ValueError
            If there is no such file, module or function.
        """
        place, word = self.place, self.name.partition(":")[2]
        try:
            with _marked(self.name):
                module = _of_file(place) if place.endswith(".py") else import_module(place)
            found = getattr(module, word)
        except (AttributeError, ImportError, OSError, ValueError) as error:
            raise ValueError(f"function is {self.name!r}: it cannot be found ({error}); 'file.py:name' of a file "
                             "beside this one is needed, or 'module:name' of a module that can be imported.") from None
        if not callable(found):
            raise ValueError(f"function is {self.name!r}: a function m(t) is needed, and that is {found!r}.")
        return found

    def __eq__(self, other: object) -> bool:
        return (self.name, self.folder) == (other.name, other.folder) if isinstance(other, Named) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.name, self.folder))

    def __repr__(self) -> str:
        return self.name

    def __reduce__(self) -> tuple[Any, ...]:
        return Named, (self.name, self.folder)


def sentence_of(error: BaseException) -> str:
    """Return what an exception says, in one line; of one that a named function has raised, that too."""
    said = " ".join(str(error).split())
    owner = getattr(error, "raised_by", None)
    return said if owner is None else f"function {owner} raised {type(error).__name__}: {said}"


def name_of(function: Any) -> str:
    """Return the name by which a file may ask for `function`, or raise `TypeError` if there is none."""
    if isinstance(function, Named):
        return function.name
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', '')}"
    try:
        same = Named(name).function is function
    except ValueError:
        same = False
    if not same:
        raise TypeError(f"function is {function!r}: only one that can be imported by its name can be written to TOML; "
                        "put it into a module.")
    return name


@contextmanager
def _marked(name: str) -> Iterator[None]:
    """Mark what is raised within as `raised_by` the function `name`; it keeps that through other processes too."""
    try:
        yield
    except Exception as error:
        error.__dict__["raised_by"] = name
        raise


def _of_file(path: str) -> Any:
    """Run a Python file and return its module."""
    spec = spec_from_file_location(os.path.splitext(os.path.basename(path))[0], path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module

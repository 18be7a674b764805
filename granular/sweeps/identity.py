"""What decides about an answer, as text: those who ask the same go on with the file of a sweep, and nobody else.
May be skipped: files, no physics.

Values are written out, arrays by a digest of their bytes, objects by their class and all that they hold. A function or
class that is a caller's own is its code: with its constants, its defaults, what it encloses, the globals it reads, and
the functions it calls, as far as they are the caller's too.
"""

from __future__ import annotations

import builtins
import functools
import pickle
import re
import sys
import types
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from hashlib import sha256
from typing import Any

import numpy as np

ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
LIBRARY = ("site-packages", "dist-packages")
"""Folders whose code is known by its name."""
PARTS = (types.FunctionType, classmethod, staticmethod, property, bool, int, float, str)
"""What of a class decides about what it does."""


def identity(value: Any) -> Any:
    """Return what decides about the answers of a value as text, numbers, and lists and tables of them."""
    return _Reader().of(value)


class _Reader:
    """Reads a value once; `inside` are the objects inside of which it reads, `known` the functions and classes read."""

    def __init__(self) -> None:
        self.inside, self.known = list[int](), list[Any]()

    def of(self, value: Any) -> Any:
        """Read a value; an object inside itself is only named."""
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if id(value) in self.inside:
            return "itself"
        self.inside.append(id(value))
        try:
            return self._read(value)
        finally:
            self.inside.pop()

    def _read(self, value: Any) -> Any:
        if isinstance(value, np.ndarray) and value.dtype.kind != "O":
            return f"{value.dtype.str}{value.shape} {digest(np.ascontiguousarray(value).tobytes())}"
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, Mapping):
            return {str(key): self.of(one) for key, one in value.items()}
        if isinstance(value, (list, tuple, np.ndarray)):
            return [self.of(one) for one in value]
        if isinstance(value, (set, frozenset)):
            return sorted((self.of(one) for one in value), key=repr)
        if isinstance(value, functools.partial):
            return ["partial", *map(self.of, (value.func, value.args, value.keywords))]
        if isinstance(value, types.MethodType):
            return [self.of(value.__func__), self.of(value.__self__)]
        if isinstance(value, (types.FunctionType, type)):
            return self.code(value)
        if isinstance(value, (types.BuiltinFunctionType, np.ufunc, types.ModuleType)):
            return getattr(value, "__qualname__", None) or value.__name__
        return [self.of(type(value)), self.held(value)]

    def code(self, given: Any) -> Any:
        """Read a function or a class: its name, and of a caller's own, when it is met first, what it is."""
        name = f"{given.__module__}.{given.__qualname__}"
        if not is_own(given.__module__) or any(given is other for other in self.known):
            return name
        self.known.append(given)
        return [name, *(self.function(given) if isinstance(given, types.FunctionType) else self.cls(given))]

    def function(self, given: types.FunctionType) -> Iterator[Any]:
        """Read what a function does, and with what."""
        yield digest(b"".join(code(given.__code__)))
        yield self.of([given.__defaults__, given.__kwdefaults__])
        yield [self.of(cell.cell_contents) for cell in given.__closure__ or () if cell != types.CellType()]
        there = given.__globals__
        yield {word: self.of(there[word]) for word in sorted(set(names(given.__code__))) if word in there}

    def cls(self, given: type) -> Iterator[Any]:
        """Read the bases of a class, its methods and values."""
        yield [self.of(base) for base in given.__bases__]
        yield {word: self.of(getattr(part, "__func__", getattr(part, "fget", part)))
               for word, part in vars(given).items() if isinstance(part, PARTS) and not word.startswith("__f")
               and word not in ("__module__", "__doc__", "__qualname__")}

    def held(self, value: Any) -> Any:
        """Read what an object holds; of a library's by its pickle, else as it says that it is."""
        if is_dataclass(value):
            return {one.name: self.of(getattr(value, one.name)) for one in fields(value)}
        if is_own(type(value).__module__):
            slots = [name for cls in type(value).__mro__ for name in vars(cls).get("__slots__", ())]
            return self.of(getattr(value, "__dict__", {}) | {n: getattr(value, n) for n in slots if hasattr(value, n)})
        try:
            return digest(pickle.dumps(value))
        except Exception:  # whatever its own code raises
            return ADDRESS.sub("", repr(value))


def is_own(module: str | None) -> bool:
    """Return whether a module is a caller's own: not this package, nor installed, nor a part of Python."""
    root = (module or "__main__").partition(".")[0]
    if root == "__main__":
        return True
    if root == "granular" or root in sys.stdlib_module_names:
        return False
    return not any(folder in (getattr(sys.modules.get(root), "__file__", None) or "") for folder in LIBRARY)


def names(compiled: types.CodeType) -> Iterator[str]:
    """Yield the names that a code, and those inside it, may read of its globals, except for Python's own."""
    yield from (name for name in compiled.co_names if not hasattr(builtins, name))
    for one in compiled.co_consts:
        if isinstance(one, types.CodeType):
            yield from names(one)


def code(compiled: types.CodeType) -> Iterator[bytes]:
    """Yield what a code does, not where it stands."""
    yield compiled.co_code
    yield repr((compiled.co_names, compiled.co_varnames, compiled.co_flags)).encode()
    for one in compiled.co_consts:
        if isinstance(one, types.CodeType):
            yield from code(one)
        else:
            yield repr(sorted(one, key=repr) if isinstance(one, frozenset) else one).encode()


def digest(data: bytes) -> str:
    """Return a few letters that stand for some bytes."""
    return sha256(data).hexdigest()[:16]

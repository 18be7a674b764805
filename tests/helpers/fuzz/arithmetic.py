"""One source, three arithmetics: doubles compiled by numba, long doubles, and mpmath at many digits.

The solver is written in functions marked `formula`, of numbers and arrays of numbers. `build` returns such a function
with all formulas it calls bound to one arithmetic.
"""

from __future__ import annotations

import math
import types
from dataclasses import dataclass
from functools import cache
from typing import Any
from zlib import crc32

import numpy as np


def _unbound(*_: Any) -> Any:
    raise NotImplementedError("build the formula first")


power = exp = tanh = root = _unbound
"""Elementary functions, bound by `build`."""


def formula(function: Any) -> Any:
    """Mark a function of the solver: `build` binds it, and what it calls, to an arithmetic."""
    function.__formula__ = True
    return function


@dataclass(frozen=True)
class Arithmetic:
    """Numbers and their elementary functions; `columns` is half of the order of a step, `eps` its rounding."""

    name: str
    columns: int
    eps: float
    tolerance: float

    def number(self, x: Any) -> Any:
        """One number, exactly."""
        if self.name == "double":
            return float(x)
        return np.longdouble(x) if self.name == "long" else _mp().mpf(x)

    def array(self, values: Any) -> Any:
        """An array of numbers."""
        out = self.zeros(len(values))
        for i, x in enumerate(values):
            out[i] = self.number(x)
        return out

    def zeros(self, *shape: int) -> Any:
        """An array of zeros."""
        out = np.empty(shape, {"double": np.float64, "long": np.longdouble, "digits": object}[self.name])
        out.fill(self.number(0.0))
        return out


def functions(name: str) -> dict[str, Any]:
    """The elementary functions of an arithmetic."""
    if name == "double":
        return {"power": math.pow, "exp": math.exp, "tanh": math.tanh, "root": math.sqrt}
    if name == "long":
        return {"power": np.power, "exp": np.exp, "tanh": np.tanh, "root": np.sqrt}
    mp = _mp()
    return {"power": mp.power, "exp": mp.exp, "tanh": mp.tanh, "root": mp.sqrt}


DOUBLE = Arithmetic("double", 6, 2.0**-53, 1e-16)
LOOSE = Arithmetic("double", 6, 2.0**-53, 2e-15)
LONG = Arithmetic("long", 8, 2.0**-64, 5e-20)
DIGITS = Arithmetic("digits", 14, 1e-40, 1e-33)


@cache
def _mp() -> Any:
    import mpmath

    mp = mpmath.MPContext()
    mp.dps = 40
    return mp


def build(function: Any, arithmetic: Arithmetic, compiled: bool = True) -> Any:
    """Return `function` with the formulas and elementary functions it uses bound to an arithmetic."""
    return _bound(function, arithmetic.name, compiled)


@cache
def _bound(function: Any, name: str, compiled: bool) -> Any:
    elementary = functions(name)
    scope = dict(function.__globals__)
    for called in _names(function):
        if getattr(scope.get(called), "__formula__", False):
            scope[called] = _bound(scope[called], name, compiled)
        elif called in elementary:
            scope[called] = elementary[called]
    bound = types.FunctionType(function.__code__, scope, function.__name__, function.__defaults__)
    bound.__module__ = function.__module__
    bound.__qualname__ = f"{function.__name__}_{_checksum(function):08x}"
    if name != "double" or not compiled:
        return bound
    import numba

    return numba.njit(error_model="numpy", cache=True)(bound)


def _names(function: Any) -> tuple[str, ...]:
    return function.__code__.co_names


@cache
def _checksum(function: Any) -> int:
    """A checksum of a formula and of all it calls, so that stale machine code is never used."""
    scope = function.__globals__
    below = [_checksum(scope[n]) for n in _names(function) if getattr(scope.get(n), "__formula__", False)]
    read = [scope[n] for n in _names(function) if isinstance(scope.get(n), (int, float, tuple))]
    constants = [c for c in function.__code__.co_consts if not isinstance(c, (str, types.CodeType))]
    return crc32(repr((constants, _names(function), read, below)).encode(), crc32(function.__code__.co_code))

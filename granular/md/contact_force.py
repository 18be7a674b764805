"""Make force laws callable from a kernel: as they stand when interpreted, as one C function when compiled.

A kernel calls ``force(laws[c], xi, xi_dot, xi_max, pairs[c])``. Interpreted, `laws` holds the law objects. Compiled,
it holds records of their fields, and `force` is the law's own method compiled with such a record in place of `self`:
the same source, hence the same bits. The function has one fixed type whatever the law, so kernels that take it are
compiled once and cached, and a new law costs only its own few lines.
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from granular._kernels import load_numba
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws
from granular.scene import Pairs

WIDTH = 12
LAW = np.dtype([("kind", np.int64), ("field", np.float64, (WIDTH,))])
PAIR = np.dtype([("m_eff", np.float64), ("r_eff", np.float64), ("index", np.int64)])


class NotCompilableError(TypeError):
    """A law that cannot be compiled, with the reason."""


def interpreted(law: PairLaw, xi: float, xi_dot: float, xi_max: float, pair: Any) -> float:
    """Call a law as it stands."""
    return law.force(xi, xi_dot, xi_max)


def law_records(laws: SceneLaws) -> np.ndarray[Any, Any]:
    """Fields of each law as a record array, with the number of its class; shape (n_pairs,).

    Raises
    ------
    NotCompilableError
        If a law is not a dataclass of at most `WIDTH` numbers.
    """
    kinds = _kinds(laws)
    records = np.zeros(len(laws.each), LAW)
    for record, one in zip(records, laws.each, strict=True):
        law, name = one.law, type(one.law).__name__
        try:
            values = [float(getattr(law, f.name)) for f in fields(law)]
        except (TypeError, ValueError) as error:
            raise NotCompilableError(f"{name} is not a dataclass of numbers ({error})") from None
        if len(values) > WIDTH:
            raise NotCompilableError(f"{name} has {len(values)} fields, more than {WIDTH}")
        record["kind"] = kinds.index((type(law), one.memory))
        record["field"][: len(values)] = values
    return records[laws.kind]


def pair_records(pairs: Pairs) -> np.ndarray[Any, Any]:
    """Pairs as a record array, shape (n_pairs,)."""
    records = np.zeros(len(pairs), PAIR)
    records["m_eff"], records["r_eff"], records["index"] = pairs.m_eff, pairs.r_eff, np.arange(len(pairs))
    return records


def compiled_force(laws: SceneLaws) -> Any:
    """Return the compiled force for `laws`, of the type `force_type()`.

    Raises
    ------
    NotCompilableError
        With the compiler's reason.
    """
    return _compiled_kinds(tuple(_kinds(laws)))


@cache
def force_type() -> Any:
    """The numba type of a compiled force, the same for every law."""
    import numba
    from numba import types

    real = types.float64
    return types.FunctionType(real(numba.from_dtype(LAW), real, real, real, numba.from_dtype(PAIR)))


def _kinds(laws: SceneLaws) -> list[tuple[type, bool]]:
    """The different classes, and whether they have memory."""
    return list(dict.fromkeys((type(one.law), one.memory) for one in laws.each))


@cache
def _compiled_kinds(kinds: tuple[tuple[type, bool], ...]) -> Any:
    numba = load_numba()
    try:
        force = _one_kind(*kinds[-1])
        for number in reversed(range(len(kinds) - 1)):
            force = _either(number, _one_kind(*kinds[number]), force)
        return numba.njit(force_type().signature)(force.py_func)
    except numba.core.errors.NumbaError as error:
        reason = str(error).strip().splitlines()[-1]
        raise NotCompilableError(f"{kinds[0][0].__name__}.force does not compile: {reason}") from error


def _one_kind(kind: Any, memory: bool) -> Any:
    """The method of one class, with a tuple of its fields for `self`."""
    import numba
    from numba.np.unsafe.ndarray import to_fixed_tuple

    names = [f.name for f in fields(kind)]
    record, count = namedtuple("record", names), len(names)
    force = numba.njit(kind.force)
    if memory:

        def call(law: Any, xi: float, xi_dot: float, xi_max: float, pair: Any) -> Any:
            return force(record(*to_fixed_tuple(law.field, count)), xi, xi_dot, pair, xi_max)
    else:

        def call(law: Any, xi: float, xi_dot: float, xi_max: float, pair: Any) -> Any:
            return force(record(*to_fixed_tuple(law.field, count)), xi, xi_dot, pair)

    return numba.njit(call)


def _either(number: int, this: Any, others: Any) -> Any:
    """Choose by the record's kind between one class and the rest."""
    import numba

    def call(law: Any, xi: float, xi_dot: float, xi_max: float, pair: Any) -> Any:
        if law.kind == number:
            return this(law, xi, xi_dot, xi_max, pair)
        return others(law, xi, xi_dot, xi_max, pair)

    return numba.njit(call)

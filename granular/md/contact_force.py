"""How a kernel asks for the force of a pair: kernels of one face, which a march is specialised for.

They are called as ``force(physics, lo, j, xi, xi_dot, a)`` for the pair at place `j` of a window that begins at pair
`lo`, and return the unclipped force, 0 of an open pair. Laws of the form k ξ + γ ξ̇ or √ξ (k ξ + γ ξ̇) become part of
the march itself, interpreted and compiled. All others are `asked` as objects where a run is interpreted, and `called`
as one C function where it is compiled: the law's own method, compiled with a record of its fields in place of `self`.
It is the same source, hence the same bits. The function has one fixed type whatever the law, so a march that takes it
is compiled once and cached, and a new law costs only its own few lines.
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from granular._kernels import kernel, load_numba
from granular.laws.kinds import SceneLaws
from granular.scene import Pairs

WIDTH = 12
LAW = np.dtype([("kind", np.int64), ("field", np.float64, (WIDTH,))])
PAIR = np.dtype([("m_eff", np.float64), ("r_eff", np.float64), ("index", np.int64)])

Called = namedtuple("Called", "function law pair")
"""A compiled force, and records of laws and pairs that it takes."""


@kernel
def power(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """k ξ + γ ξ̇ or √ξ (k ξ + γ ξ̇)."""
    x = xi if xi > 0.0 else 0.0
    f = a.k[j + 1] * x + a.gamma[j + 1] * xi_dot
    if physics.root:
        f = math.sqrt(x) * f
    return f if xi > 0.0 else 0.0


@kernel
def asked(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Force of a law that is an object; what is too large for a number is infinite, as in compiled code."""
    if not xi > 0.0:
        return 0.0
    try:
        return physics.laws[lo + j].force(xi, xi_dot, a.top[j + 1] if a.top[j + 1] > xi else xi)
    except OverflowError:
        return math.inf


@kernel
def called(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Force of a law that is a C function of records; see `Called`."""
    if not xi > 0.0:
        return 0.0
    laws, c = physics.laws, lo + j
    return laws.function(laws.law[c], xi, xi_dot, a.top[j + 1] if a.top[j + 1] > xi else xi, laws.pair[c])


def coefficients(laws: SceneLaws) -> tuple[Any, Any, bool] | None:
    """Return k and γ of all pairs, and whether √ξ is a factor: what `power` takes, if all laws are of one such form."""
    for p, d in ((1.0, 0.0), (1.5, 0.5)):
        if all(law.form and law.form[1] == p and (law.form[3] == d or not law.form[2]) for law in laws.each):
            k, _, gamma, _ = laws.column(lambda law: law.form).T
            return k, gamma, p == 1.5
    return None


class NotCompilableError(TypeError):
    """A law that cannot be compiled, with the reason."""


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
    """Return the compiled force for `laws`, of one type whatever the laws.

    Raises
    ------
    NotCompilableError
        With the compiler's reason.
    """
    return _compiled_kinds(tuple(_kinds(laws)))


@cache
def _signature() -> Any:
    """The numba signature of a compiled force, the same for every law."""
    import numba
    from numba import types

    real = types.float64
    return real(numba.from_dtype(LAW), real, real, real, numba.from_dtype(PAIR))


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
        compiled = numba.njit(_signature())(force.py_func)
    except numba.core.errors.NumbaError as error:
        reason = str(error).strip().splitlines()[-1]
        raise NotCompilableError(f"{kinds[0][0].__name__}.force does not compile: {reason}") from error
    return numba.types.function_type.CompileResultWAP(compiled.get_compile_result(_signature()))


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

"""How a kernel asks for the force of a pair: kernels of one face, which a march is specialised for.

They are called as ``force(laws, c, xi, xi_dot, xi_max)``. Interpreted, `laws` holds the law objects, which are `asked`.
Compiled, laws that compute as k ξ + γ ξ̇ or √ξ (k ξ + γ ξ̇) become part of the march itself. All others are
`called` as one C function: the law's own method, compiled with a record of its fields in place of `self`. It
is the same source, hence the same bits. The function has one fixed type whatever the law, so a march that takes it is
compiled once and cached, and a new law costs only its own few lines.
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from granular._kernels import kernel, load_numba
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws
from granular.scene import Pairs

WIDTH = 12
LAW = np.dtype([("kind", np.int64), ("field", np.float64, (WIDTH,))])
PAIR = np.dtype([("m_eff", np.float64), ("r_eff", np.float64), ("index", np.int64)])
PROBES = ((0.3, 0.7), (1.7e-3, -2.9), (5.3e-7, 0.011), (41.0, -0.13))
"""Overlaps and rates at which a law must give the very number of its power form."""

Called = namedtuple("Called", "function law pair")
"""A compiled force, and records of laws and pairs that it takes."""
Columns = namedtuple("Columns", "k gamma root")
"""Stiffness and damping of the pairs; whether √ξ is a factor of the force."""


@kernel
def asked(laws: Any, c: int, xi: float, xi_dot: float, xi_max: float) -> Any:
    """Force of a law that is an object."""
    return laws[c].force(xi, xi_dot, xi_max)


@kernel
def called(laws: Any, c: int, xi: float, xi_dot: float, xi_max: float) -> Any:
    """Force of a law that is a C function of records; see `Called`."""
    return laws.function(laws.law[c], xi, xi_dot, xi_max, laws.pair[c])


@kernel
def power(laws: Any, c: int, xi: float, xi_dot: float, xi_max: float) -> Any:
    """k ξ + γ ξ̇ or √ξ (k ξ + γ ξ̇) of `Columns`."""
    f = laws.k[c] * xi + laws.gamma[c] * xi_dot
    return math.sqrt(xi) * f if laws.root else f


def columns(laws: SceneLaws) -> Columns | None:
    """Return what the force `power` takes, if all laws compute just so and all with √ξ or all without."""
    roots = {_has_root(law) for law in laws.each}
    if len(roots) != 1 or None in roots:
        return None
    k, _, gamma, _ = laws.column(lambda law: law.form).T
    return Columns(k.copy(), gamma.copy(), roots == {True})


def _has_root(law: PairLaw) -> bool | None:
    """Whether a law computes just as `power` does with √ξ or without, tried at a few points; None if neither."""
    if law.form is None:
        return None
    k, p, gamma, d = law.form
    if (p, d if gamma else p - 1.0) not in ((1.5, 0.5), (1.0, 0.0)):
        return None
    one = Columns([k], [gamma], p == 1.5)
    alike = all(law.given(xi, rate, xi) == power(one, 0, xi, rate, xi) for xi, rate in PROBES)
    return one.root if alike else None


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

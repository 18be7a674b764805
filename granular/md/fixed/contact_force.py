"""Contact force of a pair in the kernels with a fixed step.

All kernels share the signature ``force(physics, lo, j, xi, xi_dot, a)``, where `j` is the index of the pair in a window
that begins at pair `lo`. They return the unclipped force, and 0 for an open pair. Laws of the form k ξ + γ ξ̇, √ξ (k ξ
+ γ ξ̇) or Tsuji's law are compiled into the march itself. All other laws are called as objects (`object_force`) in
interpreted runs, and as one C function (`called`) in compiled runs. This function is the law's own method, compiled
with a record of its fields in place of `self`. The source is the same, so results are bitwise identical. The function
has one fixed type for all laws. The march is therefore compiled once and cached, and a new law costs only its own few
lines.
"""

from __future__ import annotations

import math
from collections import namedtuple
from contextlib import suppress
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from granular._engine.kernels import HEATED, RING, kernel, load_numba
from granular.laws.kinds import SceneLaws
from granular.md.fixed.window import HAS_DAMPING
from granular.scene import Pairs

MAX_LAW_FIELDS = 12
LAW_RECORD = np.dtype([("kind", np.int64), ("field", np.float64, (MAX_LAW_FIELDS,)), ("failed", np.float64, (3,))])
PAIR_RECORD = np.dtype([("m_eff", np.float64), ("r_eff", np.float64), ("index", np.int64)])

Called = namedtuple("Called", "function law pair")
"""A compiled force with the records of laws and pairs that it takes.

If a law raised an exception, its record contains the first ξ, ξ̇ and ξ_max at which it did."""


@kernel
def power(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return k ξ + γ ξ̇ or √ξ (k ξ + γ ξ̇)."""
    x = xi if xi > 0.0 else 0.0
    f = a.k[j + 1] * x + a.gamma[j + 1] * xi_dot if HAS_DAMPING else a.k[j + 1] * x
    if physics.root:
        f = math.sqrt(x) * f
    return f if xi > 0.0 else 0.0


@kernel
def tsuji(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return k ξ √ξ + γ ξ^(1/4) ξ̇, with the same rounding as the law."""
    x = xi if xi > 0.0 else 0.0
    root = math.sqrt(x)
    f = a.k[j + 1] * x * root + a.gamma[j + 1] * math.sqrt(root) * xi_dot
    return f if xi > 0.0 else 0.0


@kernel
def object_force(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return the force of a law that is an object.

    Overflow gives inf, as in compiled code.
    """
    if not xi > 0.0 or (HEATED and a.k[j + 1] == 0.0):
        return 0.0
    c = (lo + j) % physics.ring if RING else lo + j
    try:
        return physics.laws[c].force(xi, xi_dot, a.top[j + 1] if a.top[j + 1] > xi else xi)
    except OverflowError:
        return math.inf


@kernel
def called(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return the force of a law that is a C function of records, see `Called`."""
    if not xi > 0.0 or (HEATED and a.k[j + 1] == 0.0):
        return 0.0
    laws, c = physics.laws, (lo + j) % physics.ring if RING else lo + j
    return laws.function(laws.law[c], xi, xi_dot, a.top[j + 1] if a.top[j + 1] > xi else xi, laws.pair[c])


def coefficients(laws: SceneLaws) -> tuple[Any, Any, bool, Any] | None:
    """Return k and γ of all pairs, whether √ξ is a factor, and the kernel for them.

    The result is None unless all laws have one such form.
    """
    for p, d, force in ((1.0, 0.0, power), (1.5, 0.5, power), (1.5, 0.25, tsuji)):
        if all(law.form and law.form[1] == p and (law.form[3] == d or not law.form[2]) for law in laws.each):
            k, _, gamma, _ = laws.column(lambda law: law.form).T
            return k, gamma, p == 1.5, force
    return None


class NotCompilableError(TypeError):
    """A law cannot be compiled, for the reason in the message."""


def records(laws: SceneLaws, pairs: Pairs) -> Called:
    """Return the compiled force with records of laws and pairs, for `called`.

    Raises
    ------
    NotCompilableError
        With the compiler's reason, or if a law is not a dataclass of at most `MAX_LAW_FIELDS` numbers.
    """
    kinds = tuple(dict.fromkeys((type(one.law), one.memory) for one in laws.each))
    law, pair = np.zeros(len(laws.each), LAW_RECORD), np.zeros(len(pairs), PAIR_RECORD)
    for record, one in zip(law, laws.each, strict=True):
        name = type(one.law).__name__
        try:
            values = [float(getattr(one.law, f.name)) for f in fields(one.law)]
        except (TypeError, ValueError) as error:
            raise NotCompilableError(f"{name} is not a dataclass of numbers ({error})") from None
        if len(values) > MAX_LAW_FIELDS:
            raise NotCompilableError(f"{name} has {len(values)} fields, more than {MAX_LAW_FIELDS}")
        record["kind"] = kinds.index((type(one.law), one.memory))
        record["field"][: len(values)] = values
    pair["m_eff"], pair["r_eff"], pair["index"] = pairs.m_eff, pairs.r_eff, np.arange(len(pairs))
    return Called(_compiled(kinds), law[laws.kind], pair)


@cache
def _compiled(kinds: tuple[tuple[type, bool], ...]) -> Any:
    """Compile the force of laws of some classes, with or without memory.

    The compiled function has the same type for all laws.
    """
    numba = load_numba()
    real, law, pair = numba.types.float64, numba.from_dtype(LAW_RECORD), numba.from_dtype(PAIR_RECORD)
    signature = real(law, real, real, real, pair)
    try:
        force = numba.njit(signature)(_or_inf(_one_of(kinds)))
    except numba.core.errors.NumbaError as error:
        raise NotCompilableError(f"{kinds[0][0].__name__}.force does not compile: "
                                 f"{str(error).strip().splitlines()[-1]}") from error
    # a first-class function: its type depends on the signature only, not on the law
    return numba.types.function_type.CompileResultWAP(force.get_compile_result(signature))


def _or_inf(force: Any) -> Any:
    """Return the force function with exceptions converted to inf, which ends the run.

    No exception can pass through a C function. `reevaluate_laws` raises it later.
    """

    def call(law: Any, xi: float, xi_dot: float, xi_max: float, pair: Any) -> Any:
        try:
            return force(law, xi, xi_dot, xi_max, pair)
        except Exception:
            if law.failed[0] == 0.0:
                law.failed[0], law.failed[1], law.failed[2] = xi, xi_dot, xi_max
            return math.inf

    return call


def reevaluate_laws(laws: SceneLaws, compiled: Called) -> None:
    """Call laws again, interpreted, where their compiled force failed.

    They then raise their own errors.
    """
    failed = compiled.law["failed"]
    for c in np.flatnonzero(failed[:, 0]).tolist():
        with suppress(OverflowError):  # inf in interpreted runs, too
            laws[c].force(*failed[c].tolist())


def _one_of(kinds: tuple[tuple[Any, bool], ...], number: int = 0) -> Any:
    """Return a function that selects the law's method by the kind of its record.

    The method of each class is called with a tuple of its fields as `self`.
    """
    import numba
    from numba.np.unsafe.ndarray import to_fixed_tuple

    kind, memory = kinds[number]
    names = [f.name for f in fields(kind)]
    fielded, count, force, last = namedtuple("fielded", names), len(names), numba.njit(kind.force), 1 if memory else 0
    others = _one_of(kinds, number + 1) if number + 1 < len(kinds) else None

    def call(law: Any, xi: float, xi_dot: float, xi_max: float, pair: Any) -> Any:
        if others is None or law.kind == number:
            return force(fielded(*to_fixed_tuple(law.field, count)), xi, xi_dot, pair, *(xi_max,)[:last])
        return others(law, xi, xi_dot, xi_max, pair)

    return numba.njit(call)

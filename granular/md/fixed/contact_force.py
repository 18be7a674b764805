"""Contact force of a pair in the kernels with a fixed step.

All kernels share the signature ``force(physics, lo, j, xi, xi_dot, a)``. `a` is a window that begins at pair `lo` (see
`window`), and lo + j is the pair. The overlap is `xi` in m, and its rate `xi_dot` in m/s. The kernels return the force
in N before it is clipped at 0, and 0 if the overlap is not positive.

Laws of the form k ξ + γ ξ̇ or √ξ (k ξ + γ ξ̇) are part of the main loop (`march`), and so is Tsuji's law. All other
laws are called as Python objects in interpreted runs (`object_force`), and as one C function in compiled runs
(`compiled_force`). This function is the method `force` of the law, compiled with a record of its fields instead of
`self`. The source is the same, so results are bitwise identical. The function has the same type for all laws. The main
loop is therefore compiled once and cached, and for a new law only its own method is compiled.
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

CompiledForce = namedtuple("CompiledForce", "function law pair")
"""Compiled force function of all laws, with the records that it reads.

If a law raises an exception, the field `failed` of its record contains the first ξ, ξ̇ and ξ_max for which it did."""


@kernel
def power(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return the force k ξ + γ ξ̇ in N, multiplied by √ξ if `physics.root` is true."""
    x = xi if xi > 0.0 else 0.0
    f = a.k[j + 1] * x + a.gamma[j + 1] * xi_dot if HAS_DAMPING else a.k[j + 1] * x
    if physics.root:
        f = math.sqrt(x) * f
    return f if xi > 0.0 else 0.0


@kernel
def tsuji(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return the force k ξ √ξ + γ ξ^(1/4) ξ̇ in N, rounded like `granular.TsujiHertz`."""
    x = xi if xi > 0.0 else 0.0
    root = math.sqrt(x)
    f = a.k[j + 1] * x * root + a.gamma[j + 1] * math.sqrt(root) * xi_dot
    return f if xi > 0.0 else 0.0


@kernel
def object_force(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return the force in N from the method `force` of a law object.

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
def compiled_force(physics: Any, lo: int, j: int, xi: float, xi_dot: float, a: Any) -> Any:
    """Return the force in N from the compiled function of all laws.

    See `CompiledForce`.
    """
    if not xi > 0.0 or (HEATED and a.k[j + 1] == 0.0):
        return 0.0
    laws, c = physics.laws, (lo + j) % physics.ring if RING else lo + j
    return laws.function(laws.law[c], xi, xi_dot, a.top[j + 1] if a.top[j + 1] > xi else xi, laws.pair[c])


def coefficients(laws: SceneLaws) -> tuple[Any, Any, bool, Any] | None:
    """Return k and γ of all pairs, whether √ξ is a factor, and the force kernel.

    The kernel is `power` or `tsuji`. The result is None if the laws do not all have the form of the same kernel.
    """
    for p, d, force in ((1.0, 0.0, power), (1.5, 0.5, power), (1.5, 0.25, tsuji)):
        if all(law.form and law.form[1] == p and (law.form[3] == d or not law.form[2]) for law in laws.each):
            k, _, gamma, _ = laws.column(lambda law: law.form).T
            return k, gamma, p == 1.5, force
    return None


class NotCompilableError(TypeError):
    """Exception for a force law that cannot be compiled. The message is the reason."""


def records(laws: SceneLaws, pairs: Pairs) -> CompiledForce:
    """Return the compiled force function and the records of all laws and pairs.

    The kernel `compiled_force` reads the result.

    Raises
    ------
    NotCompilableError
        If the compiler rejects a law, or if a law is not a dataclass of at most `MAX_LAW_FIELDS` numbers.
    """
    kinds = tuple(dict.fromkeys((type(pair_law.law), pair_law.memory) for pair_law in laws.each))
    law, pair = np.zeros(len(laws.each), LAW_RECORD), np.zeros(len(pairs), PAIR_RECORD)
    for record, pair_law in zip(law, laws.each, strict=True):
        name = type(pair_law.law).__name__
        try:
            values = [float(getattr(pair_law.law, f.name)) for f in fields(pair_law.law)]
        except (TypeError, ValueError) as error:
            raise NotCompilableError(f"{name} is not a dataclass whose fields are all numbers ({error})") from None
        if len(values) > MAX_LAW_FIELDS:
            raise NotCompilableError(f"{name} has {len(values)} fields, more than {MAX_LAW_FIELDS}")
        record["kind"] = kinds.index((type(pair_law.law), pair_law.memory))
        record["field"][: len(values)] = values
    pair["m_eff"], pair["r_eff"], pair["index"] = pairs.m_eff, pairs.r_eff, np.arange(len(pairs))
    return CompiledForce(_compiled_force(kinds), law[laws.kind], pair)


@cache
def _compiled_force(kinds: tuple[tuple[type, bool], ...]) -> Any:
    """Compile one force function for laws of several classes.

    `kinds` contains each class, and whether it has memory. The compiled function has the same type for all laws.
    """
    numba = load_numba()
    real, law, pair = numba.types.float64, numba.from_dtype(LAW_RECORD), numba.from_dtype(PAIR_RECORD)
    signature = real(law, real, real, real, pair)
    try:
        force = numba.njit(signature)(_inf_on_exception(_select_by_kind(kinds)))
    except numba.core.errors.NumbaError as error:
        raise NotCompilableError(f"{kinds[0][0].__name__}.force does not compile: "
                                 f"{str(error).strip().splitlines()[-1]}") from error
    # a first-class function: its type depends on the signature only, not on the law
    return numba.types.function_type.CompileResultWAP(force.get_compile_result(signature))


def _inf_on_exception(force: Any) -> Any:
    """Return a force function that returns inf where `force` raises an exception.

    An exception cannot pass through a C function. An infinite force ends the run, and `reevaluate_laws` then raises the
    exception.
    """

    def call(law: Any, xi: float, xi_dot: float, xi_max: float, pair: Any) -> Any:
        """Return the force in N, or inf after an exception (see `law.failed`)."""
        try:
            return force(law, xi, xi_dot, xi_max, pair)
        except Exception:
            if law.failed[0] == 0.0:
                law.failed[0], law.failed[1], law.failed[2] = xi, xi_dot, xi_max
            return math.inf

    return call


def reevaluate_laws(laws: SceneLaws, compiled: CompiledForce) -> None:
    """Call the laws again as Python objects where their compiled force failed.

    The laws then raise their own exceptions.
    """
    failed = compiled.law["failed"]
    for c in np.flatnonzero(failed[:, 0]).tolist():
        with suppress(OverflowError):  # inf in interpreted runs, too
            laws[c].force(*failed[c].tolist())


def _select_by_kind(kinds: tuple[tuple[Any, bool], ...], number: int = 0) -> Any:
    """Return a compiled function that calls the force method of the law in a record.

    `kinds` are pairs of a class of laws and whether its laws have a memory (then `force` also gets ξ_max). The field
    `kind` of the record is an index into `kinds`. Each level of the recursion compiles the method of one class, entry
    `number` of `kinds`, and passes records of later classes on to the next level. The method is called with a tuple of
    the law's fields as `self`.
    """
    import numba
    from numba.np.unsafe.ndarray import to_fixed_tuple

    kind, memory = kinds[number]
    names = [f.name for f in fields(kind)]
    Fields, count, force, extra = namedtuple("fielded", names), len(names), numba.njit(kind.force), 1 if memory else 0
    next_kinds = _select_by_kind(kinds, number + 1) if number + 1 < len(kinds) else None

    def call(law: Any, xi: float, xi_dot: float, xi_max: float, pair: Any) -> Any:
        if next_kinds is None or law.kind == number:
            # a law with memory has `xi_max` as a further argument
            return force(Fields(*to_fixed_tuple(law.field, count)), xi, xi_dot, pair, *(xi_max,)[:extra])
        return next_kinds(law, xi, xi_dot, xi_max, pair)

    return numba.njit(call)

"""Kernels: numerical functions that run interpreted or compiled, from one source.

A kernel is a Python function of floats, lists or arrays in the subset of Python that numba compiles. Interpreted, it is
the plain function. `compiled` returns its numba version, in which every kernel that it calls is compiled as well. Only
+ - * /, `math.sqrt`, `math.pow`, `exp`, `log` and similar functions are used (no ``**``, `hypot`, `sum`, and no
fast-math). Both versions therefore give bitwise identical results.

`fitted` and `specialised` adapt a kernel to a scene. They return a copy of the kernel that reads other constants, such
as the flags below, or calls other kernels under the same names.

numba compiles by a faster pipeline (`granular._engine.numba_pipeline`), which depends on internals of numba. Versions
of numba that are not in `TESTED_NUMBA` use numba's default pipeline instead, with bitwise identical results. If the
fast pipeline fails in a tested version, the whole process switches to the default pipeline, with one warning.
"""

from __future__ import annotations

import ast
import dis
import os
import sys
import types
from collections.abc import Callable
from functools import cache, wraps
from importlib.util import find_spec
from inspect import getsourcelines
from pathlib import Path
from time import process_time
from typing import Any, TypeVar
from zlib import crc32

from granular._engine.compiler_state import (
    Mode,
    by_reference,
    cache_on_disk,
    numba_version,
    use_default_pipeline,
    with_exact_types,
    without_collection,
)
from granular._engine.package import install

F = TypeVar("F", bound=Callable[..., Any])

DRIVEN: bool = False
"""A wall is driven: its velocity is not constant."""
HEATED: bool = False
"""A wall is thermal: balls leave it with a random speed."""
WORKED: bool = False
"""A wall is driven or thermal, and exchanges energy with the balls.

The run then records an energy balance.
"""
FORCED: bool = False
"""`WORKED`, or the scene has external forces.

Balls can then have different accelerations in free flight.
"""
HUNG: bool = False
"""The balls are pendula."""
RING: bool = False
"""The balls are on a ring: the last ball and the first ball are a pair."""
METERED: bool = False
"""Whether the energy of each contact is integrated.

This costs up to a fifth of the run time of a damped chain, so it is done only on request.
"""
FLAGS = frozenset({"DRIVEN", "HEATED", "WORKED", "FORCED", "HUNG", "RING", "METERED"})
"""Names of the flags. `fitted` accepts them for every kernel."""
TESTED_NUMBA = ((0, 68),)
"""Versions of numba (major, minor) for which the fast pipeline is used.

All tests were run with them.
"""
OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
"""Options of numba for every kernel.

1/0 is inf, and the interpreter lock is released.
"""
FAST_OPTIONS: dict[str, Any] = {"_nrt": False, "no_cfunc_wrapper": True}
"""Further options of numba for kernels compiled by the fast pipeline.

References to arrays are not counted, which halves the time. No functions for calls from C are created.
"""
before_compiling: list[Callable[[], object]] = []
"""Function without arguments to call before the first compilation, if any."""


def kernel(function: F) -> F:
    """Mark a function as a kernel, so that `compiled` compiles it with its callers.

    The function itself is returned.
    """
    function.__granular_kernel__ = True  # type: ignore[attr-defined]
    return function


kernel(by_reference)  # the fast pipeline replaces it


def rare(function: F) -> F:
    """Mark a kernel that `compiled` does not inline, because it is rarely called."""
    function.__granular_rare__ = True  # type: ignore[attr-defined]
    return function


def specialised(function: F, **replacements: Any) -> F:
    """Return a copy of a kernel that uses other values for some global names.

    Names are also replaced in all kernels that the kernel calls. For example, the copy
    ``specialised(march, step=verlet, force=spring)`` calls these two kernels wherever `march` calls `step` and `force`.
    Constants are replaced in the same way. Copies are kernels, too: they run interpreted, and `compiled` keeps separate
    machine code for each of them, also on disk. Equal replacements return the same copy.

    Parameters
    ----------
    function : kernel
        Kernel to copy.
    **replacements : kernel, or number, string or tuple of them
        Replacement for each global name. A kernel as a replacement can read other replaced names, but not its own.

    Raises
    ------
    TypeError
        If neither the kernel nor any kernel that it calls reads a global of that name.
    """
    for name, value in replacements.items():
        if fitted(function, **{name: value}) is function:
            raise TypeError(f"{function.__name__} cannot be specialised for {name}: none of its kernels reads that "
                            "name.")
    return fitted(function, **replacements)


def fitted(function: F, **replacements: Any) -> F:
    """Return the copy of `specialised`, or the kernel itself if nothing changes.

    Nothing changes if neither the kernel nor any kernel that it calls reads one of the names.

    Raises
    ------
    TypeError
        If a name is neither a flag nor read by the kernel, by a kernel that it calls or by a replacement.
    """
    if not replacements:
        return function
    kernels = [function, *filter(_is_kernel, replacements.values())]
    read = frozenset().union(*map(_all_globals_read, kernels))
    if unknown := replacements.keys() - read - FLAGS:
        raise TypeError(f"{function.__name__} cannot be specialised for {min(unknown)}: none of its kernels reads "
                        "that name.")
    used = sorted((name, value) for name, value in replacements.items() if name in read)
    copy: F = _specialised_copy(function, tuple((name, value, repr(value)) for name, value in used))
    return copy


@cache
def _specialised_copy(function: Any, replacements: tuple[tuple[str, Any, str], ...]) -> Any:
    """Return the copy for sorted triples of name, replacement and its `repr`.

    The `repr` is part of the cache key, because 1 and 1.0 are equal but give different code. The kernel itself is
    returned if nothing changes.
    """
    scope, read = function.__globals__, _globals_read(function.__code__)
    replaced = {name: value for name, value, _ in replacements if name in read}
    called = {name: callee for name, callee in (_callees(function) | replaced).items() if _is_kernel(callee)}
    copies = replaced | {name: _specialised_copy(callee, replacements) for name, callee in called.items()}
    if not replaced and all(copy is scope[name] for name, copy in copies.items()):
        return function
    copy = types.FunctionType(
        function.__code__, scope | copies, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__module__, copy.__doc__ = function.__module__, function.__doc__
    copy.__dict__.update(function.__dict__)
    return copy


def have_numba() -> bool:
    """Return whether numba (the extra ``fast``) is installed and enabled.

    The function does not load numba.
    """
    return not missing_compiler_reason()


def missing_compiler_reason() -> str:
    """Return the reason why kernels cannot be compiled, or an empty string."""
    if sys.modules.get("numba", True) is None or not _is_installed("numba"):
        return f"numba is not installed; run {install('fast')}"
    if "numba" in sys.modules:
        import numba  # waits if another thread is loading it

        disabled = bool(numba.config.DISABLE_JIT)
    else:
        disabled = os.environ.get("NUMBA_DISABLE_JIT", "0").strip() not in ("", "0")
    return "NUMBA_DISABLE_JIT is set, so numba compiles nothing; unset it" if disabled else ""


@cache
def _is_installed(module: str) -> bool:
    return find_spec(module) is not None


def load_numba() -> Any:
    """Load and return numba. The first call also chooses the compiler pipeline.

    `ImportError` with the reason is raised if numba is not installed or disabled.
    """
    if reason := missing_compiler_reason():
        raise ImportError(f"`engine` cannot be 'compiled': {reason}.")
    import numba

    if Mode.fast is None:
        Mode.fast = numba_version() in TESTED_NUMBA
        if Mode.fast:
            try:
                import granular._engine.numba_pipeline  # noqa: F401
            except Exception as error:
                use_default_pipeline(error)
    return numba


@cache
def version() -> int:
    """Return a checksum of the source of the fast pipeline.

    Names of cached machine code contain it.
    """
    text = __spec__.loader.get_data(str(Path(__file__).with_name("numba_pipeline.py")))  # type: ignore[union-attr]
    return crc32(text) or 1  # 0 would mean "unknown"


@cache
def dispatcher(function: Callable[..., Any], inline: bool, is_callee: bool = False) -> Any:
    """Return the numba dispatcher of a kernel, which compiles it when called.

    Parameters
    ----------
    function : kernel
        Kernel to compile.
    inline : bool
        Whether the kernels that it calls are inlined, except for those marked `rare`.
    is_callee : bool
        Whether only other kernels call it. The fast pipeline then compiles it as a `Part`. Defaults to False.
    """
    numba, code = load_numba(), without_dead_branches(function)
    fast = bool(Mode.fast)
    # the fast pipeline overloads `by_reference` itself
    called = {name: dispatcher(callee, inline, True)
              for name, callee in _callees(function).items()
              if name in _globals_read(code) and not (fast and callee is by_reference)}
    scope = function.__globals__ | called
    copy = types.FunctionType(code, scope, function.__name__, function.__defaults__, function.__closure__)
    copy.__module__ = function.__module__
    options = dict(OPTIONS)
    if fast:
        from granular._engine.numba_pipeline import PartCompiler, WholeCompiler

        options |= FAST_OPTIONS | {"pipeline_class": PartCompiler if is_callee else WholeCompiler}
        options |= {"no_cpython_wrapper": True} if is_callee else {}
        options |= {"forceinline": inline and is_callee and not getattr(function, "__granular_rare__", False)}
    # the name identifies the cached machine code, see `cache_key`
    copy.__qualname__ = f"{function.__qualname__}_{cache_key(function, fast):08x}{'i' * inline}{'p' * is_callee}"
    result = numba.njit(**options)(copy)
    result.compile = without_collection(result.compile)
    if not fast:
        result.get_call_template = with_exact_types(result)
    if is_callee:
        return result
    cache_on_disk(result)
    if fast:
        result._compile_for_args = _with_fallback(result._compile_for_args, function, inline)
    return result


def cache_key(function: Callable[..., Any], fast: bool) -> int:
    """Return the number that identifies the machine code of a kernel by its name.

    It depends on the code of the kernel, on the options of numba and on the pipeline. `fast` is true for the fast
    pipeline.
    """
    return crc32(repr((checksum(function), OPTIONS, FAST_OPTIONS, version(), fast)).encode())


def _with_fallback(compile_for: Callable[..., Any], function: Callable[..., Any], inline: bool) -> Callable[..., Any]:
    """Return a compile function with the default pipeline as a fallback.

    numba calls it if the dispatcher of `function` has no machine code for the types of its arguments. numba then calls
    its return value. `compile_for` is numba's own compile function.
    """

    @wraps(compile_for)
    def compiled(*values: Any, **keywords: Any) -> Any:
        if Mode.fast:
            try:
                return compile_for(*values, **keywords)
            except Exception as error:
                use_default_pipeline(error)
        return dispatcher(function, inline)

    return compiled


def without_dead_branches(function: Callable[..., Any]) -> types.CodeType:
    """Return the code of a kernel with global booleans replaced by their values.

    Python then removes branches that are never executed, so numba does not compile them. The code is returned unchanged
    if its source is missing or was edited after it was loaded.
    """
    code, scope = function.__code__, function.__globals__
    values = {name: ast.Constant(scope[name]) for name in _globals_read(code) if isinstance(scope.get(name), bool)}

    class Inserter(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.expr:
            return ast.copy_location(values[node.id], node) if node.id in values else node

    if not values:
        return code
    try:
        lines, first = getsourcelines(code)
        tree = ast.increment_lineno(ast.parse("".join(lines)), first - 1)
        read = _compiled_code(tree, code)
        as_loaded = read.co_code == code.co_code and read.co_names == code.co_names
        return _compiled_code(Inserter().visit(tree), code) if (
            as_loaded and read.co_consts[1:] == code.co_consts[1:]) else code
    except (OSError, SyntaxError, StopIteration):
        return code


def _compiled_code(tree: ast.Module, code: types.CodeType) -> types.CodeType:
    """Compile a syntax tree, and return its code object with the name of `code`."""
    constants = compile(tree, code.co_filename, "exec", dont_inherit=True).co_consts
    return next(each for each in constants if isinstance(each, types.CodeType) and each.co_name == code.co_name)


def is_in_memory(function: Callable[..., Any], inline: bool = False) -> bool:
    """Return whether machine code of a kernel is loaded in this process."""
    if "numba" not in sys.modules or not have_numba():
        return False
    return bool(dispatcher(function, inline).overloads)


@cache
def is_on_disk(function: Callable[..., Any], inline: bool = False) -> bool:
    """Return whether machine code of a kernel is in numba's cache on disk.

    Loading it takes up to 1 s, compiling up to 12 s. The function loads numba. The result is cached: code that another
    process adds later is ignored.
    """
    if not have_numba():
        return False
    try:
        return bool(dispatcher(function, inline)._cache._cache_file._load_index())
    except (AttributeError, OSError):  # another version of numba, or no writable folder for the cache
        return False


def is_worthwhile(function: Callable[..., Any], work: float, warm: float, cold: float, inline: bool = False) -> bool:
    """Return whether `work` is large enough to load or compile a kernel for it.

    Parameters
    ----------
    work : float
        Remaining work, or the work done so far if the remaining work is unknown, in any unit.
    warm, cold : float
        Work in the same unit that takes as long as loading the code from disk (warm), and as compiling it (cold).
    """
    if work < warm or not have_numba():
        return False
    return work >= cold or is_in_memory(function, inline) or is_on_disk(function, inline)


class CompilationCost:
    """Interpreted time of a kernel in this process, to decide when to compile it.

    The length of a run is unknown in advance. Therefore a kernel is loaded or compiled once its interpreted time equals
    the time that loading or compiling takes. The total time is then at most about twice the shortest possible time.

    Parameters
    ----------
    function : kernel
        The kernel.
    warm, cold : float
        Time in s to load its machine code from disk, and to compile it.
    """

    spent: dict[Any, float] = {}  # noqa: RUF012  shared by all runs of a process

    def __init__(self, function: Callable[..., Any], warm: float, cold: float) -> None:
        self.function, self.warm, self.cold, self.since = function, warm, cold, process_time()

    def lap(self) -> float:
        """Add the processor time since the last call, and return the total in s."""
        now = process_time()
        total = self.spent[self.function] = self.spent.get(self.function, 0.0) + now - self.since
        self.since = now
        return total

    def due(self, ahead: float = 0.0) -> bool:
        """Return whether the run should continue with machine code.

        `ahead` is a lower bound of the remaining interpreted time in s. Defaults to 0.
        """
        return is_in_memory(self.function) or is_worthwhile(self.function, self.lap() + ahead, self.warm, self.cold)


def interpreted(function: F) -> F:
    """Return the kernel itself. It replaces `compiled` in interpreted runs."""
    return function


@cache
def compiled(function: Callable[..., Any], inline: bool = False) -> Callable[..., Any]:
    """Return the compiled version of a kernel and of all kernels that it calls.

    numba caches the machine code on disk next to the source. Its name changes with the code of the kernel, of all
    kernels that it calls, and of the compiler pipeline. A kernel cannot create arrays.

    Parameters
    ----------
    inline : bool
        Inline the kernels that it calls, except for those marked `rare`. This is faster for many short kernels, but
        takes longer to compile.

    Raises
    ------
    ImportError
        If numba is not installed, or disabled.
    """
    if before_compiling and not is_on_disk(function, inline):
        before_compiling.pop()()
    return dispatcher(function, inline)  # type: ignore[no-any-return]


Mode.on_switch += [dispatcher.cache_clear, is_on_disk.cache_clear, compiled.cache_clear]


def _callees(function: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    """Return the kernels that a kernel calls, by their global names."""
    scope = function.__globals__
    return {name: scope[name] for name in _globals_read(function.__code__) if _is_kernel(scope.get(name))}


def _is_kernel(value: Any) -> bool:
    return bool(getattr(value, "__granular_kernel__", False))


@cache
def _globals_read(code: types.CodeType) -> tuple[str, ...]:
    """Return the distinct global names that a code object reads, which takes 0.5 ms."""
    return tuple(dict.fromkeys(i.argval for i in dis.get_instructions(code) if i.opname == "LOAD_GLOBAL"))


@cache
def _all_globals_read(function: Callable[..., Any]) -> frozenset[str]:
    """Return all global names that a kernel and the kernels below it read."""
    return frozenset(_globals_read(function.__code__)).union(*map(_all_globals_read, _callees(function).values()))


@cache
def checksum(function: Callable[..., Any]) -> int:
    """Return a checksum of a kernel, of its constants and of the kernels it calls."""
    code, scope = function.__code__, function.__globals__
    constants = [x for x in code.co_consts if x != function.__doc__ and not isinstance(x, types.CodeType)]
    values = [scope.get(name) for name in _globals_read(code)]
    read = [value for value in values if isinstance(value, (int, float, str, tuple))]
    below = [checksum(callee) for callee in _callees(function).values()]
    return crc32(repr((constants, code.co_names, read, below)).encode(), crc32(code.co_code))

"""Kernels: numerical functions that run interpreted or compiled, from one source.

A kernel is a Python function of floats, lists or arrays in the subset of Python that numba compiles. Interpreted, it is
the plain function. `compiled` returns its numba version, in which every kernel that it calls is compiled as well. Only
+ - * /, `math.sqrt`, `math.pow`, `exp`, `log` and the like are used (no ``**``, `hypot`, `sum`, and no fast-math).
Both versions therefore give bitwise identical results.

`fitted` and `specialised` adapt a kernel to a scene: the same source with other constants, such as the flags below, or
with other kernels called by the same names.

numba compiles by a faster pipeline (`granular._engine.numba_pipeline`), which depends on internals of numba. Versions
of numba that are not in `TESTED_NUMBA` use numba's default pipeline instead, with bitwise identical results. If the
fast pipeline fails in a tested version, the whole process switches to the default pipeline, with one warning.
"""

from __future__ import annotations

import ast
import dis
import gc
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

from granular._engine.compiler_state import Mode, by_reference, cache_on_disk, numba_version, use_default_pipeline
from granular._engine.package import install

F = TypeVar("F", bound=Callable[..., Any])

DRIVEN: bool = False
"""A wall moves."""
HEATED: bool = False
"""A wall is thermal: balls leave it with a random speed drawn at its temperature."""
WORKED: bool = False
"""A wall exchanges energy with the balls, because it moves or is thermal.

The run then records an energy balance.
"""
FORCED: bool = False
"""`WORKED`, or constant forces: accelerations of the balls differ."""
HUNG: bool = False
"""The balls are pendula."""
RING: bool = False
"""The balls are on a ring: the last one touches the first one."""
FLAGS = frozenset({"DRIVEN", "HEATED", "WORKED", "FORCED", "HUNG", "RING"})
"""Names of the flags. `fitted` accepts them for every kernel."""
TESTED_NUMBA = ((0, 68),)
"""Versions of numba (major, minor) that use the fast pipeline.

All tests were run with them.
"""
OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
"""numba's options of every kernel: 1/0 is inf, and the interpreter lock is free."""
FAST_OPTIONS: dict[str, Any] = {"_nrt": False, "no_cfunc_wrapper": True}
"""Further options of the fast pipeline.

Arrays are not reference-counted, which halves the time, and there is no entry for C.
"""
on_making: list[Callable[[], object]] = []
"""Function to call before the first compilation. At most one entry."""


def kernel(function: F) -> F:
    """Mark a function as a kernel, which `compiled` compiles with its callers.

    The function itself is unchanged.
    """
    function.__granular_kernel__ = True  # type: ignore[attr-defined]
    return function


kernel(by_reference)  # the fast pipeline replaces it


def rare(function: F) -> F:
    """Mark a kernel that is called too rarely to be inlined."""
    function.__granular_rare__ = True  # type: ignore[attr-defined]
    return function


def specialised(function: F, **instead: Any) -> F:
    """Return a copy of a kernel in which globals of the given names are replaced.

    The replacement also holds in all kernels that it calls. ``specialised(march, step=verlet, force=spring)`` is the
    source of `march` with these two kernels called as `step` and `force`. Constants are replaced in the same way.
    Copies are kernels, too: they run interpreted, and `compiled` keeps separate machine code for each of them, also on
    disk. Equal replacements return the same copy.

    Parameters
    ----------
    function : kernel
        Kernel to copy.
    **instead : kernel, or number, string or tuple of them
        Replacement for each global name. A kernel as a replacement may read other replaced names, but not its own.

    Raises
    ------
    TypeError
        If neither the kernel nor any kernel that it calls reads a global of that name.
    """
    for name, value in instead.items():
        if fitted(function, **{name: value}) is function:
            raise TypeError(f"{function.__name__} cannot be specialised for {name}: none of its kernels reads that "
                            "name.")
    return fitted(function, **instead)


def fitted(function: F, **instead: Any) -> F:
    """Return the copy that `specialised` makes, or the kernel if nothing changes.

    The kernel itself is returned if it does not read any of the names.

    Raises
    ------
    TypeError
        If a name is neither a flag nor read by the kernel, by a kernel that it calls or by a replacement.
    """
    if not instead:
        return function
    read = _read_below(function).union(*(_read_below(value) for value in instead.values() if _is_kernel(value)))
    if unknown := instead.keys() - read - FLAGS:
        raise TypeError(f"{function.__name__} cannot be specialised for {min(unknown)}: none of its kernels reads "
                        "that name.")
    known = sorted((name, value) for name, value in instead.items() if name in read)
    copy: F = _specialised_copy(function, tuple((name, value, repr(value)) for name, value in known))
    return copy


@cache
def _specialised_copy(function: Any, instead: tuple[tuple[str, Any, str], ...]) -> Any:
    """Return the copy for sorted triples of name, replacement and its `repr`.

    The `repr` is part of the cache key, because 1 and 1.0 are equal but give different code.
    """
    scope, read = function.__globals__, _globals_read(function.__code__)
    own = {name: value for name, value, _ in instead if name in read}
    called = {name: callee for name, callee in (_callees(function) | own).items() if _is_kernel(callee)}
    copies = own | {name: _specialised_copy(callee, instead) for name, callee in called.items()}
    if not own and all(copy is scope[name] for name, copy in copies.items()):
        return function
    copy = types.FunctionType(
        function.__code__, scope | copies, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__module__, copy.__doc__ = function.__module__, function.__doc__
    copy.__dict__.update(function.__dict__)
    return copy


def have_numba() -> bool:
    """Return whether numba (the extra ``fast``) is installed and enabled.

    numba is not loaded.
    """
    return not no_compiler()


def no_compiler() -> str:
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
    """Return the module numba, and choose the pipeline.

    Raises `ImportError` with the reason if numba is unusable.
    """
    if why := no_compiler():
        raise ImportError(f"`engine` cannot be 'compiled': {why}.")
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
    """Return a number that changes with the source of the fast pipeline.

    It is part of the names of cached machine code.
    """
    text = __spec__.loader.get_data(str(Path(__file__).with_name("numba_pipeline.py")))  # type: ignore[union-attr]
    return crc32(text) or 1  # 0 would read like "unknown"


@cache
def dispatcher(function: Callable[..., Any], inline: bool, within: bool = False) -> Any:
    """Return the numba dispatcher of a kernel.

    `within` another kernel it is a `Part` in the fast pipeline.
    """
    numba, code = load_numba(), without_dead_branches(function)
    fast = bool(Mode.fast)
    called = {name: dispatcher(callee, inline, True)
              for name, callee in _callees(function).items()
              if name in _globals_read(code) and not (fast and callee is by_reference)}
    scope = function.__globals__ | called
    copy = types.FunctionType(code, scope, function.__name__, function.__defaults__, function.__closure__)
    copy.__module__ = function.__module__
    options = dict(OPTIONS)
    if fast:
        from granular._engine.numba_pipeline import PartCompiler, WholeCompiler

        options |= FAST_OPTIONS | {"pipeline_class": PartCompiler if within else WholeCompiler}
        options |= {"no_cpython_wrapper": True} if within else {}
        options |= {"forceinline": inline and within and not getattr(function, "__granular_rare__", False)}
    copy.__qualname__ = f"{function.__qualname__}_{cache_key(function, fast):08x}{'i' * inline}{'p' * within}"
    result = numba.njit(**options)(copy)
    result.compile = _without_collection(result.compile)
    if within:
        return result
    cache_on_disk(result)
    if fast:
        result._compile_for_args = _or_by_default(result._compile_for_args, function, inline)
    return result


def cache_key(function: Callable[..., Any], fast: bool) -> int:
    """Return the number in the name of a kernel's machine code.

    It differs for the fast pipeline and the default one.
    """
    return crc32(repr((checksum(function), OPTIONS, FAST_OPTIONS, version(), fast)).encode())


def _or_by_default(compile_for: Callable[..., Any], function: Callable[..., Any], inline: bool) -> Callable[..., Any]:
    """Return a function that compiles by the default pipeline if the fast one fails.

    numba calls it if a dispatcher has no machine code for the types of its arguments, and then calls its return value.
    """

    @wraps(compile_for)
    def compiled(*values: Any, **named: Any) -> Any:
        if Mode.fast:
            try:
                return compile_for(*values, **named)
            except Exception as error:
                use_default_pipeline(error)
        return dispatcher(function, inline)

    return compiled


def _without_collection(make: Any) -> Any:
    """Return `make` with the garbage collector disabled while it runs.

    Compilation creates millions of objects that stay alive. Traversing them repeatedly takes up to a tenth of the time.
    """

    @wraps(make)
    def made(signature: Any) -> Any:
        enabled = gc.isenabled()
        gc.disable()
        try:
            return make(signature)
        finally:
            if enabled:
                gc.enable()

    return made


def without_dead_branches(function: Callable[..., Any]) -> types.CodeType:
    """Return the code of a kernel with the truth values that it reads as constants.

    Python then drops branches that are never executed, before numba inlines and types them. The code is returned
    unchanged if its source is missing or was edited after it was loaded.
    """
    code, scope = function.__code__, function.__globals__
    known = {name: ast.Constant(scope[name]) for name in _globals_read(code) if isinstance(scope.get(name), bool)}

    class Known(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.expr:
            return ast.copy_location(known[node.id], node) if node.id in known else node

    if not known:
        return code
    try:
        lines, first = getsourcelines(code)
        tree = ast.increment_lineno(ast.parse("".join(lines)), first - 1)
        read = _code_in(tree, code)
        as_loaded = read.co_code == code.co_code and read.co_names == code.co_names
        return _code_in(Known().visit(tree), code) if as_loaded and read.co_consts[1:] == code.co_consts[1:] else code
    except (OSError, SyntaxError, StopIteration):
        return code


def _code_in(tree: ast.Module, code: types.CodeType) -> types.CodeType:
    """Return the code object in a syntax tree that has the name of `code`."""
    made = compile(tree, code.co_filename, "exec", dont_inherit=True).co_consts
    return next(one for one in made if isinstance(one, types.CodeType) and one.co_name == code.co_name)


def in_memory(function: Callable[..., Any], inline: bool = False) -> bool:
    """Return whether machine code of a kernel is loaded."""
    if "numba" not in sys.modules or not have_numba():
        return False
    return bool(dispatcher(function, inline).overloads)


@cache
def on_disk(function: Callable[..., Any], inline: bool = False) -> bool:
    """Return whether machine code of a kernel is in numba's cache on disk.

    Loading it takes up to one second, compiling up to 12 s. Loads numba. Code that another process adds to the cache
    later is ignored.
    """
    if not have_numba():
        return False
    try:
        return bool(dispatcher(function, inline)._cache._cache_file._load_index())
    except (AttributeError, OSError):  # another version of numba, or no writable folder for the cache
        return False


def worth(function: Callable[..., Any], work: float, warm: float, cold: float, inline: bool = False) -> bool:
    """Return whether `work` justifies loading or compiling a kernel.

    Parameters
    ----------
    work : float
        Remaining work, or the work done so far if the remaining work is unknown, in any unit.
    warm, cold : float
        Work in the same unit that takes as long as loading the code from disk, and as compiling it.
    """
    if work < warm or not have_numba():
        return False
    return work >= cold or in_memory(function, inline) or on_disk(function, inline)


class Toll:
    """Interpreted time of a kernel in this process, which decides when to compile it.

    The length of a run is unknown in advance. Compilation starts once the time spent interpreted equals the time that
    loading or compiling takes. The total is then at most about twice the time of the best choice.

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
        """Add the time since the last call, and return the total in s."""
        now = process_time()
        total = self.spent[self.function] = self.spent.get(self.function, 0.0) + now - self.since
        self.since = now
        return total

    def due(self, ahead: float = 0.0) -> bool:
        """Return whether to continue with machine code.

        `ahead` is a lower bound of the remaining time in s.
        """
        return in_memory(self.function) or worth(self.function, self.lap() + ahead, self.warm, self.cold)


def interpreted(function: F) -> F:
    """Return the kernel itself. Counterpart of `compiled` for interpreted runs."""
    return function


@cache
def compiled(function: Callable[..., Any], inline: bool = False) -> Callable[..., Any]:
    """Return the compiled version of a kernel and of all kernels that it calls.

    numba caches the machine code on disk beside the source, under a name that changes with the code of the kernel, of
    all kernels that it calls, and of the compiler pipeline. A kernel cannot create arrays.

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
    if on_making and not on_disk(function, inline):
        on_making.pop()()
    return dispatcher(function, inline)  # type: ignore[no-any-return]


Mode.on_switch += [dispatcher.cache_clear, on_disk.cache_clear, compiled.cache_clear]


def _callees(function: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    """Return the kernels that `function` calls, by their names."""
    scope = function.__globals__
    return {name: scope[name] for name in _globals_read(function.__code__) if _is_kernel(scope.get(name))}


def _is_kernel(value: Any) -> bool:
    return bool(getattr(value, "__granular_kernel__", False))


@cache
def _globals_read(code: types.CodeType) -> tuple[str, ...]:
    """Return the distinct names of the globals that a code object reads.

    This takes 0.5 ms without the cache.
    """
    return tuple(dict.fromkeys(i.argval for i in dis.get_instructions(code) if i.opname == "LOAD_GLOBAL"))


@cache
def _read_below(function: Callable[..., Any]) -> frozenset[str]:
    """Return the names of all globals that a kernel and its callees read."""
    return frozenset(_globals_read(function.__code__)).union(*map(_read_below, _callees(function).values()))


@cache
def checksum(function: Callable[..., Any]) -> int:
    """Return a checksum of a kernel, of the constants it reads, and of its callees."""
    code, scope = function.__code__, function.__globals__
    constants = [x for x in code.co_consts if x != function.__doc__ and not isinstance(x, types.CodeType)]
    values = [scope.get(name) for name in _globals_read(code)]
    read = [value for value in values if isinstance(value, (int, float, str, tuple))]
    below = [checksum(callee) for callee in _callees(function).values()]
    return crc32(repr((constants, code.co_names, read, below)).encode(), crc32(code.co_code))

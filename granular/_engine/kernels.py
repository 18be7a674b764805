"""Compile or interpret: one source for both.

A kernel is a Python function of floats, lists or arrays in the subset numba compiles. Run as it stands it is the
plain engine; `compiled` returns its numba twin, in which every kernel it calls is compiled too. Only + - * /,
`math.sqrt`, `math.pow`, `exp`, `log` and the like are used (no ``**``, `hypot`, `sum`, no fast-math), so both give
the same bits.

A kernel is made to fit what a scene has by `fitted` and `specialised`: the same source with other constants, such as
the flags of `granular._engine.kernels`, or with other kernels called by the same names.
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
from time import process_time
from typing import Any, TypeVar
from zlib import crc32

from granular._engine.held import version
from granular._engine.package import install

F = TypeVar("F", bound=Callable[..., Any])

DRIVEN: bool = False
"""A wall moves."""
HEATED: bool = False
"""A wall is thermal: balls leave it with a speed drawn at its temperature."""
WORKED: bool = False
"""A wall moves or is thermal: it does work on the balls, or heats them, and an account of energy is kept."""
FORCED: bool = False
"""As `WORKED`, or constant forces act on balls: not all of them fall alike."""
HUNG: bool = False
"""Balls are pendula."""
RING: bool = False
"""Balls stand on a ring; the last one touches the first."""
FLAGS = frozenset({"DRIVEN", "HEATED", "WORKED", "FORCED", "HUNG", "RING"})
"""The names of the flags, which any kernel may leave unread."""
on_making: list[Callable[[], object]] = []
"""Who wants to know, once, that machine code is about to be made, which takes a while."""
MANNER = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True, "nogil": True}
"""How numba compiles: 1/0 is inf, references to arrays are not counted (half of the time), and nobody calls from C."""


def kernel(function: F) -> F:
    """Mark `function` as a kernel: it runs as it is, and `compiled` knows that its callers compile it too."""
    function.__granular_kernel__ = True  # type: ignore[attr-defined]
    return function


def rare(function: F) -> F:
    """Mark a kernel as called too seldom to pay for the compilation time of inlining it."""
    function.__granular_rare__ = True  # type: ignore[attr-defined]
    return function


def specialised(function: F, **instead: Any) -> F:
    """Return a twin of a kernel in which globals, in it and in all kernels it calls, are replaced by their names.

    ``specialised(march, step=verlet, force=spring)`` is the source of `march` with these two kernels called as `step`
    and `force`; constants are replaced alike. Twins are kernels as others are: they run as they stand, `compiled` has
    one machine code for each of them, on disk too. The same replacements give the same twin.

    Parameters
    ----------
    function : kernel
        What to make a twin of.
    **instead : kernel, or number, string or tuple of them
        What stands for each global name. A kernel put in place may itself read names that are replaced, but not its
        own.

    Raises
    ------
    TypeError
        If neither the kernel nor any kernel it calls reads a global of that name.
    """
    for name, value in instead.items():
        if fitted(function, **{name: value}) is function:
            raise TypeError(f"{function.__name__} cannot be specialised for {name}: no kernel in it reads that name.")
    return fitted(function, **instead)


def fitted(function: F, **instead: Any) -> F:
    """Return a twin of a kernel as `specialised` does, or the kernel itself if it reads none of the names.

    Raises
    ------
    TypeError
        If a name is neither a flag nor read by the kernel, by a kernel that it calls or by a replacement.
    """
    if not instead:
        return function
    read = _read_below(function).union(*(_read_below(value) for value in instead.values() if _is_kernel(value)))
    if unknown := instead.keys() - read - FLAGS:
        raise TypeError(f"{function.__name__} cannot be specialised for {min(unknown)}: no kernel in it reads that "
                        "name.")
    known = sorted((name, value) for name, value in instead.items() if name in read)
    twin: F = _specialised(function, tuple((name, value, repr(value)) for name, value in known))
    return twin


@cache
def _specialised(function: Any, instead: tuple[tuple[str, Any, str], ...]) -> Any:
    """Return the twin; what is replaced comes with its `repr`, for 1 and 1.0 are the same key and not the same code."""
    scope, read = function.__globals__, _globals_read(function.__code__)
    own = {name: value for name, value, _ in instead if name in read}
    called = {name: callee for name, callee in (_callees(function) | own).items() if _is_kernel(callee)}
    twins = own | {name: _specialised(callee, instead) for name, callee in called.items()}
    if not own and all(twin is scope[name] for name, twin in twins.items()):
        return function
    twin = types.FunctionType(
        function.__code__, scope | twins, function.__name__, function.__defaults__, function.__closure__
    )
    twin.__module__, twin.__doc__ = function.__module__, function.__doc__
    twin.__dict__.update(function.__dict__)
    return twin


def have_numba() -> bool:
    """Return whether numba (the extra ``fast``) can be loaded and compiles, without loading it."""
    return not no_compiler()


def no_compiler() -> str:
    """Return why kernels cannot be compiled, or nothing."""
    if sys.modules.get("numba", True) is None or not _is_installed("numba"):
        return f"numba is not installed: {install('fast')}"
    if "numba" in sys.modules:
        import numba  # waits for another thread that is loading it

        disabled = bool(numba.config.DISABLE_JIT)
    else:
        disabled = os.environ.get("NUMBA_DISABLE_JIT", "0").strip() not in ("", "0")
    return "NUMBA_DISABLE_JIT is set, so numba compiles nothing: unset it" if disabled else ""


@cache
def _is_installed(module: str) -> bool:
    return find_spec(module) is not None


def load_numba() -> Any:
    """Return the module numba, or raise `ImportError` that says what is missing."""
    if why := no_compiler():
        raise ImportError(f"engine is 'compiled': {why}.")
    import granular._engine.numba_pipeline  # noqa: F401  imports numba, and tells it of what is held

    return sys.modules["numba"]


def in_memory(function: Callable[..., Any], inline: bool = False) -> bool:
    """Return whether machine code of a kernel is loaded already, so that going over to it costs nothing."""
    if "numba" not in sys.modules or not have_numba():
        return False
    return bool(_twin(function, inline, False).overloads)  # type: ignore[attr-defined]


@cache
def on_disk(function: Callable[..., Any], inline: bool = False) -> bool:
    """Return whether machine code of a kernel lies in numba's cache: to load it takes a second, to make it up to 12.

    Loads numba. What another process makes in the meantime is not seen.
    """
    if not have_numba():
        return False
    try:
        return bool(_twin(function, inline, False)._cache._cache_file._load_index())  # type: ignore[attr-defined]
    except (AttributeError, OSError):  # another numba, or no place to keep a cache
        return False


def worth(function: Callable[..., Any], work: float, warm: float, cold: float, inline: bool = False) -> bool:
    """Return whether `work` pays for going over to the machine code of a kernel.

    Parameters
    ----------
    work : float
        What is left to do, or what was done so far where nobody knows what is left; in any unit.
    warm, cold : float
        The work in that unit that takes as long as loading the code from the disk, and as making it.
    """
    if work < warm or not have_numba():
        return False
    return work >= cold or in_memory(function, inline) or on_disk(function, inline)


class Toll:
    """The time that this process has spent on a kernel as it stands, and whether it is time for its machine code.

    Nobody knows how long a run goes on. Who goes over once he has spent as long as the code takes to load, or to make,
    needs at most about twice as long in all as who knew beforehand.

    Parameters
    ----------
    function : kernel
        Which.
    warm, cold : float
        Seconds that its machine code takes to be loaded from the disk, and to be made.
    """

    spent: dict[Any, float] = {}  # noqa: RUF012  one account for all runs of a process

    def __init__(self, function: Callable[..., Any], warm: float, cold: float) -> None:
        self.function, self.warm, self.cold, self.since = function, warm, cold, process_time()

    def lap(self) -> float:
        """Count the time since the last call as spent on the kernel; return all seconds spent on it."""
        now = process_time()
        total = self.spent[self.function] = self.spent.get(self.function, 0.0) + now - self.since
        self.since = now
        return total

    def due(self, ahead: float = 0.0) -> bool:
        """Return whether to go over to the machine code, if `ahead` more seconds are sure to be spent."""
        return in_memory(self.function) or worth(self.function, self.lap() + ahead, self.warm, self.cold)


def interpreted(function: F) -> F:
    """Return a kernel as it stands: what `compiled` is for the other engine."""
    return function


@cache
def compiled(function: Callable[..., Any], inline: bool = False) -> Callable[..., Any]:
    """Return the compiled twin of a kernel, with the kernels it calls compiled as well.

    The machine code is cached on disk beside the source, so that a second process starts computing at once, under a
    name that changes with the code of the kernel and of all it calls. A kernel cannot make arrays.

    Parameters
    ----------
    inline : bool
        Put the kernels it calls, except for the `rare` ones, into its body: faster where they are short and many, at
        the price of a longer compilation.

    Raises
    ------
    ImportError
        If numba is not installed, or told not to compile.
    """
    if on_making and not on_disk(function, inline):
        on_making.pop()()
    return _twin(function, inline, False)


@cache
def _twin(function: Callable[..., Any], inline: bool, within: bool) -> Callable[..., Any]:
    """Return the compiled twin of a kernel; one that is `within` another is no machine code of its own."""
    code, numba = _without_dead_branches(function), load_numba()
    from granular._engine.numba_pipeline import PartCompiler, WholeCompiler, kept

    called = {name: _twin(callee, inline, True)
              for name, callee in _callees(function).items() if name in _globals_read(code)}
    scope = function.__globals__ | called
    twin = types.FunctionType(code, scope, function.__name__, function.__defaults__, function.__closure__)
    twin.__module__ = function.__module__
    twin.__qualname__ = f"{function.__qualname__}_{_checksum(function):08x}{'i' * inline}{'p' * within}"
    how = {"pipeline_class": PartCompiler, "no_cpython_wrapper": True} if within else {"pipeline_class": WholeCompiler}
    inside = inline and within and not getattr(function, "__granular_rare__", False)
    result: Any = numba.njit(**MANNER, **how, forceinline=inside)(twin)
    result = result if within else kept(result)
    result.compile = _uncollected(result.compile)
    return result  # type: ignore[no-any-return]


def _without_dead_branches(function: Callable[..., Any]) -> types.CodeType:
    """Return the code of a kernel as if the truth values that it reads stood there: Python drops what never happens,
    before numba inlines and types it. Where the source is not there, or was edited meanwhile, it stays as it is."""
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
    """Return the code of the function of the name of `code` that a piece of source defines."""
    made = compile(tree, code.co_filename, "exec", dont_inherit=True).co_consts
    return next(one for one in made if isinstance(one, types.CodeType) and one.co_name == code.co_name)


def _uncollected(make: F) -> F:
    """Have machine code made, or loaded, with the garbage collector off: numba leaves millions of objects that live on,
    and looking at all of them again and again is up to a tenth of the time."""

    @wraps(make)
    def made(signature: Any) -> Any:
        on = gc.isenabled()
        gc.disable()
        try:
            return make(signature)
        finally:
            if on:
                gc.enable()

    return made  # type: ignore[return-value]


def _callees(function: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    """Return the kernels that `function` calls, by name."""
    scope = function.__globals__
    return {name: scope[name] for name in _globals_read(function.__code__) if _is_kernel(scope.get(name))}


def _is_kernel(value: Any) -> bool:
    return bool(getattr(value, "__granular_kernel__", False))


@cache
def _globals_read(code: types.CodeType) -> tuple[str, ...]:
    """Return the names of the globals that a function's code reads, each once; to read it takes .5 ms."""
    return tuple(dict.fromkeys(i.argval for i in dis.get_instructions(code) if i.opname == "LOAD_GLOBAL"))


@cache
def _read_below(function: Callable[..., Any]) -> frozenset[str]:
    """Return the names of the globals that a kernel and all kernels it calls read."""
    return frozenset(_globals_read(function.__code__)).union(*map(_read_below, _callees(function).values()))


@cache
def _checksum(function: Callable[..., Any]) -> int:
    """Return a checksum of the code of a kernel, of the constants it reads, and of all kernels it calls."""
    code, scope = function.__code__, function.__globals__
    constants = [x for x in code.co_consts if x != function.__doc__ and not isinstance(x, types.CodeType)]
    values = [scope.get(name) for name in _globals_read(code)]
    read = [value for value in values if isinstance(value, (int, float, str, tuple))]
    below = [_checksum(callee) for callee in _callees(function).values()]
    return crc32(repr((constants, code.co_names, read, below, MANNER, version())).encode(), crc32(code.co_code))

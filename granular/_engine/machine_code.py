"""How numba puts kernels together: one piece of machine code for each kernel that Python calls.

By itself numba makes and optimises machine code of every kernel, with all that it calls in it, once for each of its
callers. Here a kernel that only kernels call is a `Part`: typed and lowered once, and part of whoever needs it.

`granular._engine.kernels` loads it together with numba.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from typing import Any

from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder

IDLE = {"AnnotateTypes", "FindLiterallyCalls", "InlineClosureLikes", "InlineInlinables", "InlineOverloads",
        "LiteralPropagationSubPipelinePass", "LiteralUnroll", "MakeFunctionToJitFunction", "NopythonRewrites",
        "RewriteDynamicRaises", "WithLifting"}
"""Passes for what no kernel has: closures, ``with``, tuples that are unrolled, expressions of whole arrays, errors."""


class Part(JITCodeLibrary):  # type: ignore[misc]
    """The code of a kernel that only kernels call: never optimised or loaded for itself."""

    def finalize(self) -> None:
        """Leave the code as it is, to be linked."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return that there is none."""
        return 0

    @property
    def codegen(self) -> Part:
        """Who is told of the environment that a kernel raises errors from: nobody, as kernels raise none."""
        return self

    def set_env(self, name: str, env: Any) -> None:
        """Forget the environment."""


class Whole(JITCodeLibrary):  # type: ignore[misc]
    """The code of a kernel that Python calls, with that of all parts below it."""

    def add_linking_library(self, library: Any) -> None:
        """Link a library and, as a part links nothing, what it needs."""
        if library not in self._linking_libraries:
            super().add_linking_library(library)
            for below in library._linking_libraries if isinstance(library, Part) else ():
                self.add_linking_library(below)


def kept(dispatcher: Any) -> Any:
    """Return a function of numba's whose machine code is kept on the disk, if numba finds a place that it can write."""
    with suppress(RuntimeError):
        dispatcher.enable_caching()
    return dispatcher


@cache
def remembering(context: Any) -> Any:
    """Return a typing context that shares all with another, but asks only once for the type of ``pairs[c]``: numba
    tries 14 templates each time, a fifth of the time it takes in all. A kernel is made once for all constants, and
    taken as it was made for just these types: numba would warn of records that begin alike."""

    class Remembering(type(context)):  # type: ignore[misc]
        def resolve_function_type(self, function: Any, args: Any, kws: Any) -> Any:
            if isinstance(function, types.Dispatcher):
                plain = tuple(map(types.unliteral, args))  # type: ignore[attr-defined]
                _, names, folded, _ = function.dispatcher.get_call_template(plain, kws)
                return function.dispatcher.overloads[tuple(folded)].signature.replace(pysig=names)
            if kws:
                return super().resolve_function_type(function, args, kws)
            if (function, args) not in known:
                known[function, args] = super().resolve_function_type(function, args, kws)
            return known[function, args]

    known: dict[Any, Any] = {}
    out = object.__new__(Remembering)
    out.__dict__ = context.__dict__
    return out


class PartCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's own passes, but for the idle ones, for a part."""

    library = Part

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        state = self.state
        state.typingctx = remembering(state.typingctx)
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        passes = DefaultPassBuilder.define_nopython_pipeline(state)
        passes.passes[:] = [one for one in passes.passes if one[0].__name__ not in IDLE]
        return [passes]


class WholeCompiler(PartCompiler):
    """The same for a kernel that Python calls."""

    library = Whole

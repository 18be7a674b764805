"""How numba puts kernels together: one piece of machine code for each kernel that Python calls.

By itself numba makes and optimises machine code of every kernel, with all that it calls in it, once for each of its
callers. Here a kernel that only kernels call is a `Part`: typed and lowered once, and part of whoever needs it.

Tuples that are `held` are one word for it: a place in memory from which their fields are read.

`granular._engine.kernels` loads it together with numba.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from typing import Any
from zlib import crc32

from llvmlite import ir
from numba import njit, typeof
from numba.core import cgutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, intrinsic, overload, register_model, typeof_impl, unbox

from granular._engine.held import WORDS, Held, held

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


class Reference(types.Type):
    """The type of a place where fields of such names and types are noted."""

    def __init__(self, names: tuple[str, ...], fields: tuple[Any, ...]) -> None:
        self.names, self.fields = names, fields
        super().__init__(name=f"Reference{crc32(repr(self.key).encode()):08x}")  # short: it is in every symbol

    @property
    def key(self) -> Any:
        """What tells it from others."""
        return self.names, self.fields


@register_model(Reference)
class ReferenceModel(models.OpaqueModel):  # type: ignore[misc]
    """A pointer."""


@infer_getattr
class ReferenceAttribute(AttributeTemplate):  # type: ignore[misc]
    """Fields are read by their names."""

    key = Reference

    def generic_resolve(self, reference: Any, name: str) -> Any:
        """Return the type of a field."""
        return reference.fields[reference.names.index(name)] if name in reference.names else None


def _place_of(context: Any, builder: Any, reference: Reference, room: Any, at: int) -> Any:
    """Return where field number `at` is noted in a room."""
    noted = ir.LiteralStructType([context.get_value_type(field) for field in reference.fields])
    assert context.get_abi_sizeof(noted) <= 8 * WORDS
    return cgutils.gep_inbounds(builder, builder.bitcast(room, noted.as_pointer()), 0, at)


@lower_getattr_generic(Reference)  # type: ignore[untyped-decorator]
def _read(context: Any, builder: Any, reference: Any, room: Any, name: str) -> Any:
    at = reference.names.index(name)
    value = builder.load(_place_of(context, builder, reference, room, at))
    return impl_ret_borrowed(context, builder, reference.fields[at], value)


@intrinsic  # type: ignore[untyped-decorator]
def _note(typing: Any, fields: Any, room: Any) -> Any:
    reference = Reference(fields.fields, tuple(fields.types))

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        data = context.make_array(room)(context, builder, given[1]).data
        for at in range(len(fields)):
            builder.store(builder.extract_value(given[0], at), _place_of(context, builder, reference, data, at))
        return builder.bitcast(data, cgutils.voidptr_t)

    return reference(fields, room), code


@overload(held)  # type: ignore[untyped-decorator]
def _held(fields: Any, room: Any) -> Any:
    def noted(fields: Any, room: Any) -> Any:
        return _note(fields, room)

    return noted


@kept
@njit(_nrt=False)  # type: ignore[untyped-decorator]
def _fill(fields: Any, room: Any) -> None:
    _note(fields, room)


Held.note = staticmethod(_fill)


@typeof_impl.register(Held)  # type: ignore[untyped-decorator]
def _type_of(value: Any, context: Any) -> Any:
    return Reference(value._fields, tuple(map(typeof, value)))


@unbox(Reference)  # type: ignore[untyped-decorator]
def _unboxed(reference: Any, value: Any, c: Any) -> Any:
    room, array = c.pyapi.object_getattr_string(value, "room"), types.Array(types.int64, 1, "C")
    failed = cgutils.is_null(c.builder, room)
    place = cgutils.alloca_once_value(c.builder, ir.Constant(cgutils.voidptr_t, None))
    with c.builder.if_then(c.builder.not_(failed), likely=True):
        data = c.context.make_array(array)(c.context, c.builder, c.unbox(array, room).value).data
        c.builder.store(c.builder.bitcast(data, cgutils.voidptr_t), place)
        c.pyapi.decref(room)  # the tuple keeps it
    return NativeValue(c.builder.load(place), is_error=failed)

"""Faster compiler pipeline for kernels, by overriding internals of numba.

By default numba optimises the machine code of every kernel once for each of its callers. This pipeline types and
lowers a kernel that only kernels call once, as a `Part`, and links it into every `Whole` kernel that Python calls.
Named tuples of arrays (`granular._engine.compiler_state.ByReference`) are passed as one pointer. Together this halves
the compilation time and saves 5 % of a call.

`granular._engine.kernels` uses this pipeline only for the versions of numba in its `TESTED_NUMBA`, and the
default pipeline after any failure.
"""

from __future__ import annotations

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

from granular._engine.compiler_state import (
    REFERENCE_WORDS,
    ByReference,
    Mode,
    by_reference,
    cache_on_disk,
    use_default_pipeline,
)

UNUSED_PASSES = {
    "AnnotateTypes", "FindLiterallyCalls", "InlineClosureLikes", "InlineInlinables", "InlineOverloads",
    "LiteralPropagationSubPipelinePass", "LiteralUnroll", "MakeFunctionToJitFunction", "NopythonRewrites",
    "RewriteDynamicRaises", "WithLifting"}
"""Compiler passes for constructs that kernels do not contain.

They are closures, ``with``, unrolled tuples and array expressions.
"""


class Part(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a kernel that only kernels call. It is only linked."""

    def finalize(self) -> None:
        """Leave the code as it is, to be linked."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return the null pointer, because the code is not loaded."""
        return 0

    @property
    def codegen(self) -> Part:
        """Receiver of the environment for exceptions, which kernels do not raise."""
        return self

    def set_env(self, name: str, env: Any) -> None:
        """Ignore the environment."""


class Whole(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a kernel that Python calls, with the code of all parts below it."""

    def add_linking_library(self, library: Any) -> None:
        """Link a library, and the libraries below it that a part does not link."""
        if library not in self._linking_libraries:
            super().add_linking_library(library)
            for below in library._linking_libraries if isinstance(library, Part) else ():
                self.add_linking_library(below)


@cache
def remembering(context: Any) -> Any:
    """Return a typing context like `context` that caches the types of functions.

    numba tries 14 templates for each ``pairs[c]``, a fifth of the compilation time. A kernel is compiled once for all
    literal arguments, and for exactly these types: numba would warn about records whose first fields are equal.
    """

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
    """numba's compiler passes for a part, without `UNUSED_PASSES`."""

    library = Part

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        state = self.state
        state.typingctx = remembering(state.typingctx)
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        passes = DefaultPassBuilder.define_nopython_pipeline(state)
        passes.passes[:] = [one for one in passes.passes if one[0].__name__ not in UNUSED_PASSES]
        return [passes]


class WholeCompiler(PartCompiler):
    """numba's compiler passes for a kernel that Python calls."""

    library = Whole


class Reference(types.Type):
    """numba type of a pointer to a table of addresses of arrays.

    It is defined by the names and types of the fields.
    """

    def __init__(self, names: tuple[str, ...], fields: tuple[Any, ...]) -> None:
        self.names, self.fields = names, fields
        super().__init__(name=f"Reference{crc32(repr(self.key).encode()):08x}")  # short, because it is in every symbol

    @property
    def key(self) -> Any:
        """Names and types of the fields, by which numba compares types."""
        return self.names, self.fields


@register_model(Reference)
class ReferenceModel(models.OpaqueModel):  # type: ignore[misc]
    """A pointer."""


@infer_getattr
class ReferenceAttribute(AttributeTemplate):  # type: ignore[misc]
    """Types of the fields of a reference."""

    key = Reference

    def generic_resolve(self, reference: Any, name: str) -> Any:
        """Return the type of a field, or None for an unknown name."""
        return reference.fields[reference.names.index(name)] if name in reference.names else None


def place_of(context: Any, builder: Any, reference: Reference, room: Any, at: int) -> Any:
    """Return a pointer to the array structure of field number `at` of a table."""
    layout = ir.LiteralStructType([context.get_value_type(field) for field in reference.fields])
    assert context.get_abi_sizeof(layout) <= 8 * REFERENCE_WORDS
    return cgutils.gep_inbounds(builder, builder.bitcast(room, layout.as_pointer()), 0, at)


@lower_getattr_generic(Reference)  # type: ignore[untyped-decorator]
def _read_field(context: Any, builder: Any, reference: Any, room: Any, name: str) -> Any:
    at = reference.names.index(name)
    value = builder.load(place_of(context, builder, reference, room, at))
    return impl_ret_borrowed(context, builder, reference.fields[at], value)


@intrinsic  # type: ignore[untyped-decorator]
def _write(typing: Any, fields: Any, room: Any) -> Any:
    reference = Reference(fields.fields, tuple(fields.types))

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        data = context.make_array(room)(context, builder, given[1]).data
        for at in range(len(fields)):
            builder.store(builder.extract_value(given[0], at), place_of(context, builder, reference, data, at))
        return builder.bitcast(data, cgutils.voidptr_t)

    return reference(fields, room), code


@unbox(Reference)  # type: ignore[untyped-decorator]
def _unboxed(reference: Any, value: Any, c: Any) -> Any:
    room, array = c.pyapi.object_getattr_string(value, "room"), types.Array(types.int64, 1, "C")
    failed = cgutils.is_null(c.builder, room)
    place = cgutils.alloca_once_value(c.builder, ir.Constant(cgutils.voidptr_t, None))
    with c.builder.if_then(c.builder.not_(failed), likely=True):
        data = c.context.make_array(array)(c.context, c.builder, c.unbox(array, room).value).data
        c.builder.store(c.builder.bitcast(data, cgutils.voidptr_t), place)
        c.pyapi.decref(room)  # the tuple keeps a reference
    return NativeValue(c.builder.load(place), is_error=failed)


@overload(by_reference)  # type: ignore[untyped-decorator]
def _by_reference(fields: Any, room: Any) -> Any:
    def written(fields: Any, room: Any) -> Any:
        return _write(fields, room)

    return written


@cache_on_disk
@njit(_nrt=False)  # type: ignore[untyped-decorator]
def _fill(fields: Any, room: Any) -> None:
    _write(fields, room)


ByReference.write_addresses = staticmethod(_fill)


@typeof_impl.register(ByReference)  # type: ignore[untyped-decorator]
def _type_of(value: Any, context: Any) -> Any:
    fields = tuple(map(typeof, value))
    if Mode.fast:
        try:
            value.room  # noqa: B018  created here, where a failure is not an error of the run
            return Reference(value._fields, fields)
        except Exception as error:
            use_default_pipeline(error)
    return types.NamedTuple(fields, type(value))  # type: ignore[attr-defined]

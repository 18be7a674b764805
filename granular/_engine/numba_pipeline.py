"""Faster compiler pipeline for kernels, by overriding internals of numba.

By default numba optimises the machine code of every kernel once for each of its callers. This pipeline compiles a
kernel that only kernels call once, as a `Part`, and links it into every `Whole`, a kernel that Python calls.
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
"""Compiler passes of numba for constructs that kernels do not contain.

These constructs are closures, ``with``, unrolled tuples and array expressions.
"""


class Part(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a kernel that only kernels call. It is linked, but not loaded."""

    def finalize(self) -> None:
        """Mark the code as final without optimisation, because it is linked later."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return the null pointer, because the code is not loaded."""
        return 0

    @property
    def codegen(self) -> Part:
        """Object whose `set_env` numba calls with the environment for exceptions."""
        return self

    def set_env(self, name: str, env: Any) -> None:
        """Ignore the environment, because kernels do not raise exceptions."""


class Whole(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a kernel that Python calls, with the code of all parts below it."""

    def add_linking_library(self, library: Any) -> None:
        """Link a library, and all libraries that a `Part` refers to but does not link."""
        if library not in self._linking_libraries:
            super().add_linking_library(library)
            for below in library._linking_libraries if isinstance(library, Part) else ():
                self.add_linking_library(below)


@cache
def caching_context(context: Any) -> Any:
    """Return a typing context of numba like `context` that caches function types.

    numba tries 14 templates for each ``pairs[c]``, which takes a fifth of the compilation time. A kernel is compiled
    once for all values of literal arguments. Its compiled version is selected by the exact types, because numba would
    warn about records whose first fields are equal.
    """

    class CachingContext(type(context)):  # type: ignore[misc]
        def resolve_function_type(self, function: Any, args: Any, kws: Any) -> Any:
            """Return the signature of a call.

            A kernel has the signature of its version compiled for the exact argument types. For other functions the
            result of numba is cached, unless there are keyword arguments.
            """
            if isinstance(function, types.Dispatcher):
                argument_types = tuple(map(types.unliteral, args))  # type: ignore[attr-defined]
                _, names, folded, _ = function.dispatcher.get_call_template(argument_types, kws)
                return function.dispatcher.overloads[tuple(folded)].signature.replace(pysig=names)
            if kws:
                return super().resolve_function_type(function, args, kws)
            if (function, args) not in signatures:
                signatures[function, args] = super().resolve_function_type(function, args, kws)
            return signatures[function, args]

    signatures: dict[Any, Any] = {}
    out = object.__new__(CachingContext)
    out.__dict__ = context.__dict__
    return out


class PartCompiler(CompilerBase):  # type: ignore[misc]
    """Compiler passes of numba for a `Part`, without `UNUSED_PASSES`."""

    library = Part

    def define_pipelines(self) -> list[Any]:
        """Return the list of pipelines, which has one entry."""
        state = self.state
        state.typingctx = caching_context(state.typingctx)
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        passes = DefaultPassBuilder.define_nopython_pipeline(state)
        passes.passes[:] = [entry for entry in passes.passes if entry[0].__name__ not in UNUSED_PASSES]
        return [passes]


class WholeCompiler(PartCompiler):
    """Compiler passes of numba for a kernel that Python calls, a `Whole`."""

    library = Whole


class Reference(types.Type):
    """Numba type of a pointer to the array addresses of a `ByReference` tuple.

    Two such types are equal if the names and types of the fields of their tuples are equal.
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
    """Data model of a `Reference` in machine code: a pointer."""


@infer_getattr
class ReferenceAttribute(AttributeTemplate):  # type: ignore[misc]
    """Types of the fields of a `Reference`, for attributes in kernels."""

    key = Reference

    def generic_resolve(self, reference: Any, name: str) -> Any:
        """Return the type of a field, or None for an unknown name."""
        return reference.fields[reference.names.index(name)] if name in reference.names else None


def field_pointer(context: Any, builder: Any, reference: Reference, room: Any, at: int) -> Any:
    """Return a pointer to the array structure of field `at` in the table `room`."""
    layout = ir.LiteralStructType([context.get_value_type(field) for field in reference.fields])
    assert context.get_abi_sizeof(layout) <= 8 * REFERENCE_WORDS
    return cgutils.gep_inbounds(builder, builder.bitcast(room, layout.as_pointer()), 0, at)


@lower_getattr_generic(Reference)  # type: ignore[untyped-decorator]
def _read_field(context: Any, builder: Any, reference: Any, room: Any, name: str) -> Any:
    """Generate code that reads the field `name` from the table `room`."""
    at = reference.names.index(name)
    value = builder.load(field_pointer(context, builder, reference, room, at))
    return impl_ret_borrowed(context, builder, reference.fields[at], value)


@intrinsic  # type: ignore[untyped-decorator]
def _write(typing: Any, fields: Any, room: Any) -> Any:
    """Return the type of a `Reference`, and code that writes its table `room`."""
    reference = Reference(fields.fields, tuple(fields.types))

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        data = context.make_array(room)(context, builder, values[1]).data
        for at in range(len(fields)):
            builder.store(builder.extract_value(values[0], at), field_pointer(context, builder, reference, data, at))
        return builder.bitcast(data, cgutils.voidptr_t)

    return reference(fields, room), code


@unbox(Reference)  # type: ignore[untyped-decorator]
def _unboxed(reference: Any, value: Any, c: Any) -> Any:
    """Generate code that converts a `ByReference` tuple of Python to a `Reference`."""
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
    """Return the numba type of a `ByReference` tuple, which depends on the pipeline."""
    fields = tuple(map(typeof, value))
    if Mode.fast:
        try:
            value.room  # noqa: B018  created here, where a failure is not an error of the run
            return Reference(value._fields, fields)
        except Exception as error:
            use_default_pipeline(error)
    return types.NamedTuple(fields, type(value))  # type: ignore[attr-defined]

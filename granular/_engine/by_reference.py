"""What numba is told of tuples that are `held`: a type that is one word, and how their fields are read.

`granular._engine.kernels` loads it together with numba.
"""

from __future__ import annotations

from typing import Any
from zlib import crc32

from llvmlite import ir
from numba import njit, typeof
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, intrinsic, overload, register_model, typeof_impl, unbox

from granular._engine.held import WORDS, Held, held
from granular._engine.machine_code import kept


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

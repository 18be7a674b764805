"""Checks of arguments. Most functions return the checked value, or raise an error.

Every message has the form "`name` must be N, got V.", followed by one sentence with the usual fix if it helps. `name`
is the name of the argument in messages, `fix` the sentence.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cached_property, partial
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular._engine.signature import nearest

Array = NDArray[np.float64]
MAX_INTEGER = 2**63 - 1
"""Largest integer of 64 bits, the largest that arrays can store."""
MAX_REQUESTED_COUNT = 10_000_000
"""Maximum number of balls of a ready-made scene, and of samples of a run.

The results of such a run take several GB.
"""

MAX_LISTED_OPTIONS = 12
"""Maximum number of options that a message lists as the requirement.

More options are listed at the end of the message, and only if none of them resembles the value.
"""
EDITED_STATE = "The file was edited after it was saved."
"""Last sentence of messages about an inconsistent saved state."""


class ByNumbers:
    """Base class of dataclasses of numbers and arrays, compared and hashed by value."""

    @cached_property
    def _key(self) -> tuple[Any, ...]:
        """Hashable tuple of all field values, with 0.0 for -0.0 in arrays."""
        values = (getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]
        return tuple((x.shape, (x + 0.0).tobytes()) if isinstance(x, np.ndarray) else x for x in values)

    def __eq__(self, other: object) -> bool:
        return self._key == other._key if isinstance(other, type(self)) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key)

    def __reduce__(self) -> tuple[Any, ...]:  # a copy is constructed again, so that its arrays are read-only
        return partial(type(self), **{f.name: getattr(self, f.name) for f in fields(self)}), ()  # type: ignore[arg-type]


def number(
    name: str,
    value: Any,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    finite: bool = True,
    fix: str = "",
) -> float:
    """Return `value` as a float if it is a single number in the allowed range.

    Parameters
    ----------
    above, at_least, at_most : float
        Requirements above < value and at_least ≤ value ≤ at_most. By default all numbers are allowed.
    finite : bool
        Whether infinity is refused. nan is always refused. Defaults to True.

    Raises
    ------
    TypeError
        If `value` is not a single number, such as a string, a boolean or an array.
    ValueError
        If it is outside of the range.
    """
    if type(value) is float and above < value and at_least <= value <= at_most and math.isfinite(value):
        return value
    try:
        wrong = isinstance(value, (bool, str, bytes, np.ma.MaskedArray)) or np.ndim(value) != 0
        if wrong or getattr(value, "dtype", None) == np.bool_:
            raise TypeError
        x = float(value)
    except OverflowError:
        x = math.inf if value > 0 else -math.inf  # an integer too large for a float
    except (TypeError, ValueError):
        raise TypeError(misuse(name, value, "a single number", fix)) from None
    if not (above < x and at_least <= x <= at_most) or (finite and math.isinf(x)):
        raise ValueError(misuse(name, value, _range_text(above, at_least, at_most, finite), fix))
    return x


def integer(name: str, value: Any, *, at_least: int = 0, at_most: int = MAX_INTEGER, fix: str = "") -> int:
    """Return `value` as an int if it is a whole number within ``[at_least, at_most]``.

    Floats without a fractional part are accepted.
    """
    if type(value) is int and at_least <= value <= at_most:
        return value
    exact = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    x = value if exact else number(name, value, fix=fix)
    if x != x // 1 or not at_least <= x <= at_most:
        least = f"of at least {at_least}" if x <= at_most else f"from {at_least} to {at_most}"
        raise ValueError(misuse(name, value, f"an integer {least}", fix))
    return int(x)


def array(
    name: str, value: Any, shape: tuple[int, ...] | EllipsisType | None = None, *, fix: str = "", finite: str = ""
) -> Array:
    """Return a read-only float64 copy of `value` if it has the shape `shape`.

    The shape None means one dimension of any length, and ``...`` any shape. If `finite` is not empty, all entries must
    be finite. `finite` then describes the requirement in the message, such as "a finite coefficient".
    """
    if isinstance(value, np.ma.MaskedArray):
        raise TypeError(misuse(name, value, "an array without a mask", fix or "Leave out the masked entries."))
    try:
        is_float_array = type(value) is np.ndarray and value.dtype == np.float64
        copy = value.copy() if is_float_array else np.array(_checked_numbers(value), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(misuse(name, value, "an array of numbers", fix)) from None
    except MemoryError:
        raise ValueError(must(name, "an array that fits into memory", f"an array of shape {np.shape(value)}")) from None
    if copy.ndim != 1 if shape is None else shape not in (..., copy.shape):
        need = "a one-dimensional array" if shape is None else f"an array of shape {shape}"
        raise ValueError(must(name, need, f"an array of shape {copy.shape}", fix))
    copy.flags.writeable = False
    if finite and not np.isfinite(copy).all():
        every(name, copy.ravel(), np.isfinite(copy).ravel(), finite)
    return copy


def increasing_array(name: str, value: Any, need: str, *, at_least: float = -math.inf) -> Array:
    """Return an array of at least two finite, strictly increasing numbers.

    No entry may be below `at_least`. `need` describes the requirement on an entry in the message.
    """
    copy = array(name, value)
    if len(copy) < 2:
        raise ValueError(must(name, "an array of at least 2 entries", f"{len(copy)}"))
    every(name, copy, np.isfinite(copy) & (copy >= at_least), need)
    every(name, copy, np.diff(copy, prepend=-math.inf) > 0.0, "larger than the entry before it")
    return copy


def _checked_numbers(value: Any) -> Any:
    """Return `value`, or raise `TypeError` if it does not consist of numbers.

    Refused are values that numpy converts without a warning: strings (except "inf"), booleans, None, complex numbers
    and dates.
    """
    if isinstance(value, (list, tuple)) and {float, int}.issuperset(map(type, value)):
        return value
    converted = np.asarray(value)
    kind = converted.dtype.kind
    if kind not in "iufUSO" or contains_booleans(value):
        raise TypeError
    if kind in "USO":
        if any(isinstance(x, (str, bytes, bool, np.bool_, type(None))) and x != "inf"
               for x in np.asarray(value, dtype=object).flat):
            raise TypeError
        return value
    return converted


def is_single(value: Any) -> bool:
    """Return whether `value` is a single value, not a list or an array of values."""
    return (value if isinstance(value, np.ndarray) else np.asarray(value, dtype=object)).ndim == 0


def contains_booleans(value: Any) -> bool:
    """Return whether a list or tuple contains booleans, which numpy makes 0 and 1."""
    return isinstance(value, (list, tuple)) and not {bool, np.bool_}.isdisjoint(map(type, value))


def saved_array(
    state: Mapping[str, Any], name: str, kind: str, shape: tuple[int, ...], least: float = -math.inf,
    most: float = math.inf, *, finite: bool = True, nan: bool = False,
) -> Any:
    """Return one array of a saved state if its type, shape and values are valid.

    Parameters
    ----------
    state : mapping of str to array
        Saved state.
    name : str
        Name of the array in the state.
    kind : {"f", "i", "b"}
        Kind of numpy's data type: float, int or bool.
    shape : tuple of int
        Required shape.
    least, most : float
        Allowed range of the entries. Defaults to all numbers.
    finite, nan : bool
        Whether inf is refused, and whether nan is accepted. Default to True and False.
    """
    value = np.asarray(state.get(name))
    if value.dtype.kind != kind or value.shape != shape:
        got = f"{value.dtype} of shape {value.shape}" if name in state else "nothing"
        type_name = {"f": "float", "i": "int", "b": "bool"}[kind]
        raise ValueError(must(
            f"{name!r} in the state of `trajectory`", f"{type_name} of shape {shape}", got, EDITED_STATE))
    is_valid = (value >= least) & (value <= most) & (not finite or np.isfinite(value)) | (nan and np.isnan(value))
    if not is_valid.all():
        invalid_value = value[~is_valid].flat[0] if value.shape else value
        raise ValueError(must(f"{name!r} in the state of "
                              "`trajectory`", f"in [{least:g}, {most:g}]", str(invalid_value), EDITED_STATE))
    return value


def boolean(name: str, value: Any) -> bool:
    """Return `value` as a bool if it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(misuse(name, value, "True or False"))
    return bool(value)


def of_kind(name: str, value: Any, kind: Any, need: str, fix: str = "") -> Any:
    """Return `value` if it is an instance of `kind`. `need` describes the requirement."""
    if not isinstance(value, kind):
        raise TypeError(misuse(name, value, need, fix))
    return value


def several(name: str, value: Any, need: str, least: int = 0) -> list[Any]:
    """Return one or several strings or functions as a list.

    The list must have at least `least` entries. `need` describes the requirement in the message, in the form "X, or
    several", where X describes an entry.
    """
    is_single_value = isinstance(value, str) or callable(value)
    entries = [value] if is_single_value else list(of_kind(name, value, Iterable, need))
    for entry in entries:
        of_kind(f"every entry of `{name}`", entry, (str, Callable), need.removesuffix(", or several"))
    if len(entries) < least:
        raise ValueError(must(name, need, "an empty list"))
    return entries


def choices(name: str, value: Any, options: Sequence[str], least: int = 0) -> tuple[str, ...]:
    """Return one or several strings as a tuple if all of them are in `options`.

    The tuple must have at least `least` entries.
    """
    need = f"one or more of {', '.join(options)}"
    return tuple(choice(name, entry, options) for entry in several(name, value, need, least))


def every(name: str, values: Array, good: NDArray[np.bool_], need: str, fix: str = "") -> None:
    """Raise `ValueError` for the first entry of `values` that is not `good`.

    `good` is a boolean array. The message contains the index of the entry. `need` describes the requirement on an
    entry.
    """
    if not good.all():
        i = int(np.flatnonzero(~good)[0])
        raise ValueError(misuse(f"{name}[{i}]", float(values[i]), need, fix))


def positive(name: str, value: Any, what: str, fix: str = "", shape: tuple[int, ...] | None = None) -> Array:
    """Return a non-empty array of positive, finite numbers.

    `what` names an entry in the message, such as "mass".
    """
    copy = array(name, value, shape, fix=fix)
    every(name, copy, np.isfinite(copy) & (copy > 0.0), "positive and finite", fix)
    if not copy.size:
        raise ValueError(must(name, f"an array of at least one {what}", "an empty array"))
    return copy


def raise_if_true(wrong: Mapping[str, object]) -> None:
    """Raise `ValueError` with the first sentence whose condition is true.

    `wrong` maps sentences to conditions.
    """
    for sentence, is_wrong in wrong.items():
        if is_wrong:
            raise ValueError(sentence)


def choice(name: str, value: Any, options: Sequence[str]) -> str:
    """Return `value` if it is one of `options`."""
    if not isinstance(value, str) or value not in options:
        suggestion = nearest(value, options)
        listed = ", ".join(options)
        need, fix = (f"one of {listed}", "") if len(options) <= MAX_LISTED_OPTIONS else (
            "a known name", f"Known names: {listed}.")
        raise ValueError(misuse(name, value, need, f"Did you mean {suggestion!r}?" if suggestion else fix))
    return str(value)


def known_names(given: Iterable[str], names: Collection[str], what: str, kind: type[Exception] = ValueError) -> None:
    """Raise an error for the first of the `given` names that is not in `names`.

    `kind` is the class of the error. `what` is the kind of name, such as "option of gas" or "command". The message
    contains the most similar name, or all names if no name is similar.
    """
    for name in given:
        if name not in names:
            thing, _, owner = what.partition(" of ")
            suggestion = nearest(name, names)
            all_names = f"available: {', '.join(sorted(names))}." if names else "there is none."
            hint = "see --help." if name.startswith("-") else all_names  # an option of a command
            complaint = f"{owner} has no {thing} {quoted(name)}" if owner else f"unknown {thing} {name}"
            raise kind(f"{complaint}; " + (
                f"did you mean {quoted(suggestion) if owner else suggestion}?" if suggestion else hint))


def per_pair(name: str, value: Any, n_pairs: int) -> tuple[Any, ...]:
    """Return one law or rule per pair as a tuple.

    A single law or rule holds for all pairs. A list must have `n_pairs` entries.
    """
    if not isinstance(value, (list, tuple)):
        return (value,) * n_pairs
    if len(value) != n_pairs:
        fix = "Give one for all pairs, or one per pair from the bottom up."
        length = f"the length of {quoted(name)}"
        raise ValueError(must(length, f"{n_pairs} (the number of pairs)", f"{len(value)}", fix))
    return tuple(value)


def _range_text(above: float, at_least: float, at_most: float, finite: bool) -> str:
    """Return the description of an allowed range in messages; see `number`."""
    low, kind = max(above, at_least), "a finite number" if finite else "a number"
    if low == at_least == at_most:
        return f"{low:g}"
    if at_most < math.inf:
        return f"{kind} of at most {at_most:g}" if low == -math.inf else (
            f"a number in {'[' if at_least > above else '('}{low:g}, {at_most:g}]")
    if low == -math.inf:
        return kind
    return f"{kind} {'of at least' if at_least > above else 'above'} {low:g}"


def misuse(name: str, value: Any, need: str, fix: str = "") -> str:
    """Return the message "`name` must be `need`, got `value`. `fix`"."""
    try:
        shown = " ".join(repr(value).split())
    except ValueError:  # a whole number of thousands of digits
        shown = f"a number of {type(value).__name__} with thousands of digits"
    if len(shown) > 60:
        shown = shown[:57] + "..."
    return must(name, need, shown, fix)


def must(name: str, need: str, got: str, fix: str = "") -> str:
    """Return the message "`name` must be `need`, got `got`. `fix`" for a text `got`."""
    subject = quoted(name)
    return f"{subject[0].upper()}{subject[1:]} must be {need}, got {got}." + f" {fix}" * bool(fix)


def quoted(name: str) -> str:
    """Return a name in backticks if it is the name of an argument, such as `gap[1]`.

    Phrases and options of the command line are returned unchanged.
    """
    return f"`{name}`" if re.fullmatch(r"[^\W\d]\w*(\[[^\]]*\]|\.\w+|\(\S+\))*", name) else name

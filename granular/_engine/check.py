"""Argument checks. Each returns the checked value, or raises an error.

Every message has the form "`name` must be N, got V." and, if it helps, one sentence with the usual fix. `optional`
imports packages that only some tasks need.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cached_property, partial, wraps
from importlib import import_module
from types import EllipsisType, FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular._engine.package import EXTRAS, install
from granular._engine.signature import Function, face as face, nearest, parameters as parameters

Array = NDArray[np.float64]
MAX_INTEGER = 2**63 - 1
"""The largest whole number that arrays hold."""
MAX_REQUESTED_COUNT = 10_000_000
"""Largest number of balls of a ready-made scene, or of samples of a run.

With all results they take some GB.
"""

LISTED = 12
"""Names up to this number are listed in a message before the value that was given."""
EDITED_STATE = "The file was edited after it was saved."
"""The remedy of a saved state that does not fit."""


class ByNumbers:
    """Dataclass of numbers and arrays, compared and hashed by their values."""

    @cached_property
    def _key(self) -> tuple[Any, ...]:
        """All field values as one hashable value; -0.0 counts as 0.0."""
        values = (getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]
        return tuple((x.shape, (x + 0.0).tobytes()) if isinstance(x, np.ndarray) else x for x in values)

    def __eq__(self, other: object) -> bool:
        return self._key == other._key if isinstance(other, type(self)) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key)

    def __reduce__(self) -> tuple[Any, ...]:  # made anew: none writes into arrays of a copy of which all is known
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
    """Return `value` as a float within ``(above, …)`` and ``[at_least, at_most]``.

    nan is always refused.
    """
    if type(value) is float and above < value and at_least <= value <= at_most and math.isfinite(value):
        return value
    try:
        wrong = isinstance(value, (bool, str, bytes, np.ma.MaskedArray)) or np.ndim(value) != 0
        if wrong or getattr(value, "dtype", None) == np.bool_:
            raise TypeError
        x = float(value)
    except OverflowError:
        x = math.inf if value > 0 else -math.inf  # a whole number that no float can hold
    except (TypeError, ValueError):
        raise TypeError(misuse(name, value, "a single number", fix)) from None
    if not (above < x and at_least <= x <= at_most) or (finite and math.isinf(x)):
        raise ValueError(misuse(name, value, _range(above, at_least, at_most, finite), fix))
    return x


def whole(name: str, value: Any, *, at_least: int = 0, at_most: int = MAX_INTEGER, fix: str = "") -> int:
    """Return `value` as an int within ``[at_least, at_most]``."""
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
    """Return a read-only float64 copy of `value` with the given `shape`.

    The shape None means any length, and ``...`` any shape. If `finite` is given, all entries have to be finite, and it
    describes an entry in the message.
    """
    if isinstance(value, np.ma.MaskedArray):
        raise TypeError(misuse(name, value, "an array without a mask", fix or "Leave out the masked entries."))
    try:
        plain = type(value) is np.ndarray and value.dtype == np.float64
        out = value.copy() if plain else np.array(_worded(value), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(misuse(name, value, "an array of numbers", fix)) from None
    except MemoryError:
        raise ValueError(must(name, "an array that fits into memory", f"an array of shape {np.shape(value)}")) from None
    if out.ndim != 1 if shape is None else shape not in (..., out.shape):
        need = "a one-dimensional array" if shape is None else f"an array of shape {shape}"
        raise ValueError(must(name, need, f"an array of shape {out.shape}", fix))
    out.flags.writeable = False
    if finite and not np.isfinite(out).all():
        every(name, out.ravel(), np.isfinite(out).ravel(), finite)
    return out


def rising(name: str, value: Any, need: str, *, at_least: float = -math.inf) -> Array:
    """Return two or more finite, increasing numbers as an array.

    `need` describes an entry in the message.
    """
    out = array(name, value)
    if len(out) < 2:
        raise ValueError(must(name, "an array of at least 2 entries", f"{len(out)}"))
    every(name, out, np.isfinite(out) & (out >= at_least), need)
    every(name, out, np.diff(out, prepend=-math.inf) > 0.0, "larger than the entry before it")
    return out


def _worded(value: Any) -> Any:
    """Return a value that can become an array, or raise `TypeError`.

    It refuses values that numpy would convert silently: words (except "inf"), truth values and None among numbers,
    complex numbers and dates.
    """
    if isinstance(value, (list, tuple)) and {float, int}.issuperset(map(type, value)):
        return value
    given = np.asarray(value)
    kind = given.dtype.kind
    if kind not in "iufUSO" or among_numbers(value):
        raise TypeError
    if kind in "USO":
        if any(isinstance(x, (str, bytes, bool, np.bool_, type(None))) and x != "inf"
               for x in np.asarray(value, dtype=object).flat):
            raise TypeError
        return value
    return given


def is_one(value: Any) -> bool:
    """Whether a value is a single one, and not a list or array of values."""
    return (value if isinstance(value, np.ndarray) else np.asarray(value, dtype=object)).ndim == 0


def among_numbers(value: Any) -> bool:
    """Whether a list contains truth values, which numpy converts to 0 and 1."""
    return isinstance(value, (list, tuple)) and not {bool, np.bool_}.isdisjoint(map(type, value))


def saved_array(
    state: Mapping[str, Any], name: str, kind: str, shape: tuple[int, ...], least: float = -math.inf,
    most: float = math.inf, *, finite: bool = True, nan: bool = False,
) -> Any:
    """Return an entry of a saved state with the given `kind` (of numpy) and `shape`.

    Its entries must be within the limits.
    """
    value = np.asarray(state.get(name))
    if value.dtype.kind != kind or value.shape != shape:
        got = f"{value.dtype} of shape {value.shape}" if name in state else "nothing"
        word = {"f": "float", "i": "int", "b": "bool"}[kind]
        raise ValueError(must(f"{name!r} in the state of `trajectory`", f"{word} of shape {shape}", got, EDITED_STATE))
    good = (value >= least) & (value <= most) & (not finite or np.isfinite(value)) | (nan and np.isnan(value))
    if not good.all():
        wrong = value[~good].flat[0] if value.shape else value
        raise ValueError(must(f"{name!r} in the state of "
                              "`trajectory`", f"in [{least:g}, {most:g}]", str(wrong), EDITED_STATE))
    return value


def truth(name: str, value: Any) -> bool:
    """Return `value` if it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(misuse(name, value, "True or False"))
    return bool(value)


def of_kind(name: str, value: Any, kind: Any, need: str, fix: str = "") -> Any:
    """Return `value` if it is an instance of `kind`; `need` says of what."""
    if not isinstance(value, kind):
        raise TypeError(misuse(name, value, need, fix))
    return value


def several(name: str, value: Any, need: str, least: int = 0) -> list[Any]:
    """Return words or functions, or a single one, as a list.

    `need` is "X, or several", where each entry is X.
    """
    one = isinstance(value, str) or callable(value)
    entries = [value] if one else list(of_kind(name, value, Iterable, need))
    for entry in entries:
        of_kind(f"every entry of `{name}`", entry, (str, Callable), need.removesuffix(", or several"))
    if len(entries) < least:
        raise ValueError(must(name, need, "an empty list"))
    return entries


def choices(name: str, value: Any, options: Sequence[str], least: int = 0) -> tuple[str, ...]:
    """Return one or several choices as a tuple; raise unless all are in `options`."""
    need = f"one or more of {', '.join(options)}"
    return tuple(choice(name, one, options) for one in several(name, value, need, least))


def typed(module: dict[str, Any], *kinds: type) -> None:
    """Make the public functions of a module check their annotated arguments.

    `module` is the module's ``globals()``. Arguments annotated as one of `kinds`, as an `Array` or as a `Mapping` must
    have this type.
    """
    needed: dict[str, Any] = {kind.__name__: (kind, f"a granular.{kind.__name__}") for kind in kinds} | {
        "Array": (np.ndarray, "an array"), "Mapping": (Mapping, "a mapping")}
    for name, function in list(module.items()):
        if isinstance(function, FunctionType) and function.__module__ == module["__name__"] and name[0] != "_":
            module[name] = _typed(function, needed)


def _typed(function: Function, needed: Mapping[str, tuple[type, str]]) -> Function:
    """Return a function that checks its annotated arguments.

    Without such arguments the function is only a `face`.
    """
    names = function.__code__.co_varnames
    places = [(names.index(name), name, *needed[word.partition("[")[0]])
              for name, word in function.__annotations__.items()
              if name != "return" and word.partition("[")[0] in needed]

    inner = face(function)

    @wraps(function)
    def checked(*values: Any, **named: Any) -> Any:
        for i, name, kind, need in places:
            if not isinstance(values[i] if i < len(values) else named.get(name), kind) and (
                    i < len(values) or name in named):
                of_kind(name, values[i] if i < len(values) else named[name], kind, need)
        return inner(*values, **named)

    return checked if places else inner  # type: ignore[return-value]


def callback(name: str, value: Any, *given: str) -> Any:
    """Return `value` if it is None, or a function with arguments of these names."""
    if value is not None and not callable(value):
        raise TypeError(misuse(name, value, "a function or None"))
    return value if value is None else takes(name, value, *given)


def takes(name: str, function: Any, *given: str, fix: str = "") -> Any:
    """Return a user's function if it has arguments of these names, in this order."""
    import inspect

    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # some builtins have none
        return function
    names = list(signature.parameters)
    try:
        signature.bind(*given)
        fits = sorted(names) != sorted(given) or names == list(given)
    except TypeError:
        fits = False
    if not fits:
        bare = [p.replace(annotation=p.empty) for p in signature.parameters.values()]
        taken = signature.replace(parameters=bare, return_annotation=signature.empty)
        arguments = f"argument{'s' * (len(given) != 1)} ({', '.join(given)})"
        raise TypeError(must(name, f"a function with the {arguments}", f"{taken}", fix))
    return function


def is_own(value: Any) -> bool:
    """Return whether a law or rule is user-defined."""
    cls = type(value)
    home = sys.modules.get(cls.__module__) if cls.__module__.startswith("granular.") else None
    return getattr(home, cls.__name__, None) is not cls


def every(name: str, values: Array, good: NDArray[np.bool_], need: str, fix: str = "") -> None:
    """Raise for the first entry of `values` whose `good` is false, naming its index."""
    if not good.all():
        i = int(np.flatnonzero(~good)[0])
        raise ValueError(misuse(f"{name}[{i}]", float(values[i]), need, fix))


def positive(name: str, value: Any, what: str, fix: str = "", shape: tuple[int, ...] | None = None) -> Array:
    """Return positive, finite numbers as a non-empty array. `what` names an entry."""
    out = array(name, value, shape, fix=fix)
    every(name, out, np.isfinite(out) & (out > 0.0), "positive and finite", fix)
    if not out.size:
        raise ValueError(must(name, f"an array of at least one {what}", "an empty array"))
    return out


def refuse(wrong: Mapping[str, object]) -> None:
    """Raise `ValueError` with the first of these sentences whose condition holds."""
    for sentence, so in wrong.items():
        if so:
            raise ValueError(sentence)


def choice(name: str, value: Any, options: Sequence[str]) -> str:
    """Return `value` if it is one of `options`."""
    if not isinstance(value, str) or value not in options:
        near = nearest(value, options)
        listed = ", ".join(options)
        need, fix = (f"one of {listed}", "") if len(options) <= LISTED else ("a known name", f"Known names: {listed}.")
        raise ValueError(misuse(name, value, need, f"Did you mean {near!r}?" if near else fix))
    return str(value)


def known(given: Iterable[str], names: Collection[str], what: str, kind: type[Exception] = ValueError) -> None:
    """Raise an error for the first given name that is not in `names`.

    `what` is the kind of name, such as "option of gas" or "command". The message contains the nearest name, or all.
    """
    for name in given:
        if name not in names:
            thing, _, owner = what.partition(" of ")
            near = nearest(name, names)
            every = f"available: {', '.join(sorted(names))}." if names else "there is none."
            listed = "see --help." if name.startswith("-") else every  # an option of a command
            wrong = f"{owner} has no {thing} {quoted(name)}" if owner else f"unknown {thing} {name}"
            raise kind(f"{wrong}; " + (f"did you mean {quoted(near) if owner else near}?" if near else listed))


def per_pair(name: str, value: Any, n_pairs: int) -> tuple[Any, ...]:
    """Spread one law or rule over all pairs, or check that a list has one per pair."""
    if not isinstance(value, (list, tuple)):
        return (value,) * n_pairs
    if len(value) != n_pairs:
        fix = "Give one for all pairs, or one per pair from the bottom up."
        length = f"the length of {quoted(name)}"
        raise ValueError(must(length, f"{n_pairs} (the number of pairs)", f"{len(value)}", fix))
    return tuple(value)


def _range(above: float, at_least: float, at_most: float, finite: bool) -> str:
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
    """Return the message "`name` must be …, got …. One sentence with the fix."."""
    try:
        shown = " ".join(repr(value).split())
    except ValueError:  # a whole number of thousands of digits
        shown = f"a number of {type(value).__name__} with thousands of digits"
    if len(shown) > 60:
        shown = shown[:57] + "..."
    return must(name, need, shown, fix)


def must(name: str, need: str, got: str, fix: str = "") -> str:
    subject = quoted(name)
    return f"{subject[0].upper()}{subject[1:]} must be {need}, got {got}." + f" {fix}" * bool(fix)


def quoted(name: str) -> str:
    """Return a name in backticks if it is an argument, such as `gap[1]`.

    Phrases and options of the command line are returned unchanged.
    """
    return f"`{name}`" if re.fullmatch(r"[^\W\d]\w*(\[[^\]]*\]|\.\w+|\(\S+\))*", name) else name


def optional(module: str, by: str) -> Any:
    """Return a module of an optional package, or raise `ImportError` with a hint.

    Parameters
    ----------
    module : str
        Name of the module, such as "matplotlib.figure".
    by : str
        Feature that needs it.
    """
    package = module.split(".")[0]
    try:
        return import_module(module)
    except ImportError:
        extra = next((name for name, packages in EXTRAS.items() if package in packages.split()), "plot")
        raise ImportError(f"{by} requires {package}, which is not installed. Install it with: "
                          f"{install(extra)}") from None

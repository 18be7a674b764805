"""Checks of user-defined functions, and of the arguments of public functions."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import wraps
from types import FunctionType
from typing import Any

import numpy as np

from granular._engine.check import misuse, must, of_kind
from granular._engine.signature import Function, face, raise_call_error


def check_argument_types(module: dict[str, Any], *kinds: type) -> None:
    """Add type checks of the arguments to all public functions of a module.

    `module` is the ``globals()`` of the module. Arguments that are annotated as one of the classes `kinds`, as `Array`
    or as `Mapping` must have this type. Others are not checked.
    """
    needed: dict[str, Any] = {kind.__name__: (kind, f"a granular.{kind.__name__}") for kind in kinds} | {
        "Array": (np.ndarray, "an array"), "Mapping": (Mapping, "a mapping")}
    for name, function in list(module.items()):
        is_function = isinstance(function, FunctionType) and function.__module__ == module["__name__"]
        if is_function and name[0] != "_" and not hasattr(function, "__wrapped__"):
            module[name] = _typed(function, needed)


def _typed(function: Function, needed: Mapping[str, tuple[type, str]]) -> Function:
    """Return `function` with type checks of its annotated arguments.

    `check_argument_types` applies it to a module. `needed` maps names of annotations to classes and to their
    description in messages. Without arguments to check, the function is only decorated by `face`.
    """
    names = function.__code__.co_varnames
    checked_arguments = [(names.index(name), name, *needed[annotation.partition("[")[0]])
              for name, annotation in function.__annotations__.items()
              if name != "return" and annotation.partition("[")[0] in needed]

    if not checked_arguments:
        return face(function)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        for i, name, kind, need in checked_arguments:
            value = args[i] if i < len(args) else kwargs.get(name, kind)
            if not isinstance(value, kind) and (i < len(args) or name in kwargs):
                of_kind(name, value, kind, need)
        try:  # as in `face`, in the same frame
            return function(*args, **kwargs)
        except TypeError as error:
            raise_call_error(function, error)

    return call  # type: ignore[return-value]


def callback(name: str, value: Any, *given: str) -> Any:
    """Return `value` if it is None or a function with these arguments.

    See `function_of`.
    """
    if value is not None and not callable(value):
        raise TypeError(misuse(name, value, "a function or None"))
    return value if value is None else function_of(name, value, *given)


def function_of(name: str, function: Any, *given: str, fix: str = "") -> Any:
    """Return a user's function if it can be called with these arguments.

    `given` are the names of the arguments. A function with the same names in another order is refused. A function with
    other names is accepted if the number of its arguments fits.
    """
    import inspect

    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # some builtins have no signature
        return function
    names = list(signature.parameters)
    try:
        signature.bind(*given)
        fits = sorted(names) != sorted(given) or names == list(given)
    except TypeError:
        fits = False
    if not fits:
        parameters = [p.replace(annotation=p.empty) for p in signature.parameters.values()]
        shown_signature = signature.replace(parameters=parameters, return_annotation=signature.empty)
        arguments = f"argument{'s' * (len(given) != 1)} ({', '.join(given)})"
        raise TypeError(must(name, f"a function with the {arguments}", f"{shown_signature}", fix))
    return function


def is_user_defined(value: Any) -> bool:
    """Return whether a law or rule is user-defined."""
    cls = type(value)
    module = sys.modules.get(cls.__module__) if cls.__module__.startswith("granular.") else None
    return getattr(module, cls.__name__, None) is not cls

"""Error messages for calls that do not fit the signature of a public function."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, NoReturn, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def face(target: Function) -> Function:
    """Decorate a public function or class so that call errors name the parameter.

    A call that does not fit the signature raises `TypeError` with the wrong or missing parameter, and with the most
    similar parameter, if any. Exceptions raised inside the function are unchanged. A class is changed in place: its
    `__init__` and its class methods are decorated. Every call costs one more frame.
    """
    if isinstance(target, type):
        for name, member in list(vars(target).items()):
            if name == "__init__" or isinstance(member, classmethod):
                setattr(target, name, classmethod(face(member.__func__)) if name != "__init__" else face(member))
        return target

    @wraps(target)
    def call(*args: Any, **kwargs: Any) -> Any:
        """Call `target`, with a clear message if its arguments do not fit."""
        try:
            return target(*args, **kwargs)
        except TypeError as error:
            raise_call_error(target, error)

    return call  # type: ignore[return-value]


def raise_call_error(function: Callable[..., Any], error: TypeError) -> NoReturn:
    """Raise the error of a call to `function` again.

    If the arguments do not match the signature, the message is replaced.
    """
    if error.__traceback__.tb_next is not None:  # type: ignore[union-attr]  # raised within the function
        raise error
    raise _call_error(function, str(error)) from None


def _call_error(function: Callable[..., Any], message: str) -> TypeError:
    """Return the error for a call that does not fit the signature.

    `message` is the message of Python's own `TypeError`.
    """
    name, names = function.__qualname__.removesuffix(".__init__"), [*re.findall(r"'(\w+)'", message), ""]
    if "unexpected keyword" in message:
        suggestion = nearest(names[0], parameters(function) - {"self", "cls"})
        fix = f"did you mean `{suggestion}`?" if suggestion else f"see help({name})."
        return TypeError(f"`{name}` has no parameter `{names[0]}`; {fix}")
    if "missing" in message:
        missing = ", ".join(f"`{word}`" for word in names[:-1])
        return TypeError(f"`{name}` requires {missing}, which {'is' if len(names) == 2 else 'are'} missing.")
    counts = re.search(r"takes (.*) but (\d+) (?:was|were) given", message)
    return TypeError(f"`{name}` takes {counts[1]}, got {counts[2]}. Pass the other arguments by name."
                     if counts else message)


def parameters(function: Callable[..., Any]) -> set[str]:
    """Return the names of all parameters of a function."""
    from inspect import signature

    return set(signature(function).parameters)


def nearest(word: Any, options: Iterable[str]) -> str:
    """Return the option most similar to `word`, or an empty string.

    The similarity must be at least 0.6 (see `difflib.get_close_matches`).
    """
    from difflib import get_close_matches

    matches = get_close_matches(str(word), list(options), n=1)
    return matches[0] if matches else ""

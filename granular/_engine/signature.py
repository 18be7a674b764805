"""Messages for calls that do not fit the signature of a public function."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def face(thing: Function) -> Function:
    """Decorate a public function or class, so that wrong calls name a parameter.

    A call that does not fit the signature raises `TypeError` with the nearest parameter. Other calls cost one more
    frame. Their exceptions are unchanged.
    """
    if isinstance(thing, type):
        for name, made in list(vars(thing).items()):
            if name == "__init__" or isinstance(made, classmethod):
                setattr(thing, name, classmethod(face(made.__func__)) if name != "__init__" else face(made))
        return thing

    @wraps(thing)
    def call(*values: Any, **named: Any) -> Any:
        try:
            return thing(*values, **named)
        except TypeError as error:
            if error.__traceback__.tb_next is not None:  # type: ignore[union-attr]  # raised within the function
                raise
            raise _misfit(thing, str(error)) from None

    return call  # type: ignore[return-value]


def _misfit(function: Callable[..., Any], message: str) -> TypeError:
    """Return the error for a call that does not fit, from Python's own message."""
    name, quoted = function.__qualname__.removesuffix(".__init__"), [*re.findall(r"'(\w+)'", message), ""]
    if "unexpected keyword" in message:
        near = nearest(quoted[0], parameters(function) - {"self", "cls"})
        fix = f"did you mean `{near}`?" if near else f"see help({name})."
        return TypeError(f"`{name}` has no parameter `{quoted[0]}`; {fix}")
    if "missing" in message:
        missing = ", ".join(f"`{word}`" for word in quoted[:-1])
        return TypeError(f"`{name}` requires {missing}, which {'is' if len(quoted) == 2 else 'are'} missing.")
    found = re.search(r"takes (.*) but (\d+) (?:was|were) given", message)
    return TypeError(f"`{name}` takes {found[1]}, got {found[2]}. Name the others." if found else message)


def parameters(function: Callable[..., Any]) -> set[str]:
    """Return the names of the parameters of a function."""
    from inspect import signature

    return set(signature(function).parameters)


def nearest(word: Any, options: Iterable[str]) -> str:
    """Return the option closest to `word`, or an empty string.

    Its similarity must be above 0.6.
    """
    from difflib import get_close_matches

    near = get_close_matches(str(word), list(options), n=1)
    return near[0] if near else ""

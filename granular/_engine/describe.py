"""Force laws, collision rules, walls and scenes as JSON: words and numbers.

A word names a class, such as "hertz" or "sine". No code from a file is executed when such a description is read.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

import numpy as np

from granular._engine.files import plain_text

CLASS_PLACES = {
    "law": {
        "linear-dashpot": "granular.laws.dashpot:LinearDashpot",
        "hertz": "granular.laws.hertz:Hertz",
        "viscoelastic-hertz": "granular.laws.hertz:ViscoelasticHertz",
        "tsuji-hertz": "granular.laws.hertz:TsujiHertz",
        "power-law": "granular.laws.springs:PowerLaw",
        "walton-braun": "granular.laws.springs:WaltonBraun",
        "matched-end": "granular.laws.springs:MatchedEnd",
    },
    "rule": {
        "constant-restitution": "granular.laws.rules:ConstantRestitution",
        "tabulated-restitution": "granular.laws.rules:TabulatedRestitution",
        "thornton-restitution": "granular.laws.rules:ThorntonRestitution",
        "law-restitution": "granular.md.binary:LawRestitution",
    },
    "wall": {
        "sine": "granular.scene.walls.formulas:Sine",
        "piecewise": "granular.scene.walls.formulas:Piecewise",
        "panels": "granular.scene.walls.panels:Panels",
        "thermal": "granular.scene.walls.thermal:Thermal",
    },
}
"""Classes that a file can contain, as module:class, by kind and word."""
CLASS_WORDS = {place: word for kind in CLASS_PLACES.values() for word, place in kind.items()}
"""Word of each class in files, by its module:class."""
OLD_CLASS_PLACES = {f"granular.{place}": word for place, word in {
    "laws.dashpot:LinearDashpot": "linear-dashpot",
    "laws.hertz:Hertz": "hertz",
    "laws.hertz:ViscoelasticHertz": "viscoelastic-hertz",
    "laws.hertz:TsujiHertz": "tsuji-hertz",
    "laws.springs:PowerLaw": "power-law",
    "laws.springs:WaltonBraun": "walton-braun",
    "laws.statics:MatchedEnd": "matched-end",
    "rules:ConstantRestitution": "constant-restitution",
    "rules:TabulatedRestitution": "tabulated-restitution",
    "rules:ThorntonRestitution": "thornton-restitution",
    "binary:LawRestitution": "law-restitution",
    "walls.formulas:Sine": "sine",
    "walls.formulas:Piecewise": "piecewise",
    "walls.panels:Panels": "panels",
    "walls.thermal:Thermal": "thermal",
    "laws.power:PowerLaw": "power-law",
    "laws.walton_braun:WaltonBraun": "walton-braun",
    "laws.matched_end:MatchedEnd": "matched-end",
    "walls.sine:Sine": "sine",
    "walls.piecewise:Piecewise": "piecewise",
}.items()}
"""Word of each class by its module:class in files of formats 1 and 2."""


def to_json(physics: Any) -> dict[str, Any]:
    """Return the description of a law, rule or wall: word of its class, text, numbers.

    A user-defined class or a function has no such word: its module and name replace it, and there are no numbers.
    """
    kind = type(physics)
    place = f"{kind.__module__}:{kind.__qualname__}"
    description: dict[str, Any] = {"class": CLASS_WORDS.get(place, place), "shown": plain_text(repr(physics))}
    if place in CLASS_WORDS:
        description["fields"] = _numbers(physics)
    return description


def _numbers(physics: Any) -> dict[str, Any]:
    return {f.name: _as_json(getattr(physics, f.name)) for f in fields(physics)}


def _as_json(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [_as_json(entry) for entry in value]
    return to_json(value) if is_dataclass(value) or callable(value) else value


def scene_to_json(scene: Any) -> dict[str, Any]:
    """Return all fields of a scene for JSON, with "inf" for the mass of a wall."""
    return _numbers(scene) | {"mass": ["inf" if m == np.inf else m for m in scene.mass.tolist()]}


def with_current_words(text: str) -> str:
    """Return JSON text of format 1 or 2 with the words of the current format."""
    for place, word in OLD_CLASS_PLACES.items():
        text = text.replace(f'"{place}"', f'"{word}"')
    return text


def from_json(what: str, value: Any) -> Any:
    """Return the law, rule or wall that `to_json` described.

    Parameters
    ----------
    what : {"law", "rule", "wall"}
        Kind of the object.
    value : dict
        Description.

    Raises
    ------
    LookupError
        If the class is user-defined. The message is the text of the object.
    TypeError, ValueError
        If the class is not in `CLASS_PLACES`, or if its fields are not valid.
    """
    if not isinstance(value, dict) or not all(isinstance(value.get(key), str) for key in ("class", "shown")):
        raise ValueError(f"The description of a {what} must be an object with the strings 'class' and 'shown', got "
                         f"{plain_text(repr(value), 60)}.")
    word = OLD_CLASS_PLACES.get(value["class"], value["class"])
    if "fields" not in value and word not in CLASS_WORDS.values():
        raise LookupError(plain_text(value["shown"]))
    if word not in CLASS_PLACES[what]:
        raise ValueError(f"The class of a {what} must be one of {', '.join(CLASS_PLACES[what])}, got "
                         f"{plain_text(repr(word), 60)}. A later version of granular can have other classes.")
    module, name = CLASS_PLACES[what][word].split(":")
    kind, values = getattr(import_module(module), name), value.get("fields")
    field_names = [f.name for f in fields(kind)]
    if not isinstance(values, dict) or sorted(values) != sorted(field_names):
        raise ValueError(f"The fields of a {what} of class {word!r} must be {', '.join(field_names)}, got "
                         f"{plain_text(repr(values), 60)}.")
    return kind(**{key: _value(value) for key, value in values.items()})


def _value(value: Any) -> Any:
    """Return the value of a field from JSON: a number, a law, or a tuple of them."""
    if isinstance(value, list):
        return tuple(map(_value, value))
    return from_json("law", value) if isinstance(value, dict) else value

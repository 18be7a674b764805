"""Force laws, collision rules, walls and scenes as JSON: a word and numbers.

Reading such a description never runs code from the file.
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
"""Classes that a file can name, by words. No other object is created from a file."""
CLASS_WORDS = {place: word for kind in CLASS_PLACES.values() for word, place in kind.items()}
"""Word of each class, by its place."""
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
"""Places of these classes in files of formats 1 and 2, with their words."""


def to_json(physics: Any) -> dict[str, Any]:
    """Return the word and the numbers of a law, rule or wall.

    For a user-defined class, and for a function, only the name is returned.
    """
    kind = type(physics)
    place = f"{kind.__module__}:{kind.__qualname__}"
    described: dict[str, Any] = {"class": CLASS_WORDS.get(place, place), "shown": plain_text(repr(physics))}
    if place in CLASS_WORDS:
        described["fields"] = _numbers(physics)
    return described


def _numbers(physics: Any) -> dict[str, Any]:
    return {f.name: _as_json(getattr(physics, f.name)) for f in fields(physics)}


def _as_json(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [_as_json(one) for one in value]
    return to_json(value) if is_dataclass(value) or callable(value) else value


def scene_to_json(scene: Any) -> dict[str, Any]:
    """Return the numbers of a scene, with the word inf for the mass of a wall."""
    return _numbers(scene) | {"mass": ["inf" if m == np.inf else m for m in scene.mass.tolist()]}


def by_words(text: str) -> str:
    """Return JSON text of an older format with words instead of places."""
    for place, word in OLD_CLASS_PLACES.items():
        text = text.replace(f'"{place}"', f'"{word}"')
    return text


def from_json(what: str, value: Any) -> Any:
    """Return the law, rule or wall (`what`) that `to_json` described.

    Raises
    ------
    LookupError
        If it is a user-defined class. The message is its description.
    TypeError, ValueError
        If it is not in `CLASS_PLACES`, has other fields, or values that its class refuses.
    """
    if not isinstance(value, dict) or not all(isinstance(value.get(key), str) for key in ("class", "shown")):
        raise ValueError(f"The description of a {what} must be a table with the texts 'class' and 'shown', got "
                         f"{plain_text(repr(value), 60)}.")
    word = OLD_CLASS_PLACES.get(value["class"], value["class"])
    if "fields" not in value and word not in CLASS_WORDS.values():
        raise LookupError(plain_text(value["shown"]))
    if word not in CLASS_PLACES[what]:
        raise ValueError(f"The class of a {what} must be one of {', '.join(CLASS_PLACES[what])}, got "
                         f"{plain_text(repr(word), 60)}. A later version of granular may know more.")
    module, name = CLASS_PLACES[what][word].split(":")
    kind, given = getattr(import_module(module), name), value.get("fields")
    known = [f.name for f in fields(kind)]
    if not isinstance(given, dict) or sorted(given) != sorted(known):
        raise ValueError(f"The fields of a {what} of class {word!r} must be {', '.join(known)}, got "
                         f"{plain_text(repr(given), 60)}.")
    return kind(**{key: _value(one) for key, one in given.items()})


def _value(value: Any) -> Any:
    """Return a number, a tuple of numbers, or the laws of a rule."""
    if isinstance(value, list):
        return tuple(map(_value, value))
    return from_json("law", value) if isinstance(value, dict) else value

"""Initial states of the teaching page, as links: scenes, settings and limits.

Names are the names of the library (restitution, stiffness, mass_ratio, ...). Links have shorter names (eps, k,
massRatio).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from granular._engine import check
from granular.cases import balls
from granular.cases.case import Option

LANGUAGES = ("en", "de", "fr", "es", "tr", "zh")
"""Languages of the pages. All have the same sentences."""
DEFAULT_CRADLE_BALLS = 5
"""Default number of balls of the cradle."""


@dataclass(frozen=True)
class Setting:
    """A setting of the teaching page: a number, or an integer.

    Parameters
    ----------
    slider : str
        Name in a link.
    about : str
        Description for the help text of the command.
    least, most : float
        Limits of the value.
    whole, zero : bool
        Whether the value is an integer, and whether 0 is allowed although it is below `least`.
    words : tuple of str
        Possible values, if the value is a word.
    """

    slider: str
    about: str
    least: float = 0.0
    most: float = 1.0
    whole: bool = False
    zero: bool = False
    words: tuple[str, ...] = ()

    def link_parameters(self, name: str, value: Any) -> dict[str, Any]:
        """Return the parameters of a link to the page with this setting at `value`.

        The result is a dict of the parameters after # in the URL, by their short names. `name` is used in error
        messages only.

        Raises
        ------
        ValueError, TypeError
            If the value is not a number within the limits.
        """
        if self.whole:
            return {self.slider: check.integer(name, value, at_least=int(self.least), at_most=int(self.most))}
        if self.zero and type(value) in (int, float) and value == 0:
            return {self.slider: 0}
        fix = "A gap of 0 means touching." if self.zero else ""
        return {self.slider: check.number(name, value, at_least=self.least, at_most=self.most, fix=fix)}


class Choice(Setting):
    """Setting whose value is one of several words. A link contains its index."""

    def link_parameters(self, name: str, value: Any) -> dict[str, Any]:
        """Return the parameter of a link to the page: the index of the word `value`."""
        return {self.slider: self.words.index(check.choice(name, value, self.words))}


class Language(Setting):
    """Setting whose value is a language of the page."""

    def link_parameters(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameter of a language."""
        return {self.slider: check.choice(name, value, self.words)}


class BallSetting(Setting):
    """Setting whose value is the name of a ball in `granular.balls`.

    The link contains this name.
    """

    def link_parameters(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameter of a ball."""
        return {self.slider: check.choice(name, value, self.words)}


class BooleanSetting(Setting):
    """Setting whose value is True or False."""

    def link_parameters(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameter of a boolean setting as 0 or 1."""
        return {self.slider: +check.boolean(name, value)}


RESTITUTION_SETTING = Setting("eps", "ε of all contacts", 0.1, 1.0)
GAP_SETTING = Setting("gap", "distance between the surfaces of the balls in m; 0 is touching", 1e-7, 0.1, zero=True)
STIFFNESS_SETTING = Setting("k", "stiffness of all contacts in N/m", 4e3, 1e9)
HEIGHT_SETTING = Setting("height", "drop height in m", 0.15, 2.0)
CENTRE_SETTING = Setting("height", "height of the lower ball's centre in m", 0.15, 2.0)
COUNT_SETTING = Setting("n", "number of balls", 2, 8, whole=True)


def ball_settings(i: int, prefix: str, label: str) -> dict[str, Setting]:
    """Return the settings of a ball: its name, and its properties.

    Only a ball with a prefix has the setting "filled", because it does not matter for a single ball.

    Parameters
    ----------
    i : int
        Number of the ball in links, 1 or 2.
    prefix : str
        Prefix of the names of the settings: "lower_", "upper_" or "".
    label : str
        Name of the ball in help texts.
    """
    name = prefix or "ball_"
    return {
        name.rstrip("_"): BallSetting(name.rstrip("_"), f"{label}: a name of granular.balls", words=tuple(balls.BALLS)),
        prefix + "mass": Setting(f"m{i}", f"mass of {label} in kg", 1e-3, 2.0),
        prefix + "radius": Setting(f"r{i}", f"radius of {label} in m", 2e-3, 0.15),
        prefix + "duration": Setting(f"t{i}", f"duration of a bounce of {label} on the floor in s", 1e-5, 0.03),
        prefix + "restitution": Setting(f"e{i}", f"ε of {label} on the floor", 0.1, 1.0),
    } | ({prefix + "filled": BooleanSetting(f"air{i}", f"whether {label} is filled with air")} if prefix else {})


SCENE_SETTINGS: dict[str, dict[str, Setting]] = {
    "story": {"screen": Setting("screen", "screen of the story; 0 is the drop", 0, 6, whole=True)},
    "real-balls": {
        **ball_settings(1, "lower_", "the lower ball"),
        **ball_settings(2, "upper_", "the upper ball"),
        "gap": GAP_SETTING,
        "height": HEIGHT_SETTING,
        "pair_rule": Choice("rule", "rule for the stiffness of the contact of two balls", words=balls.RULES),
        "bounces": Setting("bounces", "number of the bounce after which the flight is compared", 1, 2, whole=True),
    },
    "three-balls": {
        "gap": GAP_SETTING,
        "restitution": RESTITUTION_SETTING,
        "ratio": Setting("ratio", "radius ratio R₁/R₂", 0.5, 50.0),
        "stiffness": STIFFNESS_SETTING,
        "height": CENTRE_SETTING,
    },
    "ball-stack": {
        "gap": GAP_SETTING,
        "restitution": RESTITUTION_SETTING,
        "n": COUNT_SETTING,
        "stiffness": STIFFNESS_SETTING,
        "height": HEIGHT_SETTING,
        "mass_ratio": Setting("massRatio", "mass of each ball relative to the ball below", 0.1, 1.0),
    },
    "newtons-cradle": {
        "gap": GAP_SETTING,
        "restitution": RESTITUTION_SETTING,
        "n": Setting("n", "number of balls", 2, 9, whole=True),
        "stiffness": STIFFNESS_SETTING,
        "moving": Setting("moving", "number of balls that move at the start", 1, 8, whole=True),
        "speed": Setting("speed", "speed of these balls in m/s", 0.1, 3.0),
    },
    "bouncing-ball": {**ball_settings(1, "", "the ball"), "height": HEIGHT_SETTING},
}
"""Settings of each scene, with the limits of ``physics/setups.mjs`` (tested)."""
PAGE_SCENES = tuple(SCENE_SETTINGS)
"""Scenes with which the page can open, and its story."""
COMMON_SETTINGS = {
    "language": Language("lang", "language of the page [the language of the browser]", words=LANGUAGES),
    "at": Setting("at", "initial time, as a fraction of the time shown", 0.0, 1.0),
}
LABORATORY_SETTINGS = {"predict": BooleanSetting("predict", "start with a question for a prediction")}


def settings(scene: str) -> dict[str, Setting]:
    """Return the settings of one of `PAGE_SCENES`, by name."""
    own = SCENE_SETTINGS[check.choice("scene", scene, PAGE_SCENES)]
    return own | COMMON_SETTINGS | ({} if scene == "story" else LABORATORY_SETTINGS)


def link(scene: str, values: Mapping[str, Any]) -> str:
    """Return the initial state of the page as the query string of its link.

    Parameters
    ----------
    scene : str
        One of `PAGE_SCENES`.
    values : mapping
        Values of settings of this scene, with the names and units of the library.

    Raises
    ------
    ValueError, TypeError
        If the scene or a name is unknown, or if the page cannot show a value.
    """
    known = settings(scene)
    parameters: dict[str, Any] = {} if scene == "story" else {"scene": scene}
    check.known_names(values, known, f"setting of the page {scene}", TypeError)
    if scene == "story" and "at" in values:
        parameters = {"screen": 0}
    for name in filter(values.__contains__, known):
        parameters |= known[name].link_parameters(name, values[name])
    if "moving" in values:
        fix = "At least one ball has to be at rest."
        check.integer(
            "moving", values["moving"], at_least=1, at_most=parameters.get("n", DEFAULT_CRADLE_BALLS) - 1, fix=fix)
    return urlencode(parameters)


def options() -> list[Option]:
    """Return the settings of all scenes as options of the command line."""
    all_settings: dict[str, Setting] = {}
    for scene in PAGE_SCENES:
        all_settings = settings(scene) | all_settings
    return [Option(name, _kind(setting), None, _about(name, setting)) for name, setting in all_settings.items()]


def _about(name: str, setting: Setting) -> str:
    scenes = [scene for scene in PAGE_SCENES if name in settings(scene)]
    where = "" if len(scenes) >= len(PAGE_SCENES) - 1 else f" ({', '.join(scenes)})"
    return ("{" + ", ".join(setting.words) + "}: " if len(setting.words) in range(2, 7) else "") + setting.about + where


def _kind(setting: Setting) -> str:
    if isinstance(setting, BooleanSetting):
        return "bool"
    return "str" if setting.words else "int" if setting.whole else "float"

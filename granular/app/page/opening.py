"""Initial states of the teaching page, as links: scenes, settings and limits.

The library's names are used here (restitution, stiffness, mass_ratio, ...). Links have shorter ones (eps, k,
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
SHORT_NAMES = {"m": "mass", "r": "radius", "t": "duration", "e": "restitution", "air": "filled"}
DEFAULT_CRADLE_BALLS = 5
"""Default number of balls of the cradle."""


@dataclass(frozen=True)
class Setting:
    """A number, or an integer.

    Parameters
    ----------
    slider : str
        Name in a link.
    about : str
        Description for the help text of the command.
    least, most : float
        Limits.
    whole, zero : bool
        Whether the value is an integer, and whether 0 is allowed below `least`.
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

    def written(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameters for `value`, or raise an error."""
        if self.whole:
            return {self.slider: check.whole(name, value, at_least=int(self.least), at_most=int(self.most))}
        if self.zero and type(value) in (int, float) and value == 0:
            return {self.slider: 0}
        fix = "A gap of 0 means touching." if self.zero else ""
        return {self.slider: check.number(name, value, at_least=self.least, at_most=self.most, fix=fix)}


class Choice(Setting):
    """One of several words, which a link has as its index."""

    def written(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameter of a setting with a list of options."""
        return {self.slider: self.words.index(check.choice(name, value, self.words))}


class Language(Setting):
    """Setting of the page that selects its language."""

    def written(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameter of a language."""
        return {self.slider: check.choice(name, value, self.words)}


class Kind(Setting):
    """A ball by its name in `granular.balls`. `slider` is 1 for the lower ball or 2."""

    def written(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameters of a ball."""
        ball = balls.BALLS[check.choice(name, value, self.words)]
        return {f"{short}{self.slider}": +getattr(ball, long) for short, long in SHORT_NAMES.items()}


class Truth(Setting):
    """True or False."""

    def written(self, name: str, value: Any) -> dict[str, Any]:
        """Return the link parameter of a boolean setting as 0 or 1."""
        return {self.slider: +check.truth(name, value)}


RESTITUTION_SETTING = Setting("eps", "ε of all contacts", 0.1, 1.0)
GAP_SETTING = Setting("gap", "distance between the surfaces of the balls in m; 0 is touching", 1e-7, 0.1, zero=True)
STIFFNESS_SETTING = Setting("k", "stiffness of all contacts in N/m", 4e3, 1e9)
HEIGHT_SETTING = Setting("height", "drop height in m", 0.15, 2.0)
CENTRE_SETTING = Setting("height", "height of the lower ball's centre in m", 0.15, 2.0)
COUNT_SETTING = Setting("n", "number of balls", 2, 8, whole=True)


def of_ball(i: int, before: str, called: str) -> dict[str, Setting]:
    """Return the settings of ball `i`: its name, or its numbers.

    Whether a single ball is filled with air does not matter.
    """
    name = before or "ball_"
    return {
        name.rstrip("_"): Kind(str(i), f"{called}: a name of granular.balls", words=tuple(balls.BALLS)),
        before + "mass": Setting(f"m{i}", f"mass of {called} in kg", 1e-3, 2.0),
        before + "radius": Setting(f"r{i}", f"radius of {called} in m", 2e-3, 0.15),
        before + "duration": Setting(f"t{i}", f"duration of a bounce of {called} on the floor in s", 1e-5, 0.03),
        before + "restitution": Setting(f"e{i}", f"ε of {called} on the floor", 0.1, 1.0),
    } | ({before + "filled": Truth(f"air{i}", f"whether {called} is filled with air")} if before else {})


SCENE_SETTINGS: dict[str, dict[str, Setting]] = {
    "story": {"screen": Setting("screen", "screen of the story; 0 is the drop", 0, 6, whole=True)},
    "real-balls": {
        **of_ball(1, "lower_", "the lower ball"),
        **of_ball(2, "upper_", "the upper ball"),
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
    "bouncing-ball": {**of_ball(1, "", "the ball"), "height": HEIGHT_SETTING},
}
"""Settings of each scene, with the limits of ``physics/setups.mjs`` (tested)."""
PAGE_SCENES = tuple(SCENE_SETTINGS)
"""Scenes with which the page can open, and its story."""
COMMON_SETTINGS = {
    "language": Language("lang", "language of the page [the language of the browser]", words=LANGUAGES),
    "at": Setting("at", "initial time, as a fraction of the time shown", 0.0, 1.0),
}
LABORATORY_SETTINGS = {"predict": Truth("predict", "start with a question for a prediction")}


def settings(scene: str) -> dict[str, Setting]:
    """Return the settings of one of `PAGE_SCENES`."""
    own = SCENE_SETTINGS[check.choice("scene", scene, PAGE_SCENES)]
    return own | COMMON_SETTINGS | ({} if scene == "story" else LABORATORY_SETTINGS)


def link(scene: str, values: Mapping[str, Any]) -> str:
    """Return the initial state of the page as the query string of its link.

    Raises
    ------
    ValueError, TypeError
        If the scene or a name is unknown, or if the page cannot show a value.
    """
    known = settings(scene)
    begin: dict[str, Any] = {} if scene == "story" else {"scene": scene}
    check.known(values, known, f"setting of the page {scene}", TypeError)
    if scene == "story" and "at" in values:
        begin = {"screen": 0}
    given = [name for name in known if name in values]
    kinds_first = sorted(given, key=lambda name: not isinstance(known[name], Kind))  # numbers of a ball may differ
    for name in kinds_first:
        begin |= known[name].written(name, values[name])
    if "moving" in values:
        fix = "At least one ball has to be at rest."
        check.whole("moving", values["moving"], at_least=1, at_most=begin.get("n", DEFAULT_CRADLE_BALLS) - 1, fix=fix)
    return urlencode(begin)


def options() -> list[Option]:
    """Return all settings as options of the command line, with their scenes."""
    everywhere: dict[str, Setting] = {}
    for scene in PAGE_SCENES:
        everywhere = settings(scene) | everywhere
    return [Option(name, _kind(setting), None, _about(name, setting)) for name, setting in everywhere.items()]


def _about(name: str, setting: Setting) -> str:
    having = [scene for scene in PAGE_SCENES if name in settings(scene)]
    where = "" if len(having) >= len(PAGE_SCENES) - 1 else f" ({', '.join(having)})"
    return ("{" + ", ".join(setting.words) + "}: " if len(setting.words) in range(2, 7) else "") + setting.about + where


def _kind(setting: Setting) -> str:
    if isinstance(setting, Truth):
        return "bool"
    return "str" if setting.words else "int" if setting.whole else "float"

"""Stop conditions for both engines.

For example, ``simulate(..., until=until.contact(pair=0, nth=2))`` stops before the second contact with the floor. The
module also determines which scenes need a stop condition, and gives the advice for runs that a limit ended.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from granular._engine import check as _check, signature as _signature
from granular.scene.places import endless_reason

if TYPE_CHECKING:
    from granular.scene import Scene

__all__ = ["Contact", "Force", "Position", "Separated", "Speed", "contact", "force", "position", "separated", "speed"]
__dir__ = __all__.copy


class _Checked:
    """Base of stop conditions, which checks their numbers."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for name, check in FIELD_CHECKS[type(self).__name__].items():
            object.__setattr__(self, name, check(name, getattr(self, name)))


@_signature.face
@dataclass(frozen=True, slots=True)
class Contact(_Checked):
    """Condition to stop just before the `nth` contact of `pair` begins, see `contact`."""

    pair: int
    nth: int


@_signature.face
@dataclass(frozen=True, slots=True)
class Separated:
    """Condition to stop when all pairs have separated, see `separated`."""


@_signature.face
@dataclass(frozen=True, slots=True)
class Force(_Checked):
    """Condition to stop when the force of `pair` exceeds `above` in N, see `force`."""

    pair: int
    above: float


@_signature.face
@dataclass(frozen=True, slots=True)
class Speed(_Checked):
    """Condition to stop when the speed of `ball` exceeds `above` in m/s, see `speed`."""

    ball: int
    above: float


@_signature.face
@dataclass(frozen=True, slots=True)
class Position(_Checked):
    """Condition to stop when `ball` is above or below a position in m, see `position`."""

    ball: int
    above: float | None = None
    below: float | None = None

    def __post_init__(self) -> None:
        if (self.above is None) is (self.below is None):
            raise TypeError(f"One of `above` and `below` must be given, a position in m, got {self.above!r} and "
                            f"{self.below!r}.")
        _Checked.__post_init__(self)  # super() does not work in a dataclass with slots


Level = Force | Speed | Position
Until = Contact | Separated | Level
LEVEL_TYPES = (Force, Speed, Position)
CHECK_NUMBER, CHECK_LEVEL = _check.integer, partial(_check.number, at_least=0.0)
FIELD_CHECKS: dict[str, dict[str, Callable[[str, Any], Any]]] = {
    "Contact": {"pair": CHECK_NUMBER, "nth": partial(_check.integer, at_least=1)},
    "Force": {"pair": CHECK_NUMBER, "above": CHECK_LEVEL}, "Speed": {"ball": CHECK_NUMBER, "above": CHECK_LEVEL},
    "Position": {"ball": CHECK_NUMBER} | dict.fromkeys(
        ("above", "below"), lambda name, place: place if place is None else _check.number(name, place)),
}
"""Function that checks each field of the stop conditions, by class and field name."""


@_signature.face
def contact(pair: int, nth: int = 1) -> Contact:
    """Stop just before the `nth` contact of a pair begins.

    A contact begins when its force becomes positive. For soft spheres this happens when an overlap begins. It happens
    again when a force that was clipped at 0 becomes positive during the same overlap. The `nth` contact is neither
    logged nor counted.

    Parameters
    ----------
    pair : int
        Number of the pair from the bottom. If there is a floor, its pair is 0.
    nth : int
        Number of the contact, counted from 1. Defaults to 1.

    Returns
    -------
    Contact
    """
    return Contact(pair, nth)


@_signature.face
def separated() -> Separated:
    """Stop when no pair is in contact or approaches, after at least one contact.

    The balls can meet again later because of gravity, an external force or a driven wall.

    Returns
    -------
    Separated
    """
    return Separated()


@_signature.face
def force(pair: int, above: float) -> Force:
    """Stop when the contact force F of a pair first exceeds a level.

    The contact has not ended at that time. The condition detects the arrival of a wave, also in a chain of touching
    balls, where all contacts begin simultaneously. It applies to soft spheres only, because collisions of hard spheres
    are instantaneous.

    Parameters
    ----------
    pair : int
        Number of the pair from the bottom. If there is a floor, its pair is 0.
    above : float
        Level in N, not negative. If the force is larger at the start, the run stops immediately.

    Returns
    -------
    Force
    """
    return Force(pair, above)


@_signature.face
def speed(ball: int, above: float) -> Speed:
    """Stop when the speed abs(v) of a ball first exceeds a level.

    If a collision of hard spheres changes the speed to a larger value, the run stops right after this collision.

    Parameters
    ----------
    ball : int
        Number of the body from the bottom, as in `Scene`. A floor is body 0, and then the lowest ball is 1.
    above : float
        Level in m/s, not negative. If the speed is larger at the start, the run stops immediately.

    Returns
    -------
    Speed
    """
    return Speed(ball, above)


@_signature.face
def position(ball: int, above: float | None = None, *, below: float | None = None) -> Position:
    """Stop when the centre of a ball is first above or below a position.

    Either `above` or `below` is required.

    Parameters
    ----------
    ball : int
        Number of the body from the bottom, as in `Scene`. A floor is body 0, and then the lowest ball is 1.
    above, below : float
        Position x in m as in ``Trajectory.position``. On a ring it is not reduced by the length of the ring. If the
        condition holds at the start, the run stops immediately.

    Returns
    -------
    Position
    """
    return Position(ball, above, below)


def checked(until: Until | None, scene: Scene) -> Until | None:
    """Return the stop condition `until`, after checking that it applies to the scene.

    Raises
    ------
    TypeError, ValueError
        If `until` is not a stop condition, or if its pair or ball does not exist in the scene.
    """
    if until is None or isinstance(until, Separated):
        return until
    if not isinstance(until, (Contact, *LEVEL_TYPES)):
        raise TypeError(_check.misuse("until", until, "a condition from granular.until, such as until.contact(0, 2)"))
    name = f"of until.{type(until).__name__.lower()}"
    if isinstance(until, (Contact, Force)):
        _check.integer(f"`pair` {name}", until.pair, at_most=scene.n_pairs - 1, fix="The lowest pair is 0.")
    elif scene.is_wall[_check.integer(f"`ball` {name}", until.ball, at_most=scene.n - 1, fix="The lowest body is 0.")]:
        raise ValueError(f"`ball` {name} must be a ball, {int(scene.is_wall[0])} to "
                         f"{scene.n - 1 - int(scene.is_wall[-1])} in this scene, got {until.ball}, which is a wall.")
    return until


def refuse_levels(until: Until | None, function: str) -> None:
    """Raise `ValueError` if a stop condition is a level of force, speed or position.

    `function` is the name of the function that supports only `contact` and `separated`.
    """
    if isinstance(until, LEVEL_TYPES):
        raise ValueError(f"`until` must be until.contact or until.separated for {function}, got {until!r}. Or give "
                         "`t_end` in s.")


def check_end(
    scene: Scene, t_end: float | None, until: Until | None, max_events: int | None, *,
    dented: Callable[[], bool] = bool, elastic: Callable[[], bool] = bool, soft: bool = True,
) -> None:
    """Raise `ValueError` if a run could be infinite and has no stop condition.

    Parameters
    ----------
    scene : Scene
        The initial state.
    t_end, until, max_events : optional
        The stop conditions of the run, or None if not given.
    dented : callable
        Function that returns whether balls fall on a floor and dissipate energy only where an overlap exceeds all
        previous overlaps. It is called only if the run has no stop condition. By default it returns False.
    elastic : callable
        Function that returns whether all pairs are declared to be elastic, and no other option ends such a run. It is
        called only if the run has no stop condition. By default it returns False.
    soft : bool
        Whether a run of soft spheres is checked. Defaults to True.
    """
    if t_end is not None or until is not None or max_events is not None:
        return
    kind = "with a driven wall" if scene.driven else "with a thermal wall" if scene.heated else (
        "on a ring" if scene.ring else "of pendula" if scene.pendulum > 0.0 else
        "under gravity with laws that dissipate only at the largest overlap so far" if dented() else
        endless_reason(scene, soft) if elastic() else "")
    if kind:
        raise ValueError(f"`t_end` must be given, got None. A run {kind} does not end by itself. Give t_end=, until= "
                         "or max_events=.")


def raised(option: str, end: float) -> str:
    """Return the advice for a run that the limit `option` ended before `end` in s."""
    return f"raise {option}=" + ", or give t_end= or until=" * (end == math.inf)

"""Stop conditions, understood by both engines: ``simulate(..., until=until.contact(pair=0, nth=2))``.

Also which scenes need one, and which option raises the limit that ended a run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from granular._engine import check as _check
from granular.scene.places import unending

if TYPE_CHECKING:
    from granular.scene import Scene

__all__ = ["Contact", "Force", "Position", "Separated", "Speed", "contact", "force", "position", "separated", "speed"]
__dir__ = __all__.copy


class _Checked:
    """A condition whose numbers are checked, and plain."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for name, check in CHECKS[type(self).__name__].items():
            object.__setattr__(self, name, check(name, getattr(self, name)))


@_check.face
@dataclass(frozen=True, slots=True)
class Contact(_Checked):
    """Stop just before the `nth` contact of `pair` begins; see `contact`."""

    pair: int
    nth: int


@_check.face
@dataclass(frozen=True, slots=True)
class Separated:
    """Stop when everything has parted; see `separated`."""


@_check.face
@dataclass(frozen=True, slots=True)
class Force(_Checked):
    """Stop when the contact force of `pair` exceeds `above` in N; see `force`."""

    pair: int
    above: float


@_check.face
@dataclass(frozen=True, slots=True)
class Speed(_Checked):
    """Stop when the speed of `ball` exceeds `above` in m/s; see `speed`."""

    ball: int
    above: float


@_check.face
@dataclass(frozen=True, slots=True)
class Position(_Checked):
    """Stop when the position of `ball` is above or below a place in m; see `position`."""

    ball: int
    above: float | None = None
    below: float | None = None

    def __post_init__(self) -> None:
        if (self.above is None) is (self.below is None):
            raise TypeError(f"above is {self.above!r} and below is {self.below!r}: one of them is needed, a place "
                            "in m.")
        _Checked.__post_init__(self)  # super() is not known where a class has slots


Level = Force | Speed | Position
Until = Contact | Separated | Level
LEVELS = (Force, Speed, Position)
NUMBER, LEVEL = _check.whole, partial(_check.number, at_least=0.0)
CHECKS: dict[str, dict[str, Callable[[str, Any], Any]]] = {
    "Contact": {"pair": NUMBER, "nth": partial(_check.whole, at_least=1)},
    "Force": {"pair": NUMBER, "above": LEVEL}, "Speed": {"ball": NUMBER, "above": LEVEL},
    "Position": {"ball": NUMBER} | dict.fromkeys(
        ("above", "below"), lambda name, place: place if place is None else _check.number(name, place)),
}
"""What checks the numbers of each condition."""


@_check.face
def contact(pair: int, nth: int = 1) -> Contact:
    """Stop just before the `nth` onset (F ≠ 0) of a contact of `pair` acts.

    That contact is neither logged nor counted. A soft contact begins when the overlap crosses 0 upwards, and
    again when a clipped force becomes positive while the overlap is still there.

    Parameters
    ----------
    pair : int
        Number of the pair from the bottom; 0 is the floor's if there is one.
    nth : int
        Which onset, counted from 1.
    """
    return Contact(pair, nth)


@_check.face
def separated() -> Separated:
    """Stop when, after at least one contact, every pair is open and none approaches.

    That is said of the moment: gravity, a force or a driven wall may bring them together again.
    """
    return Separated()


@_check.face
def force(pair: int, above: float) -> Force:
    """Stop at the moment when the contact force F of `pair` first exceeds `above`, with the contact still open.

    This says when a push has arrived, also in a row of balls that touch, where every contact begins at once. Soft
    spheres only: the force of hard ones lasts for no time.

    Parameters
    ----------
    pair : int
        Number of the pair from the bottom; 0 is the floor's if there is one.
    above : float
        Level in N, not negative. It is met at once by a force that is larger at the start.
    """
    return Force(pair, above)


@_check.face
def speed(ball: int, above: float) -> Speed:
    """Stop at the moment when the speed abs(v) of `ball` first exceeds `above`, at a collision right after it.

    Parameters
    ----------
    ball : int
        Number of the body from the bottom, as in `Scene`: a floor is body 0, and the lowest ball then 1.
    above : float
        Level in m/s, not negative. It is met at once by a speed that is larger at the start.
    """
    return Speed(ball, above)


@_check.face
def position(ball: int, above: float | None = None, *, below: float | None = None) -> Position:
    """Stop at the moment when the centre of `ball` is first above a place, or below one.

    Parameters
    ----------
    ball : int
        Number of the body from the bottom, as in `Scene`: a floor is body 0, and the lowest ball then 1.
    above, below : float
        Place x in m, one of the two; as in ``Trajectory.position``, on a ring not taken modulo its length. It is met
        at once by a ball that is beyond it at the start.
    """
    return Position(ball, above, below)


def checked(until: Until | None, scene: Scene) -> Until | None:
    """Return `until` if it fits a scene, else raise."""
    if until is None or isinstance(until, Separated):
        return until
    if not isinstance(until, (Contact, *LEVELS)):
        raise TypeError(f"until is {until!r}: a condition from granular.until is needed, such as until.contact(0, 2).")
    name = f"of until.{type(until).__name__.lower()}"
    if isinstance(until, (Contact, Force)):
        _check.whole(f"pair {name}", until.pair, at_most=scene.n_pairs - 1, fix="pairs are numbered from 0")
    elif scene.is_wall[_check.whole(f"ball {name}", until.ball, at_most=scene.n - 1, fix="bodies are numbered from 0")]:
        raise ValueError(f"ball {name} is {until.ball}: that is a wall; balls of this scene are numbered from "
                         f"{int(scene.is_wall[0])} to {scene.n - 1 - int(scene.is_wall[-1])}.")
    return until


def without_levels(until: Until | None, who: str) -> None:
    """Raise where `who` knows contacts and parting only."""
    if isinstance(until, LEVELS):
        raise ValueError(f"until is {until!r}: {who} knows until.contact and until.separated only; give t_end in s.")


def check_end(
    scene: Scene, t_end: float | None, until: Until | None, max_events: int | None, *,
    dented: Callable[[], bool] = bool, elastic: Callable[[], bool] = bool,
) -> None:
    """Raise if no stop condition is given for a scene whose contacts never end.

    Parameters
    ----------
    scene : Scene
        The initial state.
    t_end, until, max_events : optional
        The stop conditions of the run; None if not given.
    dented : callable
        Returns whether balls fall on a floor and dissipate energy only where an overlap exceeds all overlaps before it.
        False by default. It is called only if no stop condition is given.
    elastic : callable
        Likewise, whether all pairs are elastic by declaration, and no option treats an inelastic collapse.
    """
    if t_end is not None or until is not None or max_events is not None:
        return
    why = "beside a driven wall" if scene.driven else "beside a thermal wall" if scene.heated else (
        "on a ring" if scene.ring else "of pendula" if scene.pendulum > 0.0 else
        "under gravity, and laws that lose nothing within a dent once made," if dented() else
        unending(scene) if elastic() else "")
    if why:
        raise ValueError(f"t_end is None: {why} a run never comes to an end by itself; give t_end, until, or a "
                         "max_events of your own.")


def raised(option: str, end: float) -> str:
    """Return what to change after a run until `end` in s that its limit `option` ended."""
    return f"raise {option}=" + ", or give t_end= or until=" * (end == math.inf)

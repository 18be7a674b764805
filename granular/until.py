"""Stop conditions, understood by both engines: ``simulate(..., until=until.contact(pair=0, nth=2))``.
May be skipped: two small records.
"""

from __future__ import annotations

from dataclasses import dataclass

from granular import _check

__all__ = ["Contact", "Separated", "contact", "separated"]
__dir__ = __all__.copy


@dataclass(frozen=True, slots=True)
class Contact:
    """Stop just before the `nth` contact of `pair` begins; see `contact`."""

    pair: int
    nth: int


@dataclass(frozen=True, slots=True)
class Separated:
    """Stop when everything has parted; see `separated`."""


Until = Contact | Separated


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
    return Contact(_check.whole("pair", pair), _check.whole("nth", nth, at_least=1))


def separated() -> Separated:
    """Stop when, after at least one contact, every pair is open and none approaches.

    That is said of the moment: gravity, a force or a driven wall may bring them together again.
    """
    return Separated()


def checked(until: Until | None, n_pairs: int) -> Until | None:
    """Return `until` if it fits a scene of `n_pairs` pairs, else raise."""
    if until is None or isinstance(until, Separated):
        return until
    if not isinstance(until, Contact):
        raise TypeError(f"until is {until!r}: a condition from granular.until is needed, such as until.contact(0, 2).")
    _check.whole("pair of until.contact", until.pair, at_most=n_pairs - 1, fix="pairs are numbered from 0")
    return until

"""Pairs in free flight: no force of their own and none on their bodies, so that everything is a closed form."""

from __future__ import annotations

import math
from typing import Any

from granular._flight import gap_after, rate_at_contact, time_to_contact
from granular._kernels import kernel
from granular.md.located.clock import since, tick
from granular.md.located.events import BEGIN, PART
from granular.md.located.records import OPEN, RESIDUAL

DRIFT = 4.0
"""Balls that close at less than this many times the noise of their rate are taken to drift along side by side."""


@kernel
def predict(pair: Any, law: Any) -> None:
    """Plan the flight of a free pair, a block of its own, to its next event.

    Contacts leave rates of rounding where the exact ones are zero: balls that stay together would meet again after
    some 1e12 s.
    """
    if pair.mode == OPEN and pair.pull == 0.0 and 0.0 < pair.eta <= DRIFT * pair.noise:
        pair.eta = 0.0
    wait, what = time_to_contact(max(0.0, -pair.xi), -pair.eta, pair.pull), BEGIN
    if pair.mode == RESIDUAL:
        wait, what = time_to_contact(pair.xi, pair.eta, -pair.pull), PART
        again = force_returns(pair, law) if law.s == 1.0 else math.inf
        if again < wait:
            wait, what = again, BEGIN
    pair.wait, pair.what = wait, what
    pair.due = pair.t + (wait + pair.tail)


@kernel
def force_returns(pair: Any, law: Any) -> float:
    """Return the time until φ = kξ + γη of a clipped pair rises to zero: -φ falls like a gap."""
    phi = 0.0 if pair.exact else law.k * pair.xi + law.gamma * pair.eta
    rise = law.k * pair.eta + law.gamma * pair.pull
    return time_to_contact(max(0.0, -phi), -rise, law.k * pair.pull)


@kernel
def glide(pair: Any, dt: float) -> None:
    """Advance a free pair by `dt`."""
    pair.xi = -gap_after(-pair.xi, -pair.eta, pair.pull, dt)
    pair.eta += pair.pull * dt
    if dt > 0.0:
        pair.exact = 0
    tick(pair, dt)


@kernel
def glide_to(pair: Any, t: float, tail: float) -> None:
    """Advance a free pair to the time t + tail."""
    dt = since(pair, t, tail)
    if dt > 0.0:
        glide(pair, dt)


@kernel
def arrive(pair: Any) -> None:
    """Advance a free pair to its event: exactly there, with the rate it has from the state, not from the time."""
    if pair.mode == OPEN:
        pair.eta = -rate_at_contact(max(0.0, -pair.xi), -pair.eta, pair.pull)
        pair.xi = 0.0
        tick(pair, pair.wait)
    else:
        glide(pair, pair.wait)

"""Soft spheres between two events, for whom watches a pair or a ball: when the next event is, and force or velocity
until then, as the pieces say.
May be skipped: stop conditions, no physics.

A run that is watched follows all contacts by pieces, but where those that disturb each other are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from granular._records import column, plain
from granular.md.located.pieces import elapsed, integral, since, tau_at, value
from granular.md.located.records import ACTIVE
from granular.until import Force, Level, Position


def calm(run: Any) -> tuple[float, float]:
    """Return the time in s up to which a run has got, and that of the next event."""
    now = max(run.now, run.request.start - run.start)
    if run.creep is not None:
        return run.start + now, math.inf
    clock = column(run.s.pairs, "t")  # which is ahead where a contact was solved at once
    soonest = min(float(column(run.s.queue[1:2], "due")[0]), clock[clock > now].min(initial=math.inf))
    return run.start + now, run.start + soonest


def motion(run: Any, level: Level) -> Callable[[float], float] | None:
    """Return force in N or velocity in m/s as a function of the time in s up to the next event; None for what only a
    row shows."""
    s, n, hung = run.s, run.scene.n_pairs, run.scene.pendulum > 0.0
    if run.creep is not None or isinstance(level, Position) or hung or (column(s.pairs, "lasts") > 0.0).any():
        return None
    if isinstance(level, Force):
        pushes = pushing(s, level.pair)
        return lambda t: max(0.0, value(pushes[0].f, tau_at(pushes[1], t - run.start, 0.0))) if pushes else 0.0
    (body,) = plain(s.bodies[level.ball : level.ball + 1])
    sides = [(1.0, level.ball - 1), (-1.0, level.ball)]
    pushed = [(sign, *pushing(s, c % n)) for sign, c in sides if (run.scene.ring or 0 <= c < n) and pushing(s, c % n)]

    def velocity(time: float) -> float:
        v, now = body.v - body.fall * since(body, time - run.start, 0.0), time - run.start
        for sign, member, block in pushed:
            q = block.clock
            v += sign * body.inverse_mass * elapsed(block.h, q, 1.0) * integral(member.f, q, tau_at(block, now, 0.0))
        return float(v)

    return velocity


def pushing(s: Any, c: int) -> tuple[Any, Any] | tuple[()]:
    """Return the records of pair `c` and of its block if its force acts."""
    (pair,) = plain(s.pairs[c : c + 1])
    if pair.slot < 0:
        return ()
    (member,), (first,) = plain(s.pool[pair.slot : pair.slot + 1]), plain(s.pairs[pair.first : pair.first + 1])
    return (member, plain(s.pool[first.slot : first.slot + 1])[0]) if member.mode == ACTIVE else ()

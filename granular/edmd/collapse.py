"""Detection of inelastic collapse.

A suspected collapse is followed in relative coordinates (`zoom`) and classified by a `Verdict`, or rejected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.flight import time_to_contact
from granular._engine.records import Records, column
from granular.edmd.clusters import press_again
from granular.edmd.physics import Physics
from granular.edmd.records import APART, BUDGET, LATER, RELATIVE_FIELDS, RESTS, SPENT, TINY, UNTIL, Log
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State, gaps
from granular.edmd.zoom import soonest, write_back, zoom
from granular.scene import Scene

SLICE_REACH = 64
"""Number of pairs on either side of the suspect in the slice."""
SLOW_RATE_FACTOR = 2.0**-20
"""Largest rate of a pair in a collapse, in units of the speed scale."""
NEGLIGIBLE_SPEED_FACTOR = 1e-12
"""Negligible speed, in units of the speed scale."""
ISOLATION_FACTOR = 64.0
"""Minimum isolation of a slow group.

A group is classified only if no pair outside collides within this many times the wait for its own next collision.
"""
UNDECIDED_FACTOR, CHECK_INTERVAL = 64, 16_384
"""Collisions in relative coordinates before an undecided slice is classified.

`UNDECIDED_FACTOR` is in units of the square of the number of pairs. After this number a slice can be classified by its
speeds, or by its bound if `max_events` ends the run. `CHECK_INTERVAL` is the number of collisions between two such
classifications.
"""


@dataclass(frozen=True)
class Verdict:
    """An inelastic collapse, or a possible one.

    Attributes
    ----------
    kind : str
        *exact*: infinitely many bounces of one ball on a wall, summed. *proved*: two pairs that alternate forever, or
        more pairs whose collision sequence repeats forever. *bounded*: it is not known whether the sequence is
        infinite, but no body involved will be faster than `bound`.
    first, last : int
        First and last pair involved.
    bound : float
        Largest possible speed in m/s of the bodies involved, relative to each other (to the wall), from now on. Valid
        unless another body hits them.
    """

    kind: str
    first: int
    last: int
    bound: float

    def where(self, scene: Scene) -> str:
        """Return the names of the pairs, such as "pair floor–1" or "pairs 1–2 to 4–5"."""
        first, last = scene.pairs.name(self.first), scene.pairs.name(self.last)
        return f"pair {first}" if self.first == self.last else f"pairs {first} to {last}"


def begin(state: State, queue: SortedQueue) -> None:
    """Follow the neighbourhood of the suspect in relative coordinates from now on.

    The suspect has just collided.
    """
    run, c, n = state.run, int(state.run.suspect), len(state.pairs)
    first, end = max(0, c - SLICE_REACH), min(n, c + SLICE_REACH + 1)
    if state.ring:
        whole = n <= 2 * SLICE_REACH + 1  # the largest gap comes last, and no collapse extends across it
        first = (int(np.argmax(state.row(run.now)[1])) + 1 if whole else c - SLICE_REACH) % n
        end = first + min(n, 2 * SLICE_REACH + 1)
    state.set(first=first, began=run.now, elapsed=0.0, looked=0, ordinary=0, clamped=0, faint=0)
    state.clock.zooms += 1
    # A run with that many undecided collisions is classified again after each `CHECK_INTERVAL`.
    if run.zoomed >= UNDECIDED_FACTOR * (end - first) ** 2:
        run.allowance = CHECK_INTERVAL
    state.near = near = np.zeros(end - first, RELATIVE_FIELDS)
    pairs, bodies = state.slices()
    u, noise = column(bodies, "fall_velocity"), column(bodies, "noise")
    pull, at = column(pairs, "closing_acceleration"), column(pairs, "at")
    rate = (np.diff(u) - pull * at) - pull * (run.now - at)
    # A closing rate below its noise has an uncertain sign.
    rounding = (pull == 0.0) & (rate < 0.0) & (rate * rate < noise[:-1] + noise[1:])
    near["gap"], near["rate"] = gaps(pairs, u, run.now, True), np.where(rounding, 0.0, rate)
    near["rate"][(c - first) % n] = run.rebound
    state.near = queue.hold(near)


def advance_slice(
    state: State, physics: Physics, queue: SortedQueue, limit: float, budget: int, log: Log | None
) -> tuple[int, Verdict | None]:
    """Advance the slice until time `limit`.

    Returns the reason of the pause, and a verdict if the slice ends with one.
    """
    run, near, seen = state.run, state.near, state.run.events
    assert near is not None
    rows = None if log is None else queue.rows(budget)
    run.room = min(queue.soonest(run.first, run.first + len(near) - 1), state.clock.window) - run.began
    run.edge, run.budget = limit, budget if rows is None else len(rows)
    slices = state.slices()
    end: int = queue.use(zoom)(run, near, *slices, physics.rule, rows, state.walls)
    state.put(*slices)
    wait = queue.use(soonest)(run, near, slices[0])[1] if end == UNTIL else 0.0
    run.now = run.began + (run.elapsed + wait)
    if log is not None and rows is not None:
        log.append(queue.kept(rows[: run.events - seen]))
    if end in (LATER, UNTIL, BUDGET):
        return end, None
    verdict = Verdict("exact", int(run.suspect), int(run.suspect), 0.0) if end == RESTS else None
    if end in (TINY, SPENT):
        verdict = judged(state, physics)
        # A spent allowance alone is not a collapse: the bound must also be negligible.
        if verdict is None or not (end == TINY or verdict.bound < 1e-9 * state.clock.speed):
            verdict = None
            if end == SPENT and run.zoomed >= UNDECIDED_FACTOR * len(near) ** 2:
                run.allowance = run.looked + CHECK_INTERVAL
                verdict = _faint(state, physics)
                if verdict is None:
                    return end, None
            else:
                # Undecided: suspect less often, and allow twice as many collisions next time.
                run.short = math.ldexp(run.short, -4)
                run.allowance *= 2
    if verdict is not None and verdict.kind == "bounded":
        verdict = _proved(state, physics, verdict)
    finish(state, queue)
    if end == RESTS and state.walls is not None:
        queue.use(press_again)(run, state.pairs, state.bodies, 0, len(state.pairs) - 1, state.walls)
    return UNTIL if run.stop_pair == APART and queue.apart() else end, verdict


def finish(state: State, queue: SortedQueue) -> None:
    """End the use of relative coordinates and write the slice back into the state.

    Counts the rates that velocities cannot represent.
    """
    put_back(state, queue)
    run, near = state.run, state.near
    assert near is not None
    if run.looked > 0:
        (pairs, bodies), rate = state.slices(), column(near, "rate")
        stored = np.diff(column(bodies, "fall_velocity")) - column(pairs, "closing_acceleration") * column(pairs, "at")
        # A rate is lost if velocities reproduce it with an error above 50 %.
        state.clock.lost += int((np.abs(stored - rate) > 0.5 * np.abs(rate)).sum())
        queue.refresh(run.first, run.first + len(near) - 1)
    run.clamps += run.clamped
    state.near = None


def put_back(state: State, queue: SortedQueue) -> None:
    """Write the gaps and velocities of the slice back into the state."""
    slices = state.slices()
    queue.use(write_back)(state.run, state.near, *slices)
    state.put(*slices)


def bound(state: State, physics: Physics) -> Verdict | None:
    """Return a verdict on the slow pairs of an unfinished slice, or None.

    The verdict must have a finite bound.
    """
    if state.near is None or state.run.looked == 0:
        return None
    verdict = judged(state, physics, collided=int(np.argmin(column(state.near, "gap"))))
    return verdict if verdict is not None and math.isfinite(verdict.bound) else None


def left(state: State, physics: Physics) -> Verdict | None:
    """Return `bound` for a slice that can end a run, or None.

    The slice must have had many collisions, and no other event may be due soon.
    """
    if state.near is None or state.run.zoomed < UNDECIDED_FACTOR * len(state.near) ** 2:
        return None
    verdict = bound(state, physics)
    return verdict if verdict is not None and _is_alone(state, verdict) else None


def slowing(run: Any, events: int) -> str:
    """Return message text on a run that slowed down before its limit, or ""."""
    text = ""
    if len(run.pace) == 2:
        (begin, start), (tail, t) = run.pace
        last, took = events - tail, run.time() - t
        # The events of the last part came ten times as fast as those before.
        if last > 0 and took * (tail - begin) < 0.1 * last * (t - start):
            text = (f"; the last {last} collisions took only {took:.3g} s: the balls cluster and slow down, perhaps "
                    "forever; use collapse='merge', tc= or elastic_below=")
        found = bound(run.state, run.physics)
        if found is not None:
            text += (f"; unless hit from outside, no body of {found.where(run.scene)} will be faster than "
                     f"{found.bound:.2g} m/s")
    return text


def _faint(state: State, physics: Physics) -> Verdict | None:
    """Return a verdict on the longest group with negligible speeds, or None.

    The group contains the suspect. The condition must hold in two consecutive tests. Otherwise the end of a finite
    sequence would be classified as a collapse.
    """
    # Each step lowers the limit of slow rates by 2^4, down to 2^-56 of the scale.
    for k in range(0, 40, 4):
        verdict = judged(state, physics, SLOW_RATE_FACTOR * 2.0**-k)
        if verdict is None:
            break
        if verdict.bound < NEGLIGIBLE_SPEED_FACTOR * state.clock.speed and _is_alone(state, verdict):
            state.run.faint += 1
            return verdict if state.run.faint >= 2 else None
    state.run.faint = 0
    return None


def _proved(state: State, physics: Physics, verdict: Verdict) -> Verdict:
    """Return the verdict *proved* if pairs of a *bounded* verdict collide forever.

    The proof requires that no other pair collides within the remaining time, even if it approaches faster by twice the
    bound. Without a proof the given verdict is returned.
    """
    run, near, (pairs, bodies), n = state.run, state.near, state.slices(), len(state.pairs)
    low, high = ((k - int(run.first)) % n for k in (verdict.first, verdict.last))
    end, pull = high + 1, column(pairs, "closing_acceleration")
    resting = (column(bodies, "is_free") == 0.0) & np.isfinite(column(bodies, "mass")) & (run.gravity > 0.0)
    if physics.rule is not None or state.walls is not None or pull[low:end].any() or resting[low : end + 1].any():
        return verdict
    from granular.edmd.proof import forever  # rarely needed

    gap, rate = column(near, "gap"), column(near, "rate")
    found = forever(pairs[low:end], gap[low:end], rate[low:end])
    if found is None:
        return verdict
    low, end = low + found.first, low + found.last + 1
    wait = list(map(time_to_contact, gap.tolist(), (rate - 2.0 * verdict.bound).tolist(), pull.tolist()))
    if not found.left < min([*wait[:low], *wait[end:], float(run.room - run.elapsed)]):
        return verdict
    return Verdict("proved", (int(run.first) + low) % n, (int(run.first) + end - 1) % n, verdict.bound)


def _is_alone(state: State, verdict: Verdict) -> bool:
    """Return whether a group collides many times before any other pair does."""
    columns = column(state.near, "gap"), column(state.near, "rate"), column(state.slices()[0], "closing_acceleration")
    wait = list(map(time_to_contact, *(x.tolist() for x in columns)))
    first, last = ((k - state.run.first) % len(state.pairs) for k in (verdict.first, verdict.last))
    return min(wait[:first] + wait[last + 1 :], default=math.inf) > ISOLATION_FACTOR * min(wait[first : last + 1])


def judged(
    state: State, physics: Physics, share: float = SLOW_RATE_FACTOR, collided: int | None = None
) -> Verdict | None:
    """Return a verdict on the neighbours of the suspect with slow rates, or None.

    Rates are slow if they are below `share` of the speed scale. The verdict is *proved* for two alternating pairs, else
    *bounded*. If `collided` is given, this pair of the slice replaces the suspect.
    """
    run, gap, rate = state.run, column(state.near, "gap"), column(state.near, "rate")
    tiny = state.clock.speed * share
    # Slow pairs must also be close: within the distance of a slow rate during a window.
    slow = (np.abs(rate) < tiny) & (gap < tiny * state.clock.window)
    if state.walls is not None:
        slow &= column(state.slices()[0], "heat") < 0
    low = high = j = int(run.suspect - run.first) % len(state.pairs) if collided is None else collided
    while low > 0 and slow[low - 1]:
        low -= 1
    while high + 1 < len(slow) and slow[high + 1]:
        high += 1
    (pairs, bodies), end = state.slices(), high + 1
    pairs, bodies = pairs[low:end], bodies[low : end + 1]
    pulled = bool((column(pairs, "closing_acceleration")[[0, -1]] > 0.0).any())
    if low == high and (not pulled or (physics.rule is None and math.isinf(max(column(bodies, "mass"))))):
        return None  # Two free bodies collide once, and the bounces of a single ball on a wall are summed.
    kind, speed = "bounded", largest_speed(bodies, gap[low:end], rate[low:end], run.gravity)
    if physics.scene.external_force is not None:
        speed = largest_speed_under_forces(bodies, gap[low:end], rate[low:end], run.gravity)
    if high == low + 1 and not pulled and physics.rule is None and alternates(pairs, rate[low], rate[high], j == low):
        kind = "proved"
    first, n = int(run.first), len(state.pairs)
    return Verdict(kind, (first + low) % n, (first + high) % n, speed)


def largest_speed(bodies: Records, gap: Array, rate: Array, gravity: float) -> float:
    """Return √(2E/m_min) in m/s, an upper bound of the speed of each body.

    The bound holds until another body hits the group. E is the energy of its bodies relative to their wall (with
    gravity), or to their centre of mass without a wall.
    """
    mass = np.ascontiguousarray(column(bodies, "mass"))
    ball = np.isfinite(mass)
    velocity = np.concatenate([[0.0], np.cumsum(rate)])
    height = np.concatenate([[0.0], np.cumsum(gap)])
    if ball.all():
        velocity -= (mass @ velocity) / mass.sum()
        height = np.zeros_like(height)  # all balls fall together
    elif ball[0]:
        velocity -= velocity[-1]
        if gravity > 0.0:
            return math.inf  # the balls fall off the ceiling
    energy = 0.5 * mass[ball] @ velocity[ball] ** 2 + gravity * (mass[ball] @ height[ball])
    return math.sqrt(2.0 * float(energy) / float(mass[ball].min()))


def largest_speed_under_forces(bodies: Records, gap: Array, rate: Array, gravity: float) -> float:
    """Return the bound of `largest_speed` with external forces.

    The result is inf if the forces pull the group apart somewhere. The potential energy is the sum of gap times
    pressing force, where the pressing force of a pair is that of all bodies resting on each other.
    """
    mass = np.array(column(bodies, "mass"))
    ball = np.isfinite(mass)
    fall = np.where(ball, gravity, 0.0) - column(bodies, "force_acceleration")
    velocity = np.concatenate([[0.0], np.cumsum(rate)])
    mass[~ball] = 0.0
    if ball.all():
        velocity -= (mass @ velocity) / mass.sum()
        fall -= (mass @ fall) / mass.sum()
    elif ball[0]:
        velocity -= velocity[-1]
    weight = mass * fall
    pressing = -np.cumsum(weight)[:-1] if ball[0] and not ball[-1] else np.cumsum(weight[::-1])[::-1][1:]
    if (pressing < 0.0).any():
        return math.inf
    return math.sqrt(2.0 * float(0.5 * mass @ velocity**2 + pressing @ gap) / float(mass[ball].min()))


def alternates(pairs: Records, rate_a: float, rate_b: float, lower_collided: bool) -> bool:
    """Return whether two pairs collide in turn forever.

    The pairs have constant restitution and collide only with each other. Two collisions map the ratio of the rates by a
    Möbius map. The pairs alternate forever if its fixed points are real and the ratio lies on the right side of the
    unstable fixed point.
    """
    e1, e2 = column(pairs, "eps").tolist()
    onto_lower = column(pairs, "low")[1] * (1.0 + e2)  # rate change of the lower pair per rate of the upper
    onto_upper = column(pairs, "high")[0] * (1.0 + e1)
    p, q, opening, closing = onto_lower, onto_upper, rate_a, -rate_b
    if not lower_collided:
        p, q, e1, e2, opening, closing = q, p, e2, e1, rate_b, -rate_a
    trace, det = p * q - e1 - e2, e1 * e2
    if not (opening > 0.0 and closing > 0.0 and trace > 0.0 and trace * trace >= 4.0 * det):
        return False
    unstable = 0.5 * (trace - math.sqrt(trace * trace - 4.0 * det))
    return bool(opening < (p * q - e2 - unstable) / q * closing)

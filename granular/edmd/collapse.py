"""Is it an inelastic collapse? The suspects of the event loop are looked at closely, and a verdict is given or not."""

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
from granular.edmd.records import APART, BUDGET, LATER, NEAR, RESTS, SPENT, TINY, UNTIL, Log
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State, gaps
from granular.edmd.zoom import soonest, write_back, zoom

REACH = 64
"""Pairs looked at on each side of a suspect."""
SLOW = 2.0**-20
"""Rates below this, in units of the scale, make a pair part of a collapse."""
ROUNDING = 1e-12
"""Speeds below this, in units of the scale, count for nothing."""
ALONE = 64.0
"""Such a run is judged while nothing outside collides for so many times the wait for its own next collision."""
PATIENCE, STEP = 64, 16_384
"""Collisions looked at closely, in units of the square of the pairs looked at, before a run may be judged by that (or,
where `max_events` ends it, by the bound it has got to); and how many lie between two such judgements."""


@dataclass(frozen=True)
class Verdict:
    """An inelastic collapse, or what may be one.

    Attributes
    ----------
    kind : str
        *exact*: infinitely many bounces of one ball on a wall, summed; *proved*: two pairs that alternate forever, or
        more whose word of collisions repeats forever; *bounded*: no collapse, for nobody knows whether it is infinite,
        but no body involved will be faster than `bound`.
    first, last : int
        The pairs involved.
    bound : float
        Largest possible speed in m/s of the bodies involved, relative to each other (to the wall), from now on,
        unless another body hits them.
    """

    kind: str
    first: int
    last: int
    bound: float

    def __str__(self) -> str:
        return f"pair {self.first}" if self.first == self.last else f"pairs {self.first} to {self.last}"


def begin(state: State, queue: SortedQueue) -> None:
    """Look closely at the neighbourhood of the suspect, which has just collided, from now on."""
    run, c, n = state.run, int(state.run.suspect), len(state.pairs)
    first, end = max(0, c - REACH), min(n, c + REACH + 1)
    if state.ring:
        whole = n <= 2 * REACH + 1  # then the largest gap is last, and no collapse reaches across it
        first = (int(np.argmax(state.row(run.now)[1])) + 1 if whole else c - REACH) % n
        end = first + min(n, 2 * REACH + 1)
    state.set(first=first, began=run.now, elapsed=0.0, looked=0, ordinary=0, clamped=0, faint=0)
    state.clock.zooms += 1
    if run.zoomed >= PATIENCE * (end - first) ** 2:
        run.allowance = STEP
    state.near = near = np.zeros(end - first, NEAR)
    pairs, bodies = state.slices()
    u, noise = column(bodies, "fall_velocity"), column(bodies, "noise")
    pull, at = column(pairs, "closing_acceleration"), column(pairs, "at")
    rate = (np.diff(u) - pull * at) - pull * (run.now - at)
    rounding = (pull == 0.0) & (rate < 0.0) & (rate * rate < noise[:-1] + noise[1:])
    near["gap"], near["rate"] = gaps(pairs, u, run.now, True), np.where(rounding, 0.0, rate)
    near["rate"][(c - first) % n] = run.rebound
    state.near = queue.hold(near)


def look(
    state: State, physics: Physics, queue: SortedQueue, limit: float, budget: int, log: Log | None
) -> tuple[int, Verdict | None]:
    """Go on with a closer look until time `limit`; return why it pauses, and the verdict if it ends with one."""
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
        if verdict is None or not (end == TINY or verdict.bound < 1e-9 * state.clock.speed):
            verdict = None
            if end == SPENT and run.zoomed >= PATIENCE * len(near) ** 2:
                run.allowance = run.looked + STEP
                verdict = _faint(state, physics)
                if verdict is None:
                    return end, None
            else:
                run.short = math.ldexp(run.short, -4)
                run.allowance *= 2
    if verdict is not None and verdict.kind == "bounded":
        verdict = _proved(state, physics, verdict)
    finish(state, queue)
    if end == RESTS and state.walls is not None:
        queue.use(press_again)(run, state.pairs, state.bodies, 0, len(state.pairs) - 1, state.walls)
    return UNTIL if run.stop_pair == APART and queue.apart() else end, verdict


def finish(state: State, queue: SortedQueue) -> None:
    """End a closer look: put its pairs back into the state, and count the rates that velocities cannot hold."""
    put_back(state, queue)
    run, near = state.run, state.near
    assert near is not None
    if run.looked > 0:
        (pairs, bodies), rate = state.slices(), column(near, "rate")
        held = np.diff(column(bodies, "fall_velocity")) - column(pairs, "closing_acceleration") * column(pairs, "at")
        state.clock.lost += int((np.abs(held - rate) > 0.5 * np.abs(rate)).sum())
        queue.refresh(run.first, run.first + len(near) - 1)
    run.clamps += run.clamped
    state.near = None


def put_back(state: State, queue: SortedQueue) -> None:
    """Put gaps and velocities of the pairs looked at back into the state."""
    slices = state.slices()
    queue.use(write_back)(state.run, state.near, *slices)
    state.put(*slices)


def bound(state: State, physics: Physics) -> Verdict | None:
    """Return what can be said of the slow pairs of a closer look that is not over."""
    if state.near is None or state.run.looked == 0:
        return None
    verdict = judged(state, physics, collided=int(np.argmin(column(state.near, "gap"))))
    return verdict if verdict is not None and math.isfinite(verdict.bound) else None


def left(state: State, physics: Physics) -> Verdict | None:
    """Return the same of one that has lasted long, if nothing else is due soon: what a run may end with for good."""
    if state.near is None or state.run.zoomed < PATIENCE * len(state.near) ** 2:
        return None
    verdict = bound(state, physics)
    return verdict if verdict is not None and _is_alone(state, verdict) else None


def slowing(run: Any, events: int) -> str:
    """Return what shows that a run that was cut off was slowing down, if anything does."""
    said = ""
    if len(run.pace) == 2:
        (begin, start), (tail, t) = run.pace
        last, took = events - tail, run.time() - t
        if last > 0 and took * (tail - begin) < 0.1 * last * (t - start):
            said = (f"; the last {last} of them took only {took:.3g} s: the balls cluster and slow down, perhaps "
                    "without end. Remedies by name: collapse='merge', tc=, elastic_below=")
        found = bound(run.state, run.physics)
        if found is not None:
            said += f"; unless hit from outside, no body of {found} will exceed {found.bound:.2g} m/s"
    return said


def _faint(state: State, physics: Physics) -> Verdict | None:
    """Return the verdict on the longest run about the suspect whose speeds will count for nothing, if there is one.

    It must be so twice in a row, or the end of a finite sequence would be taken for a collapse.
    """
    for k in range(0, 40, 4):
        verdict = judged(state, physics, SLOW * 2.0**-k)
        if verdict is None:
            break
        if verdict.bound < ROUNDING * state.clock.speed and _is_alone(state, verdict):
            state.run.faint += 1
            return verdict if state.run.faint >= 2 else None
    state.run.faint = 0
    return None


def _proved(state: State, physics: Physics, verdict: Verdict) -> Verdict:
    """Return the verdict *proved* on those pairs of a *bounded* one that collide forever, if they are shown to.

    No pair but them may collide within the time that is left, though it has come closer by twice the bound.
    """
    run, near, (pairs, bodies), n = state.run, state.near, state.slices(), len(state.pairs)
    low, high = ((k - int(run.first)) % n for k in (verdict.first, verdict.last))
    end, pull = high + 1, column(pairs, "closing_acceleration")
    resting = (column(bodies, "is_free") == 0.0) & np.isfinite(column(bodies, "mass")) & (run.gravity > 0.0)
    if physics.rule is not None or state.walls is not None or pull[low:end].any() or resting[low : end + 1].any():
        return verdict
    from granular.edmd.proof import forever  # seldom needed

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
    """Return whether no pair outside a run collides before it has had time for many collisions of its own."""
    columns = column(state.near, "gap"), column(state.near, "rate"), column(state.slices()[0], "closing_acceleration")
    wait = list(map(time_to_contact, *(x.tolist() for x in columns)))
    first, last = ((k - state.run.first) % len(state.pairs) for k in (verdict.first, verdict.last))
    return min(wait[:first] + wait[last + 1 :], default=math.inf) > ALONE * min(wait[first : last + 1])


def judged(state: State, physics: Physics, share: float = SLOW, collided: int | None = None) -> Verdict | None:
    """Return what can be said of the neighbours of the suspect with rates below `share` of the scale.

    Proved of two pairs, bounded, or nothing. `collided`, a pair of the slice, stands for the suspect if it is given.
    """
    run, gap, rate = state.run, column(state.near, "gap"), column(state.near, "rate")
    tiny = state.clock.speed * share
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
        return None  # two free bodies collide once; the bounces of a ball alone on a wall are summed
    kind, speed = "bounded", largest_speed(bodies, gap[low:end], rate[low:end], run.gravity)
    if physics.scene.external_force is not None:
        speed = largest_speed_under_forces(bodies, gap[low:end], rate[low:end], run.gravity)
    if high == low + 1 and not pulled and physics.rule is None and alternates(pairs, rate[low], rate[high], j == low):
        kind = "proved"
    first, n = int(run.first), len(state.pairs)
    return Verdict(kind, (first + low) % n, (first + high) % n, speed)


def largest_speed(bodies: Records, gap: Array, rate: Array, gravity: float) -> float:
    """Return √(2E/m_min) in m/s, which no body of a run of pairs exceeds while nobody hits the run.

    E is the energy of its bodies relative to the wall among them (with gravity), else to their centre of mass.
    """
    mass = np.ascontiguousarray(column(bodies, "mass"))
    ball = np.isfinite(mass)
    velocity = np.concatenate([[0.0], np.cumsum(rate)])
    height = np.concatenate([[0.0], np.cumsum(gap)])
    if ball.all():
        velocity -= (mass @ velocity) / mass.sum()
        height = np.zeros_like(height)  # they fall together
    elif ball[0]:
        velocity -= velocity[-1]
        if gravity > 0.0:
            return math.inf  # they fall off the ceiling
    energy = 0.5 * mass[ball] @ velocity[ball] ** 2 + gravity * (mass[ball] @ height[ball])
    return math.sqrt(2.0 * float(energy) / float(mass[ball].min()))


def largest_speed_under_forces(bodies: Records, gap: Array, rate: Array, gravity: float) -> float:
    """Return the same where forces act too; inf if they pull the run apart somewhere.

    What presses a pair together, were all of them at rest on each other, does the work of its gap.
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
    """Return whether two pairs of constant restitution, free except for each other, collide in turn forever.

    Two collisions map the ratio of the rates by a Möbius map; forever means that its fixed points are real and the
    ratio lies on the right side of the unstable one.
    """
    e1, e2 = column(pairs, "eps").tolist()
    onto_lower = column(pairs, "low")[1] * (1.0 + e2)  # what a collision of the upper pair gives the rate of the lower
    onto_upper = column(pairs, "high")[0] * (1.0 + e1)
    p, q, opening, closing = onto_lower, onto_upper, rate_a, -rate_b
    if not lower_collided:
        p, q, e1, e2, opening, closing = q, p, e2, e1, rate_b, -rate_a
    trace, det = p * q - e1 - e2, e1 * e2
    if not (opening > 0.0 and closing > 0.0 and trace > 0.0 and trace * trace >= 4.0 * det):
        return False
    unstable = 0.5 * (trace - math.sqrt(trace * trace - 4.0 * det))
    return bool(opening < (p * q - e2 - unstable) / q * closing)

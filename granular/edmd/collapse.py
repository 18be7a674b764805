"""Detection of inelastic collapse: infinitely many collisions in a finite time.

After a suspicious collision, the neighbouring pairs (the *slice*) are followed in relative coordinates
(`advance_relative`). The collisions are then classified by a `Verdict`, or the suspicion is rejected and the run
continues. The terms slice and epoch are defined in `granular.edmd.motion`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.flight import time_to_contact
from granular._engine.records import Records, column
from granular.edmd.clusters import recompute_closing
from granular.edmd.physics import Physics
from granular.edmd.records import APART, BUDGET, LATER, RELATIVE_FIELDS, RESTS, SPENT, TINY, UNTIL, Log
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State, gaps
from granular.edmd.zoom import advance_relative, next_collision, write_back
from granular.scene import Scene

SLICE_REACH = 64
"""Number of pairs in the slice on either side of the suspected pair."""
SLOW_RATE_FACTOR = 2.0**-20
"""Rate below which a pair is slow, in units of the speed scale."""
NEGLIGIBLE_SPEED_FACTOR = 1e-12
"""Speed that is negligible, in units of the speed scale."""
ISOLATION_FACTOR = 64.0
"""Minimum ratio of times for the isolation of a group of slow pairs.

The next collision of any pair outside the group must be later than this many times the time until the next collision
of the group. Otherwise the group is not classified.
"""
UNDECIDED_FACTOR, CHECK_INTERVAL = 64, 16_384
"""Numbers of collisions in relative coordinates after which a slice is classified.

After `UNDECIDED_FACTOR` times the squared number of pairs, a slice without a decision can be classified by its speeds.
If `max_events` ends the run, it can be classified by a bound of its speeds. `CHECK_INTERVAL` is the number of
collisions between two such attempts.
"""


@dataclass(frozen=True)
class Verdict:
    """Classification of an inelastic collapse, or of a possible collapse.

    Attributes
    ----------
    kind : str
        *exact*: infinitely many bounces of one ball on a wall, whose sum is known. *proved*: two pairs that alternate
        forever, or more pairs whose collision sequence repeats forever. *bounded*: it is not known whether the
        collisions are infinitely many, but no body involved will be faster than `bound`.
    first, last : int
        First and last pair involved.
    bound : float
        Upper bound of the later speeds of the bodies involved in m/s, relative to their wall or to their centre of
        mass. It is valid until another body hits them.
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
    """Start relative coordinates for the pairs around the suspected pair.

    The suspected pair, `run.suspect`, has just collided.
    """
    run, c, n = state.run, int(state.run.suspect), len(state.pairs)
    first, end = max(0, c - SLICE_REACH), min(n, c + SLICE_REACH + 1)
    if state.ring:
        is_whole_ring = n <= 2 * SLICE_REACH + 1  # the largest gap comes last, and no collapse extends across it
        first = (int(np.argmax(state.row(run.now)[1])) + 1 if is_whole_ring else c - SLICE_REACH) % n
        end = first + min(n, 2 * SLICE_REACH + 1)
    state.set(first=first, began=run.now, elapsed=0.0, looked=0, ordinary=0, clamped=0, faint=0)
    state.clock.zooms += 1
    # A run with that many undecided collisions is classified again after each `CHECK_INTERVAL`.
    if run.zoomed >= UNDECIDED_FACTOR * (end - first) ** 2:
        run.allowance = CHECK_INTERVAL
    state.near = near = np.zeros(end - first, RELATIVE_FIELDS)
    pairs, bodies = state.slices()
    u, noise = column(bodies, "fall_velocity"), column(bodies, "noise")
    closing, at = column(pairs, "closing_acceleration"), column(pairs, "at")
    rate = (np.diff(u) - closing * at) - closing * (run.now - at)
    # A closing rate below its noise has an uncertain sign.
    is_rounding = (closing == 0.0) & (rate < 0.0) & (rate * rate < noise[:-1] + noise[1:])
    near["gap"], near["rate"] = gaps(pairs, u, run.now, True), np.where(is_rounding, 0.0, rate)
    near["rate"][(c - first) % n] = run.rebound
    state.near = queue.convert(near)


def advance_slice(
    state: State, physics: Physics, queue: SortedQueue, limit: float, budget: int, log: Log | None
) -> tuple[int, Verdict | None]:
    """Advance the slice until `limit` (s since the epoch), and classify it at its end.

    At most `budget` collisions are processed and appended to `log`. Returns the reason of the pause, and a `Verdict` or
    None.
    """
    run, near, seen = state.run, state.near, state.run.events
    assert near is not None
    rows = None if log is None else queue.rows(budget)
    run.room = min(queue.soonest(run.first, run.first + len(near) - 1), state.clock.window) - run.began
    run.edge, run.budget = limit, budget if rows is None else len(rows)
    slices = state.slices()
    end: int = queue.specialise(advance_relative)(run, near, *slices, physics.rule, rows, state.walls)
    state.write_slice(*slices)
    wait = queue.specialise(next_collision)(run, near, slices[0])[1] if end == UNTIL else 0.0
    run.now = run.began + (run.elapsed + wait)
    if log is not None and rows is not None:
        log.append(queue.filled_rows(rows[: run.events - seen]))
    if end in (LATER, UNTIL, BUDGET):
        return end, None
    verdict = Verdict("exact", int(run.suspect), int(run.suspect), 0.0) if end == RESTS else None
    if end in (TINY, SPENT):
        verdict = slow_pairs_verdict(state, physics)
        # A spent allowance alone is not a collapse: the bound must also be negligible.
        if verdict is None or not (end == TINY or verdict.bound < 1e-9 * state.clock.speed):
            verdict = None
            if end == SPENT and run.zoomed >= UNDECIDED_FACTOR * len(near) ** 2:
                run.allowance = run.looked + CHECK_INTERVAL
                verdict = _negligible_speed_verdict(state, physics)
                if verdict is None:
                    return end, None
            else:
                # Undecided: suspect less often, and allow twice as many collisions next time.
                run.short = math.ldexp(run.short, -4)
                run.allowance *= 2
    if verdict is not None and verdict.kind == "bounded":
        verdict = _proved_verdict(state, physics, verdict)
    end_slice(state, queue)
    if end == RESTS and state.walls is not None:
        queue.specialise(recompute_closing)(run, state.pairs, state.bodies, 0, len(state.pairs) - 1, state.walls)
    return UNTIL if run.stop_pair == APART and queue.all_recede() else end, verdict


def end_slice(state: State, queue: SortedQueue) -> None:
    """End relative coordinates and write the slice back into the state.

    Rates that the fall velocities cannot represent are counted in `clock.lost`.
    """
    write_slice_back(state, queue)
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


def write_slice_back(state: State, queue: SortedQueue) -> None:
    """Write the gaps and velocities of the slice into the records of the state."""
    slices = state.slices()
    queue.specialise(write_back)(state.run, state.near, *slices)
    state.write_slice(*slices)


def bounded_verdict(state: State, physics: Physics) -> Verdict | None:
    """Return a `Verdict` with a finite bound on the slow pairs of the slice, or None.

    The pairs are those around the pair with the smallest gap. The slice can be undecided.
    """
    if state.near is None or state.run.looked == 0:
        return None
    verdict = slow_pairs_verdict(state, physics, collided=int(np.argmin(column(state.near, "gap"))))
    return verdict if verdict is not None and math.isfinite(verdict.bound) else None


def verdict_at_limit(state: State, physics: Physics) -> Verdict | None:
    """Return the `Verdict` on a slice at which `max_events` ends a run, or None.

    It is the result of `bounded_verdict`. None is returned after few collisions in the slice, or if another event is
    due soon.
    """
    if state.near is None or state.run.zoomed < UNDECIDED_FACTOR * len(state.near) ** 2:
        return None
    verdict = bounded_verdict(state, physics)
    return verdict if verdict is not None and _is_isolated(state, verdict) else None


def slowing_message(run: Any, events: int) -> str:
    """Return parts of the message of a run that `max_events` ends, or "".

    `events` is the number of all collisions. The first part states that the last collisions came at least ten times as
    fast as earlier collisions. The second part states a bound of the speeds of slow pairs, if one is known.
    """
    text = ""
    if len(run.pace) == 2:
        (begin, start), (tail, t) = run.pace
        last, took = events - tail, run.time() - t
        # The events of the last part came ten times as fast as earlier events.
        if last > 0 and took * (tail - begin) < 0.1 * last * (t - start):
            text = (f"; the last {last} collisions took only {took:.3g} s: the balls cluster and slow down, perhaps "
                    "forever; use collapse='merge', tc= or elastic_below=")
        verdict = bounded_verdict(run.state, run.physics)
        if verdict is not None:
            text += (f"; unless hit from outside, no body of {verdict.where(run.scene)} will be faster than "
                     f"{verdict.bound:.2g} m/s")
    return text


def _negligible_speed_verdict(state: State, physics: Physics) -> Verdict | None:
    """Return a `Verdict` on the longest group with negligible speeds, or None.

    The group contains the suspected pair and is isolated. The condition must hold in two consecutive calls. Otherwise
    the end of a finite sequence of collisions would be classified as a collapse.
    """
    # Each step lowers the limit of slow rates by 2^4, down to 2^-56 of the scale.
    for k in range(0, 40, 4):
        verdict = slow_pairs_verdict(state, physics, SLOW_RATE_FACTOR * 2.0**-k)
        if verdict is None:
            break
        if verdict.bound < NEGLIGIBLE_SPEED_FACTOR * state.clock.speed and _is_isolated(state, verdict):
            state.run.faint += 1
            return verdict if state.run.faint >= 2 else None
    state.run.faint = 0
    return None


def _proved_verdict(state: State, physics: Physics, verdict: Verdict) -> Verdict:
    """Return a *proved* `Verdict` if the pairs of a *bounded* one collide forever.

    The proof requires that no other pair collides within the remaining time, even if it approaches faster by twice the
    bound. Without a proof, the argument `verdict` is returned unchanged.
    """
    run, near, (pairs, bodies), n = state.run, state.near, state.slices(), len(state.pairs)
    low, high = ((k - int(run.first)) % n for k in (verdict.first, verdict.last))
    end, closing = high + 1, column(pairs, "closing_acceleration")
    resting = (column(bodies, "is_free") == 0.0) & np.isfinite(column(bodies, "mass")) & (run.gravity > 0.0)
    if physics.rule is not None or state.walls is not None or closing[low:end].any() or resting[low : end + 1].any():
        return verdict
    from granular.edmd.proof import forever  # rarely needed

    gap, rate = column(near, "gap"), column(near, "rate")
    proof = forever(pairs[low:end], gap[low:end], rate[low:end])
    if proof is None:
        return verdict
    low, end = low + proof.first, low + proof.last + 1
    wait = list(map(time_to_contact, gap.tolist(), (rate - 2.0 * verdict.bound).tolist(), closing.tolist()))
    if not proof.left < min([*wait[:low], *wait[end:], float(run.room - run.elapsed)]):
        return verdict
    return Verdict("proved", (int(run.first) + low) % n, (int(run.first) + end - 1) % n, verdict.bound)


def _is_isolated(state: State, verdict: Verdict) -> bool:
    """Return whether the pairs of a `Verdict` collide long before any other pair.

    Their next collision must be earlier by the factor `ISOLATION_FACTOR`.
    """
    columns = column(state.near, "gap"), column(state.near, "rate"), column(state.slices()[0], "closing_acceleration")
    wait = list(map(time_to_contact, *(x.tolist() for x in columns)))
    first, last = ((k - state.run.first) % len(state.pairs) for k in (verdict.first, verdict.last))
    return min(wait[:first] + wait[last + 1 :], default=math.inf) > ISOLATION_FACTOR * min(wait[first : last + 1])


def slow_pairs_verdict(
    state: State, physics: Physics, rate_factor: float = SLOW_RATE_FACTOR, collided: int | None = None
) -> Verdict | None:
    """Return a `Verdict` on the slow pairs next to the suspected pair, or None.

    A pair is slow if its rate is below `rate_factor` times the speed scale. The result is *proved* for two alternating
    pairs, otherwise *bounded*. `collided` is a pair of the slice that replaces the suspected pair.
    """
    run, gap, rate = state.run, column(state.near, "gap"), column(state.near, "rate")
    slow_rate = state.clock.speed * rate_factor
    # Slow pairs must also be close: within the distance of a slow rate during a window.
    is_slow = (np.abs(rate) < slow_rate) & (gap < slow_rate * state.clock.window)
    if state.walls is not None:
        is_slow &= column(state.slices()[0], "heat") < 0
    low = high = j = int(run.suspect - run.first) % len(state.pairs) if collided is None else collided
    while low > 0 and is_slow[low - 1]:
        low -= 1
    while high + 1 < len(is_slow) and is_slow[high + 1]:
        high += 1
    (pairs, bodies), end = state.slices(), high + 1
    pairs, bodies = pairs[low:end], bodies[low : end + 1]
    is_pressed = bool((column(pairs, "closing_acceleration")[[0, -1]] > 0.0).any())
    if low == high and (not is_pressed or (physics.rule is None and math.isinf(max(column(bodies, "mass"))))):
        return None  # Two free bodies collide once, and the bounces of a single ball on a wall are summed.
    kind, speed = "bounded", largest_speed(bodies, gap[low:end], rate[low:end], run.gravity)
    if physics.scene.external_force is not None:
        speed = largest_speed_under_forces(bodies, gap[low:end], rate[low:end], run.gravity)
    if high == low + 1 and not is_pressed and physics.rule is None and alternates(
            pairs, rate[low], rate[high], j == low):
        kind = "proved"
    first, n = int(run.first), len(state.pairs)
    return Verdict(kind, (first + low) % n, (first + high) % n, speed)


def largest_speed(bodies: Records, gap: Array, rate: Array, gravity: float) -> float:
    """Return √(2E/m_min) in m/s, an upper bound of the speed of each body.

    The bound is valid until another body hits the group. E is the energy of its bodies relative to their wall (with
    gravity), or to their centre of mass if no body is a wall. m_min is the smallest mass. `gap` (m) and `rate` (m/s)
    belong to the pairs of the group.
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
    """Return the upper bound of speeds as `largest_speed`, with external forces.

    The potential energy is the sum of gap times pressing force over all pairs. The pressing force of a pair is the
    total force of all bodies beyond the pair, seen from the wall. The result is inf if it is negative for any pair.
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
    """Return whether two neighbouring pairs collide in turn forever.

    `rate_a` and `rate_b` are the rates (m/s) of the lower and the upper pair. `lower_collided` states which of them
    has just collided. The pairs have constant restitution and collide only with each other. Two collisions map the
    ratio of the rates by a Möbius map. The pairs alternate forever if its fixed points are real, and if the ratio lies
    on the right side of the unstable fixed point.
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

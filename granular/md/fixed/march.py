"""Main loop of the fixed-step methods, with the chain divided into windows.

A force propagates by one pair per evaluation of the forces. A window with a margin on either side can therefore take
several steps independently of the rest of the chain. The values in its margins become invalid and are discarded. A
short chain is one window.

Two sets of rows alternate: the steps lead from one set to the other. Some events concern more than one window: all
pairs open, the stop condition is met, or a row of balls at rest is hit. Then these steps are discarded, and all windows
repeat them one by one. Times are stored as a step number and a fraction, so late times do not lose digits.
"""

from __future__ import annotations

from typing import Any

from granular._engine.kernels import DRIVEN, HEATED, RING, WORKED, kernel

# `begin`, `step` and EVALUATIONS are those of Verlet here; in the kernels of `Stepper`, those of its own integrator
from granular.md.fixed.integrators import CHANGED, CLOSED, beside, half_way as begin, verlet as step
from granular.md.fixed.notes import log_contacts, may_log_alone
from granular.md.fixed.walls import CROWD, HALT, HIT, MAX_HITS_PER_STEP, book, compute_wall_motion, heat
from granular.md.fixed.window import COUNT, RAW, XI, load, store

DONE, FLIGHT, FULL, UNTIL, CROWDED = range(5)
"""Why `march` returned.

Steps used up, every pair open, log buffer full, stop condition met, too many hits in a step."""
EVALUATIONS_PER_WINDOW = 96
"""Evaluations of the forces per window before the next window is stepped."""
EVALUATIONS_PER_STEP = 1
"""Evaluations of the forces per step."""
NO_PAIR = -1
"""Pair number that stands for no pair."""


@kernel
def remember(m: int, a: Any) -> None:
    """Update the largest overlaps of running contacts, for laws with memory."""
    for j in range(m):
        a.top[j + 1] = 0.0 if not a.xi[j + 1] > 0.0 else a.xi[j + 1] if a.xi[j + 1] > a.top[j + 1] else a.top[j + 1]


@kernel
def take_steps(
    physics: Any, here: Any, there: Any, work: Any, k: int, reach: int, noting: bool, watched_pair: int
) -> tuple[int, int]:
    """Take up to `reach` steps of the windows of `work`, from `here` to `there`.

    If `noting`, contacts are counted and logged. A chain in one window then stops when all its pairs are open. A longer
    chain cannot step its windows independently if the pair `watched_pair` opens.

    Returns
    -------
    taken, flags : int
        Number of steps taken, 0 if the windows cannot take them independently, and the flags of the last step.
    """
    # + 2: forces act on both balls of a pair, and `beside` reads the next pair
    pairs, margin, taken, flags, a = len(here[XI]) - 2, reach * EVALUATIONS_PER_STEP + 2, reach, 0, work.window
    for first in range(work.low, min(work.high, pairs), physics.block):
        stop = min(first + physics.block, pairs)
        lo, hi, alone = max(0, first - margin), min(pairs, stop + margin), stop - first == pairs
        if RING and not alone:
            lo, hi = first - margin, stop + margin
        m, done, wall_flags = hi - lo, 0, 0  # keep pairs first … stop-1, step lo … hi-1
        load(lo, m, physics, here, work)
        begin(physics.dt, m, a)
        while done < taken:
            right = m if hi == pairs else m - done * EVALUATIONS_PER_STEP  # pairs beyond are invalid by now
            if DRIVEN and (lo == 0 or hi == pairs):
                compute_wall_motion(physics, k + done)
            if HEATED and (lo == 0 or hi == pairs):
                wall_flags = heat(physics, lo, m, first, stop, k + done, work)
                if wall_flags & HIT:
                    begin(physics.dt, m, a)
                if noting and wall_flags & (HALT | CROWD):
                    return 0, 0
                flags |= wall_flags
            step_flags = step(physics, lo, right, a)
            if done == 0 or step_flags & CHANGED or wall_flags & HIT:
                beside(right, a)
            if physics.memory:
                remember(right, a)
            if WORKED:
                book(physics, lo, right, a)
            flags |= step_flags
            if noting and step_flags & CHANGED:
                if physics.logged and not may_log_alone(first, stop, lo, physics.ring, work.was, work.rows, work):
                    return 0, 0
                log_contacts(first, stop, lo, k + done, physics, work.was, work.rows, work)
            done += 1
            full = physics.logged and work.ended[0] + most_rows(pairs) > len(work.log)
            if alone and noting and (full or not step_flags & CLOSED):
                taken, flags = done, step_flags
            if first <= watched_pair < stop and not a.xi[watched_pair - lo + 1] > 0.0:  # or nan
                return 0, 0
        store(lo, first, stop, work, there)
    return taken, flags


@kernel
def most_rows(pairs: int) -> int:
    """Return the largest number of log rows that a step can add."""
    return pairs + 2 * MAX_HITS_PER_STEP if HEATED else pairs


@kernel
def deepest(xi: Any) -> int:
    """Return the pair of the largest overlap, or any pair if all are open or nan."""
    best = 1
    for j in range(1, len(xi) - 1):
        best = j if xi[j] > 0.0 and not xi[j] <= xi[best] else best
    return best - 1


@kernel
def march(
    physics: Any, here: Any, there: Any, work: Any, start: int, steps: int, room: int
) -> tuple[int, int, bool]:
    """Take up to `steps` steps from step number `start`.

    The loop stops as well if more than `room` contacts have ended. Finished contacts are counted, and logged if a log
    is kept.

    Returns
    -------
    why, k : int
        One of `DONE`, `FLIGHT`, `FULL`, `UNTIL`, `CROWDED`, and the step number reached. After `UNTIL` the contact
        begins between step k and step k + 1.
    turned : bool
        Whether `there` contains the state at step k. After `UNTIL` the other set contains the state at step k + 1.
    """
    pairs, k, turned, single_steps, until, deep = len(here[XI]) - 2, start, False, 0, work.pair + 1, deepest(here[XI])
    alone, ended = pairs <= physics.block, work.ended
    ended[0] = 0
    while k < start + steps:
        if ended[0] > room or (physics.logged and ended[0] + most_rows(pairs) > len(work.log)):
            return FULL, k, turned
        # a single window has no margins, so it can take more steps per call
        reach = min(
            4 * EVALUATIONS_PER_WINDOW if alone else EVALUATIONS_PER_WINDOW // EVALUATIONS_PER_STEP, start + steps - k
        )
        # one overlapping pair is enough to prove that the scene is not open
        deep = deep if here[XI][deep + 1] > 0.0 else deepest(here[XI])
        before, taken, flags, walking = ended[0], 0, 0, single_steps > 0
        if walking or alone or here[XI][deep + 1] > 0.0:
            taken, flags = take_steps(physics, here, there, work, k, 1 if walking else reach, not walking,
                                      NO_PAIR if walking or alone else deep)
        if walking:
            if HEATED and flags & (HALT | CROWD):
                return UNTIL if flags & HALT else CROWDED, k, turned
            if until > 0 and there[RAW][until] > 0.0 and not here[RAW][until] > 0.0 \
                    and here[COUNT][until] + 1 == work.nth:
                return UNTIL, k, turned
            log_contacts(0, pairs, 0, k, physics, here, there, work)
            flags = CLOSED if there[XI][deepest(there[XI]) + 1] > 0.0 else 0
            single_steps -= 1
        elif taken == 0 or ended[0] > room:
            # discard these steps and repeat them one by one, where all windows see each other
            ended[0], single_steps, deep = before, reach, deepest(here[XI])
            continue
        here, there, turned, k = there, here, not turned, k + taken
        if not flags & CLOSED:
            return FLIGHT, k, turned
    return DONE, k, turned

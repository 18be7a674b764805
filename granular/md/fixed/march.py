"""Main loop of the fixed-step methods, with the chain divided into windows.

A window is a part of the chain that fits into the processor cache (see `window`). A force propagates by one pair per
evaluation of the forces. A window with a margin on either side can therefore take several steps independently of the
rest of the chain. The values in its margins become invalid and are discarded. A short chain is one window.

Two sets of state arrays, `here` and `there`, alternate: each call of `take_steps` reads one set and writes the other.
Some events concern more than one window: no pair overlaps any more, the stop condition is met, or a collision reaches
balls that touch at rest. The steps of such a call are discarded and repeated one by one for the whole chain. Times are
stored as a step number and a fraction of a step, so late times do not lose digits.
"""

from __future__ import annotations

from typing import Any

from granular._engine.kernels import DRIVEN, HEATED, RING, WORKED, kernel

# placeholders: `Stepper` replaces `begin`, `step` and EVALUATIONS_PER_STEP by the kernels of its integrator
from granular.md.fixed.integrators import (
    CHANGED,
    CLOSED,
    prepare_verlet as begin,
    update_common_overlap,
    verlet as step,
)
from granular.md.fixed.notes import can_log_alone, log_contacts
from granular.md.fixed.walls import CROWD, HALT, HIT, MAX_HITS_PER_STEP, add_energies, compute_wall_motion, process_hits
from granular.md.fixed.window import COUNT, RAW, XI, load, store

DONE, FLIGHT, FULL, UNTIL, CROWDED = range(5)
"""Reasons for which `march` returns.

They are: all steps taken, no pair overlaps, log buffer full, stop condition met, and too many hits of a thermal wall
in one step."""
EVALUATIONS_PER_WINDOW = 96
"""Number of force evaluations in one window before the next window is stepped."""
EVALUATIONS_PER_STEP = 1
"""Number of force evaluations per step, replaced by the value of the integrator."""
NO_PAIR = -1
"""Value of a pair number that denotes no pair."""


@kernel
def update_memory(m: int, a: Any) -> None:
    """Update the largest overlap in m of each unfinished contact in a window.

    It is 0 for pairs without overlap. Force laws with memory depend on it.
    """
    for j in range(m):
        a.top[j + 1] = 0.0 if not a.xi[j + 1] > 0.0 else a.xi[j + 1] if a.xi[j + 1] > a.top[j + 1] else a.top[j + 1]


@kernel
def take_steps(
    physics: Any, here: Any, there: Any, work: Any, k: int, max_steps: int, counts_contacts: bool, watched_pair: int
) -> tuple[int, int]:
    """Take up to `max_steps` steps with each window of `work`, one after the other.

    Parameters
    ----------
    here, there : state arrays
        State at step `k`, and arrays to which the state after the steps is written.
    k : int
        Step number at the start.
    max_steps : int
        Number of steps. A chain in a single window takes fewer steps if its log is full or if no pair overlaps.
    counts_contacts : bool
        Whether contacts are counted and logged.
    watched_pair : int
        Pair whose overlap shows that the chain is not in free flight. If it ends, no steps are taken.

    Returns
    -------
    taken, flags : int
        Number of steps taken, and flags of the steps. The number is 0 if the steps concern more than one window. They
        must then be repeated one by one.
    """
    # + 2: forces act on both balls of a pair, and `update_common_overlap` reads the next pair
    pairs, margin, taken, flags, a = len(here[XI]) - 2, max_steps * EVALUATIONS_PER_STEP + 2, max_steps, 0, work.window
    for first in range(work.low, min(work.high, pairs), physics.block):
        stop = min(first + physics.block, pairs)
        lo, high, is_single_window = max(0, first - margin), min(pairs, stop + margin), stop - first == pairs
        if RING and not is_single_window:
            lo, high = first - margin, stop + margin
        m, done, wall_flags = high - lo, 0, 0  # the window steps pairs lo … high-1, and keeps pairs first … stop-1
        load(lo, m, physics, here, work)
        begin(physics.dt, m, a)
        while done < taken:
            right = m if high == pairs else m - done * EVALUATIONS_PER_STEP  # pairs beyond it are already invalid
            if DRIVEN and (lo == 0 or high == pairs):
                compute_wall_motion(physics, k + done)
            if HEATED and (lo == 0 or high == pairs):
                wall_flags = process_hits(physics, lo, m, first, stop, k + done, work)
                if wall_flags & HIT:
                    begin(physics.dt, m, a)
                if counts_contacts and wall_flags & (HALT | CROWD):
                    return 0, 0
                flags |= wall_flags
            step_flags = step(physics, lo, right, a)
            if done == 0 or step_flags & CHANGED or wall_flags & HIT:
                update_common_overlap(right, a)
            if physics.memory:
                update_memory(right, a)
            if WORKED:
                add_energies(physics, lo, right, a)
            flags |= step_flags
            if counts_contacts and step_flags & CHANGED:
                if physics.logged and not can_log_alone(first, stop, lo, physics.ring, work.was, work.rows, work):
                    return 0, 0
                log_contacts(first, stop, lo, k + done, physics, work.was, work.rows, work)
            done += 1
            is_log_full = physics.logged and work.ended[0] + max_new_rows(pairs) > len(work.log)
            if is_single_window and counts_contacts and (is_log_full or not step_flags & CLOSED):
                taken, flags = done, step_flags
            if first <= watched_pair < stop and not a.xi[watched_pair - lo + 1] > 0.0:  # or nan
                return 0, 0
        store(lo, first, stop, work, there)
    return taken, flags


@kernel
def max_new_rows(pairs: int) -> int:
    """Return the maximum number of log rows that one step of `pairs` pairs adds."""
    return pairs + 2 * MAX_HITS_PER_STEP if HEATED else pairs


@kernel
def deepest(xi: Any) -> int:
    """Return the number of the pair with the largest overlap.

    `xi` is the array of overlaps in m, in which pair c is entry c + 1. If no overlap is positive, any pair is returned.
    """
    deepest_index = 1
    for j in range(1, len(xi) - 1):
        deepest_index = j if xi[j] > 0.0 and not xi[j] <= xi[deepest_index] else deepest_index
    return deepest_index - 1


@kernel
def march(
    physics: Any, here: Any, there: Any, work: Any, start: int, steps: int, contact_budget: int
) -> tuple[int, int, bool]:
    """Take up to `steps` steps from step number `start`, and log finished contacts.

    Parameters
    ----------
    here, there : state arrays
        State at step `start`, and a second set of arrays. The two sets alternate.
    contact_budget : int
        The loop ends with `FULL` once more than this number of contacts have ended.

    Returns
    -------
    why, k : int
        One of `DONE`, `FLIGHT`, `FULL`, `UNTIL`, `CROWDED`, and the step number reached. After `UNTIL` the contact
        to stop at begins between step k and step k + 1.
    is_swapped : bool
        Whether `there` contains the state at step k. After `UNTIL` the other set contains the state at step k + 1.
    """
    pairs, k, is_swapped, single_steps, until, deepest_pair = (
        len(here[XI]) - 2, start, False, 0, work.pair + 1, deepest(here[XI]))
    is_single_window, ended = pairs <= physics.block, work.ended
    ended[0] = 0
    while k < start + steps:
        if ended[0] > contact_budget or (physics.logged and ended[0] + max_new_rows(pairs) > len(work.log)):
            return FULL, k, is_swapped
        # a single window has no margins, so it can take more steps per call
        max_steps = min(
            4 * EVALUATIONS_PER_WINDOW if is_single_window else EVALUATIONS_PER_WINDOW // EVALUATIONS_PER_STEP,
            start + steps - k,
        )
        # one overlapping pair is enough to prove that the chain is not in free flight
        deepest_pair = deepest_pair if here[XI][deepest_pair + 1] > 0.0 else deepest(here[XI])
        before, taken, flags, steps_singly = ended[0], 0, 0, single_steps > 0
        if steps_singly or is_single_window or here[XI][deepest_pair + 1] > 0.0:
            taken, flags = take_steps(physics, here, there, work, k, 1 if steps_singly else max_steps, not steps_singly,
                                      NO_PAIR if steps_singly or is_single_window else deepest_pair)
        if steps_singly:
            if HEATED and flags & (HALT | CROWD):
                return UNTIL if flags & HALT else CROWDED, k, is_swapped
            if until > 0 and there[RAW][until] > 0.0 and not here[RAW][until] > 0.0 \
                    and here[COUNT][until] + 1 == work.nth:
                return UNTIL, k, is_swapped
            log_contacts(0, pairs, 0, k, physics, here, there, work)
            flags = CLOSED if there[XI][deepest(there[XI]) + 1] > 0.0 else 0
            single_steps -= 1
        elif taken == 0 or ended[0] > contact_budget:
            # discard these steps and repeat them one by one, where all windows see each other
            ended[0], single_steps, deepest_pair = before, max_steps, deepest(here[XI])
            continue
        here, there, is_swapped, k = there, here, not is_swapped, k + taken
        if not flags & CLOSED:
            return FLIGHT, k, is_swapped
    return DONE, k, is_swapped

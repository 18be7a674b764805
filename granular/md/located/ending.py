"""End of a located run: static overlaps, statistics, message and last contacts.

A run that ends at rest is continued until its overlaps are static. They are compared with the static values at times of
7 binary digits. These times do not depend on the time of the proof, so that a resumed run ends bitwise identically.
"""

from __future__ import annotations

import math
from itertools import groupby
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.records import column, plain
from granular.md.located.records import ACTIVE, DORMANT, GENERAL
from granular.md.located.rest.equilibrium import static_overlap
from granular.run.contact_log import CONTACT_ROW, Rows
from granular.run.drive import Pause
from granular.run.trajectory import Status
from granular.run.until import Contact, raised

STATIC_OVERLAP_TOLERANCE = 1e-9
"""Relative deviation from its static value up to which an overlap is static."""
MAX_STATIC_TESTS = 4096
"""Maximum number of comparisons, 64 per doubling of the time.

If the overlaps are not static then, they decay more slowly than floats can resolve."""


def settle_overlaps(run: Any) -> None:
    """Advance a run that is proved to rest until all overlaps are static.

    `run` is a `located.run.Run`.
    """
    # under general laws, rest is proved when all forces balance: the overlaps are static already
    loaded = [p for p in island_members(run) if p.mode == ACTIVE and p.load > 0.0 and p.kind != GENERAL]
    pair, static = [p.number for p in loaded], np.array([static_overlap(p, p.load) for p in loaded])
    # the period of a contact is the shortest meaningful time in a run that rests from its start
    shortest = max((math.sqrt(xi / (p.load * p.inverse)) for p, xi in zip(loaded, static.tolist(), strict=True)),
                   default=0.0)
    time = max(run.now, float(run.counters["t"]), run.request.start - run.start)
    for _ in range(MAX_STATIC_TESTS if loaded else 0):
        time = _next_test_time(time, shortest)
        while (pause := run.to(run.start + time, False)) is Pause.full:
            pass
        if pause is not Pause.reached:
            return
        if (abs(run.row_after(time, run.start + time).gap[pair] + static) <= STATIC_OVERLAP_TOLERANCE * static).all():
            return
        time = math.nextafter(time, math.inf)


def _next_test_time(time: float, shortest: float) -> float:
    """Return the first time in s of a comparison at or after `time`.

    The times of comparisons are 0 and the numbers of 7 binary digits that are at least about `shortest`.
    """
    if time == 0.0:
        return 0.0
    exponent = math.frexp(max(time, shortest))[1] - 7
    return math.ldexp(math.ceil(math.ldexp(max(time, shortest), -exponent)), exponent)


def stats_of(run: Any, r: Any) -> dict[str, Any]:
    """Return the statistics of a run. `r` is its record of counters."""
    return {
        "engine": "compiled" if run.engine == "compiled" else "plain",
        "steps": int(r.steps), "events": int(r.events), "contacts": int(r.contacts),
        "error_estimate": float(r.error), "resting": bool(r.rests),
        "shared_impulse": float(r.shared + r.shared_low) if run.request.log else math.nan,
        "isolated": int(r.isolated), "tables": int(r.tables),
        "first_disturbed": (run.start + float(r.disturbed), int(r.first)),
    }


def message_of(run: Any, status: Status, r: Any, t: float) -> str:
    """Return the sentence of a status with numbers and the usual remedy.

    `r` is the record of counters, and `t` the time in s at which the run ended.
    """
    sentence = f"{status.value} (t = {t:.6g} s, {r.contacts} contacts, {r.steps} steps)"
    until = run.request.until
    if status is Status.max_events and not run.pace.stalled:
        sentence += "; " + raised("max_steps" if r.steps >= r.max_steps else "max_events", run.request.end)
    if status is Status.until and t == run.start and isinstance(until, Contact):
        sentence += (": touching balls are in contact from the start; to stop at a given force use "
                     f"granular.until.force({until.pair}, above=...)")
    if run.pace.stalled:
        sentence += (f": contacts creep or chatter, with {run.pace.step:.2g} s per trial step on average; use weaker "
                     "damping or a force without a jump at rest, or continue with granular.md.resume")
    if not (r.rests or run.bound):
        return sentence
    if status is Status.time:
        sentence += "; the balls rest on each other"
    if run.collocation is not None or not r.barrier:
        return f"{sentence}: all forces balance to rounding error"
    touching = [p for p in island_members(run) if p.mode == ACTIVE or p.mode == DORMANT]
    # consecutive pair numbers form a group
    groups = [[p for _, p in group] for _, group in groupby(enumerate(touching), lambda at: at[1].number - at[0])]
    # the inverse masses `lower` and `upper` are 0 for a wall: a group between two walls is closed
    decay = max(slowest_decay(group, group[0].lower == 0.0 == group[-1].upper) for group in groups)
    relation = "is less than" if r.energy < (1.0 - 1e-9) * r.barrier else "equals"  # see `equilibrium.prove_group`
    energies = f"{r.energy:.3g} J, {relation} the {r.barrier:.3g} J that"
    reason = f"the energy about the equilibrium, {energies} the first contact needs to open"
    return f"{sentence}: {reason}; the slowest motion decays in {decay:.3g} s"


def slowest_decay(pairs: list[Any], closed: bool) -> float:
    """Return the decay time in s of the slowest small motion of a pile.

    The pile consists of touching `pairs`, and the motion is about their current overlaps. The result is inf if this
    motion does not decay. Between two walls (`closed`) the sum of overlaps is constant, so motions that change it are
    excluded.
    """
    a, n = motion_matrix(pairs), len(pairs)
    if closed:
        zero_sum = np.linalg.qr(np.column_stack([np.ones(n), np.eye(n)[:, 1:]]))[0][:, 1:]
        basis = np.kron(np.eye(2), zero_sum)
        a = basis.T @ a @ basis
    slowest = -float(np.linalg.eigvals(a).real.max())
    return 1.0 / slowest if slowest > 0.0 else float("inf")


def motion_matrix(pairs: list[Any]) -> Array:
    """Return the matrix A of ẏ = A y for small motions y = (ξ, η) of touching pairs.

    For n pairs it has shape (2n, 2n). The motions are about the current overlaps.
    """
    k = np.array([p.k if p.p == 1.0 else p.k * p.p * p.xi ** (p.p - 1.0) for p in pairs])
    gamma = np.array([p.gamma if p.d == 0.0 else p.gamma * p.xi**p.d for p in pairs])
    lower, own, upper = np.array([(p.lower, -p.inverse, p.upper) for p in pairs]).T
    w = np.diag(lower[1:], 1) + np.diag(own) + np.diag(upper[:-1], -1)
    return np.block([[np.zeros_like(w), np.eye(len(pairs))], [w * k, w * gamma]])


def island_members(run: Any) -> list[Any]:
    """Return the records of the pairs in islands as plain objects, from the bottom up."""
    slot = column(run.s.pairs, "slot")[: run.scene.n_pairs]
    slots = slot[slot >= 0].tolist()
    return [run.s.pool[i] for i in slots] if isinstance(run.s.pool, list) else plain(run.s.pool[slots])


def unlogged_contacts(run: Any, end: float) -> Rows | None:
    """Return the contacts at the end of a run that are not yet in the log, or None.

    `end` is the end in s since the start of the run. Contacts that have not ended have nan as their end time.
    """
    blocks = [*run.rows(), *(run.with_scene_times(rows) for rows in _unfinished_contacts(run))]
    if not blocks:
        return None
    rows = np.concatenate(blocks)
    late = rows["t_end"] > run.start + end  # later only by rounding
    rows["t_end"][late], rows["v_out"][late] = math.nan, math.nan
    return rows


def _unfinished_contacts(run: Any) -> list[Rows]:
    """Return the contacts that have not ended, in a list of at most one array."""
    unfinished = [p for p in island_members(run) if p.going_on] if column(run.s.pool, "going_on").any() else []
    if not unfinished:
        return []
    rows = np.zeros(len(unfinished), CONTACT_ROW)
    rows["t_end"] = rows["lower_out"] = rows["upper_out"] = math.nan
    rows["pair"] = [p.number for p in unfinished]
    for name in ("t_begin", "duration", "lower_in", "upper_in", "xi_max", "force_max", "impulse"):
        rows[name] = [getattr(p, name) for p in unfinished]
    return [rows]

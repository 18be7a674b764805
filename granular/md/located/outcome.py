"""How a run ended: the sentence with its numbers, the account of the work done, and the contacts that go on; `run` is
one of `located.run`.
May be skipped: words and numbers of what is computed elsewhere.
"""

from __future__ import annotations

import math
from itertools import groupby
from typing import Any

import numpy as np

from granular._records import column, plain
from granular.drive import CONTACT_ROW, Rows
from granular.md.located.creep import slowest_decay
from granular.md.located.records import ACTIVE, DORMANT
from granular.trajectory import Status


def stats(run: Any, r: Any, crept: float) -> dict[str, Any]:
    """Return the amount of work; `r` are the counters, `crept` the impulse in N s that was shared while creeping."""
    return {
        "engine": "compiled" if run.engine == "compiled" else "plain",
        "steps": int(r.steps), "events": int(r.events), "contacts": int(r.begun),
        "error_estimate": float(r.error), "resting": bool(r.rests) or run.creep is not None,
        "shared_impulse": math.fsum([r.shared, r.shared_low, crept]) if run.request.log else math.nan,
        "isolated": int(r.isolated), "tables": int(r.tables),
        "first_disturbed": (run.start + float(r.disturbed), int(r.first)),
    }


def message(run: Any, status: Status, r: Any, t: float) -> str:
    """Return the sentence of a status with its numbers."""
    sentence = f"{status.value} (t = {t:.6g} s, {r.begun} contacts, {r.steps} steps)"
    if run.pace.stalled:
        sentence += (f": contacts creep or chatter, {run.pace.step:.2g} s a trial step on the average; weaker damping, "
                     "or a force without a jump at rest, is needed (granular.md.resume goes on)")
    if not (r.rests or run.bound or run.creep):
        return sentence
    if status is Status.time:
        sentence += "; the balls rest on each other"
    if run.collocation is not None or not (run.creep or r.barrier):
        return f"{sentence}: every force balances to rounding"
    piled = [p for p in members(run) if p.mode == ACTIVE or p.mode == DORMANT]
    groups = [[p for _, p in group] for _, group in groupby(enumerate(piled), lambda at: at[1].number - at[0])]
    decay = max(slowest_decay(group, group[0].lower == 0.0 == group[-1].upper) for group in groups)
    why = "about the equilibrium, no sum of decaying modes takes a contact force to zero"
    if run.creep is None:
        energies = f"{r.energy:.3g} J, is less than the {r.barrier:.3g} J that"
        why = f"the energy about the equilibrium, {energies} the first contact needs to open"
    return f"{sentence}: {why}; the slowest motion decays in {decay:.3g} s"


def members(run: Any) -> list[Any]:
    """Return the records of pairs in islands as plain objects, from the bottom up."""
    slot = column(run.s.pairs, "slot")[: run.scene.n_pairs]
    slots = slot[slot >= 0].tolist()
    return [run.s.pool[i] for i in slots] if isinstance(run.s.pool, list) else plain(run.s.pool[slots])


def still_open(run: Any) -> Rows:
    """Return the contacts that go on at the end."""
    going = [p for p in members(run) if p.begun] if column(run.s.pool, "begun").any() else []
    rows = np.zeros(len(going), CONTACT_ROW)
    rows["t_end"] = rows["lower_out"] = rows["upper_out"] = math.nan
    rows["pair"] = [p.number for p in going]
    for name in ("t_begin", "duration", "lower_in", "upper_in", "xi_max", "force_max", "impulse"):
        rows[name] = [getattr(p, name) for p in going]
    return rows

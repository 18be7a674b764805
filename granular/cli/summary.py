"""One trajectory in words and a few numbers.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from granular import isolation, measures
from granular.cases import Case
from granular.trajectory import Status, Trajectory

MOST = 20
"""Rows of a table at most."""


def summary(case: Case, run: Trajectory) -> str:
    """Return how a run ended; if its numbers mean anything, its contacts by pair, and each body at the end."""
    engine = "hard spheres (edmd)" if run.law is None else "soft spheres (md)"
    lines = [case.about] if case.about else []
    lines += [f"{run.scene!r}, {engine}"]
    if run.status in (Status.unstable, Status.broken):  # no number of such a run means anything
        return "\n".join([*lines, f"{run.status.name} at t = {run.time[-1]:.6g} s: {run.message}"])
    lines += [f"{run.status.name}: {run.message}",
              f"t = {run.time[-1]:.12g} s, {len(run.contacts)} contacts",
              *filter(None, [isolation.sentence(run)]), "", *_contacts(run), "", *_bodies(run)]
    if run.scene.fed:
        parts = measures.balance(run)
        said = (f"{words} {parts[name]:.6g}" for name, words in measures.ACCOUNT.items() if parts[name])
        return "\n".join([*lines, "", "energy, J: " + ", ".join(said)])
    energy = run.energy()
    if energy[0] > 0.0 and not math.isnan(energy[-1]):
        lines += ["", f"energy left: {100.0 * energy[-1] / energy[0]:.6g} % of {energy[0]:.6g} J"]
    return "\n".join(lines)


def _contacts(run: Trajectory) -> Iterator[str]:
    yield f"{'pair':>12} {'contacts':>9} {'first onset / s':>18} {'last onset / s':>18} {'max overlap / m':>16}"
    for pair, row in _some(run.scene.n_pairs):
        log = run.of(pair)
        row = row or f"{'–'.join(_label(run, body) for body in run.scene.bodies(pair)):>12} {len(log):9d}"
        if len(log) and "…" not in row:
            deepest = 0.0 if run.law is None else float(log["xi_max"].max())
            row += f" {log['t_begin'][0]:18.12g} {log['t_begin'][-1]:18.12g} {deepest:16.4g}"
        yield row


def _bodies(run: Trajectory) -> Iterator[str]:
    yield f"{'body':>12} {'mass / kg':>12} {'position / m':>18} {'velocity / (m/s)':>20}"
    for i, row in _some(run.scene.n):
        mass, x, v = run.scene.mass[i], run.position[-1, i], run.velocity[-1, i]
        yield row or f"{_label(run, i):>12} {mass:12.6g} {x:18.12g} {v:20.12g}"


def _label(run: Trajectory, body: int) -> str:
    return str(body) if not run.scene.is_wall[body] else "floor" if body == 0 else "ceiling"


def _some(n: int) -> Iterator[tuple[int, str]]:
    """The numbers of `n` pairs or bodies; of many only the first and the last, and a row for those left out."""
    for i in range(n):
        if i < MOST - 2 or i == n - 1 or n <= MOST:
            yield i, ""
        elif i == n - 2:
            yield i, f"{'…':>12} ({n - MOST + 1} more)"

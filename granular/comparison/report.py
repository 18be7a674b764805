"""A comparison in words and numbers: the table that a person reads, and JSON with provenance."""

from __future__ import annotations

import math
from dataclasses import asdict
from os import PathLike
from typing import Any

import numpy as np

from granular import _files, outcome
from granular._describe import scene_to_json
from granular.comparison.numbers import Compared
from granular.comparison.verdict import contacts, verdict
from granular.measures import ROUNDING

MANY = 8
"""Up to this many laws or pairs are shown one by one."""
SAME_RESTITUTION = 1e-9
"""Values of ε closer than this are the same."""


def table(report: Compared) -> str:
    """The report a person reads."""
    lines = [f"{report.scene!r}", *_law_lines(report), "", *_outcome_lines(report), "", *_why_lines(report)]
    lines += ["", *_measure_lines(report), *(f"warning: {w}" for w in warnings(report)), "", verdict(report)]
    return "\n".join(lines)


def warnings(report: Compared) -> list[str]:
    """What to mind: a rule that is not that of the laws, and what no force law would bear."""
    return [*_two_restitutions(report), *_extremes(report)]


def _two_restitutions(report: Compared) -> list[str]:
    """Pairs whose hard spheres collide with another ε than their force law has."""
    hard, law = np.array(report.restitution_spec), np.array(report.law_restitution)
    differ = np.flatnonzero(np.abs(hard - law) > SAME_RESTITUTION)
    if not len(differ):
        return []
    c = int(differ[0])
    more = f" (so do {len(differ) - 1} more pairs)" if len(differ) > 1 else ""
    return [f"hard spheres of pair {c} run with ε = {hard[c]:.6g}, their force law has {law[c]:.6g}{more}"]


def _extremes(report: Compared) -> list[str]:
    """Deep overlaps, and speeds near the speed of sound."""
    found, scene, log = [], report.scene, report.counted[1].contacts
    depth, speed, shortest = np.zeros(scene.n_pairs), np.zeros(scene.n_pairs), np.full(scene.n_pairs, math.inf)
    met = outcome.counts(report.counted[1]) > 0
    np.maximum.at(depth, log["pair"], log["xi_max"])
    np.maximum.at(speed, log["pair"], np.abs(log["v_in"][:, 0] - log["v_in"][:, 1]))
    np.minimum.at(shortest, log["pair"], log["duration"])
    radius = np.where(scene.radius > 0.0, scene.radius, math.inf)
    radius = np.minimum(*scene.sides(radius))
    depth = depth / radius
    speed[met] *= shortest[met] / (2.0 * math.pi * radius[met])  # in the speed of sound, 2 π R / t_c
    for c in np.flatnonzero((depth > 0.1) | (speed > 0.1)).tolist():
        if depth[c] > 0.1:
            found.append(f"pair {c} overlaps by {depth[c]:.2g} of the smaller radius; force laws end near 0.1")
        if speed[c] > 0.1:
            found.append(f"pair {c} meets at {speed[c]:.2g} of the speed of contact waves")
    return found


def as_dict(report: Compared) -> dict[str, Any]:
    """All numbers with provenance, ready for JSON (nan and inf become None)."""
    numbers: dict[str, Any] = _files.plain(
        {
            "provenance": _files.provenance(),
            "scene": scene_to_json(report.scene),
            "law": [repr(law) for law in report.law],
            "rule": repr(report.rule),
            "until": repr(report.until),
            "t_end": report.t_end,
            "pairs": [asdict(p) for p in report.pairs],
            "rounding_contacts": dict(zip(("hard", "soft"), _left_out(report), strict=True)),
            "impact_speed": report.impact_speed,
            "restitution": list(report.restitution_spec),
            "law_restitution": list(report.law_restitution),
            "restitution_ratio": report.restitution_ratio,
            "measures": report.measures,
            "groups": report.groups,
            "error": report.error,
            "verdict": verdict(report),
            "warnings": warnings(report),
            "hard": _run(report.hard),
            "soft": _run(report.soft),
        }
    )
    return numbers


def to_json(report: Compared, path: str | PathLike[str]) -> None:
    """Write `to_dict` to a file, whole or not at all."""
    _files.write_json(path, as_dict(report))


def _law_lines(report: Compared) -> list[str]:
    """Each different law, or each pair's, with its own ε; then the rule of the hard spheres with its own."""
    eps, pairs = np.array(report.law_restitution), np.arange(len(report.law))
    of_law: dict[str, list[int]] = {}
    for c, law in enumerate(report.law):
        of_law.setdefault(repr(law), []).append(c)
    few = len(of_law) > 1 and len(pairs) <= MANY
    rows = [(repr(law), [c]) for c, law in enumerate(report.law)] if few else list(of_law.items())
    lines = [f"{_which(some, len(pairs)):<9} {_short(law)}   {_eps(eps[some])}" for law, some in rows[:MANY]]
    if len(rows) > MANY:
        lines.append(f"({len(rows) - MANY} more laws not shown)")
    return [*lines, f"{'rule':<9} {_short(repr(report.rule))}   {_eps(np.array(report.restitution_spec))}"]


def _which(pairs: list[int], n: int) -> str:
    return f"pair {pairs[0]}" if len(pairs) == 1 else "all pairs" if len(pairs) == n else f"{len(pairs)} pairs"


def _eps(values: Any) -> str:
    low, high = float(values.min()), float(values.max())
    return f"ε = {low:.6g}" + (f" … {high:.6g}" if high - low > SAME_RESTITUTION else "")


def _short(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:77]}…"


def _outcome_lines(report: Compared) -> list[str]:
    head = f"{'':22}{'hard spheres':>16}{'soft spheres':>16}"
    lines = [head, f"{'':22}{'(event-driven)':>16}{'(Newton)':>16}"]
    shown = report.pairs if len(report.pairs) <= 8 else report.pairs[:3] + report.pairs[-3:]
    for p in shown:
        mark = "  still in contact at the stop" if p.ongoing else ""
        lines.append(f"{f'contacts of pair {p.pair}':22}{p.hard_contacts:>16}{p.soft_contacts:>16}")
        lines.append(f"{f'v_rel′ pair {p.pair}, m/s':22}{_speed(p.hard_v_rel)}{_speed(p.soft_v_rel)}{mark}")
    if len(shown) < len(report.pairs):
        lines.append(f"({len(report.pairs) - len(shown)} pairs in between not shown; all are in the JSON)")
    hard, soft = report.hard, report.soft
    lines.append(f"{'all contacts':22}{len(hard.contacts):>16}{len(soft.contacts):>16}")
    if any(_left_out(report)):
        left = "".join(f"{n:>16}" for n in _left_out(report))
        lines.append(f"{'left out as rounding':22}{left}  slower than {ROUNDING:g} of the fastest impact")
    lines.append(f"{'ended at t, s':22}{hard.time[-1]:>16.9g}{soft.time[-1]:>16.9g}")
    lines.append(f"{'because':22}{hard.status.name:>16}{soft.status.name:>16}")
    if not math.isnan(ratio := report.restitution_ratio):
        lines.append(f"{'ε_eff / ε_spec':22}{1.0:>16.6g}{ratio:>16.6g}")
    return lines


def _left_out(report: Compared) -> list[int]:
    """How many contacts of the hard and of the soft run are rounding, and count for nothing."""
    runs = zip((report.hard, report.soft), report.counted, strict=True)
    return [len(run.contacts) - len(counted.contacts) for run, counted in runs]


def _speed(v: float) -> str:
    return f"{'–':>16}" if math.isnan(v) else f"{v:>16.6g}"


def _why_lines(report: Compared) -> list[str]:
    shared = report.overlaps
    if not shared:
        return ["Why: no two contacts of neighbouring pairs overlap in time; only the finite durations differ."]
    log = report.counted[1].contacts
    lines = [f"Why: {contacts(len(shared), 'overlap')} in time with a contact of a neighbouring pair, first of all:"]
    for o in shared[:4]:
        below, above = log[o.lower], log[o.upper]
        lines.append(
            f"  pairs {below['pair']} and {above['pair']} share {o.end - o.begin:.3g} s from t = {o.begin:.9g} s "
            f"(contacts of {below['duration']:.3g} and {above['duration']:.3g} s)"
        )
    return lines


def _measure_lines(report: Compared) -> list[str]:
    """Lines of the measures that have a value for this scene."""
    m, g = report.measures, report.groups
    lines = [
        (report.error, f"largest error of a velocity, in impact speeds = {report.error:.3g}"),
        (m["shared_impulse"], f"impulse shared with a neighbour      φ   = {m['shared_impulse']:.4g}"),
        (m["crowding"], f"events with a neighbour within t_c   p   = {m['crowding']:.4g}"),
        (m["occupation"], f"share of time in contact             Λ   = {m['occupation']:.3g}"),
        (m["distance"], f"distance of leaving velocities       D   = {m['distance']:.3g}"
                        f"   (hard spheres from gaps shifted by 1e-12: {m['predictability']:.1g})"),
        (m["mass_centre_ratio"], f"restitution of the mass centre, soft / hard = {m['mass_centre_ratio']:.4g}"),
    ]  # fmt: skip
    parts = [
        (g["mass_ratio"], f"mass ratio {g['mass_ratio']:.4g}"),
        (g["stiffness_ratio"], f"stiffness ratio {g['stiffness_ratio']:.4g}"),
        (g["gap_omega_over_speed"], f"Δh ω₀/v {g['gap_omega_over_speed']:.3g}"),
        (g["gravity_over_omega_speed"], f"g/(ω₀v) {g['gravity_over_omega_speed']:.2g}"),
    ]
    groups = ", ".join(text for value, text in parts if not math.isnan(value))
    return [text for value, text in lines if not math.isnan(value)] + [f"groups: {groups}"]


def _run(run: Any) -> dict[str, Any]:
    log = run.contacts[:10_000]
    return {
        "status": run.status.name,
        "message": run.message,
        "stats": {k: v for k, v in run.stats.items() if isinstance(v, (int, float, str, bool))},
        "time": run.time.tolist(),
        "velocity": run.velocity[-1].tolist(),
        "gap": run.gap[-1].tolist(),
        "contacts": {name: log[name].tolist() for name in log.dtype.names},
        "contacts_left_out": len(run.contacts) - len(log),
    }

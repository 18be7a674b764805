"""A comparison in words and numbers: the table, the one-line verdict, and JSON with provenance."""

from __future__ import annotations

import json
import math
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import _files
from granular.measures import ROUNDING, SAME, SMALL
from granular.pair_outcome import PairOutcome
from granular.scene import Scene
from granular.trajectory import Status

if TYPE_CHECKING:
    from granular.comparison import Comparison

TROUBLE = (Status.collapse, Status.max_events, Status.unstable)


def verdict(report: Comparison) -> str:
    """One line: may this scene be event-driven?"""
    for name, run in (("soft-sphere", report.soft), ("event-driven", report.hard)):
        if run.status in TROUBLE:
            return f"No verdict on all of it: the {name} run ended with {run.status.name} ({run.message})"
    m = report.measures
    hard, soft = report.counted
    if not len(hard.contacts):
        if not len(soft.contacts):
            return "Yes, trivially: nothing collides."
        if (hard.gap[-1][soft.contacts["pair"]] == 0.0).all():
            return _settling(report)
    if endless := _endless(report):
        return endless
    wrong = [p.pair for p in report.pairs if p.hard_contacts != p.soft_contacts]
    if m["predictability"] > 0.01 and (report.scene.gap == 0.0).any():
        return "Not uniquely: touching balls have no one hard-sphere answer; here it hangs on the tie rule (ties=)."
    if m["predictability"] > 0.01:
        share = 100.0 * m["shared_impulse"]
        shared = "" if math.isnan(share) else f"; {share:.2g} % of the impulse is shared"
        return f"Not ball by ball: beyond predictability (compare ensembles){shared}."
    if wrong and report.only_timing:
        return (
            f"Yes, but for timing: the contacts are the same, yet {len(wrong)} of {len(report.pairs)} pairs have one "
            "on the other side of t_end."
        )
    if wrong:
        p = report.pairs[wrong[-1]]
        many = f"{len(wrong)} of {len(report.pairs)} pairs differ in contacts; " if len(wrong) > 1 else ""
        return f"No: {many}pair {p.pair} has {_contacts(p.soft_contacts)}, not {p.hard_contacts}{_parting(p)}."
    if report.error > SAME:
        what = "separation speeds" if report.judged_by_separation else "velocities"
        return f"No: {what} are off by {report.error:.2g} of the impact speed."
    if m["shared_impulse"] > ROUNDING:
        return f"Yes, within {report.error:.1g} of the impact speed, though contacts overlap in time."
    error = max(report.error, 1e-16)
    return f"Yes: every contact is binary, and outcomes agree within {error:.1g} of the impact speed."


def _settling(report: Comparison) -> str:
    """The verdict where hard spheres rest on each other, and soft ones only sink under their weight."""
    depth = float(report.soft.contacts["xi_max"].max())
    radius = min((float(r) for r in report.scene.radius if r > 0.0), default=math.inf)
    if depth > SAME * radius:
        return f"No: nothing collides, but soft spheres sink by {depth / radius:.2g} of a radius under their weight."
    return f"Yes, trivially: nothing collides; soft spheres overlap by {depth:.3g} m under their weight."


def _endless(report: Comparison) -> str:
    """The verdict where a soft contact fills much of the run, while hard spheres have bounced; else nothing."""
    span = float(report.soft.time[-1] - report.soft.time[0])
    for p in report.pairs:
        lasted = float(report.counted[1].of(p.pair)["duration"][-1]) if p.ongoing else 0.0
        moving = abs(float(np.diff(report.hard.velocity[-1])[p.pair])) > SAME * report.impact_speed
        if lasted > SMALL * span and moving:
            return (
                f"No: a soft contact of pair {p.pair} has lasted {lasted:.3g} of the {span:.3g} s of the run and is "
                "not over; hard spheres part at once."
            )
    return ""


def _parting(p: PairOutcome) -> str:
    """How a pair parts in the soft run; nothing where there is no speed to tell."""
    if math.isnan(p.soft_v_rel):
        return ", and is still in contact" if p.ongoing else ""
    hard = "" if math.isnan(p.hard_v_rel) else f" instead of {p.hard_v_rel:.4g}"
    return f", and parts at {p.soft_v_rel:.4g}{hard} m/s"


def table(report: Comparison) -> str:
    """The report a person reads."""
    lines = [f"{report.scene!r}", *_law_lines(report), "", *_outcome_lines(report), "", *_why_lines(report)]
    lines += ["", *_measure_lines(report), *(f"warning: {w}" for w in warnings(report)), "", report.verdict]
    return "\n".join(lines)


def warnings(report: Comparison) -> list[str]:
    """What the model itself would not bear: deep overlaps, speeds near the speed of sound."""
    found, scene, log = [], report.scene, report.soft.contacts
    for pair in scene.pairs:
        rows = log[log["pair"] == pair.index]
        radius = min((r for r in scene.radius[pair.index : pair.index + 2] if r > 0.0), default=math.inf)
        if len(rows) and (depth := float(rows["xi_max"].max()) / radius) > 0.1:
            found.append(f"pair {pair.index} overlaps by {depth:.2g} of the smaller radius; force laws end near 0.1")
        speed = float(abs(rows["v_in"][:, 0] - rows["v_in"][:, 1]).max()) if len(rows) else 0.0
        if len(rows) and math.isfinite(radius):
            sound = 2.0 * radius * math.pi / float(rows["duration"].min() or math.nan)
            if speed / sound > 0.1:
                found.append(f"pair {pair.index} meets at {speed / sound:.2g} of the speed of contact waves")
    return found


def as_dict(report: Comparison) -> dict[str, Any]:
    """All numbers with provenance, ready for JSON (nan and inf become None)."""
    from dataclasses import asdict

    numbers: dict[str, Any] = _clean(
        {
            "provenance": _files.provenance(),
            "scene": _scene(report.scene),
            "law": [repr(law) for law in report.law],
            "rule": repr(report.rule),
            "until": repr(report.until),
            "t_end": report.t_end,
            "pairs": [asdict(p) for p in report.pairs],
            "rounding_contacts": dict(zip(("hard", "soft"), _left_out(report), strict=True)),
            "impact_speed": report.impact_speed,
            "restitution": list(report.restitution_spec),
            "restitution_ratio": report.restitution_ratio,
            "measures": report.measures,
            "groups": report.groups,
            "error": report.error,
            "verdict": report.verdict,
            "warnings": warnings(report),
            "hard": _run(report.hard),
            "soft": _run(report.soft),
        }
    )
    return numbers


def write_json(report: Comparison, path: str | PathLike[str]) -> None:
    """Write `as_dict` to a file, whole or not at all."""
    _files.write_text(path, json.dumps(as_dict(report), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _law_lines(report: Comparison) -> list[str]:
    eps, same = report.restitution_spec, len({repr(law) for law in report.law}) == 1
    shown = report.law[:1] if same or len(report.law) > 8 else report.law
    lines = [
        f"{'all pairs' if len(shown) < len(report.law) else f'pair {c}':<9} {law!r}   ε = {eps[c]:.6g}"
        for c, law in enumerate(shown)
    ]
    return lines


def _outcome_lines(report: Comparison) -> list[str]:
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


def _left_out(report: Comparison) -> list[int]:
    """How many contacts of the hard and of the soft run are rounding, and count for nothing."""
    runs = zip((report.hard, report.soft), report.counted, strict=True)
    return [len(run.contacts) - len(counted.contacts) for run, counted in runs]


def _speed(v: float) -> str:
    return f"{'–':>16}" if math.isnan(v) else f"{v:>16.6g}"


def _why_lines(report: Comparison) -> list[str]:
    shared = report.overlaps
    if not shared:
        return ["Why: no two contacts of neighbouring pairs overlap in time; only the finite durations differ."]
    log = report.soft.contacts
    lines = [f"Why: {_contacts(len(shared), 'overlap')} in time with a contact of a neighbouring pair, first of all:"]
    for o in shared[:4]:
        below, above = log[o.lower], log[o.upper]
        lines.append(
            f"  pairs {below['pair']} and {above['pair']} share {o.end - o.begin:.3g} s from t = {o.begin:.9g} s "
            f"(contacts of {below['duration']:.3g} and {above['duration']:.3g} s)"
        )
    return lines


def _measure_lines(report: Comparison) -> list[str]:
    m, g = report.measures, report.groups
    return [
        f"impulse shared with a neighbour      φ   = {m['shared_impulse']:.4g}",
        f"events with a neighbour within t_c   p   = {m['crowding']:.4g}",
        f"share of time in contact             Λ   = {m['occupation']:.3g}",
        f"distance of final velocities         D   = {m['distance']:.3g}"
        f"   (hard spheres from gaps shifted by 1e-12: {m['predictability']:.1g})",
        f"restitution of the mass centre, soft / hard = {m['mass_centre_ratio']:.4g}",
        f"groups: mass ratio {g['mass_ratio']:.4g}, stiffness ratio {g['stiffness_ratio']:.4g}, "
        f"Δh ω₀/v {g['gap_omega_over_speed']:.3g}, g/(ω₀v) {g['gravity_over_omega_speed']:.2g}",
    ]


def _contacts(n: int, verb: str = "") -> str:
    noun = "contact" if n == 1 else "contacts"
    return f"{n} {noun}" + (f" {verb}{'s' if n == 1 else ''}" if verb else "")


def _scene(scene: Scene) -> dict[str, Any]:
    arrays = {name: getattr(scene, name).tolist() for name in ("mass", "radius", "gap", "velocity")}
    mass = ["inf" if math.isinf(m) else m for m in arrays["mass"]]
    return arrays | {"mass": mass, "gravity": scene.gravity, "origin": scene.origin}


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


def _clean(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _clean(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_clean(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

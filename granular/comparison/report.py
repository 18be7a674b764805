"""Text and numbers of a comparison: the printed report, and the content of JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.reports import (
    duration,
    named_pairs,
    number,
    pairs_by_law,
    percent,
    problem,
    scene_text,
    short_text,
    unit_of,
)
from granular.comparison import measures
from granular.comparison.input_warnings import SAME_RESTITUTION, short_warning_lines, warnings
from granular.comparison.outcome import ERROR_LIMIT, MIN_CONTACT_STRENGTH, PairOutcome, counts
from granular.md import isolation
from granular.run.trajectory import Trajectory
from granular.run.until import Contact

if TYPE_CHECKING:
    from granular.comparison.answer import ComparisonWithAnswer

SHORT_PAIR_COUNT, FULL_PAIR_COUNT = 2, 8
"""Number of pairs in the short report, and of pairs or laws in the full report."""
MEASURE_FORMATS = {
    "error": f"error = {{error:.3g}} of the fastest impact{{unit}} (hard spheres are valid up to {ERROR_LIMIT:g})",
    "shared_impulse": "share of the impulse during a neighbouring contact  φ = {shared_impulse:.4g}",
    "floor_share": "share of the floor's impulse with a load on ball 1    = {floor_share:.4g}",
    "crowding": "share of events with a neighbour within t_c         p = {crowding:.4g}",
    "occupation": "share of time in contact                            Λ = {occupation:.3g}",
    "distance": "distance of leaving velocities                      D = {distance:.3g}",
    "predictability": "D of hard spheres from gaps shifted by 1e-12          = {predictability:.1g}",
    "mass_centre_ratio": "restitution of the mass centre, soft / hard           = {mass_centre_ratio:.4g}",
}
GROUP_FORMATS = {
    "mass_ratio": "mass ratio {mass_ratio:.4g}", "stiffness_ratio": "stiffness ratio {stiffness_ratio:.4g}",
    "gap_omega_over_speed": "Δh ω₀/v {gap_omega_over_speed:.3g}",
    "gravity_over_omega_speed": "g/(ω₀v) {gravity_over_omega_speed:.2g}",
    "shaking": "Γ {shaking:.6g}", "shaking_omega": "ω/ω₀ {shaking_omega:.3g}",
}
"""Formats of measures and groups. Values that are nan are left out."""
DETAILS_HINT = "More (laws, overlaps, φ, p, Λ, D) with -v, in Python with report.details()."


def text(report: ComparisonWithAnswer) -> str:
    """Return the short report of up to 20 lines.

    It contains the verdict, its reason, and the largest difference of the engines.
    """
    return "\n".join(
        [
            report.verdict,
            *list(_reason_lines(report))[:2],
            "",
            f"{short_text(scene_text(report.scene))}, {_eps_text(report.restitution_spec)}",
            "",
            *_header_lines(),
            *_rise_lines(report),
            *_deciding_lines(report),
            *_pair_lines(report, SHORT_PAIR_COUNT),
            *_end_lines(report),
            *_format_known(MEASURE_FORMATS, _error_values(report)),
            *short_warning_lines(report),
            DETAILS_HINT,
        ]
    )


def details(report: ComparisonWithAnswer) -> str:
    """Return the full report."""
    from granular.comparison.further import floor_share

    return "\n".join([
        report.verdict, *_reason_lines(report), "",
        scene_text(report.scene), *_law_lines(report), "",
        *_header_lines(), *_rise_lines(report), *_deciding_lines(report),
        *_pair_lines(report, FULL_PAIR_COUNT, speeds=True),
        *_end_lines(report), *_energy_lines(report), "",
        *_format_known(
            MEASURE_FORMATS, _error_values(report) | report.measures | {"floor_share": floor_share(report)}),
        "groups: " + ", ".join(_format_known(GROUP_FORMATS, report.groups)),
        *(f"warning: {w}" for w in warnings(report)),
    ])


def numbers(report: ComparisonWithAnswer) -> dict[str, Any]:
    """Return all numbers of a comparison as a dictionary for JSON."""
    return {
        **problem(report),
        "rule": repr(report.rule),
        "pairs": [asdict(p) for p in report.pairs],
        "rounding_contacts": dict(zip(("hard", "soft"), _ignored_counts(report), strict=True)),
        "impact_speed": report.impact_speed,
        "restitution": report.restitution_spec,
        "law_restitution": report.law_restitution,
        "restitution_ratio": report.restitution_ratio,
        "measures": report.measures,
        "groups": report.groups,
        **isolation.numbers(report.soft),
        "error": report.error,
        "deciding": None if report.deciding is None else asdict(report.deciding),
        **({} if math.isnan(report.drop) else {"drop": report.drop, "rises": report.rises}),
        "answer": report.answer.name,
        "reasons": [asdict(reason) | {"answer": reason.answer.name} for reason in report.reasons],
        "verdict": report.verdict,
        "warnings": warnings(report),
        "hard": _run_numbers(report.hard),
        "soft": _run_numbers(report.soft),
    }


def _run_numbers(run: Trajectory) -> dict[str, Any]:
    """Return the numbers of a run for JSON (at most 10,000 contacts)."""
    log = run.contacts[:10_000]
    return {
        "status": run.status.name,
        "message": run.message,
        "stats": {k: v for k, v in run.stats.items() if isinstance(v, (int, float, str, bool))},
        "time": run.time,
        "velocity": run.velocity[-1],
        "gap": run.gap[-1],
        "account": measures.balance(run),
        "contacts": {name: log[name] for name in log.dtype.names or ()},
        "contacts_left_out": len(run.contacts) - len(log),
    }


def _law_lines(report: ComparisonWithAnswer) -> list[str]:
    """Return a line for each law, or for each pair, and one for the collision rule.

    Each pair has its own line if there are several laws and at most `FULL_PAIR_COUNT` pairs.
    """
    eps, n = np.array(report.law_restitution), len(report.law)
    of_law = pairs_by_law(report.law)
    few = len(of_law) > 1 and n <= FULL_PAIR_COUNT
    rows = [(repr(law), [c]) for c, law in enumerate(report.law)] if few else list(of_law.items())
    return [
        *(_law_line(named_pairs(pairs, n, report.scene.pairs.name), law, eps[pairs])
          for law, pairs in rows[:FULL_PAIR_COUNT]),
        *[f"({len(rows) - FULL_PAIR_COUNT} more laws not shown)"] * (len(rows) > FULL_PAIR_COUNT),
        _law_line("rule", repr(report.rule), np.array(report.restitution_spec)),
    ]


def _law_line(of: str, text: str, eps: Any) -> str:
    return f"{of:<13} {text if len(text) <= 80 else f'{text[:77]}…'}   {_eps_text(eps)}"


def _eps_text(values: Any) -> str:
    low, high = float(min(values)), float(max(values))
    return f"ε = {low:.6g}" + f" … {high:.6g}" * (high - low > SAME_RESTITUTION)


def _header_lines() -> Iterator[str]:
    """Yield the two header lines of the table."""
    yield _table_line("", "hard spheres", "soft spheres")
    yield _table_line("", "(event-driven)", "(Newton)")


def _rise_lines(report: ComparisonWithAnswer) -> Iterator[str]:
    """Yield how high the top ball rises after the first and the last bounce.

    The unit of the heights is the drop height.
    """
    if math.isnan(report.drop):
        return
    last = report.until.nth - 1 if isinstance(report.until, Contact) and report.until.pair == 0 else 1
    for bounce in sorted({1, max(1, last)}):
        hard, soft = (number(rise / report.drop) for rise in report.rises(bounce))
        yield _table_line(f"rise of ball {report.scene.n - 1}, drops", hard, soft,
                    f"  of {report.drop:.4g} m" + f", bounce {bounce}" * (bounce > 1))


def _deciding_lines(report: ComparisonWithAnswer) -> Iterator[str]:
    """Yield two lines on the ball with the largest error, for both engines."""
    departure = report.deciding
    if departure is not None:
        yield _table_line(f"ball {departure.ball} leaves, m/s", number(departure.hard_velocity),
                          number(departure.soft_velocity), f"  error {percent(departure.difference)}")
        yield _table_line("at t, s", f"{departure.hard_t:.9g}", f"{departure.soft_t:.9g}",
                    f"  episode {departure.episode}, {departure.contacts} contact{'s' * (departure.contacts != 1)}")


def _end_lines(report: ComparisonWithAnswer) -> Iterator[str]:
    """Yield the numbers of contacts of both runs, and the times at which they ended."""
    hard, soft = report.hard, report.soft
    yield _table_line("all contacts", len(report.settled.contacts), len(soft.contacts))
    if any(ignored := _ignored_counts(report)):
        yield _table_line("rounding errors, ignored", *ignored, f"  below {MIN_CONTACT_STRENGTH:g} of U")
    yield from _uncompared_lines(report)
    statuses = ", ".join(dict.fromkeys((hard.status.name, soft.status.name)))
    at = hard.stats.get("collapse_time", hard.time[-1])
    yield _table_line("ended at t, s", f"{at:.9g}", f"{soft.time[-1]:.9g}", f"  {statuses}")
    if not math.isnan(ratio := report.restitution_ratio):
        yield _table_line("ε_eff / ε_spec", 1, f"{ratio:.6g}")


def _pair_lines(report: ComparisonWithAnswer, limit: int, speeds: bool = False) -> Iterator[str]:
    """Yield contacts and separation speeds of the pairs that differ most.

    Parameters
    ----------
    limit : int
        Maximum number of pairs.
    speeds : bool
        Whether to include the separation speeds.
    """
    shown = sorted(sorted(report.pairs, key=_difference_key)[:limit], key=lambda p: p.pair)
    name = report.scene.pairs.name
    for p in shown:
        yield _table_line(f"contacts of pair {name(p.pair)}", p.hard_contacts, p.soft_contacts)
        if speeds:
            yield _table_line(f"v_r′ of pair {name(p.pair)}, m/s", number(p.hard_v_rel), number(p.soft_v_rel),
                              "  still in contact at the stop" if p.ongoing else _neighbour_mark(report, p))
    if hidden := len(report.pairs) - len(shown):
        yield f"({hidden} more pair{'s' * (hidden > 1)}, which differ{'s' * (hidden == 1)} less)"


def _neighbour_mark(report: ComparisonWithAnswer, p: PairOutcome) -> str:
    """Text if a neighbouring soft contact lasts when the pair's last one ends."""
    soft, (below, above) = report.continued[1], report.scene.neighbours
    for c in {*below[above == p.pair].tolist(), *above[below == p.pair].tolist()}:
        log = soft.of(c)
        if ((log["t_begin"] < p.soft_t_f) & ~(log["t_end"] <= p.soft_t_f)).any():
            return f"  pair {report.scene.pairs.name(c)} in contact"
    return ""


def _difference_key(p: PairOutcome) -> tuple[bool, float]:
    """Sort key with which pairs that differ most come first.

    Pairs with different numbers of contacts come before all other pairs.
    """
    difference = abs(p.soft_v_rel - p.hard_v_rel)
    return p.hard_contacts == p.soft_contacts, 1.0 if math.isnan(difference) else -difference


def _energy_lines(report: ComparisonWithAnswer) -> Iterator[str]:
    """Yield the energy balance with moving or thermal walls, and notes on its use."""
    if not report.scene.fed:
        return
    hard, soft = measures.balance(report.hard), measures.balance(report.soft)
    yield "\nenergy, J"
    for name, words in measures.BALANCE_LABELS.items():
        if hard[name] or soft[name]:  # terms that are 0 in both runs are left out; nan is shown
            yield _table_line(words, number(hard[name]), number(soft[name]))
    if report.scene.driven:
        yield "The duration of a contact shifts the phase of the next one, so timing matters at a driven wall."
    if report.scene.heated:
        yield "Both runs draw the same sequence of speeds at thermal walls; single balls diverge after some time."


def _table_line(name: str, hard: Any, soft: Any, mark: str = "") -> str:
    return f"{name:26}{hard:>15}{soft:>15}{mark}"


def _uncompared_lines(report: ComparisonWithAnswer) -> Iterator[str]:
    """Yield a line on contacts of settling balls that only one run has.

    The comparison ignores such contacts.
    """
    further, fastest, runs = 0, 0.0, (report.settled, report.soft)
    for c in np.flatnonzero(np.not_equal(*map(counts, runs)) & ~report.other_counts).tolist():
        fewer, more = sorted((run.of(c) for run in runs), key=len)
        further += len(more) - len(fewer)
        fastest = max(fastest, float(np.abs(np.diff(more["v_in"][len(fewer):])).max()))
    if further:
        scale, unit = unit_of(fastest, "m/s", 1.0)
        yield (f"{further} further bounce{'s' * (further > 1)} {'are' if further > 1 else 'is'} not compared: at most "
               f"{fastest / scale:.3g} {unit}")


def _ignored_counts(report: ComparisonWithAnswer) -> tuple[int, int]:
    """Numbers of hard and of soft contacts at rounding level, which are ignored."""
    hard, soft = report.counted
    return len(report.settled.contacts) - len(hard.contacts), len(report.soft.contacts) - len(soft.contacts)


def _reason_lines(report: ComparisonWithAnswer) -> Iterator[str]:
    """Yield the reason why the engines differ, and the number of isolated contacts."""
    shared = report.overlaps
    if not shared and isolation.isolated_share(report.continued[1]) < 1.0:
        yield "Why: contacts that overlap in time exert no relevant force; only the finite durations differ."
    elif not shared:
        yield "Why: no two contacts of neighbouring pairs overlap in time; only the finite durations differ."
    else:
        yield from _overlap_lines(report)
    yield from filter(None, [isolation.sentence(report.soft)])


def _overlap_lines(report: ComparisonWithAnswer) -> Iterator[str]:
    """Yield the reason for overlapping contacts, with up to four overlaps."""
    shared, log = report.overlaps, report.counted[1].contacts
    count = len({row for o in shared for row in (o.lower, o.upper)})
    yield f"Why: {count} contacts of neighbouring pairs overlap in time{', beginning with' * (len(shared) > 1)}:"
    for o in shared[:4]:
        below, above = log[o.lower], log[o.upper]
        lower, upper = (report.scene.pairs.name(int(row["pair"])) for row in (below, above))
        yield (
            f"  pairs {lower} and {upper} at t = {o.begin:.9g} s for {duration(o.end - o.begin)} "
            f"(they last {duration(below['duration'])} and {duration(above['duration'])})"
        )


def _error_values(report: ComparisonWithAnswer) -> dict[str, Any]:
    """Return the error, and its unit as text. The unit is left out if the error is 0."""
    unit = f", {float(report.units[report.errors.argmax()]):.3g} m/s" if report.error > 0.0 else ""
    return {"error": report.error, "unit": unit}


def _format_known(formats: dict[str, str], values: dict[str, Any]) -> list[str]:
    """Format all texts whose values are not nan.

    Parameters
    ----------
    formats : dict
        Format string for each name.
    values : dict
        Value for each name.
    """
    return [text.format(**values) for name, text in formats.items() if not math.isnan(values.get(name, math.nan))]

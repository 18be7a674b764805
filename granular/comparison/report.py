"""Text and numbers of a comparison: the printed report, and the content of JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.reports import (
    described,
    duration,
    named_pairs,
    number,
    pairs_by_law,
    percent,
    problem,
    shortened,
    unit_of,
)
from granular.comparison import measures
from granular.comparison.numbers import smaller_radius
from granular.comparison.outcome import ERROR_LIMIT, MIN_CONTACT_STRENGTH, PairOutcome
from granular.laws.kinds import resolved
from granular.md import isolation
from granular.run.trajectory import Status, Trajectory
from granular.run.until import Contact

if TYPE_CHECKING:
    from granular.comparison.answer import Judged

SHORT_PAIR_COUNT, FULL_PAIR_COUNT = 2, 8
"""Pairs listed in the short report; pairs or laws listed in the full report."""
SAME_RESTITUTION = 1e-9
"""Difference of ε below which two values are equal."""
OVERLAP_SHARES = 0.5 ** np.arange(16)
"""Shares of the largest overlap at which force laws are checked for attraction."""
MIN_DENSITY, MAX_DENSITY, MAX_WAVE_SPEED = 0.15, 23_000.0, 20_000.0
"""Limits of solids: densities in kg/m³, and the speed of sound in m/s.

Aerographene has 0.16 and osmium 22 590 kg/m³, and diamond 18 000 m/s. The speed of sound has no lower limit:
soft balls have deep overlaps, which are reported.
"""
MEASURE_FORMATS = {
    "error": f"error = {{error:.3g}} of the fastest impact (hard spheres are valid up to {ERROR_LIMIT:g})",
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


def text(report: Judged) -> str:
    """Return the short report of up to 20 lines.

    It contains the verdict, its reason, and the largest difference of the engines.
    """
    first, *more = warnings(report) or [""]
    return "\n".join(
        [
            report.verdict,
            *list(_why(report))[:2],
            "",
            f"{shortened(described(report.scene))}, {_eps(report.restitution_spec)}",
            "",
            *_head(),
            *_rises(report),
            *_deciding(report),
            *_pairs(report, SHORT_PAIR_COUNT),
            *_ends(report),
            *_known(MEASURE_FORMATS, {"error": report.error}),
            *[f"warning: {first}" + f" (and {len(more)} more)" * bool(more)] * bool(first),
            DETAILS_HINT,
        ]
    )


def details(report: Judged) -> str:
    """Return the full report."""
    from granular.comparison.further import floor_share

    return "\n".join([
        report.verdict, *_why(report), "",
        described(report.scene), *_laws(report), "",
        *_head(), *_rises(report), *_deciding(report), *_pairs(report, FULL_PAIR_COUNT, speeds=True),
        *_ends(report), *_account(report), "",
        *_known(MEASURE_FORMATS, {"error": report.error} | report.measures | {"floor_share": floor_share(report)}),
        "groups: " + ", ".join(_known(GROUP_FORMATS, report.groups)),
        *(f"warning: {w}" for w in warnings(report)),
    ])


def warnings(report: Judged) -> list[str]:
    """Return warnings about the input.

    They are different ε of law and rule, merged balls, attraction, properties of no solid, and deep overlaps.
    """
    return [*_two_restitutions(report), *_merged(report), *_attraction(report), *_no_solid(report), *_extremes(report)]


def _two_restitutions(report: Judged) -> Iterator[str]:
    """Warn about pairs whose hard spheres have another ε than their force law."""
    hard, law = np.array(report.restitution_spec), np.array(report.law_restitution)
    differ = np.flatnonzero(np.abs(hard - law) > SAME_RESTITUTION)
    for c in differ[:1]:
        pair = report.scene.pairs.name(int(c))
        yield (f"hard spheres of pair {pair}{_and(differ)} collide with ε = {hard[c]:.6g}, but their force law has "
               f"{law[c]:.6g}")


def _merged(report: Judged) -> Iterator[str]:
    """Warn about hard spheres that merge or collide elastically by an option."""
    many, below = report.hard.stats.get("merged", 0), report.hard.stats.get("merge_below", math.inf)
    if many and below < math.inf:
        yield f"{many} hard collisions below {below:.3g} m/s were merged; the result depends on that speed"
    yield from (f"hard spheres run with {name} = {value:.3g} {unit}; the result depends on it, see remedies()"
                for name, unit in (("tc", "s"), ("elastic_below", "m/s")) if (value := report.hard_options[name]))


def _attraction(report: Judged) -> Iterator[str]:
    """Warn about force laws that attract at rest at an overlap that a contact reaches.

    Engines clip this force to 0. A dashpot attracts only while balls separate.
    """
    log, (kind, each) = report.soft.contacts, resolved(report.law, report.scene).in_pairs
    depth = np.zeros(len(each))
    np.maximum.at(depth, kind[log["pair"]], log["xi_max"])
    for c, (law, deepest) in enumerate(zip(each, depth.tolist(), strict=True)):
        pulls = [xi for xi in deepest * OVERLAP_SHARES if law.force(xi, 0.0, xi) < 0.0] if law.form is None else []
        if pulls:
            pair = int(np.flatnonzero(kind == c)[0])
            yield (f"the law of pair {report.scene.pairs.name(pair)} attracts at an overlap of {max(pulls):.2g} m; "
                   "attractive contact forces are replaced by 0")


def _no_solid(report: Judged) -> Iterator[str]:
    """Warn about densities, or speeds of contact waves, that no solid has.

    The speed is 2 R √(∂F/∂ξ / m_eff). The usual reason are wrong units.
    """
    scene = report.scene
    slope = resolved(report.law, scene).column(lambda law: law.impact_stiffness(report.impact_speed))
    with np.errstate(all="ignore"):
        density = scene.mass / (4.0 / 3.0 * math.pi * scene.radius**3)
        waves = 2.0 * smaller_radius(scene) * np.sqrt(slope / scene.pairs.m_eff)
    balls = ~scene.is_wall & (scene.radius > 0.0)
    odd = np.flatnonzero(balls & ~((density >= MIN_DENSITY) & (density <= MAX_DENSITY)))
    for i in odd[:1]:
        yield (f"density of ball {i}{_and(odd)} is {density[i]:.2g} kg/m³, which no solid has: are radii in m and "
               "masses in kg?")
    fast = np.flatnonzero((waves > MAX_WAVE_SPEED) & (waves < math.inf))
    for c in fast[:1] if not len(odd) else ():
        yield (f"waves in the contact of pair {scene.pairs.name(c)}{_and(fast)} travel at {waves[c]:.2g} m/s, faster "
               "than sound in any solid: is its stiffness in SI units?")


def _and(some: Any) -> str:
    """Return the text for further balls or pairs."""
    return f" (and of {len(some) - 1} more)" if len(some) > 1 else ""


def _extremes(report: Judged) -> Iterator[str]:
    """Warn about deep overlaps, and speeds near the speed of sound, 2 π R / t_c.

    Both are meaningless for an unstable run.
    """
    if report.soft.status is Status.unstable:
        return
    run = report.counted[1]
    order, edge = run.by_pair
    met, log = np.flatnonzero(np.diff(edge)), run.contacts[order]
    size = smaller_radius(report.scene)[met]
    deepest, fastest = (np.maximum.reduceat(values, edge[met])
                        for values in (log["xi_max"], np.abs(log["v_in"][:, 0] - log["v_in"][:, 1])))
    shortest = np.minimum.reduceat(log["duration"], edge[met])
    depths, speeds = deepest / size, fastest * (shortest / (2.0 * math.pi * size))
    name = report.scene.pairs.name
    for c, depth, speed in zip(met.tolist(), depths, speeds, strict=True):
        if depth > 0.1:
            yield (f"pair {name(c)} overlaps by {percent(depth)} of the smaller radius; force laws are valid up to "
                   "about 10 %")
        if speed > 0.1:
            yield f"pair {name(c)} collides at {percent(speed)} of the speed of contact waves"


def numbers(report: Judged) -> dict[str, Any]:
    """Return all numbers."""
    return {
        **problem(report),
        "rule": repr(report.rule),
        "pairs": [asdict(p) for p in report.pairs],
        "rounding_contacts": dict(zip(("hard", "soft"), _left_out(report), strict=True)),
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
        "reasons": [asdict(one) | {"answer": one.answer.name} for one in report.reasons],
        "verdict": report.verdict,
        "warnings": warnings(report),
        "hard": _run(report.hard),
        "soft": _run(report.soft),
    }


def _run(run: Trajectory) -> dict[str, Any]:
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


def _laws(report: Judged) -> list[str]:
    """Return a line for each law, or for each pair, and one for the collision rule."""
    eps, n = np.array(report.law_restitution), len(report.law)
    of_law = pairs_by_law(report.law)
    few = len(of_law) > 1 and n <= FULL_PAIR_COUNT
    rows = [(repr(law), [c]) for c, law in enumerate(report.law)] if few else list(of_law.items())
    return [
        *(_law(named_pairs(some, n, report.scene.pairs.name), law, eps[some]) for law, some in rows[:FULL_PAIR_COUNT]),
        *[f"({len(rows) - FULL_PAIR_COUNT} more laws not shown)"] * (len(rows) > FULL_PAIR_COUNT),
        _law("rule", repr(report.rule), np.array(report.restitution_spec)),
    ]


def _law(of: str, text: str, eps: Any) -> str:
    return f"{of:<13} {text if len(text) <= 80 else f'{text[:77]}…'}   {_eps(eps)}"


def _eps(of: Any) -> str:
    low, high = float(min(of)), float(max(of))
    return f"ε = {low:.6g}" + f" … {high:.6g}" * (high - low > SAME_RESTITUTION)


def _head() -> Iterator[str]:
    """Yield the header of the table."""
    yield _line("", "hard spheres", "soft spheres")
    yield _line("", "(event-driven)", "(Newton)")


def _rises(report: Judged) -> Iterator[str]:
    """Yield the rises of the top ball after the first and the last bounce."""
    if math.isnan(report.drop):
        return
    last = report.until.nth - 1 if isinstance(report.until, Contact) and report.until.pair == 0 else 1
    for bounce in sorted({1, max(1, last)}):
        hard, soft = (number(rise / report.drop) for rise in report.rises(bounce))
        yield _line(f"rise of ball {report.scene.n - 1}, drops", hard, soft,
                    f"  of {report.drop:.4g} m" + f", bounce {bounce}" * (bounce > 1))


def _deciding(report: Judged) -> Iterator[str]:
    """Yield the ball and the episode with the largest error, for both engines."""
    one = report.deciding
    if one is not None:
        yield _line(f"ball {one.ball} leaves, m/s", number(one.hard_velocity), number(one.soft_velocity),
                    f"  error {percent(one.difference)}")
        yield _line("at t, s", f"{one.hard_t:.9g}", f"{one.soft_t:.9g}",
                    f"  episode {one.episode}, {one.contacts} contact{'s' * (one.contacts != 1)}")


def _ends(report: Judged) -> Iterator[str]:
    """Yield numbers of contacts and ends of the runs."""
    hard, soft = report.hard, report.soft
    yield _line("all contacts", len(report.settled.contacts), len(soft.contacts))
    if any(left := _left_out(report)):
        yield _line("rounding errors, ignored", *left, f"  below {MIN_CONTACT_STRENGTH:g} of U")
    yield from _not_compared(report)
    because = ", ".join(dict.fromkeys((hard.status.name, soft.status.name)))
    at = hard.stats.get("collapse_time", hard.time[-1])
    yield _line("ended at t, s", f"{at:.9g}", f"{soft.time[-1]:.9g}", f"  {because}")
    if not math.isnan(ratio := report.restitution_ratio):
        yield _line("ε_eff / ε_spec", 1, f"{ratio:.6g}")


def _pairs(report: Judged, most: int, speeds: bool = False) -> Iterator[str]:
    """Yield contacts and separation speeds of the `most` pairs that differ most."""
    shown = sorted(sorted(report.pairs, key=_difference_key)[:most], key=lambda p: p.pair)
    name = report.scene.pairs.name
    for p in shown:
        yield _line(f"contacts of pair {name(p.pair)}", p.hard_contacts, p.soft_contacts)
        if speeds:
            yield _line(f"v_rel′ pair {name(p.pair)}, m/s", number(p.hard_v_rel), number(p.soft_v_rel),
                        "  still in contact at the stop" if p.ongoing else _neighbour_mark(report, p))
    if hidden := len(report.pairs) - len(shown):
        yield f"({hidden} more pair{'s' * (hidden > 1)}, which differ{'s' * (hidden == 1)} less)"


def _neighbour_mark(report: Judged, p: PairOutcome) -> str:
    """Mark a separation speed while a neighbouring soft contact is running."""
    soft, (below, above) = report.levelled[1], report.scene.neighbours
    for c in {*below[above == p.pair].tolist(), *above[below == p.pair].tolist()}:
        log = soft.of(c)
        if ((log["t_begin"] < p.soft_t_f) & ~(log["t_end"] <= p.soft_t_f)).any():
            return f"  pair {report.scene.pairs.name(c)} in contact"
    return ""


def _difference_key(p: PairOutcome) -> tuple[bool, float]:
    """Sort key: pairs that differ most come first."""
    return p.hard_contacts == p.soft_contacts, -float(np.nan_to_num(abs(p.soft_v_rel - p.hard_v_rel), nan=-1.0))


def _account(report: Judged) -> Iterator[str]:
    """Yield the energy balance of moving or thermal walls, with notes on its use."""
    if not report.scene.fed:
        return
    hard, soft = measures.balance(report.hard), measures.balance(report.soft)
    yield "\nenergy, J"
    for name, words in measures.BALANCE_LABELS.items():
        if hard[name] or soft[name]:  # what is 0 in both is not shown; nan is
            yield _line(words, number(hard[name]), number(soft[name]))
    if report.scene.driven:
        yield "The duration of a contact shifts the phase of the next one, so timing matters at a driven wall."
    if report.scene.heated:
        yield "Both runs draw the same sequence of speeds at thermal walls; single balls diverge after some time."


def _line(name: str, hard: Any, soft: Any, mark: str = "") -> str:
    return f"{name:26}{hard:>15}{soft:>15}{mark}"


def _not_compared(report: Judged) -> Iterator[str]:
    """Yield a line on further contacts of balls that settle in one of the two runs."""
    further, fastest = 0, 0.0
    for p in report.pairs:
        fewer, more = sorted((run.of(p.pair) for run in (report.settled, report.soft)), key=len)
        if not report.other_counts[p.pair] and len(more) > len(fewer):
            further += len(more) - len(fewer)
            fastest = max(fastest, float(np.abs(np.diff(more["v_in"][len(fewer):])).max()))
    if further:
        scale, unit = unit_of(fastest, "m/s", 1.0)
        yield (f"{further} further bounce{'s' * (further > 1)} {'are' if further > 1 else 'is'} not compared: at most "
               f"{fastest / scale:.3g} {unit}")


def _left_out(report: Judged) -> tuple[int, int]:
    """Numbers of hard and of soft contacts at rounding level, which are ignored."""
    hard, soft = report.counted
    return len(report.settled.contacts) - len(hard.contacts), len(report.soft.contacts) - len(soft.contacts)


def _why(report: Judged) -> Iterator[str]:
    """Yield the reason why the engines differ, and how many contacts are isolated."""
    shared = report.overlaps
    if not shared and report.measures["isolated_share"] < 1.0:
        yield "Why: contacts that overlap in time exert no relevant force; only the finite durations differ."
    elif not shared:
        yield "Why: no two contacts of neighbouring pairs overlap in time; only the finite durations differ."
    else:
        yield from _overlaps(report)
    yield from filter(None, [isolation.sentence(report.soft)])


def _overlaps(report: Judged) -> Iterator[str]:
    """Yield the first contacts that overlap in time."""
    shared, log = report.overlaps, report.counted[1].contacts
    some = f"{len(shared)} contacts overlap" if len(shared) > 1 else "1 contact overlaps"
    first = "; the first" * (len(shared) > 1)
    yield f"Why: {some} in time with a contact of a neighbouring pair{first}:"
    for o in shared[:4]:
        below, above = log[o.lower], log[o.upper]
        lower, upper = (report.scene.pairs.name(int(one["pair"])) for one in (below, above))
        yield (
            f"  pairs {lower} and {upper} at t = {o.begin:.9g} s for {duration(o.end - o.begin)} "
            f"(they last {duration(below['duration'])} and {duration(above['duration'])})"
        )


def _known(texts: dict[str, str], values: dict[str, float]) -> list[str]:
    """Return the texts whose values are not nan."""
    return [text.format(**values) for name, text in texts.items() if not math.isnan(values.get(name, math.nan))]

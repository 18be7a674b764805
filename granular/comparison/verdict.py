"""May this scene be event-driven? The answer in one line."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from granular.comparison.numbers import Compared
from granular.measures import ROUNDING
from granular.outcome import SAME, PairOutcome, has_memory
from granular.timing import SMALL
from granular.trajectory import EARLY


def verdict(report: Compared) -> str:
    """One line: may this scene be event-driven?"""
    return next(_answers(report))


def _answers(report: Compared) -> Iterator[str]:
    """What may be said of two runs, the first thing first; only what is asked for is computed."""
    for name, run in (("soft-sphere", report.soft), ("event-driven", report.hard)):
        if run.status in EARLY:
            yield f"No verdict: the {name} run did not get to its end; {run.status.name}: {run.message}"
    if not len(report.counted[0].contacts):
        yield from _no_collision(report)
    yield from _endless(report)
    yield from _not_unique(report)
    if report.measures["predictability"] > SAME:
        share = 100.0 * report.measures["shared_impulse"]
        shared = "" if math.isnan(share) else f"; {share:.2g} % of the impulse is shared"
        yield f"Not ball by ball: beyond predictability (compare ensembles){shared}."
    wrong = [p for p in report.pairs if p.hard_contacts != p.soft_contacts]
    if report.scene.driven and not report.only_timing:
        yield from _out_of_phase(report, wrong)
    if wrong:
        yield _other_counts(report, wrong)
    if math.isnan(report.error):
        yield "No verdict: no contact has come to its end."
    isolated = report.measures["isolated_share"]
    if report.error > SAME:
        though = ", though every contact is isolated" if isolated == 1.0 else ""
        yield f"No: outcomes are off by {report.error:.2g} of the impact speed{though}."
    if isolated == 1.0:
        yield f"Yes: every contact is binary (certified), and {_agree(report)}."
    if report.measures["shared_impulse"] > ROUNDING:
        yield f"Yes, within {report.error:.1g} of the impact speed, though contacts overlap in time."
    if isolated < 1.0:
        yield f"Yes: contacts that overlap in time share no impulse that counts, and {_agree(report)}."
    yield f"Yes: every contact is binary, and {_agree(report)}."


def _no_collision(report: Compared) -> Iterator[str]:
    """Hard spheres do not collide: soft ones do not either, or rest on each other and sink under their weight."""
    hard, log = report.counted[0], report.counted[1].contacts
    if not len(log):
        yield "Yes, trivially: nothing collides."
    elif (hard.gap[-1][log["pair"]] == 0.0).all():
        depth = float(log["xi_max"].max())
        radius = min((float(r) for r in report.scene.radius if r > 0.0), default=math.inf)
        if depth > SAME * radius:
            yield f"No: nothing collides, but soft spheres sink by {depth / radius:.2g} of a radius under their weight."
        yield f"Yes, trivially: nothing collides; soft spheres overlap by {depth:.3g} m under their weight."


def _endless(report: Compared) -> Iterator[str]:
    """A soft contact that fills much of the run, or has no end in sight, while the hard spheres have bounced."""
    span = float(report.soft.time[-1] - report.soft.time[0])
    parting, soft = np.diff(report.hard.velocity[-1]), report.counted[1]
    for p in [p for p in report.pairs if p.ongoing]:
        lasted = float(soft.of(p.pair)["duration"][-1])
        moving = max(abs(float(parting[p.pair])), abs(p.hard_v_rel)) > SAME * report.impact_speed
        if moving and (lasted > SMALL * span or (math.isnan(p.soft_v_rel) and not has_memory(soft))):
            yield (
                f"No: a soft contact of pair {p.pair} has lasted {lasted:.3g} of the {span:.3g} s of the run and is "
                "not over; hard spheres part at once."
            )


def _not_unique(report: Compared) -> Iterator[str]:
    """Balls that touch or collide at once, where tie rules differ: no hard-sphere answer is the right one."""
    worst, error = max(report.tie_errors.items(), key=lambda item: item[1], default=("", 0.0))
    if error > SAME:
        yield (
            "Not uniquely: balls that touch or collide at once have no one hard-sphere answer; here it hangs on the "
            f"tie rule: {report.hard_options['ties']} and {worst} differ by {error:.2g} of the impact speed."
        )
    if report.measures["predictability"] > SAME and (report.scene.gap == 0.0).any():
        yield "Not uniquely: touching balls have no one hard-sphere answer; here it hangs on the tie rule (ties=)."
    if report.measures["predictability"] <= SAME < report.shift_error:
        yield (
            "Not uniquely: hard spheres from gaps shifted by 1e-12 of themselves, as where balls collide almost at "
            f"once, differ by {report.shift_error:.2g} of the impact speed."
        )


def _out_of_phase(report: Compared, wrong: list[PairOutcome]) -> Iterator[str]:
    """Runs that part where a wall is driven: a lag there changes velocities, and is no error of timing alone."""
    if wrong or report.error > SAME:
        some = f"; {len(wrong)} of {len(report.pairs)} pairs differ in contacts" if wrong else ""
        off = "" if math.isnan(report.error) else f"outcomes are off by {report.error:.2g} of the impact speed{some}; "
        yield f"Not ball by ball: {off}at a driven wall timing is outcome (compare thresholds, means, ensembles)."


def _other_counts(report: Compared, wrong: list[PairOutcome]) -> str:
    """Pairs with other numbers of contacts, unless only the tie rule or the end time decides that."""
    n = len(report.pairs)
    if report.only_timing:
        return (
            f"Yes, except for timing: the contacts are the same, yet {len(wrong)} of {n} pairs have one "
            "on the other side of t_end."
        )
    p = max(reversed(wrong), key=_miss)
    said = f"pair {p.pair} has {p.soft_contacts} contact{'s' * (p.soft_contacts != 1)}, not {p.hard_contacts}"
    many = f"{len(wrong)} of {n} pairs differ in contacts; " if len(wrong) > 1 else ""
    if not report.error <= SAME:
        return f"No: {many}{said}{_parting(p, report)}."
    if not all(report.unsettled_counts[p.pair] for p in wrong):
        return f"No: {many}{said}, though {_agree(report)}."
    return (
        f"Yes: {_agree(report)}, though {said}; in which order balls collide that meet at once decides no more than "
        "that."
    )


def _agree(report: Compared) -> str:
    return f"outcomes agree within {max(report.error, 1e-16):.1g} of the impact speed"


def _miss(p: PairOutcome) -> float:
    """How far the separation speeds of a pair are apart in m/s."""
    return float(np.nan_to_num(abs(p.soft_v_rel - p.hard_v_rel), nan=-1.0))


def _parting(p: PairOutcome, report: Compared) -> str:
    """How a pair parts in the soft run, or how far others are off if that is not what is wrong."""
    if p.ongoing and math.isnan(p.soft_v_rel):
        return ", and is still in contact"
    if _miss(p) > SAME * report.impact_speed:
        return f", and parts at {p.soft_v_rel:.4g} instead of {p.hard_v_rel:.4g} m/s"
    return "" if math.isnan(report.error) else f", and outcomes are off by {report.error:.2g} of the impact speed"

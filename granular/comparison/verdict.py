"""May this scene be event-driven? The answer in one line."""

from __future__ import annotations

import math

import numpy as np

from granular.comparison.numbers import Compared
from granular.measures import ROUNDING
from granular.outcome import SAME, PairOutcome, has_memory
from granular.timing import SMALL
from granular.trajectory import EARLY


def verdict(report: Compared) -> str:
    """One line: may this scene be event-driven?"""
    return (
        _unfinished(report) or _no_collision(report) or _endless(report) or _not_unique(report)
        or _unpredictable(report) or _counts(report) or _outcomes(report)
    )  # fmt: skip


def _unfinished(report: Compared) -> str:
    """Nothing is claimed of a run that did not get to its end."""
    for name, run in (("soft-sphere", report.soft), ("event-driven", report.hard)):
        if run.status in EARLY:
            return f"No verdict: the {name} run did not get to its end; {run.status.name}: {run.message}"
    return ""


def _no_collision(report: Compared) -> str:
    """Hard spheres that do not collide: soft ones do not either, or rest on each other and sink under their weight."""
    hard, soft = report.counted
    if len(hard.contacts):
        return ""
    if not len(soft.contacts):
        return "Yes, trivially: nothing collides."
    if not (hard.gap[-1][soft.contacts["pair"]] == 0.0).all():
        return ""
    depth = float(soft.contacts["xi_max"].max())
    radius = min((float(r) for r in report.scene.radius if r > 0.0), default=math.inf)
    if depth > SAME * radius:
        return f"No: nothing collides, but soft spheres sink by {depth / radius:.2g} of a radius under their weight."
    return f"Yes, trivially: nothing collides; soft spheres overlap by {depth:.3g} m under their weight."


def _endless(report: Compared) -> str:
    """A soft contact that fills much of the run, or has no end in sight, while the hard spheres have bounced."""
    span = float(report.soft.time[-1] - report.soft.time[0])
    parting, soft = np.diff(report.hard.velocity[-1]), report.counted[1]
    for p in report.pairs:
        if not p.ongoing:
            continue
        lasted = float(soft.of(p.pair)["duration"][-1])
        moving = max(abs(float(parting[p.pair])), abs(p.hard_v_rel)) > SAME * report.impact_speed
        if moving and (lasted > SMALL * span or (math.isnan(p.soft_v_rel) and not has_memory(soft))):
            return (
                f"No: a soft contact of pair {p.pair} has lasted {lasted:.3g} of the {span:.3g} s of the run and is "
                "not over; hard spheres part at once."
            )
    return ""


def _not_unique(report: Compared) -> str:
    """Balls that touch or collide at once, where tie rules differ: no hard-sphere answer is the right one."""
    errors = report.tie_errors
    worst = max(errors, key=lambda name: errors[name], default="")
    if worst and errors[worst] > SAME:
        return (
            "Not uniquely: balls that touch or collide at once have no one hard-sphere answer; here it hangs on the "
            f"tie rule: {report.hard_options['ties']} and {worst} differ by {errors[worst]:.2g} of the impact speed."
        )
    if report.measures["predictability"] > SAME and (report.scene.gap == 0.0).any():
        return "Not uniquely: touching balls have no one hard-sphere answer; here it hangs on the tie rule (ties=)."
    if report.measures["predictability"] <= SAME < report.shift_error:
        return (
            "Not uniquely: hard spheres from gaps shifted by 1e-12 of themselves, as where balls collide almost at "
            f"once, differ by {report.shift_error:.2g} of the impact speed."
        )
    return ""


def _unpredictable(report: Compared) -> str:
    m = report.measures
    if not m["predictability"] > SAME:
        return ""
    share = 100.0 * m["shared_impulse"]
    shared = "" if math.isnan(share) else f"; {share:.2g} % of the impulse is shared"
    return f"Not ball by ball: beyond predictability (compare ensembles){shared}."


def _counts(report: Compared) -> str:
    """Pairs with other numbers of contacts, unless only the tie rule or the end time decides that."""
    wrong = [p for p in report.pairs if p.hard_contacts != p.soft_contacts]
    if not wrong:
        return ""
    if report.only_timing:
        return (
            f"Yes, but for timing: the contacts are the same, yet {len(wrong)} of {len(report.pairs)} pairs have one "
            "on the other side of t_end."
        )
    p = max(reversed(wrong), key=_miss)
    said = f"pair {p.pair} has {contacts(p.soft_contacts)}, not {p.hard_contacts}"
    many = f"{len(wrong)} of {len(report.pairs)} pairs differ in contacts; " if len(wrong) > 1 else ""
    if not report.error <= SAME:
        return f"No: {many}{said}{_parting(p, report)}."
    same = f"outcomes agree within {max(report.error, 1e-16):.1g} of the impact speed"
    if all(report.unsettled_counts[p.pair] for p in wrong):
        return f"Yes: {same}, though {said}; in which order balls collide that meet at once decides no more than that."
    return f"No: {many}{said}, though {same}."


def _outcomes(report: Compared) -> str:
    if math.isnan(report.error):
        return "No verdict: no contact has come to its end."
    if report.error > SAME:
        return f"No: outcomes are off by {report.error:.2g} of the impact speed."
    if report.measures["shared_impulse"] > ROUNDING:
        return f"Yes, within {report.error:.1g} of the impact speed, though contacts overlap in time."
    error = max(report.error, 1e-16)
    return f"Yes: every contact is binary, and outcomes agree within {error:.1g} of the impact speed."


def _miss(p: PairOutcome) -> float:
    """How far the separation speeds of a pair are apart in m/s."""
    miss = abs(p.soft_v_rel - p.hard_v_rel)
    return -1.0 if math.isnan(miss) else miss


def _parting(p: PairOutcome, report: Compared) -> str:
    """How a pair parts in the soft run, or how far others are off if that is not what is wrong."""
    if p.ongoing and math.isnan(p.soft_v_rel):
        return ", and is still in contact"
    if _miss(p) > SAME * report.impact_speed:
        return f", and parts at {p.soft_v_rel:.4g} instead of {p.hard_v_rel:.4g} m/s"
    return "" if math.isnan(report.error) else f", and outcomes are off by {report.error:.2g} of the impact speed"


def contacts(n: int, verb: str = "") -> str:
    """So many contacts, and what they do."""
    noun = "contact" if n == 1 else "contacts"
    return f"{n} {noun}" + (f" {verb}{'s' if n == 1 else ''}" if verb else "")

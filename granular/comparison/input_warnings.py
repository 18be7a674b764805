"""Warnings about the input of a comparison: laws, rules, units and overlaps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.reports import percent
from granular.comparison.numbers import smaller_radius
from granular.laws.kinds import resolved
from granular.run.trajectory import Status

if TYPE_CHECKING:
    from granular.comparison.answer import ComparisonWithAnswer

SAME_RESTITUTION = 1e-9
"""Difference of ε below which two values are equal."""
OVERLAP_FRACTIONS = 0.5 ** np.concatenate([np.arange(16), [24, 32, 40, 48]])
"""Fractions of the largest overlap at which force laws are tested for attraction.

The smallest fractions find weak adhesion.
"""
MIN_DENSITY, MAX_DENSITY, MAX_WAVE_SPEED = 0.15, 23_000.0, 20_000.0
"""Limits of solids: density in kg/m³, and speed of sound in m/s.

Aerographene has 0.16 and osmium 22 590 kg/m³, and diamond 18 000 m/s. The speed of sound has no lower limit:
soft balls have deep overlaps, which are reported.
"""
DEPTH_WARNING = "pair {pair} overlaps by {share} of the smaller radius{others}; force laws are valid up to about 10 %"
SPEED_WARNING = "pair {pair} collides at {share} of the speed of contact waves{others}"
MAX_FRACTION, MAX_NAMED_PAIRS = 0.1, 3  # largest overlap and speed without a warning; pairs that a warning names


def warnings(report: ComparisonWithAnswer) -> list[str]:
    """Return warnings about the input, one sentence each.

    The warnings concern attractive force laws, different ε of law and rule, merged balls, properties that no solid has,
    and deep overlaps. Attraction is first, because both models omit it.
    """
    return [*_attraction_warnings(report), *_restitution_warnings(report), *_remedy_warnings(report),
            *_solid_warnings(report), *_overlap_and_speed_warnings(report)]


def short_warning_lines(report: ComparisonWithAnswer) -> list[str]:
    """Warnings in at most two lines.

    If there are three or more, the second line contains the facts without their explanations.
    """
    first, *more = warnings(report) or [""]
    facts = ["; ".join(one.partition(";")[0] for one in more)] if len(more) > 1 else more
    return [f"warning: {one}" for one in (first, *facts) if one]


def _restitution_warnings(report: ComparisonWithAnswer) -> Iterator[str]:
    """Warn if hard spheres have another ε than their force law.

    Only the first such pair is named.
    """
    hard, law = np.array(report.restitution_spec), np.array(report.law_restitution)
    differing = np.flatnonzero(np.abs(hard - law) > SAME_RESTITUTION)
    for c in differing[:1]:
        pair = report.scene.pairs.name(int(c))
        yield (f"hard spheres of pair {pair}{_further_count(differing)} collide with ε = {hard[c]:.6g}, but their "
               f"force law has {law[c]:.6g}")


def _remedy_warnings(report: ComparisonWithAnswer) -> Iterator[str]:
    """Warn if hard spheres merge, use the TC model, or have an elastic cut-off."""
    merged, below = report.hard.stats.get("merged", 0), report.hard.stats.get("merge_below", math.inf)
    if merged and below < math.inf:
        yield f"{merged} hard collisions below {below:.3g} m/s were merged; the result depends on that speed"
    yield from (f"hard spheres run with {name} = {value:.3g} {unit}; the result depends on it, see remedies()"
                for name, unit in (("tc", "s"), ("elastic_below", "m/s")) if (value := report.hard_options[name]))


def _attraction_warnings(report: ComparisonWithAnswer) -> Iterator[str]:
    """Warn about force laws that are attractive at rest at an overlap that occurred.

    Engines replace an attractive contact force by 0. Laws of the form F = k ξ^p + damping are not tested: they attract
    only while balls separate.
    """
    log, (kind, each) = report.soft.contacts, resolved(report.law, report.scene).in_pairs
    depth = np.zeros(len(kind))
    np.fmax.at(depth, log["pair"], log["xi_max"])
    for c, law in enumerate(each):
        pair = int(np.argmax(np.where(kind == c, depth, -1.0)))
        attractive = [xi for xi in float(depth[pair]) * OVERLAP_FRACTIONS
                      if law.force(xi, 0.0, xi) < 0.0] if law.form is None and depth[pair] > 0.0 else []
        if attractive:
            yield (f"the law of pair {report.scene.pairs.name(pair)} attracts at an overlap of {max(attractive):.2g} "
                   "m; the attraction is clipped to 0, so neither model has adhesion")


def _solid_warnings(report: ComparisonWithAnswer) -> Iterator[str]:
    """Warn about densities, or speeds of contact waves, that no solid has.

    The speed is 2 R √(∂F/∂ξ / m_eff). The usual reason is wrong units.
    """
    scene = report.scene
    slope = resolved(report.law, scene).column(lambda law: law.impact_stiffness(report.impact_speed))
    with np.errstate(all="ignore"):
        density = scene.mass / (4.0 / 3.0 * math.pi * scene.radius**3)
        waves = 2.0 * smaller_radius(scene) * np.sqrt(slope / scene.pairs.m_eff)
    balls = ~scene.is_wall & (scene.radius > 0.0)
    unusual = np.flatnonzero(balls & ~((density >= MIN_DENSITY) & (density <= MAX_DENSITY)))
    for i in unusual[:1]:
        yield (f"density of ball {i}{_further_count(unusual)} is {density[i]:.2g} kg/m³, which no solid has: are radii "
               "in m and masses in kg?")
    fast = np.flatnonzero((waves > MAX_WAVE_SPEED) & (waves < math.inf))
    for c in fast[:1] if not len(unusual) else ():
        yield (f"waves in the contact of pair {scene.pairs.name(c)}{_further_count(fast)} travel at {waves[c]:.2g} "
               "m/s, faster than sound in any solid: is its stiffness in SI units?")


def _further_count(items: Any) -> str:
    """Text for the number of further balls or pairs in `items`, "" for one."""
    return f" (and of {len(items) - 1} more)" if len(items) > 1 else ""


def _overlap_and_speed_warnings(report: ComparisonWithAnswer) -> Iterator[str]:
    """Warn about deep overlaps, and about collisions near the speed of contact waves.

    The speed of contact waves is 2 π R / t_c. Unstable runs are ignored because their overlaps have no meaning.
    """
    if report.soft.status is Status.unstable:
        return
    run = report.counted[1]
    order, starts = run.by_pair
    touching, log = np.flatnonzero(np.diff(starts)), run.contacts[order]
    size = smaller_radius(report.scene)[touching]
    deepest, fastest = (np.maximum.reduceat(values, starts[touching])
                        for values in (log["xi_max"], np.abs(log["v_in"][:, 0] - log["v_in"][:, 1])))
    shortest = np.minimum.reduceat(log["duration"], starts[touching])
    depths, speeds = deepest / size, fastest * (shortest / (2.0 * math.pi * size))
    for values, sentence in ((depths, DEPTH_WARNING), (speeds, SPEED_WARNING)):
        large = sorted(np.flatnonzero(values > MAX_FRACTION).tolist(), key=lambda i: -values[i])
        named = [(report.scene.pairs.name(int(touching[i])), percent(values[i])) for i in large[:MAX_NAMED_PAIRS]]
        others = [f"{pair}: {share}" for pair, share in named[1:]]
        if more := len(large) - len(named):
            others.append(f"{more} more")
        for pair, share in named[:1]:
            yield sentence.format(pair=pair, share=share, others=f" (also {', '.join(others)})" if others else "")

"""Alignment of two runs at their ends, and further runs under other tie rules.

Soft spheres lag behind hard spheres by about one contact duration per collision. The end time of a comparison can
therefore lie between the n-th contact of a pair in one run and in the other, or within a contact. For each pair, the
larger number n of contacts at the end counts. Both runs are continued until the n-th contact of the pair has ended,
and later contacts are ignored. A contact that begins later than the lag allows is missing.

The outcome of collisions between touching balls, or of simultaneous collisions, follows from the force law for soft
spheres. Hard spheres need a tie rule. If two tie rules give different results, the hard-sphere result is not unique.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from granular import edmd, md
from granular._engine.check import Array, typed
from granular.comparison.outcome import approach, at_once, components, counted, counts, partings, sticking, strengths
from granular.laws.kinds import resolved
from granular.md.isolation import Durations
from granular.run.drive import DEFAULT_MAX_EVENTS
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene
from granular.scene.places import Closing
from granular.scene.walls.motion import ends

FOLLOWED_DURATIONS = 20.0
"""Durations of an isolated contact for which a running contact is followed."""
MIN_COLLISION_LIMIT = 100_000
"""Least limit on the collisions of a continued hard run beside a shaken wall."""
CONTINUABLE_STATUSES = (Status.time, Status.until)
"""Statuses of runs that can be continued."""
TIE_RULES_TO_TRY = ("left", "right", "poisson")
"""Tie rules to try: two sequential orders, and Poisson's rule for groups."""
MAX_BODIES_FOR_POISSON = 1000
"""Bodies above which Poisson's rule is not tried: its cost is quadratic."""
COLLISION_LIMIT_FACTOR = 10
"""Limit on the collisions under another tie rule, over the run's collisions."""


def levelled(hard: Trajectory, soft: Trajectory, options: Mapping[str, Any]) -> tuple[Trajectory, Trajectory]:
    """Continue both runs to equal numbers of contacts, and return them.

    For each pair, n is the larger number of contacts at the end of the two runs. The contact logs that are returned
    contain the first n contacts of every pair, as far as they occur.

    Parameters
    ----------
    hard, soft : Trajectory
        Runs of one scene, with the contacts that count in their logs.
    options : mapping
        Options of `granular.md.simulate` with which the soft run was made.

    Notes
    -----
    A contact that one run still lacks may begin later by the lag: the isolated duration at its approach speed, plus the
    time in which its balls travel the distance by which they may be behind. This distance is the largest approach speed
    times the sum of all durations so far, both of the component. The second part is at most the length of the run. A
    contact that begins later is missing. Two cases are not continued: hard spheres that touch at the start and have not
    collided by the end, and pairs at rest at the end if the missing contacts belong to balls that bounce ever lower.
    """
    most, cut = np.maximum(counts(hard), counts(soft)), float(soft.time[-1])
    latest, followed = _latest(hard, soft, most), _patience(soft, cut)
    end = float(latest[1].max())
    later = _continued(soft, end, options)
    still = _ever_lower(soft, at_once(hard), [c for c in np.flatnonzero(followed > cut).tolist()
                                     if not later.of(c)["t_end"][soft.count(c) - 1] <= followed[c]])
    latest[1, still] = cut
    until = _patience(_due(later, latest[1], most), cut)
    until[still] = followed[still]
    if until.max() > end:
        later = _continued(soft, float(until.max()), options)
    hard, later = counted(at_once(_continued(hard, float(latest[0].max()), {})), later)
    return _due(hard, latest[0], most), _endless(_due(later, latest[1], most), until)


def followed(soft: Trajectory, options: Mapping[str, Any]) -> Trajectory:
    """Return the soft run with each contact that has begun followed to its end."""
    until, begun = _patience(soft, float(soft.time[-1])), counts(soft)
    return first(_endless(_continued(soft, float(until.max()), options), until), begun)


def _due(run: Trajectory, latest: Array, most: Any) -> Trajectory:
    """Keep the first `most` contacts of each pair that begin by `latest`.

    `latest` has shape (n-1,).
    """
    kept = run.contacts["t_begin"] <= latest[run.contacts["pair"]]
    return first(run if kept.all() else replace(run, contacts=run.contacts[kept]), most)


def _patience(soft: Trajectory, cut: float) -> Array:
    """Time in s until which a contact without end is followed, per pair, (n-1,).

    It is counted from the end of the run `cut`, or from the onset if that is later.
    """
    until = np.full(soft.scene.n_pairs, -np.inf)
    running, patience = _running(soft)
    until[running["pair"]] = np.maximum(running["t_begin"], cut) + patience
    return until


def _running(soft: Trajectory) -> tuple[Any, Array]:
    """Contacts without an end, and the time in s for which each is followed."""
    endless = np.isnan(soft.contacts["t_end"])
    running = soft.contacts[endless]
    alone = Durations(soft.law or (), soft.scene)(running["pair"], strengths(soft)[endless])
    return running, FOLLOWED_DURATIONS * np.where(np.isfinite(alone), alone, 0.0)


def _endless(soft: Trajectory, until: Array) -> Trajectory:
    """Remove the end of contacts that last longer than they are followed.

    Another pair may need a longer run, in which such a contact ends after all.
    """
    upto = until[soft.contacts["pair"]]
    lasting = np.isfinite(upto) & (soft.contacts["t_end"] > upto)
    if not lasting.any():
        return soft
    log = soft.contacts.copy()
    log["t_end"][lasting], log["v_out"][lasting] = np.nan, np.nan
    log["duration"][lasting] = (upto - log["t_begin"])[lasting]
    return replace(soft, contacts=log)


def first(run: Trajectory, most: Array) -> Trajectory:
    """Keep the first `most` (n-1,) contacts of every pair."""
    order, edge = run.by_pair
    nth = np.empty(len(order), np.int64)
    nth[order] = np.arange(len(order)) - np.repeat(edge[:-1], np.diff(edge))
    kept = nth < most[run.contacts["pair"]]
    return run if kept.all() else replace(run, contacts=run.contacts[kept])


def _latest(hard: Trajectory, soft: Trajectory, most: Any) -> Array:
    """Latest onset in s of the missing contacts of each pair, (2, n-1).

    The first row is for the hard run, the second one for the soft run. A pair with fewer contacts than in the other run
    may be late by the lag of the contact that it lacks.
    """
    lag = lags(hard, soft)
    latest = np.repeat([[hard.time[-1]], [soft.time[-1]]], soft.scene.n_pairs, axis=1)
    for k, (run, other) in enumerate(((hard, soft), (soft, hard))):
        pair = np.flatnonzero(counts(run) < most)
        if len(pair):
            order, edge = other.by_pair
            latest[k, pair] += lag(pair, np.abs(approach(other)[order[edge[pair + 1] - 1]]))
    lying = np.zeros(len(most), np.bool_)
    lying[soft.contacts["pair"][soft.contacts["t_begin"] <= soft.time[0]]] = True
    latest[0, (counts(hard) == 0) & lying] = hard.time[-1]  # they lie on each other from the start
    stuck = (hard.gap[-1] == 0.0) & (np.abs(partings(hard)) <= sticking(hard))
    latest[0, _ever_lower(at_once(hard), soft, np.flatnonzero(stuck).tolist())] = hard.time[-1]
    return np.asarray(latest, float)


def lags(hard: Trajectory, soft: Trajectory) -> Callable[[Any, Array], Array]:
    """Return the function ``lag(pair, speed)``: delay in s allowed for a contact.

    It is the isolated duration at an approach speed in m/s, plus the time in which the balls travel the distance by
    which they may be behind, but at most the length of the run. It is 0 for contacts that do not end.
    """
    alone, span = Durations(soft.law or (), soft.scene), soft.time[-1] - soft.time[0]
    behind = _behind(hard, soft, alone)

    def lag(pair: Any, speed: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            late = alone(pair, speed) + np.fmin(behind[pair] / speed, span)
        return np.asarray(np.nan_to_num(late, posinf=0.0))

    return lag


def _ever_lower(run: Trajectory, other: Trajectory, resting: list[int]) -> list[int]:
    """Return the pairs at rest in `run` that only bounce ever lower in `other`.

    Their contacts in `other` that `run` lacks are no faster than the last contact in `run`, or than contacts of balls
    that settle.
    """
    if not resting:
        return resting
    run, other = counted(run, other)
    here, there = approach(run), approach(other)
    weight = components(run, other).weight(run if run.rule is None else other)
    return [c for c in resting
            if not (there[other.rows(c)][run.count(c) :] > max(weight[c], *here[run.rows(c)][-1:])).any()]


def _behind(hard: Trajectory, soft: Trajectory, alone: Durations) -> Array:
    """Distance in m by which the balls of each pair may be behind, (n-1,).

    It is the total duration of the contacts of a component times its largest approach speed.
    """
    parts = components(hard, soft)
    isolated = np.nan_to_num(alone(hard.contacts["pair"], np.abs(approach(hard))), posinf=0.0)
    over = np.where(np.isnan(soft.contacts["t_end"]), 0.0, soft.contacts["duration"])
    delay, fastest = np.zeros((2, parts.count + 1))
    for run, lasting in ((hard, isolated), (soft, over)):
        of = parts.of_pair[run.contacts["pair"]]
        np.add.at(delay, of, lasting)
        np.maximum.at(fastest, of, approach(run))
    return np.asarray((delay * fastest)[parts.of_pair])


def _continued(run: Trajectory, end: float, options: Mapping[str, Any]) -> Trajectory:
    """Continue a run until `end` in s, and return it with the new contacts."""
    end = min(end, ends(*run.scene.motions))
    if run.scene.is_wall[[0, -1]].all():  # nor beyond where they leave no room
        end = min(end, Closing(run.scene, float(run.time[0]), flattened=run.rule is None).look(end))
    if run.status not in CONTINUABLE_STATUSES or not end > run.time[-1]:
        return run
    if run.rule is not None:
        later = edmd.resume(run, t_end=end, max_events=max(MIN_COLLISION_LIMIT, 10 * len(run.contacts)))
    elif run.state:
        later = md.resume(run, t_end=end)
    else:
        return _restarted(run, end, options)
    over = run.contacts[~np.isnan(run.contacts["t_end"])]
    return replace(run, contacts=np.concatenate([over, later.contacts]), stats=later.stats)


def _restarted(run: Trajectory, end: float, options: Mapping[str, Any]) -> Trajectory:
    """Continue a fixed-step run from its last sample, as it has no checkpoint."""
    scene, now = run.scene, float(run.time[-1])
    if scene.heated or has_memory(run):
        return run
    velocity = np.where(scene.is_wall, scene.velocity, run.velocity[-1])  # walls add how they are shaken
    rest = scene.replace(gap=run.gap[-1], velocity=velocity, origin=float(run.position[-1][0]))
    later = md.simulate(rest, run.law, t_start=now, t_end=end, **options).contacts
    log, kept = run.contacts.copy(), np.ones(len(later), np.bool_)
    for row in np.flatnonzero(np.isnan(log["t_end"])).tolist():
        for i in np.flatnonzero(later["pair"] == log["pair"][row])[:1].tolist():  # the rest of the same contact
            kept[i] = False
            log["duration"][row] += later["duration"][i]
            log["impulse"][row] += later["impulse"][i]
            for name in ("t_end", "v_out"):
                log[name][row] = later[name][i]
    return replace(run, contacts=np.concatenate([log, later[kept]]))


def has_memory(soft: Trajectory) -> bool:
    """Whether a law has memory, so that the last sample does not define the rest."""
    return soft.law is not None and any(law.memory for law in resolved(soft.law, soft.scene).each)


def unfollowed(soft: Trajectory) -> Any:
    """Whether the last contact of each pair has no end, but may have one, (n-1,).

    It was not followed for long enough to be called endless.
    """
    short, (running, patience) = np.zeros(soft.scene.n_pairs, np.bool_), _running(soft)
    short[running["pair"]] = running["duration"] < 0.99 * patience
    return short & (soft.status in CONTINUABLE_STATUSES)


def touching(scene: Scene) -> Any:
    """Whether each pair consists of two balls that touch at the start, (n-1,)."""
    return (scene.gap == 0.0) & ~np.logical_or(*scene.sides(scene.is_wall))


def nudged(scene: Scene) -> Scene:
    """Return the scene with gaps shifted by 1e-12 of themselves, up and down.

    Gaps of touching balls are shifted by 1e-12 of the nearest gap beside them, at most of the sum of both radii.
    Distant gaps therefore do not matter.
    """
    sign = np.where(np.arange(scene.n_pairs) % 2, -1.0, 1.0)
    here, size = touching(scene), np.add(*scene.sides(scene.radius))
    room = np.where(size > 0.0, size, math.inf)
    if here.any():
        apart = np.flatnonzero(scene.gap > 0.0)
        beside = np.searchsorted(apart, np.arange(scene.n_pairs))[:, None] + [-1, 0]
        beside[(beside < 0) | (beside >= len(apart))] = len(apart)
        room = np.minimum(room, np.append(scene.gap[apart], math.inf)[beside].min(axis=1))
    shift = np.where(here, np.where(np.isfinite(room), room, 1.0), scene.gap * sign)
    return scene.replace(gap=scene.gap + 1e-12 * shift)


def tied(run: Trajectory) -> Any:
    """Whether each pair touches at the start or collides with its neighbour.

    A pair collides with its neighbour if both collisions are simultaneous. The result has the shape of the gaps.
    """
    pair, time, found = run.contacts["pair"], run.contacts["t_begin"], run.scene.gap == 0.0
    order = np.lexsort([pair, time])
    at_once = np.flatnonzero((np.diff(time[order]) == 0.0) & (np.abs(np.diff(pair[order])) == 1))
    found[pair[order[at_once]]] = found[pair[order[at_once + 1]]] = True
    return found


def others(hard: Trajectory, options: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield options of `granular.edmd.simulate` for each of the other tie rules.

    Nothing is yielded if no pair is `tied`. Poisson's rule is not defined for balls that stick, for example after a
    collapse, for the TC model and for an elastic cut-off. It is slow for many bodies. Any tie rule may refuse the
    scene.
    """
    if hard.scene.n < 3 or not tied(hard).any():
        return
    limit = min(
        options.get("max_events", DEFAULT_MAX_EVENTS), COLLISION_LIMIT_FACTOR * (len(hard.contacts) + hard.scene.n)
    )
    by_itself = hard.scene.n <= MAX_BODIES_FOR_POISSON and "merge_below" not in hard.stats and not (
        options.get("collapse") == "merge" or options.get("tc") or options.get("elastic_below"))
    for name in TIE_RULES_TO_TRY if by_itself else TIE_RULES_TO_TRY[:2]:
        if name != options.get("ties", "left"):
            yield {**options, "ties": name, "max_events": limit}


typed(globals(), Scene, Trajectory)

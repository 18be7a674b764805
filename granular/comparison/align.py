"""What is arbitrary in a run: where it is cut, and the rule that decides ties. Both runs of a scene go on until they
have the same contacts, each followed to its end; and the other tie rules are tried.

Soft spheres lag behind hard ones by about a contact's duration per collision. So an end time may fall between the n-th
contact of a pair in one run and in the other, or within it. That is no difference of the two: for each pair the larger
number n of contacts by the end counts, both runs are gone on with until *its* n-th contact is over, and later ones are
ignored. What is not there after the time by which it can be late is missing.

Newton's equation decides a collision of balls that touch, or collide at once, by its force law. Hard spheres have no
law, so a rule has to decide, and where two rules differ no answer is the right one.
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
from granular.run.drive import EVENTS
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene
from granular.scene.places import Closing
from granular.scene.walls.motion import ends

PATIENCE = 20.0
"""A contact still running at the end of a run is followed for so many of its isolated durations."""
MOST = 100_000
"""Collisions for which a hard run is gone on with, at least: beside a shaken wall they may pile up."""
CUT = (Status.time, Status.until)
"""Statuses of runs that can be gone on with."""
RULES = ("left", "right", "poisson")
"""One collision after the other in two orders, and a touching group as a whole, in the way that takes any ε."""
FEW = 1000
"""Scenes of more bodies are not tried with the last: the cost of a group grows with its square."""
MOST_OF_OTHERS = 10
"""Another rule is given up after so many times the collisions of the first."""


def levelled(hard: Trajectory, soft: Trajectory, options: Mapping[str, Any]) -> tuple[Trajectory, Trajectory]:
    """Return both runs with the first n contacts of every pair in their logs, n the larger number at their ends.

    Parameters
    ----------
    hard, soft : Trajectory
        Runs of one scene, with the contacts that count in their logs.
    options : mapping
        Those of `granular.md.simulate` with which the soft run was made.

    Notes
    -----
    A contact that one run has yet to make may be late by its isolated duration, and by the way that its balls lag
    behind, at most the fastest approach times all durations so far, both of its component, at the speed with which it
    closes, and not by more than the run has lasted. One that begins later is missing. Hard spheres that lie on each
    other from the start, and have not collided by the end, are not waited for; nor are pairs at rest at the end, if the
    contacts that they lack are those of balls that bounce ever lower.
    """
    most, cut = np.maximum(counts(hard), counts(soft)), float(soft.time[-1])
    latest, followed = _latest(hard, soft, most), _patience(soft, cut)
    end = float(latest[1].max())
    later = _gone_on(soft, end, options)
    still = _ever_lower(soft, at_once(hard), [c for c in np.flatnonzero(followed > cut).tolist()
                                     if not later.of(c)["t_end"][soft.count(c) - 1] <= followed[c]])
    latest[1, still] = cut
    until = _patience(_due(later, latest[1], most), cut)
    until[still] = followed[still]
    if until.max() > end:
        later = _gone_on(soft, float(until.max()), options)
    hard, later = counted(at_once(_gone_on(hard, float(latest[0].max()), {})), later)
    return _due(hard, latest[0], most), _endless(_due(later, latest[1], most), until)


def followed(soft: Trajectory, options: Mapping[str, Any]) -> Trajectory:
    """Return the soft run with the contacts that have begun by its end in its log, each followed to its end."""
    until, begun = _patience(soft, float(soft.time[-1])), counts(soft)
    return first(_endless(_gone_on(soft, float(until.max()), options), until), begun)


def _due(run: Trajectory, latest: Array, most: Any) -> Trajectory:
    """Return the run with those of the first contacts of every pair that begin no later than `latest` (n-1,) says."""
    kept = run.contacts["t_begin"] <= latest[run.contacts["pair"]]
    return first(run if kept.all() else replace(run, contacts=run.contacts[kept]), most)


def _patience(soft: Trajectory, cut: float) -> Array:
    """Until when in s the contact of each pair that has no end is followed, from the cut or its onset on, (n-1,)."""
    until = np.full(soft.scene.n_pairs, -np.inf)
    running, patience = _running(soft)
    until[running["pair"]] = np.maximum(running["t_begin"], cut) + patience
    return until


def _running(soft: Trajectory) -> tuple[Any, Array]:
    """The contacts that have no end, and for how long in s each is followed."""
    endless = np.isnan(soft.contacts["t_end"])
    running = soft.contacts[endless]
    alone = Durations(soft.law or (), soft.scene)(running["pair"], strengths(soft)[endless])
    return running, PATIENCE * np.where(np.isfinite(alone), alone, 0.0)


def _endless(soft: Trajectory, until: Array) -> Trajectory:
    """Return the run in which contacts that last longer than they are followed have no end, whatever others need."""
    upto = until[soft.contacts["pair"]]
    lasting = np.isfinite(upto) & (soft.contacts["t_end"] > upto)
    if not lasting.any():
        return soft
    log = soft.contacts.copy()
    log["t_end"][lasting], log["v_out"][lasting] = np.nan, np.nan
    log["duration"][lasting] = (upto - log["t_begin"])[lasting]
    return replace(soft, contacts=log)


def first(run: Trajectory, most: Array) -> Trajectory:
    """Return the run with only the first contacts of every pair in its log, as many as `most` (n-1,) says."""
    order, edge = run.by_pair
    nth = np.empty(len(order), np.int64)
    nth[order] = np.arange(len(order)) - np.repeat(edge[:-1], np.diff(edge))
    kept = nth < most[run.contacts["pair"]]
    return run if kept.all() else replace(run, contacts=run.contacts[kept])


def _latest(hard: Trajectory, soft: Trajectory, most: Any) -> Array:
    """When in s the contacts that the hard, and the soft run has yet to make must have begun, (2, n-1).

    A pair that has fewer contacts than in the other run may be late by the duration of a contact, and by the time in
    which it goes as far as it may be behind, at the speed of the contact that it lacks.
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
    """Return a function of pairs and approach speeds in m/s: the time in s by which such contacts may be late.

    It is the duration of the contact, and the time in which its balls go as far as they may be behind, but no longer
    than the run. 0 for contacts that do not end.
    """
    alone, span = Durations(soft.law or (), soft.scene), soft.time[-1] - soft.time[0]
    behind = _behind(hard, soft, alone)

    def lag(pair: Any, speed: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            late = alone(pair, speed) + np.fmin(behind[pair] / speed, span)
        return np.asarray(np.nan_to_num(late, posinf=0.0))

    return lag


def _ever_lower(run: Trajectory, other: Trajectory, resting: list[int]) -> list[int]:
    """Of these pairs, which rest in a run, those that in the other go on with contacts no faster than the last here, or
    than those of balls that settle."""
    if not resting:
        return resting
    run, other = counted(run, other)
    here, there = approach(run), approach(other)
    weight = components(run, other).weight(run if run.rule is None else other)
    return [c for c in resting
            if not (there[other.rows(c)][run.count(c) :] > max(weight[c], *here[run.rows(c)][-1:])).any()]


def _behind(hard: Trajectory, soft: Trajectory, alone: Durations) -> Array:
    """How far in m balls may be behind, (n-1,): the time that all contacts of a component take, at its fastest."""
    parts = components(hard, soft)
    isolated = np.nan_to_num(alone(hard.contacts["pair"], np.abs(approach(hard))), posinf=0.0)
    over = np.where(np.isnan(soft.contacts["t_end"]), 0.0, soft.contacts["duration"])
    delay, fastest = np.zeros((2, parts.count + 1))
    for run, lasting in ((hard, isolated), (soft, over)):
        of = parts.of_pair[run.contacts["pair"]]
        np.add.at(delay, of, lasting)
        np.maximum.at(fastest, of, approach(run))
    return np.asarray((delay * fastest)[parts.of_pair])


def _gone_on(run: Trajectory, end: float, options: Mapping[str, Any]) -> Trajectory:
    """Return the run with the contacts until a later time `end` in s in its log."""
    end = min(end, ends(*run.scene.motions))
    if run.scene.is_wall[[0, -1]].all():  # nor beyond where they leave no room
        end = min(end, Closing(run.scene, float(run.time[0]), flattened=run.rule is None).look(end))
    if run.status not in CUT or not end > run.time[-1]:
        return run
    if run.rule is not None:
        later = edmd.resume(run, t_end=end, max_events=max(MOST, 10 * len(run.contacts)))
    elif run.state:
        later = md.resume(run, t_end=end)
    else:
        return _restarted(run, end, options)
    over = run.contacts[~np.isnan(run.contacts["t_end"])]
    return replace(run, contacts=np.concatenate([over, later.contacts]), stats=later.stats)


def _restarted(run: Trajectory, end: float, options: Mapping[str, Any]) -> Trajectory:
    """Return a run of fixed steps, which cannot be resumed, with the contacts of a run from its last row."""
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
    """Whether a law of a soft-sphere run has memory, so that its last state does not tell how it goes on."""
    return soft.law is not None and any(law.memory for law in resolved(soft.law, soft.scene).each)


def unfollowed(soft: Trajectory) -> Any:
    """Whether each pair has a last contact without end that has not lasted long enough to be called endless, (n-1,)."""
    short, (running, patience) = np.zeros(soft.scene.n_pairs, np.bool_), _running(soft)
    short[running["pair"]] = running["duration"] < 0.99 * patience
    return short & (soft.status in CUT)


def touching(scene: Scene) -> Any:
    """Whether each pair is of two balls that touch at the start, shape of the gaps."""
    return (scene.gap == 0.0) & ~np.logical_or(*scene.sides(scene.is_wall))


def nudged(scene: Scene) -> Scene:
    """Gaps shifted by 1e-12 of themselves, with changing sign; of touching balls by 1e-12 of the next gap beside them,
    at most of both radii: what is far away counts for nothing."""
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
    """Whether the bodies of each pair touch at the start, or collide at the same time as a neighbouring pair does,
    shape of the gaps."""
    pair, time, found = run.contacts["pair"], run.contacts["t_begin"], run.scene.gap == 0.0
    order = np.lexsort([pair, time])
    at_once = np.flatnonzero((np.diff(time[order]) == 0.0) & (np.abs(np.diff(pair[order])) == 1))
    found[pair[order[at_once]]] = found[pair[order[at_once + 1]]] = True
    return found


def others(hard: Trajectory, options: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield options of `granular.edmd.simulate` for each other tie rule, if pairs of a run made with `options` are
    `tied`.

    Poisson's rule is not defined for balls that stick, such as after a collapse, for the TC model and for an elastic
    cut-off; it is slow for many bodies. Any rule may refuse the scene.
    """
    if hard.scene.n < 3 or not tied(hard).any():
        return
    limit = min(options.get("max_events", EVENTS), MOST_OF_OTHERS * (len(hard.contacts) + hard.scene.n))
    by_itself = hard.scene.n <= FEW and "merge_below" not in hard.stats and not (
        options.get("collapse") == "merge" or options.get("tc") or options.get("elastic_below"))
    for name in RULES if by_itself else RULES[:2]:
        if name != options.get("ties", "left"):
            yield {**options, "ties": name, "max_events": limit}


typed(globals(), Scene, Trajectory)

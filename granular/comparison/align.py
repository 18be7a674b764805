"""Alignment of two runs at their ends, and further runs under other tie rules.

Soft spheres lag behind hard spheres by about one contact duration per collision. The n-th contact of a pair can
therefore have ended in one run when the comparison stops, but not in the other run. For each pair, n is the larger
number of contacts in the two runs. Both runs are continued until the n-th contact of the pair has ended, and later
contacts are ignored. A contact that begins later than the lag allows counts as missing.

If balls touch, or collide simultaneously, the force law determines the outcome for soft spheres. Hard spheres need a
tie rule. If two tie rules give different results, the hard-sphere result is not unique.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from granular import edmd, md
from granular._engine.callables import check_argument_types
from granular._engine.check import Array
from granular.comparison.outcome import (
    approach,
    combine_simultaneous,
    components,
    counted,
    counts,
    separation_speeds,
    sticking_speed,
    strengths,
)
from granular.laws.kinds import resolved
from granular.md.isolation import Durations, isolated_durations
from granular.run.drive import DEFAULT_MAX_EVENTS
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene
from granular.scene.places import WallMeeting
from granular.scene.walls.motion import ends

FOLLOWED_DURATIONS = 20.0
"""Limit on the time for which an unfinished contact is followed.

It is in units of the duration of an isolated contact of the same pair.
"""
MIN_COLLISION_LIMIT = 100_000
"""Smallest limit on the collisions of a continued hard run.

Near a shaken wall a continued run can have many more collisions than the original run.
"""
END_MARGIN = 1e-9
"""Margin of the end time of two compared hard runs, relative to their length."""
CONTINUABLE_STATUSES = (Status.time, Status.until)
"""Statuses of runs that can be continued."""
TIE_RULES_TO_TRY = ("left", "right", "poisson")
"""Tie rules to try: two sequential orders, and Poisson's rule for groups."""
MAX_BODIES_FOR_POISSON = 1000
"""Maximum number of bodies for Poisson's rule, whose cost is quadratic in it."""
COLLISION_LIMIT_FACTOR = 10
"""Limit on the collisions of a checking run, relative to the original run."""


def equalize_counts(hard: Trajectory, soft: Trajectory, options: Mapping[str, Any]) -> tuple[Trajectory, Trajectory]:
    """Continue a hard and a soft run to equal numbers of contacts.

    For each pair, n is the larger number of contacts at the end of the two runs. The returned contact logs contain the
    first n contacts of every pair. A contact that begins later than the lag allows is left out.

    Parameters
    ----------
    hard, soft : Trajectory
        Runs of one scene, without contacts at rounding level.
    options : mapping
        Options of `granular.md.simulate` for the soft run.

    Notes
    -----
    A contact that one run still lacks counts if it begins within the lag after the end of the run. The lag is the
    isolated duration t_c(v) at the approach speed v of the contact, plus a travel time s/v. The balls can be behind by
    the distance s, the largest approach speed of the component times the sum of all durations of its contacts so far.
    The travel time is at most the length of the run.

    A run is not continued for two kinds of pairs: hard spheres that touch at the start and have not collided by the
    end, and pairs that rest at the end of one run while their balls bounce ever lower in the other run.
    """
    if _is_settled(hard, soft):
        return hard, soft
    needed_counts, stop_time = np.maximum(counts(hard), counts(soft)), float(soft.time[-1])
    latest_onset, followed_until = _latest_onsets(hard, soft, needed_counts), _followed_until(soft, stop_time)
    end = float(latest_onset[1].max())
    continued = _continue_run(soft, end, options)
    settling = _pairs_bouncing_lower(soft, combine_simultaneous(hard), [
        c for c in np.flatnonzero(followed_until > stop_time).tolist()
        if not continued.of(c)["t_end"][soft.count(c) - 1] <= followed_until[c]])
    latest_onset[1, settling] = stop_time
    until = _followed_until(_timely_contacts(continued, latest_onset[1], needed_counts), stop_time)
    until[settling] = followed_until[settling]
    if until.max() > end:
        continued = _continue_run(soft, float(until.max()), options)
    if not _stay_apart(hard, np.flatnonzero(counts(hard) < needed_counts), latest_onset[0]):
        hard = combine_simultaneous(_continue_run(hard, float(latest_onset[0].max()), {}))
    hard, continued = counted(hard, continued)
    return _timely_contacts(hard, latest_onset[0], needed_counts), _without_late_ends(
        _timely_contacts(continued, latest_onset[1], needed_counts), until)


def _is_settled(hard: Trajectory, soft: Trajectory) -> bool:
    """Whether both runs have equal numbers of contacts, all of which have ended."""
    return bool((counts(hard) == counts(soft)).all()) and not np.isnan(soft.contacts["t_end"]).any()


def follow_contacts(soft: Trajectory, options: Mapping[str, Any]) -> Trajectory:
    """Return the soft run with each of its contacts continued to its end.

    Contacts that begin after the end of the given run are left out. A contact that lasts longer than
    `FOLLOWED_DURATIONS` keeps t_end = nan.
    """
    until, begun = _followed_until(soft, float(soft.time[-1])), counts(soft)
    return keep_first_contacts(_without_late_ends(_continue_run(soft, float(until.max()), options), until), begun)


def _timely_contacts(run: Trajectory, latest: Array, max_counts: Any) -> Trajectory:
    """Return a run with the contacts of each pair that begin in time.

    Parameters
    ----------
    latest : (n-1,) array
        Latest onset in s for each pair.
    max_counts : (n-1,) array of int
        Maximum number of contacts for each pair.
    """
    kept = run.contacts["t_begin"] <= latest[run.contacts["pair"]]
    return keep_first_contacts(run if kept.all() else replace(run, contacts=run.contacts[kept]), max_counts)


def _followed_until(soft: Trajectory, stop_time: float) -> Array:
    """Time in s until which an unfinished contact of each pair is followed, (n-1,).

    The time allowed by `_unfinished_contacts` starts at the end of the run, `stop_time` in s, or at the onset of the
    contact if that is later. The value is -inf for pairs without an unfinished contact.
    """
    until = np.full(soft.scene.n_pairs, -np.inf)
    running, patience = _unfinished_contacts(soft)
    until[running["pair"]] = np.maximum(running["t_begin"], stop_time) + patience
    return until


def _unfinished_contacts(soft: Trajectory) -> tuple[Any, Array]:
    """Unfinished contacts of a soft run, and the time in s for which to follow each.

    The time is `FOLLOWED_DURATIONS` isolated durations of the contact. It is 0 if an isolated contact does not end.
    """
    is_unfinished = np.isnan(soft.contacts["t_end"])
    running = soft.contacts[is_unfinished]
    if not len(running):
        return running, np.zeros(0)
    duration = isolated_durations(soft)(running["pair"], strengths(soft)[is_unfinished])
    return running, FOLLOWED_DURATIONS * np.where(np.isfinite(duration), duration, 0.0)


def _without_late_ends(soft: Trajectory, until: Array) -> Trajectory:
    """Return a soft run in which contacts that last too long have no end.

    A contact can last longer than it is followed. If another pair needs a longer run, the end of such a contact can be
    in the log. It is removed here, so that the result does not depend on the other pair.

    Parameters
    ----------
    until : (n-1,) array
        Time in s until which a contact of each pair is followed. Values that are not finite remove nothing.
    """
    limit = until[soft.contacts["pair"]]
    lasting = np.isfinite(limit) & (soft.contacts["t_end"] > limit)
    if not lasting.any():
        return soft
    log = soft.contacts.copy()
    log["t_end"][lasting], log["v_out"][lasting] = np.nan, np.nan
    log["duration"][lasting] = (limit - log["t_begin"])[lasting]
    return replace(soft, contacts=log)


def keep_first_contacts(run: Trajectory, max_counts: Array) -> Trajectory:
    """Return a run with the first `max_counts` (n-1,) contacts of every pair."""
    order, edge = run.by_pair
    nth = np.empty(len(order), np.int64)
    nth[order] = np.arange(len(order)) - np.repeat(edge[:-1], np.diff(edge))
    kept = nth < max_counts[run.contacts["pair"]]
    return run if kept.all() else replace(run, contacts=run.contacts[kept])


def _latest_onsets(hard: Trajectory, soft: Trajectory, needed_counts: Any) -> Array:
    """Latest onset in s at which a missing contact of a pair still counts, (2, n-1).

    Row 0 is for the hard run, row 1 for the soft run. The value is the end of the run. If the pair has fewer contacts
    in this run than `needed_counts`, the lag of `allowed_delay` is added, for the approach speed of the pair's last
    contact in the other run. Nothing is added in row 0 for the two kinds of pairs that do not continue a run,
    see `equalize_counts`.

    Parameters
    ----------
    needed_counts : (n-1,) array of int
        Larger number of contacts of each pair in the two runs.
    """
    lag = allowed_delay(hard, soft)
    latest = np.repeat([[hard.time[-1]], [soft.time[-1]]], soft.scene.n_pairs, axis=1)
    for k, (run, other) in enumerate(((hard, soft), (soft, hard))):
        pair = np.flatnonzero(counts(run) < needed_counts)
        if len(pair):
            order, starts = other.by_pair
            latest[k, pair] += lag(pair, np.abs(approach(other)[order[starts[pair + 1] - 1]]))
    touches_at_start = np.zeros(len(needed_counts), np.bool_)
    touches_at_start[soft.contacts["pair"][soft.contacts["t_begin"] <= soft.time[0]]] = True
    latest[0, (counts(hard) == 0) & touches_at_start] = hard.time[-1]  # they touch from the start
    stuck = (hard.gap[-1] == 0.0) & (np.abs(separation_speeds(hard)) <= sticking_speed(hard))
    if stuck.any():
        bouncing = _pairs_bouncing_lower(combine_simultaneous(hard), soft, np.flatnonzero(stuck).tolist())
        latest[0, bouncing] = hard.time[-1]
    return np.asarray(latest, float)


def allowed_delay(hard: Trajectory, soft: Trajectory) -> Callable[[Any, Array], Array]:
    """Return a function ``lag(pair, speed)`` for the allowed delay of a contact in s.

    The arguments are pair numbers and approach speeds in m/s. The lag is the isolated duration, plus the time that the
    balls need to travel the distance by which they can lag behind the other run. The second part is at most the length
    of the run. The lag is 0 for contacts that do not end. The last result is cached in the soft run.
    """
    compared_with, stored_lag = vars(soft).get("_delay", (None, None))
    if compared_with is hard:
        return stored_lag  # type: ignore[no-any-return]
    isolated_duration, span = isolated_durations(soft), soft.time[-1] - soft.time[0]
    behind = _distances_behind(hard, soft, isolated_duration)

    def lag(pair: Any, speed: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            delay = isolated_duration(pair, speed) + np.fmin(behind[pair] / speed, span)
        return np.where(np.isfinite(delay), delay, 0.0)

    vars(soft)["_delay"] = hard, lag
    return lag


def _pairs_bouncing_lower(run: Trajectory, other: Trajectory, resting: list[int]) -> list[int]:
    """Return the pairs that rest at the end of `run` and bounce ever lower in `other`.

    The missing contacts of a pair are its contacts in `other` beyond the number of its contacts in `run`. The pair is
    returned if none of their approach speeds exceeds the larger of two speeds: the approach speed of the pair's last
    contact in `run`, and the speed v_g that weight gives a ball during a contact (`Components.weight`).

    Parameters
    ----------
    run, other : Trajectory
        A hard run and a soft run, in either order.
    resting : list of int
        Pairs that rest at the end of `run`.
    """
    if not resting:
        return resting
    run, other = counted(run, other)
    speeds, other_speeds = approach(run), approach(other)
    weight = components(run, other).weight(run if run.rule is None else other)
    return [c for c in resting
            if not (other_speeds[other.rows(c)][run.count(c) :] > max(weight[c], *speeds[run.rows(c)][-1:])).any()]


def _distances_behind(hard: Trajectory, soft: Trajectory, isolated_duration: Durations) -> Array:
    """Distance in m by which the balls of each pair can be behind, (n-1,).

    It is the total duration of all contacts of the component in both runs, times the largest approach speed of the
    component. Contacts of hard spheres count with their isolated durations `isolated_duration`. Soft contacts without
    end are ignored.
    """
    parts = components(hard, soft)
    hard_durations = isolated_duration(hard.contacts["pair"], np.abs(approach(hard)))
    hard_durations[~np.isfinite(hard_durations)] = 0.0
    soft_durations = np.where(np.isnan(soft.contacts["t_end"]), 0.0, soft.contacts["duration"])
    delay, fastest = np.zeros((2, parts.count + 1))
    for run, durations in ((hard, hard_durations), (soft, soft_durations)):
        component = parts.of_pair[run.contacts["pair"]]
        np.add.at(delay, component, durations)
        np.fmax.at(fastest, component, approach(run))  # speeds of an unstable run can be nan
    return np.asarray((delay * fastest)[parts.of_pair])


def _continue_run(run: Trajectory, end: float, options: Mapping[str, Any]) -> Trajectory:
    """Return a run continued until the time `end` in s, with all contacts in its log.

    The run is returned unchanged if it has reached `end`, or if its status does not allow a continuation. It is not
    continued beyond the end of a wall's path, or beyond the time when two walls leave no room for the balls.
    """
    end = min(end, ends(*run.scene.motions))
    if run.scene.is_wall[[0, -1]].all():  # nor beyond the time when they leave no room
        end = min(end, WallMeeting(run.scene, float(run.time[0]), flattened=run.rule is None).search_until(end))
    if run.status not in CONTINUABLE_STATUSES or not end > run.time[-1] or _flies_until(run, end):
        return run
    if run.rule is not None:
        later = edmd.resume(run, t_end=end, max_events=max(MIN_COLLISION_LIMIT, 10 * len(run.contacts)))
    elif run.state:
        later = md.resume(run, t_end=end)
    else:
        return _restart_from_last_sample(run, end, options)
    finished = run.contacts[~np.isnan(run.contacts["t_end"])]
    return replace(run, contacts=np.concatenate([finished, later.contacts]), stats=later.stats)


def _flies_until(run: Trajectory, end: float) -> bool:
    """Whether no balls touch after the last sample before the time `end` in s.

    In free flight the gap of a pair is concave in time, gap + rate·T - a T²/2 with the closing acceleration a ≥ 0. If
    it is not negative at the last sample and positive at `end`, the pair does not touch in between. Scenes with a
    ceiling under gravity, other forces or driven walls are not examined.
    """
    scene, elapsed = run.scene, end - float(run.time[-1])
    if scene._flags or (scene.closing_acceleration < 0.0).any():
        return False
    gap, (low, high) = run.gap[-1], scene.sides(run.velocity[-1])
    travel, fall = (high - low) * elapsed, 0.5 * scene.closing_acceleration * elapsed**2
    at_end = gap + travel - fall
    return bool((gap >= 0.0).all() and (at_end > END_MARGIN * (gap + np.abs(travel) + fall)).all())


def _stay_apart(hard: Trajectory, pair: Any, until: Array) -> bool:
    """Whether none of the given pairs can meet by the given times.

    Until balls i and i + 1 meet, ball i exchanges momentum only with bodies below it. Collisions do not increase
    S² = Σ m (v - V)² of ball i and the balls below, with the velocity V of the walls. Gravity increases S by at most
    g √M T during the time T, with M = Σ m. Hence |v - V| ≤ (S + g √M T)/√m for ball i, and similarly for ball i + 1
    with the balls above. The result is False for rings, and for scenes with forces other than gravity, with driven or
    thermal walls, without walls, or with walls of different velocities.

    Parameters
    ----------
    pair : array of int
        The pairs.
    until : (n-1,) array
        Time in s until which each pair of the scene must stay apart.
    """
    scene, elapsed = hard.scene, until[pair] - hard.time[-1]
    walls, mass = scene.velocity[scene.is_wall], np.where(scene.is_wall, 0.0, scene.mass)
    if not len(pair):
        return True
    if scene._flags or scene.ring or not len(walls) or (walls != walls[0]).any():
        return False
    terms = np.array([mass * (hard.velocity[-1] - walls[0]) ** 2, mass])
    below, above = np.sqrt(terms.cumsum(axis=1)), np.sqrt(terms[:, ::-1].cumsum(axis=1)[:, ::-1])
    reach = sum((s[i] + scene.gravity * m[i] * elapsed) * np.sqrt(scene.inverse_mass[i])
                for i, (s, m) in zip(scene.bodies(pair), (below, above), strict=True)) * elapsed
    return bool((hard.gap[-1][pair] > reach).all())


def continue_past_end(run: Trajectory, hard: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Return two hard runs, continued past a collision at their common end time.

    Rounding errors decide which collisions at the end time are in the log, also within a simultaneous group. If a
    collision of either run begins within a relative `END_MARGIN` before the end, both are continued by this margin. If
    the status of one run is not `time`, both are returned unchanged.
    """
    end = float(hard.time[-1])
    margin = END_MARGIN * (end - float(hard.time[0]))
    if run.status is hard.status is Status.time and any((r.contacts["t_begin"] >= end - margin).any()
                                                        for r in (run, hard)):
        return _continue_run(run, end + margin, {}), _continue_run(hard, end + margin, {})
    return run, hard


def _restart_from_last_sample(run: Trajectory, end: float, options: Mapping[str, Any]) -> Trajectory:
    """Continue a fixed-step run from its last sample, because it has no checkpoint.

    The run is returned unchanged if the last sample does not determine the continuation: with thermal walls, or with a
    force law that has memory.
    """
    scene, now = run.scene, float(run.time[-1])
    if scene.heated or has_memory(run):
        return run
    velocity = np.where(scene.is_wall, scene.velocity, run.velocity[-1])  # the scene adds the motion of driven walls
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
    """Whether a force law of the run has memory.

    The last sample of the run then does not determine the continuation.
    """
    return soft.law is not None and any(law.memory for law in resolved(soft.law, soft.scene).each)


def has_unfollowed_contact(soft: Trajectory) -> Any:
    """Whether each pair has a contact that had not ended when its run stopped, (n-1,).

    This means contacts that were followed for less than `FOLLOWED_DURATIONS`. They can still end. Contacts followed for
    longer count as contacts without end.
    """
    is_short, (running, patience) = np.zeros(soft.scene.n_pairs, np.bool_), _unfinished_contacts(soft)
    is_short[running["pair"]] = running["duration"] < 0.99 * patience
    return is_short & (soft.status in CONTINUABLE_STATUSES)


def balls_touch_at_start(scene: Scene) -> Any:
    """Whether each pair consists of two balls that touch at the start, (n-1,)."""
    return (scene.gap == 0.0) & ~np.logical_or(*scene.sides(scene.is_wall))


def with_shifted_gaps(scene: Scene) -> Scene:
    """Return the scene with its gaps multiplied by 1 + 1e-12 or 1 - 1e-12 alternately.

    The gap of two touching balls is 0, and is increased by 1e-12 of a length instead. This length is the smaller one of
    the nearest nonzero gaps below and above, and at most the sum of the radii of the two balls. It is 1 m if neither
    exists. Distant gaps therefore do not matter.
    """
    sign = np.where(np.arange(scene.n_pairs) % 2, -1.0, 1.0)
    touches, size = balls_touch_at_start(scene), np.add(*scene.sides(scene.radius))
    room = np.where(size > 0.0, size, math.inf)
    if touches.any():
        apart = np.flatnonzero(scene.gap > 0.0)
        neighbour = np.searchsorted(apart, np.arange(scene.n_pairs))[:, None] + [-1, 0]
        neighbour[(neighbour < 0) | (neighbour >= len(apart))] = len(apart)
        room = np.minimum(room, np.append(scene.gap[apart], math.inf)[neighbour].min(axis=1))
    shift = np.where(touches, np.where(np.isfinite(room), room, 1.0), scene.gap * sign)
    return scene._with_valid_gaps(scene.gap + 1e-12 * shift)


def has_ties(run: Trajectory) -> Any:
    """Whether each pair touches at the start or collides with a neighbour, (n-1,).

    A pair collides with a neighbour if the collisions of two neighbouring pairs are exactly simultaneous.
    """
    pair, time, result = run.contacts["pair"], run.contacts["t_begin"], run.scene.gap == 0.0
    order = np.lexsort([pair, time])
    simultaneous = np.flatnonzero((np.diff(time[order]) == 0.0) & (np.abs(np.diff(pair[order])) == 1))
    result[pair[order[simultaneous]]] = result[pair[order[simultaneous + 1]]] = True
    return result


def other_tie_rules(hard: Trajectory, options: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the options of `granular.edmd.simulate` for each of the other tie rules.

    Nothing is yielded without a pair for which `has_ties` is true. Poisson's rule is left out if it is not defined: for
    balls that stick, for example after a collapse, for the TC model, and for an elastic cut-off. It is also left out
    for many bodies because it is slow. `granular.edmd.simulate` can still refuse a scene under another tie rule.
    """
    n = hard.scene.n
    if n < 3 or not has_ties(hard).any():
        return
    limit = min(options.get("max_events", DEFAULT_MAX_EVENTS), COLLISION_LIMIT_FACTOR * (len(hard.contacts) + n))
    allows_poisson = n <= MAX_BODIES_FOR_POISSON and "merge_below" not in hard.stats and not (
        options.get("collapse") == "merge" or options.get("tc") or options.get("elastic_below"))
    for name in TIE_RULES_TO_TRY if allows_poisson else TIE_RULES_TO_TRY[:2]:
        if name != options.get("ties", "left"):
            yield {**options, "ties": name, "max_events": limit}


check_argument_types(globals(), Scene, Trajectory)

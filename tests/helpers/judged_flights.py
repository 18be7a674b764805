"""Free flights of balls in both runs, matched by the contacts at both ends; written without the page's definition."""

import math
from collections import namedtuple

from tests.helpers.judged_episodes import numbered, velocity_after

Flight = namedtuple("Flight", "ball before after begin end velocity contact_duration")
MIN_DURATIONS = 5.0


def flights_of(rows, ball, bodies, end):
    """Flights of a ball by the contacts (pair, number) that begin and end them; the last one ends with the run."""
    mine = sorted(((key, r) for key, r in numbered(rows).items() if ball in bodies(key[0])),
                  key=lambda one: one[1].begin)
    found, latest = {}, None
    for key, row in mine:
        if latest and row.begin > latest[1].end:
            found[latest[0], key] = flight(ball, latest, key, row.begin, row.end - row.begin, bodies)
        if latest is None or math.isnan(row.end) or row.end > latest[1].end:
            latest = key, row
        if math.isnan(row.end):
            return found
    if latest and latest[1].end < end:
        found[latest[0], None] = flight(ball, latest, None, end, 0.0, bodies)
    return found


def flight(ball, latest, key, end, next_duration, bodies):
    row = latest[1]
    duration = max(row.end - row.begin, 0.0 if math.isnan(next_duration) else next_duration)
    return Flight(ball, latest[0], key, row.end, end, velocity_after(row, ball, bodies), duration)


def wrong_flights(hard, soft, judge, unit):
    """Long flights that differ by more than 0.01 U plus the acceleration times the lag, or are in the soft run only."""
    found = []
    fastest = max((abs(v) for row in (*hard, *soft) for v in row.before), default=0.0)
    acceleration = judge.scene.gravity + judge.scene.pendulum * fastest
    end = min(float(judge.carried.time[-1]), float(judge.soft.time[-1]))
    for ball in (b for b in range(judge.n) if not judge.walls[b]):
        one, other = (flights_of(rows, ball, judge.bodies, end) for rows in (hard, soft))
        for ends in one.keys() | other.keys():
            h, s = one.get(ends), other.get(ends)
            if h and s:
                long = min(h.end - h.begin, s.end - s.begin) > MIN_DURATIONS * s.contact_duration
                if long and abs(h.velocity - s.velocity) > 0.01 * unit[ball] + acceleration * abs(h.begin - s.begin):
                    found.append((h, s))
            elif s and None not in ends:
                fast = abs(s.velocity) > 0.01 * unit[ball]  # slower flights are bounces of balls that settle
                found += [(h, s)] * (fast and s.end - s.begin > MIN_DURATIONS * s.contact_duration)
    return found

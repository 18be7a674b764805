"""What states, queues and watches of hard runs must be at any time: functions that raise `AssertionError` where they
are not."""

import math

import numpy as np

from granular._engine.records import plain, record_array
from granular.edmd.compiled_queue import BlockQueue
from granular.edmd.motion import next_event_time
from granular.edmd.physics import rank
from granular.edmd.records import Walls
from granular.edmd.sorted_queue import LAST_ENTRY
from granular.edmd.watch import LAST_CONTACT_FIELDS


def events_of(queue):
    """Return time and rank of the next event of every pair of a queue, which must be in order."""
    if queue.name == "sorted":
        order, entry, _ = queue.queue
        assert list(order) == sorted([*(one for one in entry if one[0] < math.inf), LAST_ENTRY])
        return list(entry)
    tree = queue.queue.tolist()
    leaves, pairs = len(tree) // 2, len(queue.state.pairs)
    assert tree[1:leaves] == list(map(min, tree[2::2], tree[3::2])), "matches are not decided"
    return tree[leaves : leaves + pairs]


def check_queue(queue):
    """The queue is in order, and an event that of its pair except for rounding."""
    run, pairs, bodies = queue.state.run, plain(queue.state.pairs), plain(queue.state.bodies)
    walls = queue.state.walls
    walls = None if walls is None else Walls(plain(walls.sides), plain(walls.panels), walls.clock)
    for c, (time, key) in enumerate(events_of(queue)):
        due = queue.fit(next_event_time)(pairs[c], bodies[c], bodies[c + 1], walls)
        assert key == rank(c, run.order, run.seed, pairs[c].contacts), c
        assert math.isclose(time, due, rel_tol=1e-9, abs_tol=1e-12), (c, time, due)
    if isinstance(queue, BlockQueue):
        check_blocks(queue)


def check_blocks(queue):
    """Blocks neither leave out nor repeat a pair, and nothing outside a halo could be felt inside."""
    s, start = queue.state, max(queue.state.run.now, 0.0)
    speed, ends = queue._blocks(s.clock.window)
    gap, reach = s.row(start)[1], 2.0 * speed * (s.clock.window - start)
    kept = [c for first, last, _, _ in ends for c in range(first, last)]
    assert not ends or kept == list(range(len(s.pairs)))
    for first, last, low, high in ends:
        assert low == 0 or gap[low + 1 : first].sum() >= reach
        assert high == len(s.pairs) or gap[last : high - 1].sum() >= reach


def check_watch(watch):
    """What is known of the last contacts can be."""
    last = record_array(watch.last, LAST_CONTACT_FIELDS).copy()
    begun = np.isfinite(last["began"])
    last["lasting"][watch.instants] += 1.0 * begun[watch.instants]
    assert (last["lasting"][begun] > 0.0).all()
    assert not last["lasting"][~begun].any()
    assert last["disturbed"].sum() <= watch.disturbed <= watch.seen
    assert (watch.disturbed == 0) == (watch.first[1] < 0) == math.isnan(watch.first[0])

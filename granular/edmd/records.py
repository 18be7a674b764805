"""What a run of hard spheres knows of pairs, bodies and itself: records with names; why a queue hands control back.
May be skipped: how a run is held, no physics.
"""

from __future__ import annotations

import numpy as np

from granular.edmd import hanging
from granular.edmd.driven import OF_BODY, OF_PAIR

PAIR = np.dtype(
    [
        ("gap", float), ("at", float),  # m, at that time in s since the epoch
        ("pull", float),  # gravity's closing acceleration, m/s²
        ("hits", int), ("last", float),  # collisions so far, and the time of the last one not looked at closely in s
        ("streak", int),  # how often a collision in a row looked like a collapse
        ("low", float), ("high", float),  # shares of the lower and the upper body in a change of the rate
        ("eps", float),  # where rules are constant
    ],
    align=True,
)  # fmt: skip
BODY = np.dtype(
    [
        ("u", float),  # free-fall velocity of the epoch, m/s
        ("falls", float),  # 1 falls; 0 a wall, or a ball that rests on a wall
        ("noise", float),  # (m/s)², square of what rounding may have left in u
        ("mass", float),
    ],
    align=True,
)
NEAR = np.dtype([("gap", float), ("rate", float)])
"""Gap and rate of a pair that is looked at closely, m and m/s."""
RUN = np.dtype(
    [
        ("pairs", int), ("gravity", float), ("tc", float), ("elastic_below", float), ("merge_below", float),
        ("order", int), ("seed", int),  # of ties
        ("now", float), ("events", int), ("zoomed", int),  # tau of the last event; collisions, those in closer looks
        ("clamps", int), ("merged", int),  # gaps set to 0, collisions merged
        ("closed", float),  # m, the sum of the gaps where it never changes, else 0
        ("edge", float), ("budget", int),  # until when to go now, and for how many events at most
        ("stop_pair", int), ("stop_hits", int),  # pause before this pair, which has collided so often, collides again
        ("slow", float), ("short", float),  # what looks like a collapse, m/s (< 0: nothing does) and s
        ("suspect", int), ("rebound", float),  # the pair that collided last, in a closer look too; its rate after, m/s
        # a closer look
        ("first", int), ("began", float),  # the lowest pair; when it began, tau in s
        ("elapsed", float), ("looked", int),  # s and collisions since then
        ("ordinary", int),  # collisions in a row that did not look like a collapse
        ("clamped", int),  # gaps set to 0
        ("faint", int),  # how often in a row its speeds were found to count for nothing
        ("room", float),  # s since it began: when something outside happens
        ("allowance", int),  # collisions without a decision; doubled after each such look
    ],
    align=True,
)  # fmt: skip
"""Numbers that kernels know."""
CLOCK = np.dtype(
    [
        ("start", float), ("epoch", float), ("epoch_low", float),  # s: the first row; the zero of tau
        ("length", float),  # m, the mean gap at the start, the largest so far if driven
        ("window", float),  # s, 2^k, grows as balls slow down
        ("speed", float), ("fall", float),  # m/s, scale of relative velocities, never below what falling `length` gives
        ("strength", float),  # m/s², the largest acceleration of a ball
        ("rebases", int), ("zooms", int), ("lost", int),  # closer looks, and rates lost to rounding in them
        ("last_event", int),  # events at which the run ends
        ("goal", float), ("dated", int),  # s: until when kernels move the zero of tau themselves; rows they have dated
    ]
)  # fmt: skip
"""Numbers that they do not."""
DRIVEN_PAIR, DRIVEN_BODY, HUNG_PAIR, HUNG_BODY = (np.dtype(plain_one.descr + more, align=True) for plain_one, more in (
    (PAIR, OF_PAIR), (BODY, OF_BODY), (PAIR, hanging.OF_PAIR), (BODY, hanging.OF_BODY)))  # fmt: skip
NEVER, APART = -1, -2
"""`stop_pair` of a run that does not stop at a contact, and of one that stops when no pair approaches."""
LATER, UNTIL, BUDGET, SUSPECT, TOUCHING, OUTSIDE, QUIET, RESTS, TINY, SPENT = range(10)
"""Why a queue or a closer look hands control back. The next event is later than asked for; it is the contact to stop
at, or all pairs recede; as many events as asked for have acted. Of a queue: the last collisions look like a collapse;
a touching group is to collide as a whole. Of a closer look, for good: something outside the slice comes next; no
collapse; a ball has come to rest on a wall; rates below 2^-200 of the scale; no decision within the allowance."""

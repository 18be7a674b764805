"""Hard spheres: event-driven dynamics of balls on a line, with instantaneous collisions.
May be skipped: names of the package only.

`simulate` runs a scene, `resume` goes on with it. How it works, from the bottom up: `physics` (all that does not
change: the scene, the options, which of simultaneous collisions acts first), `records` and `state` (all that changes,
with its re-based clock, and how it is saved), `motion` (what one pair does), `collision` (one event) and `clusters`
(balls that stay together), `ties` (touching balls that collide as a whole), `sorted_queue` and `compiled_queue` (the
event loop, plain and compiled, there in blocks for large scenes), `zoom`, `collapse` and `proof` (a closer look at
what may be an inelastic collapse, and the verdict), `driven` and `wall_state` (walls that shake, or heat, forces),
`hanging` (pendula), `watch` (where soft contacts would disturb each other), `run` (all of it together, which queue
runs it, and the closing sentence), `simulation` (the public face).
"""

from granular.edmd.simulation import events, resume, simulate

__all__ = ["events", "resume", "simulate"]

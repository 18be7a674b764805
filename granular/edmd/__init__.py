"""Hard spheres: event-driven dynamics of balls on a line, with instantaneous collisions.
May be skipped: names of the package only.

`simulate` runs a scene, `resume` goes on with it. How it works, from the bottom up: `ties` (simultaneous ones: which
acts first, or all at once), `physics` (all that does not change: the scene and the options), `motion` (what one pair
does), `collision` (one event, and balls that stay together), `records` and `state` (all that changes, with its re-based
clock, and how it is saved), `groups` (touching balls that collide as a whole), `sorted_queue` and `compiled_queue` (the
event loop, plain and compiled, there in blocks for large scenes), `zoom`, `collapse` and `proof` (a closer look at what
may be an inelastic collapse, and the verdict), `driven`, `wall_state`, `clusters`, `driven_event` (walls that shake,
or heat, forces), `ring` and `hanging` (a closed line, pendula), `fit` (which kernels take the place of others), `watch`
(where soft contacts would disturb each other), `run` (all of it together, which queue runs it, and the closing
sentence), `simulation` (the public face).
"""

from granular.edmd.simulation import resume, simulate

__all__ = ["resume", "simulate"]

"""Hard spheres: event-driven dynamics of balls on a line, with instantaneous collisions.
May be skipped: names of the package only.

`simulate` runs a scene, `resume` goes on with it. How it works, from the bottom up: `ties` (which of simultaneous
collisions acts first), `physics` (all that does not change: the scene and the options), `motion` (what one pair does),
`collision` (one event, and balls that stay together), `records` and `state` (all that changes, with its re-based
clock), `groups` (touching balls that collide as a whole), `sorted_queue` and `tree_queue` (the event loop, plain and
compiled), `blocks` (the compiled one for large scenes), `zoom` and `collapse` (a closer look at what may be an
inelastic collapse, and the verdict), `driven`, `riding`, `as_one`, `parting` and `heating` (walls that shake or heat,
forces), `ring` and `hanging` (a closed line, pendula: kernels in place of others), `watch` (where soft contacts would
disturb each other), `run` (all of it together, and which queue runs it), `outcome` (the closing sentence),
`simulation` (the public face).
"""

from granular.edmd.simulation import resume, simulate

__all__ = ["resume", "simulate"]

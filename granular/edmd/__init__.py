"""Hard spheres: event-driven dynamics of balls on a line, with instantaneous collisions.

`simulate` runs a scene, `resume` goes on with it. How it works, from the bottom up: `motion` (what one pair does),
`ties`, `groups` and `touching` (simultaneous collisions: one by one, or a touching group as a whole), `merge` (balls
that stay together), `event` (one collision), `model` (all that does not change: the scene and the options), `state`
(all that does, with its re-based clock), `sorted_queue` and `tree_queue` (the event loop, plain and compiled), `blocks`
(the compiled one for large scenes), `zoom` and `collapse` (a closer look at what may be an inelastic collapse, and the
verdict), `run` (all of it together), `engines` and `simulation` (the public face), `outcome` (the closing sentence),
`older` (runs saved by releases before).
"""

from granular.edmd.simulation import resume, simulate

__all__ = ["resume", "simulate"]

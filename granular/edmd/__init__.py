"""Hard spheres: event-driven dynamics with instantaneous collisions.

`simulate` runs a scene, `resume` continues a run, and `events` yields the collisions of a run.

Start with: `motion`, `collision`, `sorted_queue`, `run`.
Support modules: `checkpoint`, `clusters`, `collapse`, `compiled_queue`, `driven`, `ending`, `epoch`, `hanging`,
`levels`, `physics`, `proof`, `queue_choice`, `records`, `simulation`, `state`, `ties`, `wall_state`, `watch`, `zoom`.
The module `motion` defines the terms that the docstrings of this package use.
"""

from granular.edmd.simulation import events, resume, simulate

__all__ = ["events", "resume", "simulate"]

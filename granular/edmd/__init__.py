"""Hard spheres: event-driven dynamics with instantaneous collisions.

`simulate` runs a scene, `resume` continues a run, `events` yields its events.

Main line: `motion`, `collision`, `sorted_queue`, `run`.
A first reader may skip: `clusters`, `collapse`, `compiled_queue`, `driven`, `ending`, `hanging`, `levels`, `physics`,
`proof`, `records`, `simulation`, `state`, `ties`, `wall_state`, `watch`, `zoom`.
"""

from granular.edmd.simulation import events, resume, simulate

__all__ = ["events", "resume", "simulate"]

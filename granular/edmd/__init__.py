"""Hard spheres: event-driven dynamics with instantaneous collisions.

`simulate` runs a scene, `resume` continues a run, and `events` yields the collisions of a run.

Start with: `motion`, `collision`, `sorted_queue`, `run`.
Support modules: `clusters`, `collapse`, `compiled_queue`, `driven`, `ending`, `hanging`, `levels`, `physics`,
`proof`, `records`, `simulation`, `state`, `ties`, `wall_state`, `watch`, `zoom`.

The docstrings of this package use these terms:

* *rate*: the rate of change of the gap of a pair in m/s. It is negative while the two bodies approach.
* *closing acceleration*: minus the second time derivative of a gap in m/s². It is positive if it closes the gap.
* *epoch*, *tau*: the records of a run store times in s since the epoch. Such a time is called tau. The epoch is moved
  forward from window to window, so late times keep their digits.
* *window*: the length of time in s after which the epoch is moved. It is a power of two.
* *fall velocity*: the velocity in m/s that a body in free flight has at the epoch.
* *noise*: an upper bound of the squared rounding error of a fall velocity, in m²/s².
* *stuck*: the bodies of a stuck pair touch and move with the same velocity.
* *relative coordinates*: the gaps and rates of neighbouring pairs (the *slice*) replace the velocities of their bodies
  while `zoom` examines a possible inelastic collapse.
"""

from granular.edmd.simulation import events, resume, simulate

__all__ = ["events", "resume", "simulate"]

"""Event-located soft spheres: a step is a polynomial, an event is its first root.
May be skipped: names of the package only.

`Run` follows one scene, `many.solve_many` a map of small ones in a single compiled call.
"""

from granular.md.located.run import Run

__all__ = ["Run"]

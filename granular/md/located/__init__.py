"""Event-located soft spheres: a step is a polynomial, an event is its first root.

`run` follows one scene, `solve_many` a map of small ones in a single compiled call.
"""

from granular.md.located.batch import Many, solve_many
from granular.md.located.run import run

__all__ = ["Many", "run", "solve_many"]

"""One scene under both engines: `compare(scene, law) -> Comparison`. May this scene be event-driven?

=============  =====================================================================================================
`run`          `compare`, and `Comparison` as people have it
`numbers`      both runs, and the numbers that tell them apart
`law_rule`     the collision rule that force laws make
`verdict`      the answer in one line
`report`       the table, and JSON
`figure`       timelines, forces and world lines
`film`         both engines side by side in slow motion
`effective`    the ε with which hard spheres give what soft spheres gave
=============  =====================================================================================================
"""

from granular.comparison.law_rule import LawRule
from granular.comparison.run import Comparison, compare

__all__ = ["Comparison", "LawRule", "compare"]

"""One scene under both engines: `compare(scene, law) -> Comparison`. May this scene be event-driven?
May be skipped: names of the package only.

=============  =====================================================================================================
`run`          `compare`, and `Comparison` as people have it
`numbers`      both runs, and the numbers that tell them apart
`checks`       hard runs under other tie rules and from shifted gaps: whether there is one answer
`further`      both runs again, and past their stop: how high a ball rises, the ε that gives another outcome
`answer`       the answer as a value, and the reasons of every component
`report`       the table, and what JSON has of it
`view`         which span of time is drawn, a lens on one pair, and the scene in words
`against`      a run of another program
`remedies`     remedies for an inelastic collapse
`figure`       timelines, forces and world lines
`film`         both engines side by side in slow motion
=============  =====================================================================================================
"""

from typing import TYPE_CHECKING

from granular._engine.lazy import attributes

if TYPE_CHECKING:
    from granular.comparison.answer import Answer, Reason
    from granular.comparison.run import Comparison, compare
    from granular.md.binary import LawRule

__all__ = ["Answer", "Comparison", "LawRule", "Reason", "compare"]
__dir__ = __all__.copy
__getattr__ = attributes(__name__, {
    "granular.md.binary": "LawRule",
    "granular.comparison.answer": "Answer Reason",
    "granular.comparison.run": "Comparison compare",
})

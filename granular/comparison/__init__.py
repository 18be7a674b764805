"""Run one scene as hard and as soft spheres, and decide whether they agree.

Start with: `run`, `answer`.
Support modules: `against`, `align`, `episodes`, `figure`, `film`, `further`, `input_warnings`, `measures`,
`numbers`, `outcome`, `reason_texts`, `remedies`, `report`, `view`, `zoom`.
"""

from typing import TYPE_CHECKING

from granular._engine.package import attributes

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

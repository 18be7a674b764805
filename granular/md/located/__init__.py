"""Event-located integration of soft spheres by polynomial steps.

A step is a polynomial, and an event is its first root.

Main line: `pieces`, `series`, `plan`, `blocks`, `one_contact/`, `run`.
A first reader may skip: `checkpoint`, `collocation`, `contacts`, `ending`, `islands`, `jumps`, `ledger`,
`levels`, `log`, `many`, `modes`, `own_law`, `pace`, `pendula`, `power_form`, `records`, `rest/`, `restore`,
`step_size`, `system`, `walls`.
"""

from granular.md.located.run import Run

__all__ = ["Run"]

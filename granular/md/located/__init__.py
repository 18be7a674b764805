"""Event-located integration of soft spheres by polynomial steps.

A step is a polynomial in time, a *piece*, and an event is its first root.

Start with: `pieces`, `series`, `plan`, `blocks`, `one_contact/`, `run`.
Support modules: `checkpoint`, `collocation`, `contacts`, `ending`, `islands`, `jumps`, `ledger`, `levels`, `log`,
`many`, `modes`, `numbering`, `own_law`, `pace`, `peaks`, `pendula`, `power_form`, `records`, `rest/`, `restore`,
`step_size`, `system`, `walls`.

Parameters with the same meaning in all modules: `s` is the `System` of all records, with `run` (counters and the
current event), `pairs`, `bodies` and `pool` (records of pairs in islands). `c` is the number of a pair. `lo` … `hi`-1
are the pairs of an island or block, `block` is the pool record of pair `lo`, and `pair` or `member` the record of one
pair. `t` + `tail` is a time in s since the start of the run, as the sum of two floats. `laws` is the `Collocation` of
general laws, or None if every law is a power form.
"""

from granular.md.located.run import Run

__all__ = ["Run"]

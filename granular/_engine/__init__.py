"""Kernels, records, roots, argument checks and files that all rooms use.

Modules of this room do not depend on scenes, laws or engines.

Main line: `flight`.
A first reader may skip: `check`, `compiler_state`, `describe`, `files`, `kernels`, `numba_pipeline`, `package`,
`progress`, `records`, `reports`, `roots`, `signature`.
"""

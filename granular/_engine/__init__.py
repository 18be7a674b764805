"""Kernels, records, roots, argument checks and files that all rooms use.

Nothing here knows scenes, laws or engines.

Main line: `flight`.
A first reader may skip: `check`, `describe`, `files`, `kernels`, `numba_pipeline`, `package`, `progress`,
`records`, `reports`, `roots`, `signature`.
"""
